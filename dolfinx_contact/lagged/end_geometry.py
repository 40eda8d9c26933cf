# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The geometry of a step: whether its way can be followed, and how far it is from that with which the step was solved.

A step is solved with a tangent plane, arms and a way along the surface for each node.  They are exact at one position.
What is missed at the end counts as force: a length times the stiffness of its node, an angle times the reaction, an arm
times the reaction over the largest arm.  On deformable surfaces, whose rows are exact for one displacement, it is the forces on both
bodies that those of the end would make.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.contact.interface import NodalStiffness
from dolfinx_contact.contact.placement import LONGEST
from dolfinx_contact.step.staggered import Change, Lagged
from dolfinx_contact.support.anderson import Anderson
from dolfinx_contact.support.attributes import surfaces_of
from dolfinx_contact.support.checks import place
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.surfaces.surface import cross, rotation_less_one

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.placement import Placement
    from dolfinx_contact.contact.state import State
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep
    from dolfinx_contact.surfaces.surface import Surface

# How often a step is repeated with the geometry of its end.
REPEATED = 5

# The same with deformable surfaces, and differences of ends that are mixed.
RENEWED, MIXED = 24, 5

# Radians by which a normal may turn along the way of a step, and in how many places it is looked at.
TURNED, PLACES = 0.5, 32


class EndGeometry(Lagged):
    """Frames, gaps and ways: those of the displacement at which the step has ended.

    Args:
        body: The body.
        contacts: All contacts.
        tol: Largest error of the geometry.
        step_at: The step with frames of a displacement, from the step before.
    """

    def __init__(
        self,
        body: ElasticBody,
        contacts: Sequence[Contact],
        tol: float,
        step_at: Callable[[LoadStep, np.ndarray], LoadStep],
    ):
        self._body, self._contacts, self._tol, self._step_at = body, contacts, tol, step_at
        self._ends, self._repeated = Ends(body, contacts), 0
        self.limit = self._ends.most

    def change(self, step: LoadStep, found: SolverResult, goal: float) -> Change:
        both = [two for two in zip(self._contacts, step.stiffness) if two[0].changes]
        if not both:
            return Change(True, step)
        contacts, stiffness = map(list, zip(*both))
        refused = "" if self._repeated else too_long(self._body, contacts, found.x)
        acting = step.carried(self._tol)
        missed = geometry_error(self._body, contacts, stiffness, found.x, acting)
        return Change(missed <= self._tol, step, missed, refused=refused)

    def renewed(self, step: LoadStep, found: SolverResult) -> LoadStep:
        self._repeated += 1
        for surface in surfaces_of(self._contacts):
            surface.end_step()
        placed = [contact.placement.now for contact in self._contacts]
        for contact in self._contacts:
            contact.restore()
        step = self._step_at(step, self._ends.after(found.x))
        for contact, before in zip(self._contacts, placed):
            contact.placement.count_as(before)
        return step

    def not_settled(self, change: Change) -> str:
        return undivided(change.size, self._tol, self._repeated)


class Ends:
    """Displacements, and poses of surfaces, whose geometry a step is repeated with: those at which it has ended.

    After the first one, they are mixed by Anderson's method where they answer to the geometry: rows on deformable surfaces follow the
    displacement of facets, which in soft bodies follows the rows nearly as far; a platen that turns freely, and pushes a slender body
    aside by that, tilts to and fro.

    Attributes:
        most: How often a step is repeated.
    """

    def __init__(self, body: ElasticBody, contacts: Sequence[Contact]):
        renewed = any(c.surface.deformable and c.changes for c in contacts)
        self.most = RENEWED if renewed else REPEATED
        self._turning = surfaces_of(c for c in contacts if c.surface.spins)
        self._arm, self._mix, self._at = body.extent, None, None
        if renewed or self._turning:
            size = body.size + sum(pose.size for pose in self._poses())
            self._mix = Anderson(size, MIXED, body.total)

    def _poses(self) -> list[np.ndarray]:
        """Displacement and rotation of each surface that turns freely, as lengths."""
        return [np.append(s.displacement, self._arm * s.rotation) for s in self._turning]

    def after(self, x: np.ndarray) -> np.ndarray:
        """The next one, after a solution with the last one ended at ``x``, owned degrees of freedom; surfaces take their poses.  Collective."""
        at, self._at = self._at, np.concatenate((x, *self._poses()))
        if at is not None and self._mix is not None:
            self._at = self._mix.step(at, self._at - at)[0]
            first = x.size
            for surface in self._turning:
                size, angles = surface.point.size, surface.rotation.size
                pose, first = self._at[first : first + size + angles], first + size + angles
                surface.displacement = pose[:size]
                surface.turn_to(pose[size:] / self._arm)
        return self._at[: x.size]


