# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""How many solutions the steps of a punch have, and which of them each solver finds.

Existence is certain for an elastic body, uniqueness is not. Every step is condensed to its contact nodes and
solved from many random starts; each answer is judged by NumPy functions of the tests. The fixed point then
does the step from the same history, which is Newton's; solution 0 is the one that Newton's method found there.

    python -m benchmarks.solutions        # the block of tests/step/test_solutions.py, and the coarse punch
"""

from __future__ import annotations

import contextlib
import tempfile

import numpy as np

import dolfinx_contact as dc
from benchmarks.measurement import SOLVERS
from benchmarks.tables import table
from mechanics import judge, scenes
from studies.punch import Parameters, Punch, programme

TOL, APART = 1e-10, 1e-6  # solutions differ by more than APART of the largest reaction
CROSSED = dict(mu=(1.0, 0.1), p=(0.01, 1.0))


def random_start(rng, r: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """Reactions: anywhere in the cone, slipping anywhere under the normal ones of ``r``, or ``r`` with noise."""
    kind, normal = rng.integers(3), r[:, 2]
    if kind == 2:
        return r * (1 + 10 ** rng.uniform(-2, 0.5) * rng.normal(size=r.shape))
    angle, radius = rng.uniform(0, 2 * np.pi, len(r)), np.ones(len(r))
    if kind == 0:
        normal = normal.mean() * rng.exponential(size=len(r)) * rng.choice([0, 1, 3], len(r))
        radius = np.sqrt(rng.uniform(size=len(r)))
    direction = np.column_stack((mu[0] * np.cos(angle), mu[1] * np.sin(angle)))
    return np.column_stack((direction * (radius * normal)[:, None], normal))


def solutions(W, q, friction, first, starts: int, seed: int) -> list[list]:
    """``[reactions, how many starts led to them, judged errors]`` of each solution, the first one first."""
    rng, newton, found = np.random.default_rng(seed), dc.CondensedNewton(fallbacks=False), []
    number(found, first, W, q, friction)
    for _ in range(starts):
        start = random_start(rng, first, friction.mu)
        with contextlib.suppress(dc.CondensedNotConverged):
            r = dc.solve_condensed(W, q, friction, solver=newton, tol=TOL, r0=start).reaction
            found[number(found, r, W, q, friction)][1] += 1
    return found


def number(found, r, W, q, friction) -> int:
    """Which of the solutions found ``r`` is; a new one is judged, of law and slips over the reactions, and added."""
    apart = [np.abs(r - known).max() / np.abs(r).max() for known, *_ in found]
    if min(apart, default=np.inf) <= APART:
        return int(np.argmin(apart))
    found.append([r.copy(), 0, judge.condensed(W, q, friction.mu, friction.p, r, TOL).errors])
    return len(found) - 1


TITLES = "hits open stick error normal tangential work reactions_apart slips_apart".split()


def described(found, W, q, friction) -> str:
    """A table of the solutions; what is ``apart`` is the largest nodal difference to another one."""
    reactions = np.array([r for r, *_ in found])
    slips = np.array([(q + (W @ r.ravel()).reshape(q.shape))[:, :2] for r in reactions])
    lines = []
    for (r, hits, errors), slip in zip(found, slips):
        inside = np.linalg.norm(r[:, :2] / friction.mu, axis=1) < (1 - 1e-9) * r[:, 2]
        sums = r[:, 2].sum(), np.linalg.norm(r[:, :2], axis=1).sum(), -(r[:, :2] * slip).sum()
        pairs = (reactions, r), (slips, slip)
        apart = (np.abs(every - own).max() / np.abs(every).max() for every, own in pairs)
        numbers = (f"{value:.6g}" for value in (max(errors), *sums, *apart))
        lines.append([hits, (r[:, 2] == 0).sum(), inside.sum(), *numbers])
    return table(TITLES, lines)


def examine(make, programme: list, starts: list[int]) -> None:
    """Print for every step its solutions, and the number of the one that each map of the fixed point finds.

    Args:
        make: Gives for a solver a problem, and what moves its top to an entry of ``programme``.
        programme: Where the top is at the end of each step.
        starts: Random starts in each step.
    """
    leader, move = make(dc.CondensedNewton())
    others = {name: make(solver()) for name, solver in SOLVERS.items() if "fixed point" in name}
    contact, W = leader.contacts[0], None
    for k, (top, count) in enumerate(zip(programme, starts, strict=True)):
        with tempfile.NamedTemporaryFile(suffix=".npz") as checkpoint:
            leader.save(checkpoint.name)
            move(top)
            leader.solve()
            W = leader.bound().compliance() if W is None else W
            w = np.column_stack((contact.slip_increment, contact.gap))
            q = w - (W @ contact.reaction.ravel()).reshape(w.shape)
            condensed = W, q, contact.friction
            found, by = solutions(*condensed, contact.reaction, count, seed=k), {}
            by_newton = len(found)
            for name, (problem, move_other) in others.items():
                problem.load(checkpoint.name)
                move_other(top)
                try:
                    step = problem.solve()
                    which = number(found, problem.contacts[0].reaction, *condensed)
                    by[name] = f"{which} in {step.iterations}"
                except dc.NotConverged as failure:
                    by[name] = str(failure)
        said = f"{len(found)} solution(s), {by_newton} of them from {count} starts; {by}"
        print(f"{k + 1:3} {top}: {said}\n{described(found, *condensed)}", flush=True)


def punch(solver):
    """The coarse punch."""
    made = Punch(Parameters(refine=-1, tol=TOL), solver=solver, friction=CROSSED)
    return made.problem, made.move_top


def block(solver):
    """A block of 32 bricks."""
    made = scenes.block(**CROSSED, solver=solver, tol=TOL)
    return made.problem, lambda top: made.move_top(*top)


if __name__ == "__main__":
    # Pressed and dragged, then dragged back: a step of tests/step/test_solutions.py.
    examine(block, [(0.004, 0.002, -0.01), (-0.004, 0.002, -0.01)], [0, 200])
    steps = programme(Parameters())
    examine(punch, steps, [20] * len(steps))
