# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Curved, wavy and turning rigid surfaces: exact distances, rigid motions that change nothing, closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from scipy.spatial.transform import Rotation

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from dolfinx_contact.contact.contact_step import frames_of, step_of
from dolfinx_contact.surfaces.surface import CurvedSurface
from dolfinx_contact.surfaces.ufl_distance import by_ufl
from mechanics.material import elasticity

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
E = 1000.0


def block(
    surface,
    mu=0.0,
    p=None,
    edge=1.0,
    cells=None,
    half=False,
    nonlinear=False,
    order=1,
    modulus=1.0,
    **options,
):
    """A block on [-edge/2, edge/2]^(d-1) x [0, edge] whose top is held and moved, and whose foot meets a surface.

    Of it the half y > 0 alone with ``half``, its displacement across y = 0 being zero.
    """
    d = surface.point.size
    corners = [np.append(np.full(d - 1, -edge / 2), 0.0), np.append(np.full(d - 1, edge / 2), edge)]
    if half:
        corners[0][1] = 0.0
    create, kind = (
        (mesh.create_box, mesh.CellType.hexahedron)
        if d == 3
        else (mesh.create_rectangle, mesh.CellType.quadrilateral)
    )
    domain = create(COMM, corners, cells or [2] * d, kind)
    foot, top = (
        mesh.locate_entities_boundary(
            domain, d - 1, lambda x, z=z: np.isclose(x[d - 1] / edge, z / edge)
        )
        for z in (0.0, edge)
    )
    V = functionspace(domain, ("Lagrange", order, (d,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    held = fem.Constant(domain, np.zeros(d))
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, d - 1, top), V)
    bcs, across = [bc], V.sub(1)
    if half:
        middle = mesh.locate_entities_boundary(domain, d - 1, lambda x: np.isclose(x[1], 0.0))
        dofs, zero = fem.locate_dofs_topological(across, d - 1, middle), fem.Constant(domain, 0.0)
        bcs.append(fem.dirichletbc(zero, dofs, across))
    contact = dc.Contact(V, foot, surface, dc.Friction(mu, p))
    F = elasticity(u, v, E * modulus, 0.0)
    if nonlinear:  # stiffer where it is stretched
        F = F + E * ufl.inner(u, u) * ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, tol=1e-10, **options)

    def step(*where):
        held.value = np.array(where, dtype=float)
        return problem.solve()

    return SimpleNamespace(contact=contact, problem=problem, step=step, u=u, V=V, surface=surface)


def by_distance(ball, gradient=True):
    """A ball given by half its distance, with or without the gradient of that."""

    def arms(y):
        return y - ball.point[:, None]

    def slopes(y):
        return arms(y) / (2 * np.linalg.norm(arms(y), axis=0))

    found = dc.RigidSurface(
        lambda y: (np.linalg.norm(arms(y), axis=0) - ball.radius) / 2,
        point=ball.point,
        gradient=slopes if gradient else None,
        axis=ball.axis,
    )
    vars(found).update(radius=ball.radius, inside=False)
    return found


def coordinates(d):
    """Of some mesh that has nothing to do with the body."""
    unit = mesh.create_unit_square if d == 2 else mesh.create_unit_cube
    domain = unit(MPI.COMM_SELF, *[1] * d)
    return domain, ufl.SpatialCoordinate(domain)


def by_expression(ball):
    """A ball given in UFL by half its distance, with a radius that may be changed."""
    domain, x = coordinates(ball.point.size)
    arm, radius = x - ufl.as_vector(ball.point), fem.Constant(domain, ball.radius)
    found = dc.RigidSurface(
        (ufl.sqrt(ufl.dot(arm, arm)) - radius) / 2, point=ball.point, axis=ball.axis
    )
    vars(found).update(radius=ball.radius, inside=False, size=radius)
    return found


