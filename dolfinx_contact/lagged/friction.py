# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Friction that follows the state at the end of a step."""

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

# The largest factor by which changes of the reactions are taken to fall from one solution to the next.
SLOWEST_RATE = 0.9

# Tolerance of a solution on the way: at most this one, and this part of the last change of the reactions.
ROUGH_TOL = 1e-3
PART_OF_CHANGE = 0.03


class LaggedFriction(Lagged):
    """Laws that follow the state: the errors by which a step is judged are measured with those of the state found."""

    limit, first_tol = 50, ROUGH_TOL

    def __init__(self) -> None:
        self._last = np.inf

    def friction(self, contact: ContactStep, state: State) -> Friction:
        """The law of a contact in a state; ``contact.friction`` itself where it stays.  Collective."""
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
            return Change(True, state.of(state.step.but(tol=goal)), change, forward)
        self._last = change
        tol = max(goal, min(ROUGH_TOL, PART_OF_CHANGE * change))
        return Change(False, state, change, forward, tol)

    def renewed(self, step: LoadStep, state: StepState) -> LoadStep:
        return step.but(starts=(state.x,), motions=state.c)

    def _with_laws_of(self, state: StepState) -> LoadStep:
        """The step with the laws of a state.  Collective."""
        step = state.step
        laws = [self.friction(*both) for both in zip(step.contacts, state.nodes)]
        changed = any(law is not k.friction for law, k in zip(laws, step.contacts))
        if not step.body.comm.allreduce(changed, op=MPI.LOR):
            return step
        return step.with_laws([k.with_friction(law) for law, k in zip(laws, step.contacts)])


class PressureFriction(LaggedFriction):
    """Friction that follows the pressure."""

    def friction(self, contact: ContactStep, state: State) -> Friction:
        given = contact.given
        pressure = per_area(state.reaction[:, -1], given.area)
        return given.laws.under(given, pressure, contact.friction, contact.frames)

    def message(self, solutions: int) -> str:
        return f"{solutions} times with friction that follows the pressure"
