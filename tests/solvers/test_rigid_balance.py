# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A body on soft springs: its rigid motions are balanced apart, and the fixed point solves it."""

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from dolfinx_contact.law.maps import BipotentialMap, ReturnMap
from dolfinx_contact.solvers.fixed_point.preconditioner import ContactPreconditioner
from mechanics.two_blocks import box, joined

SHAPES = [(6, 4), (4, 4, 2)]


def held_by_springs(stiffness, cells, solver=None, comm=scenes.COMM, tol=1e-10, **options):
    """A block in springs of ``stiffness`` times its modulus, which pull it to ``scene.home``."""
    friction = {"mu": 0.2, "p": None} if len(cells) == 2 else {}
    scene = scenes.block(comm, cells, **friction, **options)
    scene.home = fem.Function(scene.V)
    stiffness = fem.Constant(scene.mesh, float(stiffness))  # one form for all
    pull = stiffness * scene.modulus * ufl.inner(scene.u - scene.home, ufl.TestFunction(scene.V))
    scene.problem = dc.ContactProblem(
        scene.F + pull * ufl.dx, scene.u, [scene.contact], solver=solver, tol=tol
    )

    def go(*displacement):
        scene.home.x.array[:] = np.tile(
            scene.axes @ displacement, scene.home.x.array.size // len(cells)
        )

    scene.go = go
    return scene


def pressed_and_dragged(stiffness, cells, map):
    """The first step of a block pressed and dragged, maps, its rigid balance, and a state with reactions."""
    scene = held_by_springs(stiffness, cells, turn=scenes.rotation() if len(cells) == 3 else None)
    scene.go(*[0.004, 0.002][: len(cells) - 1], -0.005)
    step = scene.problem.load_step()
    trial = step.body.free_state(step.b)
    rho = [contact.stiffness.normal for contact in step.contacts]
    maps = [BipotentialMap(r) if map == "bipotential" else ReturnMap(r, r) for r in rho]
    return step, maps, ContactPreconditioner(step, maps).rigid, step.evaluate(trial, maps)


@pytest.mark.parametrize("map", ["return", "bipotential"])
@pytest.mark.parametrize("cells", SHAPES)
def test_no_force_is_left_along_rigid_motions(cells, map):
    """After balancing, the forces out of balance along all rigid motions have fallen a hundredfold or more."""
    step, maps, rigid, trial = pressed_and_dragged(1e-4, cells, map)
    body, motions = step.body, step.body.rigid_modes()

    def along(x):
        return np.linalg.norm(body.total(motions.T @ step.evaluate(x, maps).residual))

    assert along(rigid.balanced(trial.x, step, maps, trial)[0]) < 1e-2 * along(trial.x)


@pytest.mark.parametrize("map", ["return", "bipotential"])
@pytest.mark.parametrize("cells", SHAPES)
def test_slope_is_the_derivative_of_the_forces(cells, map):
    """Newton's matrix is the difference quotient of the forces along the motions, statuses mixed."""
    step, maps, rigid, trial = pressed_and_dragged(1e-4, cells, map)
    body, n = step.body, len(rigid)
    assert n == {2: 3, 3: 6}[len(cells)]
    x0, *_ = rigid.balanced(trial.x, step, maps, trial)
    forces = step.b - body.multiply(x0)
    size = np.abs(rigid.modes).max()
    unit = body.largest(np.abs(trial.x)) / body.largest(np.array([size]))
    middle = 0.02 * unit * np.random.default_rng(3).normal(size=n)

    def left(c):
        return rigid.left(x0 + rigid.modes @ c, forces - rigid.forces @ c, step, maps, trial)

    quotient = [
        (left(middle - h)[0] - left(middle + h)[0]) / 2e-6 / unit for h in 1e-6 * unit * np.eye(n)
    ]
    slope = left(middle)[1]
    assert np.abs(np.transpose(quotient) - slope).max() < 1e-4 * np.abs(slope).max()


def test_held_bodies_have_no_motions_to_balance():
    """A block whose top is held pays nothing: no motion is soft."""
    scene = scenes.block(solver=dc.FixedPoint())
    scene.move_top(0, 0, -0.01)
    scene.problem.solve()
    assert len(scene.problem.bound().preconditioner.rigid) == 0


