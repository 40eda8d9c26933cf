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
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.placement import Placement
    from dolfinx_contact.contact.state import History, State
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep, StepState
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
        step: The step.
        tol: Largest error of the geometry.
        step_at: The step with frames of a displacement, from the step before.
    """

    def __init__(
        self, step: LoadStep, tol: float, step_at: Callable[[LoadStep, np.ndarray], LoadStep]
    ):
        self._tol, self._step_at = tol, step_at
        self._ends = Ends(step.body, [contact.given for contact in step.contacts])
        self._repeated, self.limit = 0, self._ends.most

    def change(self, found: SolverResult, goal: float) -> Change:
        state = found.state
        if not any(contact.given.changes for contact in state.step.contacts):
            return Change(True, state)
        state.step.place_surfaces(state)
        refused = "" if self._repeated else too_long(state)
        missed = geometry_error(state, state.step.reaction_scale(state, self._tol))
        return Change(missed <= self._tol, state, missed, refused=refused)

    def renewed(self, step: LoadStep, state: StepState) -> LoadStep:
        self._repeated += 1
        step.place_surfaces(state)
        for surface in surfaces_of(step.contacts):
            surface.end_step()
        return self._step_at(step, self._ends.after(state.x))

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


def geometry_error(state: StepState, S: float) -> float:
    """Forces by which the geometry at the end of a step differs from that used, over the reactions.  Collective.

    Args:
        state: The state, with surfaces where it has them.
        S: Norm of the reactions.
    """
    body, squares = state.step.body, np.zeros(3)
    for contact, nodes in _changing(state):
        if contact.surface.deformable:
            missed = _missed_by_rows(contact, nodes, state.x, body.fixed)
        else:
            with raised_together(body.comm):  # the user's functions
                missed = _missed(contact, nodes, state.x)
        squares += [np.square(force).sum() for force in missed]
    parts = [*np.sqrt(body.total(squares)), *_moments(state)]
    left = float(max(parts))
    return left / S if S > 0.0 else (np.inf if left > 0.0 else 0.0)


def _changing(state: StepState) -> list[tuple[ContactStep, State]]:
    """Contacts whose geometry changes in the step, with their nodes."""
    both = zip(state.step.contacts, state.nodes)
    return [(contact, nodes) for contact, nodes in both if contact.given.changes]


def _missed(contact: ContactStep, state: State, u: np.ndarray) -> tuple[np.ndarray, ...]:
    """Of gaps, normals with textures, and ways, as forces on each node, ``shape=(n,)``."""
    placement, r, frames = contact.given.placement, state.reaction, contact.frames
    surface, there = placement.ended_at(u)
    y = surface.relative(there)
    own, distance = surface.frames(y), surface.distance(y)
    size, friction = np.linalg.norm(r, axis=1), np.linalg.norm(r[:, :-1], axis=1)
    turned = surface.turned(own)[..., -1, :] - frames.frame[..., -1, :]
    angle = np.linalg.norm(np.atleast_2d(turned), axis=1)
    way = placement.way(surface, y, own, distance, contact.given.history)
    missed = way - (0.0 if frames.way is None else frames.way)
    return (
        _pressed(contact, state, distance + contact.opening, contact.points.closed),
        np.hypot(size * angle, friction * contact.given.laws.turned(contact, y, own)),
        _dragged(contact, state, missed),
    )


def _missed_by_rows(
    contact: ContactStep, state: State, u: np.ndarray, fixed: np.ndarray
) -> tuple[np.ndarray, ...]:
    """The same on a deformable surface; forces of its nodes, too, in the place of normals.  Collective."""
    ended = contact.given.placement.end_of(contact.frames, state, u)
    ended.forces[fixed] = 0.0
    friction = np.linalg.norm(state.reaction[:, :-1], axis=1)
    came = contact.points.alone & ~ended.alone  # opposite something at the end alone
    with raised_together(contact.comm):  # the user's functions
        turned = friction * contact.given.laws.turned(
            contact, ended.home, ended.frame, ended.points
        )
    turned[ended.alone] = 0.0
    given = contact.given
    opening = given.placement.opening(ended.points, given.history, contact.depth)
    closed = contact.points.closed & ~came
    return (
        _pressed(contact, state, ended.gap + opening, closed),
        np.append(ended.forces, turned),
        _dragged(contact, state, ended.slip),
    )


def _pressed(
    contact: ContactStep, state: State, exact: np.ndarray, closed: np.ndarray
) -> np.ndarray:
    """Normal forces that gaps at the end of a step, ``shape=(n,)``, would make beside those used, but at ``closed`` nodes."""
    presses = state.reaction[:, -1] > 0.0
    off = np.where(presses, np.abs(exact - state.gap), np.maximum(-exact, 0.0))
    off[closed] = 0.0
    return contact.stiffness.normal * off


def _dragged(contact: ContactStep, state: State, missed: np.ndarray) -> np.ndarray:
    """By how much ways that slips lack, ``shape=(n, gdim - 1)``, would change friction."""
    contact.points.without_held(missed)
    made = np.linalg.norm(np.einsum("nij,nj->ni", contact.stiffness.tangential, missed), axis=1)
    # Friction of what slips turns at most as its slip does.
    slip = np.linalg.norm(state.slip_increment, axis=1)
    friction = np.linalg.norm(state.reaction[:, :-1], axis=1)
    length = np.linalg.norm(missed, axis=1)
    turns = np.divide(friction * length, slip, made.copy(), where=slip > 0.0)
    return np.where(friction > 0.0, np.minimum(made, turns), 0.0)


def _moments(state: StepState) -> list[float]:
    """Of moments about the points of surfaces that turn, over their largest arm.  Collective."""
    missed, body, changing = [], state.step.body, _changing(state)
    for surface in surfaces_of(contact for contact, _ in changing if contact.surface.spins):
        sums, arms = np.zeros(surface.rotation.size), [np.zeros(1)]
        for contact, nodes in changing:
            if contact.surface is surface:
                _, there = contact.given.placement.ended_at(state.x)
                used = contact.frames.arms
                off = there - surface.point - surface.displacement - used
                forces = np.einsum("ni,nij->nj", nodes.reaction, contact.points.frames)
                turning = np.eye(sums.size)
                sums += [(cross(axis, off) * forces).sum() for axis in turning]
                arms.append(np.linalg.norm(used, axis=1))
        largest = body.largest(np.concatenate(arms))
        moment = float(np.linalg.norm(body.total(sums)))
        missed.append(moment / largest if largest > 0.0 else 0.0)
    return missed


def too_long(state: StepState) -> str:
    """Where the way of a step cannot be followed, in words; empty where it can.  Collective.

    The nearest point of the surface is followed along the way of node and surface, from where the node touches to where it
    opens.  Its frame must not turn by more than half a radian, about the normal either: then the way is shorter than half of the least radius, and
    the side of the surface stays.
    """
    body, changing = state.step.body, _changing(state)
    for contact in [c for c, _ in changing if c.surface.deformable and body.nonlinear]:
        turned = contact.given.placement.twist(state.x, state.step.last)
        if turned > LONGEST:
            return (
                f"the step is too long: two bodies turn against each other by {turned:.2g} radians in it, {LONGEST:g} is the most. Divide the step, "
                "or let dc.advance do so"
            )
    lost = [(2.0, "")]
    for contact, nodes in [both for both in changing if not both[0].surface.deformable]:
        with raised_together(body.comm):  # the user's functions
            turned = _turned_on_the_way(contact, nodes, state.x)
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


def _turned_on_the_way(contact: ContactStep, state: State, u: np.ndarray) -> np.ndarray:
    """By how much each node's normal has turned along the way since it touched, ``shape=(PLACES + 1, n)``, radians."""
    placement = contact.given.placement
    surface, there = placement.ended_at(u)
    count, dim = there.shape
    if not count:
        return np.zeros((PLACES + 1, 0))
    y = _way(surface, placement, contact.given.history, surface.relative(there))
    flat = y.reshape(-1, dim)
    normals, distance = _looked_at(surface, flat)
    normals, touches = normals.reshape(y.shape), distance.reshape(-1, count) < 0.0
    touches[0] |= contact.last.reaction[:, -1] > 0.0
    touches[-1] |= state.reaction[:, -1] > 0.0
    touches[:, contact.points.closed] = False
    touched = np.logical_or.accumulate(touches)[:-1]
    opens = np.logical_or.accumulate(touches[::-1])[::-1][1:]
    bends = np.linalg.norm(np.diff(normals, axis=0), axis=2)
    bends[np.isnan(bends)] = np.pi  # through a place without a normal, such as a centre
    if dim == 3:  # and about the normal
        turned = placement.turned_to(surface, contact.given.history)
        bends = np.hypot(bends, (normals[-1] @ turned) / PLACES)
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


def _way(surface: Surface, placement: Placement, history: History, end: np.ndarray) -> np.ndarray:
    """Positions along the way, relative to the surface, in its axes, ``shape=(PLACES + 1, n, gdim)``.

    In space nodes go straight, and the surface moves and turns evenly.
    """
    turned = placement.turned_to(surface, history)
    start, end = placement.started(history) - surface.point, end - surface.point
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
