# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Surfaces driven by force and held by contact nodes with prescribed displacements."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from dolfinx_contact.step.staggered import Change, Lagged

if TYPE_CHECKING:
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep, StepState
    from dolfinx_contact.surfaces.held import HeldSurfaces


class HeldPlanes(Lagged):
    """Lagged status, held or sliding, of the surfaces that nodes held by supports may hold.

    After the first solution, surfaces on which the friction of these nodes is exceeded slide, in
    all later solutions of the step.

    Args:
        step_again: Function of the step and ``HeldSurfaces``; it returns the step with this status.
    """

    limit = 1

    def __init__(self, step_again: Callable[[LoadStep, HeldSurfaces], LoadStep]):
        self._step_again, self._slid, self._asked = step_again, None, False

    def change(self, found: SolverResult, goal: float) -> Change:
        state, step = found.state, found.state.step
        slid = None if self._asked else step.holding.slid(step.contacts, state.nodes)
        self._slid, self._asked = slid, True
        return Change(slid is None, state)

    def renewed(self, step: LoadStep, state: StepState) -> LoadStep:
        return self._step_again(step, self._slid)
