# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Wear over many cycles: jumps against cycles simulated one by one and closed forms; killed runs, ranks, and what is refused."""

import json

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import scenes
from dolfinx import mesh

from mechanics.scenes import on_plane, problem_of

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
MU, WEIGHT, ACCURACY = 0.3, 1.0, 0.02


def pad(coefficient, stroke, comm=COMM):
    """A pad under dead weight on a plane that goes to and fro by ``stroke``: the scene and its cycle."""
    wear = dc.Wear(coefficient)
    scene = scenes.block(comm=comm, cells=(6, 3), mu=MU, p=None, E=1000.0, tol=1e-8, wear=wear)
    plane = scene.surface
    plane.free, plane.force = ("n",), (0, WEIGHT)
    scene.problem.solve()
    return scene, fretting(scene, stroke)


def fretting(scene, stroke):
    """A cycle: right, middle, left, middle."""
    plane = scene.surface

    def cycle(done):
        for way in (stroke, 0.0, -stroke, 0.0):
            plane.displacement = (way, plane.displacement[1])
            scene.problem.solve()

    return cycle


def roller(coefficient, stroke, comm=COMM, touching=8.0, cells=(24, 6), grade=3.0, nu=0.3):
    """A cylinder of radius 100 under a weight on a plane that goes to and fro by less than slides it as a whole: the problem and its cycle.

    It may touch as far as ``touching`` from the middle.
    """
    domain = mesh.create_rectangle(comm, [[-1, 0], [1, 1]], cells, mesh.CellType.quadrilateral)
    x = domain.geometry.x
    x[:, :2] = 8 * np.sinh(grade * x[:, :2]) / np.sinh(grade)
    x[:, 1] += x[:, 0] ** 2 / 200 * (1 - x[:, 1] / 8)
    marks = (
        lambda x: (x[1] <= x[0] ** 2 / 200 + 1e-9) & (np.abs(x[0]) < touching + 1e-9),
        lambda x: x[1] > 8 - 1e-9,
    )
    foot, head = (mesh.locate_entities_boundary(domain, 1, mark) for mark in marks)
    scene = on_plane(domain, foot, head, 210e3, nu, MU, loads=False, wear=dc.Wear(0.0))
    scene.problem = problem_of(scene)
    scene.surface.free, scene.surface.force = ("n",), (0, 2000.0)
    scene.problem.solve()
    cycle = fretting(scene, stroke)
    for _ in range(2):  # stick and slip settle
        cycle(0)
    scene.contact.wear = dc.Wear(coefficient)
    return scene, cycle


def total(scene, array):
    return scene.contact.comm.allreduce(float(scene.contact.area @ array))


@pytest.mark.slow
@pytest.mark.parametrize("make, coefficient, stroke", [(pad, 1e-4, 0.2), (roller, 2e-4, 2e-3)])
def test_estimates_are_the_errors_of_jumps(make, coefficient, stroke):
    """In gross and in partial slip, jumps wear what cycles one by one do: to the accuracy, and with the error that is estimated, within three.

    Errors of a hundredth of the accuracy are not resolved: in gross slip the volume follows from the weight.
    """
    truth, cycle = make(coefficient, stroke)
    for done in range(40):
        cycle(done)
    scene, cycle = make(coefficient, stroke)
    found = dc.cycle_jump(scene.problem, cycle, 40, ACCURACY)
    assert found.cycles == 40 and found.reached and found.simulated < 40
    assert found.volume == pytest.approx(total(scene, scene.contact.wear_depth), rel=1e-12)
    # the two meshes may be divided among ranks in different ways
    expected, depth, area = (
        scenes.by_position(*of)
        for of in ((truth, "wear_depth"), (scene, "wear_depth"), (truth, "area"))
    )
    off, volume = depth - expected, area @ expected
    errors = {
        "volume_error": abs(area @ off) / volume,
        "depth_error": np.abs(off).max() / expected.max(),
        "profile_error": area @ np.abs(off) / volume,
    }
    for name, error in errors.items():
        estimated, resolved = getattr(found, name), ACCURACY / 100
        assert error <= ACCURACY / 2
        assert error <= max(3 * estimated, resolved) and estimated <= max(3 * error, resolved), name


