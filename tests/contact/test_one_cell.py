# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Meshes of one cell, whose stiffness is a full matrix."""

import os
import subprocess
import sys

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from scenes import COMM

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace

SOLVED = """
import dolfinx_contact  # before PETSc, which one of DOLFINx's wheels needs
import numpy as np
from petsc4py import PETSc
from dolfinx_contact.petsc.linear_solver import LinearSolver
for n in (1, 2, 24):
    A = PETSc.Mat().createDense((n, n), array=np.ones((n, n)) + np.eye(n)).convert("aij")
    print(LinearSolver(A, None, "full_", None).solve(np.ones(n)).tolist())
"""


@pytest.mark.slow
@pytest.mark.skipif(COMM.size > 1, reason="starts a process of its own")
def test_a_full_matrix_does_not_end_the_process():
    """Ones plus the identity, n rows: the sum of a row is n + 1, so that the answer to ones is 1 / (n + 1)."""
    done = subprocess.run(
        [sys.executable, "-c", SOLVED], capture_output=True, text=True, env=os.environ, timeout=100
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for line, n in zip(done.stdout.splitlines(), (1, 2, 24), strict=True):
        assert np.allclose(eval(line), np.full(n, 1 / (n + 1)), rtol=1e-12, atol=0.0)


def test_the_users_ordering_goes_before_ours():
    """Options of the user are taken as they are: of a full matrix, too, MUMPS takes the ordering asked for, AMF."""
    from petsc4py import PETSc

    from dolfinx_contact.petsc.linear_solver import LinearSolver, options_given

    mine = 3 if COMM.rank == 0 else 0
    A = PETSc.Mat().createDense(((mine, 3), (mine, 3)), comm=COMM)
    A.setUp()
    for row in range(*A.getOwnershipRange()):
        A.setValues([row], range(3), np.ones(3) + np.eye(3)[row])
    A.assemble()
    A = A.convert("aij")
    with options_given("ordered_", {"mat_mumps_icntl_7": 2}):
        solver = LinearSolver(A, None, "ordered_", None)
    assert solver.ksp.getPC().getFactorMatrix().getMumpsInfog(7) == 2
    assert np.allclose(solver.solve(np.ones(mine)), 0.25, rtol=1e-12, atol=0.0)
    solver.destroy()


@pytest.mark.parametrize("gdim, order", [(3, 1), (2, 1), (3, 2)])
def test_a_body_of_one_cell(gdim, order):
    """A block of one cell carries its weight 1; held at its head and pressed by the strain 1e-3, without lateral contraction, E times that, and half its weight."""
    edges = [1] * gdim
    cell = mesh.CellType.hexahedron if gdim == 3 else mesh.CellType.quadrilateral
    make = mesh.create_unit_cube if gdim == 3 else mesh.create_unit_square
    domain = make(COMM, *edges, cell)
    V, up = functionspace(domain, ("Lagrange", order, (gdim,))), np.eye(gdim)[-1]
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = (1e5 * ufl.inner(ufl.sym(ufl.grad(u)), ufl.grad(v)) + v[gdim - 1]) * ufl.dx
    foot = mesh.locate_entities_boundary(domain, gdim - 1, lambda x: np.isclose(x[gdim - 1], 0))
    head = fem.locate_dofs_geometrical(V, lambda x: np.isclose(x[gdim - 1], 1))
    for bcs, force in (([], 1.0), ([fem.dirichletbc(-1e-3 * up, head, V)], 100.5)):
        plane = dc.RigidPlane(np.zeros(gdim), up)
        contact = dc.Contact(V, foot, plane, dc.Friction(0.3))
        with dc.ContactProblem(F, u, [contact], bcs=bcs) as problem:
            problem.solve()
            assert np.abs(contact.force() - force * up).max() < 1e-7 * force
