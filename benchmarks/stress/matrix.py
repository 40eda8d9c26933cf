# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""One scene of the stress matrix with one solver, every answer judged from the mechanics (mechanics/judge.py)."""

from __future__ import annotations

import warnings
from collections import Counter
from time import perf_counter

import numpy as np

import dolfinx_contact as dc
from benchmarks.stress.rigs import CornerScene, RigScene
from benchmarks.stress.scenes import Scene
from benchmarks.stress.two_bodies import PairScene
from mechanics import judge
from mechanics.condensed import random_problem
from mechanics.corners import build_corner
from mechanics.judge import Verdict
from mechanics.judge_corners import CornerJudge
from mechanics.judge_rigs import RigJudge
from mechanics.judge_scene import SceneJudge
from mechanics.judge_two_bodies import TwoBodiesJudge
from mechanics.rigs import build_rig
from mechanics.scenes import build, problem_of
from mechanics.two_blocks import build_two

REFUSALS = (dc.NotConverged, dc.CondensedNotConverged, dc.LinearSolverError, ValueError)
GEOMETRY = 1e-6  # of faces that move: below what they are judged by
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
    sums = dict.fromkeys(("steps", "scratch", "iterations"), 0)
    worst = dict.fromkeys(("error", "slip_error", "reactions", "rounding", "slowest"), 0.0)
    record = dict(group=scene.group, name=scene.name, outcome="solved", **worst, **sums)
    used = Counter()
    steps = condensed_steps if scene.condensed else body_steps
    steps = rig_steps if isinstance(scene, RigScene) else steps
    steps = corner_steps if isinstance(scene, CornerScene) else steps
    steps = pair_steps if isinstance(scene, PairScene) else steps
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", dc.RoundingWarning)
        # the answer to the linear form is asked for
        warnings.filterwarnings("ignore", "the body is strained")
        for verdict, step, method in steps(scene, solver, record):
            at = level(step, scene.tol)
            note(record, verdict, at, at > scene.tol)
            record["steps"] += 1
            record["scratch"] += verdict.from_scratch is not None
            record["iterations"] += step.iterations
            record["slowest"] = max(record["slowest"], step.seconds)
            used[method] += 1
    return record | dict(seconds=perf_counter() - start, methods=dict(used))


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
        record.setdefault("said", f"step {record['steps'] + 1}: {verdict}")
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
    if scene.seed is not None:
        problem = random_problem(scene.seed)
        W, q, mu, p = problem.W, problem.q, problem.mu, problem.p
    else:  # one node that slides by more than 1 while it is pressed by ``scene.depth``
        W, q = np.eye(3), np.array([[1.0, 0.5, -scene.depth]])
        mu = np.broadcast_to(scene.body["mu"], 2)
        p = np.broadcast_to(scene.body.get("p", mu), 2)
    try:
        law = dc.Friction(mu, p)
        found = dc.solve_condensed(W, q, law, solver=solver, tol=scene.tol, max_seconds=30)
    except REFUSALS as said:
        return refuse(record, said)
    yield judge.condensed(W, q, mu, p, found.reaction, scene.tol), found, found.branch


def solved(scene: Scene, problem, apply, record):
    """Load after load that ``apply`` puts on: (what it returns, step, method), until one is refused, or of all that are not."""
    for load in scene.tops:
        asked = apply(load)
        try:
            step = problem.solve()
        except REFUSALS as said:
            refuse(record, said)
            if not scene.goes_on:
                return
            continue
        yield asked, step, step.tried[-1].branch if step.tried else step.solver.split()[0]


def body_steps(scene: Scene, solver, record):
    """Load step after load step that is not refused: (verdict, step, method)."""
    built = build(**scene.body)
    of = SceneJudge(built, scene.body.get("mu", 0.2), scene.body.get("p"))
    problem = problem_of(built, solver, scene.tol)

    def apply(move):
        if getattr(move, "fresh", False):
            problem.reset()
            of.restart()
        built.move_top(move)

    for _, step, method in solved(scene, problem, apply, record):
        yield of.verdict(scene.tol), step, method


def rig_steps(scene: RigScene, solver, record):
    """As ``body_steps``, of a surface that force drives."""
    built = build_rig(**scene.body)
    of = RigJudge(built, scene.body.get("mu", 0.2), scene.body.get("p"))
    problem = problem_of(built, solver, scene.tol)
    problem.geometry_tol = np.inf  # the judge has the geometry of the start
    for asked, step, method in solved(scene, problem, built.apply, record):
        yield of.verdict(asked, scene.tol), step, method


def corner_steps(scene: CornerScene, solver, record):
    """As ``body_steps``, of a body whose edge belongs to two contacts.  No distance of reactions: shares are not unique."""
    built = build_corner(**scene.body)
    of = CornerJudge(built)
    problem = dc.ContactProblem(built.F, built.u, built.contacts, bcs=built.bcs, solver=solver, tol=scene.tol)  # fmt: skip
    for _, step, method in solved(scene, problem, built.apply, record):
        yield of.verdict(), step, method


def pair_steps(scene: PairScene, solver, record):
    """As ``body_steps``, of two deformable bodies."""
    built = build_two(**scene.body)
    of = TwoBodiesJudge(built)
    problem = problem_of(built, solver, scene.tol, geometry_tol=GEOMETRY)

    def apply(way):
        built.move_top(way)
        return -way[-1] * built.height

    for down, step, method in solved(scene, problem, apply, record):
        admitted = max(GEOMETRY, step.geometry_error) if built.sliding == "large" else 0.0
        yield of.verdict(down, scene.tol, admitted), step, method


def pairs(chosen: list[Scene], solvers=SOLVERS) -> list[tuple[Scene, str]]:
    """Scenes and the solvers that they are given to: on plain arrays there is one."""
    return [(scene, s) for scene in chosen for s in solvers if not scene.condensed or s == "default"]  # fmt: skip