def test_a_million_cycles_of_gross_slip():
    """Under dead weight the worn volume is k mu N times the way; few cycles are simulated for it."""
    coefficient, stroke, cycles = 1e-10, 2.0, 10**6
    scene, cycle = pad(coefficient, stroke)
    found = dc.cycle_jump(scene.problem, cycle, cycles, ACCURACY)
    assert found.volume == pytest.approx(coefficient * MU * WEIGHT * 4 * stroke * cycles, rel=ACCURACY)  # fmt: skip
    assert found.simulated <= 50 and found.rejected == 0
    assert found.table[-1]["cycle"] == cycles == sum(row["jump"] for row in found.table)


@pytest.mark.slow
@pytest.mark.parametrize("power", [-12, -6, 0, 3, 6])
def test_jumps_with_any_coefficient(power):
    """Under dead weight the volume is k mu N times the way; of a block at a given approach no more wears off than was pressed in."""
    natural, stroke, cycles, approach = 1e-3, 0.2, 30, 0.01
    coefficient = natural * 10.0**power
    scene, cycle = pad(coefficient, stroke)
    found = dc.cycle_jump(scene.problem, cycle, cycles, ACCURACY)
    assert found.reached and found.simulated < cycles
    assert found.volume == pytest.approx(coefficient * MU * WEIGHT * 4 * stroke * cycles, rel=ACCURACY)  # fmt: skip
    wear = dc.Wear(coefficient)
    scene = scenes.block(cells=(6, 3), mu=MU, p=None, E=1000.0, tol=1e-8, wear=wear)
    scene.move_top(0, -approach)
    scene.problem.solve()
    found = dc.cycle_jump(scene.problem, fretting(scene, stroke), cycles, ACCURACY)
    assert 0.0 < found.volume < 1.001 * approach  # of a foot of length one
    if power >= 0:
        assert found.volume == pytest.approx(approach, rel=ACCURACY)


@pytest.mark.slow
@pytest.mark.parametrize("power", [-12, -6, 0, 2, 4, 6])
def test_partial_slip_with_any_coefficient(power):
    """Jumps wear what cycles one by one do, from next to nothing to all that slips in the first stroke, and say how far they are off at most."""
    if power == 2 and COMM.size > 1:
        pytest.skip("several scars solve it, and rounding, which ranks do not repeat, chooses one")
    coefficient, cycles = 2e-4 * 10.0**power, 16
    truth, cycle = roller(coefficient, 2e-3)
    for done in range(cycles):
        cycle(done)
    scene, cycle = roller(coefficient, 2e-3)
    found = dc.cycle_jump(scene.problem, cycle, cycles, ACCURACY)
    depth, true = (
        scenes.by_position(of, "wear_depth") for of in (scene, truth)
    )  # ranks may share both otherwise
    error = np.abs(depth - true).max() / true.max()
    assert found.reached and error <= ACCURACY / 2
    assert error <= max(3 * found.depth_error, ACCURACY / 100)


@pytest.mark.slow
def test_strokes_that_wear_off_much_leave_a_side():
    """The scar is lopsided because the first stroke comes first: it is the mirror image if that goes the other way, and more increments change little."""
    scars = []
    for sign, parts in ((1, 1), (-1, 1), (1, 4)):
        scene, _ = roller(0.0, 2e-3)
        scene.problem.reset()  # no stroke yet
        scene.problem.solve()
        scene.contact.wear = dc.Wear(1e-2)
        plane, before = scene.surface, 0.0
        for way in (2e-3, 0.0, -2e-3, 0.0):
            for part in range(1, parts + 1):
                at = sign * (before + (way - before) * part / parts)
                plane.displacement = (at, plane.displacement[1])
                scene.problem.solve()
            before = way
        here = dict(zip(np.round(sign * scene.contact.x[:, 0], 9).tolist(), scene.contact.wear_depth.tolist()))  # fmt: skip
        scars.append({x: depth for of in COMM.allgather(here) for x, depth in of.items()})
    one, mirrored, fine = (np.array([scar[x] for x in sorted(scars[0])]) for scar in scars)
    side = np.abs(one - one[::-1]).max()
    assert side > 0.3 * one.max()
    assert mirrored == pytest.approx(one, abs=1e-4 * one.max())
    assert fine == pytest.approx(one, abs=0.5 * side)


