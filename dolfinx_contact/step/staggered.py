# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The outer loop of a load step: what a step takes for known is renewed until it changes no more.

These quantities are lagged: a step is solved with their values of the state before.  They stand on levels, the fastest first.  After
each solution the levels are asked in turn; all quantities of the first level that has not settled are renewed, the levels before it
begin anew, and the step is solved again: fixed points, nested.
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
    """How far a lagged quantity is from that of the state found."""

    settled: bool
    state: StepState  # the one to go on with; of its step
    size: float = 0.0  # of the forces that it makes, over the reactions
    forward: float = 0.0  # the part of the forward error that it makes
    tol: float = 0.0  # to which the step is solved next, 0 is that of the level
    refused: str = ""  # why no other value helps, in words


class Lagged:
    """A quantity that a step takes for known.

    Attributes:
        limit: How often it is renewed at most, until a slower one is.
        first_tol: Tolerance of the first solution.
    """

    limit, first_tol = 5, 0.0

    def restarted(self, step: LoadStep) -> LoadStep:
        """The step with a first value, once a slower quantity has another one.  Collective."""
        return step

    def change(self, found: SolverResult, goal: float) -> Change:
        """What has become of it in the state found.  Collective.

        Args:
            found: With the state.
            goal: The tolerance of the step.
        """
        raise NotImplementedError

    def renewed(self, step: LoadStep, state: StepState) -> LoadStep:
        """The step with the value of the state found, to be solved again.  Collective."""
        raise NotImplementedError

    def not_settled(self, change: Change) -> str:
        """What to say where the limit is reached, in words; empty where errors tell."""
        return ""

    def message(self, solutions: int) -> str:
        """What a record says of so many solutions, in words."""
        return ""


class Staggered(NamedTuple):
    """What the loop ends with."""

    found: SolverResult
    changes: dict  # sizes, by names of classes
    refused: str  # why it is no solution, in words


def solve_staggered(
    step: LoadStep, levels: Sequence[Level], search: Search, goal: float
) -> Staggered:
    """Solve a step with all lagged quantities those of the state found.  Collective.

    Args:
        step: The step, to be solved to its tolerance until all is settled.
        levels: Of lagged quantities, the fastest first.
        search: What a solver finds.
        goal: The tolerance in the end.
    """
    loop = _Loop(levels, step.tol, goal)
    step = loop.begun(step, len(levels))
    while True:
        found = search(step)
        loop.count(found)
        if not found.state.within:
            break  # no state with these values
        late, found = loop.first_unsettled(found)
        step = found.state.step
        if late == len(levels):
            if step.tol <= goal:
                break
            loop.aim, start = goal, (found.state.x,)
            finer = step.but(tol=goal, starts=start, motions=found.state.c, continues=True)
            step = loop.begun(finer, late)
        elif loop.at_its_limit(late):
            break
        else:
            step = loop.renewed(step, found.state, late)
        found = None  # of states the next search has its own
    return Staggered(loop.result(found), loop.sizes, loop.refused)


class _Loop:
    """What the loop counts: renewals and solutions of each level, iterations, the forward error."""

    def __init__(self, levels: Sequence[Level], aim: float, goal: float):
        self._levels, self.aim, self._goal = levels, aim, goal
        self._renewals, self._solutions = [0] * len(levels), [0] * len(levels)
        self._iterations, self._forward, self._tol = 0, 0.0, 0.0
        self._changes: list[Change] = []
        self.sizes: dict[str, float] = {}
        self.refused = ""

    def begun(self, step: LoadStep, slower: int, tol: float = 0.0) -> LoadStep:
        """The step with the tolerance of its next solution, once levels before ``slower`` begin anew.  Collective."""
        quantities = [quantity for level in self._levels[:slower] for quantity in level]
        for quantity in quantities:
            step = quantity.restarted(step)
        self._renewals[:slower] = self._solutions[:slower] = [0] * slower
        tol = max([tol or self.aim, *(quantity.first_tol for quantity in quantities)])
        return step.but(tol=tol)

    def count(self, found: SolverResult) -> None:
        """Count a solution."""
        self._iterations, self._forward = self._iterations + found.iterations, found.forward_error
        self._solutions = [count + 1 for count in self._solutions]

    def first_unsettled(self, found: SolverResult) -> tuple[int, SolverResult]:
        """The first level that has not settled, or their number, and the state as the quantities leave it.  Collective."""
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
        """Whether a level cannot be renewed any more; ``refused`` says why."""
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
        """The step with all quantities of a level renewed.  Collective."""
        self._renewals[k] += 1
        for quantity in self._levels[k]:
            step = quantity.renewed(step, state)
        tol, self._changes = max(change.tol for change in self._changes), []
        return self.begun(step, k, tol)

    def result(self, found: SolverResult) -> SolverResult:
        """What was found, with all iterations, and the reasons of all levels."""
        both = zip(self._levels, self._solutions)
        message = [quantity.message(count) for level, count in both for quantity in level]
        reason = "; ".join(filter(None, (found.reason, *message)))
        return found._replace(
            iterations=self._iterations, forward_error=self._forward, reason=reason
        )
