# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Immutable last converged state of a problem, from which the next step starts.

Checkpoints contain its fields.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.contact.contact_step import exclude_fixed_directions
from dolfinx_contact.solvers.base import KEPT_STARTS

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import FreeState
    from dolfinx_contact.bodies.internal_variables import InternalVariables
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.state import History
    from dolfinx_contact.problem import ContactProblem
    from dolfinx_contact.solvers.base import SolverResult


@dataclass(frozen=True, eq=False)
class Accepted:
    """Converged state at the end of a step, from which the next step starts; data are not copied.

    Attributes:
        x: Displacement, owned degrees of freedom.
        x_before: Displacement at the end of the previous step.
        histories: ``History`` of each contact.
        poses: Displacement, rotation, and rotation of the guides, of each contact's surface.
        free_state: The last contact-free solution of the body; None if unknown.
        variables: Values of the internal variables.
        starts: Start data that solvers have stored for later steps, see ``BoundSolver.solve``.
        problem: Number of the problem to which the state belongs.
    """

    x: np.ndarray
    x_before: np.ndarray
    histories: tuple[History, ...]
    poses: tuple[tuple, ...]
    free_state: FreeState | None
    variables: tuple[np.ndarray, ...]
    starts: tuple
    problem: int

    def replaced(self, **parts: Any) -> Accepted:
        """Return a copy of the state with some attributes replaced."""
        return replace(self, **parts)


def poses_of(contacts: Sequence[Contact]) -> tuple[tuple, ...]:
    """Return displacement, rotation and rotation of the guides of each contact's surface."""
    surfaces = [contact.surface for contact in contacts]
    return tuple((*surface.stands[:2], surface.placed) for surface in surfaces)


def histories_of(contacts: Sequence[Contact]) -> tuple[History, ...]:
    """Return the history of each contact."""
    return tuple(contact.history for contact in contacts)


def values_of(internal: InternalVariables | None) -> tuple[np.ndarray, ...]:
    """Return copies of the present values of internal variables; empty if there are none."""
    return () if internal is None else internal.values()


def put_surfaces(contacts: Sequence[Contact], poses: Sequence[tuple]) -> None:
    """Move each contact's surface to a pose returned by ``poses_of``."""
    for contact, (displacement, rotation, placed) in zip(contacts, poses):
        contact.surface.displacement = displacement
        contact.surface.place(rotation, placed)


def unloaded(problem: ContactProblem) -> Accepted:
    """Return the state before the first step, and reset the contacts' histories.  Collective."""
    for contact in problem.contacts:
        contact.reset()
    zero = np.zeros(problem.body.size)
    histories, values = histories_of(problem.contacts), values_of(problem.internal)
    return Accepted(
        zero, zero, histories, poses_of(problem.contacts), None, values, (), problem.number
    )


def advanced(problem: ContactProblem, found: SolverResult) -> Accepted:
    """Return the state after a converged step.  Collective.

    Surfaces driven by force are moved to their final poses.
    """
    state, before = found.state, problem.accepted
    state.step.place_surfaces(state)
    both = zip(state.step.contacts, state.nodes)
    histories = tuple(contact.ended(nodes, state.x) for contact, nodes in both)
    for contact in problem.contacts:
        contact.surface.end_step()
    values = values_of(problem.internal)
    starts = before.starts if found.start is None else (*before.starts, found.start)[-KEPT_STARTS:]
    poses, free_state = poses_of(problem.contacts), problem.body.last_free_state
    return Accepted(state.x, before.x, histories, poses, free_state, values, starts, problem.number)


def show(problem: ContactProblem, accepted: Accepted) -> Accepted:
    """Restore body, contacts, surfaces and internal variables to a state.  Collective.

    Returns:
        The state with the contacts' histories in frames that agree with the present supports.
    """
    body, contacts = problem.body, problem.contacts
    body.last_free_state = accepted.free_state
    put_surfaces(contacts, accepted.poses)
    for contact, history in zip(contacts, accepted.histories):
        contact.set_history(history)
        exclude_fixed_directions(contact, body.fixed)
    body.show(accepted.x)
    if problem.internal:
        problem.internal.put(accepted.variables)
    return accepted.replaced(histories=histories_of(contacts))
