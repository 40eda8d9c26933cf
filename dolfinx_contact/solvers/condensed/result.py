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
        error: ``|r - proj(r - kappa w)|`` relative to the acting forces, see ``solve_condensed``.
        slip_error: Defect of the slip rule, as a force, relative to the same.
        local_error: The largest error of any single contact, relative to the force that acts there, ``max(|r|, kappa |w|)``; zero
            if rounding may explain it.  ``error`` and ``slip_error`` hardly detect errors at contacts that are much softer, or
            carry much less, than others.
        rounding: Rounding error of both in double precision; an error above ``tol`` is below it.
        change: Size of the next Newton step of the reactions, relative to the same forces: an estimate of the distance to the
            nearest solution.  If W is ill conditioned, it is much larger than the error.  It says nothing about other solutions.
        iterations: Of all methods tried.
        seconds: Wall time of all methods tried.
        branch: The method that found the solution; if none was found "", or "infeasible" if it is proved that none exists.
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
    """No method reached the tolerance.

    Attributes:
        best: The ``CondensedResult`` of the smallest errors found; not a solution.
        tried: The methods tried, a tuple of ``Attempt``.
        infeasible: Whether it is proved that there is no solution: whatever the reactions, a gap is negative.

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
