# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Multigrid for the stiffness plus springs: every level is the Galerkin product, smoothers are the body's own."""

import numpy as np
import pytest
import scenes
from petsc4py import PETSc

import dolfinx_contact as dc
from dolfinx_contact.petsc.linear_solver import MULTIGRID_OPTIONS, LinearSolver
from dolfinx_contact.petsc.multigrid import Multigrid


def stiffened(**options):
    """A block pressed once by the fixed point: its problem, and the multigrid of stiffness and springs."""
    scene = scenes.block(
        cells=(12, 12, 8), solver=dc.FixedPoint(), petsc_options=MULTIGRID_OPTIONS | options
    )
    scene.move_top(0, 0, -0.005)
    scene.problem.solve()
    multigrid = scene.problem.bound().preconditioner.stiffened
    assert isinstance(multigrid, Multigrid)
    return scene.problem, multigrid.pc


def operator(problem, pc, level):
    """A level's matrix; the finest, of which PETSc makes no products, from the stiffness and springs along the axes."""
    matrix = pc.getMGSmoother(level).getOperators()[1]
    if matrix.getType() != "python":
        return matrix
    whole = problem.body.K.copy()
    whole.setDiagonal(matrix.getDiagonal())
    x, y = whole.createVecs()
    x.setRandom()
    whole.mult(x, y)
    scale = y.norm()
    y.scale(-1.0)
    assert (matrix * x + y).norm() <= 1e-12 * scale
    return whole


@pytest.mark.parametrize("threshold", [0.01, -1.0])
def test_levels_are_galerkin_products(threshold):
    """Each coarse matrix is P^T A P of the one above, springs included, on any number of ranks."""
    problem, pc = stiffened(pc_gamg_threshold=threshold)
    finest = pc.getMGLevels() - 1
    assert finest >= 1
    top, K = operator(problem, pc, finest), problem.body.K
    stiffness = dc.OwnLoop(problem.contacts[0], K, map="return").springs
    springs = top.getDiagonal().sum() - K.getDiagonal().sum()
    assert springs == pytest.approx(problem.body.total(stiffness.sum()))
    for level in range(finest, 0, -1):
        product = operator(problem, pc, level).PtAP(pc.getMGInterpolation(level))
        size = product.norm()
        product.axpy(-1.0, operator(problem, pc, level - 1))
        assert product.norm() <= 1e-12 * size


def test_as_good_as_a_hierarchy_of_its_own():
    """Conjugate gradients take as many iterations, within a tenth or one, as with GAMG set up for the sum."""
    problem, pc = stiffened()
    A, body = operator(problem, pc, pc.getMGLevels() - 1), problem.body
    right, left = A.createVecs()
    left.array_w[:] = np.sin(1.0 + body.V.tabulate_dof_coordinates()[: body.size // 3]).ravel()
    ksp = PETSc.KSP().create(A.comm)
    ksp.setOperators(A)
    ksp.setType("cg")
    ksp.setTolerances(rtol=1e-10)
    ksp.setPC(pc)
    ksp.solve(left, right)
    own = LinearSolver(A, MULTIGRID_OPTIONS | {"ksp_rtol": 1e-10}, "own_", body.rigid_modes)
    difference = np.abs(own.solve(left.array_r.copy()) - right.array_r).max()
    assert difference <= 1e-8 * right.norm(PETSc.NormType.INFINITY)
    expected = own.ksp.getIterationNumber()
    assert abs(ksp.getIterationNumber() - expected) <= max(0.1 * expected, 1)
    own.destroy()


def test_smoothers_are_those_of_the_body():
    """What the user says of the smoothers of the stiffness holds with springs, too.

    Jacobi's, within a domain of each rank: where a rank has a node that no other is strongly coupled to, GAMG gives it six
    coarse unknowns with three rows of zeros, which pbjacobi, as it inverts blocks, refuses.
    """
    _, pc = stiffened(
        mg_levels_pc_type="asm", mg_levels_sub_pc_type="jacobi", mg_levels_ksp_max_it=3
    )
    for level in range(1, pc.getMGLevels()):
        smoother = pc.getMGSmoother(level)
        assert smoother.getType() == "chebyshev" and smoother.getTolerances()[3] == 3
        assert smoother.getPC().getType() == "asm"
        assert [ksp.getPC().getType() for ksp in smoother.getPC().getASMSubKSP()] == ["jacobi"]
