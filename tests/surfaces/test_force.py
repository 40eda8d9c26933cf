# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Planes driven by force: closed forms, balances, and the displacement-driven runs whose forces they are given."""

import numpy as np
import pytest
import scenes
from dolfinx import mesh
from way_scenes import slab

import dolfinx_contact as dc
from dolfinx_contact.surfaces.balance import SurfaceBalance
from mechanics.scenes import build, problem_of

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
E, TOL = 210e3, 1e-10
SOLVERS = {"default": None, "fixed point": dc.FixedPoint(), "paper's map": dc.FixedPoint(map="bipotential")}  # fmt: skip
OF_EACH = ["default", "fixed point", pytest.param("paper's map", marks=pytest.mark.slow)]
CELLS = {3: (4, 4, 2), 2: (4, 3)}


def free_block(free, dim=3, **options):
    """A block whose top stands still, on a plane that is free in some directions; pushes it in the scene's axes."""
    scene = scenes.block(cells=CELLS[dim], tol=TOL, **options)
    scene.move_top(*np.zeros(dim))
    scene.surface.free = free

    def push(*force):
        scene.surface.force = scene.axes @ np.array(force, dtype=float)
        return scene.problem.solve()

    scene.push = push
    scene.force = lambda: scene.axes.T @ scene.contact.force()
    scene.moved = lambda: scene.axes.T @ scene.surface.displacement
    return scene


@pytest.mark.parametrize("solver", OF_EACH)
@pytest.mark.parametrize("dim", [2, 3])
def test_a_pressed_block_has_the_pressure_force_over_area(dim, solver):
    """Without Poisson's effect: pressure F / A everywhere, and the plane rises by F h / (E A)."""
    scene = free_block(("n",), dim, mu=0.0, p=None, nu=0.0, solver=SOLVERS[solver])
    for load in (1e-5 * E, 1e-3 * E, 2e-3 * E, 5e-4 * E):
        scene.push(*np.zeros(dim - 1), load)
        assert np.allclose(scene.contact.pressure, load, rtol=1e-8, atol=0)
        assert scene.moved()[-1] == pytest.approx(load * 0.6 / E, rel=1e-8)
        assert scene.force()[-1] == pytest.approx(load, rel=1e-9)


@pytest.mark.parametrize("solver", OF_EACH)
@pytest.mark.parametrize("dim", [2, 3])
def test_a_stroke_under_dead_weight_is_resisted_by_mu_times_it(dim, solver):
    """Normal force prescribed, stroke prescribed: once the block slides, friction is mu N, N stays."""
    scene = free_block(("n",), dim, mu=0.3, p=None, solver=SOLVERS[solver])
    load = 1e-3 * E
    for stroke in (0.0, 0.5, 1.0):
        scene.surface.displacement = np.array([stroke, *scene.surface.displacement[1:]])
        scene.push(*np.zeros(dim - 1), load)
        assert scene.moved()[0] == stroke
        assert scene.force()[-1] == pytest.approx(load, rel=1e-9)
    assert scene.force()[0] == pytest.approx(0.3 * load, rel=1e-9)


@pytest.mark.parametrize("solver", OF_EACH)
@pytest.mark.parametrize("case", ["isotropic", "not associated", "in the plane"])
def test_forces_of_a_displacement_driven_run_lead_back_to_its_displacements(case, solver):
    """A plane that is given the forces which a prescribed programme needed goes through the same programme."""
    dim, mu, p, free = {
        "isotropic": (3, 0.3, None, ("t1", "n")),
        "not associated": (3, (0.3, 0.15), (0.05, 0.20), ("t1", "t2", "n")),
        "in the plane": (2, 0.3, None, ("t", "n")),
    }[case]
    given = free_block((), dim, mu=mu, p=p)
    driven = free_block(free, dim, mu=mu, p=p, solver=SOLVERS[solver])
    programme = [(0, 0, 2), (0.5, 0.2, 2), (1.0, 0.3, 2.2), (0.6, 0.3, 1.8), (-0.4, 0.1, 2.5)]
    for place in programme:
        place = 1e-3 * np.array(place)[[0, 2] if dim == 2 else [0, 1, 2]]
        if case == "isotropic":
            driven.surface.displacement = np.array([*driven.surface.displacement[:1], place[1], 0])
        given.surface.displacement = place
        given.problem.solve()
        step = driven.push(*given.force())
        assert max(step.error, step.slip_error) <= TOL
        free_part = np.array([name in free for name in driven.surface.directions])
        assert driven.moved() == pytest.approx(place, abs=1e-7 * 2e-3)
        assert driven.force()[free_part] == pytest.approx(given.force()[free_part], abs=1e-8 * E * 1e-3)  # fmt: skip


