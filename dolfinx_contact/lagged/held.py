# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Whether planes that force drives are held by contact nodes which supports hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from dolfinx_contact.step.staggered import Change, Lagged

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep


class HeldPlanes(Lagged):
    """Planes that held nodes hold: those that they cannot hold slide, in the next solution and all later ones.

    Args:
        contacts: All contacts.
        step_again: The step anew, with planes held as they are.
    """

    limit = 1

    def __init__(self, contacts: Sequence[Contact], step_again: Callable[[LoadStep], LoadStep]):
        self._contacts, self._step_again, self._asked = contacts, step_again, False

    def change(self, step: LoadStep, found: SolverResult, goal: float) -> Change:
        slides = not self._asked and step.holding.slide()
        self._asked = True
        return Change(not slides, step)

    def renewed(self, step: LoadStep, found: SolverResult) -> LoadStep:
        for contact in self._contacts:
            contact.restore()
        return self._step_again(step)
