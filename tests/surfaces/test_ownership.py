# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Whose is what: springs belong to the motion they name, motions and histories to one problem, textures to their owner."""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from scenes import elasticity
from test_force import E, free_block

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace

pytestmark = pytest.mark.ranks
SPRINGS = {
    "by name": (("n", "t1"), {"n": 0.5 * E, "t1": 0.1 * E}),
    "by name in another order": (("t1", "n"), {"n": 0.5 * E, "t1": 0.1 * E}),
    "in the order of free": (("n", "t1"), (0.5 * E, 0.1 * E)),
    "by name, one without": (("n", "t1"), {"n": 0.5 * E}),
}


@pytest.mark.parametrize("given", SPRINGS)
def test_springs_pull_the_motions_that_they_name(given):
    """Body and spring in series share the drive, R = drive / (1 / k + h / (E A)), whatever the order of names."""
    free, stiffness = SPRINGS[given]
    scene = free_block(free, mu=0.3, p=None, nu=0.0)
    scene.surface.stiffness, scene.surface.drive = stiffness, (0, 0, 1e-3)
    assert scene.surface.free == free
    scene.push(0, 0, 0)
    assert scene.force()[2] == pytest.approx(1e-3 / (1 / (0.5 * E) + 0.6 / E), rel=1e-8)


def test_springs_of_turning_surfaces_by_name():
    """A ball joint with a rotational spring: one name is enough, and one number for all is refused."""
    moved = []
    for stiffness in ({"r1": 1e9 * E, "r2": 1e9 * E}, None):
        scene = free_block(("n", "r2", "r1") if stiffness else ("n",), mu=0.0, p=None, nu=0.0)
        scene.surface.stiffness = stiffness or 0.0
        scene.push(0, 0, 1e-3 * E)
        moved.append(scene.moved()[2])
        assert np.abs(scene.surface.rotation).max() < 1e-9
    assert moved[0] == pytest.approx(moved[1], rel=1e-7)


@pytest.mark.parametrize("wrong", [{"t": 1.0}, {"n": -1.0}, {"n": np.nan}, {"n": "stiff"}])
def test_springs_that_name_nothing_are_refused(wrong):
    """A name that is no motion, and a number that is no stiffness."""
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1))
    with pytest.raises(ValueError, match="surface.stiffness"):
        plane.stiffness = wrong


def test_a_driven_surface_belongs_to_one_problem():
    """Two problems that a force drives on one surface would take each other's motion for theirs: the older one is refused."""
    scene = free_block(("n",), mu=0.3, p=None)
    scene.push(0, 0, 1e-3 * E)
    contact = dc.Contact(scene.V, scene.facets, scene.surface, dc.Friction(0.3))
    later = dc.ContactProblem(scene.F, scene.u, [contact], bcs=scene.bcs)
    later.solve()
    for verb in (scene.problem.solve, scene.problem.reset):
        with pytest.raises(ValueError, match="driven by force in another ContactProblem"):
            verb()
    later.solve()
    scene.surface.free = ()  # where it stands is still what the later problem has found
    with pytest.raises(ValueError, match="make a surface"):
        scene.problem.solve()


@pytest.mark.parametrize("closed", [False, True])
def test_a_surface_that_another_problem_has_driven_since_is_refused(closed):
    """Two problems made at once, one run after the other: the later one would begin with the shear that the first one found.

    A problem made when the first one has ended begins where it left the surface, with the forces of a surface of its own.
    """

    first, other = (free_block(("n",), mu=0.3, p=None) for _ in range(2))

    def on_its_surface():
        contact = dc.Contact(other.V, other.facets, first.surface, dc.Friction(0.3))
        return contact, dc.ContactProblem(other.F, other.u, [contact], bcs=other.bcs)

    _, made_before = on_its_surface()
    first.push(0, 0, 1e-3 * E)
    first.surface.free = ("t1", "n")
    first.push(2.5e-4 * E, 0, 1e-3 * E)
    if closed:
        first.problem.close()
    first.surface.free = ("n",)
    with pytest.raises(ValueError, match="driven by force in another ContactProblem"):
        made_before.solve()
    contact, made_after = on_its_surface()
    made_after.solve()
    assert np.allclose(contact.force(), [0, 0, 1e-3 * E], rtol=0, atol=1e-9 * E)


