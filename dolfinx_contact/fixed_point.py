"""The paper's predictor-corrector as a fixed point of the displacement alone."""

from __future__ import annotations

import numpy as np

from dolfinx_contact.anderson import Anderson


class FixedPoint:
    """Predictor and corrector of the paper in every iteration, without a condensed operator.

    One iteration takes the reactions that the body asks for, ``K u - f`` at the contact nodes,
    does the predictor and the projection on the friction cone [dSFMH07, Section 2], puts the new
    reactions into the residual, and corrects the displacement by one back-solve with the
    stiffness plus springs ``rho diag(Q^2, 1)`` at the contact nodes.  The zero of the residual does
    not depend on rho.  Anderson's method accelerates the sequence.

    Args:
        depth: Number of previous corrections that Anderson's method mixes.
        max_iterations: Iterations with one metric before the next one is tried.
        metrics: Values of rho over the nodal normal stiffness, tried in this order until one
            converges; a change costs one factorisation.
    """

    def __init__(self, depth: int = 12, max_iterations: int = 300, metrics=(1.0, 3.0, 0.3)):
        self.depth, self.max_iterations, self.metrics = depth, max_iterations, tuple(metrics)

    def solve(self, system, x: np.ndarray, tol: float) -> tuple[np.ndarray, float, int]:
        """Iterate until ``system``'s error is at most ``tol``, or every metric has been tried.

        Args:
            system: Offers ``residual(x) -> (residual, error)``, ``correction(residual)``,
                ``use_metric(factor)`` and ``total(array)``; nothing else is known of it.
            x: Start, this rank's unknowns.

        Returns:
            The iterate of the smallest error, its error, and the number of iterations.
        """
        iterations = 0
        best = (np.inf, x)
        for metric in self.metrics:
            system.use_metric(metric)
            anderson = Anderson(x.size, self.depth, system.total)
            x, smallest = best[1], np.inf
            for _ in range(self.max_iterations):
                residual, error = system.residual(x)
                if error < best[0]:
                    best = (error, x)
                if error <= tol or not np.isfinite(error):
                    break
                following, norm = anderson.step(x, system.correction(residual))
                iterations += 1
                if norm > 1e3 * smallest:  # the differences mislead: start again from the best
                    anderson.restart()
                    following, smallest = best[1], np.inf
                smallest = min(smallest, norm)
                x = following
            if best[0] <= tol:
                break
        return best[1], best[0], iterations
