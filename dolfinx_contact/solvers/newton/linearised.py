# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Any solver on a nonlinear body: a sequence of contact steps of the linearised body."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from dolfinx_contact.petsc.linear_solver import LinearSolverError
from dolfinx_contact.solvers.base import BoundSolver, Solver, SolverResult
from dolfinx_contact.solvers.fixed_point.fixed_point import FixedPoint
from dolfinx_contact.step.nonlinear import LinearisedStep

# Linearised steps at most; of one is taken the largest half, quarter, ... after which the error is smaller than the
# largest of the last BEFORE ones.
MOST, SHORTEST, BEFORE = 30, 2.0**-6, 3

# Tolerance of a linearised step: at most ROUGH, else this part of what is left after it, were errors to fall as squares.
ROUGH, PART = 1e-3, 0.1


class Linearised:
    """Newton's method: in every iteration a solver's contact step of the body linearised at the last iterate.

    Args:
        solver: The solver of the linearised steps.
    """

    nonlinear = True

    def __init__(self, solver: Solver):
        self.solver = solver

    def bind(self, body: Any, contacts: Any, stiffness: Any, memory: Any) -> BoundSolver:
        """See ``Solver``."""
        return BoundLinearised(self.solver, body, contacts, memory)


class BoundLinearised:
    """The method for one body; the solver is bound anew to every tangent."""

    def __init__(self, solver, body, contacts, memory):
        self._solver, self._body, self._contacts, self._memory = solver, body, contacts, memory

    def destroy(self) -> None:
        """Nothing is kept."""

    def renew_law(self) -> bool:
        """See ``BoundSolver``."""
        return True

    def solve(self, step, start: np.ndarray | None = None) -> SolverResult:
        """Linearise until the errors are at most the tolerance, or nothing helps any more.

        Args:
            step: The ``NonlinearStep``.
            start: Where to begin; None asks the step.
        """
        x = step.start() if start is None else start
        best, forward, iterations, used = x, np.inf, 0, []
        errors, last = deque([np.inf], maxlen=BEFORE), np.inf
        while len(used) < MOST:
            try:
                with np.errstate(all="ignore"):  # a trial may turn elements inside out
                    found = self._linear_step(step, x, last)
            except (LinearSolverError, np.linalg.LinAlgError):
                break
            iterations += found.iterations
            used.append(found.chosen)
            x, error = self._part(step, x, found.x, max(errors))
            if x is None:
                break
            rate = min(error / last, 0.9)
            change = step.errors.change * rate / (1 - rate)
            best, forward = x, max(found.forward_error, change)
            errors.append(error)
            last = error
            rounded = step.errors.within(0.0)
            if step.errors.within(step.tol) and (forward <= step.tol or rounded):
                break
        names = ", ".join(dict.fromkeys(used)) or type(self._solver).__name__
        return SolverResult(best, iterations, forward, f"{names}, linearised {len(used)} times")

    def _linear_step(self, step, x: np.ndarray, error: float) -> SolverResult:
        """The contact step of the body linearised at ``x``, whose error is known."""
        body = self._body
        body.linearise(x)
        b = body.linear_load(step.b, -step.by_form(x))
        tol = max(PART * min(error * error, ROUGH / PART), PART * step.tol, 1e-13)
        linear = LinearisedStep(
            body, self._contacts, step.stiffness, b, step.external, [x], tol, step.unit
        )  # fmt: skip
        bound = self._bind(step.stiffness)
        try:
            return bound.solve(linear)
        finally:
            bound.destroy()
            if step.surfaces is not None:
                step.surfaces.moved_with(linear.surfaces)

    def _bind(self, stiffness) -> BoundSolver:
        """The solver, bound to the present tangent; the fixed point where that is none of a body by itself.

        Bodies under pressure may be stable on the plane alone: without it nodes would not give way to their reactions.
        """
        arguments = self._body, self._contacts, stiffness, self._memory
        try:
            return self._solver.bind(*arguments)
        except ValueError:
            return FixedPoint().bind(*arguments)

    def _part(self, step, x: np.ndarray, to: np.ndarray, most: float):
        """The iterate at a part of the way, and its largest error; None if no part helps."""
        whole, length = to - x, 1.0
        while length >= SHORTEST:
            following = to if length == 1.0 else x + length * whole
            error = step.measure(following).largest
            moved = np.isfinite(step.size(step.forces(following)))
            # Supports that are not yet where they should be make any error infinite.
            if moved and (error < most or error == np.inf == most):
                return following, error
            length /= 2
        return None, np.inf
