# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact points as rows of a matrix: motion and forces are adjoint, each point has a frame of its own."""

import numpy as np
import pytest
from scipy import sparse

from dolfinx_contact.contact.interface import ContactPoints


@pytest.fixture(params=[2, 3])
def points(request):
    """Five of nine nodes with frames of their own, and a random generator."""
    rng, dim = np.random.default_rng(request.param), request.param
    nodes = np.sort(rng.choice(9, 5, replace=False))
    frames = np.array([np.linalg.qr(rng.normal(size=(dim, dim)))[0] for _ in nodes])
    return ContactPoints(dim * nodes[:, None] + np.arange(dim), frames, (9 * dim, 0, 9 * dim)), rng


def test_motion_is_that_of_the_node_in_its_frame(points):
    """B u, row by row, is each node's displacement in its own frame."""
    points, rng = points
    u = rng.normal(size=points.size)
    for motion, dofs, frame in zip(points.motion(u), points.dofs, points.frames):
        assert motion == pytest.approx(frame @ u[dofs], abs=1e-15)


def test_forces_are_the_adjoint_of_motion(points):
    """Virtual work: reactions times motion are nodal forces times displacement; reactions come back from forces."""
    points, rng = points
    u, r = rng.normal(size=points.size), rng.normal(size=(points.count, points.dim))
    forces = np.zeros(points.size)
    points.add_forces(r, forces)
    assert forces @ u == pytest.approx((r * points.motion(u)).sum(), rel=1e-13)
    assert points.reactions(forces) == pytest.approx(r, rel=1e-13)


def test_blocks_are_summed_where_the_points_are(points):
    """u^T (B^T D B) u is the sum of nodal energies, and nothing stands at other nodes."""
    points, rng = points
    u, D = rng.normal(size=points.size), rng.normal(size=points.frames.shape)
    matrix = points.matrix(D)
    motion = points.motion(u)
    assert u @ (matrix @ u) == pytest.approx(np.einsum("ni,nij,nj", motion, D, motion), rel=1e-12)
    elsewhere = np.setdiff1d(np.arange(points.size), points.dofs)
    assert abs(matrix[elsewhere]).max() == 0.0


def test_what_a_support_leaves_of_each_direction(points):
    """A node all of whose components are fixed has nothing left, one of which none is has all."""
    points, _ = points
    left = points.free_of(points.dofs[0])
    assert left[0] == pytest.approx(0.0) and left[1:] == pytest.approx(1.0)


@pytest.fixture(params=[2, 3])
def pairs(request):
    """Two points that are means of two of five nodes, and one that is its node; frames of their own; a random generator."""
    rng, dim = np.random.default_rng(10 + request.param), request.param
    frames = np.array([np.linalg.qr(rng.normal(size=(dim, dim)))[0] for _ in range(5)])
    m, s = np.zeros((2, 5, 5))
    m[0, [0, 3]] = m[1, [1, 2]] = 0.5
    s[0, [0, 3]] = s[1, [1, 2]] = m[4, 4] = s[4, 4] = 1.0
    dofs = dim * np.arange(1, 6)[:, None] + np.arange(dim)
    owned = (7 * dim, 100, 7 * dim + 100)
    return ContactPoints(dofs, frames, owned, sparse.csr_matrix(m), sparse.csr_matrix(s)), rng


def test_points_of_several_nodes_do_the_work_of_these(pairs):
    """Motion is the mean of the nodes in the point's frame, forces are its adjoint and tell the reactions again; others never touch."""
    points, rng = pairs
    u, r = rng.normal(size=points.size), rng.normal(size=(5, points.dim))
    mean = (u[points.dofs[0]] + u[points.dofs[3]]) / 2
    assert points.motion(u)[0] == pytest.approx(points.frames[0] @ mean, rel=1e-13)
    r[points.alone] = 0.0
    forces = np.zeros(points.size)
    points.add_forces(r, forces)
    assert forces @ u == pytest.approx((r * points.motion(u)).sum(), rel=1e-12)
    assert points.reactions(forces) == pytest.approx(r, rel=1e-12, abs=1e-14)
    assert points.closed.tolist() == points.alone.tolist() == [False, False, True, True, False]
    assert not points.local


def test_rows_are_motions_along_given_directions(pairs):
    """Rows along directions of each point give its motion along these, without what supports fix of any of its nodes."""
    points, rng = pairs
    turns, free = rng.normal(size=(5, points.dim - 1, points.dim)), np.ones(points.size, dtype=bool)
    free[points.dofs[3]] = False
    (directions, sums), u = points.rows(turns, free), rng.normal(size=points.size)
    rows = directions @ sums
    assert rows.shape == (5 * (points.dim - 1), points.size + 100)
    moved = np.einsum("nki,ni->nk", turns, points.motion(free * u)).ravel()
    assert rows[:, 100:] @ u == pytest.approx(moved, rel=1e-12, abs=1e-14)