@pytest.mark.parametrize("length, modulus, turned", [(1, 1, True), (1e-6, 1e9, False), (1e8, 1e-12, True)])  # fmt: skip
def test_units_and_axes_do_not_matter(length, modulus, turned):
    """Lengths, moduli and the directions of the scene change the plane's motion as they must, and nothing else."""
    found = []
    for size, stiff, turn in ((1, 1, None), (length, modulus, scenes.rotation(3) if turned else None)):  # fmt: skip
        options = dict(length=size, E=E * stiff, turn=turn)
        scene = free_block(("t1", "n"), **options)
        unit = E * stiff * size**2 * 1e-3
        steps = [scene.push(force * unit, 0, unit).counts for force in (0.0, 0.1, 0.27, -0.1)]
        found.append((scene.moved() / size, scene.force() / unit, steps))
    (moved, force, steps), (moved_too, force_too, steps_too) = found
    assert moved_too == pytest.approx(moved, abs=1e-8 * np.abs(moved).max())
    assert force_too[[0, 2]] == pytest.approx([-0.1, 1.0], rel=1e-9)
    assert steps == steps_too


@pytest.mark.parametrize("dim", [2, 3])
def test_a_shear_force_below_friction_sticks(dim):
    """Where nothing slips the plane moves in proportion to the force, and back to where it was."""
    scene = free_block(("t1", "n") if dim == 3 else ("t", "n"), dim, mu=1e4, p=None)
    load = 1e-3 * E
    rest = np.zeros(dim - 2)
    scene.push(0, *rest, load)
    at = [scene.moved()[0]]
    for part in (0.1, 0.2, -0.2, 0.0):
        assert scene.push(part * load, *rest, load).counts.slip == 0
        at.append(scene.moved()[0])
    at = np.array(at) - at[0]
    assert at[1:] / at[1] == pytest.approx([1, 2, -2, 0], abs=1e-7)
    assert at[1] > 0


@pytest.mark.parametrize("solver", [None, pytest.param(dc.FixedPoint(), marks=pytest.mark.slow)])
@pytest.mark.parametrize("dim", [2, 3])
def test_no_state_beyond_gross_sliding(dim, solver):
    """More than mu N is refused, whether N is given or found; the last state stays, and the run goes on from it."""
    tangent, rest = ("t1" if dim == 3 else "t"), np.zeros(dim - 2)
    for free in ((tangent, "n"), (tangent,)):
        scene = free_block(free, dim, mu=0.3, p=None, solver=solver)
        scene.surface.displacement = np.append(np.zeros(dim - 1), 0.0 if "n" in free else 1e-3)
        load = 1e-3 * E
        scene.push(0.2 * load, *rest, load)
        stood, reaction = scene.surface.displacement, scene.contact.reaction
        for part in (1.2, -1.2) if "n" in free else (3.0,):
            with pytest.raises(dc.NotConverged, match="the plane slides away") as caught:
                scene.push(part * 0.3 * load, *rest, load)
            assert caught.value.step.error > TOL
            assert (scene.surface.displacement == stood).all()
            assert (scene.contact.reaction == reaction).all()
        scene.push(0.24 * load, *rest, load)
        assert scene.force()[0] == pytest.approx(0.24 * load, rel=1e-9)


