# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Friction that follows the pressure at the end of a step."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.step.staggered import Change, Lagged

if TYPE_CHECKING:
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep

# The largest factor by which changes of the reactions are taken to fall from one solution to the next.
SLOWEST_RATE = 0.9

# Tolerance of a solution on the way: at most this one, and this part of the last change of the reactions.
ROUGH_TOL, PART_OF_CHANGE = 1e-3, 0.03


class PressureFriction(Lagged):
    """Laws that follow the pressure: the errors by which a step is judged are measured with those of the pressures found.

    Args:
        renew_laws: Lets contacts have the laws of their present state.
    """

    limit, first_tol = 50, ROUGH_TOL

    def __init__(self, renew_laws: Callable[[], None]):
        self._renew_laws = renew_laws
        self.restart()

    def restart(self) -> None:
        self._last = np.inf

    def change(self, step: LoadStep, found: SolverResult, goal: float) -> Change:
        self._renew_laws()
        step = step.with_laws_of(found.x)
        change = step.measure(found.x).change
        rate = min(change / self._last, SLOWEST_RATE) if 0.0 < self._last < np.inf else 0.5
        forward = max(found.forward_error, change * rate / (1 - rate))
        settled = forward <= goal and step.errors.within(goal)
        if settled or step.errors.within(0.0):
            return Change(True, step.within(goal), change, forward)
        self._last = change
        tol = max(goal, min(ROUGH_TOL, PART_OF_CHANGE * change))
        return Change(False, step, change, forward, tol)

    def renewed(self, step: LoadStep, found: SolverResult) -> LoadStep:
        return step

    def said(self, solutions: int) -> str:
        return f"{solutions} times with friction that follows the pressure"
