# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Work of friction: never negative, exact for rigid sliding, and how it converges in the increments."""

import warnings

import numpy as np
import pytest
import scenes

import dolfinx_contact as dc
from dolfinx_contact.law.dissipation import frictional_work, slipped_last

COMM = scenes.COMM
EPS = np.finfo(float).eps
LAWS = {
    "isotropic": dict(mu=0.2),
    "associated": dict(mu=(0.3, 0.15)),
    "case C": dict(mu=(0.3, 0.15), p=(0.05, 0.20)),
    "crossed": dict(mu=(1.0, 0.01), p=(0.01, 1.0)),
}


def slid_along(e, mu, p):
    """Force of a node over its normal force, ``shape=(2,)``, while it slides along ``e``.

    The point of the ellipse where ``P^-2 r_t`` points against ``e``.
    """
    mu, p = (np.broadcast_to(a, 2) for a in (mu, mu if p is None else p))
    force = p**2 * e
    return -force / np.hypot(*(force / mu))


def slide(friction, slips, normal, stuck_before=True):
    """Works, ``shape=(steps, 2)``, of one node that slides rigidly by ``slips`` under the forces ``normal``."""
    mu, p = friction.mu, np.where(friction.mu > 0, friction.p, 1.0)
    forces = [[*n * slid_along(s, mu, p), n] for s, n in zip(slips, normal[1:])]
    before = [[0.0, 0.0, normal[0]], *forces[:-1]]
    slipped = np.arange(len(slips)) > 0
    return frictional_work(friction, np.array(before), slipped, np.array(forces), slips)[0]


def random_states(rng, n, tangents):
    """Reactions inside, on and outside of any cone, and slips; many of them degenerate."""
    before, now = rng.normal(size=(2, n, tangents + 1)) * 10.0 ** rng.integers(-9, 9, (2, n, 1))
    slips = rng.normal(size=(n, tangents)) * 10.0 ** rng.integers(-9, 9, (n, 1))
    for array in (before, now, slips):
        array[rng.random(array.shape) < 0.2] = 0.0
        array[rng.random(n) < 0.1] = 0.0
        array[rng.random(n) < 0.1] *= 1e-300
    back = rng.random(n) < 0.2  # straight back along the old force, or along with it
    slips[back] = before[back, :-1] * rng.choice([-1.0, 1.0], (back.sum(), 1))
    return before, rng.random(n) < 0.5, now, slips


@pytest.mark.parametrize("tangents", [1, 2])
def test_never_negative(tangents):
    """Along each direction, at every node, whatever the states, even those that are no solutions."""
    rng, n = np.random.default_rng(1), 20_000
    laws = [dc.Friction(0.0), dc.Friction(0.3), dc.Friction(1e-50)]
    if tangents == 2:
        mu, p = 10.0 ** rng.uniform(-3, 3, (2, n, 2))
        mu[::7] = 0.0
        turn = rng.uniform(0, 2 * np.pi, n)
        laws += [dc.Friction(**law) for law in LAWS.values()]
        laws += [dc.Friction((1.0, 1e-9), p=(1e-9, 1.0)), dc.Friction((1e50, 1e-50), k=0.6)]
        laws += [dc.Friction(mu, p, axes=np.column_stack((np.cos(turn), np.sin(turn))))]
    for law in laws:
        before, slipped, now, slips = random_states(rng, n, tangents)
        work = frictional_work(law, before, slipped, now, slips)[0]
        assert work.shape == slips.shape and np.isfinite(work).all()
        assert (work >= 0).all()
        assert law.frictionless == (not work.any())
        if law.mu.ndim == 1:  # a rank may have no nodes
            nothing = frictional_work(law, *(a[:0] for a in (before, slipped, now, slips)))[0]
            assert nothing.shape == (0, tangents)


