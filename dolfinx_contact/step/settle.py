# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What is found for a load step: whatever holds the body, and friction that follows the pressure at the step's end."""

from __future__ import annotations

import numpy as np

from dolfinx_contact.solvers.base import SolverResult
from dolfinx_contact.step.trial import held_by_contact, unmoved, without_reactions

# How often friction is made to follow, and the largest factor by which its changes are taken to fall.
MOST, SLOWEST = 50, 0.9

# Tolerance of a solution on the way: at most ROUGH, and this part of the last change of the reactions.
ROUGH, PART = 1e-3, 0.03


def found_for(body, contacts, step, last, undetermined: str, solve) -> SolverResult:
    """What is found with the laws as they are.  Collective.

    Args:
        body, contacts: The body and its contacts.
        step: The ``LoadStep``; has measured what is returned.
        last: The last converged displacement, owned degrees of freedom.
        undetermined: What to do with motions that nothing determines, see ``held_by_contact``.
        solve: Function of the step that asks the solver.
    """
    if step.surfaces is not None:
        step.surfaces.check()
        if step.surfaces.beyond(given=True):
            return unmoved(body, step, last)
    if body.loose is not None:
        return held_by_contact(body, contacts, step, last, undetermined, solve)
    found = None if body.nonlinear else without_reactions(body, contacts, step)
    return found or solve(step)


def with_friction(contacts, step, search, renew, memory) -> SolverResult:
    """What is found with friction that belongs to the state found.  Collective.

    A fixed point: the step is solved, laws that follow the pressure become those of the pressures found, and the errors are
    measured with these.  They are what the step is judged by; while they are too large the step is solved again.

    Args:
        contacts: The contacts; some may have laws that follow the pressure.
        step: The ``LoadStep``.
        search: Function that finds a displacement with the laws as they are.
        renew: Function that makes them those of the present state.
        memory: Of the solver, see ``Solver``.
    """
    if not any(contact.follows_pressure for contact in contacts):
        return search()
    goal, rounds, iterations, last, iterate = step.tol, 0, 0, np.inf, None
    step.tol = max(goal, ROUGH)
    while rounds < MOST:
        found, past = search(), memory.get("past", ())
        if iterate is not None and len(past) > 1 and past[-2] is iterate:
            del past[-2]  # one for a step: the others were on the way
        iterate = past[-1] if past else None
        rounds, iterations = rounds + 1, iterations + found.iterations
        if not step.errors.within(step.tol):
            break  # no state with these laws
        renew()
        step.again(found.x)
        change = step.measure(found.x).change
        rate = min(change / last, SLOWEST) if 0.0 < last < np.inf else 0.5
        found = found._replace(forward_error=max(found.forward_error, change * rate / (1 - rate)))
        settled = found.forward_error <= goal and step.errors.within(goal)
        if settled or step.errors.within(0.0):
            break
        last, step.tol = change, max(goal, min(ROUGH, PART * change))
    step.tol = goal
    said = f"{found.chosen}, {rounds} times with friction that follows the pressure"
    return found._replace(iterations=iterations, chosen=said)


def refusal(step, contacts) -> str:
    """Why a step has not converged, as far as anything tells.  Collective."""
    said = step.hidden() or step.no_state() or "Smaller load steps help most often"
    if any(contact.follows_pressure for contact in contacts):
        said += "; friction follows the pressure, and was that of the last iterate"
    return said