def surfaces(d):
    """Of each kind; the body's foot is near the origin."""
    below = np.append(np.zeros(d - 1), -2.0)
    ball = dc.RigidSphere(below, 2.0)
    found = [ball, dc.RigidSphere(-2 * below, 4.0, inside=True), by_expression(ball)]
    if d == 3:
        slanted = (1.0, 0.5, 0.02)
        found += [
            dc.RigidSphere(below, 2.0, axis=slanted),
            dc.RigidCylinder(below, slanted, 2.0),
            dc.RigidCylinder(-2 * below, slanted, 4.0, inside=True),
            dc.RigidPlane((0.1, 0.2, -0.05), (0.05, 0.1, 1.0), slanted),
            by_distance(dc.RigidSphere(below, 2.0, axis=slanted)),
        ]
    return found


def rotation(surface):
    """Its matrix, by SciPy."""
    d = surface.point.size
    turn = surface.rotation.copy() if d == 3 else np.append([0, 0], surface.rotation)
    return Rotation.from_rotvec(turn).as_matrix()[:d, :d]


def distance(surface, x):
    """Signed distances of points, one by one, from where the surface is."""
    R = rotation(surface)
    arms = x - surface.point - surface.displacement
    if isinstance(surface, dc.RigidPlane):
        return arms @ (R @ surface.normal)
    if isinstance(surface, dc.RigidCylinder):
        return _signed(surface, np.linalg.norm(np.cross(R @ surface.axis, arms), axis=1))
    return _signed(surface, np.sqrt((arms**2).sum(axis=1)))


def _signed(surface, from_centre):
    return (surface.radius - from_centre) * (1 if surface.inside else -1)


def given(contact, displacements):
    """Array of owned degrees of freedom with these displacements of the contact nodes."""
    values = np.zeros(contact.points.size)
    values[contact.points.dofs] = displacements
    return values


@pytest.mark.parametrize("d, k", [(2, 0), (2, 1), *((3, k) for k in range(7))])
def test_gaps_are_distances_at_the_start_of_every_step(d, k):
    """However far nodes and surface have moved and turned before; normals are gradients of the distance."""
    rng, surface = np.random.default_rng(k), surfaces(d)[k]
    contact = block(surface).contact
    x = contact.x[:, :d]
    where = np.zeros_like(x)
    for _ in range(4):
        surface.displacement = 0.1 * rng.normal(size=d)
        surface.rotation = rng.normal(size=surface.rotation.size)
        step = step_of(contact, frames=frames_of(contact, given(contact, where)))
        gap = step.at(given(contact, where)).gap
        assert gap == pytest.approx(distance(surface, x + where), abs=1e-13)
        frames = np.broadcast_to(step.frames.frame, (len(x), d, d))
        assert np.allclose(frames @ frames.transpose(0, 2, 1), np.eye(d), atol=1e-14)
        for j, shift in enumerate(1e-6 * np.eye(d)):
            slope = distance(surface, x + where + shift) - distance(surface, x + where - shift)
            assert slope / 2e-6 == pytest.approx(frames[:, -1, j], abs=1e-9)
        where = where + 0.1 * rng.normal(size=x.shape)
        contact.accept(step.ended(step.at(given(contact, where))))


@pytest.mark.parametrize("d, k", [(2, 0), (2, 1), *((3, k) for k in range(7))])
def test_a_rigid_motion_of_all_changes_nothing(d, k):
    """Body and surface move and turn together, by finite angles: gaps stay, nothing slips, frames turn, too."""
    rng, surface = np.random.default_rng(k), surfaces(d)[k]
    contact = block(surface).contact
    x = contact.x[:, :d]
    contact.present = step_of(contact).at(given(contact, 0.0 * x))
    contact.accept(step_of(contact).ended(contact.present))
    gap, frame = contact.gap, contact.frame
    for _ in range(3):
        surface.rotation = rng.normal(size=surface.rotation.size)
        surface.displacement = rng.normal(size=d)
        R = rotation(surface)
        moved = surface.point + surface.displacement + (x - surface.point) @ R.T - x
        step = step_of(contact, frames=frames_of(contact, given(contact, moved)))
        state = step.at(given(contact, moved))
        assert state.gap == pytest.approx(gap, abs=1e-13)
        assert np.abs(state.slip_increment).max(initial=0) < 1e-13
        assert step.frames.frame == pytest.approx(frame @ R.T, abs=1e-13)
        contact.accept(step.ended(state))


