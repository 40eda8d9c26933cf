# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The judge accepts exact answers, rejects wrong ones, whatever the units, and its tight solutions are tight."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from mechanics import judge
from mechanics.condensed import random_pair, random_problem
from mechanics.judge_solver import ByStiffness

TOL = 1e-8
LAWS = {"A": (0.2, 0.2), "B": ((0.3, 0.15), (0.3, 0.15)), "C": ((0.3, 0.15), (0.05, 0.2))}
KINDS = ["open", "stick", "slip", "slip", "stick", "open", "slip"]


def manufactured(law="C", soft=0.0, seed=0, force=1.0, length=1.0, kinds=KINDS):
    """A random body with a state put into it: a stiffness, nodes, loads and reactions that obey the law.

    Twenty nodes held together by random springs; with ``soft`` springs of that ratio hold them, else the last three
    nodes are fixed.
    """
    rng = np.random.default_rng(seed)
    mu, p = (np.broadcast_to(part, 2).astype(float) for part in LAWS[law])
    n, nodes = len(kinds), 20
    B = rng.integers(-8, 9, size=(90, nodes, 3))
    B = (nodes * B - B.sum(axis=1, keepdims=True)).reshape(90, -1) / 128  # translations: no force
    K = B.T @ B + soft * np.eye(60)  # without any rounding if soft is a power of two
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    fixed = np.arange(0) if soft else np.arange(51, 60)
    contact = 3 * np.arange(n)[:, None] + np.arange(3)
    pairs = [random_pair(rng, mu, p, kind, 1.0, 1e-2) for kind in kinds]
    r, w = (np.array(part) for part in zip(*pairs))
    before = 1e-2 * rng.normal(size=(n, 3))
    gap0 = rng.uniform(0, 1e-2, size=n)
    u = 1e-2 * rng.normal(size=60)
    u[contact] = np.column_stack([before[:, :2] + w[:, :2], w[:, 2] - gap0]) @ turn
    start = np.zeros(60)
    start[contact] = before @ turn
    forces = np.zeros(60)
    forces[contact] = r @ turn
    f = (K.astype(np.longdouble) @ u - forces).astype(float)
    body = judge.Body(force / length * K, contact, fixed, turn, length * gap0, length, mu, p)
    return SimpleNamespace(
        body=body, K=K, r=force * r, u=length * u, f=force * f, before=length * start,
        verdict=lambda s: s.body.verdict(s.u, s.r, s.f, s.before, s.u[s.body.fixed], TOL),
    )  # fmt: skip


def judged(scene):
    return scene.verdict(scene)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("soft", [0.0, 2**-10, 2**-30])
@pytest.mark.parametrize("force, length", [(1, 1), (1e12, 1e-6), (1e-9, 1e9)])
def test_exact_answers_are_accepted(law, soft, force, length):
    """An answer that obeys every law is accepted at the smallest tolerance, in all units, softly held or not."""
    for seed in range(4):
        scene = manufactured(law, soft, seed, force, length)
        found = judged(scene)
        assert found.accepts(1e-13), found
        assert found.rounding < 1e-12  # and not by way of the allowance for rounding


def scaled(scene):
    scene.r = 1.001 * scene.r


def turned(scene):
    node = KINDS.index("slip")
    local = scene.body.local(scene.u)
    before = scene.body.local(scene.before)
    slip = local[node, :2] - before[node, :2]
    c, s = np.cos(1e-3), np.sin(1e-3)
    local[node, :2] = before[node, :2] + np.array([[c, -s], [s, c]]) @ slip
    move_to(scene, local)


def move_to(scene, local):
    """Displacements of contact nodes with loads that keep equilibrium: only the law is violated."""
    scene.u[scene.body.contact] = local @ scene.body.frame
    forces = np.zeros_like(scene.u)
    forces[scene.body.contact] = scene.r @ scene.body.frame
    scene.f = np.array(scene.body.relation.K @ scene.u.astype(np.longdouble) - forces, dtype=float)


def one_force_moved(scene):
    scene.r[1], scene.r[4] = scene.r[4].copy(), scene.r[1].copy()


def stuck_node_moves(scene):
    local = scene.body.local(scene.u)
    local[KINDS.index("stick"), 0] += 1e-6
    move_to(scene, local)


def penetrates(scene):
    local = scene.body.local(scene.u)
    local[KINDS.index("open"), 2] = -scene.body.gap0[KINDS.index("open")] - 1e-6
    move_to(scene, local)


def force_at_a_gap(scene):
    scene.r[KINDS.index("open"), 2] = 1e-5 * np.abs(scene.r).max()
    move_to(scene, scene.body.local(scene.u))


