# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Mixed spaces: contact on the displacements, pressures beside them."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from dolfinx.fem.petsc import assemble_matrix
from mixed_scenes import block, held, pressed, ring, taylor_hood
from patches import carries_even_stress
from scenes import COMM
from test_bodies_of_users import BULK, rubber_seal

from dolfinx_contact.compat import mixed_functionspace, partitioner
from mechanics import judge

pytestmark = pytest.mark.ranks
SLIPS = pytest.mark.parametrize("slips", [False, True], ids=["stick", "slip"])
TILTED = pytest.mark.parametrize(
    "tilted", [pytest.param(False, marks=pytest.mark.slow), True], ids=["flat", "tilted"]
)
SOLVERS = {"CondensedNewton": dc.CondensedNewton(), "SparseNewton": dc.SparseNewton(), "FixedPoint": dc.FixedPoint()}  # fmt: skip


def passes_patch_test(found) -> None:
    """Displacements, pressures, statuses, reactions and slips are those of the even stress."""
    u, p = (found.u.sub(i).collapse().x.array for i in range(2))
    exact = found.exact.x.array
    assert np.abs(u - exact).max(initial=0.0) <= 1e-10 * np.abs(exact).max(initial=1e-3)
    assert np.abs(p / found.pressure - 1).max(initial=0.0) <= 1e-9
    carries_even_stress(found)


@SLIPS
@TILTED
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_patch(cell, tilted, slips):
    """On distorted meshes an even stress is found exactly by Taylor-Hood's elements."""
    passes_patch_test(pressed(cell, slips, tilted))


