# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What each method of the condensed solver is for: the same problems without it.

    python -m benchmarks.condensed_ablation [--every 1] [--without proximal_point "newton, 3 rho_t+newton, 0.3 rho_t"]

Three sets of problems: ``bodies``, the condensed problems of every n-th scene of the stress matrix, as its runs with
``CondensedNewton`` meet them; ``piles``, the family of ``rigid_family`` below 300 contacts; ``single``, one contact of
any compliance and law.  First all are solved with all methods; then, for each list of names, those again in which one
of the named methods was tried.  A method stays if without it more than one in 300 problems of bodies is lost, or more
than one in a hundred of the others.  The record holds a line for each problem that a run tells apart.
"""

from __future__ import annotations

import argparse
import json
import pickle
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np

import dolfinx_contact as dc
from benchmarks import rigid_family
from benchmarks.measurement import commit, now
from benchmarks.stress import matrix
from benchmarks.stress.rigs import corner_scenes, rig_scenes
from benchmarks.stress.scenes import scenes
from dolfinx_contact.solvers.condensed import body as condensed
from dolfinx_contact.solvers.condensed import newton as condensed_newton
from dolfinx_contact.solvers.condensed.kernel import condensed_operator

LARGEST = 300  # contacts of a pile
LIMITS = dict(max_iterations=200_000, newton_iterations=60, fallbacks=True)


class Recorder:
    """An operator that keeps the problems that it is given: those that Newton's method alone does not solve."""

    def __init__(self, found, name, W, dim, tied=0):
        self._found, self._name, self._problem = found, name, dict(W=W, dim=dim, tied=tied)
        self._operator, self._prepared = condensed_operator(W, dim, tied), False

    def __getattr__(self, name):
        return getattr(self._operator, name)

    def prepare(self):
        self._prepared = True
        return self._operator.prepare()

    def solve(self, **given):
        answer = self._operator.solve(**given)
        self._found["solved"][answer.branch] += 1
        if given["fallbacks"] and answer.branch not in ("free", "newton"):
            kept = {k: v for k, v in given.items() if k not in ("monitor", "max_seconds")}
            name = f"{self._name} #{sum(self._found['solved'].values())}"
            problem = self._problem | dict(prepared=self._prepared, given=kept, name=name)
            self._found["problems"].append(problem)
        return answer


def from_bodies(every: int) -> dict:
    """Problems of the stress matrix that need more than Newton's method, and the count of all by what solved them."""
    found = dict(problems=[], solved=Counter())
    chosen = (scenes() + rig_scenes() + corner_scenes())[::every]
    for scene in chosen:

        def recorded(W, dim, tied=0, name=f"{scene.group}: {scene.name}"):
            return Recorder(found, name, W, dim, tied)

        with (
            patch.object(condensed, "condensed_operator", recorded),
            patch.object(condensed_newton, "condensed_operator", recorded),
        ):
            matrix.run(scene, dc.CondensedNewton(max_seconds=20))
    return found


def given(q, mu, p=None, tol=1e-8) -> dict:
    """Arguments of the kernel's ``solve``."""
    return dict(mu=mu, p=p, q=q.ravel(), starts=[], tol=tol, slip_tol=tol, **LIMITS)


def piles():
    """The family of rigid bodies."""
    for scene in rigid_family.scenes(LARGEST):
        name = f"{scene.kind} {len(scene.q)} seed {scene.seed}"
        mu = np.full(2, scene.mu)
        yield dict(
            W=scene.W.toarray(),
            dim=3,
            tied=0,
            prepared=False,
            name=name,
            given=given(scene.q, mu, mu),
        )


def single(count: int = 400):
    """One contact, of condition up to 1e8 and any law, in two dimensions and three."""
    rng = np.random.default_rng(7)
    for k in range(count):
        dim = 2 + k % 2
        B = np.linalg.qr(rng.normal(size=(dim, dim)))[0]
        W = (B * 10 ** rng.uniform(-rng.uniform(0, 8), 0, size=dim)) @ B.T
        q = rng.normal(size=dim)
        q[-1] = -abs(q[-1]) * 10 ** rng.uniform(-3, 0)
        mu, p = 10 ** rng.uniform(-1, 0.5, size=dim - 1), 10 ** rng.uniform(-1, 1, size=dim - 1)
        yield dict(
            W=(W + W.T) / 2, dim=dim, tied=0, prepared=False, name=f"{k}", given=given(q, mu, p)
        )


def solve(problem: dict, seconds: float, without=()) -> SimpleNamespace:
    """One problem: whether it was solved, by which methods, how long it took."""
    operator = condensed_operator(problem["W"], problem["dim"], problem["tied"])
    if problem["prepared"]:
        operator.prepare()
    start = time.process_time()
    found = operator.solve(**problem["given"], max_seconds=seconds, without=list(without))
    return SimpleNamespace(
        solved=found.converged,
        branch=found.branch if found.converged else "REFUSED",
        tried=[attempt.branch for attempt in found.tried],
        iterations=found.iterations,
        seconds=time.process_time() - start,
        error=max(found.error, found.slip_error),
    )


def compare(name: str, problems: list[dict], lists: list[list[str]], seconds: float, log) -> None:
    """Solve with all methods and without those of each list; print a line for each, and what was lost."""

    def note(problem, without, run):
        line = dict(set=name, problem=problem["name"], without=without) | vars(run)
        print(json.dumps(line | dict(measured=f"{now()[:10]}, {commit()}")), file=log, flush=True)

    def report(without, runs):
        lost = [(p["name"], r) for p, r in zip(problems, runs) if not r.solved]
        took = sorted(run.seconds for run in runs) or [0.0]
        print(f"{name}: without {', '.join(without) or 'none'}: {len(lost)} of {len(runs)} lost, median "
              f"{took[len(took) // 2]:.4f} s, slowest {took[-1]:.2f}, all {sum(took):.2f} s; by",
              dict(Counter(run.branch for run in runs)), flush=True)  # fmt: skip
        for lost_name, run in lost[:20]:
            print(f"    {lost_name}: {run.error:.1e} left after {run.seconds:.1f} s", flush=True)

    base = [solve(problem, seconds) for problem in problems]
    for problem, run in zip(problems, base):
        note(problem, [], run)
    report([], base)
    for without in lists:
        runs = list(base)
        for k, (problem, run) in enumerate(zip(problems, base)):
            if set(run.tried) & set(without):
                runs[k] = solve(problem, seconds, without)
                note(problem, without, runs[k])
        report(without, runs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=1, help="scenes of the stress matrix")
    parser.add_argument("--seconds", type=float, default=20.0, help="for each problem")
    parser.add_argument("--sets", nargs="+", default=["bodies", "piles", "single"])
    parser.add_argument("--without", nargs="*", default=[], help="names of methods with + between")
    parser.add_argument("--output", type=Path, default=Path("results/condensed-ablation"))
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    kept = options.output / f"bodies-{options.every}.pickle"
    lists = [names.split("+") for names in options.without]
    with (options.output / "ablation.jsonl").open("a") as log:
        for name in options.sets:
            if name == "bodies":
                if not kept.exists():
                    kept.write_bytes(pickle.dumps(from_bodies(options.every)))
                found = pickle.loads(kept.read_bytes())
                print("bodies, by what solved them first:", dict(found["solved"]), flush=True)
                problems = found["problems"]
            else:
                problems = list({"piles": piles, "single": single}[name]())
            compare(name, problems, lists, options.seconds, log)


if __name__ == "__main__":
    main()