@pytest.mark.parametrize("k", range(3))
def test_a_sphere_that_turns_about_its_centre_leaves_last_reactions(k):
    """Neither normals nor what acted before change in space, whichever tangents the turned sphere has."""
    rng, surface = np.random.default_rng(k), surfaces(3)[k]
    contact = block(surface, 0.3).contact
    reaction = rng.normal(size=(len(contact.x), 3))
    contact.present = contact.present._replace(reaction=reaction)
    contact.accept(step_of(contact).ended(contact.present))
    before = np.einsum("ni,nij->nj", reaction, contact.frame)
    for _ in range(3):
        surface.rotation = rng.normal(size=3)
        frames = frames_of(contact, np.zeros(contact.points.size))
        last = step_of(contact, frames=frames).last
        after = np.einsum("ni,nij->nj", last.reaction, frames.frame)
        assert after == pytest.approx(before, abs=1e-13)


@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
def test_half_a_block_carries_half_the_force(solver):
    """A plane of symmetry holds a tangential direction of contact nodes, at every step anew."""
    rows = [
        block(dc.RigidSphere((0, 0, -3.0), 3.0, axis=(1, 0, 0)), (0.3, 0.15), cells=cells, half=half, solver=solver)
        for half, cells in ((False, [4, 4, 2]), (True, [4, 2, 2]))
    ]  # fmt: skip
    for slide in (0.0, 0.02, 0.1, 0.05):
        for scene in rows:
            scene.step(slide, 0, -0.08)
        full, half = (scene.contact.force() for scene in rows)
        assert 2 * half[[0, 2]] == pytest.approx(full[[0, 2]], rel=1e-8, abs=1e-8 * full[2])
        slip = rows[1].contact.slip_increment[rows[1].contact.points.held]
        assert (slip == 0).all()
    held = COMM.allreduce(int(rows[1].contact.points.held[:, 1].sum()))
    assert held == 5


def test_a_function_of_position_is_the_surface_where_it_is_zero():
    """By differences as by its gradient and by UFL, to nine digits; forces on a ball given so are those on a ball."""
    ball, found = dc.RigidSphere((0, 0, -3.0), 3.0, axis=(1, 0, 0)), []
    ways = by_distance(ball), by_distance(ball, gradient=False), by_expression(ball)
    for surface in (ball, *ways):
        scene = block(surface, (0.3, 0.15), cells=[3, 3, 2])
        for slide in (0.0, 0.1):
            scene.step(slide, 0, -0.06)
        found.append(scene.contact.force())
    size = np.linalg.norm(found[0])
    assert np.linalg.norm(found[1] - found[0]) < 1e-8 * size
    assert np.linalg.norm(found[2] - found[0]) < 1e-6 * size
    assert np.linalg.norm(found[3] - found[0]) < 1e-8 * size


@pytest.mark.parametrize("d", [2, 3])
def test_an_expression_is_what_it_says_at_any_position(d):
    """Values and derivatives in UFL are those by hand: fewer positions than before or more, far from any mesh."""
    _, x = coordinates(d)
    values, gradient = by_ufl(ufl.exp(x[0] / 50) * ufl.sin(x[d - 1]) + x[0] ** 3, d)
    random = np.random.default_rng(4)
    for n in (7, 3, 1, 40):
        y = 100 * random.normal(size=(d, n))
        first, last = np.exp(y[0] / 50), y[d - 1]
        by_hand = np.zeros((d, n))
        by_hand[0] = first / 50 * np.sin(last) + 3 * y[0] ** 2
        by_hand[d - 1] += first * np.cos(last)
        assert np.allclose(values(y), first * np.sin(last) + y[0] ** 3, rtol=1e-13)
        assert np.allclose(gradient(y), by_hand, rtol=1e-12, atol=1e-12)


