# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Supports released or added between steps: ``problem.bcs`` is exchanged, and what the contact remembers stays."""

from types import SimpleNamespace

import mixed_scenes
import numpy as np
import pytest
import scenes
import two_bodies
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
MULTIGRID = dict(petsc_options={"ksp_type": "cg", "ksp_rtol": 1e-13, "pc_type": "gamg"})
KINDS = {
    "condensed": dict(solver=dc.CondensedNewton()),
    "nonlinear": dict(nonlinear=1e4),
    "fixed point": dict(solver=dc.FixedPoint()),
    "sparse": dict(solver=dc.SparseNewton()),
    "SNES": dict(solver=dc.SNES()),
    "multigrid": dict(solver=dc.FixedPoint(), **MULTIGRID),
    "linearised": dict(nonlinear=1e4, solver=dc.FixedPoint()),
    "three dimensions": dict(d=3),
}


def total(values) -> float:
    return COMM.allreduce(float(np.sum(values)), op=MPI.SUM)


def apart(one, other) -> float:
    """Largest difference of two arrays over all ranks, over the largest entry."""
    both = [np.abs(one - other).max(initial=0.0), np.abs(other).max(initial=0.0)]
    most = [COMM.allreduce(float(size), op=MPI.MAX) for size in both]
    return most[0] / (most[1] or 1.0)