def test_in_partial_slip_wear_ends_where_the_slip_zone_carries_nothing():
    """Under a constant weight, what sticks does not wear and takes over the load, and wear comes to an end [Ciavarella and Hills 1999]."""
    scene, cycle = roller(1e-2, 2e-3)
    c, rates = scene.contact, []
    before = c.reaction[:, -1]
    for done in range(16):
        depth = c.wear_depth
        cycle(done)
        rates.append(total(scene, c.wear_depth - depth))
    assert rates[-1] < 0.02 * rates[0]
    worn = scene.problem.body.largest(c.wear_depth)
    edges = (before > 0.0) & (c.wear_depth > 0.5 * worn)  # what slipped and was worn off
    carried = [
        COMM.allreduce(float(of[edges].sum())) / 2000.0 for of in (before, c.reaction[:, -1])
    ]
    assert carried[0] > 0.05 and carried[1] < 1e-3


@pytest.mark.slow
def test_the_limit_of_partial_slip_is_contact_of_the_stick_zone_alone():
    """Where gentle wear has ended, the stick zone carries what it would carry if nothing else could touch [Ciavarella and Hills 1999]."""
    scene, cycle = roller(1e-3, 2e-3)
    for done in range(80):
        cycle(done)
    alone, _ = roller(
        0.0, 0.0, touching=0.8
    )  # mm, between the last node that sticks and the first one that slips
    sides = []
    for c in (scene.contact, alone.contact):
        here = dict(zip(np.round(c.x[:, 0], 9).tolist(), c.reaction[:, 1].tolist()))
        sides.append({x: r for of in COMM.allgather(here) for x, r in of.items()})
    worn, expected = sides
    assert len(expected) == 7 and sum(expected.values()) == pytest.approx(2000.0, rel=1e-6)
    for x, carried in worn.items():
        assert carried == pytest.approx(expected.get(x, 0.0), abs=0.01 * max(expected.values())), x


@pytest.mark.slow
def test_the_limit_of_partial_slip_in_closed_form():
    """Nodes carry the integrals of p = (P / pi + E* (c^2 - 2 x^2) / 4 R) / sqrt(c^2 - x^2), of a parabola that touches for |x| < c alone [Ciavarella and Hills 1999].

    To 4 % of each force for |x| < c / 2, c halfway between the last node that sticks and the first that slips.  At nu = 0.45 tractions
    hardly move normally; before wear, the forces there are 2 % above those of Hertz.
    """
    nu, weight, R = 0.45, 2000.0, 100.0
    scene, cycle = roller(1e-4, 2e-3, cells=(32, 8), grade=3.5, nu=nu)
    assert dc.cycle_jump(scene.problem, cycle, 10**4, 0.05).reached
    found = zip(scene.contact.x[:, 0].tolist(), scene.contact.reaction[:, 1].tolist())
    x, r = np.array(sorted({round(x, 9): r for of in COMM.allgather(list(found)) for x, r in of}.items())).T  # fmt: skip
    between = 0.5 * (x[1:] + x[:-1])
    first, *_, last = np.flatnonzero(r > 1e-3 * r.max())
    c = between[last]
    assert c == pytest.approx(-between[first - 1]) and r[first : last + 1].sum() == pytest.approx(weight)  # fmt: skip
    modulus = 210e3 / (1 - nu**2)
    t = np.clip(between, -c, c)
    carried = weight / np.pi * np.arcsin(t / c) + modulus / (4 * R) * t * np.sqrt(c**2 - t**2)
    inside = np.abs(x[1:-1]) < c / 2
    assert inside.sum() >= 7
    assert r[1:-1][inside] == pytest.approx(np.diff(carried)[inside], rel=0.04)