def test_a_constant_of_an_expression_is_taken_as_it_stands():
    """A circle that grows between steps presses as one that comes nearer by as much, at a foot small to its radius."""
    ball = dc.RigidSphere((0, -2.0), 2.0)
    growing, found = by_expression(ball), []
    for surface in (ball, growing):
        scene = block(surface, edge=1e-3)
        scene.step(0, -1e-5)
        if surface is growing:
            surface.size.value += 1e-5
        else:
            surface.displacement = (0, 1e-5)
        scene.step(0, -1e-5)
        found.append(scene.contact.force())
    assert found[0][1] > 0 and np.linalg.norm(found[1] - found[0]) < 1e-5 * found[0][1]


def test_small_rotations_keep_their_digits():
    """A turn of 1e-12 moves points by 1e-12 times their arm to ten digits, about a point far away."""
    plane = dc.RigidPlane((1e3, 0, 0), (0, 0, 1))
    plane.rotation = (0, 0, 1e-12)
    assert plane.motion(np.array([[1e3, 2.0, 5.0]]))[0] == pytest.approx([-2e-12, 0, 0], rel=1e-10, abs=1e-23)  # fmt: skip


@pytest.mark.parametrize("solver", [None, dc.FixedPoint(), dc.SparseNewton()])
@pytest.mark.parametrize("d", [2, 3])
def test_a_large_sphere_is_a_plane(d, solver):
    """With a radius of 1e5 edges forces are those of a plane to 1e-4, with friction, up and down."""
    foot = np.append(np.zeros(d - 1), -1e5)
    axis = None if d == 2 else (1.0, 0, 0)
    mu, p = (0.3, None) if d == 2 else ((0.3, 0.15), (0.05, 0.2))
    flat = dc.RigidPlane(np.zeros(d), np.append(np.zeros(d - 1), 1.0), axis)
    rows = [
        block(surface, mu, p, solver=solver)
        for surface in (flat, dc.RigidSphere(foot, 1e5, axis=axis))
    ]
    for slide, depth in ((0.0, 0.02), (0.003, 0.02), (0.02, 0.02), (0.01, 0.015)):
        for scene in rows:
            scene.step(slide, *np.zeros(d - 2), -depth)
        on_plane, on_sphere = (scene.contact.force() for scene in rows)
        assert on_sphere == pytest.approx(on_plane, abs=1e-4 * on_plane[-1])
    assert np.abs(on_plane[0]) > 0.05 * on_plane[-1]


def pulled_over(steps):
    """A block without friction, pulled from 0.2 to 0.6 over a circle: largest errors of direction and depth of its force."""
    scene = block(dc.RigidSphere((0.0, -1.0), 1.0), edge=0.1)
    for slide in np.linspace(0.2, 0.6, steps + 1):
        scene.step(slide, np.sqrt(1 - slide**2) - 1)
    contact = scene.contact
    touching = contact.reaction[:, 1] > 0
    there = (contact.x[:, :2] + scene.u.x.array[contact.points.dofs])[touching]
    normal = there - scene.surface.point
    off = contact.frame[touching, 1] - normal / np.linalg.norm(normal, axis=1)[:, None]
    errors = (np.linalg.norm(off, axis=1), np.abs(distance(scene.surface, there)))
    assert COMM.allreduce(int(touching.sum())) > 0
    assert contact.force() @ scene.surface.point < 0.0
    return [COMM.allreduce(error.max(initial=0.0), op=scenes.MPI.MAX) for error in errors]


