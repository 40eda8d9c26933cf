# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Newton's method on the contact problem condensed to the contact nodes, w = q + W r."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.law.friction import Friction, principal_axes
from dolfinx_contact.solvers.base import BoundSolver, Solver
from dolfinx_contact.solvers.condensed.input import checked_problem, proved_infeasible
from dolfinx_contact.solvers.condensed.kernel import condensed_operator
from dolfinx_contact.solvers.condensed.result import (
    Attempt,
    CondensedNotConverged,
    CondensedResult,
)
from dolfinx_contact.support.checks import RoundingWarning, positive

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import LoadStep


# Iteration limit if the user gives none; the single methods have limits of their own.
UNLIMITED_ITERATIONS = 200_000

# Default iteration limit of ``solve_condensed``, whose problem may have no solution: ITERATION_WORK
# over the square of the number of unknowns, at least FEWEST_ITERATIONS and PER_CONTACT iterations
# per contact, at most MOST_ITERATIONS.  Random problems of up to 12 contacts, with strong friction
# and crossed slip rules, need up to 6,500 iterations; a pile of 156 contacts needs 757.
ITERATION_WORK = 9e6
FEWEST_ITERATIONS = 600
PER_CONTACT = 10
MOST_ITERATIONS = 7000

# Number of iterations after which infeasibility is tested, and largest number of contacts for this
# test, which then takes less than a second.
FIRST_ITERATIONS = 100
PROVABLE_CONTACTS = 500

# Refinement of a solution whose reactions are still uncertain: tolerances relative to tol; it
# continues while the next Newton step falls below LEAST_GAIN of its last size, and stops if the
# error is below NEAR_ROUNDING times the rounding error.  Up to EXHAUSTIVE_UNKNOWNS unknowns, all
# methods may search again.
NEARER_TOLERANCES = (1e-2, 1e-4)
LEAST_GAIN = 0.1
NEAR_ROUNDING = 10
EXHAUSTIVE_UNKNOWNS = 100