def geometry_error(
    body: ElasticBody,
    contacts: Sequence[Contact],
    stiffness: list[NodalStiffness],
    u: np.ndarray,
    S: float,
) -> float:
    """Forces by which the geometry at the end of a step differs from that used, over the reactions.  Collective.

    Args:
        body: The body.
        contacts: Those whose geometry changes; in the state of ``u``.
        stiffness: Of their nodes.
        u: Displacement of owned degrees of freedom.
        S: Norm of the reactions.
    """
    squares = np.zeros(3)
    for contact, of in zip(contacts, stiffness):
        if contact.surface.deformable:
            missed = _missed_by_rows(contact, of, u, body.fixed)
        else:
            with raised_together(body.comm):  # the user's functions
                missed = _missed(contact, of, u)
        squares += [np.square(force).sum() for force in missed]
    parts = [*np.sqrt(body.total(squares)), *_moments(body, contacts, u)]
    left = float(max(parts))
    return left / S if S > 0.0 else (np.inf if left > 0.0 else 0.0)


def _missed(contact: Contact, stiffness: NodalStiffness, u: np.ndarray) -> tuple[np.ndarray, ...]:
    """Of gaps, normals with textures, and ways, as forces on each node, ``shape=(n,)``."""
    placement, r = contact.placement, contact.reaction
    surface, there = placement.ended_at(u)
    y = surface.relative(there)
    own, distance = surface.frames(y), surface.distance(y)
    size, friction = np.linalg.norm(r, axis=1), np.linalg.norm(r[:, :-1], axis=1)
    turned = surface.turned(own)[..., -1, :] - contact.frame[..., -1, :]
    angle = np.linalg.norm(np.atleast_2d(turned), axis=1)
    way = placement.way(surface, y, own, distance, contact.settled)
    missed = way - (0.0 if placement.now.way is None else placement.now.way)
    return (
        _pressed(contact, stiffness, distance + contact.opening, contact.points.closed),
        np.hypot(size * angle, friction * contact.axes_turned(y, own)),
        _dragged(contact, stiffness, missed),
    )


def _missed_by_rows(
    contact: Contact, stiffness: NodalStiffness, u: np.ndarray, fixed: np.ndarray
) -> tuple:
    """The same on a deformable surface; forces of its nodes, too, in the place of normals.  Collective."""
    ended = contact.placement.ended(contact.present, u)
    ended.forces[fixed] = 0.0
    friction = np.linalg.norm(contact.reaction[:, :-1], axis=1)
    came = contact.points.alone & ~ended.alone  # opposite something at the end alone
    with raised_together(contact.comm):  # the user's functions
        turned = friction * contact.axes_turned(ended.home, ended.frame, ended.points)
    turned[ended.alone] = 0.0
    return (
        _pressed(
            contact,
            stiffness,
            ended.gap + contact.opening_at(ended.points),
            contact.points.closed & ~came,
        ),  # fmt: skip
        np.append(ended.forces, turned),
        _dragged(contact, stiffness, ended.slip),
    )


def _pressed(
    contact: Contact, stiffness: NodalStiffness, exact: np.ndarray, closed: np.ndarray
) -> np.ndarray:
    """Normal forces that gaps at the end of a step, ``shape=(n,)``, would make beside those used, but at ``closed`` nodes."""
    presses = contact.reaction[:, -1] > 0.0
    off = np.where(presses, np.abs(exact - contact.present.gap), np.maximum(-exact, 0.0))
    off[closed] = 0.0
    return stiffness.normal * off


def _dragged(contact: Contact, stiffness: NodalStiffness, missed: np.ndarray) -> np.ndarray:
    """By how much ways that slips lack, ``shape=(n, gdim - 1)``, would change friction."""
    contact.points.without_held(missed)
    made = np.linalg.norm(np.einsum("nij,nj->ni", stiffness.tangential, missed), axis=1)
    # Friction of what slips turns at most as its slip does.
    slip = np.linalg.norm(contact.slip_increment, axis=1)
    friction = np.linalg.norm(contact.reaction[:, :-1], axis=1)
    length = np.linalg.norm(missed, axis=1)
    turns = np.divide(friction * length, slip, made.copy(), where=slip > 0.0)
    return np.where(friction > 0.0, np.minimum(made, turns), 0.0)


def _moments(body: ElasticBody, contacts: Sequence[Contact], u: np.ndarray) -> list[float]:
    """Of moments about the points of surfaces that turn, over their largest arm.  Collective."""
    missed = []
    for surface in surfaces_of(c for c in contacts if c.surface.spins):
        sums, arms = np.zeros(surface.rotation.size), [np.zeros(1)]
        for contact in contacts:
            if contact.surface is surface:
                _, there = contact.placement.ended_at(u)
                used = contact.arms
                off = there - surface.point - surface.displacement - used
                forces = np.einsum("ni,nij->nj", contact.reaction, contact.points.frames)
                turning = np.eye(sums.size)
                sums += [(cross(axis, off) * forces).sum() for axis in turning]
                arms.append(np.linalg.norm(used, axis=1))
        largest = body.largest(np.concatenate(arms))
        moment = float(np.linalg.norm(body.total(sums)))
        missed.append(moment / largest if largest > 0.0 else 0.0)
    return missed


