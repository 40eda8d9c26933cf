# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Curved surfaces driven by force, and surfaces that are free to turn: balances, closed forms, units."""

import numpy as np
import pytest
import scenes
from test_surfaces import E, block

import dolfinx_contact as dc
from dolfinx_contact.surfaces.balance import SurfaceBalance
from mechanics.rigs import Load, build_rig

COMM = scenes.COMM
SOLVERS = {"default": None, "fixed point": dc.FixedPoint()}


def below(d, radius):
    return np.append(np.zeros(d - 1), -radius)


CURVED = {
    "circle": lambda: dc.RigidSphere(below(2, 2.0), 2.0),
    "sphere": lambda: dc.RigidSphere(below(3, 2.0), 2.0, axis=(1, 0, 0)),
    "socket": lambda: dc.RigidSphere(-below(3, 8.0), 8.0, axis=(1, 0, 0), inside=True),
    "roller": lambda: dc.RigidCylinder(below(3, 2.0), (0.8, 0.6, 0), 2.0),
}


def names(surface, *letters):
    """Free directions of a curved surface: "n" is its last one, "t" the first."""
    known = surface.directions
    return tuple({"t": known[0], "n": known[-1]}[letter] for letter in letters)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", CURVED)
def test_a_curved_surface_is_in_balance_with_its_force(kind, solver):
    """Weight and shear force, up and down: the force of the contact is the given one along what is free, every step."""
    surface = CURVED[kind]()
    d = surface.point.size
    scene = block(surface, 0.3, solver=SOLVERS[solver], cells=[4] * d)
    surface.free = names(surface, "t", "n")
    for shear, weight in ((0, 10), (1, 12), (2.5, 12), (-2, 8), (0, 20)):
        surface.force = np.array([shear, *np.zeros(d - 2), weight])
        step = scene.step(*np.zeros(d))
        assert max(step.error, step.slip_error) <= 1e-10
        force = scene.contact.force()
        assert force[[0, -1]] == pytest.approx([shear, weight], abs=1e-8 * weight)


@pytest.mark.parametrize("kind", CURVED)
def test_its_place_is_that_of_the_run_with_displacements(kind):
    """Repeated under the same force a surface comes to where prescribing its place gives this force, to all digits."""
    surface, other = CURVED[kind](), CURVED[kind]()
    d = surface.point.size
    scene, given = block(surface, cells=[4] * d), block(other, cells=[4] * d)
    surface.free = names(surface, "n")
    for weight in (10.0, 30.0):
        surface.force = np.append(np.zeros(d - 1), weight)
        for _ in range(8):
            scene.step(*np.zeros(d))
        other.displacement = surface.displacement
        for _ in range(8):
            given.step(*np.zeros(d))
        assert given.contact.force()[-1] == pytest.approx(weight, rel=1e-8)