def test_a_surface_driven_by_displacement_may_be_shared():
    """Two problems, stepped in turn over one prescribed surface, have the forces that each has alone."""
    forces = {}
    for together in (False, True):
        first = free_block((), mu=0.3, p=None)
        second = free_block((), mu=0.3, p=None)
        if together:
            contact = dc.Contact(second.V, second.facets, first.surface, dc.Friction(0.3))
            second.problem = dc.ContactProblem(second.F, second.u, [contact], bcs=second.bcs)
            second.contact = contact
        for place in ((0, 0, 1e-3), (3e-4, 0, 1e-3), (1e-4, 0, 1e-3)):
            for scene in (first, second):
                scene.contact.surface.displacement = place
                scene.problem.solve()
        forces[together] = [scene.contact.force() for scene in (first, second)]
    assert np.allclose(forces[True], forces[False], rtol=1e-9, atol=1e-9 * E)


def test_a_second_problem_on_a_contact_is_told_of():
    """A history that ends without a word is a wrong answer: a warning; none of a contact that has made no step."""
    scene = free_block((), mu=0.3, p=None)
    dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=scene.bcs).solve()
    with pytest.warns(UserWarning, match="1 of 1 contacts have a history .* begins anew"):
        dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=scene.bcs)
    dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=scene.bcs)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_law_of_the_last_step_is_in_the_checkpoint(dim, tmp_path):
    """Friction exchanged after a step: the next one does the same work, straight on or from the file."""
    path = MPI.COMM_WORLD.bcast(tmp_path, root=0) / "state.npz"
    laws = [dict(mu=(0.3, 0.1), p=(0.02, 0.2)), dict(mu=(0.1, 0.3), p=(0.2, 0.02))]
    if dim == 2:
        laws = [dict(mu=0.3, p=None), dict(mu=0.1, p=None)]
    works = []
    for loaded in (False, True):
        scene = free_block((), dim, **laws[0], wear=dc.Wear(1e-3))
        rest = np.arange(1.0, dim - 1)
        for k in range(2, 4) if loaded else range(4):
            if k == 2:
                if loaded:
                    scene.problem.load(path)
                scene.problem.save(path)
                before = scene.contact.dissipation.sum(), scene.contact.wear_depth.sum()
                scene.contact.friction = dc.Friction(**laws[1])
            scene.move_top(2e-3 * k, *1e-3 * k * rest, -1e-3)
            scene.problem.solve()
        sums = scene.contact.dissipation.sum(), scene.contact.wear_depth.sum()
        works.append(np.subtract(sums, before))
    assert (works[0] > 0).all() or MPI.COMM_WORLD.size > 1
    assert works[1] == pytest.approx(works[0], rel=1e-6)


@pytest.mark.parametrize("moved_before", [False, True])
def test_reset_returns_surfaces_to_where_the_problem_found_them(moved_before):
    """The same programme after a reset has the same forces, on a surface moved and turned by hand, and by force."""
    scene = free_block((), mu=0.3, p=None)
    if moved_before:
        scene.surface.displacement, scene.surface.rotation = (0, 0, -2e-4), (0, 0, 0.1)
        contact = dc.Contact(scene.V, scene.facets, scene.surface, dc.Friction(0.3))
        scene.contact, scene.problem = (
            contact,
            dc.ContactProblem(scene.F, scene.u, [contact], bcs=scene.bcs),
        )
    start, runs = (scene.surface.displacement, scene.surface.rotation), []
    for _ in range(2):
        forces = []
        for place, turn, free in (
            ((0, 0, 1e-3), 0.0, ()),
            ((4e-4, 0, 1e-3), 0.0, ()),
            ((0, 0, 0), 0.2, ()),
            (None, 0, ("n",)),
        ):
            scene.surface.free = free
            if place is not None:
                scene.surface.displacement = start[0] + np.array(place)
                scene.surface.rotation = start[1] + np.array((0, 0, turn))
            scene.surface.force = (0, 0, 1e-3 * E) if free else None
            scene.problem.solve()
            forces.append(scene.contact.force())
        runs.append(forces)
        scene.problem.reset()
        assert np.array_equal(scene.surface.displacement, start[0])
        assert np.array_equal(scene.surface.rotation, start[1])
    assert np.allclose(runs[1], runs[0], rtol=0, atol=1e-9 * E)


@pytest.mark.parametrize("moved", ["before the contact", "before the problem", "after it"])
@pytest.mark.parametrize("surface", ["plane", "ball"])
def test_slip_counts_from_where_the_problem_found_the_surface(surface, moved, monkeypatch):
    """A surface put aside by far more than sticks: no friction if it was there when the problem was made, mu N if it moved later."""
    made = dc.RigidPlane((0, 0, 0), (0, 0, 1)) if surface == "plane" else dc.RigidSphere((0, 0, -5000), 5000)  # fmt: skip

    def aside():
        made.displacement = (0.02, 0, 0.001)

    if moved == "before the contact":
        aside()
    problem_of = dc.ContactProblem
    if moved == "before the problem":
        monkeypatch.setattr(dc, "ContactProblem", lambda *a, **k: aside() or problem_of(*a, **k))
    contact, problem, _ = slab(made, dc.Friction(0.3))
    if moved == "after it":
        aside()
    problem.solve()
    force = contact.force()
    assert force[2] > 0
    wanted = 0.3 if moved == "after it" else 0.0
    uneven = (
        0.0 if surface == "plane" else 0.02 / 5000 * 0.1 / (4 * 0.001)
    )  # G of half the slope, over E d / h
    assert force[0] / force[2] == pytest.approx(wanted, abs=2 * uneven + 1e-7)