@pytest.mark.parametrize("law", LAWS)
def test_exact_for_rigid_sliding(law):
    """Along a line, to and fro, under a constant or linearly varying force: mean force times m times way.

    Any increments, from rest and from open, down to a force of zero; the law itself is asked for m.
    """
    rng = np.random.default_rng(2)
    friction = dc.Friction(**LAWS[law])
    for steps in (1, 2, 5, 20):
        for _ in range(20):
            turn = rng.uniform(0, 2 * np.pi)
            e = np.array([np.cos(turn), np.sin(turn)])
            way = rng.uniform(0.1, 1.0, steps) * rng.choice([-1.0, 1.0], steps)
            time = np.append(0.0, np.abs(way).cumsum())  # a constant speed
            first, last = rng.choice([0.0, 1.0, 7.0], 2, replace=False)
            for normal in (np.full(steps + 1, 2.5), first + (last - first) * time / time[-1]):
                slips = way[:, None] * e
                r = slid_along(e, *(LAWS[law].get(k) for k in "mu p".split()))
                state = np.array([[*r, 1.0]])
                assert friction.law(3).bipotential_gap(state, np.zeros(1), e[None])[0] < 1e-13
                expected = -(r @ e) * 0.5 * (normal[0] + normal[-1]) * time[-1]
                work = slide(friction, slips, normal)
                assert work.sum() == pytest.approx(expected, rel=64 * EPS * steps)


def test_exact_for_sharp_corners():
    """A rigid node that turns by a right angle or more works as on straight lines."""
    friction = dc.Friction(**LAWS["case C"])
    slips = np.array([[1.0, 0.2], [-0.4, 2.0], [-1.0, -3.0], [2.0, 0.0], [-1.0, 1e-9]])
    expected = [-slid_along(s, *LAWS["case C"].values()) @ s for s in slips]
    work = slide(friction, slips, np.ones(6)).sum(axis=1)
    assert work == pytest.approx(expected, rel=64 * EPS)


def test_units_and_frames_do_not_matter():
    """Work scales with forces and lengths, and axes turned with everything else give the same."""
    rng, n = np.random.default_rng(3), 1000
    friction = dc.Friction(**LAWS["case C"])
    before, slipped, now, slips = (rng.normal(size=shape) for shape in ((n, 3), n, (n, 3), (n, 2)))
    slipped = slipped > 0
    work = frictional_work(friction, before, slipped, now, slips)[0]
    for force, length in ((1e-90, 1e60), (1e12, 1e-12), (1e100, 1e100)):
        scaled = frictional_work(friction, force * before, slipped, force * now, length * slips)[0]
        assert scaled == pytest.approx(force * length * work, rel=1e-12, abs=0)
    turn = rng.uniform(0, 2 * np.pi, n)
    cos, sin = np.cos(turn), np.sin(turn)

    def turned(a):
        a = a.copy()
        a[:, 0], a[:, 1] = cos * a[:, 0] - sin * a[:, 1], sin * a[:, 0] + cos * a[:, 1]
        return a

    grooves = dc.Friction(**LAWS["case C"], axes=np.column_stack((cos, sin)))
    again = frictional_work(grooves, turned(before), slipped, turned(now), turned(slips))[0]
    largest = work.max(axis=1, keepdims=True)
    assert (np.abs(again - work) <= 1e-9 * largest).all()


def test_opening_and_closing_nodes():
    """A force that falls to zero or rises from it counts with its half along the whole slip."""
    friction, slip = dc.Friction(0.2), np.array([[3.0, 4.0]])
    r, none = np.array([[-0.6, -0.8, 5.0]]) * [0.2 * 5, 0.2 * 5, 1], np.zeros((1, 3))
    for before, after in ((r, none), (none, r)):
        for slipped in (False, True):
            work = frictional_work(friction, before, np.array([slipped]), after, slip)[0]
            assert work.sum() == pytest.approx(0.5 * 5.0 * 0.2 * 5.0, rel=8 * EPS)
    assert not frictional_work(friction, none, np.array([False]), none, slip)[0].any()


