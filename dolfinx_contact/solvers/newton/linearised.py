# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Any solver on a nonlinear body: a sequence of contact steps of the linearised body."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.petsc.linear_solver import LinearSolverError
from dolfinx_contact.solvers.base import BoundSolver, Solver, SolverResult
from dolfinx_contact.solvers.fixed_point.fixed_point import FixedPoint
from dolfinx_contact.step.load_step import Judged, LoadStep
from dolfinx_contact.step.nonlinear import LinearisedStep
from dolfinx_contact.support.line_search import halves

if TYPE_CHECKING:
    from dolfinx_contact.bodies.nonlinear import NonlinearBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.interface import NodalStiffness

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

    def __init__(
        self,
        solver: Solver,
        body: NonlinearBody,
        contacts: Sequence[Contact],
        memory: dict[str, Any],
    ):
        self._solver, self._body, self._contacts, self._memory = solver, body, contacts, memory

    def destroy(self) -> None:
        """Nothing is kept."""

    def renew_law(self) -> bool:
        """See ``BoundSolver``."""
        return True

    def solve(self, step: LoadStep, start: np.ndarray | None = None) -> SolverResult:
        """Linearise until the errors are at most the tolerance, or nothing helps any more.

        Args:
            step: The ``NonlinearStep``.
            start: Where to begin; None asks the step.
        """
        x = step.start() if start is None else start
        best, forces, forward, iterations, used = x, step.by_form(x), np.inf, 0, []
        errors, last = deque([np.inf], maxlen=BEFORE), np.inf
        while len(used) < MOST:
            try:
                with np.errstate(all="ignore"):  # a trial may turn elements inside out
                    found = self._linear_step(step, x, forces, last)
            except (LinearSolverError, np.linalg.LinAlgError):
                break
            iterations += found.iterations
            used.append(found.solver)
            judged = self._part(step, x, found.x, max(errors))
            if judged is None:
                break
            x, forces, now = judged.x, judged.forces, judged.errors
            rate = min(now.largest / last, 0.9)
            change = now.change * rate / (1 - rate)
            best, forward, last = x, max(found.forward_error, change), now.largest
            errors.append(last)
            if now.within(step.tol) and (forward <= step.tol or now.within(0.0)):
                break
        solver = used[-1] if used else type(self._solver).__name__
        said = f"linearised {len(used)} times"
        return SolverResult(best, iterations, forward, solver, reason=said)

    def _linear_step(
        self, step: LoadStep, x: np.ndarray, forces: np.ndarray, error: float
    ) -> SolverResult:
        """The contact step of the body linearised at ``x``, whose forces ``-F(x)`` and error are known."""
        body = self._body
        body.linearise(x)
        b = body.linear_load(step.b, -forces)
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

    def _bind(self, stiffness: Sequence[NodalStiffness]) -> BoundSolver:
        """The solver, bound to the present tangent; the fixed point where that is none of a body by itself.

        Bodies under pressure may be stable on the plane alone: without it nodes would not give way to their reactions.
        """
        arguments = self._body, self._contacts, stiffness, self._memory
        try:
            return self._solver.bind(*arguments)
        except ValueError:
            return FixedPoint().bind(*arguments)

    def _part(self, step: LoadStep, x: np.ndarray, to: np.ndarray, most: float) -> Judged | None:
        """The iterate at a part of the way, judged; None if no part helps."""
        for length in halves(SHORTEST):
            judged = step.judged(to if length == 1.0 else x + length * (to - x))
            error, moved = judged.errors.largest, np.isfinite(step.size(judged.forces))
            # Supports that are not yet where they should be make any error infinite.
            if moved and (error < most or error == np.inf == most):
                return judged
        return None
