"""Predictor and corrector as a fixed point of the displacement alone."""

from __future__ import annotations

import math
from time import perf_counter

import numpy as np

from dolfinx_contact.anderson import Anderson
from dolfinx_contact.smoothing_newton import SmoothingNewton

# Factors of the nodal stiffness, tried in this order. The first ones needed the fewest iterations on
# the paper's punch; the paper's map weights slip by Q^2, which a larger rho makes up for.
METRICS = {"bipotential": (3.0, 1.0, 10.0), "return": (1.0, 3.0, 0.3)}

# The contact is linearised every EVERY iterations: by the first time most nodes have found their status,
# and easy steps are nearly over. If the error then grows by more than GROWTH, it was too early; if two
# tangents do not bring it down to FALL, statuses are still changing.
EVERY, GROWTH, FALL = 20, 100.0, 0.3


class FixedPoint:
    """Predictor and corrector in every iteration, without a condensed operator.

    One iteration takes the reactions that the body asks for, ``K u - f`` at the contact nodes,
    does the predictor and the projection on the friction cone [dSFMH07, Section 2], puts the new
    reactions into the residual, and corrects the displacement by one back-solve with the
    stiffness plus springs at the contact nodes, see ``Contact.springs``.  The zero of the residual
    does not depend on the metric rho.  Anderson's method accelerates the sequence.  Every twenty iterations
    the contact is linearised, and the layers next to the plane are then corrected with that
    tangent before the back-solve, see ``SurfaceLayer``.

    A hard step, in which such a tangent does not help, is left to Newton's method on the same residual with the
    law rounded off, see ``SmoothingNewton``: an iteration is then one of GMRES with the same correction.  If
    that fails, too, the fixed point goes on.

    Args:
        map: "return", or "bipotential", the paper's predictor and Euclidean projection, see
            ``Contact.update``.  The law is the same; with strongly non-associated friction "return"
            needs fewer iterations (docs/method.md).
        rho: Metric over the nodal normal stiffness; None finds it: the next value of a short list is
            tried where one does not converge, at the cost of a factorisation.
        depth: Number of previous corrections that Anderson's method mixes.
        newton: Whether Newton's method may be tried, with the first metric.
        max_iterations: Iterations with one metric; those of Newton's method come on top.
        max_seconds: Wall time after which the search ends, seconds.

    Raises:
        ValueError: an unknown map, or a metric, depth or number of iterations that is not positive.
    """

    def __init__(
        self,
        map="return",
        rho=None,
        depth: int = 12,
        newton: bool = True,
        max_iterations: int = 400,
        max_seconds: float = math.inf,
    ):
        if map not in METRICS:
            raise ValueError(f"map must be one of {', '.join(METRICS)}, got {map!r}.")
        for name, value in (
            ("rho", rho),
            ("depth", depth),
            ("max_iterations", max_iterations),
            ("max_seconds", max_seconds),
        ):
            if not (value is None and name == "rho" or value > 0):
                raise ValueError(f"{name} must be positive, got {value!r}.")
        self.map, self.rho, self.depth, self.max_iterations = map, rho, depth, max_iterations
        self.newton, self.max_seconds = bool(newton), max_seconds

    def solve(self, system, x: np.ndarray | None, tol: float) -> tuple[np.ndarray, int]:
        """Iterate until ``system``'s error is at most ``tol``, or every metric has been tried.

        Args:
            system: Offers ``balanced(x)``, ``residual(x) -> (residual, error)``,
                ``correction(residual)``, ``use_metric(map, factor)``, ``linearise(x)``,
                what ``SmoothingNewton`` and ``NewtonKrylov`` need, ``guess()`` and ``total(array)``;
                nothing else is known of it.
            x: Start, this rank's unknowns; None takes ``system.guess()``.

        Returns:
            The iterate of the smallest error, and the number of iterations.
        """
        x = system.guess() if x is None else x
        search = _Search(system, x, tol, self.max_seconds)
        hasty = self.newton
        for factor in METRICS[self.map] if self.rho is None else (self.rho,):
            search.begin(self.max_iterations)
            x = search.best
            while search.goes_on:
                system.use_metric(self.map, factor)
                linearised = self._accelerate(search, x, hasty)
                x = search.best  # of before Newton's method, which may end in a corner
                if hasty and search.goes_on:
                    SmoothingNewton(search).solve(linearised)
                hasty = False
            if search.over:
                break
        return search.best, search.iterations

    def _accelerate(self, search, x: np.ndarray, hasty: bool) -> np.ndarray | None:
        """Anderson's method from ``x``, until a tangent misleads, or two do not help if it is ``hasty``.

        Returns:
            Where the first of the two was taken.
        """
        system, last, before = search.system, (np.inf, None), (np.inf, None)
        anderson = Anderson(x.size, self.depth, system.total)
        smallest, due = np.inf, search.left - EVERY
        while True:
            x, residual = search.residual(x)
            if not search.goes_on or search.error > GROWTH * last[0]:
                return last[1]
            if search.left <= due:
                if hasty and search.error > FALL * before[0]:
                    return before[1]
                # not where the end is as near as the last tangent is behind
                if last[1] is None or search.error**2 > search.tol * last[0]:
                    system.linearise(x)
                    anderson.restart()
                    smallest = np.inf
                last, before = (search.error, x), last
                due = search.left - EVERY
            following, norm = anderson.step(x, system.correction(residual))
            search.count(1)
            if norm > 1e3 * smallest:  # the differences mislead: start again from the best
                anderson.restart()
                following, smallest = search.best, np.inf
            smallest = min(smallest, norm)
            x = following


class _Search:
    """The best iterate so far, and whether the search goes on."""

    def __init__(self, system, x: np.ndarray, tol: float, max_seconds: float):
        self.system, self.best, self.tol = system, x, tol
        self.error = self._smallest = np.inf
        self.iterations = self.left = 0
        self._start, self._seconds = perf_counter(), max_seconds
        self.over = self._lost = False

    def begin(self, most: int) -> None:
        """Another metric, with so many iterations at most."""
        self.left, self._lost = most, False

    @property
    def goes_on(self) -> bool:
        """With the present metric."""
        return not (self.over or self._lost) and self.left > 0

    def count(self, iterations: int) -> None:
        """Iterations that were done."""
        self.iterations += iterations
        self.left -= iterations

    def residual(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """``x`` in balance, and its residual."""
        x = self.system.balanced(x)
        residual, self.error = self.system.residual(x)
        if self.error < self._smallest:
            self._smallest, self.best = self.error, x
        self._lost = not np.isfinite(self.error)
        self.over = self.error <= self.tol or self._late()
        return x, residual

    def _late(self) -> bool:
        """Whether the time is up on any rank; asks them only if there is a limit."""
        if self._seconds == math.inf:
            return False
        return bool(self.system.total([perf_counter() - self._start > self._seconds])[0] > 0)
