# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Ctrl-C and monitors: whoever waits is answered in the midst of a solve, and the last state is in place."""

import gc
import signal
from contextlib import contextmanager
from time import perf_counter

import numpy as np
import pytest
import scenes

import dolfinx_contact as dc
from dolfinx_contact.support.collective import by_first_rank

COMM = scenes.COMM
ALONE = pytest.mark.skipif(COMM.size > 1, reason="a signal reaches one process")


@contextmanager
def interrupted(seconds: float):
    """Ctrl-C after so many seconds, which has to arrive as what it is.

    Python drops what is raised while it frees objects, and other tests leave problems to be freed: they are freed before.
    NumPy drops what is raised while it looks for an attribute: as a user would, it is pressed again some time later.
    """
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    gc.collect()
    gc.disable()
    signal.setitimer(signal.ITIMER_REAL, seconds, 30.0)
    try:
        with pytest.raises(KeyboardInterrupt):
            yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        gc.enable()
        signal.signal(signal.SIGALRM, before)


def endless(n: int):
    """W, q of contacts that press against each other in pairs, the more the larger their reactions, so that every method is
    tried: of 300 contacts for more than half a minute."""
    random = np.random.default_rng(0)
    slips = random.normal(size=(3 * n, 3 * n // 2))
    slips[2::3] = 0.0
    W = slips @ slips.T / (3 * n)
    normal = np.arange(2, 3 * n, 3)
    W[normal, normal] = 1.0
    W[normal[::2], normal[1::2]] = W[normal[1::2], normal[::2]] = -1.001
    q = np.full((n, 3), -1.0)
    q[:, :2] = random.normal(size=(n, 2))
    return W, q


@pytest.mark.slow
@ALONE
def test_an_interrupt_ends_the_condensed_solver():
    """In the kernel, too, Ctrl-C is answered: long before a search that has half a minute left ends by itself."""
    W, q = endless(300)
    friction, solver = (
        dc.Friction((0.9, 0.3), p=(0.01, 1.0)),
        dc.CondensedNewton(max_seconds=30.0),
    )
    start = perf_counter()
    with interrupted(1.0):
        dc.solve_condensed(W, q, friction, solver=solver)
    assert (
        perf_counter() - start < 25.0
    )  # 0.04 s after the second, on a machine with nothing else to do


@ALONE
@pytest.mark.parametrize(
    "solver",
    [
        dc.CondensedNewton(),
        dc.FixedPoint(max_iterations=10**9),
    ],
)
def test_an_interrupt_leaves_the_last_state(solver, monkeypatch):
    """Wherever a step is, in the kernel or the fixed point: Ctrl-C ends it, and the next solve is what it would have been."""
    from dolfinx_contact.solvers import search

    scene = scenes.block(cells=(2, 2, 2), solver=solver)
    scene.move_top(0, 0, -0.01)
    scene.problem.solver = dc.CondensedNewton()
    scene.problem.solve()
    scene.problem.solver = solver
    kept, reaction = scene.u.x.array.copy(), scene.contact.reaction
    scene.move_top(0.002, 0.001, -0.01)
    if isinstance(solver, dc.CondensedNewton):

        class Slow:  # as if it were one of 300 contacts
            dim = 3

            def solve(self, **_):
                W, q = endless(300)
                return dc.solve_condensed(W, q, dc.Friction((0.9, 0.3), p=(0.01, 1.0)))

        monkeypatch.setattr(scene.problem.bound(), "operator", Slow())
    else:  # no error is small enough: it goes on for ever
        monkeypatch.setattr(search.Search, "goes_on", property(lambda self: True))
    with interrupted(0.5):
        scene.problem.solve()
    assert np.array_equal(scene.u.x.array, kept) and scene.contact.reaction is reaction
    monkeypatch.undo()
    scene.problem.solver = dc.CondensedNewton()
    scene.problem.solve()


@ALONE
def test_an_interrupt_ends_an_iterative_solve_at_once():
    """Ctrl-C during a linear solve that would go on for hours is answered, and leaves PETSc so that it can go on."""
    options = {
        "ksp_type": "richardson",
        "ksp_richardson_scale": 1e-15,
        "ksp_max_it": 10**8,
        "pc_type": "jacobi",
    }
    scene = scenes.block(petsc_options=options, solver=dc.FixedPoint())
    scene.move_top(0, 0, -0.01)
    for _ in range(2):
        with interrupted(0.5):
            scene.problem.solve()
        assert not scene.u.x.array.any()


def test_an_interrupt_of_the_first_rank_is_one_of_all():
    """What ends the work of the first rank ends the waiting of the others."""

    def work(_):
        raise KeyboardInterrupt

    for tell in (None, print):
        with pytest.raises(KeyboardInterrupt):
            by_first_rank(COMM, work, tell)
    said = []
    assert (
        by_first_rank(COMM, lambda monitor: monitor(1, 2), lambda *line: said.append(line)) is None
    )
    assert said == [(1, 2)]


@pytest.mark.parametrize("mu", [0.3, 0.0])
def test_the_monitor_sees_every_iteration_of_the_kernel(mu):
    """Every iterate of the condensed problem is told on all ranks, with all nodes by status; and nothing is found that
    would not have been found without."""
    records, reactions = [], []
    for monitored in (False, True):
        scene, seen = scenes.block(cells=(4, 4, 2), mu=mu, p=None, solver=dc.CondensedNewton()), []
        if monitored:
            scene.problem.monitor = lambda *line: seen.append(line)  # noqa: B023
        scene.move_top(0.002, 0.001, -0.01)
        records.append(scene.problem.solve())
        reactions.append(scene.contact.reaction)
    assert records[0].iterations == records[1].iterations > 0
    assert len(seen) > records[1].iterations
    assert [line[0] for line in seen] == list(range(len(seen)))
    assert all(sum(line[2]) == 25 for line in seen)
    assert COMM.bcast(seen, root=0) == seen
    if COMM.size == 1:
        assert np.array_equal(*reactions)


@pytest.mark.parametrize("branch", ["newton", "free"])
def test_iterations_are_none_only_where_nothing_was_to_do(branch):
    """An answer that was not there at the start took at least one iteration."""
    nodes = {"newton": 4, "free": 2}[branch]
    q = np.full((nodes, 3), 0.1 if branch == "free" else -0.1)
    found = dc.solve_condensed(np.eye(3 * nodes), q, dc.Friction(0.3))
    assert found.branch == branch
    assert (found.iterations > 0) == (branch != "free")
