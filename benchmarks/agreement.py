# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""How far the results of the fixed point are from those of Newton's method over a cycle of the punch.

Each solver goes through its own history. Differences are relative to the largest nodal reaction, and to the
largest total, of the cycle so far.  Run by variants.py.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "demos"))
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from punch import Parameters, Punch, programme

from dolfinx_contact.linear_solver import DIRECT, MULTIGRID

PRECONDITIONERS = {"factorisation": DIRECT, "multigrid": MULTIGRID}


def differences(case: str, tol: float, refine: int = 0) -> dict[str, tuple[float, float]]:
    """Largest difference of nodal reactions and of totals (force, sum of tangential norms) by preconditioner."""
    parameters = Parameters(case=case, refine=refine, tol=tol)
    newton = Punch(parameters, solver=dc.CondensedNewton())
    others = {name: Punch(parameters, solver=dc.FixedPoint()) for name in PRECONDITIONERS}
    for name, punch in others.items():
        punch.problem.body._options = PRECONDITIONERS[name]
    largest, worst = np.zeros(2), {name: np.zeros(2) for name in others}
    for displacement in programme(parameters):
        expected = _results(newton, displacement)
        largest = np.maximum(largest, [np.abs(part).max() for part in expected])
        for name, punch in others.items():
            found = _results(punch, displacement)
            apart = [np.abs(a - b).max() for a, b in zip(found, expected)]
            worst[name] = np.maximum(worst[name], apart / largest)
    return {name: tuple(map(float, pair)) for name, pair in worst.items()}


def _results(punch, displacement) -> tuple[np.ndarray, np.ndarray]:
    """Nodal reactions and totals after a step."""
    punch.press(displacement)
    r = punch.contact.reaction
    return r, np.append(r.sum(axis=0), np.linalg.norm(r[:, :2], axis=1).sum())
