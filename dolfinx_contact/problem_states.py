# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The converged states of a problem: where the next step begins, kept in memory and in files."""

from __future__ import annotations

from collections import deque
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from dolfinx_contact.problem_input import ProblemOptions, check_alive
from dolfinx_contact.results import checkpoint
from dolfinx_contact.solvers.condensed.body import KEPT


class Kept(NamedTuple):
    """All that a step ends with and the next one starts from: references, nothing is copied."""

    states: list  # the last displacement and the one before
    contacts: list  # histories
    surfaces: list  # displacements and rotations
    known: Any  # the body's free state
    past: tuple  # steps of the condensed solver
    variables: list  # values of internal variables


class ProblemStates(ProblemOptions):
    """The last converged states of a ``ContactProblem``, which has body, contacts and displacement."""

    _before: Kept | None = None

    def rewind(self) -> None:
        """Go back by one accepted step, as if it had not been made, to try another one.  Collective.

        Displacement, contacts with their sums, and planes are those of the end of the step before; loads, boundary values and
        laws stay as they are.  One step is kept: after it, ``rewind`` again needs another one to go back by.

        Raises:
            ValueError: no step has been accepted since the beginning, the last ``reset``, ``load`` or ``rewind``.
        """
        check_alive(self, self.body, self.contacts)
        if self._before is None:
            raise ValueError(
                "there is no step to go back by: rewind goes back once after a step; save and load go further."
            )
        kept = self._before
        self._states, self.body.known = kept.states, kept.known
        for contact, history, where in zip(self.contacts, kept.contacts, kept.surfaces):
            contact.go_back(history)
            contact.surface.displacement, contact.surface.rotation = where
        self._remember(kept.past)
        self._variables.go_back(kept.variables)
        self._restore()
        self._keep()

    def _keep(self, step: bool = False) -> None:
        """Keep the present state to go back to; after a ``step`` the one before, too."""
        self._before = self._kept if step else None
        self._kept = Kept(
            self._states,
            [contact.history() for contact in self.contacts],
            self._places(),
            self.body.known,
            tuple(self._memory.get("past", ())),
            self._variables.last,
        )

    def _places(self) -> list[tuple]:
        """Displacement and rotation of each contact's surface."""
        return [
            (contact.surface.displacement, contact.surface.rotation) for contact in self.contacts
        ]

    def _remember(self, past) -> None:
        """Starts for the condensed solver."""
        kept = self._memory.setdefault("past", deque(maxlen=KEPT))
        kept.clear()
        kept.extend(past)

    def reset(self) -> None:
        """Return to the undeformed body without reactions or history, and surfaces to where they were when the problem was made."""
        check_alive(self, self.body, self.contacts)
        for contact, where in zip(self.contacts, self._stood):
            contact.surface.displacement, contact.surface.rotation = where
        self._begin()
        self._variables.reset()
        self._restore()

    def _begin(self) -> None:
        """No history.  ``u`` is left: it is the guess of the first step."""
        self._states = [np.zeros(self.body.size)] * 2
        self.body.known = None
        self._memory.clear()
        for contact in self.contacts:
            contact.reset()
        self._keep()

    def save(self, path: str | PathLike[str]) -> None:
        """Write a checkpoint: all that the next step starts from, of all ranks, in one file.

        The file is replaced in one go, so a run that is killed leaves the last one whole.  Collective.

        Args:
            path: File name, usually ending in ``.npz``.
        """
        check_alive(self, self.body, self.contacts)
        past = self._memory.get("past", ())
        checkpoint.save(path, self.body, self.contacts, self._states, past, self._variables)

    def load(self, path: str | PathLike[str]) -> None:
        """Continue from a checkpoint of the same problem, on any number of ranks.  Collective.

        On one rank the steps that follow have the same bits as without the interruption.  On several
        ranks MUMPS adds in the order in which messages arrive, and they agree to rounding.

        Raises:
            ValueError: the file is no checkpoint of this problem.
        """
        check_alive(self, self.body, self.contacts)
        self._states, past = checkpoint.load(path, self.body, self.contacts, self._variables)
        self._remember(past)
        self._restore()
        self._keep()

    def _restore(self) -> None:
        self.body.show(self._states[0])
        self._variables.restore()
        for contact in self.contacts:
            contact.restore()
