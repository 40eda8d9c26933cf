# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Perfectly rough contact, mu = inf, and coefficients beside which rounding of slips is large."""

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace

COMM, INF = scenes.COMM, np.inf
PROGRAMME = [(0.0, -0.01), (0.003, -0.012), (-0.002, -0.01)]
SOLVERS = [None, dc.FixedPoint(), dc.SparseNewton()]


def moved(scene, x, z):
    scene.move_top(x, *[0.0] * (scene.V.mesh.geometry.dim - 2), z)
    return scene.problem.solve()


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("cells", [(3, 3, 2), (4, 2)])
def test_what_touches_a_rough_plane_is_glued(cells, solver):
    """Pressed and sheared so that nothing lifts, a block has the displacement of one whose foot is held by supports, at rest or on a moving plane."""
    scene = scenes.block(cells=cells, mu=INF, p=None, solver=solver, tol=1e-10)
    glued, gdim = scenes.block(cells=cells, mu=0.0, p=None), len(cells)
    foot = mesh.locate_entities_boundary(
        glued.V.mesh, gdim - 1, lambda x: np.isclose(x[gdim - 1], 0.0)
    )
    stands = fem.Constant(glued.V.mesh, np.zeros(gdim))
    support = fem.dirichletbc(stands, fem.locate_dofs_topological(glued.V, gdim - 1, foot), glued.V)
    linear = dc.ContactProblem(glued.F, glued.u, [], bcs=[*glued.bcs, support])
    for k, (x, z) in enumerate(PROGRAMME):
        stands.value[0] = 1e-3 * k
        scene.surface.displacement = stands.value
        step = moved(scene, x, z)
        assert (
            step.counts.open == step.counts.slip == 0 and max(step.error, step.slip_error) <= 1e-10
        )
        glued.move_top(x, *[0.0] * (gdim - 2), z)
        linear.solve()
        assert np.abs(scene.u.x.array - glued.u.x.array).max() <= 1e-10
    assert not scene.contact.dissipation.any() and not scene.contact.slip_path.any()


@pytest.mark.parametrize("solver", SOLVERS)
def test_large_coefficients_are_as_good_as_infinite_ones(solver):
    """From 1e3 over 1e7, for which sweeps once took minutes, to 1e30, and with infinity, reactions of a block that is sheared until half of it lifts are the same; no more is asked than rounding allows."""
    found = []
    for mu in (1e3, 1e7, 1e30, INF, (INF, INF)):
        scene = scenes.block(cells=(2, 2, 1), mu=mu, p=None, solver=solver, tol=1e-10)
        for x, z in ((0.0, -0.01), (0.02, -0.001)):
            step = moved(scene, x, z)
            assert max(step.error, step.slip_error, step.forward_error) <= 1e-10
        assert step.counts.open > 0 and step.counts.slip == 0
        found.append(scenes.gathered(scene.contact)[1])
    for other in found[1:]:
        assert np.abs(other - found[0]).max() <= 1e-8 * np.abs(found[0]).max()


def test_a_loose_block_on_a_rough_plane():
    """Held by contact alone, pulled sideways by its weight so that its edge would lift: the plane carries both, however little presses there."""
    edges = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.4]]
    domain = mesh.create_box(COMM, edges, [3, 3, 2], mesh.CellType.hexahedron)
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = (1e3 * ufl.inner(ufl.sym(ufl.grad(u)), ufl.grad(v)) - v[0] + v[2]) * ufl.dx
    foot = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[2], 0.0))
    contact = dc.Contact(V, foot, dc.RigidPlane((0, 0, 0), (0, 0, 1)), dc.Friction(INF))
    step = dc.ContactProblem(F, u, contact).solve()
    assert np.abs(contact.force() - (-0.4, 0.0, 0.4)).max() <= 1e-7
    least = COMM.allreduce(contact.reaction[:, 2].min(initial=1.0), op=scenes.MPI.MIN)
    assert step.counts.open == 0 and 0.0 < least < 1e-5


def test_rough_on_one_side():
    """A field: where mu is infinite nodes stick, where it is zero they carry no friction."""
    scene = scenes.block(cells=(4, 4, 2), mu=0.0, p=None)
    scene.contact.friction = dc.Friction(lambda x: np.where(x[0] < -0.1, INF, 0.0))
    moved(scene, 0.0, -0.01)
    moved(scene, 0.002, -0.01)
    c, left = scene.contact, scene.contact.x[:, 0] < -0.1
    assert (c.status[left] == dc.Status.STICK).all()
    assert np.abs(c.slip_increment[left]).max(initial=0.0) <= 1e-10
    assert not c.reaction[~left, :-1].any()
    assert COMM.allreduce(int((c.slip_increment[~left, 0] != 0).sum())) > 0


def test_a_rough_plane_cannot_be_dragged_along():
    """By 0.4 of the normal force, which mu = 0.3 cannot carry, a rough plane is moved by the block's shear alone, and back when it ends."""
    scene = scenes.block(cells=(2, 2, 1), mu=INF, p=None)
    scene.surface.free = ("t1", "n")
    stood = []
    for part in (0.0, 0.4, 0.0):
        scene.surface.force = (part * 210, 0, 210.0)
        assert scene.problem.solve().counts.slip == 0
        stood.append(scene.surface.displacement[0])
    assert abs(stood[1]) > 1e-4 and abs(stood[2] - stood[0]) <= 1e-7 * abs(stood[1])


@pytest.mark.parametrize("mu", [(INF, 0.3), [[INF, 0.3], [0.3, 0.3]], -INF, np.nan, [None, INF], np.ma.array([INF, 1.0], mask=[0, 1])])  # fmt: skip
def test_infinite_in_one_direction_is_refused(mu):
    """Infinity stands in both directions or in none, and nothing else passes with it."""
    with pytest.raises(ValueError, match="^mu "):
        dc.Friction(mu)
    with pytest.raises(ValueError, match="mu must be infinite in both directions"):
        scene = scenes.block(cells=(2, 2, 1))
        scene.contact.friction = dc.Friction(lambda x: np.stack((INF + 0 * x[0], 1 + 0 * x[0])))
        COMM.barrier()
