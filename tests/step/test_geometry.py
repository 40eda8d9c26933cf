# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The geometry of a step: the same scene said in two ways, one step or many, and ways that cannot be followed."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from way_scenes import COMM, ring, slab

import dolfinx_contact as dc
from dolfinx_contact.contact.contact_step import nodal_stiffness
from dolfinx_contact.contact.rigid import _round
from dolfinx_contact.lagged.end_geometry import MOST_REPETITIONS

pytestmark = pytest.mark.ranks
TOL = 1e-3  # the default geometry_tol


def total(values) -> float:
    return COMM.allreduce(float(np.sum(values)))


def largest(values) -> float:
    return COMM.allreduce(float(np.max(values, initial=0.0)), op=MPI.MAX)


# -- the way along a surface -------------------------------------------------------------------


@pytest.mark.parametrize("d", [2, 3])
def test_a_way_is_that_of_an_even_turn(d):
    """Where a point goes round an axis evenly, its way is its velocity at the end: by the exponential, to rounding."""
    random = np.random.default_rng(d)
    for _ in range(20):
        psi = random.uniform(-1, 1, 1 if d == 2 else 3)
        Psi = np.array([[0, -1.0], [1, 0]]) * psi if d == 2 else np.cross(np.eye(3), psi)
        R, n1 = expm(Psi), random.normal(size=d)
        n1 /= np.linalg.norm(n1)
        if d == 3:
            # The nearest way from one normal to the other, and a turn about the normal.
            across = psi - (psi @ n1) * n1
            n0, drill = Rotation.from_rotvec(across).as_matrix().T @ n1, -psi @ n1
            psi = across - drill * n1
            Psi = -np.cross(psi, np.eye(3))
            Psi = np.array([np.cross(psi, e) for e in np.eye(3)]).T
            R = expm(Psi)
            turned = drill * n1
        else:
            n0, turned = R.T @ n1, np.zeros(1)
        end, along = random.normal(size=d), random.normal(size=d)
        # y' = Psi y + b with y(1) - y(0) = chord has the velocity Psi (1 - exp(-Psi))^-1 chord at its end
        velocity = Psi @ end + along
        t, w = np.polynomial.legendre.leggauss(12)
        t, w = (t + 1) / 2, w / 2
        chord = sum(weight * expm(-(1 - s) * Psi) @ velocity for s, weight in zip(t, w))
        found = _round(chord[None], n0[None], n1[None], turned)
        assert found[0] == pytest.approx(velocity, rel=1e-12, abs=1e-12)


def test_no_chord_is_no_way():
    """What has not moved relative to the surface has not slipped, whatever both have turned by."""
    n0, n1 = Rotation.random(2, random_state=1).as_matrix()[:, 0]
    assert not _round(np.zeros((1, 3)), n0, n1, np.array([0.1, 0.2, 0.3])).any()


# -- body or surface, one step or many ---------------------------------------------------------


def on_a_circle(ways, tol=TOL, mu=0.0, d=2):
    """A small block pulled along a circle, its head 1 % below where the circle would have it: force and last step."""
    R, side = 1.0, 0.1
    low, high = [-side / 2] * (d - 1) + [0.0], [side / 2] * (d - 1) + [side]
    ball = dc.RigidSphere(np.append(np.zeros(d - 1), -R), R, axis=None)
    scene = slab(low, high, [2] * d, ball, mu, tol=1e-10, geometry_tol=tol)
    for way in ways:
        step = scene.step(way, *np.zeros(d - 2), np.sqrt(R**2 - way**2) - R - 1e-3)
    return scene, step


@pytest.mark.parametrize("d", [2, 3])
def test_one_step_over_a_circle_is_many(d):
    """From 0 to 0.4 radii: forces within the tolerance of the geometry, smaller where that is asked for."""
    for tol, near in ((TOL, 3 * TOL), (1e-5, 3e-5)):
        one, many = (on_a_circle(ways, tol, d=d) for ways in ([0.4], 0.4 * np.linspace(0.1, 1, 8)))
        assert max(one[1].geometry_error, many[1].geometry_error) <= tol
        forces = [scene.contact.force() for scene, _ in (one, many)]
        assert forces[0] == pytest.approx(forces[1], abs=near * np.linalg.norm(forces[1]))
        assert forces[0][0] > 0.3 * forces[0][-1] > 0.0


