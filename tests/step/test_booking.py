# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""After any exception nothing has happened, also while a step that has converged is booked: what is shown, and what the next step makes of it."""

import signal
import sys
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
import scenes
import two_bodies

import dolfinx_contact as dc
from dolfinx_contact import problem as module
from dolfinx_contact.checks.scene import SlipTurns, WearsInLeaps

COMM = scenes.COMM
ALONE = pytest.mark.skipif(COMM.size > 1, reason="a signal reaches one process")


def worn_blocks():
    """Two bodies, both worn."""
    scene = two_bodies.blocks(
        "quadrilateral", cells=((3, 3), (4, 3)), size=(1.0, 2.0), sliding="large"
    )
    scene.contact.wear = dc.Wear(1e-9, opposite=3e-9)
    return scene.problem, lambda k: scene.way.value.__setitem__(slice(None), (0.05 * k, -0.002))


def turning_plane():
    """A block on a plane that turns, with friction that follows the path, and wear."""
    friction = dc.Friction(lambda x, slip_path: 0.3 + slip_path)
    scene = scenes.block(cells=(3, 3, 2), mu=0.3, p=None)
    scene.contact.friction, scene.contact.wear = friction, dc.Wear(1e-9)

    def to(k):
        scene.move_top(0.002 * k, 0, -0.01)
        scene.surface.rotation = (0, 0, 0.05 * k)

    return scene.problem, to


SCENES = dict(worn_blocks=worn_blocks, turning_plane=turning_plane)


class Run:
    """A problem after two steps, which can be had again; what a step shows, and what the next one makes of it."""

    def __init__(self, made):
        self.problem, self.to = made()
        for k in (0, 1):
            self.to(k)
            self.problem.solve()
        self._start = self.problem.snapshot()
        self.undone = self.shown(), self.next()
        self.again()
        self.to(2)
        self.problem.solve()
        self.done = self.shown(), self.next()
        self.again()

    def again(self):
        self.problem.restore(self._start)
        self.to(2)

    def shown(self):
        u, sums = self.problem.u.x.array, []
        for c in self.problem.contacts:
            sums += [
                c.reaction.sum(),
                c.gap.sum(),
                c.slip_path.sum(),
                c.dissipation.sum(),
                c.wear_depth.sum(),
            ]
        return COMM.allreduce(np.array([np.abs(u).sum(), *sums]))

    def next(self):
        self.to(3)
        self.problem.solve()
        return self.shown()

    def is_(self, whole):
        found = self.shown(), self.next()
        return all(np.allclose(a, b, 1e-6, 1e-12) for a, b in zip(found, whole))


def at_line(k, act, first="advanced", file="accepted.py"):
    """Do something at the k-th line that the package runs from the booking of a step on, or from another function on; returns how many there were."""
    seen = SimpleNamespace(lines=0, booking=False)

    def lines(frame, event, _):
        if event == "line":
            seen.lines += 1
            if seen.lines == k:
                sys.settrace(None)
                act()
        return lines

    def calls(frame, event, _):
        code = frame.f_code
        seen.booking |= code.co_name == first and code.co_filename.endswith(file)
        return lines if seen.booking and "dolfinx_contact" in code.co_filename else None

    sys.settrace(calls)
    return seen


class Broken(Exception):
    pass


def breaks():
    raise Broken("in the midst")


@ALONE
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("act, kind", [(breaks, Broken), (lambda: signal.raise_signal(signal.SIGINT), KeyboardInterrupt)])  # fmt: skip
def test_an_exception_at_every_line_of_booking(scene, act, kind):
    """Ctrl-C or an error anywhere in it: the step has not been done, or has been done wholly; never some of it."""
    run, k, stride = Run(SCENES[scene]), 0, 7
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        seen = at_line(-1, breaks)
        run.problem.solve()
        sys.settrace(None)
        assert seen.lines > 200
        for k in range(1, seen.lines + 1, stride):
            run.again()
            at_line(k, act)
            try:
                run.problem.solve()
                raised = False
            except (
                kind,
                DeprecationWarning,
            ):  # NumPy makes one of what is raised while it compares
                raised = True
            finally:
                sys.settrace(None)
            assert run.is_(run.undone if raised else run.done), f"line {k} of {seen.lines}"
    finally:
        signal.signal(signal.SIGINT, before)


@ALONE
@pytest.mark.parametrize("scene", SCENES)
def test_an_exception_at_any_line_of_a_step(scene):
    """An error at any of 60 random lines of it: nothing has happened to contacts, surfaces, u and the accepted state, and the step can be made."""
    run, called = Run(SCENES[scene]), []
    problem = run.problem
    seen = at_line(-1, breaks, "solve", "problem.py")
    problem.solve()
    sys.settrace(None)
    assert seen.lines > 3000
    for k in np.random.default_rng(0).integers(1, seen.lines, 60):
        run.again()
        before = [(c.history, c.present, c.friction, c.surface.stands) for c in problem.contacts]
        u, accepted = problem.u.x.array.copy(), problem.snapshot()
        called.clear()
        at_line(k, lambda: called.append(0) or breaks(), "solve", "problem.py")
        try:
            problem.solve()
            assert not called, f"line {k} of {seen.lines}: nothing was raised"
            continue  # this step has fewer lines
        except (Broken, DeprecationWarning):  # NumPy makes one of what is raised while it compares
            pass
        finally:
            sys.settrace(None)
        booked = problem.accepted.x is not accepted.x
        if booked:  # raised once all was done
            assert run.is_(run.done)
            continue
        for contact, (history, present, friction, stands) in zip(problem.contacts, before):
            assert contact.history is history and contact.present is present
            assert contact.friction is friction
            assert all(map(np.array_equal, contact.surface.stands[:2], stands[:2]))
        assert np.array_equal(problem.u.x.array, u), f"line {k} of {seen.lines}"
    run.again()
    problem.solve()
    assert run.is_(run.done)


@pytest.mark.ranks
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("on", ["all", "last"])
def test_an_exception_while_ranks_book(scene, on, monkeypatch):
    """On all ranks, or on one alone after what it tells others: all raise it, and the step has not been done."""
    run = Run(SCENES[scene])
    if on == "all" or COMM.rank == COMM.size - 1:
        last = SlipTurns.run
        monkeypatch.setattr(SlipTurns, "run", lambda *given: last(*given) or breaks())
    with pytest.raises(Broken):
        run.problem.solve()
    monkeypatch.undo()
    assert run.is_(run.undone)
    run.again()
    run.problem.solve()
    assert run.is_(run.done)


TOLD = ["warn_of_rounding", "warn_of_inaccurate_reactions"]


@pytest.mark.ranks
@pytest.mark.parametrize("name", [*TOLD, "run"])
def test_every_warning_as_an_error(name, monkeypatch):
    """Raised, it undoes the step, and it is still to be told: the next time it is."""
    run, owner = Run(worn_blocks), WearsInLeaps if name == "run" else module

    def warn(*arguments):
        if name == "run":
            return "something"
        warnings.warn("something", stacklevel=2)

    def told():
        return run.problem.checks, vars(run.problem)["_over"]

    monkeypatch.setattr(owner, name, warn)
    flags = told()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(UserWarning, match="something"):
            run.problem.solve()
    assert flags == told() and np.allclose(run.shown(), run.undone[0], 1e-6, 1e-12)
    with pytest.warns(UserWarning, match="something"):
        run.problem.solve()
    assert np.allclose(run.shown(), run.done[0], 1e-6, 1e-12)
