# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""How the solution of a load step is searched for: levels of lagged quantities around what holds the body and a solver; and without reactions, whether that is one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.petsc.linear_solver import stage
from dolfinx_contact.results.record import NO_SOLUTION
from dolfinx_contact.solvers.base import SolverName, SolverResult

if TYPE_CHECKING:
    from dolfinx_contact.problem import ContactProblem
    from dolfinx_contact.step.load_step import LoadStep, StepState

# Penetration over the largest displacement that three digits of it leave no doubt about.
CERTAIN_PENETRATION = 0.1

NOTHING_TOUCHES = "nothing touches"

# Tolerance of a solution on the way to the geometry of the end, over that of the geometry.
ROUGH_TOLERANCE = 0.03


def solution(problem: ContactProblem) -> tuple[SolverResult, dict, str]:
    """What is found with all that the step takes for known, which is that of the state found: see ``Staggered``.  Collective."""
    step, own = problem.load_step(), ()
    goal, levels = step.tol, _levels(problem, step)
    if _digits_later(problem):
        step = step.but(tol=max(goal, ROUGH_TOLERANCE * problem.geometry_tol))
    starts = problem.accepted.starts
    if not levels:
        return find(problem, step, starts), {}, ""
    from dolfinx_contact.step.staggered import solve_staggered

    def search(step: LoadStep) -> SolverResult:
        nonlocal own  # of the starts found within a step the last one alone
        found = find(problem, step, (*starts, *own))
        own = own if found.start is None else (found.start,)
        return found._replace(start=own[0] if own else None)

    return solve_staggered(step, levels, search, goal)


def _levels(problem: ContactProblem, step: LoadStep) -> list:
    """What the step takes for known, level by level, the fastest first; imported where there is any.  Collective."""
    contacts, levels = problem.contacts, []
    if any(contact.laws.follow_pressure for contact in contacts):
        from dolfinx_contact.lagged.friction import PressureFriction

        levels.append([PressureFriction()])
    levels += [[quantity] for quantity in problem.lagged]
    if any(contact.laws.wears_within for contact in contacts):
        from dolfinx_contact.lagged.wear import WearOfStep

        levels.append([WearOfStep(step, problem.geometry_tol)])
    if step.holding is not None:
        from dolfinx_contact.lagged.held import HeldPlanes

        levels.append([HeldPlanes(lambda step, holding: problem.load_step(None, step, holding))])
    if any(contact.changes for contact in contacts) or step.may_land():
        from dolfinx_contact.lagged.end_geometry import EndGeometry
        from dolfinx_contact.lagged.landing import SlipBeforeLanding

        tol = problem.geometry_tol
        end = EndGeometry(step, tol, lambda step, at: problem.load_step(at, step))
        levels.append([end, SlipBeforeLanding(tol)])
    return levels


def _digits_later(problem: ContactProblem) -> bool:
    """Whether the step is solved to as many digits as its geometry needs first: all digits take cycles of multigrid."""
    renewed = any(c.geometry.renews_rows for c in problem.contacts)
    return renewed and not (problem.body.exact or problem.body.nonlinear)


def find(problem: ContactProblem, step: LoadStep, starts: Sequence[Any]) -> SolverResult:
    """What is found with the laws as they are, whatever holds the body, judged by F itself.  Collective.

    Raises:
        ValueError: on all ranks, if nothing can hold the body, or nothing determines a motion that is to be refused.
    """
    if step.holding is not None and step.holding.beyond:
        return unmoved(step)
    if step.surfaces is not None:
        step.surfaces.check(step.contacts)
        last = [contact.last for contact in step.contacts]
        if step.surfaces.beyond(step.contacts, last, step.no_motions, given=True):
            return unmoved(step)
    body, found, statics = problem.body, None, None
    if body.loose is not None:
        from dolfinx_contact.step.statics import Statics

        statics = Statics(step, problem.accepted.x)
        step = step.but(statics=statics)
        if statics.message:
            return unmoved(step, statics.reason)
        if not statics.loads.any():
            found = floating(step)
        pressed = np.concatenate([contact.last.reaction[:, -1] for contact in step.contacts])
        if not body.largest(pressed) > 0.0:
            statics.place()
        else:
            statics.follow()
    elif not body.nonlinear:
        found = without_reactions(step)
    if found is None:
        with stage("contact: iterations"):
            found = problem.bound(step).solve(step, starts)
        found = found._replace(state=found.state.judged)
    if statics is None or not found.state.within:
        return found
    if not statics.balanced(found.state):
        return unmoved(step)
    return found._replace(state=statics.settled(found.state, problem.undetermined))


