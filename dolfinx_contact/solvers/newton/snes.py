# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""PETSc's non-linear solver SNES, applied to the residual of body and contact together."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from petsc4py import PETSc

from dolfinx_contact.bodies.input import warn_of_unread
from dolfinx_contact.law.maps import ReturnMap
from dolfinx_contact.petsc.linear_solver import LinearSolverError, options_given
from dolfinx_contact.solvers.base import BoundSolver, Solver, SolverName, SolverResult
from dolfinx_contact.solvers.newton.contact_tangent import ContactTangent, OnTangent
from dolfinx_contact.solvers.newton.sparse_newton import NORMAL_FACTOR, Descent
from dolfinx_contact.solvers.search import Search

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import LoadStep, StepState

DEFAULT_OPTIONS = {"snes_type": "newtonls", "snes_linesearch_type": "l2"}
# Iteration limit of the search: far above ``snes_max_it``, so that SNES alone decides when to stop.
MOST_ITERATIONS = 10_000
SNES_REASONS = {
    value: name for name, value in vars(PETSc.SNES.ConvergedReason).items() if name[0] in "CD"
}


@dataclass(frozen=True, eq=False)  # a dictionary has no hash
class SNES(Solver):
    """PETSc's SNES on the equations of ``SparseNewton``, with its types, line searches and options.

    One Newton step first imposes the boundary values and finds which nodes are in contact; SNES
    continues from there.  It ends when the errors of the step are at most the ``tol`` of the
    problem; ``snes_rtol`` and similar options are ignored.  The prefix of its options is the
    problem's ``petsc_options_prefix``. Linear systems are factorised; the prefix of their options
    ends in ``tangent_``.

    Attributes:
        petsc_options: Dictionary of SNES options without prefix.  The environment variable
            PETSC_OPTIONS and the command line override them.

    Raises:
        ValueError: ``petsc_options`` is not a dictionary.

    Example:
        >>> solver = dc.SNES({"snes_linesearch_type": "l2"})  # for ContactProblem(..., solver=solver)
    """

    nonlinear: ClassVar[bool] = True
    petsc_options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.petsc_options, dict):
            raise ValueError(
                f'petsc_options must be a dictionary such as {{"snes_monitor": None}}, got {self.petsc_options!r}.'
            )

    def bind(self, step: LoadStep) -> BoundSolver:
        """See ``Solver``."""
        return BoundSNES(self, step)


class BoundSNES(OnTangent):
    """PETSc's SNES, set up for the load steps of one problem."""

    def solve(
        self, step: LoadStep, starts: Sequence[Any] = (), start: StepState | None = None
    ) -> SolverResult:
        """Run SNES until the errors are at most the tolerance or SNES stops; return the best state.

        Args:
            step: The load step.
            starts: Not used.
            start: The initial state; None takes ``step.start()``.
        """
        state = step.start() if start is None else start
        search = Search(step, state, math.inf)
        search.begin(search.best, MOST_ITERATIONS)
        kappa = [contact.stiffness.normal for contact in step.contacts]
        maps = [ReturnMap(NORMAL_FACTOR * rho, rho) for rho in kappa]
        message = "converged at its start"
        with np.errstate(all="ignore"):  # a trial displacement may invert elements
            state = step.evaluate(state.x, maps, before=state.as_start)
            if step.held(state.x):
                search.see(state)
            if not search.over:
                try:
                    state = self._supports_moved(step, state, maps, search, stands=start is None)
                    message = self._iterate(_Equations(self._tangent, maps, search, state), state.x)
                except LinearSolverError as failure:
                    message = str(failure)
        return SolverResult(
            search.best, search.iterations, search.forward_error, SolverName.SNES, reason=message
        )

    def _supports_moved(
        self,
        step: LoadStep,
        state: StepState,
        maps: Sequence[ReturnMap],
        search: Search,
        stands: bool,
    ) -> StepState:
        """Apply Newton steps until the displacement has its boundary values; return that state.

        One step is usually enough.

        Raises:
            LinearSolverError: no part of a Newton step reduces the residual enough.
        """
        descent, length = Descent(step, self._tangent, stands), 1.0
        descent.begin(maps)
        while length > 0.0:
            state, length = descent.advance(state, chord=False)
            search.count(1)
            if step.held(state.x):
                return state
        raise LinearSolverError("no part of Newton's step brings the supports to their places.")

    def _iterate(self, equations: _Equations, x: np.ndarray) -> str:
        """Run SNES from a displacement; return its type and converged reason as text."""
        X, residual = self._tangent.matrix.createVecs()
        X.array_w[:] = x
        snes = PETSc.SNES().create(self._body.comm)
        snes.setOptionsPrefix(self._body.prefix)
        snes.setKSP(self._tangent.ksp)
        snes.setFunction(equations.calls(equations.function), residual)
        snes.setJacobian(equations.calls(equations.jacobian), self._tangent.matrix)
        snes.setConvergenceTest(equations.calls(equations.test))
        given = self._options.petsc_options
        try:
            with options_given(self._body.prefix, DEFAULT_OPTIONS | given) as unread:
                snes.setFromOptions()
                snes.solve(None, X)
            warn_of_unread([name for name in unread if name in given])
            equations.search.count(snes.getIterationNumber())
            reason = snes.getConvergedReason()
            return f"{snes.getType()}, {SNES_REASONS.get(reason, reason)}"
        except PETSc.Error as failure:  # since PETSc 3.25, it hides the exception of a callback
            raise equations.failure or failure from None
        finally:
            for part in (snes, X, residual):
                part.destroy()


class _Equations:
    """Callbacks of SNES: residual, Jacobian and convergence test.

    Attributes:
        search: The ``Search``, which keeps the best iterate.
        failure: The exception that a callback raised; None if there was none.
    """

    def __init__(
        self,
        tangent: ContactTangent,
        maps: Sequence[ReturnMap],
        search: Search,
        state: StepState,
    ):
        self.search, self.failure = search, None
        self._step, self._tangent, self._maps = search.step, tangent, maps
        self._seen = self._last = state

    def calls(self, work: Callable) -> Callable:
        """Return a callback that calls ``work`` and stores its exception in ``failure``."""

        def call(*arguments: Any):
            try:
                return work(*arguments)
            except BaseException as failure:
                self.failure = failure
                raise

        return call

    def _at(self, X: PETSc.Vec) -> StepState:
        """Return the state at a displacement; the last one is cached for repeated calls."""
        if not self._step.body.same(X.array_r, self._last.x):
            self._last = self._step.evaluate(X.array_r.copy(), self._maps, before=self._seen)
        return self._last

    def function(self, snes: PETSc.SNES, X: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Compute minus the forces out of balance; zero at constrained degrees of freedom."""
        residual.array_w[:] = -self._at(X).residual

    def jacobian(self, snes: PETSc.SNES, X: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        """Assemble the derivative of ``function`` in the matrix of the contact tangent."""
        state, body = self._at(X), self._step.body
        if body.nonlinear:
            body.linearise(state.x)
        self._tangent.linearise(self._step.derivatives(state, self._maps))

    def test(self, snes: PETSc.SNES, iteration: int, norms: tuple) -> int:
        """Return PETSc's reason for convergence if the search has ended, else 0.

        The criterion is the errors of the load step, instead of PETSc's norms.
        """
        self._seen = self.search.see(self._at(snes.getSolution()))
        done = self.search.over
        return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE if done else 0
