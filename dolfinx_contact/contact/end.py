# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Nodal forces due to errors of the contact geometry in a step; paths of nodes on rigid surfaces.

An error of length is multiplied by the stiffness of its node, an error of angle by the reaction.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.support.checks import place
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.surfaces.surface import rotation_less_one

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.rigid import RigidGeometry
    from dolfinx_contact.contact.state import History, State
    from dolfinx_contact.surfaces.surface import Surface

# Largest turn of a local frame along the path of a node in a step, radians: the path is then
# shorter than half of the radius of curvature.
LARGEST_TURN = 0.5

# Number of intervals in which the path of a step is divided to find this turn.
PLACES_ON_WAY = 32


def pressed(
    contact: ContactStep, state: State, exact: np.ndarray, closed: np.ndarray
) -> np.ndarray:
    """Return the normal forces due to errors of the gaps in a step, ``shape=(n,)``.

    Args:
        contact: The contact in the step.
        state: State at the end of the step.
        exact: Gaps with the geometry at the end of the step, ``shape=(n,)``, length.
        closed: Nodes that never touch, whose errors are zero, ``shape=(n,)``, booleans.
    """
    presses = state.reaction[:, -1] > 0.0
    off = np.where(presses, np.abs(exact - state.gap), np.maximum(-exact, 0.0))
    off[closed] = 0.0
    return contact.stiffness.normal * off


def dragged(contact: ContactStep, state: State, missed: np.ndarray) -> np.ndarray:
    """Return the changes of friction due to errors of the slips in a step, ``shape=(n,)``, force.

    Args:
        contact: The contact in the step.
        state: State at the end of the step.
        missed: Errors of the slips, ``shape=(n, gdim - 1)``, local frame, length; changed in place.
    """
    contact.points.remove_constrained(missed)
    made = np.linalg.norm(np.einsum("nij,nj->ni", contact.stiffness.tangential, missed), axis=1)
    # The direction of friction of a slipping node changes at most as much as that of its slip.
    slip = np.linalg.norm(state.slip_increment, axis=1)
    friction = np.linalg.norm(state.reaction[:, :-1], axis=1)
    length = np.linalg.norm(missed, axis=1)
    turns = np.divide(friction * length, slip, made.copy(), where=slip > 0.0)
    return np.where(friction > 0.0, np.minimum(made, turns), 0.0)


