# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Progress of an iterative solver: best iterate, estimated error, and whether to continue."""

from __future__ import annotations

import math
from collections import deque
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import LoadStep, StepState

# Number of last iterations from which the convergence rate is estimated.
RATE_WINDOW = 3

# Number of last iterates over which changes of nodal status are counted, for error messages.
COUNTED_ITERATES = 50


class Search:
    """Progress of an iterative solver in one load step: best state, errors and stopping criteria.

    The search may consist of several attempts, each with its own start and iteration limit.

    Args:
        step: The load step.
        state: The initial state.
        max_seconds: Wall time after which the search ends, seconds.

    Attributes:
        best: The state with the smallest errors of all attempts.
        nearest: The state with the smallest errors of the present attempt.
        error: Largest relative error of the last iterate.  Far from a solution, only the error of
            equilibrium is evaluated.
        forward_error: Estimated forward error of the best state, see docs/errors.md.
        iterations: Number of iterations so far.
        left: Number of iterations left in the present attempt.
        over: Whether the search has ended: the step is solved, only rounding errors are left, or
            the time limit is reached.
        strayed: A force-free equilibrium of a body that is held by contact alone and was in contact
            at the end of the last step.  It may be the wrong solution.  None if no such state was
            found.
    """

    strayed: StepState | None = None

    def __init__(self, step: LoadStep, state: StepState, max_seconds: float):
        self.step, self.best, self.nearest = step, state, state
        self.error = self._smallest = self.forward_error = np.inf
        self._rank = self._attempt = (True, np.inf)
        self._errors: deque[float] = deque(maxlen=RATE_WINDOW + 1)
        self.iterations = self.left = 0
        self._states, self._status = 0, np.zeros(0, dtype=np.uint8)
        # number of the state in which each node last changed its status
        self._changed_in = np.zeros(0, dtype=int)
        self._start, self._seconds = perf_counter(), max_seconds
        self.over = self._lost = False

    def begin(self, state: StepState, most: int, patience: float = math.inf) -> None:
        """Begin a new attempt from a state.

        Args:
            state: The initial state of the attempt.
            most: Iteration limit of the attempt.
            patience: The attempt is given up if its smallest error has not halved within this
                number of iterations.
        """
        self.left, self._lost, self._patience = most, False, patience
        self.nearest, self._attempt, self._smallest = state, (True, np.inf), np.inf
        self._halved, self._since = np.inf, self.iterations

    @property
    def within(self) -> bool:
        """Whether all errors of the best state are at most the tolerance."""
        return not self._rank[0]

    @property
    def goes_on(self) -> bool:
        """Whether the present attempt continues: not ended or given up, iterations left."""
        return not (self.over or self._lost) and self.left > 0

    def count(self, iterations: int) -> None:
        """Add a number of completed iterations to the counters."""
        self.iterations += iterations
        self.left -= iterations

    def see(self, state: StepState) -> StepState:
        """Record an iterate: update errors, best state and stopping criteria; return the state.
        Collective.

        If its errors are at most the tolerance, they are evaluated again with the residual form F,
        and the state with these errors is recorded and returned.
        """
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
        within = self.error <= tol  # only then is the forward error part of the rank
        rank = (not within, max(self.error, change) if within else self.error)
        strays = not errors.acts and self.step.was_held_by_contact
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
        self.over = bool(solved or rounded or self._time_is_up())
        return state

    def count_changes(self, state: StepState) -> None:
        """Record which nodes have a different status (stick, slip, open) than in the last state."""
        status = np.concatenate([np.zeros(0, np.uint8), *(nodes.status for nodes in state.nodes)])
        if self._states == 0:
            self._status, self._changed_in = status, np.zeros(status.size, dtype=int)
        self._states += 1
        self._changed_in[status != self._status] = self._states
        self._status = status

    @property
    def changes(self) -> tuple[int, int]:
        """Numbers of this rank's nodes that changed status recently, and of states counted."""
        counted = min(self._states, COUNTED_ITERATES)
        first = self._states - counted + 1  # the first state has no predecessor
        return int(np.count_nonzero(self._changed_in > first)), counted

    def _contraction(self) -> float:
        """Ratio of the remaining error to the last change of the reactions.

        Assumes that convergence continues at its present rate.
        """
        last, first, steps = self._errors[-1], self._errors[0], len(self._errors) - 1
        if last == 0.0 or steps == 0:
            return 0.0 if last == 0.0 else 1.0
        rate = max(last / self._errors[-2], (last / first) ** (1 / steps))
        return rate / (1 - rate) if rate < 0.9 else 9.0

    def _time_is_up(self) -> bool:
        """Whether the time limit is reached on any rank.  Collective if there is a limit."""
        if self._seconds == math.inf:
            return False
        return bool(self.step.total([perf_counter() - self._start > self._seconds])[0] > 0)
