# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A symmetric matrix by its lower half: the same products and sweeps as PETSc's, whoever owns what; others are told apart."""

import numpy as np
import pytest
import scenes
from petsc4py import PETSc

import dolfinx_contact as dc
from dolfinx_contact.compat import partitioner
from dolfinx_contact.contact.interface import like
from dolfinx_contact.petsc.linear_solver import MULTIGRID_OPTIONS, LinearSolver
from dolfinx_contact.petsc.symmetric_matrix import GaussSeidel, halved, plus

pytestmark = pytest.mark.ranks
OWNERS = {
    "shared": None,
    "on one rank": partitioner(lambda cells, size: np.zeros(cells), 8),
}
SWEEP = PETSc.Mat.SORType.LOCAL_SYMMETRIC_SWEEP | PETSc.Mat.SORType.ZERO_INITIAL_GUESS


def block(owners="shared", cells=(5, 4, 3), **options):
    """A block on a plane, and its stiffness."""
    scene = scenes.block(scenes.COMM, cells, partitioner=OWNERS[owners], **options)
    scene.problem.body.refresh()
    return scene, scene.problem.body.K


def random_like(K):
    """A vector of seeded numbers, and room for another one."""
    x, y = K.createVecs()
    x.array_w[:] = np.random.default_rng(7 + K.comm.rank).normal(size=x.array_r.size)
    return x, y


def same(A, B, tol=1e-13):
    """Whether matrices have the same products and diagonal, to rounding."""
    x, y = random_like(B)
    B.mult(x, y)
    rest = A * x - y
    diagonal = A.getDiagonal() - B.getDiagonal()
    return rest.norm() <= tol * y.norm() and diagonal.norm() <= tol * B.getDiagonal().norm()


@pytest.mark.parametrize("owners", OWNERS)
@pytest.mark.parametrize("cells", [(5, 4, 3), (7, 5)])
@pytest.mark.parametrize("scale", [1.0, 1e-120, 1e120])
def test_products_are_the_same(owners, cells, scale):
    """In two and three dimensions, whatever the units."""
    mu = (0.3, 0.2) if len(cells) == 3 else 0.3
    p = (0.1, 0.2) if len(cells) == 3 else None
    _, K = block(owners, cells, mu=mu, p=p)
    K.scale(scale)
    half = halved(K)
    assert half.getPythonContext().size == len(cells)
    assert same(half, K)


@pytest.mark.parametrize("owners", OWNERS)
def test_a_sweep_is_petscs(owners):
    """Each rank's symmetric Gauss-Seidel over its own unknowns, by blocks of a node: PETSc's with blocks."""
    _, K = block(owners)
    b, x = random_like(K)
    own = K.getDiagonalBlock() if K.comm.size > 1 else K
    blocks = own.convert("baij", PETSc.Mat())
    left, right = blocks.createVecs()
    left.array_w[:] = b.array_r
    if b.array_r.size:
        blocks.SOR(left, right, sortype=SWEEP, its=1, lits=1)
    pc = PETSc.PC().create(K.comm)
    pc.setOperators(halved(K))
    pc.setType("python")
    pc.setPythonContext(GaussSeidel())
    pc.setUp()
    pc.apply(b, x)
    difference = np.abs(x.array_r - right.array_r).max(initial=0.0)
    assert difference <= 1e-12 * np.abs(right.array_r).max(initial=1e-300)


@pytest.mark.parametrize("owners", OWNERS)
def test_springs_of_a_node_share_what_they_do_not_change(owners):
    """K + S, with springs in every direction of a node; not where they couple two nodes."""
    scene, K = block(owners)
    points = scene.contact.points
    rates = np.random.default_rng(1).uniform(size=(points.count, 3, 3))
    S = like(K, points.matrix(rates + rates.transpose(0, 2, 1)))
    A = K.copy()
    A.axpy(1.0, S, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    half = halved(K)
    assert same(plus(half, S), A)
    assert same(half, K)  # as it was
    assert plus(half, K) is None


def test_a_matrix_that_is_not_symmetric_is_left_to_petsc():
    """One entry that couples two nodes is enough, relative to its row; conjugate gradients then have the whole matrix."""
    _, K = block(cells=(8, 8, 6))
    row = K.getOwnershipRange()[0]
    if K.comm.rank == 0:
        columns, values = K.getRow(row)
        at = next(c for c, v in zip(columns, values) if c >= row + 3 and v != 0.0)
        K.setValue(row, at, 1e-8 * np.abs(values).max(), addv=True)
    K.assemble()
    assert halved(K) is None


def test_the_users_smoother_goes_before_ours():
    """Options of the levels, among the user's own or in PETSc's database, keep the matrix whole; ours halve it."""
    scene, K = block(cells=(8, 8, 6))
    modes = scene.problem.body.rigid_modes
    assert LinearSolver(K, MULTIGRID_OPTIONS, "ours_", modes).halved is not None
    assert (
        LinearSolver(K, MULTIGRID_OPTIONS | {"mg_levels_pc_type": "sor"}, "own_", modes).halved
        is None
    )
    database = PETSc.Options("database_")
    database["mg_levels_ksp_max_it"] = 3
    try:
        assert LinearSolver(K, MULTIGRID_OPTIONS, "database_", modes).halved is None
    finally:
        del database["mg_levels_ksp_max_it"]


def test_a_loose_body_multiplies_by_its_own_stiffness():
    """Where anchors hold the body, its solver has another matrix than its stiffness."""
    scene = scenes.block(cells=(8, 8, 6))
    problem = dc.ContactProblem(scene.F, scene.u, [scene.contact], petsc_options=MULTIGRID_OPTIONS)
    body = problem.body
    body.refresh()
    assert body.loose is not None
    x, y = random_like(body.K)
    body.K.mult(x, y)
    expected = y.array_r.copy()
    body.solve(x.array_r.copy())
    assert body.anchors.solver.halved is not None
    difference = body.multiply(x.array_r.copy()) - expected
    assert np.abs(difference).max(initial=0.0) <= 1e-13 * np.abs(expected).max(initial=1.0)
