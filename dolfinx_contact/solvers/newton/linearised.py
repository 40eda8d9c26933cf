# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Newton's method for non-linear bodies: a sequence of load steps of the linearised body."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from dolfinx_contact.petsc.linear_solver import LinearSolverError
from dolfinx_contact.solvers.base import BoundSolver, Solver, SolverResult
from dolfinx_contact.solvers.fixed_point.fixed_point import FixedPoint
from dolfinx_contact.step.load_step import LoadStep, StepState
from dolfinx_contact.step.nonlinear import LinearisedStep
from dolfinx_contact.support.line_search import halves

# Largest number of linearised steps.  Line search: lengths 1, 1/2, 1/4, ... down to SHORTEST_STEP
# are tried until the error falls below the largest of the last ERRORS_BEFORE errors.
MOST_STEPS = 30
SHORTEST_STEP = 2.0**-6
ERRORS_BEFORE = 3

# Tolerance of a linearised step: TOLERANCE_PART of the error expected after it with quadratic
# convergence, and at most ROUGH_TOLERANCE.
ROUGH_TOLERANCE = 1e-3
TOLERANCE_PART = 0.1


class Linearised(Solver):
    """Newton's method for non-linear bodies: a sequence of linearised load steps.

    Each iteration solves a load step with contact.  The body is linearised at the last iterate; the
    contact law is not.

    Args:
        solver: Options of the solver for the linearised steps.
    """

    nonlinear = True

    def __init__(self, solver: Solver):
        self.solver = solver

    def bind(self, step: LoadStep) -> BoundSolver:
        """See ``Solver``."""
        return BoundLinearised(self.solver)


class BoundLinearised(BoundSolver):
    """Newton's method for one problem; the inner solver is set up anew for every tangent."""

    def __init__(self, solver: Solver):
        self._solver = solver

    def close(self) -> None:
        """Do nothing: the solver keeps no data between load steps."""

    def update(self, step: LoadStep) -> None:
        """Do nothing: the solver keeps no data between load steps."""

    def solve(
        self, step: LoadStep, starts: Sequence[Any] = (), start: StepState | None = None
    ) -> SolverResult:
        """Iterate until the errors are at most the tolerance or no step reduces them.

        Returns the best state.

        Args:
            step: The ``NonlinearStep``.
            starts: Start data of earlier steps, passed to the inner solver.
            start: The initial state; None takes ``step.start()``.
        """
        best = step.start() if start is None else start
        state, forward, iterations, used, own = best.as_start, np.inf, 0, [], []
        errors, last = deque([np.inf], maxlen=ERRORS_BEFORE), np.inf
        while len(used) < MOST_STEPS:
            try:
                with np.errstate(all="ignore"):  # a trial displacement may invert elements
                    found = self._linear_step(step, state, last, [*starts, *own])
            except (LinearSolverError, np.linalg.LinAlgError):
                break
            iterations += found.iterations
            used.append(found.solver)
            own += [] if found.start is None else [found.start]
            following = self._part(state, found.state, max(errors))
            if following is None:
                break
            state, now = following, following.errors
            rate = min(now.largest / last, 0.9)
            change = now.change * rate / (1 - rate)
            best, forward, last = state, max(found.forward_error, change), now.largest
            errors.append(last)
            if now.within(step.tol) and (forward <= step.tol or now.within(0.0)):
                break
        solver = used[-1] if used else type(self._solver).__name__
        message = f"linearised {len(used)} times"
        start = own[-1] if own else None
        return SolverResult(best, iterations, forward, solver, reason=message, start=start)

    def _linear_step(
        self, step: LoadStep, state: StepState, error: float, starts: Sequence[Any]
    ) -> SolverResult:
        """Solve the load step of the body linearised at a state; ``error`` is the state's error."""
        body = step.body
        body.linearise(state.x)
        tol = max(
            TOLERANCE_PART * min(error * error, ROUGH_TOLERANCE / TOLERANCE_PART),
            TOLERANCE_PART * step.tol,
            1e-13,
        )
        parts = {part.name: getattr(step, part.name) for part in fields(LoadStep)}
        parts |= dict(b=body.linear_load(step.b, -state.forces), starts=(state.x,), tol=tol)
        linear = LinearisedStep(**parts | dict(motions=state.c, monitor=None))
        bound = self._bind(linear)
        try:
            return bound.solve(linear, starts)
        finally:
            bound.close()

    def _bind(self, step: LoadStep) -> BoundSolver:
        """Set up the inner solver with the present tangent, or ``FixedPoint`` if it refuses it.

        The tangent of a body may be unstable without its contacts, for instance under pressure.
        Then contact nodes have no positive compliance, and other solvers refuse the tangent.
        """
        try:
            return self._solver.bind(step)
        except ValueError:
            return FixedPoint().bind(step)

    def _part(self, state: StepState, to: StepState, most: float) -> StepState | None:
        """Return the first state between ``state`` and ``to`` with an error below ``most``.

        This is a line search from ``to`` backwards.  None if no step length reduces the error
        enough.
        """
        step = state.step
        for length in halves(SHORTEST_STEP):
            x = to.x if length == 1.0 else state.x + length * (to.x - state.x)
            trial = step.measure(x, c=to.c, before=state)
            step.tell(trial)
            error, moved = trial.errors.largest, np.isfinite(step.size(trial.forces))
            # The error is infinite until the displacement has its boundary values.
            if moved and (error < most or error == np.inf == most):
                return trial
        return None
