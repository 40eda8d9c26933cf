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

from dolfinx_contact.step.staggered import Change, Lagged
from dolfinx_contact.support.anderson import Anderson
from dolfinx_contact.support.attributes import surfaces_of
from dolfinx_contact.surfaces.surface import cross

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep, StepState

# How often a step is repeated with the geometry of its end.
MOST_REPETITIONS = 5

# The same with deformable surfaces, and differences of ends that are mixed.
MOST_RENEWALS = 24
MIXED_ENDS = 5


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
        renewed = any(c.geometry.renews_rows for c in contacts)
        self.most = MOST_RENEWALS if renewed else MOST_REPETITIONS
        self._turning = surfaces_of(c for c in contacts if c.surface.spins)
        self._arm, self._mix, self._at = body.extent, None, None
        if renewed or self._turning:
            size = body.size + sum(pose.size for pose in self._poses())
            self._mix = Anderson(size, MIXED_ENDS, body.total)

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
        missed = contact.given.geometry.missed(contact, nodes, state.x, body.fixed)
        squares += [np.square(force).sum() for force in missed]
    parts = [*np.sqrt(body.total(squares)), *_moments(state)]
    left = float(max(parts))
    return left / S if S > 0.0 else (np.inf if left > 0.0 else 0.0)


def _changing(state: StepState) -> list[tuple[ContactStep, State]]:
    """Contacts whose geometry changes in the step, with their nodes."""
    both = zip(state.step.contacts, state.nodes)
    return [(contact, nodes) for contact, nodes in both if contact.given.changes]


def _moments(state: StepState) -> list[float]:
    """Of moments about the points of surfaces that turn, over their largest arm.  Collective."""
    missed, body, changing = [], state.step.body, _changing(state)
    for surface in surfaces_of(contact for contact, _ in changing if contact.surface.spins):
        sums, arms = np.zeros(surface.rotation.size), [np.zeros(1)]
        for contact, nodes in changing:
            if contact.surface is surface:
                _, there = contact.given.geometry.ended_at(state.x)
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
    """Where the way of a step cannot be followed, in words; empty where it can.  Collective."""
    step, lost = state.step, [(2.0, "")]
    at = state.x, step.last if step.body.nonlinear else None
    lost += [c.given.geometry.too_long(c, nodes, *at) for c, nodes in _changing(state)]
    part, message = min(step.body.comm.allgather(min(lost)))
    if part > 1.0:
        return ""
    return f"the step is too long: {message}. Divide the step, or let dc.advance do so"


def undivided(missed: float, tol: float, repeated: int) -> str:
    """What to say of a step whose geometry stays different, in words."""
    other = "; if that does not help, let the other body carry the unknowns" * (
        repeated == MOST_RENEWALS
    )
    return (
        f"distances, normals or arms at the end of the step differ by {missed:.1e} of the reactions from those with which it was "
        f"solved, after {repeated} repetitions, geometry_tol is {tol:.1e}: the increment is too large for its surface. Divide "
        f"it, or let dc.advance do so{other}"
    )