def box(d=2, mu=0.3, nonlinear=0.0, solver=None, tol=1e-10, soft=0.0, wear=None, **options):
    """A unit square or cube of modulus 1000 and weight 1 on a plane, on a ``soft`` spring per volume.

    ``on(axis, at, along)`` is a support of a face, along one axis or all, with its values; with ``above`` not down to the plane.
    """
    cells = (mesh.create_unit_square, [4, 4], "quadrilateral") if d == 2 else (mesh.create_unit_cube, [3, 2, 3], "hexahedron")  # fmt: skip
    domain = cells[0](COMM, *cells[1], getattr(mesh.CellType, cells[2]))
    V = functionspace(domain, ("Lagrange", 1, (d,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    force = fem.Constant(domain, np.array([0.0] * (d - 1) + [-1.0]))
    F = (1000.0 * ufl.inner(ufl.sym(ufl.grad(u)), ufl.grad(v)) - ufl.inner(force, v)) * ufl.dx
    if soft:
        F += soft * ufl.inner(u, v) * ufl.dx
    if nonlinear:
        F += nonlinear * ufl.inner(ufl.grad(u), ufl.grad(u)) * ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx  # fmt: skip

    def on(axis, at, along=None, value=0.0, above=-1.0):
        facets = mesh.locate_entities_boundary(
            domain, d - 1, lambda x: np.isclose(x[axis], at) & (x[d - 1] > above)
        )
        if along is None:
            values = fem.Function(V)
            return fem.dirichletbc(values, fem.locate_dofs_topological(V, d - 1, facets)), values
        part, values = V.sub(along), fem.Constant(domain, float(value))
        dofs = fem.locate_dofs_topological(part, d - 1, facets)
        return fem.dirichletbc(values, dofs, part), values

    plane = dc.RigidPlane([0] * d, np.eye(d)[-1], None if d == 2 else (1, 0, 0))
    foot = mesh.locate_entities_boundary(domain, d - 1, lambda x: np.isclose(x[d - 1], 0.0))

    def problem(bcs):
        u.x.array[:] = 0.0
        contact = dc.Contact(V, foot, plane, dc.Friction(mu), wear=wear)
        made = dc.ContactProblem(F, u, [contact], bcs=bcs, solver=solver, tol=tol, **options)
        return made, contact

    return SimpleNamespace(V=V, u=u, on=on, problem=problem, force=force, plane=plane, d=d)


@pytest.mark.parametrize("kind", [*KINDS, "soft"])
def test_without_friction_the_order_of_supports_does_not_matter(kind):
    """Stages with other supports each end where a problem built anew with these is: released, added, and as at first."""
    options = KINDS.get(kind, dict(soft=0.1))
    scene = box(mu=0.0, **options)
    top, _ = scene.on(scene.d - 1, 1.0, scene.d - 1, -0.01)
    near, _ = scene.on(0, 0.0, 0, 0.002)
    far, _ = scene.on(0, 1.0, 0)
    more = [scene.on(1, 0.0, 1)[0]] if scene.d == 3 else []
    clamped, _ = scene.on(scene.d - 1, 1.0)
    stages = [[top, near, *more], [top, near, far, *more], [top, far, *more], [clamped]]
    stages += [[]] * ("soft" in options)
    expected = []
    for bcs in stages:
        problem, contact = scene.problem(bcs)
        problem.solve()
        expected.append((scene.u.x.array.copy(), contact.reaction))
    problem, contact = scene.problem(stages[0])
    for bcs, (u, reaction) in zip([*stages, stages[0]], [*expected, expected[0]]):
        problem.bcs = bcs
        assert problem.bcs == tuple(bcs)
        problem.solve()
        assert apart(scene.u.x.array, u) < 1e-7 and apart(contact.reaction, reaction) < 1e-7


def left(scene, contact):
    """What a step leaves."""
    return [a.copy() for a in (scene.u.x.array, contact.reaction, contact.displacement, contact.dissipation, contact.slip_path, contact.wear_depth)]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_released_support_is_one_that_moves_to_where_it_carries_nothing(kind):
    """The step that releases a side, and the one that moves its support to where the side has gone then, end in the same state."""
    scene = box(wear=dc.Wear(1e-6), **KINDS[kind])
    d = scene.d
    top, press = scene.on(d - 1, 1.0)
    side, push = scene.on(0, 1.0, above=0.1)
    held = scene.on(0, 1.0, above=0.1)
    press.x.array[d - 1 :: d] = -0.02
    push.x.array[d - 1 :: d] = -0.02

    def pushed():
        problem, contact = scene.problem([side, top])
        for way in (0.0, -0.03):
            push.x.array[0::d] = way
            problem.solve()
        return problem, contact

    problem, contact = pushed()
    carried, slipped = contact.force(), total(contact.slip_path)
    problem.bcs = [top]
    problem.solve()
    released = left(scene, contact)
    assert contact.force()[0] * carried[0] < 0.0 < slipped < total(contact.slip_path)
    problem, contact = pushed()
    held[1].x.array[:] = released[0]
    problem.bcs = [held[0], top]
    problem.solve()
    for one, other in zip(left(scene, contact), released):
        assert apart(one, other) < 1e-6


@pytest.mark.parametrize("kind", ["condensed", "sparse", "nonlinear"])
def test_what_held_a_body_is_released_and_taken_again(kind):
    """A body pushed along by its side: -mu N. Let go, contact alone holds it: no force along the plane. Pushed on: -mu N again.

    Slip and work go on from where they were.
    """
    options = KINDS[kind]
    scene = box(**options, soft=1e-6 * ("nonlinear" in options))
    side, push = scene.on(0, 0.0, 0)
    problem, contact = scene.problem([side])
    problem.solve()
    push.value = 0.1
    problem.solve()
    assert contact.force() == pytest.approx([-0.3, 1.0], rel=1e-6)
    worked, path = total(contact.dissipation), contact.slip_path
    problem.bcs = []
    problem.solve()
    assert np.abs(contact.force() - (0.0, 1.0)).max() < 1e-6
    assert worked == pytest.approx(0.03, rel=0.01) and (contact.slip_path >= path).all()
    problem.bcs = [side]
    push.value = 0.15
    problem.solve()
    assert contact.force() == pytest.approx([-0.3, 1.0], rel=1e-6)
    assert total(contact.dissipation) - worked == pytest.approx(0.3 * 0.05, rel=0.01)


@pytest.mark.parametrize("kind", ["condensed", "sparse"])
def test_friction_remembers_what_supports_did(kind):
    """Contact nodes held where they have slid keep their friction, without what pushed them, too, as far as the cone has room for it."""
    scene = box(**KINDS[kind])
    side, push = scene.on(0, 0.0, 0)
    problem, contact = scene.problem([side])
    for way in (0.0, 0.1):
        push.value = way
        problem.solve()
    before, worked = contact.reaction, total(contact.dissipation)
    part, (whole, _) = scene.V.sub(0), scene.V.sub(0).collapse()
    values = fem.Function(whole)
    where = fem.locate_dofs_geometrical((part, whole), lambda x: np.isclose(x[1], 0.0))
    values.x.array[where[1]] = scene.u.x.array[where[0]]
    foot = fem.dirichletbc(values, where, part)
    problem.bcs = [side, foot]
    problem.solve()
    assert apart(contact.reaction, before) < 1e-7
    problem.bcs = [foot]
    for weight in (1.0, 0.5):
        before, scene.force.value[1] = contact.reaction, -weight
        problem.solve()
        kept = np.maximum(before[:, 0], -0.3 * contact.reaction[:, 1])
        assert (
            apart(contact.reaction[:, 0], kept) < 1e-7 and (contact.status == dc.Status.STICK).all()
        )
        assert contact.force()[1] == pytest.approx(weight, rel=1e-6)
    assert total(contact.dissipation) == pytest.approx(worked, rel=1e-9)


def test_nodes_that_a_support_kept_from_touching_touch_when_it_is_gone():
    """Half of the foot stands on a support: contact and support share the weight. Without it contact has all of it, as if anew."""
    scene = box(mu=0.0)
    side, _ = scene.on(0, 0.0, 0)
    half = fem.locate_dofs_geometrical(
        (scene.V.sub(1), scene.V.sub(1).collapse()[0]), lambda x: np.isclose(x[1], 0) & (x[0] > 0.6)
    )[0]
    stand = fem.dirichletbc(fem.Constant(scene.V.mesh, 0.0), half, scene.V.sub(1))
    problem, contact = scene.problem([side])
    problem.solve()
    expected = contact.reaction
    with pytest.warns(UserWarning, match="are left out"):
        problem, contact = scene.problem([side, stand])
    problem.solve()
    assert 0.3 < contact.force()[1] < 0.7
    shared = contact.reaction
    problem.bcs = [side]
    problem.solve()
    assert contact.force()[1] == pytest.approx(1.0, rel=1e-9)
    assert apart(contact.reaction, expected) < 1e-7
    with pytest.warns(UserWarning, match="are left out") as said:
        problem.bcs = [side, stand]
    assert said[0].filename == __file__
    problem.solve()
    assert apart(contact.reaction, shared) < 1e-7


def test_a_release_that_nothing_can_balance_is_refused_and_put_right():
    """A force beyond friction needs its support: without it the step fails, state and sums stay, and with it all is as before."""
    scene = box()
    side, _ = scene.on(0, 0.0, 0)
    scene.force.value[0] = 0.4
    problem, contact = scene.problem([side])
    problem.solve()
    before = left(scene, contact)
    problem.bcs = []
    with pytest.raises(dc.NotConverged, match="loads drive"):
        problem.solve()
    assert all(map(np.array_equal, left(scene, contact), before)) and problem.bcs == ()
    problem.bcs = (side,)
    problem.solve()
    assert apart(contact.reaction, before[1]) < 1e-7


def test_a_nonlinear_body_is_asked_at_every_release_whether_anything_holds_it():
    """Contact alone does not hold it: refused at every attempt, and solved once it is held again."""
    scene = box(nonlinear=1.0)
    clamp, _ = scene.on(1, 1.0)
    problem, contact = scene.problem([clamp])
    problem.solve()
    problem.bcs = []
    for _ in range(2):
        with pytest.raises(ValueError, match="nothing holds"):
            problem.solve()
    problem.bcs = [clamp]
    assert problem.solve().error < 1e-10


def test_wrong_supports_are_refused_in_words():
    """What is no list of conditions on this space, or contradicts the contact, is refused on all ranks; the old supports stay."""
    scene, other = box(), box()
    clamp, press = scene.on(1, 1.0)
    press.x.array[1::2] = -0.01
    problem, contact = scene.problem([clamp])
    problem.solve()
    before = contact.reaction
    foot, _ = scene.on(1, 0.0)
    wrong = [(clamp, "write bcs=\\[bc\\]"), (None, "must be a list"), ([1.0], "dirichletbc"), ([other.on(1, 1.0)[0]], "another space"), ([clamp, foot], "is fixed by boundary")]  # fmt: skip
    for bcs, said in wrong:
        with pytest.raises(ValueError, match=said):
            problem.bcs = bcs
        assert problem.bcs == (clamp,)
    if COMM.size > 1:
        with pytest.raises(ValueError, match="differs between ranks"):
            problem.bcs = [clamp] * (1 + COMM.rank)
    problem.solve()
    assert apart(contact.reaction, before) < 1e-7
    problem.close()
    with pytest.raises(ValueError, match="has been closed"):
        problem.bcs = [clamp]


@pytest.mark.parametrize("kind", ["condensed", "nonlinear"])
def test_stages_are_taken_back_and_saved(kind, tmp_path):
    """``rewind`` takes back the step and not the supports; a checkpoint goes on with those that it was written with, and says so."""
    path = tmp_path / "stage.npz"
    scene = box(**KINDS[kind])
    top, press = scene.on(1, 1.0)
    side, push = scene.on(0, 1.0, above=0.1)
    for values in (press, push):
        values.x.array[1::2] = -0.02
    push.x.array[0::2] = -0.03

    def pushed():
        problem, contact = scene.problem([side, top])
        problem.solve()
        return problem, contact

    problem, contact = pushed()
    first = left(scene, contact)
    problem.bcs = [top]
    problem.solve()
    second = left(scene, contact)
    problem.save(path)
    problem.rewind()
    assert all(map(np.array_equal, left(scene, contact), first)) and problem.bcs == (top,)
    problem.solve()
    assert all(apart(*both) < 1e-7 for both in zip(left(scene, contact), second))
    problem.bcs = [side, top]
    problem.solve()
    third = left(scene, contact)
    problem, contact = pushed()
    with pytest.raises(ValueError, match="other supports, as at the node at"):
        problem.load(path)
    assert all(apart(*both) < 1e-7 for both in zip(left(scene, contact)[:3], first[:3]))
    problem.bcs = [top]
    problem.load(path)
    assert all(map(np.array_equal, left(scene, contact), second))
    problem.bcs = [side, top]
    problem.solve()
    assert all(apart(*both) < 1e-7 for both in zip(left(scene, contact), third))


def test_a_programme_in_increments_may_have_stages():
    """``dc.advance`` goes on after a release; the history of both stages is one."""
    scene = box()
    top, press = scene.on(1, 1.0)
    side, push = scene.on(0, 1.0, above=0.1)

    def programme(t):
        for values in (press, push):
            values.x.array[1::2] = -0.02 * min(t, 1.0)
        push.x.array[0::2] = -0.01 * max(t - 1.0, 0.0)

    problem, contact = scene.problem([side, top])
    dc.advance(problem, programme, [1.0, 2.0])
    slipped = total(contact.slip_path)
    problem.bcs = [top]
    table = dc.advance(problem, programme, [3.0], start=2.0)
    assert table.column("t")[-1] == 3.0 and total(contact.slip_path) >= slipped > 0.0


@pytest.mark.parametrize("sliding", ["small", "large"])
def test_two_deformable_bodies_in_stages(sliding):
    """Blocks that meet on a slope, sides held and released, whose normals there follow the supports: as if built anew."""
    domain, top, bottom, upper, lower, above = two_bodies.pair("quadrilateral", ((3, 2), (4, 2)))
    domain.geometry.x[:, 1] += 0.2 * domain.geometry.x[:, 0]
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, way = fem.Function(V), fem.Constant(domain, np.array((0.0, -0.01)))
    ends = [fem.dirichletbc(way, fem.locate_dofs_topological(V, 1, top), V)]
    ends.append(fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, bottom), V))
    part, whole = V.sub(0), V.sub(0).collapse()[0]
    sides = [
        fem.locate_dofs_geometrical((part, whole), lambda x, at=at: np.isclose(x[0], at))[0]
        for at in (0.0, 1.0)
    ]
    sides = [fem.dirichletbc(fem.Constant(domain, 0.0), dofs, part) for dofs in sides]
    F = two_bodies.work(u, V, *two_bodies.moduli_of(domain, above, (1e3, 1e3))) * ufl.dx

    def problem(bcs):
        u.x.array[:] = 0.0
        contact = dc.Contact(
            V, lower, dc.DeformableSurface(V, upper, sliding=sliding), dc.Friction(0.0)
        )
        return dc.ContactProblem(F, u, contact, bcs=bcs, tol=1e-10, geometry_tol=1e-9), contact

    def found(contact):
        return u.x.array.copy(), contact.reaction, contact.frame, contact.gap

    stages, expected = [[*ends, *sides], [*ends, sides[0]], [*ends, sides[1]], ends], []
    for bcs in stages:
        one, contact = problem(bcs)
        one.solve()
        expected.append(found(contact))
    one, contact = problem(stages[0])
    for bcs, anew in zip([*stages, stages[0]], [*expected, expected[0]]):
        one.bcs = bcs
        one.solve()
        assert all(apart(*both) < 1e-7 for both in zip(found(contact)[:3], anew))
    one.rewind()
    one.solve()
    assert all(apart(*both) < 1e-7 for both in zip(found(contact)[:3], expected[0]))
    assert apart(expected[0][2], expected[3][2]) > 0.1


def test_friction_between_two_bodies_goes_on_after_a_release():
    """A side of the upper block pushed and let go: as where its support moves to where the side has gone then."""
    scene = two_bodies.blocks("quadrilateral", cells=((3, 3), (4, 2)), mu=0.3, moduli=(1e3, 2e3), geometry_tol=1e-9)  # fmt: skip
    held, moved = fem.Function(scene.V), fem.Function(scene.V)
    scene.way.value = (0.0, -0.02)

    def on_side(values):
        dofs = fem.locate_dofs_geometrical(scene.V, lambda x: np.isclose(x[0], 1.0) & (x[1] > 0.1))
        return [*scene.bcs, fem.dirichletbc(values, dofs)]

    def pushed():
        scene.problem.reset()
        scene.problem.bcs = on_side(held)
        for way in (0.0, -0.03):
            held.x.array[0::2], held.x.array[1::2] = way, -0.02
            scene.problem.solve()

    pushed()
    before = total(scene.contact.slip_path)
    scene.problem.bcs = scene.bcs
    scene.problem.solve()
    released = left(scene, scene.contact)
    assert 0.0 < before < total(scene.contact.slip_path)
    pushed()
    moved.x.array[:] = released[0]
    scene.problem.bcs = on_side(moved)
    scene.problem.solve()
    assert all(apart(*both) < 1e-6 for both in zip(left(scene, scene.contact), released))


def test_supports_of_a_mixed_space_in_stages():
    """Displacement and pressure: without friction each stage ends where a problem built anew with its supports does."""
    scenes_of = [mixed_scenes.block(mu=0.0, whole=False, confined=c) for c in (True, False)]
    expected = []
    for scene in scenes_of:
        scene.press(-0.01)
        expected.append(scene.w.x.array.copy())
    scene = scenes_of[0]
    confined = scene.problem.bcs
    for bcs, x in ((confined[:2], expected[1]), (confined, expected[0])):
        scene.problem.bcs = bcs
        scene.problem.solve()
        assert apart(scene.w.x.array, x) < 1e-6