@pytest.mark.parametrize("stiffness", [1e-4, 1e-6])
@pytest.mark.parametrize("cells", SHAPES)
def test_fixed_point_solves_what_soft_springs_hold(cells, stiffness):
    """Pressed, dragged, tilted by the drag and nearly lifted: few iterations, and the reactions of Newton's method."""
    own = held_by_springs(stiffness, cells, dc.FixedPoint())
    newton = held_by_springs(stiffness, cells, dc.CondensedNewton(), MPI.COMM_SELF)
    for x, z in ((0, -0.005), (0.02, -0.005), (-0.02, -0.003), (0, -0.001)):
        for scene in (own, newton):
            scene.go(x, *[x / 2][: len(cells) - 2], z)
        step = own.problem.solve()
        other = newton.problem.solve()
        assert step.iterations <= 40
        # The judge's bound of reactions, see judge.py, by the error that a step admits where rounding limits it.
        bound = 1000 * max(
            own.problem.tol, step.error, step.slip_error, other.error, other.slip_error
        )
        (_, found), (_, expected) = scenes.gathered(own.contact), scenes.gathered(newton.contact)
        assert np.abs(found - expected).max() <= bound * np.abs(expected).max()


def pushed(cell, far, modulus, solver, **options):
    """A loose block with weight on a plane, which a spring at its side pushes by several lengths, each from rest; beside it, maybe, what is far."""
    d = 2 if cell == "quadrilateral" else 3
    wide = (10, 4) if d == 2 else (5, 2, 2)
    parts = [box(cell, np.zeros(d), [1.0, *[0.5] * (d - 2), 0.3], wide)]
    if far != "nothing":
        parts.append(box(cell, [5.0, *[0.0] * (d - 1)], [6.0] + [1.0] * (d - 1), (3,) * d))
    domain = joined(parts)
    V = functionspace(domain, ("Lagrange", 1, (d,)))
    u, v, DG = fem.Function(V), ufl.TestFunction(V), functionspace(domain, ("DG", 0))
    E, weight, way = fem.Function(DG), fem.Function(DG), fem.Constant(domain, 0.0)
    E.interpolate(lambda x: np.where(x[0] < 2, 1e6, modulus * 1e6))
    weight.interpolate(lambda x: np.where(x[0] < 2, 10.0, 0.0))
    foot, side, end = (mesh.locate_entities_boundary(domain, d - 1, lambda x, k=k, at=at: (np.isclose(x[k], at)) & ((x[0] < 2) == (at < 2))) for k, at in ((d - 1, 0.0), (0, 0.0), (0, 6.0)))  # fmt: skip
    tags = mesh.meshtags(domain, d - 1, np.sort(side), np.ones(side.size, np.int32))
    ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)(1)
    strain = lambda w: ufl.sym(ufl.grad(w))  # noqa: E731
    F = E * ufl.inner(strain(u), strain(v)) * ufl.dx + weight * v[d - 1] * ufl.dx
    F -= 1e3 * (way - u[0]) * v[0] * ds
    bcs = [fem.dirichletbc(np.zeros(d), fem.locate_dofs_topological(V, d - 1, end), V)] if far == "clamped" else []  # fmt: skip
    if far == "on springs":
        soft = fem.Function(DG)
        soft.interpolate(lambda x: np.where(x[0] < 2, 0.0, 10.0))
        F += soft * ufl.inner(u, v) * ufl.dx
    contact = dc.Contact(V, foot, dc.RigidPlane(np.zeros(d), np.eye(d)[-1]), dc.Friction(0.3))
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, solver=solver, **options)
    problem.solve()
    rest, found = problem.snapshot(), []
    for way.value in (0.01, 0.1, 0.4):
        problem.restore(rest)
        found.append((problem.solve().iterations, *contact.force()))
    return np.array(found)


@pytest.mark.ranks
@pytest.mark.parametrize("far, modulus", [("clamped", 1.0), ("clamped", 1e4), ("on springs", 1.0)])
@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron"])
@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
def test_what_is_far_away_in_the_mesh_changes_nothing(cell, far, modulus, solver):
    """A loose block is pushed as it is alone, in about as many iterations, if an unrelated body is in the mesh."""
    alone = pushed(cell, "nothing", 1.0, solver)
    found = pushed(cell, far, modulus, solver)
    assert np.abs(found[:, 1:] - alone[:, 1:]).max() <= 1e-6 * np.abs(alone[:, 1:]).max()
    assert (found[:, 0] <= 1.5 * alone[:, 0] + 5).all()
