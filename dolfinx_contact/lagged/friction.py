# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Friction laws that depend on the state at the end of a step, as lagged quantities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from dolfinx_contact.contact.fields import per_area
from dolfinx_contact.step.staggered import Change, Lagged

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State
    from dolfinx_contact.law.friction import Friction
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep, StepState

# Largest assumed convergence rate, for the estimate of the forward error.
SLOWEST_RATE = 0.9

# Largest tolerance of intermediate solutions.
ROUGH_TOL = 1e-3

# Tolerance of intermediate solutions, relative to the last change of the reactions.
PART_OF_CHANGE = 0.03


class LaggedFriction(Lagged):
    """Base class of friction laws that depend on the state.

    The final errors of a step are measured with the laws evaluated at its solution.
    """

    limit, first_tol = 50, ROUGH_TOL

    def __init__(self) -> None:
        self._last = np.inf

    def friction(self, contact: ContactStep, state: State) -> Friction:
        """Return the friction law at a state; ``contact.friction`` if unchanged.  Collective."""
        raise NotImplementedError

    def restarted(self, step: LoadStep) -> LoadStep:
        self._last = np.inf
        return step

    def change(self, found: SolverResult, goal: float) -> Change:
        state = found.state
        state = self._with_laws_of(state).measure(state.x, c=state.c, before=state)
        change = state.errors.change
        rate = min(change / self._last, SLOWEST_RATE) if 0.0 < self._last < np.inf else 0.5
        forward = change * rate / (1 - rate)
        settled = max(forward, found.forward_error) <= goal and state.errors.within(goal)
        if settled or state.errors.within(0.0):
            return Change(True, state.of(state.step.replaced(tol=goal)), change, forward)
        self._last = change
        tol = max(goal, min(ROUGH_TOL, PART_OF_CHANGE * change))
        return Change(False, state, change, forward, tol)

    def renewed(self, step: LoadStep, state: StepState) -> LoadStep:
        return step.replaced(starts=(state.x,), motions=state.c)

    def _with_laws_of(self, state: StepState) -> LoadStep:
        """Return the step with the friction laws evaluated at a state.  Collective."""
        step = state.step
        laws = [self.friction(*both) for both in zip(step.contacts, state.nodes)]
        changed = any(law is not k.friction for law, k in zip(laws, step.contacts))
        if not step.body.comm.allreduce(changed, op=MPI.LOR):
            return step
        return step.with_laws([k.with_friction(law) for law, k in zip(laws, step.contacts)])


class PressureFriction(LaggedFriction):
    """Friction coefficients that depend on the contact pressure."""

    def friction(self, contact: ContactStep, state: State) -> Friction:
        given = contact.given
        pressure = per_area(state.reaction[:, -1], given.area)
        return given.laws.under(given, pressure, contact.friction, contact.frames)

    def message(self, solutions: int) -> str:
        return f"{solutions} times with friction that follows the pressure"
