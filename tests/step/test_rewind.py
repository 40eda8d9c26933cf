# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Steps that are tried: taken back, or made again in smaller increments."""

import logging
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import scenes

import dolfinx_contact as dc
from dolfinx_contact.extend import Solver

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
PROGRAMME = [(0, 0, -0.005), (0.001, 0.0005, -0.01), (0.002, -0.001, -0.006), (0.003, 0, -0.004)]


def left(scene):
    """All that a step leaves, but gaps, which are rounding: displacements, reactions, statuses, sums, planes."""
    c = scene.contact
    return [a.copy() for a in (scene.u.x.array, c.reaction, c.status, c.displacement, c.dissipation, c.slip_path, c.surface.displacement)]  # fmt: skip


def step(scene, *top):
    scene.move_top(*top)
    return scene.problem.solve()


@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
def test_a_step_taken_back_leaves_nothing(solver):
    """After rewind all is as it was, and the steps that follow are those of a run that never tried."""
    plain, tried = (scenes.block(solver=solver, wear=dc.Wear(1e-7)) for _ in range(2))
    for k, top in enumerate(PROGRAMME):
        step(plain, *top)
        if k == 2:
            before = left(tried)
            tried.surface.displacement = (0.01, 0.02, 0.001)
            step(tried, 0.01, 0.01, -0.02)
            tried.problem.rewind()
            assert all(map(np.array_equal, left(tried), before))
        step(tried, *top)
    for found, expected in zip(left(tried), left(plain)):
        assert np.allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max(initial=0))
        assert COMM.size > 1 or np.array_equal(found, expected)


def test_a_plane_driven_by_force_goes_back_with_its_step():
    """The motion that a force made is taken back, too."""
    scene = scenes.block(mu=0.3, p=None)
    scene.surface.free = ("t1", "n")
    for part in (0.0, 0.2):
        scene.surface.force = (part * 210, 0, 210.0)
        stood = scene.surface.displacement
        scene.problem.solve()
    scene.problem.rewind()
    assert (scene.surface.displacement == stood).all()


def test_there_is_one_step_to_go_back_by():
    """Without a step there is nothing to take back; a step that failed is none."""
    scene = scenes.block()
    message = "no step to go back by"
    with pytest.raises(ValueError, match=message):
        scene.problem.rewind()
    step(scene, *PROGRAMME[0])
    step(scene, *PROGRAMME[1])
    scene.problem.rewind()
    with pytest.raises(ValueError, match=message):
        scene.problem.rewind()
    step(scene, *PROGRAMME[1])
    scene.held.x.array[:] = np.nan
    with pytest.raises(ValueError, match="NaN"):
        scene.problem.solve()
    first = scenes.block()
    step(first, *PROGRAMME[0])
    scene.problem.rewind()
    assert scene.contact.force() == pytest.approx(first.contact.force(), rel=1e-9)
    step(scene, *PROGRAMME[1])
    scene.problem.reset()
    with pytest.raises(ValueError, match=message):
        scene.problem.rewind()


class Reluctant(Solver):
    """A solver that refuses steps larger than ``most``; solves the others as usual."""

    def __init__(self, scene, most):
        self.scene, self.most, self.refused = scene, most, 0

    def bind(self, step):
        self.bound = dc.CondensedNewton().bind(step)
        return self

    def update(self, step):
        self.bound.update(step)

    def solve(self, step, starts):
        far = np.abs(self.scene.held.x.array - self.scene.u.x.array)[self.scene.problem.body.fixed]
        if COMM.allreduce(far.max(initial=0.0), op=scenes.MPI.MAX) > self.most:
            self.refused += 1
            found = self.bound.solve(step, starts)
            x = found.state.x.copy()
            free = np.setdiff1d(np.arange(x.size), step.body.fixed)
            x[free] *= 1.5
            return found._replace(state=step.measure(x))
        return self.bound.solve(step, starts)

    def close(self):
        self.bound.close()


