# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A flat punch on a plastic half-plane (demos/demo_indentation.py) against Newton's method with the punch as boundary values."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import ufl
from demo_indentation import SIZE, YIELD, YOUNG, half_plane, indent
from dolfinx import fem
from dolfinx.fem import petsc
from mpi4py import MPI
from scipy import sparse

COMM = MPI.COMM_WORLD


def pushed(scene, depths):
    """The same with the punch as boundary values: Newton's method on them with SciPy, one rank, no contact."""
    down = fem.Constant(scene.mesh, 0.0)
    conditions = [*scene.bcs, scene.fix(1, scene.top, down)]
    F = fem.form(scene.F)
    J = fem.form(ufl.derivative(scene.F, scene.u))
    u, n = scene.u.x.array, scene.u.x.array.size
    under = fem.locate_dofs_topological(scene.V.sub(1), 1, scene.top)
    fixed = np.unique(np.concatenate([bc.dof_indices()[0] for bc in conditions]))
    free = np.setdiff1d(np.arange(n), fixed)
    for depth in depths:
        down.value = -depth
        for _ in range(30):
            move = np.zeros(n)
            move[under] = -depth - u[under]
            forces = petsc.assemble_vector(F).array
            A = petsc.assemble_matrix(J)
            A.assemble()
            A = sparse.csr_matrix(A.getValuesCSR()[::-1], shape=(n, n))
            left = -(forces + A @ move)[free]
            move[free] = sparse.linalg.spsolve(A[free][:, free].tocsc(), left)
            u += move
            if np.abs(move).max() < 1e-13 * SIZE:
                break
        yield -petsc.assemble_vector(F).array[under].sum()
        scene.law.after_step(scene.u)


@pytest.mark.slow
def test_the_punch_as_boundary_values():
    """Loaded, partly unloaded and loaded again forces are those of Newton's method without contact; taken off, the imprint stays."""
    depths = YIELD / YOUNG * np.array([2.0, 6, 12, 11, 14])
    scene = half_plane(10)
    *forces, _, left = indent(scene, [*depths, 0.9 * depths[-1], 0.0])
    expected = list(pushed(half_plane(10, MPI.COMM_SELF), depths))
    np.testing.assert_allclose(forces, expected, rtol=1e-7)
    assert forces[3] < 0.9 * forces[2] and left == 0.0
    deepest = COMM.allreduce(scene.u.x.array[1::2].min(initial=0.0), op=MPI.MIN)
    assert -depths[-1] < deepest < -0.5 * depths[-1]


def test_a_punch_that_moves_off_is_followed():
    """The first step back, in which the punch leaves all nodes, is nearly elastic: it takes few iterations, with no other solver."""
    depths = YIELD / YOUNG * np.array([2.0, 5, 10, 15, 20, 25, 24, 22])
    few = dc.SparseNewton(max_iterations=12)
    forces = list(indent(half_plane(10), depths, solver=few))
    assert 0 < forces[-1] < forces[-2] < forces[-3]
