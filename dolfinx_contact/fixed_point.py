"""Predictor and corrector as a fixed point of the displacement alone."""

from __future__ import annotations

import math
from time import perf_counter

import numpy as np

from dolfinx_contact.anderson import Anderson

# Factors of the nodal stiffness, tried in this order. The first ones needed the fewest iterations on
# the paper's punch; the paper's map weights slip by Q^2, which a larger rho makes up for.
METRICS = {"bipotential": (3.0, 1.0, 10.0), "return": (1.0, 3.0, 0.3)}

# The contact is linearised every EVERY iterations: by the first time most nodes have found their status,
# and easy steps are nearly over. If the error then grows by more than GROWTH, it was too early.
EVERY, GROWTH = 20, 100.0


class FixedPoint:
    """Predictor and corrector in every iteration, without a condensed operator.

    One iteration takes the reactions that the body asks for, ``K u - f`` at the contact nodes,
    does the predictor and the projection on the friction cone [dSFMH07, Section 2], puts the new
    reactions into the residual, and corrects the displacement by one back-solve with the
    stiffness plus springs at the contact nodes, see ``Contact.springs``.  The zero of the residual
    does not depend on the metric rho.  Anderson's method accelerates the sequence.  Every twenty iterations
    the contact is linearised, and the layers next to the plane are then corrected with that
    tangent before the back-solve, see ``SurfaceLayer``.

    Args:
        map: "return", or "bipotential", the paper's predictor and Euclidean projection, see
            ``Contact.update``.  The law is the same; with strongly non-associated friction "return"
            needs fewer iterations (docs/method.md).
        rho: Metric over the nodal normal stiffness; None finds it: the next value of a short list is
            tried where one does not converge, at the cost of a factorisation.
        depth: Number of previous corrections that Anderson's method mixes.
        max_iterations: Iterations with one metric.
        max_seconds: Wall time after which the search ends, seconds.

    Raises:
        ValueError: an unknown map, or a metric, depth or number of iterations that is not positive.
    """

    def __init__(
        self,
        map="return",
        rho=None,
        depth: int = 12,
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
        self.max_seconds = max_seconds

    def solve(self, system, x: np.ndarray, tol: float) -> tuple[np.ndarray, int]:
        """Iterate until ``system``'s error is at most ``tol``, or every metric has been tried.

        Args:
            system: Offers ``balanced(x)``, ``residual(x) -> (residual, error)``,
                ``correction(residual)``, ``use_metric(map, factor)``, ``linearise(x)``, ``forget_tangent()``,
                ``trial``, ``guess()`` and ``total(array)``; nothing else is known of it.
            x: Start, this rank's unknowns; for the bare ``system.trial``, ``system.guess()`` is taken.

        Returns:
            The iterate of the smallest error, and the number of iterations.
        """
        iterations, start = 0, perf_counter()
        best = (np.inf, system.guess() if x is system.trial else x)
        for factor in METRICS[self.map] if self.rho is None else (self.rho,):
            system.use_metric(self.map, factor)
            anderson = Anderson(x.size, self.depth, system.total)
            x, smallest, due, bound = best[1], np.inf, EVERY, np.inf
            for iteration in range(self.max_iterations):
                x = system.balanced(x)
                residual, error = system.residual(x)
                if error < best[0]:
                    best = (error, x)
                if error <= tol or not np.isfinite(error):
                    break
                if self._late(start, system):
                    return best[1], iterations
                if error > bound:  # the tangent misleads: without it, again from the best
                    system.forget_tangent()
                    anderson.restart()
                    x, bound, smallest, due = best[1], np.inf, np.inf, iteration + EVERY
                    continue
                if iteration >= due:
                    system.linearise(x)
                    anderson.restart()
                    bound, smallest, due = GROWTH * error, np.inf, iteration + EVERY
                following, norm = anderson.step(x, system.correction(residual))
                iterations += 1
                if norm > 1e3 * smallest:  # the differences mislead: start again from the best
                    anderson.restart()
                    following, smallest = best[1], np.inf
                smallest = min(smallest, norm)
                x = following
            if best[0] <= tol:
                break
        return best[1], iterations

    def _late(self, start: float, system) -> bool:
        """Whether the time is up on any rank; asks them only if there is a limit."""
        if self.max_seconds == math.inf:
            return False
        return bool(system.total([perf_counter() - start > self.max_seconds])[0] > 0)