@pytest.mark.parametrize("solver", [None, dc.SparseNewton()])
def test_a_nonlinear_body_on_a_sphere(solver):
    """Its forces are balanced at every step, and a sphere that goes to and fro comes back to the same state."""
    ball = dc.RigidSphere((0, 0, -3.0), 3.0)
    scene, found = block(ball, nonlinear=True, cells=[3, 3, 2], solver=solver), []
    for slide in (0.0, 0.1, 0.2, 0.1, 0.0, 0.0):
        ball.displacement = (slide, 0, 0.05)
        step = scene.problem.solve()
        assert max(step.error, step.slip_error) <= 1e-10
        found.append(scene.contact.force())
    assert found[-1] == pytest.approx(found[0], abs=1e-3 * found[0][2])
    assert found[2][0] < -0.01 * found[2][2]


@pytest.mark.parametrize("steps", [1, 2, 8])
def test_sliding_far_over_a_circle_ends_on_it(steps):
    """Normals and gaps are those of the end, however long the steps are, to the tolerance of the geometry."""
    normal, gap = pulled_over(steps)
    assert normal <= 1e-3
    assert gap <= 1e-5


@pytest.mark.parametrize("kind", ["circle", "sphere", "cylinder"])
def test_a_turning_roll_drags_by_mu_times_the_normal_force(kind):
    """In full sliding friction is mu N against the motion at every node; torque mu R N, and its work, turn for turn."""
    d, mu, turn = (2 if kind == "circle" else 3), 0.3, 0.05
    centre = np.append(np.zeros(d - 1), -2.0)
    roll = dc.RigidCylinder(centre, (0, 1, 0), 2.0) if kind == "cylinder" else dc.RigidSphere(centre, 2.0)  # fmt: skip
    scene = block(roll, mu)
    contact = scene.contact
    scene.step(*np.zeros(d - 1), -0.05)
    for _ in range(3):
        before = contact.dissipation
        roll.rotation = roll.rotation + (turn if d == 2 else np.array([0, -turn, 0]))
        step = scene.step(*np.zeros(d - 1), -0.05)
    assert step.counts.slip > 0 == step.counts.stick
    r = contact.reaction
    arms = contact.x[:, :d] + scene.u.x.array[contact.points.dofs] - roll.point
    forces = np.einsum("ni,nij->nj", r, contact.frame)
    torque = (arms[:, -1] * forces[:, 0] - arms[:, 0] * forces[:, -1]).sum()
    work = (contact.dissipation - before).sum()
    torque, normal, work = COMM.allreduce(np.array([torque, r[:, -1].sum(), work]))
    assert torque == pytest.approx(-mu * 2.0 * normal, rel=3e-3)  # the top of the roll goes to -x
    assert work == pytest.approx(-torque * turn, rel=3e-3)
    friction = np.linalg.norm(r[:, :-1], axis=1)
    assert friction == pytest.approx(mu * r[:, -1], rel=1e-6, abs=1e-9 * normal)


def test_grooves_as_directions_in_space():
    """Directions of friction given in space are projected on the tangent planes, as the axis of a sphere is."""
    along, found = np.array([0.6, 0.8, 0.1]), []
    for axis, axes in ((along, None), ((1, 0, 0), lambda x: np.outer(along, np.ones(x.shape[1])))):
        scene = block(dc.RigidSphere((0, 0, -3.0), 3.0, axis=axis), cells=[3, 3, 2])
        scene.contact.friction = dc.Friction((0.4, 0.1), axes=axes)
        for slide in (0.0, 0.1):
            scene.step(slide, 0, -0.06)
        found.append(scene.contact.force())
    assert found[1] == pytest.approx(found[0], rel=3e-3)
    assert abs(found[0][1]) > 0.02 * found[0][2]  # grooves turn friction aside