@pytest.mark.parametrize("law", ["isotropic", "associated", "case C"])
def test_order_along_a_given_curve(law):
    """Rigid, around a circle: second order for a whole turn, half a step's change of m off for a part of it."""
    coefficients = [LAWS[law].get(name) for name in ("mu", "p")]

    def per_way(angle):
        e = np.array([np.cos(angle), np.sin(angle)])
        return -slid_along(e, *coefficients) @ e

    def error(span, steps, exact):
        angle = 0.3 + np.linspace(0, span, steps + 1)
        slips = np.diff(np.column_stack((np.sin(angle), -np.cos(angle))), axis=0)
        return slide(dc.Friction(**LAWS[law]), slips, np.ones(steps + 1)).sum() - exact

    turn = np.mean([per_way(a) for a in np.linspace(0, 2 * np.pi, 10_000, endpoint=False)])
    errors = [error(2 * np.pi, steps, 2 * np.pi * turn) for steps in (512, 1024, 2048)]
    assert np.divide(errors[:-1], errors[1:]) == pytest.approx(4.0, rel=0.02)

    span, steps = 1.1, 1024
    x, w = np.polynomial.legendre.leggauss(100)
    part = 0.5 * span * w @ [per_way(0.3 + 0.5 * span * (1 + t)) for t in x]
    lag = 0.5 * span / steps * (per_way(0.3) - per_way(0.3 + span))
    assert error(span, steps, part) == pytest.approx(lag, abs=0.02 * span / steps * turn)


# -- a node on a spring whose other end goes around a circle: closed forms -----------------------


def circling(steps, radius, lag):
    """What one turn of ``steps`` increments leaves at a node, unit force: reactions and slips.

    Backward Euler in its steady state: the node runs around a circle, a chord a step, its force against the
    chord. Its spring, longer by ``lag`` (force over stiffness), ends on a circle of ``radius``.
    """
    half = np.pi / steps
    own = -lag * np.sin(half) + np.sqrt(radius**2 - (lag * np.cos(half)) ** 2)
    angle = 2 * half * np.arange(-1, steps + 1)
    u = own * np.column_stack((np.cos(angle), np.sin(angle)))
    slips = np.diff(u, axis=0)
    e = slips / np.linalg.norm(slips, axis=1)[:, None]
    ends = u[1:] + lag * e  # it is a state of the scheme: the spring's force balances friction
    assert np.linalg.norm(ends, axis=1) == pytest.approx(radius, rel=1e-13)
    return np.column_stack((-e, np.ones(steps + 1))), slips, own


def turn_work(steps, radius, lag):
    r, slips, own = circling(steps, radius, lag)
    slipped = np.full(steps, True)
    return frictional_work(dc.Friction(1.0), r[:-1], slipped, r[1:], slips[1:])[0].sum(), own


def test_no_nodal_rule_is_of_second_order_behind_a_spring():
    """States of two problems are the same, the works they approach differ in first order.

    The node on a spring works ``2 pi sqrt(radius^2 - lag^2)`` a turn. The rigid node on the smaller circle
    that backward Euler computes leaves the same reactions and slips.
    """
    radius, lag = 1.0, 0.6
    exact, errors, differ = 2 * np.pi * 0.8, [], []
    for steps in (64, 128, 256, 512):
        work, own = turn_work(steps, radius, lag)
        r, slips, _ = circling(steps, radius, lag)
        rigid_r, rigid_slips, _ = circling(steps, own, 0.0)
        assert np.abs(r - rigid_r).max() < 1e-12 and np.abs(slips - rigid_slips).max() < 1e-12
        errors.append(1 - work / exact)
        differ.append(steps * (exact - 2 * np.pi * own) / exact)
        # each step but the own circle's is exact to second order: the states are what is left
        assert abs(work / (2 * np.pi * own) - 1) < 2 / steps**2
    assert np.divide(errors[:-1], errors[1:]) == pytest.approx(2.0, rel=0.03)
    assert differ[-1] == pytest.approx(np.pi * lag / 0.8, rel=0.005)