@SLIPS
@pytest.mark.parametrize("cell", ["triangle", pytest.param("hexahedron", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_patch_by_every_solver(name, cell, slips, sign):
    """All solvers find it, whichever sign the equation of the pressure has."""
    found = pressed(cell, slips, tilted=True, solver=SOLVERS[name], sign=sign)
    passes_patch_test(found)
    assert found.step.solver == name


@pytest.mark.parametrize("compliance", [0.5, 2e-4, 0.0])
def test_even_compression_without_friction(compliance):
    """Force, width and pressure of a block in plane strain are those of the closed form, incompressible ones included."""
    scene = block(compliance=compliance, mu=0.0, whole=False, tol=1e-12)
    scene.press(-0.1)
    # with s = G / lambda, stress along x zero: -2 G e_x = p, p = lambda (e_x + e_y), e_y = -0.1
    across = 0.1 / (1 + 2 * compliance)
    assert scene.contact.force()[1] == pytest.approx(2 * (0.2 + 2 * across), rel=1e-10)
    u, p = (scene.w.sub(i).collapse() for i in range(2))
    x = u.function_space.tabulate_dof_coordinates()[:, :2]
    np.testing.assert_allclose(u.x.array.reshape(-1, 2), x * [across, -0.1], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(p.x.array, -2 * across, rtol=1e-10)


@pytest.mark.filterwarnings("error::UserWarning")
def test_compression_between_walls():
    """Where nearly incompressible rubber cannot escape, the force is that of its bulk; a large pressure is no large displacement."""
    scene = block(compliance=1e-6, mu=0.0, whole=False, confined=True)
    scene.press(-0.1)
    assert scene.contact.force()[1] == pytest.approx(0.2 * (2 + 1e6), rel=1e-9)


PUSHES = [(0.0, -0.02), (0.03, -0.03), (0.06, -0.02)]


@pytest.mark.skipif(COMM.size > 1, reason="dense and slow: one rank is enough")
@pytest.mark.parametrize("name", SOLVERS)
def test_pressures_eliminated_by_dense_algebra(name):
    """The judge accepts reactions on the stiffness of displacements alone, Schur's complement, near a tight solution of its own."""
    scene = block(n=2, solver=SOLVERS[name], tol=1e-11)
    contact, W = scene.contact, scene.W
    A = assemble_matrix(fem.form(ufl.derivative(scene.F, scene.w, ufl.TrialFunction(W))))
    A.assemble()
    K, (V, of_u), (_, of_p) = A[:, :], W.sub(0).collapse(), W.sub(1).collapse()
    of_u, of_p = np.ravel(of_u), np.ravel(of_p)
    part = K[np.ix_(of_u, of_p)]
    K = K[np.ix_(of_u, of_u)] - part @ np.linalg.solve(K[np.ix_(of_p, of_p)], K[np.ix_(of_p, of_u)])
    y = V.tabulate_dof_coordinates()[:, 1]
    nodes = np.flatnonzero(np.isclose(y, 0.0))
    fixed = (2 * np.flatnonzero(np.isclose(y, 1.0))[:, None] + np.arange(2)).ravel()
    free = np.setdiff1d(np.arange(len(K)), fixed)
    inverse = np.linalg.inv(K[np.ix_(free, free)])
    frame, size = contact.frame, nodes.size
    rows = np.searchsorted(free, (2 * nodes[:, None] + np.arange(2)).ravel())
    compliance = inverse[np.ix_(rows, rows)].reshape(size, 2, size, 2)
    compliance = np.einsum("aj,ijkl,bl->iakb", frame, compliance, frame)
    before = np.zeros((size, 1))
    for push in PUSHES:
        scene.press(*push)
        lift = np.zeros(len(K))
        lift[fixed] = np.tile(push, fixed.size // 2)
        trial = lift.copy()
        trial[free] -= inverse @ (K @ lift)[free]
        q = trial.reshape(-1, 2)[nodes] @ frame.T
        q[:, :1] -= before
        assert np.array_equal(contact.nodes, nodes)
        verdict = judge.condensed(compliance, q, 0.3, 0.3, contact.reaction, 1e-11)
        assert verdict.accepts(1e-11) and verdict.reactions <= 1e-8, verdict
        before += (q + np.tensordot(compliance, contact.reaction, 2))[:, :1]


@pytest.mark.parametrize("name", SOLVERS)
def test_units_of_pressure_do_not_matter(name):
    """Whatever the units of length, modulus and pressure: as many iterations, the same errors and forces but for units."""
    found = []
    for length, modulus, pressure in ((1.0, 1.0, 1.0), (1e3, 1e-2, 1e6), (1e-3, 1e11, 1e-8)):
        scene = block(mu=0.3, length=length, modulus=modulus, pressure=pressure, solver=SOLVERS[name])  # fmt: skip
        steps = [scene.press(*push) for push in PUSHES]
        force = scene.contact.force() / (modulus * length)
        found.append(([step.iterations for step in steps], [step.counts for step in steps], force))
    for other in found[1:]:
        assert other[:2] == found[0][:2]
        np.testing.assert_allclose(other[2], found[0][2], rtol=1e-6)


def test_missing_volume_counts_as_a_force():
    """An error of the pressure's equation is found, as the force that taking it back makes, in any unit of pressure."""
    errors = []
    for unit in (1.0, 1e6):
        scene = block(compliance=0.0, mu=0.0, whole=False, pressure=unit)
        scene.press(-0.1)
        problem = scene.problem
        step, x = problem.load_step(), problem.body.taken(scene.w.x.array)
        assert step.measure(x).errors.error < 1e-12
        at = problem.body.displacements.x[: problem.body.displacements.count, :2]
        dilation = np.where(
            at[:, 1:] < 0.7, 1e-6 * at * [1, 0], 0.0
        )  # moves no node of the plane off it
        x = x + problem.body.displacements.vectors(dilation[:, :, None])[:, 0]
        state = step.measure(x)
        errors.append(state.errors.error)
        left = state.residual
        rest = ~problem.body.displacements.are
        assert problem.body.norm(left[rest]) > 0.01 * problem.body.norm(left)
        assert 1e-8 < errors[-1] < 1e-4
    assert errors[1] == pytest.approx(errors[0], rel=1e-6)


@pytest.mark.parametrize("mu", [pytest.param(0.0, marks=pytest.mark.slow), 0.3])
@pytest.mark.parametrize("bulk", [pytest.param(100.0, marks=pytest.mark.slow), 1000.0, None])
def test_rubber_seal_at_30_percent(bulk, mu, record_property):
    """Neo-Hookean rubber down to incompressible: both planes carry the same, volumes obey, few iterations."""
    scene = ring(bulk, mu)
    upper, lower = (contact.force() for contact in scene.contacts)
    record_property("iterations", [step.iterations for step in scene.steps])
    record_property("force", float(lower[1]))
    np.testing.assert_allclose(lower, upper * [1, -1], rtol=1e-6, atol=1e-9)
    assert max(step.iterations for step in scene.steps) <= 6
    volume = COMM.allreduce(fem.assemble_scalar(fem.form((scene.J - 1) * ufl.dx(domain=scene.mesh, metadata={"quadrature_degree": 5}))))  # fmt: skip
    p = scene.w.sub(1)
    of_pressure = COMM.allreduce(fem.assemble_scalar(fem.form(p * ufl.dx)))
    assert volume == pytest.approx(0.0 if bulk is None else of_pressure / bulk, abs=1e-10)


@pytest.mark.slow
def test_seal_is_that_of_reduced_integration():
    """With a pressure bilinear in each cell it has the state of the displacement form, whose volume is held at 2 x 2 points."""
    alone = rubber_seal((2, 8))
    mixed = ring(BULK, pressure=("DG", 1), volume=3)
    for one, other in zip(mixed.contacts, alone.contacts):
        found, expected = (np.concatenate(COMM.allgather(np.hstack((c.x, c.reaction)))) for c in (one, other))  # fmt: skip
        found, expected = (table[np.argsort(table[:, 1])] for table in (found, expected))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


def test_seal_with_three_fields():
    """With the change of volume as a third unknown, in the space of the pressure, the seal has the force of two fields."""
    two, three = (ring(100.0, mu=0.3, jacobian=jacobian) for jacobian in (False, True))
    np.testing.assert_allclose(three.contacts[0].force(), two.contacts[0].force(), rtol=1e-8)
    assert [step.iterations for step in three.steps] == [step.iterations for step in two.steps]


@pytest.mark.parametrize("name", ["CondensedNewton", "FixedPoint"])
@pytest.mark.parametrize("compliance", [0.5, 0.0])
def test_a_block_held_by_contact_alone(compliance, name):
    """Reactions balance the loads of a block that nothing else holds, as friction allows; without it nothing can."""
    scene = block(compliance=compliance, load=(0.02, -0.1), solver=SOLVERS[name], tol=1e-10)
    scene.problem.solve()
    np.testing.assert_allclose(scene.contact.force(), [-0.04, 0.2], rtol=1e-8)
    smooth = block(compliance=compliance, load=(0.02, -0.1), mu=0.0)
    with pytest.raises((ValueError, dc.NotConverged), match="no reactions|translation"):
        smooth.problem.solve()


@pytest.mark.parametrize("name", ["CondensedNewton", "FixedPoint"])
def test_a_plane_driven_by_force(name):
    """A plane with a force on it moves to where one that is moved there has that force."""
    moved, driven = (block(compliance=0.0, solver=SOLVERS[name], tol=1e-11) for _ in range(2))
    moved.contact.surface.displacement = (0.0, 0.05)
    moved.press(0.0, 0.0)
    driven.contact.surface.free = ("n",)
    driven.contact.surface.force = moved.contact.force() * [0, 1]
    driven.press(0.0, 0.0)
    np.testing.assert_allclose(driven.contact.surface.displacement, [0.0, 0.05], rtol=1e-8)
    np.testing.assert_allclose(driven.contact.force(), moved.contact.force(), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("bulk", [pytest.param(100.0, marks=pytest.mark.slow), None])
def test_a_ball_in_a_block_of_tetrahedra(bulk):
    """A ball pressed into rubber, incompressible, too: supports carry its force, touching nodes lie on it, volume stays."""
    size = np.array([1.0, 1.0, 0.5])
    domain = mesh.create_box(COMM, [np.zeros(3), size], (4, 4, 2), mesh.CellType.tetrahedron)
    low, top = (mesh.locate_entities_boundary(domain, 2, lambda x, z=z: np.isclose(x[2], z)) for z in (0, 0.5))  # fmt: skip
    W = taylor_hood(domain)
    w = fem.Function(W)
    u, p = ufl.split(w)
    gradient = ufl.Identity(3) + ufl.grad(u)
    J, dx = ufl.det(gradient), ufl.dx(metadata={"quadrature_degree": 4})
    energy = (ufl.tr(gradient.T * gradient) - 3 - 2 * ufl.ln(J)) / 2 + p * (J - 1)
    energy -= 0 if bulk is None else p**2 / (2 * bulk)
    bc, _ = held(W, low)
    ball = dc.RigidSphere((0.5, 0.5, 0.9), 0.4, axis=(1, 0, 0))
    contact = dc.Contact(W, top, ball, dc.Friction(0.3))
    F = ufl.derivative(energy * dx, w, ufl.TestFunction(W))
    # one solution a step, whose iterations are counted: none is repeated with the geometry of its end
    problem = dc.ContactProblem(F, w, contact, bcs=[bc], geometry_tol=np.inf)
    for depth in (0.03, 0.06, 0.09):
        ball.displacement = (0.0, 0.0, -depth)
        assert problem.solve().iterations <= 6
    body, of = problem.body, problem.body.displacements
    carried = np.zeros(body.size)
    carried[body.fixed] = body.residual(body.taken(w.x.array))[body.fixed]
    carried = COMM.allreduce(of.rows(carried).sum(axis=0))
    np.testing.assert_allclose(carried, -contact.force(), rtol=0, atol=1e-9)
    displacement = w.sub(0).collapse().x.array.reshape(-1, 3)[contact.nodes]
    away = np.linalg.norm(contact.x + displacement - [0.5, 0.5, 0.81], axis=1) - 0.4
    touching = contact.reaction[:, -1] > 0.0
    assert COMM.allreduce(int(touching.sum())) >= 4
    assert np.abs(away[touching]).max(initial=0.0) < 2e-3  # tangent planes of the step before
    volume = COMM.allreduce(fem.assemble_scalar(fem.form((J - 1) * dx)))
    pressure = COMM.allreduce(fem.assemble_scalar(fem.form(p * dx)))
    assert volume == pytest.approx(0.0 if bulk is None else pressure / bulk, abs=1e-9)


@pytest.mark.parametrize("nonlinear", [False, True])
def test_checkpoint(tmp_path, nonlinear):
    """A run continued from a checkpoint goes on as if it had not been interrupted, pressures included."""
    path = COMM.bcast(str(tmp_path / "state.npz"))

    def begun():
        scene = ring(100.0, mu=0.3, steps=0) if nonlinear else block()
        return scene, (lambda *push: scene.press(-push[1])) if nonlinear else scene.press

    (straight, press), (continued, press_on) = begun(), begun()
    for push in PUSHES[:2]:
        press(*push)
    straight.problem.save(path)
    continued.problem.load(path)
    first, second = press(*PUSHES[2]), press_on(*PUSHES[2])
    assert first.iterations == second.iterations
    (w, r), (w_, r_) = (
        (s.w.x.array, s.problem.contacts[0].reaction) for s in (straight, continued)
    )
    np.testing.assert_allclose(w_, w, rtol=0, atol=1e-11 * np.abs(w).max(initial=1.0))
    np.testing.assert_allclose(r_, r, rtol=0, atol=1e-11)


@pytest.mark.skipif(COMM.size == 1, reason="needs a rank without cells")
@pytest.mark.parametrize("name", SOLVERS)
def test_ranks_without_cells(tmp_path, name):
    """A rank may have no cells: forces are those of a mesh that all share, a checkpoint of that is taken up."""
    path = COMM.bcast(str(tmp_path / "state.npz"))
    last = partitioner(lambda cells, size: np.full(cells, size - 1), 4)
    spread, gathered = (block(solver=SOLVERS[name], owners=owners, tol=1e-10) for owners in (None, last))  # fmt: skip
    for push in PUSHES[:2]:
        for scene in (spread, gathered):
            scene.press(*push)
    np.testing.assert_allclose(gathered.contact.force(), spread.contact.force(), rtol=1e-7)
    spread.problem.save(path)
    gathered.problem.load(path)
    for scene in (spread, gathered):
        scene.press(*PUSHES[2])
    np.testing.assert_allclose(gathered.contact.force(), spread.contact.force(), rtol=1e-7)


def test_sub_space_or_whole():
    """A contact may be made on the mixed space or on its displacements; another sub-space is named."""
    scene = block(n=2)
    facets, plane, law = scene.contact.facets, scene.contact.surface, dc.Friction(0.3)
    part = dc.Contact(scene.W.sub(0), facets, plane, law)
    np.testing.assert_array_equal(part.points.dofs, scene.contact.points.dofs)
    with dc.ContactProblem(scene.F, scene.w, part, bcs=scene.problem.body.bcs) as problem:
        before = scene.press(*PUSHES[0])
        assert problem.solve().counts == before.counts
    np.testing.assert_allclose(part.reaction, scene.contact.reaction, rtol=1e-12, atol=1e-15)
    with pytest.raises(ValueError, match="component"):
        dc.Contact(scene.W.sub(1), facets, plane, law)
    alone = scene.W.sub(0).collapse()[0]
    with pytest.raises(ValueError, match="another space"):
        dc.ContactProblem(scene.F, scene.w, dc.Contact(alone, facets, plane, law), bcs=[])


@pytest.mark.parametrize("simplex", [False, True])
def test_which_field_is_the_displacement(simplex):
    """A Cosserat body has rotations beside displacements: nobody guesses; on the sub-space that is named the foot carries E A u / h."""
    kind = mesh.CellType.triangle if simplex else mesh.CellType.quadrilateral
    body = mesh.create_rectangle(COMM, [[0, 0], [1, 1]], [3, 3], kind)
    W = mixed_functionspace(body, [("Lagrange", 1, (2,)), ("Lagrange", 1, (2,))])
    w = fem.Function(W)
    (p, u), (q, v) = ufl.split(w), ufl.split(ufl.TestFunction(W))

    def spun(p, u):  # rotations against those of the material: none in even compression
        return (u[1].dx(0) - u[0].dx(1)) / 2 - p[0] - p[1]

    F = (
        1000 * ufl.inner(ufl.sym(ufl.grad(u)), ufl.grad(v))
        + 10 * ufl.inner(ufl.grad(p), ufl.grad(q))
    ) * ufl.dx
    F += (100 * spun(p, u) * spun(q, v) + ufl.inner(p, q)) * ufl.dx
    foot, head = (
        mesh.locate_entities_boundary(body, 1, lambda x, z=z: np.isclose(x[1], z)) for z in (0, 1)
    )
    D = W.sub(1).collapse()[0]
    down = fem.Function(D)
    down.x.array[1::2] = -0.01
    bc = fem.dirichletbc(down, fem.locate_dofs_topological((W.sub(1), D), 1, head), W.sub(1))
    plane = dc.RigidPlane((0, 0), (0, 1))
    with pytest.raises(ValueError, match=r"several sub-spaces .* \[0, 1\], .*V.sub"):
        dc.Contact(W, foot, plane, dc.Friction(0.3))
    contact = dc.Contact(W.sub(1), foot, plane, dc.Friction(0.3))
    dc.ContactProblem(F, w, [contact], bcs=[bc]).solve()
    assert contact.force() == pytest.approx([0, 10.0], rel=1e-8, abs=1e-8)


def test_mixed_spaces_without_displacements_are_refused():
    """A mixed space needs displacements, every field has to act on them, and what has no meaning is refused."""
    scene = block(n=2)
    scalars = mixed_functionspace(scene.mesh, [("Lagrange", 1)] * 2)
    with pytest.raises(ValueError, match="none of its sub-spaces is continuous Lagrange with 2"):
        dc.Contact(scalars, scene.contact.facets, scene.contact.surface, dc.Friction(0.3))
    (u, p), (v, q) = ufl.split(scene.w), ufl.split(ufl.TestFunction(scene.W))
    apart = (ufl.inner(ufl.grad(u), ufl.grad(v)) + q * p) * ufl.dx
    contact = dc.Contact(scene.W, scene.contact.facets, scene.contact.surface, dc.Friction(0.3))
    problem = dc.ContactProblem(apart, scene.w, contact, bcs=scene.problem.body.bcs)
    with pytest.raises(ValueError, match="act on displacements"):
        problem.solve()
    with pytest.raises(ValueError, match="dc.estimate does not know mixed spaces"):
        other = dc.Contact(scene.W, scene.contact.facets, scene.contact.surface, dc.Friction(0.3))
        dc.estimate(
            scene.problem, dc.ContactProblem(scene.F, scene.w, other, bcs=scene.problem.body.bcs)
        )
