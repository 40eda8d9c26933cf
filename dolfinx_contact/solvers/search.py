# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The best iterate of a step so far, how far it may be off, and whether the search goes on."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dolfinx_contact.solvers.protocols import MapLike, StepLike

# Steps over which the fall of the errors is taken.
WINDOW = 3

# States whose statuses are kept.
KEPT = 50


class Search:
    """Keeps the best iterate.

    Args:
        step: The ``LoadStep``.
        x: Where the search begins.
        max_seconds: Wall time after which it ends, seconds.
        most: Iterations after which it ends.

    Attributes:
        best: The iterate of the smallest errors.
        error: The largest error of the last one.
        forward_error: Of the best one, see docs/errors.md.
        iterations: Done so far.
        left: Iterations left.
        over: Solved, or out of time or iterations.
        statuses: Of each contact in the last states.
    """

    def __init__(self, step: StepLike, x: np.ndarray, max_seconds: float, most: float = math.inf):
        self.step, self.best = step, x
        self.error = self._smallest = self.forward_error = np.inf
        self._rank = (True, np.inf)
        self._errors: deque[float] = deque(maxlen=WINDOW + 1)
        self.iterations = self.left = 0
        self.statuses: deque[list[np.ndarray]] = deque(maxlen=KEPT)
        self._start, self._seconds, self._most = perf_counter(), max_seconds, most
        self.over = self._lost = False

    def begin(self, most: int, patience: float = math.inf) -> None:
        """Once more, with so many iterations at most, in each ``patience`` of which the smallest error has to halve."""
        self.left, self._lost, self._patience = most, False, patience
        self._halved, self._since = np.inf, self.iterations

    @property
    def within(self) -> bool:
        """Whether the errors of the best iterate are at most the tolerance."""
        return not self._rank[0]

    @property
    def goes_on(self) -> bool:
        """Neither over nor lost nor at its last iteration."""
        return not (self.over or self._lost) and self.left > 0

    def count(self, iterations: int) -> None:
        """Iterations that were done."""
        self.iterations += iterations
        self.left -= iterations

    def residual(self, x: np.ndarray, maps: Sequence[MapLike], forces: np.ndarray) -> np.ndarray:
        """Forces out of balance of ``x``, with the step's ``forces`` there; takes note of its errors."""
        residual, errors = self.step.residual(x, maps, forces)
        self.error, tol = errors.largest, self.step.tol
        self._errors.append(self.error)
        self.statuses.append([contact.status for contact in self.step.contacts])
        change = errors.change * self._contraction()
        within = self.error <= tol  # of those the forward error counts, too
        rank = (not within, max(self.error, change) if within else self.error)
        if rank < self._rank:
            self._rank, self.best, self.forward_error = rank, x, change
        self._smallest = min(self._smallest, self.error)
        if self._smallest < 0.5 * self._halved:
            self._halved, self._since = self._smallest, self.iterations
        self._lost = not np.isfinite(self.error) or self.iterations - self._since > self._patience
        solved = errors.acts and max(self.error, change) <= tol
        stalled = len(self._errors) > WINDOW and self._errors[0] <= 4 * self.error
        rounded = stalled and errors.within(0.0)
        spent = self.iterations >= self._most
        self.over = bool(solved or rounded or spent or self._late())
        return residual

    def _contraction(self) -> float:
        """What is left to go over the last step, were errors to fall on as in the last steps."""
        last, first, steps = self._errors[-1], self._errors[0], len(self._errors) - 1
        if last == 0.0 or steps == 0:
            return 0.0 if last == 0.0 else 1.0
        rate = max(last / self._errors[-2], (last / first) ** (1 / steps))
        return rate / (1 - rate) if rate < 0.9 else 9.0

    def _late(self) -> bool:
        """Whether the time is up on any rank; asks them only if there is a limit."""
        if self._seconds == math.inf:
            return False
        return bool(self.step.total([perf_counter() - self._start > self._seconds])[0] > 0)