# -- bodies ------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [LAWS["case C"], LAWS["crossed"], dict(mu=0.3)])
@pytest.mark.parametrize("turn", [0.4, 0.0])
def test_a_corner_that_leaves_work_unknown_is_told(law, turn):
    """One stroke after another: straight on nothing is unknown, nor with isotropic friction; else after a corner more than a tenth."""
    scene = scenes.block(cells=(2, 2, 1), **{"p": None, **law})
    scene.move_top(0, 0, -1e-5)
    scene.problem.solve()
    scene.surface.displacement = (0.6, 0.0, 0)
    scene.problem.solve()
    scene.surface.displacement = (0.6 + 0.6 * np.cos(turn), 0.6 * np.sin(turn), 0)
    if turn and np.size(law["mu"]) == 2:
        with pytest.warns(UserWarning, match="leaves the frictional work unknown by .*% of all"):
            scene.problem.solve()
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            scene.problem.solve()


def test_a_pause_changes_no_work():
    """A step in which nothing moves leaves forces on the cone: whether nodes are then called slipping or sticking is rounding, and the
    work of the next step, which turns, is the same as without the pause."""
    works = []
    for pauses in (0, 1, 3):
        scene = scenes.block(cells=(2, 2, 1), **{"p": None, **LAWS["crossed"]})
        scene.move_top(0, 0, -1e-5)
        scene.problem.solve()
        for way in ((0.6, 0.0, 0), *pauses * [(0.6, 0.0, 0)], (0.9, 0.1, 0)):
            scene.surface.displacement = way
            scene.problem.solve()
        works.append(scene.contact.dissipation)
    assert works[1] == pytest.approx(works[0], rel=1e-6)
    assert works[2] == pytest.approx(works[0], rel=1e-6)


def test_forces_on_the_cone_alone_say_along_which_way_nodes_slipped():
    """Status counts, or a stuck force within a thousandth of its cone; none of open nodes, nor without friction."""
    law = dc.Friction((0.3, 0.1))
    forces = np.array(
        [[0.3, 0.0, 1.0], [0.0, 0.09999, 1.0], [0.0, 0.09, 1.0], [0.0, 0.0, 0.0], [0.0, 0.09, 1.0]]
    )
    slips = np.array([False, False, False, False, True])
    assert slipped_last(law, forces, slips).tolist() == [True, True, False, False, True]
    assert not slipped_last(dc.Friction(0.0), forces * [0, 0, 1], np.zeros(5, dtype=bool)).any()


@pytest.mark.parametrize("p", [None, (0.05, 0.20)])
@pytest.mark.parametrize("increments", [1, 2, 5, 20])
def test_block_dragged_to_and_fro(increments, p):
    """mu N times the way, whatever the increments of a stroke.

    The block lags behind the plane by its elastic displacement, at most twice that in a stroke.
    """
    scene = scenes.block(cells=(2, 2, 1), mu=(0.3, 0.3 if p is None else 0.15), p=p)
    c, stroke, total, way = scene.contact, 1.0, 0.0, 0.0
    scene.move_top(0, 0, -1e-5)
    scene.problem.solve()
    normal = []
    for end, start in ((stroke, 0.0), (0.0, stroke), (stroke, 0.0)):
        before = c.dissipation.copy()
        for x in np.linspace(start, end, increments + 1)[1:]:
            last = c.dissipation.copy()
            scene.surface.displacement = (x, 0, 0)
            scene.problem.solve()
            normal.append(c.force()[2])
            assert (c.dissipation >= last).all()
        if start or end < start or len(normal) > increments:  # the first stroke runs in
            total += COMM.allreduce((c.dissipation - before).sum())
            way += stroke
    elastic = COMM.allreduce(np.abs(scene.u.x.array).max(initial=0.0), op=scenes.MPI.MAX)
    expected = 0.3 * normal[-1] * way
    spread = max(normal[increments:]) / min(normal[increments:]) - 1
    assert total == pytest.approx(expected, rel=spread + 2 * elastic / stroke)
    assert spread + 2 * elastic / stroke < 1e-3


