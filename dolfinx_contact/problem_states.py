# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The converged states of a problem: where the next step begins, kept in memory and in files."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dolfinx_contact.contact.contact_step import meet_supports
from dolfinx_contact.solvers.base import KEPT
from dolfinx_contact.support.collective import raised_together

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.bodies.internal_variables import InternalVariables
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.step.load_step import StepState


class Kept(NamedTuple):
    """All that a step ends with and the next one starts from: references, nothing is copied."""

    displacements: tuple  # the last one and the one before
    histories: list  # of contacts and internal variables
    surfaces: list  # displacements and rotations
    known: Any  # the body's free state
    past: tuple  # steps of the condensed solver
    of: object  # whose states these are


class ProblemStates:
    """The last converged states of a body, its contacts and internal variables.

    Args:
        body: The body.
        contacts: Its contacts.
        variables: ``InternalVariables``, or None.

    Attributes:
        last: The last displacement, owned degrees of freedom.
        before: The one before.
        starts: What solvers want to begin with in later steps, see ``BoundSolver.solve``.
    """

    def __init__(
        self, body: ElasticBody, contacts: Sequence[Contact], variables: InternalVariables | None
    ) -> None:
        self._body, self._contacts, self._variables = body, contacts, variables
        self._parts: list[Any] = [*contacts, *filter(None, [variables])]  # what has a history
        self._stood, self._mine = self.places(), object()
        self._begin()

    def _begin(self) -> None:
        """No history.  ``u`` is left: it is the guess of the first step."""
        self.last = self.before = np.zeros(self._body.size)
        self._body.known = None
        self.starts: tuple = ()
        for part in self._parts:
            part.reset()
        self._keep(None)

    def _keep(self, before: Kept | None) -> None:
        """Keep the present state to go back to, and the one before, if there is one."""
        histories = self._histories()
        places, displacements = self.places(), (self.last, self.before)
        known = self._body.known
        self._kept = Kept(displacements, histories, places, known, self.starts, self._mine)
        self._before = before

    def _histories(self) -> list:
        """Of contacts and internal variables."""
        own = [] if self._variables is None else [self._variables.history()]
        return [*(contact.history for contact in self._contacts), *own]

    def places(self) -> list[tuple]:
        """Displacement and rotation of each contact's surface, and the rotation of its guides."""
        surfaces = [contact.surface for contact in self._contacts]
        return [(*surface.stands[:2], surface.placed) for surface in surfaces]

    def _put_surfaces(self, places: list[tuple]) -> None:
        for contact, (displacement, rotation, placed) in zip(self._contacts, places):
            contact.surface.displacement = displacement
            contact.surface.place(rotation, placed)

    def take_variables(self) -> None:
        """What the user has written into internal variables is their last state."""
        if self._variables is not None:
            self._variables.advance()

    def accept(self, state: StepState, start: Any) -> None:
        """Let a state be the last converged one, and keep a start for later steps.  Collective."""
        self.last, self.before = state.x, self.last
        for contact, nodes in zip(state.step.contacts, state.nodes):
            contact.given.accept(contact, nodes, state.x)
        if self._variables is not None:
            self._variables.advance()
        if start is not None:
            self.starts = (*self.starts, start)[-KEPT:]
        for contact in self._contacts:
            contact.surface.end_step()
        self._keep(self._kept)

    def restore(self) -> None:
        """Show the last converged state."""
        self._body.show(self.last)
        if self._variables is not None:
            self._variables.restore()

    def standing(self) -> tuple:
        """Where a step begins, for ``stand_again``: this state, the one before, and surfaces where the user has put them."""
        histories = self._histories()
        return self._kept._replace(histories=histories), self._before, self.places()

    def stand_again(self, stood: tuple) -> None:
        """Show the state in which a step began, whatever has happened since.  Collective."""
        kept, before, places = stood
        self._go_to(kept)
        self._before = before
        self._put_surfaces(places)

    def rewind(self) -> None:
        """Go back by one step, see ``ContactProblem.rewind``.  Collective."""
        if self._before is None:
            raise ValueError(
                "there is no step to go back by: rewind goes back once after a step; save and load go further."
            )
        self._go_to(self._before)

    def snapshot(self) -> Kept:
        """The last converged state, see ``ContactProblem.snapshot``."""
        return self._kept

    def go_to(self, kept: Kept) -> None:
        """Go on from a snapshot, see ``ContactProblem.restore``.  Collective."""
        with raised_together(self._body.comm):
            if not isinstance(kept, Kept) or kept.of is not self._mine:
                raise ValueError(
                    f"restore takes what snapshot of the same problem has returned, got {type(kept).__name__}."
                )
        self._go_to(kept)

    def _go_to(self, kept: Kept) -> None:
        (self.last, self.before), self._body.known = kept.displacements, kept.known
        for part, history in zip(self._parts, kept.histories):
            part.go_back(history)
        for contact in self._contacts:  # supports may be others now
            meet_supports(contact, self._body.fixed)
        self._put_surfaces(kept.surfaces)
        self._take(kept.past)

    def _take(self, past: Sequence[tuple]) -> None:
        """Go on from a state that was put in place, with starts for the condensed solver."""
        self.starts = tuple(past)
        self.restore()
        self._keep(None)

    def reset(self) -> None:
        """No history, and surfaces where they were at first."""
        self._put_surfaces(self._stood)
        self._begin()
        self.restore()

    def save(self, path: str | PathLike[str]) -> None:
        """Write a checkpoint, see ``ContactProblem.save``.  Collective."""
        from dolfinx_contact.results import checkpoint

        displacements = [self.last, self.before]
        given = self._body, self._contacts, displacements, self.starts, self._variables
        checkpoint.save(path, *given)

    def load(self, path: str | PathLike[str]) -> None:
        """Continue from a checkpoint, see ``ContactProblem.load``.  Collective."""
        from dolfinx_contact.results import checkpoint

        found = checkpoint.load(path, self._body, self._contacts, self._variables)
        (self.last, self.before), past = found
        self._take(past)
