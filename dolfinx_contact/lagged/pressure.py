# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Friction that follows the pressure at the end of a step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from dolfinx_contact.step.staggered import Change, Lagged

if TYPE_CHECKING:
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep, StepState

# The largest factor by which changes of the reactions are taken to fall from one solution to the next.
SLOWEST_RATE = 0.9

# Tolerance of a solution on the way: at most this one, and this part of the last change of the reactions.
ROUGH_TOL, PART_OF_CHANGE = 1e-3, 0.03


class PressureFriction(Lagged):
    """Laws that follow the pressure: the errors by which a step is judged are measured with those of the pressures found."""

    limit, first_tol = 50, ROUGH_TOL

    def __init__(self) -> None:
        self._last = np.inf

    def restarted(self, step: LoadStep) -> LoadStep:
        self._last = np.inf
        return step

    def change(self, found: SolverResult, goal: float) -> Change:
        state = found.state
        state = with_laws_of(state).measure(state.x, c=state.c, before=state)
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

    def said(self, solutions: int) -> str:
        return f"{solutions} times with friction that follows the pressure"


def with_laws_of(state: StepState) -> LoadStep:
    """The step of a state with the laws of its pressures.  Collective."""
    step = state.step
    both = zip(step.contacts, state.nodes)
    contacts = [contact.given.under_pressures_of(contact, nodes) for contact, nodes in both]
    changed = any(new is not old for new, old in zip(contacts, step.contacts))
    if not step.body.comm.allreduce(changed, op=MPI.LOR):
        return step
    return step.with_laws(contacts)
