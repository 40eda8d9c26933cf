# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The converged states of a problem: where the next step begins, kept in memory and in files."""

from __future__ import annotations

from collections import deque
from os import PathLike

import numpy as np

from dolfinx_contact.problem_input import ProblemOptions, check_alive
from dolfinx_contact.results import checkpoint
from dolfinx_contact.solvers.condensed import KEPT


class ProblemStates(ProblemOptions):
    """The last converged states of a ``ContactProblem``, which has body, contacts and displacement."""

    def reset(self) -> None:
        """Return to the undeformed body without reactions or history; planes stay where they are."""
        check_alive(self, self.body, self.contacts)
        self._begin()
        self._restore()

    def _begin(self) -> None:
        """No history.  ``u`` is left: it is the guess of the first step."""
        self._states = [np.zeros(self.body.size)] * 2
        self.body.known = None
        self._memory.clear()
        for contact in self.contacts:
            contact.reset()

    def save(self, path: str | PathLike[str]) -> None:
        """Write a checkpoint: all that the next step starts from, of all ranks, in one file.

        The file is replaced in one go, so a run that is killed leaves the last one whole.  Collective.

        Args:
            path: File name, usually ending in ``.npz``.
        """
        check_alive(self, self.body, self.contacts)
        past = self._memory.get("past", ())
        checkpoint.save(path, self.body, self.contacts, self._states, past)

    def load(self, path: str | PathLike[str]) -> None:
        """Continue from a checkpoint of the same problem, on any number of ranks.  Collective.

        On one rank the steps that follow have the same bits as without the interruption.  On several
        ranks MUMPS adds in the order in which messages arrive, and they agree to rounding.

        Raises:
            ValueError: the file is no checkpoint of this problem.
        """
        check_alive(self, self.body, self.contacts)
        self._states, past = checkpoint.load(path, self.body, self.contacts)
        kept = self._memory.setdefault("past", deque(maxlen=KEPT))
        kept.clear()
        kept.extend(past)
        self._restore()

    def _show(self, x: np.ndarray) -> None:
        self.u.x.array[: self.body.size] = x
        self.u.x.scatter_forward()

    def _restore(self) -> None:
        self._show(self._states[0])
        for contact in self.contacts:
            contact.restore()
