# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The last converged state of a problem, as a value: where the next step begins; checkpoints write its fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.contact.contact_step import meet_supports
from dolfinx_contact.solvers.base import KEPT_STARTS

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import FreeState
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.state import History
    from dolfinx_contact.problem import ContactProblem
    from dolfinx_contact.solvers.base import SolverResult


@dataclass(frozen=True, eq=False)
class Accepted:
    """All that a step ends with and the next one starts from: references, nothing is copied.

    Attributes:
        x: The displacement, owned degrees of freedom.
        x_before: That of the step before.
        histories: Of the contacts.
        poses: Of the contacts' surfaces: displacement, rotation, rotation of the guides.
        free_state: The body's last one without reactions, if it is known.
        variables: Values of the internal variables.
        starts: What solvers want to begin with in later steps, see ``BoundSolver.solve``.
        problem: Number of the problem whose state it is.
    """

    x: np.ndarray
    x_before: np.ndarray
    histories: tuple[History, ...]
    poses: tuple[tuple, ...]
    free_state: FreeState | None
    variables: tuple[np.ndarray, ...]
    starts: tuple
    problem: int

    def but(self, **parts: Any) -> Accepted:
        """The same with other parts."""
        return replace(self, **parts)


def poses_of(contacts: Sequence[Contact]) -> tuple[tuple, ...]:
    """Displacement and rotation of each contact's surface, and the rotation of its guides."""
    surfaces = [contact.surface for contact in contacts]
    return tuple((*surface.stands[:2], surface.placed) for surface in surfaces)


def put_surfaces(contacts: Sequence[Contact], poses: Sequence[tuple]) -> None:
    """Move each contact's surface to where ``poses_of`` found it."""
    for contact, (displacement, rotation, placed) in zip(contacts, poses):
        contact.surface.displacement = displacement
        contact.surface.place(rotation, placed)


def unloaded(problem: ContactProblem) -> Accepted:
    """The state before the first step; contacts forget theirs.  Collective."""
    for contact in problem.contacts:
        contact.reset()
    zero = np.zeros(problem.body.size)
    histories = tuple(contact.history for contact in problem.contacts)
    values = problem.internal.values() if problem.internal else ()
    return Accepted(
        zero, zero, histories, poses_of(problem.contacts), None, values, (), problem.number
    )


def advanced(problem: ContactProblem, found: SolverResult) -> Accepted:
    """The state after a step in which this was found; surfaces that force drives move to where it has them.  Collective."""
    state, before = found.state, problem.accepted
    state.step.place_surfaces(state)
    both = zip(state.step.contacts, state.nodes)
    histories = tuple(contact.ended(nodes, state.x) for contact, nodes in both)
    for contact in problem.contacts:
        contact.surface.end_step()
    values = problem.internal.values() if problem.internal else ()
    starts = before.starts if found.start is None else (*before.starts, found.start)[-KEPT_STARTS:]
    poses, free_state = poses_of(problem.contacts), problem.body.last_free_state
    return Accepted(state.x, before.x, histories, poses, free_state, values, starts, problem.number)


def show(problem: ContactProblem, accepted: Accepted) -> Accepted:
    """Let body, contacts, surfaces and internal variables be in a state; returns it as supports are now.  Collective."""
    body, contacts = problem.body, problem.contacts
    body.last_free_state = accepted.free_state
    put_surfaces(contacts, accepted.poses)
    for contact, history in zip(contacts, accepted.histories):
        contact.go_back(history)
        meet_supports(contact, body.fixed)
    body.show(accepted.x)
    if problem.internal:
        problem.internal.put(accepted.variables)
    return accepted.but(histories=tuple(contact.history for contact in contacts))