def pulls(scene):
    scene.r[KINDS.index("stick")] *= -1e-3
    move_to(scene, scene.body.local(scene.u))


def outside_the_cone(scene):
    scene.r[KINDS.index("slip"), :2] *= 1 + 1e-4
    move_to(scene, scene.body.local(scene.u))


def support_moved(scene):
    scene.verdict = lambda s: s.body.verdict(
        s.u, s.r, s.f, s.before, s.u[s.body.fixed] * (1 + 1e-4), TOL
    )


WRONG = [scaled, turned, one_force_moved, stuck_node_moves, penetrates, force_at_a_gap, pulls, outside_the_cone, support_moved]  # fmt: skip


@pytest.mark.parametrize("spoil", WRONG, ids=lambda f: f.__name__)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("soft", [0.0, 2**-30])
def test_wrong_answers_are_rejected(spoil, law, soft):
    """Each of the ways to be slightly wrong is rejected at 1e-8, by the conditions alone, without a comparison."""
    for seed in range(3):
        scene = manufactured(law, soft, seed)
        if spoil is support_moved and soft:
            continue  # nothing is fixed
        spoil(scene)
        found = judged(scene)
        assert not found.accepts(TOL)
        assert found.error > judge.DEFECT * TOL, found


def test_zero_answers_that_penetrate_are_rejected():
    """A body moved into the plane without any force: nothing acts, and it is wrong all the same."""
    scene = manufactured(soft=0.0)
    scene.r[:], scene.f[:] = 0, 0
    rigid = np.tile(-0.02 * scene.body.frame[2], 20)
    scene.u, scene.before = rigid, np.zeros_like(scene.before)
    assert not judged(scene).accepts(TOL)
    scene.u = -rigid  # off the plane: right
    assert judged(scene).accepts(TOL)


def test_stiffness_of_the_wrong_sign_is_rejected():
    """Minus the stiffness, all nodes open and deep in the plane."""
    good = manufactured()
    body = good.body
    contact, mu, p = body.contact, body.mu, body.p
    scene = SimpleNamespace(**vars(good))
    scene.body = judge.Body(-good.K, contact, body.fixed, body.frame, body.gap0, 1.0, mu, p)
    scene.f = -good.f
    found = judged(scene)
    assert not found.accepts(TOL) and found.notes
    open_nodes = [k for k, kind in enumerate(KINDS) if kind == "open"]
    local = scene.body.local(scene.u)
    local[open_nodes, 2] = -1.0
    move_to(scene, local)
    assert judged(scene).error > judge.DEFECT * TOL


@pytest.mark.parametrize("soft", [0.0, 2**-10, 2**-30])
@pytest.mark.parametrize("law", LAWS)
def test_tight_solutions_are_found_again(law, soft):
    """From a state that is off by 1e-5 Newton's method returns to the one that was put in, to 1e-11 of the forces."""
    for seed in range(4):
        scene = manufactured(law, soft, seed)
        body, rng = scene.body, np.random.default_rng(seed)
        off = scene.u * (1 + 1e-5 * rng.normal(size=scene.u.size))
        off[body.fixed] = scene.u[body.fixed]
        start = partial(body.relation.start, off, scene.f, body.gap0, body.local(scene.before))
        tight = judge.polished(body.relation, start, body, 1e-12 * judge.norm(scene.r))
        assert tight is not None
        assert judge.norm(tight - scene.r) < 1e-11 * judge.norm(scene.r)


def test_soft_springs_are_condensed_without_loss():
    """Forces of a rigid motion, 2^-30 of the stiffness: condensed to the contact nodes they keep seven digits."""
    scene = manufactured(soft=2**-30)
    relation = scene.body.relation
    assert isinstance(relation, ByStiffness)
    rigid = np.tile([1.0, 2.0, 3.0], 20)
    relation.start(rigid, np.zeros(60), scene.body.gap0, np.zeros((len(KINDS), 3)))
    r, _, _ = relation.state()
    total = np.asarray(r, float).sum(axis=0) @ scene.body.frame
    # All twenty nodes' springs, except for what the body gives way to them.
    assert np.abs(total / (20 * 2**-30 * np.array([1, 2, 3])) - 1).max() < 1e-6


@pytest.mark.parametrize("seed", range(30))
def test_condensed_problems(seed):
    """The solution that was put into a random condensed problem is accepted, and with 1e-4 more force rejected."""
    problem = random_problem(seed)
    if not problem.r.any():
        return
    arguments = problem.W, problem.q, problem.mu, problem.p
    assert judge.condensed(*arguments, problem.r, TOL).accepts(TOL)
    assert not judge.condensed(*arguments, 1.0001 * problem.r, TOL).accepts(TOL)
