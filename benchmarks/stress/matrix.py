# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""One scene of the stress matrix with one solver, every answer judged from the mechanics (mechanics/judge.py)."""

from __future__ import annotations

import warnings
from collections import Counter
from time import perf_counter
from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np

from benchmarks.stress.scenes import Scene
from mechanics import judge
from mechanics.condensed import random_problem
from mechanics.judge import Verdict
from mechanics.judge_scene import SceneJudge
from mechanics.scenes import build

TOL = 1e-8  # of all scenes that do not name another
WRONG = judge.DEFECT * TOL
REFUSALS = (dc.NotConverged, dc.CondensedNotConverged, dc.LinearSolverError, ValueError)
ROUNDING = getattr(dc, "RoundingWarning", UserWarning)
SOLVERS = {
    "default": lambda: None,
    "condensed": lambda: dc.CondensedNewton(max_seconds=30),
    "fixed point": dc.FixedPoint,
}


def run(scene: Scene, solver) -> dict:
    """One scene with one solver: outcome, worst judged errors, iterations, seconds.

    The outcome is ``solved``; ``rounding`` if a step returns with an error above its tolerance because double
    precision allows no more, and is judged by that error; ``WRONG``; or ``refused``.
    """
    start = perf_counter()
    record = dict(outcome="solved", error=0.0, slip_error=0.0, reactions=0.0, rounding=0.0, steps=0, scratch=0, iterations=0, slowest=0.0)  # fmt: skip
    used = Counter()
    steps = condensed_steps if scene.condensed else body_steps
    for verdict, step, method in steps(scene, solver, record):
        at = level(step, scene.tol)
        note(record, verdict, at, at > scene.tol)
        record["steps"] += 1
        record["scratch"] += verdict.from_scratch is not None
        record["iterations"] += step.iterations
        record["slowest"] = max(record["slowest"], step.seconds)
        used[method] += 1
    record.update(seconds=perf_counter() - start, methods=dict(used))
    return record


def level(step, tol: float) -> float:
    """What an answer is held to: its tolerance, or a larger error that it admits."""
    return max(tol, step.error, getattr(step, "slip_error", 0.0))


def note(record: dict, verdict: Verdict, at: float, rounded: bool) -> None:
    """Worst figures of the judge, and whether an answer is wrong that is held to the error ``at``."""
    error, slip = verdict.errors
    figures = dict(error=error, slip_error=slip, reactions=verdict.reactions, rounding=verdict.rounding)  # fmt: skip
    for name, value in figures.items():
        record[name] = max(record[name], value)
    if not verdict.accepts(at):
        record["outcome"] = "WRONG"
        first = f"step {record['steps'] + 1}: {verdict}"
        record.setdefault("said", first)
    elif rounded and record["outcome"] == "solved":
        record["outcome"] = "rounding"


def refuse(record: dict, said: Exception) -> None:
    record["refused"] = record.get("refused", 0) + 1
    if record["outcome"] != "WRONG":
        record["outcome"] = "refused"
        step = record["steps"] + record["refused"]
        record.setdefault("said", f"step {step}: {type(said).__name__}: {str(said)[:300]}")


def condensed_steps(scene: Scene, solver, record):
    """The one answer of a condensed problem: (verdict, result, method); none if it is refused."""
    problem = sliding_problem(scene) if scene.seed is None else random_problem(scene.seed)
    friction = dc.Friction(problem.mu, problem.p)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ROUNDING)
            found = dc.solve_condensed(problem.W, problem.q, friction, solver, scene.tol, max_seconds=30)  # fmt: skip
    except REFUSALS as said:
        return refuse(record, said)
    mu, p = np.broadcast_to(problem.mu, 2), np.broadcast_to(problem.p, 2)
    yield (
        judge.condensed(problem.W, problem.q, mu, p, found.reaction, scene.tol),
        found,
        found.branch,
    )


def sliding_problem(scene: Scene):
    """One node that slides by more than 1 while it is pressed by ``scene.depth``."""
    mu = scene.body["mu"]
    q = np.array([[1.0, 0.5, -scene.depth]])
    return SimpleNamespace(W=np.eye(3), q=q, mu=mu, p=scene.body.get("p", mu))


def body_steps(scene: Scene, solver, record):
    """Load step after load step that is not refused: (verdict, step, method)."""
    built = build(**scene.body)
    body = scene.body
    of = SceneJudge(built, body.get("mu", 0.2), body.get("p"))
    contacts = [built.contact] if built.contact is not None else []
    problem = dc.ContactProblem(
        built.F, built.u, contacts, bcs=built.bcs, solver=solver, tol=scene.tol
    )
    for move in scene.tops:
        if getattr(move, "fresh", False):
            problem.reset()
            of.restart()
        built.move_top(move)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ROUNDING)
                step = problem.solve()
        except REFUSALS as said:
            refuse(record, said)
            if not scene.goes_on:
                return
            continue
        yield of.verdict(scene.tol), step, step.tried[-1].branch if step.tried else step.solver.split()[0]  # fmt: skip


def pairs(chosen: list[Scene], solvers=SOLVERS) -> list[tuple[Scene, str]]:
    """Scenes and the solvers that they are given to: on plain arrays there is one."""
    return [
        (scene, solver)
        for scene in chosen
        for solver in solvers
        if not scene.condensed or solver == "default"
    ]
