# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Lagged geometry of a step, and the geometry error at its end.

For each node, a step is solved with a fixed tangent plane, lever arm and path along the surface,
which are exact at one position.  The geometry error at the end of the step is measured as a force:
an error of length times the stiffness of the node, an error of angle times the reaction, and an
error of lever arm times the reaction over the largest arm.  On deformable surfaces, whose mortar
rows are exact for one displacement, it is the difference between the forces on both bodies with the
rows used and with those of the end.
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

# Largest number of repetitions of a step with the geometry of its end, on rigid surfaces.
MOST_REPETITIONS = 5

# Largest number of repetitions on deformable surfaces, where convergence is slower.
MOST_RENEWALS = 24

# Number of differences in Anderson's method.
MIXED_ENDS = 5


class EndGeometry(Lagged):
    """Lagged frames, gaps and paths along the surface, evaluated at the end of the step.

    Args:
        step: The step.
        tol: Largest geometry error, relative to the reactions.
        step_at: Function of the previous version of the step and a displacement; it returns the
            step with the frames at this displacement.
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
        return geometry_error_message(change.size, self._tol, self._repeated)


class Ends:
    """Sequence of displacements and surface poses at which the geometry of a step is evaluated.

    The first one is the end of the first solution.  Later ones are accelerated by Anderson's method
    if the solution depends strongly on the geometry, where a plain fixed-point iteration may
    oscillate: on deformable surfaces of soft bodies, and with surfaces that rotate freely.

    Attributes:
        most: Largest number of repetitions of a step.
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
        """Return displacement and rotation of each freely rotating surface, as lengths."""
        return [np.append(s.displacement, self._arm * s.rotation) for s in self._turning]

    def after(self, x: np.ndarray) -> np.ndarray:
        """Return the next displacement for the geometry of the step.  Collective.

        Freely rotating surfaces are moved to the corresponding poses.

        Args:
            x: Displacement at the end of the last solution, owned degrees of freedom.
        """
        at, self._at = self._at, np.concatenate((x, *self._poses()))
        if at is not None and self._mix is not None:
            self._at = self._mix.step(at, self._at - at)[0]
            first = x.size
            for surface in self._turning:
                size, angles = surface.point.size, surface.rotation.size
                pose, first = self._at[first : first + size + angles], first + size + angles
                surface.displacement = pose[:size]
                surface.set_rotation(pose[size:] / self._arm)
        return self._at[: x.size]


def geometry_error(state: StepState, S: float) -> float:
    """Return the geometry error at the end of a step, relative to the reactions.  Collective.

    Args:
        state: State at the end, with the surfaces moved to their positions in it.
        S: Norm of the reactions.
    """
    body, squares = state.step.body, np.zeros(3)
    for contact, nodes in _changing_contacts(state):
        missed = contact.given.geometry.missed(contact, nodes, state.x, body.fixed)
        squares += [np.square(force).sum() for force in missed]
    parts = [*np.sqrt(body.total(squares)), *_moment_errors(state)]
    left = float(max(parts))
    return left / S if S > 0.0 else (np.inf if left > 0.0 else 0.0)


def _changing_contacts(state: StepState) -> list[tuple[ContactStep, State]]:
    """Return the contacts whose geometry changes in the step, with their nodal states."""
    both = zip(state.step.contacts, state.nodes)
    return [(contact, nodes) for contact, nodes in both if contact.given.changes]


def _moment_errors(state: StepState) -> list[float]:
    """Return errors of moments on freely rotating surfaces, as forces.  Collective.

    Each is the error of the moment about the surface's point, divided by its largest lever arm.
    """
    missed, body, changing = [], state.step.body, _changing_contacts(state)
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
    """Return a message if a node moves too far along its surface, else "".  Collective."""
    step, lost = state.step, [(2.0, "")]
    at = state.x, step.last if step.body.nonlinear else None
    lost += [c.given.geometry.too_long(c, nodes, *at) for c, nodes in _changing_contacts(state)]
    part, message = min(step.body.comm.allgather(min(lost)))
    if part > 1.0:
        return ""
    return f"the step is too long: {message}. Divide the step, or let dc.advance do so"


def geometry_error_message(missed: float, tol: float, repeated: int) -> str:
    """Return the error message for a step whose geometry has not converged.

    Args:
        missed: Geometry error, relative to the reactions.
        tol: Its tolerance.
        repeated: Number of repetitions of the step.
    """
    other = "; if that does not help, let the other body carry the unknowns" * (
        repeated == MOST_RENEWALS
    )
    return (
        f"distances, normals or arms at the end of the step differ by {missed:.1e} of the reactions from those with which it was "
        f"solved, after {repeated} repetitions, geometry_tol is {tol:.1e}: the increment is too large for its surface. Divide "
        f"it, or let dc.advance do so{other}"
    )