@dataclass(frozen=True, kw_only=True)
class CondensedNewton(Solver):
    """Semismooth Newton method with a line search on the condensed problem ``w = q + W r``.

    If Newton's method fails, other methods are tried; see docs/solvers.md.

    Args:
        slip_tol: Largest slip error of a solution, dimensionless; by default equal to ``tol``.
        max_iterations: Iteration limit of all methods together.  The default is 200,000 for a body.
            For ``solve_condensed``, it falls from 7,000 (up to 12 contacts) to 600 (41 to 60
            contacts); for more contacts, it is ten per contact, at most 7,000.
        newton_iterations: Iteration limit of one attempt of Newton's method.
        max_seconds: Wall time after which the search ends, seconds; infinite by default.
        fallbacks: Whether to try other methods if Newton's method fails.

    Raises:
        ValueError: an option is not a positive number.

    Example:
        >>> solver = dc.CondensedNewton(max_seconds=60)  # for ContactProblem(..., solver=solver)
    """

    slip_tol: float | None = None
    max_iterations: int | None = None
    newton_iterations: int = 60
    max_seconds: float = math.inf
    fallbacks: bool = True

    def __post_init__(self) -> None:
        if self.slip_tol is not None:
            positive("slip_tol", self.slip_tol, finite=True)
        if self.max_iterations is not None:
            positive("max_iterations", self.max_iterations, whole=True)
        positive("newton_iterations", self.newton_iterations, whole=True)
        positive("max_seconds", self.max_seconds)

    def solve_condensed(
        self,
        operator: Any,
        friction: Friction,
        q: np.ndarray,
        tol: float,
        starts: Sequence[np.ndarray] = (),
        **given: Any,
    ) -> CondensedResult:
        """Return a solution of the condensed problem with a kernel operator, or raise.

        The arguments are those of ``search``.  The public function is ``solve_condensed``.  If
        errors exceed ``tol`` but not their rounding error, the solution is returned with a
        ``RoundingWarning``.

        Raises:
            CondensedNotConverged: no method reached ``tol`` or, if larger, the rounding error.
        """
        found, converged = self.search(operator, friction, q, tol, starts, **given)
        if not converged:
            raise CondensedNotConverged(found)
        if found.error > tol or found.slip_error > (self.slip_tol or tol):
            warnings.warn(
                f"error {found.error:.1e}, slip error {found.slip_error:.1e} instead of tol "
                f"{tol:.1e}: limited by rounding, {found.rounding:.1e}.",
                RoundingWarning,
                stacklevel=2,
            )
        return found

    def search(
        self,
        operator: Any,
        friction: Friction,
        q: Any,
        tol: float,
        starts: Sequence[np.ndarray] = (),
        monitor: Callable | None = None,
        **scales: Any,
    ) -> tuple[CondensedResult, bool]:
        """Return the best result with a kernel operator, and whether it is a solution.

        Args:
            operator: The kernel's ``CondensedOperator`` of ``W``.
            friction: Friction of the contacts, along its principal axes.
            q, starts: Displacement without reactions, and initial reactions.  The tied rows of the
                operator, if it has any, come last.
            tol: Largest error of a solution.
            monitor: None, or a function called for every iterate with the residual and the numbers
                of open, sticking and slipping contacts.
            scales: Scales of the errors: ``stiffness``, ``shape=(n,)``, ``tangential_stiffness``,
                ``shape=(n, T, T)``, and ``tied_stiffness``, ``shape=(tied,)``, all force per
                length; and ``external``, a force that acts in addition to the reactions.
        """
        tangents = operator.dim - 1
        # Friction(0) has no slip rule; a frictionless node among others gets an arbitrary one,
        # without effect.
        p = None if friction.frictionless else np.where(friction.mu > 0, friction.p, 1.0)
        found = operator.solve(
            mu=friction.mu[..., :tangents],
            p=None if p is None else p[..., :tangents],
            q=q,
            starts=list(starts),
            tol=tol,
            slip_tol=self.slip_tol or tol,
            max_seconds=self.max_seconds,
            max_iterations=int(self.max_iterations or UNLIMITED_ITERATIONS),
            newton_iterations=int(self.newton_iterations),
            fallbacks=bool(self.fallbacks),
            monitor=monitor,
            **scales,
        )
        tried = tuple(
            Attempt(a.branch, a.converged, a.iterations, a.seconds, a.error, a.slip_error)
            for a in found.tried
        )
        result = CondensedResult(
            found.reaction,
            found.displacement,
            found.status,
            found.error,
            found.slip_error,
            found.rounding,
            found.change,
            found.iterations,
            found.seconds,
            found.branch,
            tried,
            found.tied,
            found.local_error,
        )
        return result, bool(found.converged)

    def bind(self, step: LoadStep) -> BoundSolver:
        """See ``Solver``."""
        from dolfinx_contact.solvers.condensed.body import (
            BoundCondensedNewton,  # imported here: solve_condensed does not need DOLFINx
        )

        return BoundCondensedNewton(self, step)


