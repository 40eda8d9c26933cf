# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A step of the punch that has two solutions: case C, 35,451 unknowns, unloading to 0.060 mm.

Both are found by the fixed point with multigrid from the same history, with different metrics rho, and
are judged by NumPy functions of the tests with a stiffness that is assembled apart.  Run by variants.py.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "demos"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import dolfinx.fem.petsc
import numpy as np
import ufl
from punch import CASES, Parameters, Punch, programme
from scipy.sparse import csr_matrix
from twin_solver import error

from dolfinx_contact.linear_solver import MULTIGRID

STEP, TOL = 9, 1e-11  # the tenth step, 0.060 mm


def judged(punch, K, before: np.ndarray, previous: float) -> float:
    """The error of the state that ``punch`` is in, by the judge of the tests."""
    contact, body = punch.contact, punch.problem.body
    u = punch.u.x.array
    forces = -(K @ u)
    forces[contact._dofs] += contact.reaction
    forces[body.fixed] = 0.0
    mu, p = (np.array(CASES["C"][name]) for name in ("mu", "p"))
    normal_stiffness = K.diagonal()[contact._dofs[:, 2]]
    slip = (u - before)[contact._dofs][:, :2]
    gap = contact.x[:, 2] + u[contact._dofs][:, 2]
    return error(normal_stiffness, mu, p, contact.reaction, gap, slip, forces, previous)


def both() -> list[dict]:
    """The solution of each metric, and how far they are apart."""
    punch = Punch(Parameters(case="C", refine=1, tol=1e-10), solver=dc.FixedPoint())
    problem, contact = punch.problem, punch.contact
    problem.body._options = MULTIGRID
    displacements = programme(punch.parameters)
    for displacement in displacements[:STEP]:
        punch.press(displacement)
    derivative = ufl.derivative(punch.F, punch.u, ufl.TrialFunction(punch.V))
    A = dolfinx.fem.petsc.assemble_matrix(dolfinx.fem.form(derivative))
    A.assemble()
    indptr, indices, values = A.getValuesCSR()
    K = csr_matrix((values, indices, indptr))
    rows, reactions, slips, statuses = [], [], [], []
    problem.tol = TOL
    with tempfile.TemporaryDirectory() as directory:
        problem.save(f"{directory}/history.npz")
        for rho in (None, 3.0):
            problem.load(f"{directory}/history.npz")
            problem.solver = dc.FixedPoint(rho=rho)
            before, previous = punch.u.x.array.copy(), float(np.linalg.norm(contact.reaction))
            record = punch.press(displacements[STEP])
            kept = ("iterations", "error", "stick", "slip", "normal_reaction", "tangential_reaction_sum")  # fmt: skip
            rows.append({key: record[key] for key in kept} | dict(
                solver="FixedPoint()" if rho is None else f"FixedPoint(rho={rho:g})",
                judged=judged(punch, K, before, previous), displacement=displacements[STEP],
            ))  # fmt: skip
            reactions.append(contact.reaction.copy())
            slips.append(contact.slip_increment.copy())
            statuses.append(contact.status.copy())
    apart, slips_apart = (
        np.abs(one - other).max(axis=1) / np.abs(one).max() for one, other in (reactions, slips)
    )
    for row in rows:
        row.update(apart=float(apart.max()), beyond=int((apart > 1e-3).sum()), slips_apart=float(slips_apart.max()),
            where=contact.x[statuses[0] != statuses[1]].tolist())  # fmt: skip
    return rows