def test_a_turned_plane_turns_its_axes():
    """Friction that differs along and across grooves turns with them: forces of a turned scene are the turned forces."""
    found = []
    for angle in (0.0, 0.7):
        plane = dc.RigidPlane((0, 0, 0), (0, 0, 1), (np.cos(angle), -np.sin(angle), 0))
        plane.rotation = (0, 0, angle)  # before the contact is made: nothing slips by it
        scene = block(plane, (0.4, 0.1))
        scene.step(0, 0, -0.02)
        scene.step(0.05, 0.03, -0.02)
        found.append(scene.contact.force())
    assert found[1] == pytest.approx(found[0], rel=1e-8)
    assert abs(found[0][0]) > 1.5 * abs(found[0][1])


def test_force_drives_a_turned_plane():
    """A plane tilted by its rotation presses along its own normal with the force that is given."""
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1))
    plane.rotation = (0.1, 0, 0)
    scene = block(plane)
    plane.free, plane.force = ("n",), 20 * np.array([0, -np.sin(0.1), np.cos(0.1)])
    scene.step(0, 0, 0)
    assert scene.contact.force() == pytest.approx(plane.force, rel=1e-8)


def test_waviness_is_a_gap():
    """The gap to a wavy plane is the height over it where the node has slid to; a fitting block is pressed evenly."""
    wave = lambda y: 1e-3 * np.sin(3 * y[0] + y[1])  # noqa: E731
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1), height=wave)
    scene = block(plane, 0.3)
    contact = scene.contact
    plane.displacement = (0.02, 0, 0)
    for slide in (0.0, 0.1, 0.3):
        scene.step(slide, 0, -0.01)
    end = scene.u.x.array[: contact.points.size]
    step = step_of(contact, frames=frames_of(contact, end))
    there = contact.x + end[contact.points.dofs] - plane.displacement
    assert step.at(end).gap == pytest.approx(there[:, 2] - wave(there.T), abs=1e-14)
    assert "height=..." in repr(plane)


@pytest.mark.parametrize("kind", ["sphere", "turning plane", "wavy plane"])
def test_steps_back_and_files(kind, tmp_path):
    """A step that failed or was taken back leaves nothing, and a checkpoint continues with the same bits on one rank."""

    def make():
        if kind == "sphere":
            return dc.RigidSphere((0, 0, -3.0), 3.0, axis=(1, 0, 0))
        return dc.RigidPlane(
            (0, 0, 0),
            (0, 0, 1),
            (1, 0, 0),
            height=(lambda y: 1e-3 * y[0] ** 2) if kind[0] == "w" else None,
        )

    def stop(*_):
        return 1 / 0

    def go(scene, k):
        if kind[0] == "t":
            scene.surface.rotation = (0, 0.001 * k, 0.02 * k)
        return scene.step(0.02 * k, 0.01 * k, -0.05)

    plain, tried = (block(make(), (0.3, 0.15), (0.05, 0.2)) for _ in range(2))
    for k in range(4):
        go(plain, k)
        if k == 2:
            tried.surface.displacement = (0.01, 0, 0)
            turned = tried.surface.rotation
            tried.surface.rotation = (0, 0, 0.4)
            tried.step(0.1, 0, -0.03)
            tried.problem.rewind()
            assert (tried.surface.rotation == turned).all()
            tried.problem.monitor = stop
            before = tried.contact.reaction, tried.contact.frame, tried.contact.gap
            with pytest.raises(ZeroDivisionError):
                tried.step(0.3, 0.2, -0.1)
            after = tried.contact.reaction, tried.contact.frame, tried.contact.gap
            assert all(map(np.array_equal, before, after))
            tried.problem.monitor = None
            tried.surface.displacement = (0, 0, 0)
        go(tried, k)
        if k == 2:
            file = COMM.bcast(str(tmp_path / "state.npz"))
            tried.problem.save(file)
            tried = block(make(), (0.3, 0.15), (0.05, 0.2))
            tried.problem.load(file)
    for name in ("reaction", "displacement", "gap", "dissipation", "slip_path"):
        found, expected = (getattr(scene.contact, name) for scene in (tried, plain))
        scale = np.abs(expected).max(initial=0)
        assert np.allclose(found, expected, rtol=0, atol=1e-9 * scale + (1e-12 if name == "gap" else 0))  # fmt: skip