def solve_condensed(
    W: Any,
    q: ArrayLike,
    friction: Friction | float | ArrayLike,
    *,
    solver: CondensedNewton | None = None,
    tol: float = 1e-8,
    r0: ArrayLike | None = None,
    max_seconds: float | None = None,
) -> CondensedResult:
    """Solve ``w = q + W r`` with the friction law between ``w`` and ``r`` at every contact.

    This needs neither a body nor DOLFINx.  ``W`` is the compliance between ``n`` contacts, ``q``
    their displacement without reactions.  Each contact has the components (t1, t2, n), in two
    dimensions (t, n): ``w_n`` is the gap at the end of the step, ``w_t`` the slip.

    The law [dSFMH07, Section 1] and both errors are those of ``ContactProblem``:

    - ``error = |r - proj(r - kappa (Q^2 w_t, w_n + |M Q^2 w_t|), K_mu)| / |r|`` with
      ``kappa = 1 / W_nn`` of each contact, Euclidean norms over all contacts;
    - ``slip_error = |kappa_t (w_t + |w_t| d)| / |r|`` over slipping contacts (``d`` the unit vector
    along ``P^-2 r_t``),
      ``|kappa_t w_t|`` over sticking ones, ``1 / kappa_t`` the compliance of the contact along that
      vector.

    Both are relative to the reactions in the state itself, or to the load ``|kappa (q_t, min(q_n,
    0))|`` if bodies jam and ``|r|`` exceeds it.  A result whose errors are above ``tol`` but below
    ``rounding`` is returned with a ``RoundingWarning``; a result whose ``local_error`` is above the
    square root of ``tol``, with a ``UserWarning``.

    Args:
        W: Compliance, ``shape=(3n, 3n)``, length per force; dense, or a SciPy sparse matrix, which
            is converted to a dense one.  It may be rank-deficient and slightly unsymmetric.
        q: Displacement without reactions, ``shape=(n, 3)``, or flat ``(3n,)``; ``(n, 2)`` in two
            dimensions; length units.
        friction: A ``Friction``, with coefficients common to all contacts, or ``shape=(n, 2)``, a
            pair for each; a number; or an array of isotropic coefficients, one per contact,
            ``shape=(n,)``.
        solver: ``CondensedNewton(...)``; None selects the default options.
        tol: Largest error, and largest slip error unless the solver has a ``slip_tol``.
        r0: Initial reactions, of the shape of ``q``.
        max_seconds: Wall time after which the search ends, seconds.

    Returns:
        A ``CondensedResult``: reactions, displacements, status, errors and the methods used.

    Raises:
        ValueError: an array has the wrong shape, or is not real and finite; a diagonal entry of
            ``W`` is negative, or a normal one is positive but negligible; or ``friction`` does not
            fit the contacts.
        CondensedNotConverged: no method reached ``tol``; ``failure.best`` is the best state.  If it
            is proved that no solution exists, ``failure.infeasible`` is True.

    Example:
        >>> dc.solve_condensed(np.eye(2), [[0.5, -1]], dc.Friction(mu=0.3)).reaction.round(6)  # (t, n): slips
        array([[-0.3,  1. ]])
    """
    began = perf_counter()
    q, W, friction, r0 = checked_problem(q, W, friction, r0)
    solver, tol = _checked_options(solver, tol, max_seconds)
    W, q, starts, turns = _along_axes(W, q, friction, r0)
    operator = condensed_operator(W, q.shape[1])
    left = solver.max_seconds - (perf_counter() - began)  # copies of a large W take seconds
    solver = replace(solver, max_seconds=max(left, 1e-9))
    try:
        found = _found(solver, operator, W, friction, q, tol, starts)
        return _turned_back(_nearer(solver, operator, friction, q, tol, found), turns)
    except CondensedNotConverged as failure:
        raise CondensedNotConverged(_turned_back(failure.best, turns)) from None


def _checked_options(
    solver: object, tol: float, max_seconds: float | None
) -> tuple[CondensedNewton, float]:
    solver = CondensedNewton() if solver is None else solver
    if not isinstance(solver, CondensedNewton):
        raise ValueError(f"solver {solver!r} is unknown here: use None or dc.CondensedNewton(...).")
    if max_seconds is not None:
        solver = replace(solver, max_seconds=max_seconds)
    tol = positive("tol", tol, finite=True)
    if tol < 1e-13:
        raise ValueError(f"tol must be at least 1e-13 (rounding forbids less), got {tol!r}.")
    return solver, tol


def _along_axes(W: np.ndarray, q: np.ndarray, friction: Friction, r0: np.ndarray | None) -> tuple:
    """Return ``W``, ``q`` and the start along the principal axes of friction, and the axes."""
    turns = principal_axes(friction, *q.shape)
    starts = () if r0 is None else [_turned(r0.reshape(q.shape), turns)]
    if friction.axes is not None:
        W, q = _turned_matrix(W, turns), _turned(q, turns)
    return W, q, starts, turns