@pytest.mark.parametrize("tol", [TOL, 1e-5])
def test_geometry_error_is_what_the_exact_geometry_says(tol):
    """Normals and gaps at the end, taken from the circle itself, are off by no more than the tolerance over forces."""
    scene, step = on_a_circle([0.4], tol)
    contact = scene.contact
    rho = nodal_stiffness(contact, scene.problem.body.K).normal
    r, there = contact.reaction, contact.x[:, :2] + scene.u.x.array[contact.points.dofs]
    arms = there - scene.surface.point
    length = np.linalg.norm(arms, axis=1, keepdims=True)
    # the slab is pressed by its supports: they carry what the surface does
    S = np.sqrt(total(r**2))
    angle = np.linalg.norm(contact.frame[:, -1] - arms / length, axis=1)
    off = (r[:, -1] > 0) * rho * (length[:, 0] - 1.0 - contact.gap)
    parts = [np.sqrt(total(part**2)) / S for part in (np.linalg.norm(r, axis=1) * angle, off)]
    assert max(parts) <= 1.1 * tol
    assert step.geometry_error == pytest.approx(max(parts), rel=0.2, abs=1e-12)


@pytest.mark.parametrize(
    "kind, steps", [("ball", 1), ("ball", 7), ("circle", 1), ("bore", 1), ("roll", 1)]
)
def test_body_and_ball_that_go_together_do_not_notice(kind, steps):
    """By a fifth of the radius, with friction: reactions stay, nothing slips."""
    d = 2 if kind in ("circle", "bore") else 3
    up, along = np.eye(d)[-1], np.eye(d)[0]
    if kind == "roll":
        surface = dc.RigidCylinder(-up, (0, 1, 0), 1.0)
    else:
        surface = dc.RigidSphere(up if kind == "bore" else -up, 1.0, inside=kind == "bore")
    scene = slab(
        [-0.05] * (d - 1) + [0], [0.05] * (d - 1) + [0.1], [2] * d, surface, 0.3, geometry_tol=1e-8
    )
    scene.step(*-3e-3 * up)
    before = scene.contact.force()
    assert before[-1] > 0.0
    for k in range(steps):
        way = 0.2 * (k + 1) / steps * along
        surface.displacement = way
        scene.step(*way - 3e-3 * up)
    assert scene.contact.force() == pytest.approx(before, abs=1e-6 * before[-1])
    assert largest(scene.contact.slip_path) < 1e-9


@pytest.mark.parametrize("mu, steps", [(0.0, 1), (0.0, 4), (0.2, 1)])
def test_a_platen_tilts_alike_where_body_or_platen_is_moved(mu, steps):
    """A plate pushed over a platen on a ball joint, or the platen under the plate: tilt, peak and open nodes."""
    found = []
    for moved in ("body", "surface"):
        plane = dc.RigidPlane((0, 0, 0), (0, 0, 1))
        scene = slab([-0.5, -0.5, 0], [0.5, 0.5, 0.02], [8, 8, 1], plane, mu)
        plane.free, plane.force = ("n", "r1", "r2"), (0, 0, 10)
        scene.step(0, 0, 0)
        start = plane.displacement
        for k in range(steps):
            way = 0.3 * (k + 1) / steps * np.array([1.0, 0, 0])
            if moved == "surface":
                plane.displacement = plane.displacement * [0, 0, 1] + start * [1, 1, 0] - way
            step = scene.step(*(way if moved == "body" else np.zeros(3)))
        r = scene.contact.reaction[:, -1]
        found.append((plane.rotation[1], largest(scene.contact.pressure), total(r)))
        assert step.geometry_error <= TOL
        if mu == 0.0:
            assert step.counts.open == 27 and plane.rotation[1] == pytest.approx(1.09e-3, rel=0.01)
    assert found[0] == pytest.approx(found[1], rel=2e-3)


def test_a_rocker_rolls_to_where_its_weight_is():
    """In two dimensions: moved beside the middle by 0.1, a line load of a rocker presses as eccentric as that says."""
    found = []
    for moved in ("body", "surface"):
        plane = dc.RigidPlane((0, 0), (0, 1))
        scene = slab([-0.5, 0], [0.5, 0.02], [8, 1], plane)
        plane.free, plane.force = ("n", "r"), (0, 10)
        scene.step(0, 0)
        if moved == "surface":
            plane.displacement = plane.displacement - np.array([0.1, 0])
        scene.step(0.1 if moved == "body" else 0.0, 0)
        contact = scene.contact
        x = contact.x[:, 0]
        found.append(total(contact.reaction[:, -1] * x) / total(contact.reaction[:, -1]))
        assert contact.moment() == pytest.approx(0.0, abs=1e-3 * 10)
    assert found == pytest.approx([-0.1, -0.1], rel=2e-2)


