# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""How many solutions the steps of a punch have, and which of them each solver finds.

Existence is certain for an elastic body, uniqueness is not. Every step is condensed to its contact nodes and
solved from many random starts; each answer is judged by NumPy functions of the tests. The fixed point then
does the step from the same history, which is Newton's; solution 0 is the one that Newton's method found there.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "demos"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from condensed_scenes import judge
from punch import CASES, Parameters, Punch, programme

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
    found = [[first, 0, judge(W, q, friction.mu, friction.p, first)]]
    for _ in range(starts):
        start = random_start(rng, first, friction.mu)
        try:
            r = dc.solve_condensed(W, q, friction, newton, TOL, r0=start).reaction
        except dc.CondensedNotConverged:
            continue
        found[number(found, r, W, q, friction)][1] += 1
    return found


def number(found, r, W, q, friction) -> int:
    """Which of the solutions found ``r`` is; a new one is judged and added."""
    apart = [np.abs(r - known).max() / np.abs(r).max() for known, *_ in found]
    if min(apart) <= APART:
        return int(np.argmin(apart))
    found.append([r.copy(), 0, judge(W, q, friction.mu, friction.p, r)])
    return len(found) - 1


def examine(case: str, refine: int, steps: int | None, starts: int, report=print) -> list[dict]:
    """One record per step; ``by`` has the number of the solution that each map of the fixed point finds."""
    parameters = Parameters(case=case, refine=refine, tol=TOL)
    punches = {name: Punch(parameters, solver=make()) for name, make in SOLVERS.items()}
    leader, records, W = Punch(parameters, solver=dc.CondensedNewton()), [], None
    friction = leader.contact.friction
    for k, displacement in enumerate(programme(parameters)[:steps]):
        with tempfile.NamedTemporaryFile(suffix=".npz") as checkpoint:
            leader.problem.save(checkpoint.name)
            leader.press(displacement)
            contact, by = leader.contact, {}
            W = leader.problem._condensed.compliance() if W is None else W
            w = np.column_stack((contact.slip_increment, contact.gap))
            q = w - (W @ contact.reaction.ravel()).reshape(w.shape)
            found = solutions(W, q, friction, contact.reaction.copy(), starts, seed=k)
            for name, punch in punches.items():
                punch.problem.load(checkpoint.name)
                try:
                    punch.press(displacement)
                    by[name] = number(found, punch.contact.reaction, W, q, friction)
                except dc.NotConverged as failure:
                    by[name] = f"not converged, {failure.step.error:.0e}"
        largest = np.abs(found[0][0]).max()
        spread = max(np.abs(r - found[0][0]).max() / largest for r, *_ in found)
        sums = [np.linalg.norm(r[:, :2], axis=1).sum() for r, *_ in found]
        record = dict(
            step=k + 1, displacement=displacement, solutions=len(found), hits=[n for _, n, _ in found],
            spread=spread, sums=sums, errors=[e for *_, e in found], by=by,
        )  # fmt: skip
        records.append(record)
        worst = np.max(record["errors"])
        report(
            f"{k + 1:3} {displacement:.3f} mm: {sum(record['hits'])} of {starts} starts converged, {len(found)} "
            f"solution(s), errors <= {worst:.0e}, apart {spread:.1e}, sum|r_t| {min(sums):.7g} to {max(sums):.7g}; {by}"
        )
    return records


def main(argv=None) -> list[dict]:
    parser = argparse.ArgumentParser(description=__doc__)
    CASES["crossed"] = CROSSED
    parser.add_argument("--case", choices=CASES, default="crossed")
    parser.add_argument("--refine", type=int, default=-1)
    parser.add_argument("--steps", type=int, help="only the first ones")
    parser.add_argument("--starts", type=int, default=200)
    options = parser.parse_args(argv)
    return examine(options.case, options.refine, options.steps, options.starts)


if __name__ == "__main__":
    main()