@pytest.mark.parametrize("given", [True, False])
@pytest.mark.parametrize("degrees", [0, 30, 60, 90])
def test_no_state_beyond_the_ellipse_of_friction(degrees, given):
    """Pushed at an angle to the grooves a plane is held up to |M^-1 F| = N, whatever the slip rule; beyond, the refusal says so at once."""
    scene = free_block(("t1", "t2", "n") if given else ("t1", "t2"), mu=(0.3, 0.15), p=(0.05, 0.2))
    load, way = 1e-3 * E, np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    if given:
        scene.push(0, 0, load)
    else:
        scene.surface.displacement = scene.axes @ (0, 0, 1e-3)
        scene.push(0, 0, 0)
        load = scene.force()[2]
    most = load / np.linalg.norm(way / (0.3, 0.15))
    stood = scene.surface.displacement
    said = (
        "no static state exists" if given else "with the normal forces found: the plane slides away"
    )
    with pytest.raises(dc.NotConverged, match=said) as caught:
        scene.push(*(1.03 * most * way if given else 1.5 * most * way), load)
    begins = "not converged: " + "there is no solution. surface.force pushes " * given
    assert str(caught.value).startswith(begins)  # proved before anything is solved: no errors
    assert (scene.surface.displacement == stood).all()
    scene.push(*0.9 * most * way, load)
    assert scene.force()[:2] == pytest.approx(0.9 * most * way, rel=1e-7, abs=1e-7 * load)


@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
@pytest.mark.parametrize("free", ["tn", "n", "tnr", "xy"])
def test_springs_as_stiff_as_supports_are_right_or_refused(free, solver):
    """Of 1e7 E they give the force of a prescribed motion; beyond what double precision resolves they are refused by name."""
    round_, way = free == "xy", np.array([0.002 * (free != "n"), 0.01])
    forces = []
    for k in (0.0, 1e7, 1e13, 1e19):
        surface = dc.RigidSphere((0, -2.0), 2.0) if round_ else dc.RigidPlane((0, 0), (0, 1))
        scene = slab([-0.5, 0], [0.5, 0.5], [8, 4], surface, 0.3, solver=solver, tol=1e-7)
        if k == 0.0:
            surface.displacement = way
        else:
            surface.free, surface.stiffness, surface.drive = (
                tuple(free),
                dict.fromkeys(free, k * 1000),
                way,
            )
        if k > 1e7:
            with pytest.raises(ValueError, match="surface.stiffness has .* times as stiff.*leave"):
                scene.step(0, 0)
        else:
            scene.step(0, 0)
            forces.append(scene.contact.force())
    assert forces[1] == pytest.approx(forces[0], abs=3e-5 * forces[0][1])


def test_the_refusal_names_the_weak_direction():
    """Across the grooves friction carries mu_y N = 0.15 N; with the plane guided along them, along the other axis mu_x N."""
    for free, force, said in (
        (("t1", "t2", "n"), (0.0, 0.2), r"\[0.0, 1.0, 0.0\] by 42, and friction carries 31.5"),
        (("t1", "n"), (0.4, 0.0), r"\[1.0, 0.0, 0.0\] by 84, and friction carries 63"),
    ):
        scene = free_block(free, mu=(0.3, 0.15), p=None)
        load = 1e-3 * E  # 210
        scene.push(0, 0, load)
        with pytest.raises(dc.NotConverged, match=said):
            scene.push(force[0] * load, force[1] * load, load)


@pytest.mark.parametrize("solver", OF_EACH)
def test_a_spring_in_series(solver):
    """Body and spring share the drive: R = F + k (drive - u) with R = E A u / h; pulled off, the spring alone holds."""
    scene = free_block(("n",), mu=0.0, p=None, nu=0.0, solver=SOLVERS[solver])
    body, drive = E / 0.6, 1e-3
    for k in (1e-6 * body, body, 1e6 * body):
        scene.surface.stiffness = k
        for force in (0.0, 1e-4 * body):
            scene.surface.drive = np.array([0, 0, drive])
            scene.push(0, 0, force)
            assert scene.moved()[2] == pytest.approx((force + k * drive) / (k + body), rel=1e-8)
        scene.surface.drive = np.array([0, 0, -drive])
        scene.push(0, 0, 0.5 * k * drive)
        assert scene.moved()[2] == pytest.approx(-0.5 * drive, rel=1e-8)
        assert (scene.contact.reaction == 0).all()


@pytest.mark.parametrize("solver", OF_EACH)
def test_a_pulled_spring_slides_at_mu_n(solver):
    """A slider pulled by a spring: once it slides friction is mu N, and the spring is stretched by mu N / k."""
    scene = free_block(("t1", "n"), mu=0.3, p=None, solver=SOLVERS[solver])
    load, k = 1e-3 * E, 1e-2 * E
    scene.surface.stiffness = (k, 0.0)
    scene.push(0, 0, load)
    for drive in (0.5, 1.0, 1.5):
        scene.surface.drive = np.array([drive, 0, 0])
        scene.push(0, 0, load)
    assert scene.force()[[0, 2]] == pytest.approx([0.3 * load, load], rel=1e-9)
    assert scene.moved()[0] == pytest.approx(1.5 - 0.3 * load / k, rel=1e-9)