@pytest.mark.slow
def test_a_killed_programme_goes_on(tmp_path):
    """A programme that is ended and started again in the same folder makes the jumps of one that was not; so does one rank alone."""
    path = COMM.bcast(tmp_path, root=0) / "programme"
    scene, cycle = pad(1e-6, 0.2)
    straight = dc.cycle_jump(scene.problem, cycle, 100)

    def killed(row):
        if row["cycle"] > 9:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        dc.cycle_jump(*pad_of(1e-6, 0.2), 100, path=path, monitor=killed)
    assert COMM.bcast(len(list(path.iterdir())) if COMM.rank == 0 else None, root=0) == 3
    again, cycle = pad(1e-6, 0.2)
    resumed = dc.cycle_jump(again.problem, cycle, 100, path=path)
    alone = dc.cycle_jump(*pad_of(1e-6, 0.2, scenes.MPI.COMM_SELF), 100)
    for other in (resumed, alone):
        assert [row["jump"] for row in other.table] == [row["jump"] for row in straight.table]
        assert other.volume == pytest.approx(straight.volume, rel=1e-7)
        assert other.depth == pytest.approx(straight.depth, rel=1e-6)
    if COMM.size == 1:
        assert resumed == straight
        assert np.array_equal(again.contact.reaction, scene.contact.reaction)
    further = dc.cycle_jump(again.problem, cycle, 102, path=path)  # its error is that before
    assert 0.0 < further.profile_error == pytest.approx(resumed.profile_error, rel=0.1)
    with pytest.raises(ValueError, match="has done 102 cycles, more than cycles = 10"):
        dc.cycle_jump(again.problem, cycle, 10, path=path)
    good, nan = (
        COMM.bcast((path / "record.json").read_text() if COMM.rank == 0 else None),
        float("nan"),
    )
    row = json.loads(good)["table"][0]
    changes = (
        dict(measured=[]), dict(measured=[99, 0.1, 0.1, 0.1]), dict(measured=[0, 0.1, nan, 0.1]), dict(next="x"), dict(next=nan), dict(next=0.0),
        dict(simulated="a"), dict(simulated=1.5), dict(rejected=-1), dict(done=101), dict(table=[]), dict(table=[{"cycle": 102}]),
        dict(table=[row | {"cycle": 102}]), dict(table=[row | {"jump": 102, "cycle": 102, "volume": nan}]), dict(table=3),
    )  # fmt: skip
    for text in (
        "",
        "{}",
        "[]",
        "3",
        *(json.dumps(json.loads(good) | change) for change in changes),
    ):
        COMM.barrier()
        if COMM.rank == 0:
            (path / "record.json").write_text(text)
        COMM.barrier()
        with pytest.raises(ValueError, match="no record of cycle_jump"):
            dc.cycle_jump(again.problem, cycle, 104, path=path)


@pytest.mark.parametrize("cycles", [1, 2])
def test_a_cycle_that_does_not_converge_ends_the_run(cycles):
    """Where no shorter jump is left, its NotConverged is raised; the same jump is not tried for ever."""
    scene, _ = pad(1e-6, 0.2)

    def cycle(done):
        raise dc.NotConverged("not converged.", None, np.zeros(0), [])

    with pytest.raises(dc.NotConverged):
        dc.cycle_jump(scene.problem, cycle, cycles)


def test_short_jumps_have_an_error_that_is_known():
    """Jumps of three cycles at most, whose last ones are of two: one of three is measured, whatever is left over, and the error is no infinite one."""
    for cycles in (10, 13, 16):
        found = dc.cycle_jump(*pad_of(1e-6, 0.2), cycles, longest=3)
        assert max(row["jump"] for row in found.table) == 3 or cycles == 10
        assert found.reached and found.profile_error < ACCURACY


def pad_of(*given):
    scene, cycle = pad(*given)
    return scene.problem, cycle