def test_a_checkpoint_of_another_surface_is_refused(tmp_path):
    """Another radius, side, kind of surface, or a plane."""
    file, below = COMM.bcast(str(tmp_path / "state.npz")), (0, 0, -3.0)
    scene = block(dc.RigidSphere(below, 3.0))
    scene.step(0, 0, -0.05)
    scene.problem.save(file)
    block(dc.RigidSphere(below, 3.0)).problem.load(file)
    others = (
        dc.RigidSphere(below, 2.9),
        dc.RigidSphere((0, 0, 2.95), 3.0, inside=True),
        dc.RigidCylinder(below, (1, 0, 0), 3.0),
        dc.RigidPlane((0, 0, 0), (0, 0, 1)),
    )
    for other in others:
        with pytest.raises(ValueError, match="another plane"):
            block(other).problem.load(file)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: dc.RigidSphere((0, 0, 0), 0.0), "radius must be a positive number"),
        (lambda: dc.RigidSphere((0, 0, 0), -1.0), "radius must be a positive number"),
        (lambda: dc.RigidSphere((0, 0, 0, 0), 1.0), "centre must be a vector"),
        (lambda: dc.RigidSphere((0, 0), 1.0, inside=1), "inside must be True or False"),
        (lambda: dc.RigidCylinder((0, 0), (1, 0), 1.0), "RigidCylinder needs three dimensions"),
        (lambda: dc.RigidCylinder((0, 0, 0), (0, 0, 0), 1.0), "axis must not be zero"),
        (lambda: setattr(dc.RigidSphere((0, 0), 1.0), "free", ("n",)), "names among"),
        (lambda: setattr(dc.RigidSphere((0, 0), 1.0), "force", (0, 1, 0)), "vector of 2"),
        (lambda: setattr(dc.RigidSphere((0, 0), 1.0), "rotation", (0, 1)), "one angle"),
        (lambda: setattr(dc.RigidPlane((0, 0, 0), (0, 0, 1)), "rotation", 1.0), "vector of 3"),
        (lambda: dc.RigidPlane((0, 0), (0, 1), height=1.0), "height must be a function"),
        (lambda: block(dc.RigidSphere((0, 0, 0), 1.0)), "at the centre"),
        (lambda: dc.RigidSurface(1.0), "distance must be a function"),
        (lambda: dc.RigidSurface(len, gradient=2), "gradient must be a function"),
        (lambda: dc.RigidSurface(coordinates(3)[1]), "scalar expression"),
        (lambda: dc.RigidSurface(coordinates(2)[1][1]), "in 3 dimensions"),
        (lambda: dc.RigidSurface(ufl.as_ufl(1.0)), "scalar expression of the SpatialCoordinate"),
        (lambda: dc.RigidSurface(ufl.CellVolume(coordinates(3)[0])), "scalar expression"),
        (lambda: dc.RigidSurface(coordinates(3)[1][2], gradient=len), "gradient must be None"),
        (lambda: block(dc.RigidSurface(lambda y: y)), "must give shape"),
        (lambda: block(dc.RigidSurface(lambda y: 0 * y[0])), "no gradient"),
        (lambda: block(dc.RigidSphere((0, 0, -1), 1.0, axis=(0, 0, 1))), "along the normal"),
        (lambda: block(dc.RigidSphere((0, 0, -1), 1.0), (0.3, 0.1)), "give RigidSphere the first"),
        (lambda: block(dc.RigidPlane((0, 0, 0), (0, 0, 1), height=lambda y: y)), "one value per"),
    ],
)
def test_what_makes_no_sense_is_refused(make, message):
    """On all ranks, with what is wrong."""
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    "wrong",
    [lambda g: -g, lambda g: 2 * g, lambda g: 0.9 * g, lambda g: g[::-1], lambda g: g / np.linalg.norm(g, axis=0)],
    ids=["sign", "twice", "short", "order", "unit length"],
)  # fmt: skip
@pytest.mark.parametrize("d", [2, 3])
def test_a_gradient_that_is_none_of_the_distance_is_refused(d, wrong):
    """Sign, length and order of components, with the position and both values; in single precision it is good enough."""

    def distance(y):
        return 3 * (y[-1] + 0.1 * y[0] ** 2)

    def gradient(y):
        return np.array([0.6 * y[0], *np.zeros((d - 2, len(y[0]))), np.full(len(y[0]), 3.0)])

    point = np.zeros(d)
    with pytest.raises(ValueError, match=r"gradient of RigidSurface is \[.*\] at \[.*differences of distance are \[.*, (3.0|2.99)"):  # fmt: skip
        block(dc.RigidSurface(distance, point=point, gradient=lambda y: wrong(gradient(y))))
    block(dc.RigidSurface(distance, point=point, gradient=gradient))
    rough = dc.RigidSurface(
        lambda y: distance(y).astype(np.float32), point=point, gradient=gradient
    )
    block(rough)