def two_contacts():
    """A block that meets one plane in two places."""
    scene = scenes.block(cells=CELLS[3], mu=0.3, p=None)
    scene.move_top(0, 0, 0)

    def facets(low, high):
        def here(x):
            return np.isclose(x[2], 0) & (x[0] > low - 0.01) & (x[0] < high + 0.01)

        return mesh.locate_entities_boundary(scene.mesh, 2, here)

    laws = (((-0.5, 0.0), dc.Friction(0.3)), ((0.25, 0.5), dc.Friction(0.1)))
    contacts = [dc.Contact(scene.V, facets(*ends), scene.surface, law) for ends, law in laws]
    return scene.surface, dc.ContactProblem(scene.F, scene.u, contacts, bcs=scene.bcs, tol=TOL)


@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
def test_two_contacts_share_a_plane(solver):
    """A plane under two contacts has one motion, that of the run with displacements that needs these forces."""
    (plane, problem), (given, other) = two_contacts(), two_contacts()
    problem.solver, plane.free = solver, ("t1", "n")
    for place in ((0, 0, 1e-3), (3e-4, 0, 1.1e-3), (1e-4, 0, 9e-4)):
        given.displacement = place
        other.solve()
        plane.force = sum(contact.force() for contact in other.contacts)
        problem.solve()
        together = sum(contact.force() for contact in problem.contacts)
        assert together[[0, 2]] == pytest.approx(plane.force[[0, 2]], rel=1e-9)
        assert plane.displacement == pytest.approx(place, abs=1e-10)
    with pytest.raises(dc.NotConverged, match="slides away"):
        plane.force = (0.31 * plane.force[2], 0, plane.force[2])
        problem.solve()


def test_an_unbalanced_plane_is_never_converged(monkeypatch):
    """Its out-of-balance force counts in the error, over the same scale as those of the nodes."""
    scene = free_block(("n",), mu=0.0, p=None, nu=0.0)
    load = 1e-3 * E
    scene.push(0, 0, load)
    problem, x = scene.problem, scene.u.x.array[: scene.problem.body.size].copy()
    scene.surface.force = (0, 0, load * (1 + 1e-6))
    monkeypatch.setattr(SurfaceBalance, "reached", lambda self, c: c)  # it stays where it was
    step = problem.load_step()
    size = np.sqrt(COMM.allreduce((scene.contact.reaction**2).sum()))
    assert step.measure(x).errors.error == pytest.approx(1e-6 * load / size, rel=1e-3)


def test_a_plane_lost_far_away_is_never_converged():
    """Where rounding hides the force on a plane, no reactions balance it: with rounding as scale nothing seems to act."""
    scene = free_block(("n",))
    scene.push(0, 0, 1e-3 * E)
    step = scene.problem.load_step()
    errors = step.open(np.zeros(scene.problem.body.size), np.array([-1e20])).errors
    assert not errors.acts and not errors.within(TOL)


@pytest.mark.parametrize("depth", [0.0, 1e-16])
def test_a_node_that_rounding_lets_touch_does_not_hold_a_plane_back(depth):
    """One node 1e-16 lower than the others says nothing of them: the plane begins where a node would carry the force."""
    scene = free_block(("n",))
    scene.surface.force = scene.axes @ np.array([0.0, 0.0, 1e-3 * E])
    step, points = scene.problem.load_step(), scene.contact.points
    x, forces = np.zeros(scene.problem.body.size), np.zeros((points.count, 3))
    forces[:1, 2] = -depth
    points.add_forces(forces, x)  # the motion of that node
    assert step.surfaces.touched(step.contacts, x, np.zeros(1))[0] > 1e-6