def test_what_fails_leaves_the_last_jump():
    """An error of the cycle on one rank is that of all; the problem is at the end of the last jump, and wears as before."""
    scene, cycle = pad(1e-5, 0.2)
    depths = []

    def fails(done):
        cycle(done)
        if done > 2 and COMM.rank == COMM.size - 1:
            raise OSError("no space left")

    with pytest.raises(OSError, match="no space"):
        dc.cycle_jump(scene.problem, fails, 100, monitor=lambda row: depths.append(scene.contact.wear_depth))  # fmt: skip
    assert np.array_equal(scene.contact.wear_depth, depths[-1]) and scene.contact.repeats == 1


def test_a_budget_of_simulated_cycles():
    """Where it is used up, an error says where the programme is; nothing is lost, another call goes on from there."""
    scene, cycle = pad(1e-5, 0.2)
    with pytest.raises(RuntimeError, match="is at cycle 4 of 100.*with cycles=96") as error:
        dc.cycle_jump(scene.problem, cycle, 100, max_cycles=5)
    assert not isinstance(error.value, dc.NotConverged) and scene.contact.repeats == 1
    worn = total(scene, scene.contact.wear_depth)
    found = dc.cycle_jump(scene.problem, cycle, 2)
    assert found.volume == pytest.approx(1.5 * worn, rel=1e-2)


def test_a_cycle_without_a_step_is_refused():
    """Nothing would wear, and no accuracy be reached by it."""
    with pytest.raises(ValueError, match="cycle has made no step"):
        dc.cycle_jump(pad(1e-5, 0.2)[0].problem, lambda done: None, 10)


def test_what_cannot_be_meant():
    """Cycles, accuracy, wear and snapshots are checked."""
    scene, cycle = pad(1e-5, 0.2)
    problem = scene.problem
    for given, said in (((cycle, 1.5), "cycles must be"), ((cycle, 10, 0.0), "accuracy must be"), ((None, 10), "cycle must be")):  # fmt: skip
        with pytest.raises(ValueError, match=said):
            dc.cycle_jump(problem, *given)
    with pytest.raises(ValueError, match="repeats must be"):
        scene.contact.repeats = -1
    snapshot, other = problem.snapshot(), pad(1e-5, 0.2)[0]
    with pytest.raises(ValueError, match="of the same problem"):
        other.problem.restore(snapshot)
    scene.contact.wear = None
    with pytest.raises(ValueError, match="law of wear"):
        dc.cycle_jump(problem, cycle, 10)


def test_snapshots_are_returned_to():
    """From a snapshot the same steps follow, as often as one likes."""
    scene, cycle = pad(1e-5, 0.2)
    snapshot, before, found = scene.problem.snapshot(), scene.contact.wear_depth, []
    for _ in range(3):
        scene.problem.restore(snapshot)
        assert np.array_equal(scene.contact.wear_depth, before)
        assert scene.surface.displacement[0] == 0.0
        cycle(0)
        found.append(scene.contact.wear_depth)
    assert (found[0] > before).all()
    for other in found[1:]:
        assert other == pytest.approx(found[0], rel=1e-9)


@pytest.mark.slow
def test_friction_that_grows_with_depth():
    """mu = mu0 (1 + w / h) under dead weight: the depth grows as h (exp(k mu0 p s n / h) - 1), in jumps, too."""
    h, coefficient, stroke, cycles = 1e-2, 1e-8, 2.0, 10**5
    scene, cycle = pad(coefficient, stroke)
    scene.contact.friction = dc.Friction(lambda x, wear_depth: MU * (1 + wear_depth / h))
    found = dc.cycle_jump(scene.problem, cycle, cycles, ACCURACY)
    grown = np.exp(coefficient * MU * WEIGHT * 4 * stroke * cycles / h) - 1
    assert grown > 0.25 and found.volume == pytest.approx(h * grown, rel=ACCURACY)