def _found(
    solver: CondensedNewton,
    operator: Any,
    W: np.ndarray,
    friction: Any,
    q: np.ndarray,
    tol: float,
    starts: Sequence[np.ndarray],
) -> CondensedResult:
    """Return a solution; raise ``CondensedNotConverged`` if none is found.

    After ``FIRST_ITERATIONS`` iterations without success, infeasibility is tested before the search
    continues.
    """
    least = max(FEWEST_ITERATIONS, PER_CONTACT * len(q), int(ITERATION_WORK / q.size**2))
    most = solver.max_iterations or min(MOST_ITERATIONS, least)
    problem = operator, friction, q, tol, starts
    try:
        return replace(solver, max_iterations=min(FIRST_ITERATIONS, most)).solve_condensed(*problem)
    except CondensedNotConverged as failure:
        best, left = failure.best, solver.max_seconds - failure.best.seconds
        if left > 0 and len(q) <= PROVABLE_CONTACTS and proved_infeasible(W, q, tol):
            raise CondensedNotConverged(replace(best, branch="infeasible")) from None
        if (
            left <= 0 or best.iterations < FIRST_ITERATIONS or most <= FIRST_ITERATIONS
        ):  # nothing else to try
            raise
    # a restart repeats the first iterations, then continues
    return replace(solver, max_iterations=most, max_seconds=left).solve_condensed(*problem)


def _nearer(
    solver: CondensedNewton,
    operator: Any,
    friction: Any,
    q: Any,
    tol: float,
    found: CondensedResult,
) -> CondensedResult:
    """Refine a solution whose reactions are uncertain at the tolerance ``tol``.

    If ``W`` is ill conditioned, reactions may be far off although the error is ``tol``.  If
    contacts differ much in stiffness or load, this may hold for some of them.  For large problems,
    only Newton's method is used: if ``W`` is rank-deficient, the reactions are not unique anyway.
    """
    cheap = solver.fallbacks and q.size <= EXHAUSTIVE_UNKNOWNS
    most = min(solver.max_iterations or UNLIMITED_ITERATIONS, 100 * solver.newton_iterations)
    finer = replace(solver, slip_tol=None, fallbacks=cheap, max_iterations=most)

    def again(tol: float, **limits: Any):
        within = replace(finer, max_seconds=max(solver.max_seconds - found.seconds, 1e-3))
        nearer, done = within.search(operator, friction, q, tol, [found.reaction], **limits)
        both = dict(
            tried=found.tried + nearer.tried,
            iterations=found.iterations + nearer.iterations,
            seconds=found.seconds + nearer.seconds,
        )
        return replace(nearer, branch=found.branch, **both), done

    done = True
    for factor in NEARER_TOLERANCES:
        if found.change <= tol or found.error <= NEAR_ROUNDING * found.rounding:
            break
        if max(found.error, found.slip_error) > factor * tol:
            nearer, done = again(max(factor * tol, 1e-14))
            before, found = found, nearer if done else _better_result(nearer, found, tol)
            if not done or found.change > LEAST_GAIN * before.change:  # smaller errors do not help
                break
    if done and found.local_error > tol:
        nearer, done = again(tol, local_tol=tol)
        found = nearer if done else _better_result(nearer, found, tol)
    if found.local_error > math.sqrt(tol):  # half the requested digits
        warnings.warn(
            f"local_error {found.local_error:.1e}, tol {tol:.1e}: the contacts together obey the law, but not one that is far "
            "softer, or bears far less, than others. Solve such contacts by themselves, or with a smaller tol.",
            stacklevel=3,
        )
    return found


def _better_result(nearer: CondensedResult, found: CondensedResult, tol: float) -> CondensedResult:
    """Choose between a solution and the best state of a later search that did not converge.

    The later state is returned if its errors are at most ``tol`` and its local error is smaller.
    Otherwise the solution is returned with the updated record of methods, iterations and time.
    """
    if max(nearer.error, nearer.slip_error) <= tol and nearer.local_error < found.local_error:
        return nearer
    return replace(found, tried=nearer.tried, iterations=nearer.iterations, seconds=nearer.seconds)


def _turned(vectors: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Components of contact vectors along the principal axes of friction, ``shape=(n, dim)``."""
    return np.einsum("nij,nj->ni", turns, vectors)


def _turned_matrix(W: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Compliance ``W`` in components along the principal axes of friction."""
    n, dim, _ = turns.shape
    blocks = W.reshape(n, dim, n, dim)
    return np.einsum("aij,ajbk,blk->aibl", turns, blocks, turns, optimize=True).reshape(W.shape)


def _turned_back(result: CondensedResult, turns: np.ndarray) -> CondensedResult:
    back = {
        name: np.einsum("nji,nj->ni", turns, getattr(result, name))
        for name in ("reaction", "displacement")
    }
    return replace(result, **back)