@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
def test_checkpoints_resets_and_failures_keep_the_plane(solver, tmp_path):
    """The plane's place is part of the history: a run continued from a file, or after a failure, goes on alike."""
    path, load = COMM.bcast(tmp_path / "state.npz", root=0), 1e-3 * E
    programme = [(0, 1), (0.1, 1), (0.25, 1.1), (-0.2, 1.1)]
    scene, other = (free_block(("t1", "n"), mu=0.3, p=None, solver=solver) for _ in range(2))
    for k, (side, down) in enumerate(programme):
        scene.push(side * load, 0, down * load)
        if k == 1:
            scene.problem.save(path)
            stood = scene.surface.displacement
            with pytest.raises(ValueError, match="NaN"):
                scene.held.x.array[:] = np.nan
                scene.problem.solve()
            scene.move_top(0, 0, 0)
            assert (scene.surface.displacement == stood).all()
    other.problem.load(path)
    assert (other.surface.displacement == stood).all()
    for side, down in programme[2:]:
        other.push(side * load, 0, down * load)
    assert other.surface.displacement == pytest.approx(scene.surface.displacement, rel=1e-9)


@pytest.mark.filterwarnings("ignore:.* no force moves the plane")
@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
def test_how_a_plane_is_driven_may_change_between_steps(solver):
    """Pressed by displacement, held by the force that took, sheared by force, then by displacement: one history."""
    scene, given = (free_block((), mu=0.3, p=None, solver=s) for s in (solver, None))
    for place in ((0, 0, 1e-3), (2e-4, 0, 1e-3), (3e-4, 0, 1e-3), (1e-4, 0, 1.2e-3)):
        given.surface.displacement = place
        given.problem.solve()
        free = {0: (), 2e-4: ("n",), 3e-4: ("t1", "n"), 1e-4: ()}[place[0]]
        scene.surface.free = free
        start = scene.surface.displacement
        stays = [name in free for name in scene.surface.directions]
        scene.surface.displacement = np.where(stays, start, place)
        scene.push(*given.force())
        assert scene.moved() == pytest.approx(place, abs=1e-10)
        assert scene.force() == pytest.approx(given.force(), abs=1e-8 * E * 1e-3)


def test_ranks_do_not_change_the_motion():
    """All ranks together find what one rank alone finds, with a factorisation and with the condensed system."""
    for solver in (None, dc.FixedPoint()):
        found = []
        for comm in (COMM, scenes.MPI.COMM_SELF):
            scene = free_block(("t1", "n"), mu=0.3, p=None, solver=solver, comm=comm)
            for part in (0.0, 0.25, -0.1):
                scene.push(part * 1e-3 * E, 0, 1e-3 * E)
            found.append(scene.surface.displacement)
        assert found[0] == pytest.approx(found[1], rel=1e-8)


@pytest.mark.slow
def test_a_body_on_soft_springs():
    """A body on soft springs, with its anchors or its motions balanced apart: weight on the plane, and a shear force."""
    for spring in (1e-2, 1e-4):
        for options in ({}, {"solver": dc.FixedPoint()}):
            scene = build(spring=spring, mu=0.5)
            problem = problem_of(scene, tol=1e-8, **options)
            scene.move_top((0, 0, 0))
            scene.surface.free = ("t1", "n")
            for part in (0.0, 0.2):
                scene.surface.force = 1e-3 * spring * E * np.array([part, 0, 1.0])
                problem.solve()
            force = scene.contact.force()
            assert force[[0, 2]] == pytest.approx(scene.surface.force[[0, 2]], rel=1e-7)
            # springs of the top, per area: they carry all of it
            assert scene.surface.displacement[2] == pytest.approx(1e-3, rel=2 * spring + 1e-6)