@pytest.mark.slow
def test_friction_that_more_than_doubles_in_few_jumps():
    """At an accuracy of 0.05, too, where nodes lift off as friction grows, the error is as estimated, within three: jumps in which friction changes much are not made."""

    def grows():
        scene, cycle = pad(1e-4, 0.2)
        scene.contact.friction = dc.Friction(lambda x, wear_depth: MU * (1 + wear_depth / 2e-3))
        return scene, cycle

    truth, cycle = grows()
    for done in range(100):
        cycle(done)
    scene, cycle = grows()
    found = dc.cycle_jump(scene.problem, cycle, 100, 0.05)
    expected, largest = truth.contact.wear_depth, truth.problem.body.largest
    error = largest(np.abs(scene.contact.wear_depth - expected)) / largest(expected)
    assert found.simulated < 40 and largest(expected) > 4e-3  # mu > 0.9
    assert error <= 0.05 and found.depth_error / 3 <= error <= 3 * found.depth_error


@pytest.mark.slow
def test_the_scar_of_a_cylinder_in_gross_slip_is_a_chord():
    """What is worn off by sliding on a plane is the segment of the circle that the plane cuts: of half width b, volume 2 b^3 / 3 R and depth b^2 / 2 R.

    To 2 % of the largest depth at every node, for a depth of eleven times W / E, by the order of which the body flattens.
    """
    scene, cycle = roller(6e-5, 0.05)
    found = dc.cycle_jump(scene.problem, cycle, 100, 0.05)
    b = (1.5 * 100.0 * found.volume) ** (1 / 3)
    x, depth = scene.contact.x[:, 0], scene.contact.wear_depth
    chord = np.maximum(b**2 - x**2, 0.0) / 200.0
    off = scene.problem.body.largest(np.abs(depth - chord))
    assert found.reached and 4.0 < b < 5.0
    assert off < 0.02 * b**2 / 200.0


@pytest.mark.slow
def test_grooves_are_worn_flat():
    """Of a block with grooves whose friction becomes isotropic as depth wears off, drawn across them at 45 degrees under a dead weight.

    Force and depth follow from the law: of slip along d the traction is along (p1^2 d1, p2^2 d2), on the ellipse of the mu, so work per way and
    weight grows from 0.113 (case C) to 0.2 (case A), and the depth as the integral of it.
    """
    h, k, weight, stroke, cycles = 2e-3, 3e-7, 1.0, 0.2, 10**5

    def mu(x, wear_depth):
        part = np.minimum(wear_depth / h, 1.0)
        return np.stack((0.3 - 0.1 * part, 0.15 + 0.05 * part))

    def p(x, wear_depth):
        part = np.minimum(wear_depth / h, 1.0)
        return np.stack((0.05 + 0.15 * part, 0.2 + 0.0 * part))

    def work(worn):
        squares = p(None, worn) ** 2
        return (
            0.5 * squares.sum(axis=0) / np.sqrt(0.5 * ((squares / mu(None, worn)) ** 2).sum(axis=0))
        )

    scene = scenes.block(comm=COMM, cells=(3, 3, 2), E=1000.0, tol=1e-8)
    scene.contact.friction = dc.Friction(mu, p)
    plane = scene.surface
    plane.free, plane.force = ("n",), (0, 0, weight)
    scene.problem.solve()

    def cycle(done):
        for way in (stroke, 0.0, -stroke, 0.0):
            plane.displacement = (way / 2**0.5, way / 2**0.5, plane.displacement[2])
            scene.problem.solve()

    def loop():
        """Work of a cycle over weight and way, without wear."""
        scene.contact.wear = None
        before = total(scene, scene.contact.dissipation / scene.contact.area)
        cycle(0)
        done = total(scene, scene.contact.dissipation / scene.contact.area)
        return (done - before) / (4 * stroke * weight)

    cycle(0)
    first = loop()
    scene.contact.wear = dc.Wear(k)
    found = dc.cycle_jump(scene.problem, cycle, cycles, ACCURACY)
    last = loop()
    worn = np.linspace(0.0, 4 * h, 4001)
    needed = np.concatenate([[0.0], np.cumsum(np.diff(worn) / work(0.5 * (worn[1:] + worn[:-1])))])
    expected = np.interp(k * weight * 4 * stroke * cycles, needed, worn)
    assert (first, last) == (pytest.approx(work(0.0), rel=0.01), pytest.approx(0.2, rel=0.01))
    assert expected > h and found.volume == pytest.approx(expected, rel=ACCURACY)