@pytest.mark.parametrize("mu, moment", [(0.0, [0.15]), (0.3, [0.15]), (0.0, [0.01, 0.005, 0.0])])
def test_a_small_platen_tilts_alike_in_one_step_and_in_many(mu, moment):
    """By 0.05 to 0.07 under a column that without friction it pushes aside by this: pose and balance are those of its end."""
    d, found = len(moment) // 3 + 2, []
    F = 10.0 if d == 2 else 1.0
    for steps in (1, 4):
        plane = dc.RigidPlane(np.zeros(d), np.eye(d)[-1])
        ends = [-0.05] * (d - 1) + [0], [0.05] * (d - 1) + [0.1]
        scene = slab(*ends, [4, 1] if d == 2 else [4, 4, 1], plane, mu)
        plane.free, plane.force = ("n", "r") if d == 2 else ("n", "r1", "r2"), F * np.eye(d)[-1]
        scene.step(*np.zeros(d))
        for k in range(steps):
            plane.moment = (k + 1) / steps * np.array(moment)
            step = scene.step(*np.zeros(d))
        assert step.geometry_error <= TOL
        angle = plane.rotation
        contact = scene.contact
        assert contact.force()[-1] == pytest.approx(F, rel=2 * TOL)
        assert not plane.displacement[:-1].any()
        about = contact.moment()[: 2 if d == 3 else 1]
        assert about == pytest.approx(moment[: len(about)], abs=2 * TOL * F * 0.05)
        assert np.linalg.norm(angle) > 0.04
        found.append(angle)
    assert found[0] == pytest.approx(found[1], rel=5e-3, abs=1e-5)


# -- turns -------------------------------------------------------------------------------------


@pytest.mark.parametrize("angles", [[0.4], [0.1, 0.25, 0.4], [-0.3, -0.4]])
def test_a_shaft_turned_in_a_ring_has_torque_and_work_of_the_arc(angles):
    """``mu N`` times radius and angle: a turn is its arc, in one step or in many."""
    shaft = dc.RigidSphere((0, 0), 1.001)
    scene = ring((1, 1.5, 2), shaft, 0.2, held=2)
    scene.problem.solve()
    for shaft.rotation in angles:
        step = scene.problem.solve()
    contact = scene.contact
    N = total(contact.reaction[:, -1])
    sign, angle = np.sign(angles[0]), abs(angles[-1])
    assert step.counts.stick == 0
    assert contact.moment() / N == pytest.approx(sign * 0.2 * 1.001, abs=TOL)
    assert total(contact.dissipation) / N == pytest.approx(0.2 * angle * 1.001, rel=0.02)
    assert total(contact.slip_path) / sum(step.counts) == pytest.approx(angle, rel=0.02)


@pytest.mark.parametrize("angle", [0.5 * np.pi, np.pi, 1.5 * np.pi, 2 * np.pi])
def test_a_large_turn_in_one_step_is_refused_and_divided_by_advance(angle):
    """Said where; in increments the torque is that of every turn, and the work that of the whole arc."""
    shaft = dc.RigidSphere((0, 0), 1.001)
    scene = ring((1, 1.5, 2), shaft, 0.2, held=2)
    scene.problem.solve()
    before = scene.contact.force()
    shaft.rotation = angle
    with pytest.raises(dc.NotConverged, match="step is too long: after 0"):
        scene.problem.solve()
    assert (shaft.rotation == angle).all() and (scene.contact.force() == before).all()

    def programme(t):
        shaft.rotation = angle * t

    dc.advance(scene.problem, programme, [1.0])
    N = total(scene.contact.reaction[:, -1])
    assert scene.contact.moment() / N == pytest.approx(0.2 * 1.001, abs=TOL)
    assert total(scene.contact.dissipation) / N == pytest.approx(0.2 * angle * 1.001, rel=0.02)


@pytest.mark.parametrize("steps", [2, 6])
@pytest.mark.parametrize("of", ["body", "table"])
def test_a_turntable_drags_along_its_grooves(of, steps):
    """Grooves in circles about its axis: friction is that along them, 0.1, and none across, whatever turn a step has."""

    def rings(x):
        return np.stack((-x[1], x[0], 0 * x[0]))

    table = dc.RigidPlane((0, 0, 0), (0, 0, 1), axis=(1, 0, 0))
    friction = dc.Friction((0.1, 0.4), axes=rings, of="body" if of == "body" else "surface")
    scene = slab([0.95, -0.05, 0], [1.05, 0.05, 0.1], [2, 2, 1], table, friction)
    scene.step(0, 0, -1e-3)
    for k in range(1, steps + 1):
        table.rotation = (0, 0, 0.8 * k / steps)
        scene.problem.solve()
    force = scene.contact.force()
    assert force / force[2] == pytest.approx([0, 0.1, 1], abs=1e-3)


