# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Against Siconos, where Debian's python3-siconos is installed: its isotropic projection, and its
solver on orthotropic and non-associated problems in the scaled variables, where they are isotropic.
"""

import ctypes
import ctypes.util

import numpy as np
import pytest
from mpi4py import MPI

from dolfinx_contact.law.bipotential import bipotential_gap
from dolfinx_contact.law.friction import Friction
from dolfinx_contact.law.friction_cone import project_cone

pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="nothing parallel in it"),
]
TO_SICONOS = [2, 0, 1]  # it puts the normal component first


@pytest.fixture(scope="module")
def numerics():
    return pytest.importorskip(
        "siconos.numerics", reason="no python3-siconos here", exc_type=ImportError
    )


def test_projection_on_the_isotropic_cone(numerics):
    """projectionOnCone of Siconos and project_cone agree to 1e-12 of |tau|, at points anywhere, on
    the axis and at the apex."""
    library = ctypes.CDLL(ctypes.util.find_library("siconos_numerics"))
    project = library.projectionOnCone
    project.argtypes = [ctypes.POINTER(ctypes.c_double), ctypes.c_double]
    rng = np.random.default_rng(1)
    tau = rng.normal(size=(2000, 3)) * 10.0 ** rng.uniform(-3, 3, size=(2000, 1))
    tau[:20, :2] = 0
    tau[20:40] = 0
    tau[40:60, 2] = 0
    for mu in (0.01, 0.3, 1.0, 5.0):
        found = project_cone(tau, mu)
        for point, r in zip(tau, found):
            theirs = (ctypes.c_double * 3)(*point[TO_SICONOS])
            project(theirs, mu)
            assert np.linalg.norm(r[TO_SICONOS] - theirs) <= 1e-12 * np.linalg.norm(point)


@pytest.mark.parametrize(
    "mu, p",
    [(0.3, None), ((0.3, 0.15), None), ((0.3, 0.15), (0.05, 0.2)), ((0.5, 0.1), (0.2, 0.1))],
)
def test_solver_on_scaled_problems(numerics, mu, p):
    """A solution of Siconos' nonsmooth Newton method for T W S, T q and unit friction obeys the
    orthotropic or non-associated law here, and is the one our fixed point ends at, to 1e-8."""
    friction, n = Friction(mu, p), 6
    law = friction.law(3)
    rng, statuses = np.random.default_rng(2), set()
    S = np.tile([*friction.mu, 1.0], n)
    T = np.tile([*(friction.p**2 / friction.mu), 1.0], n)
    for _ in range(5):
        A = rng.normal(size=(3 * n, 3 * n))
        W = np.eye(3 * n) + 0.05 * (A @ A.T) / (3 * n)
        q = rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-3, 0, size=(n, 1))
        q[:, 2] = rng.uniform(-1, 0.5, n)
        order = np.add.outer(3 * np.arange(n), TO_SICONOS).ravel()
        scaled = (T[:, None] * W * S)[np.ix_(order, order)]
        problem = numerics.FrictionContactProblem(3, n, scaled, (T * q.ravel())[order], np.ones(n))
        options = numerics.SolverOptions(numerics.SICONOS_FRICTION_3D_NSN_AC)
        options.dparam[numerics.SICONOS_DPARAM_TOL] = 1e-13
        reaction, velocity = np.zeros(3 * n), np.zeros(3 * n)
        numerics.fc3d_driver(problem, reaction, velocity, options)
        theirs = np.empty(3 * n)
        theirs[order] = reaction
        theirs = (S * theirs).reshape(n, 3)

        ours, rho = np.zeros((n, 3)), np.full(n, 0.5)
        for _ in range(3000):
            w = q + (W @ ours.ravel()).reshape(n, 3)
            ours, branch = law.return_map(ours, w[:, 2], w[:, :2], rho, rho)
        assert np.abs(ours - theirs).max() <= 1e-8
        statuses |= set(branch)

        w = q + (W @ theirs.ravel()).reshape(n, 3)
        gap, slip = w[:, 2], w[:, :2]
        for moved, _ in (
            law.bipotential_map(theirs, gap, slip, rho),
            law.scaled_map(theirs, gap, slip, rho),
            law.return_map(theirs, gap, slip, rho, rho),
        ):
            assert np.abs(moved - theirs).max() <= 1e-8
        certificate = bipotential_gap(project_cone(theirs, mu), np.maximum(gap, 0), slip, friction)
        assert certificate.max() <= 1e-8
    assert statuses == {0, 1, 2}