def slab(surface, friction, centre=(0.0, 0.0), width=0.2, height=0.1):
    """A slab of bricks above z = 0 whose head is moved, its contact and problem."""
    low = [centre[0] - width / 2, centre[1] - width / 2, 0.0]
    high = [centre[0] + width / 2, centre[1] + width / 2, height]
    body = mesh.create_box(MPI.COMM_WORLD, [low, high], [2, 2, 1], mesh.CellType.hexahedron)
    V = functionspace(body, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = elasticity(u, v, 1000.0, 0.0)
    foot, head = (
        mesh.locate_entities_boundary(body, 2, lambda x, z=z: np.isclose(x[2], z))
        for z in (0, height)
    )
    held = fem.Constant(body, np.zeros(3))
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, head), V)
    contact = dc.Contact(V, foot, surface, friction)
    return contact, dc.ContactProblem(F, u, [contact], bcs=[bc]), held


def parallel(x):
    return np.stack((1 + 0 * x[0], 0 * x[0], 0 * x[0]))


def rings(x):
    return np.stack((-x[1], x[0], 0 * x[0]))


TURNING = [("body", parallel, 0.4), ("surface", parallel, 0.1), ("body", rings, 0.1), ("surface", rings, 0.1)]  # fmt: skip


@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
@pytest.mark.parametrize("of, grooves, right", TURNING)
def test_grooves_move_with_their_owner_under_a_turntable(of, grooves, right, solver):
    """A table turned by 90 degrees slides along y: parallel grooves of the table lie across, those of the block along x;
    rings about the axis lie along the slip, whoever has them."""
    table = dc.RigidPlane((0, 0, 0), (0, 0, 1), axis=(1, 0, 0))
    friction = dc.Friction((0.1, 0.4), axes=grooves, of=of)
    contact, problem, held = slab(table, friction, (1.0, 0.0), 0.02, 0.01)
    problem.solver, held.value = solver, (0, 0, -1e-4)
    for degrees in (0, 20, 40, 60, 80, 89.4, 89.7, 90):  # at last without a chord for an arc
        table.rotation = (0, 0, np.radians(degrees))
        problem.solve()
    found = contact.force()
    assert abs(found[1]) / found[2] == pytest.approx(right, rel=0.01)


def test_grooves_of_a_surface_are_where_the_surface_has_them():
    """A strip whose grooves turn beyond x = 0.5 slides under a block: friction is that of where the block stands on it."""

    def two_fields(y):
        return np.where(y[0] > 0.5, [[0.0], [1.0], [0.0]], [[1.0], [0.0], [0.0]])

    strip = dc.RigidPlane((0, 0, 0), (0, 0, 1), axis=(1, 0, 0))
    contact, problem, held = slab(strip, dc.Friction((0.1, 0.4), axes=two_fields, of="surface"))
    held.value, found = (0, 0, -1e-3), []
    for way in (0.0, 0.1, 0.2, 0.7, 0.9, 1.0, 0.8, 0.3, 0.1):
        strip.displacement = (-way, 0, 0)
        problem.solve()
        force = contact.force()
        found.append(abs(force[0]) / force[2])
    assert found[2] == pytest.approx(0.1, rel=1e-6)
    assert found[5:7] == pytest.approx([0.4, 0.4], rel=1e-6)
    assert found[8] == pytest.approx(0.1, rel=1e-6)


@pytest.mark.parametrize("axis", [(1, 0, 0), None])
def test_grooves_of_a_body_on_a_ball(axis):
    """Directions in space are the same at all nodes, whatever frames the ball has: across the grooves friction is mu_y N."""
    ball = dc.RigidSphere((0.03, 0.02, -50), 50, axis=axis)
    contact, problem, _ = slab(ball, dc.Friction((0.1, 0.4), axes=parallel), width=1.0, height=0.3)
    for k in range(9):
        ball.displacement = (0, 0.02 * k, 0.02)
        problem.solve()
    force, tilt = contact.force() / contact.force()[2], 0.18 / 50  # of the normal
    assert force == pytest.approx([0, (0.4 - tilt) / (1 + 0.4 * tilt), 1], abs=0.002)