def test_a_gradient_may_be_that_of_either_side_of_an_edge():
    """On the ridge of a roof differences are the mean of both sides; another one than theirs is refused."""
    for slope, fits in ((0.5, True), (-0.5, True), (0.0, True), (1.0, False)):

        def gradient(y, slope=slope):
            side = np.where(np.abs(y[0]) < 1e-9, slope / 0.5, np.sign(y[0]))
            return np.array([0.5 * side, np.ones_like(side)])

        roof = dc.RigidSurface(lambda y: y[1] + 0.5 * np.abs(y[0]), point=(0, 0), gradient=gradient)
        if fits:
            block(roof)
        else:
            with pytest.raises(ValueError, match=r"gradient of RigidSurface is \[1.0, 1.0\]"):
                block(roof)


def test_dimensions_have_to_agree():
    """A circle under a block in three dimensions."""
    V = block(dc.RigidPlane((0, 0, 0), (0, 0, 1))).V
    facets = mesh.locate_entities_boundary(V.mesh, 2, lambda x: np.isclose(x[2], 0.0))
    with pytest.raises(ValueError, match="has 2 dimensions, the mesh 3"):
        dc.Contact(V, facets, dc.RigidSphere((0, 0), 1.0), dc.Friction(0.0))


class Raised(CurvedSurface):
    """A ball like ``RigidSphere``, with no more than a surface of one's own must have."""

    def __init__(self, centre, radius):
        super().__init__(centre)
        self.radius = radius

    def distance(self, y):
        return np.linalg.norm(y - self.point, axis=1) - self.radius

    def normals(self, y):
        return (y - self.point) / np.linalg.norm(y - self.point, axis=1)[:, None]


@pytest.mark.parametrize("gdim", [2, 3])
def test_surface_of_ones_own_is_as_good_as_that_of_the_package(gdim):
    """A subclass with distance and normals gives the forces of ``RigidSphere``, and the same words on all ranks."""
    centre, forces = np.append(np.zeros(gdim - 1), -2.0), []
    for ball in (dc.RigidSphere(centre, 2.0), Raised(centre, 2.0)):
        ball.displacement = np.append(np.zeros(gdim - 1), 0.05)
        scene = block(ball, 0.3, cells=[4] * gdim)
        scene.problem.solve()
        forces.append(scene.contact.force())
    assert forces[1] == pytest.approx(forces[0], rel=1e-9, abs=1e-9 * abs(forces[0][-1]))
    assert COMM.allgather(repr(ball)) == [repr(ball)] * COMM.size
