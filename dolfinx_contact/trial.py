# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The displacement without reactions: whether it presses on a plane, and whether it is the solution."""

from __future__ import annotations

import numpy as np

from dolfinx_contact.petsc.linear_solver import stage
from dolfinx_contact.solvers.base import SolverResult

# Penetration over the largest displacement that three digits of it leave no doubt about.
CERTAIN = 0.1

NOTHING = "none: nothing touches"


def without_reactions(body, contacts, step) -> SolverResult | None:
    """The displacement without reactions, if it is the solution of a ``LoadStep``.  Collective."""
    if step.planes is not None:
        if not step.planes.can_rest:
            return None
        step.planes.move_to(step.planes.at_rest())
    with stage("contact: elastic solve"):
        trial = body.free_state(step.b, rough=True)
        certain = CERTAIN * body.largest(np.abs(trial))
        if not (body.known.exact or _deepest(body, contacts, trial) > certain):
            trial = body.free_state(step.b)  # whether anything touches takes all digits
    if not _deepest(body, contacts, trial, lambda contact: contact.gap_rounding(trial)) > 1.0:
        trial = refined(body, step, trial)
        if step.errors.within(step.tol):
            return SolverResult(trial, 0, 0.0, NOTHING)
    if step.planes is not None:
        step.planes.move_to(np.zeros(step.planes.count))
    return None


def _deepest(body, contacts, trial: np.ndarray, unit=lambda contact: 1.0) -> float:
    """The deepest penetration of all contacts, at least zero, in a unit of length.  Collective."""
    depths = [np.zeros(1)]
    for contact in contacts:
        contact.move(trial)
        depths.append(-contact.gap / unit(contact))
    return body.largest(np.concatenate(depths))


def refined(body, step, x: np.ndarray) -> np.ndarray:
    """The displacement without reactions, with another digit where what is left of ``b`` counts."""
    errors = step.measure_open(x)
    if errors.largest <= step.tol:
        return x
    finer = x + body.solve(step.forces(x))
    if step.measure_open(finer).largest < errors.largest:
        return finer
    step.measure_open(x)
    return x