def test_wear_depth_never_decreases():
    """Reversals under a falling force, where the trapezoidal rule gives negative work."""
    scene = scenes.block(wear=dc.Wear((1e-6, 2e-6)))
    c, negative = scene.contact, 0
    rng = np.random.default_rng(4)
    for k in range(12):
        scene.move_top(*(2e-3 * rng.uniform(-1, 1, 2)), -0.01 + 0.0008 * k)
        depth, work, r = c.wear_depth.copy(), c.dissipation.copy(), c.reaction
        scene.problem.solve()
        mean = -0.5 * ((r + c.reaction)[:, :-1] * c.slip_increment).sum(axis=1)
        negative += COMM.allreduce(int((mean < -1e-3 * np.abs(mean).max(initial=0.0)).sum()))
        assert (c.wear_depth >= depth).all() and (c.dissipation >= work).all()
    assert negative > 0
    assert COMM.allreduce(c.wear_depth.sum()) > 0


@pytest.mark.slow
@pytest.mark.parametrize("case", "ABC")
def test_increments_of_the_punch(case):
    """The first cycle's work in 15 increments is within 2 % of that in 120, in 60 within 0.2 %."""
    pytest.importorskip("gmsh")
    from studies.punch import Parameters, Punch, programme

    work = {}
    for factor in (1, 4, 8):
        parameters = Parameters(case=case, loading=5 * factor, unloading=10 * factor)
        punch = Punch(parameters, divisions=2, layers=1)
        for displacement in programme(parameters):
            punch.press(displacement)
        work[factor] = COMM.allreduce(punch.contact.dissipation.sum())
    assert work[1] == pytest.approx(work[8], rel=0.02)
    assert work[4] == pytest.approx(work[8], rel=0.002)


@pytest.mark.parametrize("cells", [(3, 3, 2), (4, 2)])
def test_what_sticks_does_no_work(cells):
    """A block that is shaken while all nodes stick gathers no work, path or wear, whatever slip its tolerance leaves in a step."""
    scene = scenes.block(
        cells=cells, mu=0.5, p=None, tol=1e-4, wear=dc.Wear(1e-4), solver=dc.FixedPoint()
    )
    c, across = scene.contact, [0.0] * (len(cells) - 2)
    for x in (0.0, 2e-3):
        scene.move_top(x, *across, -0.02)
        scene.problem.solve()
    sums = c.dissipation, c.slip_path, c.wear_depth
    slipped = 0.0
    for k in range(12):
        scene.move_top(2e-3 - 1e-4 * (k % 2), *across, -0.02)
        assert scene.problem.solve().counts.slip == 0
        slipped += COMM.allreduce(np.abs(c.slip_increment).sum())
    assert slipped > 0.0
    for now, before in zip((c.dissipation, c.slip_path, c.wear_depth), sums):
        assert np.array_equal(now, before)


@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
def test_slow_sliding_works_as_fast_sliding(solver, tmp_path):
    """mu N times the way, in steps each of which slips less than the tolerance leaves unknown; also where the run is taken up again."""
    way, works, path = 1e-4, [], COMM.bcast(tmp_path, root=0) / "state.npz"
    for tol, steps in ((1e-10, 1), (1e-4, 50)):
        scene = scenes.block(cells=(2, 2, 1), mu=0.3, p=None, tol=tol, solver=solver)
        for x in (0.0, 0.02, 0.03):
            scene.move_top(x, 0, -0.01)
            scene.problem.solve()
        before, stuck = scene.contact.dissipation, 0
        for k in range(steps):
            scene.move_top(0.03 + way * (k + 1) / steps, 0, -0.01)
            stuck += scene.problem.solve().counts.stick
            if k == steps // 2:
                kept = scene.contact.slip_kept
                scene.problem.save(path)
                scene.problem.reset()
                assert not scene.contact.slip_kept.any()
                scene.problem.load(path)
                assert np.array_equal(scene.contact.slip_kept, kept)
        works.append(COMM.allreduce((scene.contact.dissipation - before).sum()))
        if steps == 1:
            assert works[0] == pytest.approx(0.3 * scene.contact.force()[2] * way, rel=5e-3)
    assert stuck > 0  # else it is not slow
    assert works[1] == pytest.approx(works[0], rel=0.05)
