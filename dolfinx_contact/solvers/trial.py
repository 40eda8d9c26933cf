# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The displacement without reactions: whether it presses on a plane, and whether it is the solution."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.petsc.linear_solver import stage
from dolfinx_contact.results.record import NO_SOLUTION
from dolfinx_contact.solvers.base import SolverName, SolverResult

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.step.load_step import LoadStep

# Penetration over the largest displacement that three digits of it leave no doubt about.
CERTAIN = 0.1

NOTHING = "nothing touches"


def without_reactions(
    body: ElasticBody, contacts: Sequence[Contact], step: LoadStep
) -> SolverResult | None:
    """The displacement without reactions, if it is the solution of a ``LoadStep``.  Collective."""
    if step.surfaces is not None:
        if not step.surfaces.can_rest:
            return None
        step.surfaces.move_to(step.surfaces.at_rest())
    with stage("contact: elastic solve"):
        trial = body.free_state(step.b, rough=True)
        if not (body.known.exact or presses(body, contacts, trial)):
            trial = body.free_state(step.b)  # whether anything touches takes all digits
    if not may_touch(body, contacts, trial):
        trial = refined(body, step, trial)
        if step.errors.within(step.tol):
            return SolverResult(trial, 0, 0.0, SolverName.NONE, reason=NOTHING)
    if step.surfaces is not None:
        step.surfaces.move_to(np.zeros(step.surfaces.count))
    return None


def unmoved(
    body: ElasticBody, step: LoadStep, last: np.ndarray, reason: str = NO_SOLUTION
) -> SolverResult:
    """The last displacement with the present boundary values, judged as what it is: no solution."""
    x, fixed = last.copy(), body.fixed
    x[fixed] = step.b[fixed]
    step.measure(x)
    return SolverResult(x, 0, np.inf, SolverName.NONE, reason=reason)


def floating(
    body: ElasticBody, contacts: Sequence[Contact], step: LoadStep, last: np.ndarray
) -> SolverResult | None:
    """Of a loose body whose loads balance the displacement without reactions nearest to the last one.  Collective.

    None where it touches.
    """
    x = last.copy()
    x[body.fixed] = step.b[body.fixed]
    x += body.solve(step.forces(x))
    if may_touch(body, contacts, x) or not step.measure_open(x).within(step.tol):
        return None
    return SolverResult(x, 0, 0.0, SolverName.NONE, reason=NOTHING)


def presses(body: ElasticBody, contacts: Sequence[Contact], trial: np.ndarray) -> bool:
    """Whether a displacement without reactions known to three digits penetrates a plane for certain."""
    return _deepest(body, contacts, trial) > CERTAIN * body.farthest(trial)


def may_touch(body: ElasticBody, contacts: Sequence[Contact], trial: np.ndarray) -> bool:
    """Whether a displacement without reactions penetrates a plane by more than rounding."""
    return _deepest(body, contacts, trial, lambda contact: contact.gap_rounding(trial)) > 1.0


def _deepest(
    body: ElasticBody,
    contacts: Sequence[Contact],
    trial: np.ndarray,
    unit: Callable = lambda contact: 1.0,
) -> float:
    """The deepest penetration of all contacts, at least zero, in a unit of length.  Collective."""
    depths = [np.zeros(1)]
    for contact in contacts:
        contact.move(trial)
        depths.append(-contact.present.gap / unit(contact))
    return body.largest(np.concatenate(depths))


def refined(body: ElasticBody, step: LoadStep, x: np.ndarray) -> np.ndarray:
    """The displacement without reactions, with another digit where what is left of ``b`` counts."""
    errors = step.measure_open(x)
    if errors.largest <= step.tol:
        return x
    finer = x + body.solve(step.forces(x))
    if step.measure_open(finer).largest < errors.largest:
        return finer
    step.measure_open(x)
    return x
