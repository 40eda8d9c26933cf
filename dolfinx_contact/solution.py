# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Solution of a load step: nested loops over lagged quantities around a solver.

Before the solver runs, it is checked whether the contact-free solution already is the solution, and
whether supports and contact can hold the body.
"""

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

# Penetration relative to the largest displacement above which a contact-free solution with three
# correct digits is certain to penetrate.
CERTAIN_PENETRATION = 0.1

NOTHING_TOUCHES = "nothing touches"

# Tolerance of the solutions that update the geometry of the step, relative to ``geometry_tol``.
ROUGH_TOLERANCE = 0.03


def solution(problem: ContactProblem) -> tuple[SolverResult, dict, str]:
    """Return the solution of the next load step, with all lagged quantities converged.  Collective.

    Returns:
        The solver's result; the final changes of the lagged quantities by class name; and why the
        state is no solution, in words, empty otherwise.
    """
    step, own = problem.load_step(), ()
    goal, levels = step.tol, _levels(problem, step)
    if _starts_with_rough_solutions(problem):
        step = step.replaced(tol=max(goal, ROUGH_TOLERANCE * problem.geometry_tol))
    starts = problem.accepted.starts
    if not levels:
        return find(problem, step, starts), {}, ""
    from dolfinx_contact.step.staggered import solve_staggered

    def search(step: LoadStep) -> SolverResult:
        nonlocal own  # keep only the last start found within the step
        found = find(problem, step, (*starts, *own))
        own = own if found.start is None else (found.start,)
        return found._replace(start=own[0] if own else None)

    return solve_staggered(step, levels, search, goal)


def _levels(problem: ContactProblem, step: LoadStep) -> list:
    """Return the lagged quantities of the step by levels, the innermost loop first.  Collective."""
    contacts, levels = problem.contacts, []
    if any(contact.laws.depends_on_pressure for contact in contacts):
        from dolfinx_contact.lagged.friction import PressureFriction

        levels.append([PressureFriction()])
    levels += [[quantity] for quantity in problem.lagged]
    if any(contact.laws.wears_within for contact in contacts):
        from dolfinx_contact.lagged.wear import WearOfStep

        levels.append([WearOfStep(step, problem.geometry_tol)])
    if step.holding is not None:
        from dolfinx_contact.lagged.held import HeldPlanes

        levels.append([HeldPlanes(lambda step, holding: problem.load_step(None, step, holding))])
    if any(contact.changes for contact in contacts) or step.may_close():
        from dolfinx_contact.lagged.end_geometry import EndGeometry
        from dolfinx_contact.lagged.landing import SlipBeforeLanding

        tol = problem.geometry_tol
        end = EndGeometry(step, tol, lambda step, at: problem.load_step(at, step))
        levels.append([end, SlipBeforeLanding(tol)])
    return levels


def _starts_with_rough_solutions(problem: ContactProblem) -> bool:
    """Return whether the geometry is first updated with solutions of reduced accuracy.

    This saves multigrid cycles on deformable surfaces, where the step is solved repeatedly.
    """
    renewed = any(c.geometry.renews_rows for c in problem.contacts)
    return renewed and not (problem.body.exact or problem.body.nonlinear)


def find(problem: ContactProblem, step: LoadStep, starts: Sequence[Any]) -> SolverResult:
    """Return the solution of a load step with fixed lagged quantities.  Collective.

    Errors are measured with the residual form F.  If no static state exists, the result is the last
    displacement, marked as no solution.

    Raises:
        ValueError: on all ranks, if neither supports nor contact can hold the body, or if a motion
            is undetermined and ``undetermined`` is "refused".
    """
    if step.holding is not None and step.holding.beyond:
        return unmoved(step)
    if step.surfaces is not None:
        step.surfaces.check(step.contacts)
        last = [contact.last for contact in step.contacts]
        if step.surfaces.beyond(step.contacts, last, step.first_motions, given=True):
            return unmoved(step)
    body, found, statics = problem.body, None, None
    if body.loose is not None:
        from dolfinx_contact.step.statics import Statics

        statics = Statics(step, problem.accepted.x)
        step = step.replaced(statics=statics)
        if statics.message:
            return unmoved(step, statics.reason)
        if not statics.loads.any():
            found = floating(step)
        if step.was_held_by_contact:
            statics.follow()
        else:
            statics.place()
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
    """Return a converged state with final values at nodes that are open or have left.  Collective.

    Gaps of open nodes on deformable surfaces are evaluated at the final displacement.  Slip of
    nodes that have left the opposite surface, or have opened, ends where they left or opened.
    """
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
    """Return the contact-free solution if it is the solution of a step, else None.  Collective."""
    body, c = step.body, step.first_motions
    if step.surfaces is not None:
        if not step.surfaces.can_rest:
            return None
        c = step.surfaces.at_rest(c)
    with stage("contact: elastic solve"):
        trial = body.free_state(step.b, rough=True)
        if not (body.last_free_state.exact or presses(step, trial, c)):
            trial = body.free_state(step.b)  # full accuracy decides whether a node touches
    if may_touch(step, trial, c):
        return None
    state = refined(step.open(trial, c))
    return (
        SolverResult(state, 0, 0.0, SolverName.NONE, reason=NOTHING_TOUCHES)
        if state.within
        else None
    )


def unmoved(step: LoadStep, reason: str = NO_SOLUTION) -> SolverResult:
    """Return the last displacement with the present boundary values, as no solution.  Collective.

    Args:
        step: The step.
        reason: Why there is no solution, for the record of the step.
    """
    x, fixed = step.last.copy(), step.body.fixed
    x[fixed] = step.b[fixed]
    return SolverResult(step.measure(x), 0, np.inf, SolverName.NONE, reason=reason)


def floating(step: LoadStep) -> SolverResult | None:
    """Return the contact-free solution of a loose body under balanced loads.  Collective.

    A loose body is held by contact alone.  Of its contact-free solutions, which differ by rigid
    motions, the one nearest to the last displacement is chosen.  The result is None if it
    penetrates or is no solution within the tolerance.
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
    """Return whether a displacement with three correct digits certainly penetrates.  Collective."""
    return _deepest_penetration(step, trial, c) > CERTAIN_PENETRATION * step.body.farthest(trial)


def may_touch(step: LoadStep, trial: np.ndarray, c: np.ndarray | None = None) -> bool:
    """Return whether a displacement penetrates a surface by more than rounding.  Collective."""
    return _deepest_penetration(step, trial, c, lambda contact: contact.gap_rounding(trial)) > 1.0


def _deepest_penetration(
    step: LoadStep,
    trial: np.ndarray,
    c: np.ndarray | None,
    unit: Callable = lambda contact: 1.0,
) -> float:
    """Return the deepest penetration of all contacts, at least zero.  Collective.

    Args:
        step: The step.
        trial: Displacement, owned degrees of freedom.
        c: Motions of surfaces driven by force, ``shape=(m,)``.
        unit: Function of a contact; its value divides the penetrations of that contact.
    """
    depths = [-contact.at(trial, c).gap / unit(contact) for contact in step.contacts]
    return step.body.largest(np.concatenate([np.zeros(1), *depths]))


def refined(state: StepState) -> StepState:
    """Return a contact-free state after one step of iterative refinement.  Collective.

    The state is returned unchanged if its errors are within the tolerance, or if refinement does
    not reduce them.
    """
    step, errors = state.step, state.errors
    if errors.largest <= step.tol:
        return state
    finer = step.open(state.x + step.body.solve(step.forces(state.x)), state.c)
    return finer if finer.errors.largest < errors.largest else state
