# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The state of a search: its best iterate, the estimated error, and whether to continue."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dolfinx_contact.law.maps import NodalMap
    from dolfinx_contact.step.load_step import LoadStep

# Iterations from which the convergence rate is estimated.
WINDOW = 3

# Iterates whose statuses are kept.
KEPT = 50


class Search:
    """Keeps the best iterate and decides when a search ends.

    Args:
        step: The ``LoadStep``.
        x: Initial displacement, owned degrees of freedom.
        max_seconds: Wall time after which the search ends, seconds.

    Attributes:
        best: The iterate with the smallest errors.
        nearest: That of the present attempt.
        error: The largest error of the last iterate.
        forward_error: Forward error of the best iterate, see docs/errors.md.
        iterations: Iterations so far.
        left: Iterations left in the present attempt.
        over: Whether the step is solved, or time has run out.
        statuses: Statuses of each contact in the last iterates.
    """

    def __init__(self, step: LoadStep, x: np.ndarray, max_seconds: float):
        self.step, self.best, self.nearest = step, x, x
        self.error = self._smallest = self.forward_error = np.inf
        self._rank = self._attempt = (True, np.inf)
        self._errors: deque[float] = deque(maxlen=WINDOW + 1)
        self.iterations = self.left = 0
        self.statuses: deque[list[np.ndarray]] = deque(maxlen=KEPT)
        self._start, self._seconds = perf_counter(), max_seconds
        self.over = self._lost = False

    def begin(self, x: np.ndarray, most: int, patience: float = math.inf) -> None:
        """Begin an attempt at ``x`` of at most ``most`` iterations; it is lost if its smallest error does not halve within ``patience`` of them."""
        self.left, self._lost, self._patience = most, False, patience
        self.nearest, self._attempt, self._smallest = x, (True, np.inf), np.inf
        self._halved, self._since = np.inf, self.iterations

    @property
    def within(self) -> bool:
        """Whether the errors of the best iterate are at most the tolerance."""
        return not self._rank[0]

    @property
    def goes_on(self) -> bool:
        """Whether the attempt continues: not over, not lost, and with iterations left."""
        return not (self.over or self._lost) and self.left > 0

    def count(self, iterations: int) -> None:
        """Count iterations that were done."""
        self.iterations += iterations
        self.left -= iterations

    def residual(self, x: np.ndarray, maps: Sequence[NodalMap], forces: np.ndarray) -> np.ndarray:
        """Residual at ``x``, given the step's ``forces`` there; records the errors of ``x``."""
        residual, errors = self.step.residual(x, maps, forces)
        self.error, tol = errors.largest, self.step.tol
        self._errors.append(errors.balance)
        self.statuses.append([contact.status for contact in self.step.contacts])
        change = errors.change * self._contraction()
        within = self.error <= tol  # then the forward error counts, too
        rank = (not within, max(self.error, change) if within else self.error)
        if rank < self._rank:
            self._rank, self.best, self.forward_error = rank, x, change
        if rank < self._attempt:
            self._attempt, self.nearest = rank, x
        self._smallest = min(self._smallest, self.error)
        if self._smallest < 0.5 * self._halved:
            self._halved, self._since = self._smallest, self.iterations
        self._lost = not np.isfinite(self.error) or self.iterations - self._since > self._patience
        solved = errors.acts and max(self.error, change) <= tol
        stalled = len(self._errors) > WINDOW and self._errors[0] <= 4 * errors.balance
        rounded = stalled and errors.within(0.0)
        self.over = bool(solved or rounded or self._late())
        return residual

    def _contraction(self) -> float:
        """Ratio of the remaining error to the last change, if convergence continues at its present rate."""
        last, first, steps = self._errors[-1], self._errors[0], len(self._errors) - 1
        if last == 0.0 or steps == 0:
            return 0.0 if last == 0.0 else 1.0
        rate = max(last / self._errors[-2], (last / first) ** (1 / steps))
        return rate / (1 - rate) if rate < 0.9 else 9.0

    def _late(self) -> bool:
        """Whether time is up on any rank; communicates only if there is a limit."""
        if self._seconds == math.inf:
            return False
        return bool(self.step.total([perf_counter() - self._start > self._seconds])[0] > 0)