def too_long(body: ElasticBody, contacts: Sequence[Contact], u: np.ndarray) -> str:
    """Where the way of a step cannot be followed, in words; empty where it can.  Collective.

    The nearest point of the surface is followed along the way of node and surface, from where the node touches to where it
    opens.  Its frame must not turn by more than half a radian, about the normal either: then the way is shorter than half of the least radius, and
    the side of the surface stays.

    Args:
        body: The body.
        contacts: Those whose geometry changes; in the state of ``u``.
        u: Displacement of owned degrees of freedom.
    """
    for contact in [c for c in contacts if c.surface.deformable and body.nonlinear]:
        turned = contact.placement.twist(u)
        if turned > LONGEST:
            return (
                f"the step is too long: two bodies turn against each other by {turned:.2g} radians in it, {LONGEST:g} is the most. Divide the step, "
                "or let dc.advance do so"
            )
    lost = [(2.0, "")]
    for contact in [c for c in contacts if not c.surface.deformable]:
        with raised_together(body.comm):  # the user's functions
            turned = _turned_on_the_way(contact, u)
        some = np.flatnonzero((turned > TURNED).any(axis=0))
        if some.size:
            first = (turned > TURNED)[:, some].argmax(axis=0)
            node = some[first.argmin()]
            at = place(contact.x[:, : contact.points.dim], int(node))
            lost.append((float(first.min()) / PLACES, f"{at} on {contact.surface!r}"))
    part, at = min(body.comm.allgather(min(lost)))
    if part > 1.0:
        return ""
    return (
        f"the step is too long: after {part:.2g} of it the contact node at {at} has gone so far along the surface, or the "
        f"surface has turned so far about its normal there, that the local frame has turned by {TURNED:g} radians. Divide the step, or let dc.advance do so"
    )


def undivided(missed: float, tol: float, repeated: int) -> str:
    """What to say of a step whose geometry stays different, in words."""
    other = "; if that does not help, let the other body carry the unknowns" * (repeated == RENEWED)
    return (
        f"distances, normals or arms at the end of the step differ by {missed:.1e} of the reactions from those with which it was "
        f"solved, after {repeated} repetitions, geometry_tol is {tol:.1e}: the increment is too large for its surface. Divide "
        f"it, or let dc.advance do so{other}"
    )


def _turned_on_the_way(contact: Contact, u: np.ndarray) -> np.ndarray:
    """By how much each node's normal has turned along the way since it touched, ``shape=(PLACES + 1, n)``, radians."""
    placement = contact.placement
    surface, there = placement.ended_at(u)
    count, dim = there.shape
    if not count:
        return np.zeros((PLACES + 1, 0))
    y = _way(surface, placement, contact.settled, surface.relative(there))
    flat = y.reshape(-1, dim)
    normals, distance = _looked_at(surface, flat)
    normals, touches = normals.reshape(y.shape), distance.reshape(-1, count) < 0.0
    touches[0] |= contact.last.reaction[:, -1] > 0.0
    touches[-1] |= contact.reaction[:, -1] > 0.0
    touches[:, contact.points.closed] = False
    touched = np.logical_or.accumulate(touches)[:-1]
    opens = np.logical_or.accumulate(touches[::-1])[::-1][1:]
    bends = np.linalg.norm(np.diff(normals, axis=0), axis=2)
    bends[np.isnan(bends)] = np.pi  # through a place without a normal, such as a centre
    if dim == 3:  # and about the normal
        bends = np.hypot(bends, (normals[-1] @ placement.turned_to(surface)) / PLACES)
    within = touched & opens
    return np.concatenate((np.zeros((1, count)), np.cumsum(np.where(within, bends, 0.0), axis=0)))


def _looked_at(surface: Surface, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals and distances at positions; NaN where there are none."""
    try:
        return np.broadcast_to(surface.frames(y)[..., -1, :], y.shape), surface.distance(y)
    except ValueError:
        if len(y) == 1:
            return np.full(y.shape, np.nan), np.full(1, np.nan)
        halves = [_looked_at(surface, part) for part in np.array_split(y, 2)]
        return tuple(map(np.concatenate, zip(*halves)))


def _way(surface: Surface, placement: Placement, last: State, end: np.ndarray) -> np.ndarray:
    """Positions along the way, relative to the surface, in its axes, ``shape=(PLACES + 1, n, gdim)``.

    In space nodes go straight, and the surface moves and turns evenly.
    """
    turned = placement.turned_to(surface)
    start, end = placement.started(last) - surface.point, end - surface.point
    parts = np.linspace(0.0, 1.0, PLACES + 1)
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
