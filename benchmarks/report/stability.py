# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Stability: the stress matrix as one picture, and bodies that have to be refused."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

from benchmarks.measurement import ROOT, Measurement
from benchmarks.stress import matrix as stress
from benchmarks.stress.picture import MARKS, draw
from benchmarks.stress.scenes import LAWS, Scene, scenes
from benchmarks.tables import chosen

TITLE = "Stability"
CAPTION = "Every scene of the stress matrix by group: the largest error that an independent check found (mechanics/judge.py), and the outcome."
MATRIX = ROOT / "results" / "stress" / "stress.jsonl"  # of make stress
SINGULAR = "singular stiffness"
KEPT = ("group", "name", "solver", "outcome", "steps", "seconds", "slowest", "methods")


def plan(size: str) -> list[Measurement]:
    """The whole matrix where ``make stress`` has left it, else some of its scenes with each solver."""
    if size == "smallest":
        some = {"default": ("run", dict(solver="default", every=200))}
    elif MATRIX.exists():
        some = {"matrix": ("read", dict(file=str(MATRIX), written=MATRIX.stat().st_mtime))}
    else:
        every = 10 if size == "full" else 40
        some = {solver: ("run", dict(solver=solver, every=every)) for solver in stress.SOLVERS}
    return [
        Measurement(f"stability/{name}", f"benchmarks.report.stability:{function}", settings)
        for name, (function, settings) in {"refused": ("refused", {}), **some}.items()
    ]


def read(file: str, written: float) -> dict:
    """The matrix as ``make stress`` wrote it, in the order of its scenes, and whether it is whole."""
    lines = map(json.loads, Path(file).read_text().splitlines())
    found = {(r["group"], r["name"], r["solver"]): r for r in lines}
    asked = [(scene.group, scene.name, solver) for scene, solver in stress.pairs(scenes())]
    records = [found[key] for key in asked if key in found]
    measured = [record.get("measured", "date and commit not noted") for record in records]
    return dict(records=list(map(short, records)), whole=len(records) == len(asked), measured=measured)  # fmt: skip


def run(solver: str, every: int) -> dict:
    """Every n-th scene with one solver, without the longest programme."""
    some = [scene for scene in scenes()[::every] if scene.programme != "1000 tiny steps"]
    return dict(records=answers(some, solver), whole=False)


def refused() -> dict:
    """Singular stiffness: a spring without stiffness holds nothing; each law has to be refused."""
    some = [
        Scene(SINGULAR, f"held by nothing {law}", "one step", dict(spring=0.0, **friction))
        for law, friction in LAWS.items()
    ]
    return dict(records=answers(some, "default"), whole=False)


def answers(some: list[Scene], solver: str) -> list[dict]:
    make, chosen = stress.SOLVERS[solver], stress.pairs(some, [solver])
    return [short(dict(stress.run(scene, make()), solver=solver)) for scene, _ in chosen]


def short(record: dict) -> dict:
    worst = max(record["error"], record["slip_error"])
    return {key: record[key] for key in KEPT} | dict(error=worst, said=record.get("said", ""))


def evaluate(results: dict) -> dict:
    """Records, counts by solver, and what is neither solved nor refused."""
    records = [record for result in results.values() for record in result["records"]]
    singular = [r for r in records if r["group"] == SINGULAR]
    others = [r for r in records if r["group"] != SINGULAR]
    count = Counter((r["solver"], r["outcome"]) for r in others)
    solvers = dict.fromkeys(r["solver"] for r in others)
    return dict(
        records=records, whole=any(result["whole"] for result in results.values()),
        by_solver=[{"solver": s} | {outcome: count[s, outcome] for outcome in MARKS} for s in solvers],
        third_state=sum(r["outcome"] == "WRONG" for r in records),
        worst=max((r["error"] for r in others if r["outcome"] == "solved"), default=None),
        singular=len(singular), singular_refused=sum(r["outcome"] == "refused" for r in singular),
    )  # fmt: skip


def figure(data):
    return draw(data["records"])


def tables(data):
    yield data["by_solver"]
    yield [{
        "scenes": "all" if data["whole"] else "a part; make stress runs all", "wrong": data["third_state"],
        "largest error of an answer": data["worst"],
        "singular stiffness refused": f"{data['singular_refused']} of {data['singular']}",
    }]  # fmt: skip
    hard = [r for r in data["records"] if r["outcome"] != "solved" and r["group"] != SINGULAR]
    yield chosen(hard, {key: key for key in ("group", "name", "solver", "outcome", "error", "said")})  # fmt: skip