def test_increments_are_halved_and_grow_again(caplog):
    """Steps end at every point that is named; one that fails is made in parts, which grow where it is easy."""
    scene = scenes.block()
    scene.problem.solver = solver = Reluctant(scene, 0.0021)
    steps = []

    def programme(t):
        scene.move_top(0.001 * min(t, 2.0), 0, -0.008 * min(t, 1.0))

    with caplog.at_level(logging.INFO, logger="dolfinx_contact"):
        history = dc.advance(scene.problem, programme, [1.0, 2.0], monitor=lambda *a: steps.append(a))  # fmt: skip
    assert history.column("t") == pytest.approx([0.25, 0.5, 0.75, 1.0, 2.0])
    assert [t for t, _ in steps] == history.column("t").tolist()
    assert solver.refused == 3  # the whole, its half, and the half again after two quarters
    assert COMM.rank > 0 or "increments halved to 0.5 at 0" in caplog.text
    other = scenes.block()
    for t in history.column("t"):
        step(other, 0.001 * t, 0, -0.008 * min(t, 1.0))
    assert history.column("contact0_force_z")[-1] == pytest.approx(other.contact.force()[2], rel=1e-9)  # fmt: skip


def test_increments_grow_within_an_interval():
    """Two steps that converge double the increment, from where a whole number of larger ones is left."""
    scene = scenes.block()
    scene.problem.solver = Reluctant(scene, 0.002)

    def programme(t):
        scene.move_top(0, 0, -0.001 * (8 * t if t <= 0.5 else 4.0))  # hard, then easy

    history = dc.advance(scene.problem, programme, [1.0])
    assert history.column("t") == pytest.approx([0.25, 0.5, 1.0])


def test_increments_that_fail_again_grow_later():
    """Where every increment is hard, the next larger one is tried after 2, 4 and 8 steps, not after every second one."""
    scene = scenes.block()
    scene.problem.solver = solver = Reluctant(scene, 0.0006)

    def programme(t):
        scene.move_top(0, 0, -0.008 * t)

    history = dc.advance(scene.problem, programme, [1.0])
    assert history.column("t") == pytest.approx(np.arange(1, 17) / 16)
    assert solver.refused == 4 + 3  # 11 if after every second one


@pytest.mark.parametrize("start, points", [(-0.2, [0.0, 1.0]), (0.0, [0.5]), (3.0, [4.0, 7.0])])
def test_a_progress_bar_goes_from_nothing_to_all(monkeypatch, start, points):
    """Wherever the parameter starts, the bar is between 0 and 100 %."""
    bars = []

    class Bar:
        def __init__(self, total, initial=0.0):
            self.total, self.n, self.seen = total, initial, [initial / total]
            bars.append(self)

        def update(self, more):
            self.n += more
            self.seen.append(self.n / self.total)

        def close(self):
            pass

    monkeypatch.setitem(sys.modules, "tqdm", SimpleNamespace(tqdm=Bar))
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    scene = scenes.block(cells=(2, 2, 2))
    dc.advance(scene.problem, lambda t: scene.move_top(0, 0, -1e-3 * t), points, start=start)
    assert len(bars) == (COMM.rank == 0)
    for bar in bars:
        whole = points[-1] - start
        assert bar.seen == pytest.approx([0.0, *((t - start) / whole for t in points)])


def test_a_step_that_no_increment_solves_is_raised():
    """The last state that converged stays, and the table has the steps up to it."""
    scene = scenes.block()
    scene.surface.free = ("t1", "n")
    history = dc.History(scene.problem)

    def programme(t):
        scene.surface.force = (210.0 * t, 0, 210.0)

    with pytest.raises(dc.NotConverged, match="the plane slides away"):
        dc.advance(scene.problem, programme, [0.1, 1.1], smallest=1 / 8, history=history)
    assert history.column("t")[-1] == pytest.approx(0.225)
    assert scene.contact.force()[[0, 2]] == pytest.approx([0.225 * 210, 210], rel=1e-6)


@pytest.mark.parametrize(
    "arguments, message",
    [
        (dict(points=[]), "must rise"),
        (dict(points=[1.0, 1.0]), "must rise"),
        (dict(points=[0.0, 1.0]), "must rise"),
        (dict(points=[np.nan]), "NaN"),
        (dict(points=[1.0], smallest=0.0), "positive"),
        (dict(points=[1.0], load_history=None), "function"),
    ],
)
def test_nonsense_is_refused(arguments, message):
    """Points that do not rise, and what is no function of one number."""
    scene = scenes.block(cells=(2, 2, 2))
    with pytest.raises(ValueError, match=message):
        dc.advance(scene.problem, **{"load_history": lambda t: None} | arguments)