def ended(state: StepState, geometry_tol: float) -> StepState:
    """A converged state with what only its end tells: gaps of open nodes, slip of those that have left or opened.  Collective."""
    contacts, nodes = state.step.contacts, []
    for contact, one in zip(contacts, state.nodes):
        one = contact.with_slip_past_edges(one, state.x)
        nodes.append(contact.with_own_gaps(one, state.x))
    opens = any(contact.opened(one).any() for contact, one in zip(contacts, nodes))
    if state.step.body.comm.allreduce(opens):
        from dolfinx_contact.lagged.landing import slip_up_to_opening

        nodes = slip_up_to_opening(state, nodes, geometry_tol)
    return state.with_nodes(nodes)


def without_reactions(step: LoadStep) -> SolverResult | None:
    """The displacement without reactions, if it is the solution of a step.  Collective."""
    body, c = step.body, step.no_motions
    if step.surfaces is not None:
        if not step.surfaces.can_rest:
            return None
        c = step.surfaces.at_rest(c)
    with stage("contact: elastic solve"):
        trial = body.free_state(step.b, rough=True)
        if not (body.last_free_state.exact or presses(step, trial, c)):
            trial = body.free_state(step.b)  # whether anything touches takes all digits
    if may_touch(step, trial, c):
        return None
    state = refined(step.open(trial, c))
    return (
        SolverResult(state, 0, 0.0, SolverName.NONE, reason=NOTHING_TOUCHES)
        if state.within
        else None
    )


def unmoved(step: LoadStep, reason: str = NO_SOLUTION) -> SolverResult:
    """The last displacement with the present boundary values, judged as what it is: no solution.  Collective."""
    x, fixed = step.last.copy(), step.body.fixed
    x[fixed] = step.b[fixed]
    return SolverResult(step.measure(x), 0, np.inf, SolverName.NONE, reason=reason)


def floating(step: LoadStep) -> SolverResult | None:
    """Of a loose body whose loads balance the displacement without reactions nearest to the last one.  Collective.

    None where it touches.
    """
    x, fixed = step.last.copy(), step.body.fixed
    x[fixed] = step.b[fixed]
    x += step.body.solve(step.forces(x))
    if may_touch(step, x):
        return None
    state = step.open(x)
    return (
        SolverResult(state, 0, 0.0, SolverName.NONE, reason=NOTHING_TOUCHES)
        if state.within
        else None
    )


def presses(step: LoadStep, trial: np.ndarray, c: np.ndarray | None = None) -> bool:
    """Whether a displacement without reactions known to three digits penetrates a plane for certain.  Collective."""
    return _deepest(step, trial, c) > CERTAIN_PENETRATION * step.body.farthest(trial)


def may_touch(step: LoadStep, trial: np.ndarray, c: np.ndarray | None = None) -> bool:
    """Whether a displacement without reactions penetrates a plane by more than rounding.  Collective."""
    return _deepest(step, trial, c, lambda contact: contact.gap_rounding(trial)) > 1.0


def _deepest(
    step: LoadStep,
    trial: np.ndarray,
    c: np.ndarray | None,
    unit: Callable = lambda contact: 1.0,
) -> float:
    """The deepest penetration of all contacts, at least zero, in a unit of length.  Collective."""
    depths = [-contact.at(trial, c).gap / unit(contact) for contact in step.contacts]
    return step.body.largest(np.concatenate([np.zeros(1), *depths]))


def refined(state: StepState) -> StepState:
    """The state without reactions, with another digit where what is left of ``b`` counts.  Collective."""
    step, errors = state.step, state.errors
    if errors.largest <= step.tol:
        return state
    finer = step.open(state.x + step.body.solve(step.forces(state.x)), state.c)
    return finer if finer.errors.largest < errors.largest else state
