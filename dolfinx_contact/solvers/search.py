# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The state of a search: its best iterate, the estimated error, and whether to continue."""

from __future__ import annotations

import math
from collections import deque
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import LoadStep, StepState

# Iterations from which the convergence rate is estimated.
RATE_WINDOW = 3

# Iterates in which it is counted how many nodes change their status.
COUNTED_ITERATES = 50


class Search:
    """Keeps the best state and decides when a search ends.

    Args:
        step: The ``LoadStep``.
        state: Where it begins.
        max_seconds: Wall time after which the search ends, seconds.

    Attributes:
        best: The state with the smallest errors.
        nearest: That of the present attempt.
        error: The largest error of the last state; far from the tolerance that of equilibrium alone.
        forward_error: Forward error of the best state, see docs/errors.md.
        iterations: Iterations so far.
        left: Iterations left in the present attempt.
        over: Whether the step is solved, or time has run out.
        strayed: A state without forces of a loose body that was pressed: another one may be the answer; None if none was met.
    """

    strayed: StepState | None = None

    def __init__(self, step: LoadStep, state: StepState, max_seconds: float):
        self.step, self.best, self.nearest = step, state, state
        self.error = self._smallest = self.forward_error = np.inf
        self._rank = self._attempt = (True, np.inf)
        self._errors: deque[float] = deque(maxlen=RATE_WINDOW + 1)
        self.iterations = self.left = 0
        self._states, self._status = 0, np.zeros(0, dtype=np.uint8)
        self._changed_in = np.zeros(0, dtype=int)  # in which state each node has last changed
        self._start, self._seconds = perf_counter(), max_seconds
        self.over = self._lost = False

    def begin(self, state: StepState, most: int, patience: float = math.inf) -> None:
        """Begin an attempt at a state, of at most ``most`` iterations; it is lost if its smallest error does not halve within ``patience`` of them."""
        self.left, self._lost, self._patience = most, False, patience
        self.nearest, self._attempt, self._smallest = state, (True, np.inf), np.inf
        self._halved, self._since = np.inf, self.iterations

    @property
    def within(self) -> bool:
        """Whether the errors of the best state are at most the tolerance."""
        return not self._rank[0]

    @property
    def goes_on(self) -> bool:
        """Whether the attempt continues: not over, not lost, and with iterations left."""
        return not (self.over or self._lost) and self.left > 0

    def count(self, iterations: int) -> None:
        """Count iterations that were done."""
        self.iterations += iterations
        self.left -= iterations

    def see(self, state: StepState) -> StepState:
        """Take note of a state; where its errors are at most the tolerance it is judged by F itself.  Returns it.  Collective."""
        errors, tol = state.balance, self.step.tol
        if not state.is_far:
            errors = state.errors
            if errors.within(tol):
                state, change = state.confirmed, errors.change
                errors = state.errors._replace(change=change)
        self.step.tell(state)
        self.error = errors.largest
        self._errors.append(errors.balance)
        self.count_changes(state)
        change = errors.change * self._contraction()
        within = self.error <= tol  # then the forward error counts, too
        rank = (not within, max(self.error, change) if within else self.error)
        strays = not errors.acts and self.step.was_pressed
        if rank < self._rank and not strays:
            self._rank, self.best, self.forward_error = rank, state, change
        if rank < self._attempt and not strays:
            self._attempt, self.nearest = rank, state
        self._smallest = min(self._smallest, self.error)
        if self._smallest < 0.5 * self._halved:
            self._halved, self._since = self._smallest, self.iterations
        self._lost = not np.isfinite(self.error) or self.iterations - self._since > self._patience
        solved = errors.acts and max(self.error, change) <= tol
        stalled = len(self._errors) > RATE_WINDOW and self._errors[0] <= 4 * errors.balance
        rounded = stalled and errors.within(0.0)
        if rounded and strays:
            self.strayed, self._lost, rounded = state, True, False
        self.over = bool(solved or rounded or self._late())
        return state

    def count_changes(self, state: StepState) -> None:
        """Take note of nodes whose status is another one than in the last state."""
        status = np.concatenate([np.zeros(0, np.uint8), *(nodes.status for nodes in state.nodes)])
        if self._states == 0:
            self._status, self._changed_in = status, np.zeros(status.size, dtype=int)
        self._states += 1
        self._changed_in[status != self._status] = self._states
        self._status = status

    @property
    def changes(self) -> tuple[int, int]:
        """How many nodes of this rank have changed their status in the last states, and in how many of these."""
        counted = min(self._states, COUNTED_ITERATES)
        first = self._states - counted + 1  # the first one has nothing before it
        return int(np.count_nonzero(self._changed_in > first)), counted

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
