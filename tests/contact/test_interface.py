# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact points as rows of a matrix: motion and forces are adjoint, each point has a frame of its own."""

import numpy as np
import pytest

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