MISTAKES = {
    "unknown name": (dict(free=("n", "t")), "tuple of names among"),
    "a string": (dict(free="n"), "tuple of names among"),
    "a name of two dimensions": (dict(free=("t",)), "tuple of names among"),
    "force of two numbers": (dict(force=(0, 1)), "vector of 3"),
    "force not finite": (dict(force=(0, 0, np.nan)), "finite"),
    "stiffness below zero": (dict(stiffness=-1.0), "zero or more"),
    "stiffness not finite": (dict(stiffness=np.inf), "NaN or infinity"),
    "two stiffnesses": (dict(free=("n",), force=(0, 0, 1), stiffness=(1, 2)), "2 numbers"),
    "drive of two numbers": (dict(drive=(0, 1)), "vector of 3"),
    "no force": (dict(free=("n",)), "set surface.force"),
    "nothing for one direction": (dict(free=("t1", "n"), stiffness=(0, 1)), "set surface.force"),
    "pulled off": (dict(free=("n",), force=(0, 0, -1)), "does not press"),
    "no weight": (dict(free=("t1", "n"), force=(1, 0, 0)), "does not press"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_nonsense_is_refused(mistake):
    """What makes no sense is a ValueError that says so, on all ranks; the problem can be used on."""
    given, message = MISTAKES[mistake]
    scene = free_block((), mu=0.3, p=None)
    with pytest.raises(ValueError, match=message):
        for name, value in given.items():
            setattr(scene.surface, name, value)
        scene.problem.solve()
    scene.surface.free, scene.surface.stiffness = ("n",), 0.0
    scene.push(0, 0, E * 1e-3)


def test_a_force_that_drives_nothing_is_told_of_once():
    """A plane that was never free has a force: one warning; the plane stands, and one held again is not spoken of."""
    scene = free_block((), mu=0.3, p=None)
    with pytest.warns(UserWarning, match="no force moves the plane") as said:
        for _ in range(2):
            scene.push(0, 0, E * 1e-3)
    assert len(said) == 1 and not scene.force().any()
    scene = free_block(("n",), mu=0.3, p=None)
    for free in (("n",), ()):
        scene.surface.free = free
        scene.push(0, 0, E * 1e-3)


def test_nothing_holds_a_plane_without_friction():
    """A plane that is free along itself needs friction or a spring."""
    scene = free_block(("t1", "n"), mu=0.0, p=None)
    with pytest.raises(ValueError, match="nothing holds the plane"):
        scene.push(0, 0, E * 1e-3)
    scene.surface.stiffness = (E, 0)
    scene.push(E * 1e-3, 0, E * 1e-3)
    assert scene.moved()[0] == pytest.approx(1e-3, rel=1e-9)


def test_planes_that_are_driven_differently_on_ranks_are_refused():
    """Force and free directions must be the same on all ranks."""
    if COMM.size == 1:
        pytest.skip("needs more than one rank")
    scene = free_block(("n",), mu=0.3, p=None)
    with pytest.raises(ValueError, match="differs between ranks"):
        scene.push(0, 0, E * 1e-3 * (1 + COMM.rank))


@pytest.mark.parametrize("free", [("n",), ("t1", "n")])
@pytest.mark.parametrize("solver", [dc.CondensedNewton(), dc.FixedPoint()])
def test_a_plane_beyond_the_body_comes_to_it(solver, free):
    """A dead weight that starts far from the body, or just touches it, presses it all the same."""
    scene = free_block(free, mu=0.3, p=None, nu=0.0, solver=solver)
    for far in (-3.0, -1e-18, 0.0, 0.02):
        scene.problem.reset()
        scene.surface.displacement = (0, 0, far)
        scene.push(0, 0, E * 1e-3)
        assert scene.force()[2] == pytest.approx(E * 1e-3, rel=1e-9)
        assert 0 < scene.moved()[2] < 1e-3


def test_tables_have_the_motion_of_driven_planes(tmp_path):
    """History has a column of the plane's displacement for each direction, if the plane is driven by force."""
    scene = free_block(("n",), mu=0.3, p=None)
    history = dc.History(scene.problem)
    history.record(scene.push(0, 0, E * 1e-3))
    assert history.column("contact0_plane_z")[0] == scene.surface.displacement[2]


@pytest.mark.parametrize("dim", [2, 3])
def test_guides_stand_as_the_plane_was_placed(dim):
    """A plane that may tilt is guided along the axes that it had when its rotation was assigned: what steps find does not turn them,
    another assignment does."""
    normal, axis = np.eye(dim)[-1], None if dim == 2 else np.eye(3)[0]
    plane = dc.RigidPlane(np.zeros(dim), normal, axis)
    plane.free = ("n", "r") if dim == 2 else ("n", "r1", "r2")
    for angle in (0.0, 0.1, 0.3):
        plane.rotation = [angle] if dim == 2 else [angle, 0.0, 0.5 * angle]
        placed = plane.frame
        assert plane.drive_axes == pytest.approx(placed, abs=1e-15)
        plane.set_rotation(plane.rotation + 0.2)
        assert plane.drive_axes == pytest.approx(placed, abs=1e-15)
        assert np.abs(plane.frame - placed).max() > 0.1