@pytest.mark.parametrize("of", ["body", "surface"])
def test_grooves_along_a_roll_that_turns_and_shifts(of):
    """Slip (R w, d) across and along the grooves: friction is P^2 e / |P e| times N for the associated rule, whoever has them."""
    roll, across, along = dc.RigidCylinder((0, 0, -5000), (0, 1, 0), 5000), 0.005, 0.02

    def grooves(x):
        return np.stack((0 * x[0], 1 + 0 * x[0], 0 * x[0]))

    contact, problem, held = slab(roll, dc.Friction((0.1, 0.4), axes=grooves, of=of))
    held.value = (0, 0, -1e-3)
    for k in range(3):
        roll.displacement, roll.rotation = (0, along * k, 0), (0, across / 5000 * k, 0)
        problem.solve()
    force = contact.force()
    P2e = np.array([0.16 * across, 0.01 * along])
    right = P2e / np.hypot(0.4 * across, 0.1 * along)
    assert force[:2] / force[2] == pytest.approx(right, rel=0.005)


def test_grooves_assigned_before_or_after_the_surface_turned():
    """What a field of axes means does not depend on when it was given."""
    forces = []
    for early in (True, False):
        table = dc.RigidPlane((0, 0, 0), (0, 0, 1), axis=(1, 0, 0))
        grooved, plain = dc.Friction((0.1, 0.4), axes=parallel), dc.Friction(0.2)
        contact, problem, held = slab(table, grooved if early else plain)
        held.value, table.rotation = (0, 0, -1e-3), (0, 0, 0.45)
        if not early:
            contact.friction = grooved
        problem.solve()
        held.value = (0, 0.05, -1e-3)
        problem.solve()
        forces.append(contact.force())
    assert forces[1] == pytest.approx(forces[0], rel=1e-9, abs=1e-9 * forces[0][2])
    assert abs(forces[0][1]) / forces[0][2] == pytest.approx(0.4, rel=1e-5)


@pytest.mark.parametrize("of", ["body", "surface"])
def test_textures_go_on_after_load_rewind_and_failure(of, tmp_path):
    """Grooves under a turning table: the run through a file, and one taken back and failed on the way, do the same work."""
    path = MPI.COMM_WORLD.bcast(tmp_path, root=0) / "state.npz"
    works = []
    for way in ("straight", "loaded", "rewound"):
        table = dc.RigidPlane((0, 0, 0), (0, 0, 1), axis=(1, 0, 0))
        friction = dc.Friction((0.1, 0.4), (0.3, 0.1), axes=rings, of=of)
        contact, problem, held = slab(table, friction, (0.3, 0.2))
        held.value = (0, 0, -1e-3)
        for k in range(3 if way == "loaded" else 0, 6):
            if k == 3 and way == "straight":
                problem.save(path)
            if k == 3 and way == "loaded":
                problem.load(path)
            if k == 3 and way == "rewound":
                table.rotation = (0, 0, 0.7)
                problem.solve()
                problem.rewind()
                held.value = (np.nan, 0, 0)
                with pytest.raises(ValueError, match="NaN"):
                    problem.solve()
                held.value = (0, 0, -1e-3)
            table.rotation = (0, 0, 0.2 * k)
            problem.solve()
        works.append(MPI.COMM_WORLD.allreduce(contact.dissipation.sum()))
    assert works[1:] == pytest.approx([works[0]] * 2, rel=1e-9)


def test_fields_of_friction_are_read_at_every_step():
    """A callable over a number, and a Function, changed between steps: the next step slides with the new coefficient."""
    plane, mu = dc.RigidPlane((0, 0, 0), (0, 0, 1)), [0.2]
    contact, problem, held = slab(plane, dc.Friction(lambda x: mu[0] + 0 * x[0]), width=1.0)
    held.value = (0, 0, -1e-3)
    problem.solve()
    given = fem.Function(functionspace(contact.V.mesh, ("Lagrange", 1)))
    for k, value in enumerate((0.2, 0.3, 0.1, 0.25)):  # the first two by the callable
        mu[0] = given.x.array[:] = value
        if k == 2:
            contact.friction = dc.Friction(given)
        held.value = (0.1 * (k + 1), 0, -1e-3)
        problem.solve()
        force = contact.force()
        assert -force[0] / force[2] == pytest.approx(value, rel=1e-6)


@pytest.mark.parametrize(
    "wrong", [dict(of="table"), dict(of="surface"), dict(of="surface", axes=np.ones((4, 2)))]
)
def test_an_owner_that_makes_no_sense_is_refused(wrong):
    """Only the body or the surface can have a texture, and only a callable knows the surface's positions."""
    with pytest.raises(ValueError, match="of must be"):
        dc.Friction((0.1, 0.4), **wrong)