@pytest.mark.parametrize("of_surface", [False, True])
@pytest.mark.parametrize(
    "mu, p", [((0.1, 0.4), None), ((0.4, 0.1), None), ((0.3, 0.15), (0.05, 0.2))]
)
def test_grooves_that_turn_work_as_their_angle_says(mu, p, of_surface):
    """Straight grooves on a turntable, from the first step on: the integral of m over the angle, at the start with the grooves of then."""
    along, turn = np.array([np.cos(0.2), np.sin(0.2), 0.0]), 0.15
    law = (
        dict(axes=lambda x: np.tile(along[:, None], x.shape[1]), of="surface") if of_surface else {}
    )
    table = dc.RigidPlane((0, 0, 0), (0, 0, 1), axis=(1, 0, 0) if of_surface else along)
    friction = dc.Friction(mu, p, **law)
    scene = slab([0.98, -0.02, 0], [1.02, 0.02, 0.04], [1, 1, 1], table, friction)
    scene.step(0, 0, -1e-4)
    work = []
    for angle in turn * np.array([1, 1.25, 1.5, 1.75, 2, 2.25, 2.5]):
        table.rotation = (0, 0, angle)
        scene.problem.solve()
        work.append(total(scene.contact.dissipation))
    M, P2 = np.array(mu), np.array(p or mu) ** 2
    x, w = np.polynomial.legendre.leggauss(20)

    def right(first, last):
        angles = 0.2 + turn * (0.5 * (last + first) + 0.5 * (last - first) * x)
        e = np.column_stack((np.sin(angles), np.cos(angles)))
        m = (e * P2 * e).sum(axis=1) / np.linalg.norm(P2 * e / M, axis=1)
        return 0.5 * (last - first) * turn * w @ m

    N = scene.contact.force()[2]
    assert work[0] / N == pytest.approx(right(0, 1), rel=2e-2)
    assert (work[-1] - work[0]) / N == pytest.approx(right(1, 2.5), rel=2e-3)


# -- ways that cannot be followed --------------------------------------------------------------


def past_the_centre(ways, kind="sphere"):
    centre = (0.5, 0.5, -0.25)
    ball = dc.RigidSphere(centre, 0.05) if kind == "sphere" else dc.RigidCylinder(centre, (1, 0, 0), 0.05)  # fmt: skip
    scene = slab([0, 0, 0], [1, 1, 0.5], [8, 8, 4], ball, 0.1)
    for z in ways:
        ball.displacement = (0, 0, z)
        scene.problem.solve()
    return scene


@pytest.mark.parametrize("kind, axis", [("plane", 2), ("sphere", 2), ("sphere", 1)])
def test_a_frame_that_turns_too_far_is_told_in_words_of_both_ways(kind, axis):
    """Turned about the normal, or along the surface: what has turned is the frame."""
    surface = dc.RigidPlane((0.5, 0.5, 0), (0, 0, 1)) if kind == "plane" else dc.RigidSphere((0.5, 0.5, -10), 10.0)  # fmt: skip
    scene = slab([0, 0, 0], [1, 1, 0.5], [2, 2, 1], surface, 0.1)
    scene.step(0, 0, -1e-3)
    surface.rotation = 0.7 * np.eye(3)[axis]
    with pytest.raises(dc.NotConverged, match="about its normal there, that the local frame has turned by 0.5 radians"):  # fmt: skip
        scene.problem.solve()


@pytest.mark.parametrize("kind", ["sphere", "cylinder"])
def test_a_ball_is_not_led_through_its_centre(kind):
    """In one step it would pull: refused. In halves it presses as in steps chosen by hand."""
    with pytest.raises(dc.NotConverged, match="step is too long: after 0.8"):
        past_the_centre([0.27], kind)
    scene, by_hand = past_the_centre([], kind), past_the_centre([0.2, 0.24, 0.27], kind)

    def programme(t):
        scene.surface.displacement = (0, 0, 0.27 * t)

    dc.advance(scene.problem, programme, [1.0])
    force, right = scene.contact.force(), by_hand.contact.force()
    assert right[2] > 0.0 and force == pytest.approx(right, rel=0.01, abs=0.01 * right[2])