@pytest.mark.parametrize("far", [-5.0, 1e-3])
def test_a_ball_comes_to_the_body(far):
    """From a distance of some radii it gets where it gets from the face, in one step."""
    found = []
    for start in (0.0, far):
        ball = CURVED["sphere"]()
        scene = block(ball, cells=[5, 5, 2])
        ball.displacement = (0, 0, start)
        ball.free, ball.force = ("z",), (0, 0, 10.0)
        scene.step(0, 0, 0)
        found.append(ball.displacement[2])
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def test_a_ball_pulled_off_is_refused():
    """Nothing would hold it; the last state is in place, and the run goes on."""
    ball = CURVED["sphere"]()
    scene = block(ball, 0.3)
    ball.free, ball.force = ("z",), (0, 0, 10.0)
    scene.step(0, 0, 0)
    stood = ball.displacement
    ball.force = (0, 0, -1.0)
    with pytest.raises(ValueError, match="does not press"):
        scene.step(0, 0, 0)
    assert (ball.displacement == stood).all()
    ball.force = (0, 0, 11.0)
    scene.step(0, 0, 0)
    assert scene.contact.force()[2] == pytest.approx(11.0, rel=1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
def test_guides_turn_the_names(solver):
    """A scene turned with its guides is the turned scene."""
    found = []
    for angle in (0.0, 0.4):
        c, s = np.cos(angle), np.sin(angle)
        guides = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        roller = dc.RigidSphere(below(3, 2.0), 2.0)
        scene = block(roller, 0.3, solver=SOLVERS[solver])
        roller.guides, roller.free = guides, ("x", "z")
        for part in (0.0, 0.2):
            roller.force = 10 * (part * guides[0] + guides[2])
            scene.step(0, 0, 0)
        force = guides @ scene.contact.force()
        assert force[[0, 2]] == pytest.approx([2.0, 10.0], rel=1e-8)
        assert abs(roller.displacement @ guides[1]) < 1e-14
        found.append(roller.displacement[2])
    assert found[0] == pytest.approx(found[1], rel=0.05)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("d", [2, 3])
def test_a_platen_tilts_as_bending_says(d, solver):
    """Without Poisson's effect a moment turns it by M h / (E I), and pressure is F / A + M x / I: in closed form.

    The block is shortened by (F / A + M x / I) h / E below x, its top stands still.
    """
    plane = dc.RigidPlane(np.zeros(d), np.append(np.zeros(d - 1), 1.0))
    scene = block(plane, order=2, cells=[2] * d, solver=SOLVERS[solver])
    contact, weight, size = scene.contact, 1e-3, np.array([1.0, -0.7])[: d - 1]
    plane.free = ("n", "r") if d == 2 else ("n", "r1", "r2")
    for part in (0.0, 0.04, 0.08, -0.06):
        moment = part * weight * size
        plane.force = np.append(np.zeros(d - 1), weight)
        plane.moment = moment if d == 2 else (*moment[::-1], 0.0) * np.array([1, -1, 1])
        scene.step(*np.zeros(d))
        slope = 12 * moment / E  # of the height along each coordinate, I = 1/12
        turned = np.atleast_1d(slope) if d == 2 else np.array([slope[1], -slope[0], 0.0])
        assert plane.rotation == pytest.approx(
            turned if d == 3 else slope, rel=1e-4, abs=1e-9 * weight / E
        )
        assert plane.displacement[-1] == pytest.approx(weight / E, rel=1e-5)
        assert contact.force()[-1] == pytest.approx(weight, rel=1e-9)
    pressing = contact.reaction[:, -1]
    centre = COMM.allreduce(pressing @ contact.x[:, : d - 1])
    assert centre == pytest.approx(moment, abs=1e-5 * weight)


def platen(free, mu=0.0, solver=None, pivot=(0.0, 0, 0), axis=None, p=None, **options):
    """A block on a plane with some free motions, under a weight of 0.01."""
    plane = dc.RigidPlane(pivot, (0, 0, 1), axis)
    scene = block(plane, mu, p, cells=[4, 4, 2], solver=solver, **options)
    plane.free, plane.force = free, (0, 0, 0.01)
    return scene, plane


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_pad_rocks(mu, solver):
    """Its weight to and fro beyond the kern, where one edge lifts off: the resultant is where the weight is, every time."""
    scene, plane = platen(("n", "r1", "r2"), mu, SOLVERS[solver])
    contact, lifted = scene.contact, 0
    for x, y in ((0, 0), (0.1, 0), (0.3, 0.1), (0.42, 0), (-0.42, 0.1), (0, -0.3), (0, 0)):
        plane.moment = (0.01 * y, -0.01 * x, 0)
        step = scene.step(0, 0, 0)
        lifted += step.counts.open > 0
        left = contact.moment() - plane.moment  # about axes that stand still
        assert left[:2] == pytest.approx([0, 0], abs=1e-11)
        pressing = contact.reaction[:, 2]
        centre = COMM.allreduce(
            pressing @ contact.geometry.arms(contact.displacement, contact.history.frames)[:, :2]
        )
        assert centre / 0.01 == pytest.approx([x, y], abs=1e-4)
    assert lifted >= 3
    assert np.abs(plane.rotation[:2]).max() < (1e-8 if mu == 0.0 else 1e-5)


def test_the_weight_acts_at_the_point():
    """A platen on a pivot beside the middle is one with the moment of the weight about the middle."""
    (one, plane), (other, moved) = platen(("n", "r2")), platen(("n", "r2"), pivot=(0.1, 0, 0))
    plane.moment = (0, -1e-3, 0)
    for scene in (one, other):
        scene.step(0, 0, 0)
    assert moved.rotation == pytest.approx(plane.rotation, rel=1e-4, abs=1e-14)
    assert other.contact.reaction[:, 2] == pytest.approx(one.contact.reaction[:, 2], abs=1e-7)


@pytest.mark.parametrize("weight", [1e-6, 1e-3, 1.0])
def test_a_platen_finds_a_foot_that_is_flat_to_rounding(weight):
    """One node of it is drawn a last digit below the plane: the others are touched all the same, and carry the weight."""
    rig = build_rig(weight=weight, free=("n", "r1", "r2"))
    asked = rig.apply(Load())
    step = dc.ContactProblem(rig.F, rig.u, [rig.contact], bcs=rig.bcs).solve()
    assert rig.contact.force()[2] == pytest.approx(asked.force[2], rel=1e-9)
    assert rig.contact.moment()[:2] == pytest.approx([0, 0], abs=1e-9 * asked.force[2])
    assert step.counts.open == 0


@pytest.mark.parametrize("far", [1e8, 1e10, 3e10, 1e12, 1e16])
def test_a_platen_that_is_lost_is_in_no_state(far, monkeypatch):
    """So far away that rounding hides the weight nothing is in balance: the error says so, whatever one node carries."""
    scene, plane = platen(("n", "r1", "r2"))
    scene.step(0, 0, 0)
    step, x = scene.problem.load_step(), scene.u.x.array[: scene.problem.body.size].copy()
    monkeypatch.setattr(SurfaceBalance, "reached", lambda self, c: c)  # it stays there
    state = step.measure(x, c=far * np.array([0.0, 0.0, -1.0]))
    assert not state.errors.error < 1e-3


@pytest.mark.parametrize("solver", [None, pytest.param(dc.FixedPoint(), marks=pytest.mark.slow)])
def test_a_platen_tips_over(solver):
    """A weight beyond the outermost node has no state, and the step says so; the last state stays."""
    scene, plane = platen(("n", "r1", "r2"), solver=solver)
    plane.moment = (0, -4.9e-3, 0)
    scene.step(0, 0, 0)
    stood = plane.rotation
    for arm in (0.501, 0.6, 3.0):
        plane.moment = (0, -0.01 * arm, 0)
        with pytest.raises(dc.NotConverged, match="tips over"):
            scene.step(0, 0, 0)
        assert (plane.rotation == stood).all() and plane.spin is None
    plane.moment = (0, -4.9e-3, 0)
    scene.step(0, 0, 0)
    assert plane.rotation == pytest.approx(stood, rel=1e-3)


@pytest.mark.parametrize("solver", SOLVERS)
def test_friction_holds_a_torque(solver):
    """About its normal a plane turns in proportion to the torque while all stick, and spins away beyond sum mu r |x|."""
    scene, plane = platen(("n", "rn"), 0.5, SOLVERS[solver])
    at = []
    for torque in (0.0, 1e-4, 2e-4, -1e-4):
        plane.moment = (0, 0, torque)
        step = scene.step(0, 0, 0)
        at.append(plane.rotation[2])
        assert scene.contact.moment()[2] == pytest.approx(torque, abs=1e-11)
    assert step.counts.slip == 0
    assert at == pytest.approx(
        np.array([0, 1, 2, -1]) * at[1], abs=1e-5 * at[1]
    )  # arms grow with the load
    most = COMM.allreduce(
        0.5 * scene.contact.reaction[:, 2] @ np.linalg.norm(scene.contact.x[:, :2], axis=1)
    )
    plane.moment = (0, 0, 0.9 * most)
    scene.step(0, 0, 0)
    if solver == "default":
        plane.moment = (0, 0, 1.1 * most)
        with pytest.raises(dc.NotConverged, match="turns away"):
            scene.step(0, 0, 0)


def test_a_torque_is_held_by_friction_of_each_node_along_its_own_way():
    """About the normal sum r_n |M w| holds, w = (-y, x) of each node: beyond it the plane turns away, with that said."""
    scene, plane = platen(("n", "rn"), (0.5, 0.1), axis=(1, 0, 0))
    scene.step(0, 0, 0)
    x, y = scene.contact.x[:, :2].T
    arms = np.hypot(0.5 * y, 0.1 * x)
    most = COMM.allreduce(arms @ scene.contact.reaction[:, 2])
    plane.moment = (0, 0, 0.9 * most)
    scene.step(0, 0, 0)
    plane.moment = (0, 0, 1.2 * most)
    with pytest.raises(dc.NotConverged, match="times what friction carries with the normal forces found: the surface turns away"):  # fmt: skip
        scene.step(0, 0, 0)


def test_nothing_holds_a_turn_without_friction():
    """A plane about its normal, a ball about its centre, a roller about its axis; springs do."""
    for surface, name in (
        (dc.RigidPlane((0, 0, 0), (0, 0, 1)), "rn"),
        (dc.RigidSphere(below(3, 2.0), 2.0), "rx"),
        (dc.RigidCylinder(below(3, 2.0), (0, 1, 0), 2.0), "ry"),
    ):
        scene = block(surface)
        surface.displacement, surface.free = (0, 0, 0.01), (name,)
        with pytest.raises(ValueError, match="nothing holds"):
            scene.step(0, 0, 0)
        surface.stiffness, surface.moment = (
            5.0,
            0.01 * np.eye(3)["xyzn".index(name[1]) % 3 if name != "rn" else 2],
        )
        scene.step(0, 0, 0)
        assert np.linalg.norm(surface.rotation) == pytest.approx(0.002, rel=1e-9)


@pytest.mark.parametrize("d", [2, 3])
def test_a_free_roll_rolls(d):
    """A ball pressed on the body and moved along it, free to turn: no friction in sum, and it rolls by way over radius."""
    ball = dc.RigidSphere(below(d, 2.0), 2.0)
    scene = block(ball, 0.5, cells=[6] * d)
    ball.free = (names(ball, "n")[0], "r" if d == 2 else "ry")
    for way in (0.0, 0.01, 0.02, 0.03):
        ball.force = np.append(np.zeros(d - 1), 5.0)
        ball.displacement = np.array([way, *ball.displacement[1:]])
        scene.step(*np.zeros(d))
        force = scene.contact.force()
        assert abs(scene.contact.moment()[0 if d == 2 else 1]) < 1e-8
        assert abs(force[0]) < 0.02 * force[-1]
    turned = ball.rotation[0] if d == 2 else -ball.rotation[1]
    assert abs(turned) == pytest.approx(0.03 / 2.0, rel=0.05)


@pytest.mark.parametrize("length, modulus", [(1e-6, 1e9), (1e8, 1e-12)])
@pytest.mark.parametrize("kind", ["ball", "platen", "roller"])
def test_units_do_not_matter(kind, length, modulus):
    """Lengths and forces by powers of ten scale motions as they must; statuses and angles stay."""
    found = []
    for size, stiff in ((1.0, 1.0), (length, modulus)):
        point, force = size * below(3, 2.0), stiff * size**2
        if kind == "platen":
            surface = dc.RigidPlane(np.zeros(3), (0, 0, 1), (1, 0, 0))
            surface.free = ("t1", "n", "r1", "r2", "rn")
        else:
            surface = (
                dc.RigidSphere(point, 2 * size, axis=(1, 0, 0))
                if kind == "ball"
                else dc.RigidCylinder(point, (1, 0, 0), 2 * size)
            )
            surface.free = ("x", "z", "rx")
        scene, counts = block(surface, (0.3, 0.2), edge=size, modulus=stiff, cells=[4, 4, 2]), []
        for shear, moment in ((0, 0), (1.0, 0.3), (-1.5, 0.5)):
            surface.force = force * np.array([shear, 0, 10.0])
            surface.moment = force * size * moment * np.array([1.0, 0.4, 0.1])
            step = scene.step(0, 0, 0)
            counts.append(step.counts)
            assert max(step.error, step.slip_error) <= 1e-10
        found.append(
            (surface.displacement / size, surface.rotation, scene.contact.force() / force, counts)
        )
    for one, other in zip(*found):
        if isinstance(one, list):
            assert one == other
        else:
            assert other == pytest.approx(one, abs=1e-8 * np.abs(one).max())


@pytest.mark.parametrize("kind", ["ball", "platen"])
def test_steps_back_failures_and_files(kind, tmp_path):
    """A step that was taken back or failed leaves nothing; a checkpoint goes on alike."""

    def make():
        if kind == "ball":
            ball = dc.RigidSphere(below(3, 2.0), 2.0, axis=(1, 0, 0))
            ball.free, ball.force = ("z", "ry"), (0, 0, 10.0)
            return block(ball, (0.3, 0.15))
        return platen(("t1", "n", "r1", "r2"), (0.3, 0.15), axis=(1, 0, 0))[0]

    def go(scene, k):
        scene.surface.force = np.array([0.03 * k, 0, 1.0]) * scene.surface.force[2]
        scene.surface.moment = 0.02 * k * scene.surface.force[2] * np.array([1.0, 0.5, 0.1])
        scene.step(0, 0, 0)

    def stop(*_):
        return 1 / 0

    plain, tried = make(), make()
    file = COMM.bcast(str(tmp_path / "state.npz"))
    for k in range(4):
        go(plain, k)
        if k == 2:
            stood = tried.surface.displacement, tried.surface.rotation
            go(tried, 3)
            tried.problem.rewind()
            tried.problem.monitor = stop
            with pytest.raises(ZeroDivisionError):
                go(tried, 5)
            tried.problem.monitor = None
            assert (tried.surface.displacement == stood[0]).all()
            assert (tried.surface.rotation == stood[1]).all()
        go(tried, k)
        if k == 2:
            tried.problem.save(file)
            tried = make()
            tried.problem.load(file)
    for name in ("reaction", "displacement", "gap"):
        found, expected = (getattr(scene.contact, name) for scene in (tried, plain))
        lengths = plain.contact.displacement  # of which gaps are differences
        scale = np.abs(expected if name == "reaction" else lengths).max(initial=0)
        assert np.allclose(found, expected, rtol=0, atol=1e-7 * scale)
    assert tried.surface.rotation == pytest.approx(plain.surface.rotation, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_surface_stands_where_the_step_was_judged(solver):
    """Nearly sliding, where motions are large beside what errors allow: gaps and slips are those of its displacement."""
    scene, plane = platen(("t1", "n"), 0.2, SOLVERS[solver], axis=(1, 0, 0))
    for part in (0.0, 1 - 1e-5):
        before = plane.displacement
        u_before = scene.u.x.array[scene.contact.points.dofs]
        plane.force = 0.01 * np.array([0.2 * part, 0, 1.0])
        scene.step(0, 0, 0)
    slip = scene.u.x.array[scene.contact.points.dofs] - u_before - (plane.displacement - before)
    largest = COMM.allreduce(np.abs(slip).max(initial=0.0), op=scenes.MPI.MAX)
    assert np.abs(scene.contact.slip_increment - slip[:, :2]).max(initial=0.0) < 1e-13 * largest


MISTAKES = {
    "moment of two": (
        lambda p: setattr(p, "moment", (1, 2)),
        "surface.moment must be a vector of 3",
    ),
    "guides that are not orthonormal": (
        lambda p: setattr(p, "guides", np.ones((3, 3))),
        "right angles",
    ),
    "one stiffness for two kinds": (lambda p: setattr(p, "stiffness", 1.0), "one for each"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_nonsense_is_refused(mistake):
    """With what is wrong, on all ranks."""
    wrong, message = MISTAKES[mistake]
    ball = dc.RigidSphere(below(3, 2.0), 2.0)
    scene = block(ball, 0.3)
    ball.free, ball.force = ("z", "rx"), (0, 0, 1)
    with pytest.raises(ValueError, match=message):
        wrong(ball)
        scene.step(0, 0, 0)
