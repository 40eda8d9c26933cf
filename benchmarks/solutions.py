# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""How many solutions the steps of a punch have, and which of them each solver finds.

Existence is certain for an elastic body, uniqueness is not. Every step is condensed to its contact nodes and
solved from many random starts; each answer is judged by NumPy functions of the tests. The fixed point then
does the step from the same history, which is Newton's; solution 0 is the one that Newton's method found there.

    python -m benchmarks.solutions        # the block of tests/test_solutions.py, and the coarse punch
"""

from __future__ import annotations

import tempfile
from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np

from mechanics import judge, scenes
from studies.punch import CASES, Parameters, Punch, programme

TOL, APART = 1e-10, 1e-6  # solutions differ by more than APART of the largest reaction
CROSSED = dict(mu=(1.0, 0.1), p=(0.01, 1.0))
SOLVERS = {
    "fixed point": dc.FixedPoint,
    "fixed point, paper's map": lambda: dc.FixedPoint(map="bipotential"),
}


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
    rng, newton = np.random.default_rng(seed), dc.CondensedNewton(fallbacks=False)
    found = [[first, 0, errors(W, q, friction, first)]]
    for _ in range(starts):
        start = random_start(rng, first, friction.mu)
        try:
            r = dc.solve_condensed(W, q, friction, newton, TOL, r0=start).reaction
        except dc.CondensedNotConverged:
            continue
        found[number(found, r, W, q, friction)][1] += 1
    return found


def errors(W, q, friction, r) -> tuple[float, float]:
    """Of the law and of slips, over the reactions, by the judge of the tests."""
    return judge.condensed(W, q, friction.mu, friction.p, r, TOL).errors


def number(found, r, W, q, friction) -> int:
    """Which of the solutions found ``r`` is; a new one is judged and added."""
    apart = [np.abs(r - known).max() / np.abs(r).max() for known, *_ in found]
    if min(apart) <= APART:
        return int(np.argmin(apart))
    found.append([r.copy(), 0, errors(W, q, friction, r)])
    return len(found) - 1


def described(found, W, q, friction) -> list[dict]:
    """What a reader wants to know of each solution; ``apart`` is the largest nodal difference to another one."""
    reactions = np.array([r for r, *_ in found])
    slips = np.array([(q + np.tensordot(W.reshape(*q.shape, *q.shape), r, 2))[:, :2] for r in reactions])  # fmt: skip
    rows = []
    for (r, hits, errors), slip in zip(found, slips):
        inside = np.linalg.norm(r[:, :2] / friction.mu, axis=1) < (1 - 1e-9) * r[:, 2]
        rows.append(dict(
            hits=hits, error=float(max(errors)), open=int((r[:, 2] == 0).sum()), stick=int(inside.sum()),
            normal=float(r[:, 2].sum()), tangential=float(np.linalg.norm(r[:, :2], axis=1).sum()),
            work=float(-(r[:, :2] * slip).sum()), apart=float(np.abs(reactions - r).max() / np.abs(reactions).max()),
            slips_apart=float(np.abs(slips - slip).max() / np.abs(slips).max()),
        ))  # fmt: skip
    return rows


def examine(make, programme: list, starts: list[int], report=print) -> list[dict]:
    """One record per step; ``by`` has the number of the solution that each map of the fixed point finds.

    Args:
        make: Gives for a solver a scene: ``problem``, ``contact``, and ``move``, which takes an entry of ``programme``.
        programme: Where the top is at the end of each step.
        starts: Random starts in each step.
    """
    others = {name: make(solver()) for name, solver in SOLVERS.items()}
    leader, records, W = make(dc.CondensedNewton()), [], None
    friction = leader.contact.friction
    for k, (top, count) in enumerate(zip(programme, starts, strict=True)):
        with tempfile.NamedTemporaryFile(suffix=".npz") as checkpoint:
            leader.problem.save(checkpoint.name)
            leader.move(top)
            leader.problem.solve()
            contact, by = leader.contact, {}
            W = leader.problem.bound().compliance() if W is None else W
            w = np.column_stack((contact.slip_increment, contact.gap))
            q = w - (W @ contact.reaction.ravel()).reshape(w.shape)
            found = solutions(W, q, friction, contact.reaction.copy(), count, seed=k)
            by_newton = len(found)
            for name, scene in others.items():
                scene.problem.load(checkpoint.name)
                scene.move(top)
                try:
                    step = scene.problem.solve()
                    by[name] = dict(number=number(found, scene.contact.reaction, W, q, friction), iterations=step.iterations)  # fmt: skip
                except dc.NotConverged as failure:
                    by[name] = dict(number=None, iterations=failure.step.iterations, error=failure.step.error)  # fmt: skip
        record = dict(
            step=k + 1, top=top, nodes=len(contact.nodes), starts=count, by_newton=by_newton,
            solutions=described(found, W, q, friction), by=by,
        )  # fmt: skip
        records.append(record)
        report(f"{k + 1:3} {top}: {len(found)} solution(s), {by_newton} of them from {count} starts; {by}", flush=True)  # fmt: skip
    return records


def punch(case: str, refine: int):
    """The punch, and its programme."""
    CASES["crossed"] = CROSSED
    parameters = Parameters(case=case, refine=refine, tol=TOL)

    def make(solver):
        made = Punch(parameters, solver=solver)
        return SimpleNamespace(problem=made.problem, contact=made.contact, move=lambda top: setattr(made.approach, "value", -top))  # fmt: skip

    return make, programme(parameters)


def block():
    """A block of 32 bricks, pressed and dragged, then dragged back; a step of tests/test_solutions.py."""

    def make(solver):
        made = scenes.block(**CROSSED, solver=solver, tol=TOL)
        return SimpleNamespace(problem=made.problem, contact=made.contact, move=lambda top: made.move_top(*top))  # fmt: skip

    return make, [(0.004, 0.002, -0.01), (-0.004, 0.002, -0.01)]


if __name__ == "__main__":
    make, steps = block()
    examine(make, steps, [0, 200])
    make, steps = punch("crossed", refine=-1)
    examine(make, steps, [20] * len(steps))
