# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the solution of a condensed problem returns, or raises."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Attempt:
    """One method that was tried, and the smallest errors found until its end."""

    branch: str
    converged: bool
    iterations: int
    seconds: float
    error: float
    slip_error: float


@dataclass(frozen=True)
class CondensedResult:
    """Solution of ``solve_condensed``; ``n`` contacts, in three dimensions (in two, one column less).

    Attributes:
        reaction: ``r``, ``shape=(n, 3)``, (t1, t2, n), in the cone, force units.
        displacement: ``w = q + W r``, ``shape=(n, 3)``: slip, then gap; length units.
        status: 0 open, 1 sticking, 2 slipping, ``shape=(n,)``, as ``dc.Status``.
        error: ``|r - proj(r - kappa w)|`` over the forces that act, see ``solve_condensed``.
        slip_error: Defect of the slip rule, as a force, over the same.
        local_error: The largest of both errors of one contact, over the force that acts in it, ``max(|r|, kappa |w|)`` of
            that contact; zero if rounding may explain it.  ``error`` and ``slip_error`` hardly see contacts that are far
            softer, or bear far less, than others.
        rounding: What double precision leaves of the errors; an error above ``tol`` is below it.
        change: How much Newton's next step would still move the reactions, over the same forces:
            an estimate of what is missing to the solution nearby, which where W is ill conditioned
            is far more than the error.  It knows nothing of other solutions.
        iterations: Of all methods tried.
        seconds: Wall time of all methods tried.
        branch: The method that gave the answer.
        tried: All that were tried, in order.
        tied: Forces of the tied rows of a kernel operator, if it has any.

    Example:
        >>> found = dc.solve_condensed(np.eye(3), [[0.5, 0, -1]], friction)
        >>> found.status == dc.Status.SLIP
        array([ True])
    """

    reaction: np.ndarray
    displacement: np.ndarray
    status: np.ndarray
    error: float
    slip_error: float
    rounding: float
    change: float
    iterations: int
    seconds: float
    branch: str
    tried: tuple[Attempt, ...] = field(repr=False)
    tied: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
    local_error: float = 0.0


class CondensedNotConverged(RuntimeError):
    """No method reached the tolerance.

    Attributes:
        best: The ``CondensedResult`` of the smallest errors found; not a solution.
        tried: What was tried, a tuple of ``Attempt``.

    Example:
        >>> try:
        ...     found = dc.solve_condensed(np.eye(3), [[0.5, 0, -1]], friction)
        ... except dc.CondensedNotConverged as failure:
        ...     found = failure.best
    """

    def __init__(self, best: CondensedResult) -> None:
        self.best, self.tried = best, best.tried
        methods = ", ".join(f"{a.branch} ({a.iterations})" for a in best.tried)
        super().__init__(
            f"not converged: error {best.error:.3e}, slip error {best.slip_error:.3e} after "
            f"{best.iterations} iterations and {best.seconds:.3g} s. Tried (iterations): {methods}. "
            "Smaller load steps, or a start r0 near the solution, help most often, then more iterations, "
            "CondensedNewton(max_iterations=200_000); a body of too few degrees of freedom may have no solution at all."
        )

    def __reduce__(self) -> tuple:
        return type(self), (self.best,)
