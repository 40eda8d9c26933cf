# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Outer loops of a load step: staggered iterations over lagged quantities.

A step is solved with lagged quantities, such as friction that follows the pressure, evaluated at
the previous solution.  They are grouped into levels, the innermost loop first.  After each
solution, the levels are checked in this order.  The quantities of the first level that has not
converged are updated, the levels inside it are restarted, and the step is solved again: nested
fixed-point loops.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep, StepState

Level = Sequence["Lagged"]
Search = Callable[["LoadStep"], "SolverResult"]


class Change(NamedTuple):
    """Difference between the value of a lagged quantity and its value at the solution found.

    Attributes:
        settled: Whether the difference is within the tolerance.
        state: State to continue with; its step is the step to continue with.
        size: Norm of the forces due to the difference, relative to the reactions.
        forward: Forward error due to the difference.
        tol: Tolerance of the next solution; 0 is the default of the level.
        refused: Why no other value helps, in words; empty otherwise.
    """

    settled: bool
    state: StepState
    size: float = 0.0
    forward: float = 0.0
    tol: float = 0.0
    refused: str = ""


class Lagged:
    """Base class of lagged quantities, which are constant while a step is solved.

    Attributes:
        limit: Largest number of updates between two updates of an outer level.
        first_tol: Tolerance of the first solution after a restart, at least.
    """

    limit, first_tol = 5, 0.0

    def restarted(self, step: LoadStep) -> LoadStep:
        """Return the step with the initial value; an outer level was updated.  Collective."""
        return step

    def change(self, found: SolverResult, goal: float) -> Change:
        """Return the difference between the value used and the solution found.  Collective.

        Args:
            found: Result of the solver, with the state found.
            goal: Tolerance of the step.
        """
        raise NotImplementedError

    def renewed(self, step: LoadStep, state: StepState) -> LoadStep:
        """Return the step with the value at a state, to be solved again.  Collective."""
        raise NotImplementedError

    def not_settled(self, change: Change) -> str:
        """Return the error message if the limit is reached; empty if the errors suffice."""
        return ""

    def message(self, solutions: int) -> str:
        """Return the remark for the record of a step after this number of solutions."""
        return ""


class Staggered(NamedTuple):
    """Result of the outer loops.

    Attributes:
        found: Result of the last solution.
        changes: Last ``Change.size`` of each lagged quantity, by class name.
        refused: Why the result is no solution, in words; empty if it is one.
    """

    found: SolverResult
    changes: dict
    refused: str


def solve_staggered(
    step: LoadStep, levels: Sequence[Level], search: Search, goal: float
) -> Staggered:
    """Solve a step until all lagged quantities agree with the solution.  Collective.

    Args:
        step: The step, solved to its own tolerance until all lagged quantities have converged.
        levels: Lagged quantities by levels, the innermost loop first.
        search: Function that solves a step with fixed lagged quantities.
        goal: Tolerance of the final solution, to which the step is then solved.
    """
    loop = _Loop(levels, step.tol)
    step = loop.begun(step, len(levels))
    while True:
        found = search(step)
        loop.count(found)
        if not found.state.within:
            break  # no solution with these values
        late, found = loop.first_unsettled(found)
        step = found.state.step
        if late == len(levels):
            if step.tol <= goal:
                break
            loop.aim, start = goal, (found.state.x,)
            finer = step.replaced(tol=goal, starts=start, motions=found.state.c, continues=True)
            step = loop.begun(finer, late)
        elif loop.at_its_limit(late):
            break
        else:
            step = loop.renewed(step, found.state, late)
        found = None  # free the state before the next search
    return Staggered(loop.result(found), loop.sizes, loop.refused)


class _Loop:
    """Updates and solutions of each level, total iterations, and forward error of the loops."""

    def __init__(self, levels: Sequence[Level], aim: float):
        self._levels, self.aim = levels, aim
        self._renewals, self._solutions = [0] * len(levels), [0] * len(levels)
        self._iterations, self._forward = 0, 0.0
        self._changes: list[Change] = []
        self.sizes: dict[str, float] = {}
        self.refused = ""

    def begun(self, step: LoadStep, slower: int, tol: float = 0.0) -> LoadStep:
        """Return the step with the inner levels restarted, and its next tolerance.  Collective.

        Args:
            step: The step.
            slower: Number of inner levels to restart.
            tol: Tolerance of the next solution; 0 is ``aim``.
        """
        quantities = [quantity for level in self._levels[:slower] for quantity in level]
        for quantity in quantities:
            step = quantity.restarted(step)
        self._renewals[:slower] = self._solutions[:slower] = [0] * slower
        tol = max([tol or self.aim, *(quantity.first_tol for quantity in quantities)])
        return step.replaced(tol=tol)

    def count(self, found: SolverResult) -> None:
        """Add a solution to the counters."""
        self._iterations, self._forward = self._iterations + found.iterations, found.forward_error
        self._solutions = [count + 1 for count in self._solutions]

    def first_unsettled(self, found: SolverResult) -> tuple[int, SolverResult]:
        """Return the first level that has not converged.  Collective.

        Returns:
            Its index, or the number of levels if all have converged; the result with the state to
            continue with.
        """
        for k, level in enumerate(self._levels):
            self._changes = []
            for quantity in level:
                change = quantity.change(found, self.aim)
                found = found._replace(state=change.state)
                self._changes.append(change)
                self.sizes[type(quantity).__name__] = change.size
                self._forward = max(self._forward, change.forward)
                if change.refused:
                    return k, found
            if not all(change.settled for change in self._changes):
                return k, found
        return len(self._levels), found

    def at_its_limit(self, k: int) -> bool:
        """Return whether a level must not be updated again, and set ``refused`` to the reason."""
        self.refused = next((change.refused for change in self._changes if change.refused), "")
        if not self.refused and self._renewals[k] < max(
            quantity.limit for quantity in self._levels[k]
        ):
            return False
        largest = max(self._changes, key=lambda change: change.size)
        words = (quantity.not_settled(largest) for quantity in self._levels[k])
        self.refused = self.refused or next(filter(None, words), "")
        return True

    def renewed(self, step: LoadStep, state: StepState, k: int) -> LoadStep:
        """Return the step with all quantities of a level updated.  Collective."""
        self._renewals[k] += 1
        for quantity in self._levels[k]:
            step = quantity.renewed(step, state)
        tol, self._changes = max(change.tol for change in self._changes), []
        return self.begun(step, k, tol)

    def result(self, found: SolverResult) -> SolverResult:
        """Return the last result with the total iterations and the remarks of all levels."""
        both = zip(self._levels, self._solutions)
        message = [quantity.message(count) for level, count in both for quantity in level]
        reason = "; ".join(filter(None, (found.reason, *message)))
        return found._replace(
            iterations=self._iterations, forward_error=self._forward, reason=reason
        )
