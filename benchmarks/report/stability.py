# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Stability: the stress matrix as one picture, and bodies that have to be refused."""

from __future__ import annotations

import json
from pathlib import Path

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from benchmarks.measurement import ROOT, Measurement
from benchmarks.stress import matrix as stress
from benchmarks.stress.scenes import LAWS, scenes
from mechanics.scenes import build

TITLE = "Stability"
MATRIX = ROOT / "results" / "stress" / "stress.jsonl"  # of make stress
EVERY = 10  # without it, every tenth scene is run


def plan(size: str) -> list[Measurement]:
    """One measurement a solver; the whole matrix is read where ``make stress`` has left it."""
    parts = [Measurement("stability/refused", "benchmarks.report.stability:refused", {})]
    if size == "smallest":
        settings = dict(solver="default", every=200)
        return [
            *parts,
            Measurement("stability/default", "benchmarks.report.stability:run", settings),
        ]
    if MATRIX.exists():
        written = dict(file=str(MATRIX), written=MATRIX.stat().st_mtime)
        return [
            *parts,
            Measurement("stability/matrix", "benchmarks.report.stability:read", written),
        ]
    every = EVERY if size == "full" else 4 * EVERY
    return parts + [
        Measurement(f"stability/{solver}".replace(" ", "_"), "benchmarks.report.stability:run", dict(solver=solver, every=every))
        for solver in stress.SOLVERS
    ]  # fmt: skip


def read(file: str, written: float) -> dict:
    """The matrix as ``make stress`` wrote it, in the order of its scenes, and whether it is whole."""
    lines = map(json.loads, Path(file).read_text().splitlines())
    found = {(r["group"], r["name"], r["solver"]): r for r in lines}
    asked = [(scene.group, scene.name, solver) for scene, solver in stress.pairs(scenes())]
    records = [found[key] for key in asked if key in found]
    measured = [record.get("measured", "date and commit not noted") for record in records]
    return dict(
        records=[short(r) for r in records], whole=len(records) == len(asked), measured=measured
    )


def run(solver: str, every: int) -> dict:
    """Every n-th scene with one solver, without the longest programme."""
    records = []
    for scene in scenes()[::every]:
        if scene.programme == "1000 tiny steps" or scene.condensed and solver != "default":
            continue
        outcome = stress.run(scene, stress.SOLVERS[solver]())
        records.append(short(dict(group=scene.group, name=scene.name, solver=solver, **outcome)))
    return dict(records=records, whole=False)


def refused() -> dict:
    """Singular stiffness: a spring without stiffness holds nothing; each law has to be refused."""
    records = []
    for law, friction in LAWS.items():
        built = build(spring=0.0, **friction)
        record = dict(group="singular stiffness", name=f"held by nothing {law}", solver="default",
            outcome="WRONG", error=0.0, slip_error=0.0, steps=0, seconds=0.0, slowest=0.0, methods={})  # fmt: skip
        try:
            problem = dc.ContactProblem(built.F, built.u, [built.contact], bcs=built.bcs)
            built.move_top((0, 0, -0.01))
            problem.solve()
        except (ValueError, dc.NotConverged, dc.LinearSolverError) as said:
            record.update(outcome="refused", said=str(said)[:200])
        records.append(short(record))
    return dict(records=records, whole=False)


def short(record: dict) -> dict:
    keys = ("group", "name", "solver", "outcome", "steps", "seconds", "slowest", "methods")
    worst = max(record["error"], record["slip_error"])
    return {key: record[key] for key in keys} | dict(error=worst, said=record.get("said", ""))


def evaluate(results: dict) -> dict:
    """Records, counts by solver and group, and what is neither solved nor refused."""
    records = [record for result in results.values() for record in result["records"]]
    if not records:
        return dict(records=[])
    singular = [r for r in records if r["group"] == "singular stiffness"]
    others = [r for r in records if r["group"] != "singular stiffness"]
    solved = [r for r in others if r["outcome"] == "solved"]
    measured = sorted({when for result in results.values() for when in result.get("measured", [])})
    by_solver = {}
    for record in others:
        of = by_solver.setdefault(
            record["solver"], dict(scenes=0, solved=0, rounding=0, refused=0, WRONG=0)
        )
        of["scenes"] += 1
        of[record["outcome"]] += 1
    return dict(
        records=records, whole=any(result["whole"] for result in results.values()),
        by_solver=by_solver, measured=measured, third_state=sum(r["outcome"] == "WRONG" for r in records),
        worst=max((r["error"] for r in solved), default=None),
        singular=len(singular), singular_refused=sum(r["outcome"] == "refused" for r in singular),
        all_scenes=len(scenes()), tol=stress.TOL, wrong=stress.WRONG,
        not_solved=[r for r in others if r["outcome"] != "solved"],
    )  # fmt: skip