def test_a_ball_is_not_led_through_a_body():
    """From one side of a strip to the other, open before and after."""
    ball = dc.RigidSphere((0.5, -0.3), 0.2)
    scene = slab([0, 0], [1, 0.1], [20, 2], ball)
    scene.step(0, 0)
    ball.displacement = (0, 0.7)
    with pytest.raises(dc.NotConverged, match="step is too long"):
        scene.step(0, 0)
    ball.displacement = (0, -0.02)  # away from it
    assert scene.step(0, 0).counts.open > 0


@pytest.mark.parametrize("moved", ["block", "ball"])
@pytest.mark.parametrize("d", [2, 3])
def test_a_block_is_not_dragged_by_a_radius(d, moved):
    """Block or ball, in the plane or in space: refused, and the state is that before."""
    scene, _ = on_a_circle([0.0], d=d)
    before, way = scene.contact.force(), np.eye(d)[0] - np.eye(d)[-1]
    if moved == "ball":
        scene.surface.displacement, way = -way, np.zeros(d)
    with pytest.raises(dc.NotConverged, match="step is too long"):
        scene.step(*way - 1e-3 * np.eye(d)[-1])
    assert (scene.contact.force() == before).all()


def test_what_stays_different_is_refused():
    """Below rounding no geometry comes: the step names its increment, and rotation and place are those before."""
    plane = dc.RigidPlane((0, 0), (0, 1))
    scene = slab([-0.5, 0], [0.5, 0.1], [8, 2], plane, geometry_tol=1e-18)
    plane.free, plane.force, plane.moment = ("n", "r"), (0, 10), 0.5
    with pytest.raises(
        dc.NotConverged, match=f"after {MOST_REPETITIONS} repetitions.*the increment is too"
    ):
        scene.step(0.01, 0)
    assert not plane.rotation.any() and not plane.displacement.any()
    scene.problem.geometry_tol = TOL
    assert 0.0 < scene.step(0.01, 0).geometry_error <= TOL


@pytest.mark.parametrize("driven", [False, True])
def test_flat_planes_have_no_geometry_error(driven, monkeypatch):
    """Exactly zero, and nothing is looked at."""
    monkeypatch.delattr("dolfinx_contact.lagged.end_geometry.EndGeometry")
    plane = dc.RigidPlane((0, 0), (0, 1))
    scene = slab([-0.5, 0], [0.5, 0.5], [4, 2], plane, 0.3)
    if driven:
        plane.free, plane.force = ("n",), (0, 10.0)
    for way in (0.0, 0.2):
        assert scene.step(way, 0.0 if driven else -0.01).geometry_error == 0.0


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan, "small"])
def test_a_tolerance_that_makes_no_sense_is_refused(wrong):
    scene, _ = on_a_circle([0.0])
    with pytest.raises(ValueError, match="geometry_tol must be a positive number"):
        scene.problem.geometry_tol = wrong


# -- bodies that contact alone holds -----------------------------------------------------------


@pytest.mark.parametrize("undetermined", ["refused", "nearest"])
@pytest.mark.parametrize("mu", [0.1, 0.02])
@pytest.mark.parametrize("inside", [False, True])
def test_a_loose_ring_follows_its_shaft(undetermined, mu, inside):
    """On a shaft or in a bore that turns and is moved: it goes along, and the pressure stays."""
    shaft = dc.RigidSphere((0, 0), 29.9975 if inside else 20.0025, inside=inside)
    scene = ring((20, 23, 26, 30), shaft, mu, touching=30 if inside else 20, undetermined=undetermined)  # fmt: skip
    scene.problem.solve()
    pressure = COMM.allgather(scene.contact.pressure)[COMM.rank]
    for turn, way in ((1e-5, 0.0), (1e-4, 0.0), (1e-4, 1e-3)):
        shaft.rotation, shaft.displacement = turn, (way, 0)
        step = scene.problem.solve()
        assert step.counts.open == 0
    assert scene.contact.pressure == pytest.approx(pressure, rel=1e-3)
    x = scene.contact.x[:, :2]
    moved = scene.u.x.array[scene.contact.points.dofs] - np.array([way, 0])
    radius = np.linalg.norm(x, axis=1)
    turned = (x[:, 0] * moved[:, 1] - x[:, 1] * moved[:, 0]) / radius**2
    assert turned == pytest.approx(turn, rel=1e-3)