def missed_on_rigid(
    geometry: RigidGeometry, contact: ContactStep, state: State, u: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return errors of gaps, of normals with friction axes, and of path lengths on a rigid surface.

    They are forces on each node, ``shape=(n,)`` each.
    """
    r, frames = state.reaction, contact.frames
    with raised_together(contact.comm):  # the user's functions
        surface, there = geometry.ended_at(u)
        y = surface.relative(there)
        own, distance = surface.frames(y), surface.distance(y)
        size, friction = np.linalg.norm(r, axis=1), np.linalg.norm(r[:, :-1], axis=1)
        turned = surface.turned(own)[..., -1, :] - frames.frame[..., -1, :]
        angle = np.linalg.norm(np.atleast_2d(turned), axis=1)
        way = geometry.way(surface, y, own, distance, contact.given.history)
        missed = way - (0.0 if frames.way is None else frames.way)
        turning = contact.given.laws.turned(contact, y, own)
    return (
        pressed(contact, state, distance + contact.opening, contact.points.closed),
        np.hypot(size * angle, friction * turning),
        dragged(contact, state, missed),
    )


def too_long_on_rigid(
    geometry: RigidGeometry, contact: ContactStep, state: State, u: np.ndarray
) -> tuple[float, str]:
    """Return the fraction of a step up to which the nodes' paths can be followed, and the reason.

    The fraction exceeds 1 if all paths can be followed.  The nearest point of the surface is
    followed along the path of node and surface, from where the node touches to where it opens.  The
    local frame must not turn by more than half a radian, also not about the normal.  Then the path
    is shorter than half of the smallest radius of curvature, and the node stays on the same side of
    the surface.
    """
    with raised_together(contact.comm):  # the user's functions
        turned = _turn_along_path(geometry, contact, state, u)
    some = np.flatnonzero((turned > LARGEST_TURN).any(axis=0))
    if not some.size:
        return 2.0, ""
    first = (turned > LARGEST_TURN)[:, some].argmax(axis=0)
    part = float(first.min()) / PLACES_ON_WAY
    at = place(contact.x[:, : contact.points.dim], int(some[first.argmin()]))
    return part, (
        f"after {part:.2g} of it the contact node at {at} on {contact.surface!r} has gone so far along the surface, or the "
        f"surface has turned so far about its normal there, that the local frame has turned by {LARGEST_TURN:g} radians"
    )


def _turn_along_path(
    geometry: RigidGeometry, contact: ContactStep, state: State, u: np.ndarray
) -> np.ndarray:
    """Return the turn of each node's frame along its path since it touched, radians.

    The array has ``shape=(PLACES_ON_WAY + 1, n)``.
    """
    surface, there = geometry.ended_at(u)
    count, dim = there.shape
    if not count:
        return np.zeros((PLACES_ON_WAY + 1, 0))
    y = _path(surface, geometry, contact.given.history, surface.relative(there))
    flat = y.reshape(-1, dim)
    normals, distance = _normals_and_distances(surface, flat)
    normals, touches = normals.reshape(y.shape), distance.reshape(-1, count) < 0.0
    touches[0] |= contact.last.reaction[:, -1] > 0.0
    touches[-1] |= state.reaction[:, -1] > 0.0
    touches[:, contact.points.closed] = False
    touched = np.logical_or.accumulate(touches)[:-1]
    opens = np.logical_or.accumulate(touches[::-1])[::-1][1:]
    bends = np.linalg.norm(np.diff(normals, axis=0), axis=2)
    bends[np.isnan(bends)] = np.pi  # through a place without a normal, such as a centre
    if dim == 3:  # and about the normal
        turned = geometry.rotation_since_last_step(surface, contact.given.history)
        bends = np.hypot(bends, (normals[-1] @ turned) / PLACES_ON_WAY)
    within = touched & opens
    return np.concatenate((np.zeros((1, count)), np.cumsum(np.where(within, bends, 0.0), axis=0)))


def _normals_and_distances(surface: Surface, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return normals and distances at positions, NaN where the surface cannot be evaluated."""
    try:
        return np.broadcast_to(surface.frames(y)[..., -1, :], y.shape), surface.distance(y)
    except ValueError:
        if len(y) == 1:
            return np.full(y.shape, np.nan), np.full(1, np.nan)
        halves = [_normals_and_distances(surface, part) for part in np.array_split(y, 2)]
        return tuple(map(np.concatenate, zip(*halves)))


def _path(
    surface: Surface, geometry: RigidGeometry, history: History, end: np.ndarray
) -> np.ndarray:
    """Return positions along the paths of the nodes, relative to the surface, in its axes.

    The array has ``shape=(PLACES_ON_WAY + 1, n, gdim)``.  In space, nodes move on straight lines,
    and the surface moves and rotates uniformly.
    """
    turned = geometry.rotation_since_last_step(surface, history)
    start, end = geometry.started(history) - surface.point, end - surface.point
    parts = np.linspace(0.0, 1.0, PLACES_ON_WAY + 1)
    if not turned.any():
        return surface.point + start + parts[:, None, None] * (end - start)
    first = start + start @ rotation_less_one(-turned).T
    places = []
    for part in parts:
        straight = first + part * (end - first)
        back = (
            rotation_less_one((1.0 - part) * turned) if part < 1.0 else 0.0 * np.eye(end.shape[1])
        )
        places.append(surface.point + straight + straight @ back.T)
    return np.array(places)
