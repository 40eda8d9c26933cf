# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Result and exception of the condensed solver."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Attempt:
    """Record of one solution method that was tried.

    Attributes:
        branch: Name of the method.
        converged: Whether it found a solution.
        iterations: Number of its iterations.
        seconds: Its wall time, seconds.
        error: Smallest error found until its end, see ``CondensedResult``.
        slip_error: Slip error of the same state.
    """

    branch: str
    converged: bool
    iterations: int
    seconds: float
    error: float
    slip_error: float


@dataclass(frozen=True)
class CondensedResult:
    """Solution of ``solve_condensed`` for ``n`` contacts.

    Shapes are given for three dimensions; in two, arrays have one column less.

    Attributes:
        reaction: ``r``, ``shape=(n, 3)``, (t1, t2, n), in the cone, force units.
        displacement: ``w = q + W r``, ``shape=(n, 3)``: slip, then gap; length units.
        status: 0 open, 1 sticking, 2 slipping, ``shape=(n,)``, as ``dc.Status``.
        error: ``|r - proj(r - kappa w)|`` relative to the acting forces, see ``solve_condensed``.
        slip_error: Defect of the slip rule, as a force, relative to the same acting forces.
        local_error: Largest error of any single contact, relative to the force that acts there,
            ``max(|r|, kappa |w|)``; zero if it may be rounding alone.  ``error`` and ``slip_error``
            hardly detect errors at contacts that are much softer, or carry much less, than others.
        rounding: Rounding error of ``error`` and ``slip_error`` in double precision.  Where an
            accepted error exceeds ``tol``, it is below this value.
        change: Size of the next Newton step of the reactions, relative to the acting forces: an
            estimate of the distance to the nearest solution.  If W is ill conditioned, it is much
            larger than the error.  It says nothing about other solutions.
        iterations: Number of iterations of all methods tried.
        seconds: Wall time of all methods tried, seconds.
        branch: Name of the method that found the solution; "" if no solution was found;
            "infeasible" if it is proved that no solution exists.
        tried: All methods tried, in order.
        tied: Forces of the bilateral constraints of a kernel operator, if it has any.

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
    """Raised by ``solve_condensed`` if no method reached the tolerance.

    Attributes:
        best: The ``CondensedResult`` with the smallest errors found; not a solution.
        tried: The methods tried, a tuple of ``Attempt``.
        infeasible: Whether it is proved that no solution exists: for all reactions, a gap is
            negative.

    Example:
        >>> try:
        ...     found = dc.solve_condensed(np.eye(3), [[0.5, 0, -1]], friction)
        ... except dc.CondensedNotConverged as failure:
        ...     found = failure.best
    """

    def __init__(self, best: CondensedResult) -> None:
        self.best, self.tried = best, best.tried
        self.infeasible = best.branch == "infeasible"
        if self.infeasible:
            super().__init__(
                "no solution: whatever the reactions, the gaps of these contacts cannot all be zero or positive, since pressures on "
                "some of them move nothing (W y = 0), while q closes their gaps (q . y < 0). Check the signs of the normal components of "
                "q, and the motions that W leaves out."
            )
            return
        methods = ", ".join(f"{a.branch} ({a.iterations})" for a in best.tried)
        super().__init__(
            f"not converged: error {best.error:.3e}, slip error {best.slip_error:.3e} after "
            f"{best.iterations} iterations and {best.seconds:.3g} s. Tried (iterations): {methods}. "
            "Smaller load steps, or a start r0 near the solution, help most often, then more iterations, "
            "CondensedNewton(max_iterations=200_000); a body of too few degrees of freedom may have no solution at all."
        )

    def __reduce__(self) -> tuple:
        return type(self), (self.best,)
