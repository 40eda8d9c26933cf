# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The displacement without reactions: whether it presses on a plane, and whether it is the solution."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.petsc.linear_solver import stage
from dolfinx_contact.results.record import NO_SOLUTION
from dolfinx_contact.solvers.base import SolverName, SolverResult

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import LoadStep, StepState

# Penetration over the largest displacement that three digits of it leave no doubt about.
CERTAIN = 0.1

NOTHING = "nothing touches"


def without_reactions(step: LoadStep) -> SolverResult | None:
    """The displacement without reactions, if it is the solution of a step.  Collective."""
    body, c = step.body, step.no_motions
    if step.surfaces is not None:
        if not step.surfaces.can_rest:
            return None
        c = step.surfaces.at_rest(c)
    with stage("contact: elastic solve"):
        trial = body.free_state(step.b, rough=True)
        if not (body.last_free_state.exact or presses(step, trial, c)):
            trial = body.free_state(step.b)  # whether anything touches takes all digits
    if may_touch(step, trial, c):
        return None
    state = refined(step.open(trial, c))
    return SolverResult(state, 0, 0.0, SolverName.NONE, reason=NOTHING) if state.within else None


def unmoved(step: LoadStep, reason: str = NO_SOLUTION) -> SolverResult:
    """The last displacement with the present boundary values, judged as what it is: no solution.  Collective."""
    x, fixed = step.last.copy(), step.body.fixed
    x[fixed] = step.b[fixed]
    return SolverResult(step.measure(x), 0, np.inf, SolverName.NONE, reason=reason)


def floating(step: LoadStep) -> SolverResult | None:
    """Of a loose body whose loads balance the displacement without reactions nearest to the last one.  Collective.

    None where it touches.
    """
    x, fixed = step.last.copy(), step.body.fixed
    x[fixed] = step.b[fixed]
    x += step.body.solve(step.forces(x))
    if may_touch(step, x):
        return None
    state = step.open(x)
    return SolverResult(state, 0, 0.0, SolverName.NONE, reason=NOTHING) if state.within else None


def presses(step: LoadStep, trial: np.ndarray, c: np.ndarray | None = None) -> bool:
    """Whether a displacement without reactions known to three digits penetrates a plane for certain.  Collective."""
    return _deepest(step, trial, c) > CERTAIN * step.body.farthest(trial)


def may_touch(step: LoadStep, trial: np.ndarray, c: np.ndarray | None = None) -> bool:
    """Whether a displacement without reactions penetrates a plane by more than rounding.  Collective."""
    return _deepest(step, trial, c, lambda contact: contact.gap_rounding(trial)) > 1.0


def _deepest(
    step: LoadStep,
    trial: np.ndarray,
    c: np.ndarray | None,
    unit: Callable = lambda contact: 1.0,
) -> float:
    """The deepest penetration of all contacts, at least zero, in a unit of length.  Collective."""
    depths = [-contact.at(trial, c).gap / unit(contact) for contact in step.contacts]
    return step.body.largest(np.concatenate([np.zeros(1), *depths]))


def refined(state: StepState) -> StepState:
    """The state without reactions, with another digit where what is left of ``b`` counts.  Collective."""
    step, errors = state.step, state.errors
    if errors.largest <= step.tol:
        return state
    finer = step.open(state.x + step.body.solve(step.forces(state.x)), state.c)
    return finer if finer.errors.largest < errors.largest else state
