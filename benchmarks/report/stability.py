# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Stability: the stress matrix as one picture, and bodies that have to be refused."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import matplotlib
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from benchmarks.measurement import ROOT, Measurement
from benchmarks.stress import matrix as stress
from benchmarks.stress.scenes import LAWS, scenes
from mechanics.scenes import build

TITLE = "Stability"
MATRIX = ROOT / "results" / "stress" / "stress.jsonl"  # of make stress
SINGULAR = "singular stiffness"
COLUMNS = 24  # scenes in a line of the figure
MARKS = {"solved": ("s", 60), "rounding": ("D", 45), "refused": ("x", 45), "WRONG": ("o", 70)}
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
        record = dict(group=SINGULAR, name=f"held by nothing {law}", solver="default",
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
    """Records, counts by solver, and what is neither solved nor refused."""
    records = [record for result in results.values() for record in result["records"]]
    singular = [r for r in records if r["group"] == SINGULAR]
    others = [r for r in records if r["group"] != SINGULAR]
    count = Counter((r["solver"], r["outcome"]) for r in others)
    by_solver = [
        {"solver": s} | {outcome: count[s, outcome] for outcome in ("solved", "rounding", "refused", "WRONG")}
        for s in dict.fromkeys(r["solver"] for r in others)
    ]  # fmt: skip
    return dict(
        records=records, whole=any(result["whole"] for result in results.values()), by_solver=by_solver,
        third_state=sum(r["outcome"] == "WRONG" for r in records),
        worst=max((r["error"] for r in others if r["outcome"] == "solved"), default=None),
        singular=len(singular), singular_refused=sum(r["outcome"] == "refused" for r in singular),
    )  # fmt: skip


def figures(data):
    records = data["records"]
    solvers = list(dict.fromkeys(record["solver"] for record in records))
    of = {}
    for record in records:
        of.setdefault(record["group"], {s: [] for s in solvers})[record["solver"]].append(record)
    # From above: the first line of each group, of as many as its longest row of scenes needs.
    lines = [-(-max(map(len, row.values())) // COLUMNS) for row in of.values()]
    first = np.cumsum([0, *(count + 0.6 for count in lines)])
    figure = Figure(figsize=(15, 0.21 * first[-1] + 1.4), layout="constrained")
    axes = figure.subplots(1, len(solvers), sharey=True, squeeze=False)[0]
    colours, norm = matplotlib.colormaps["viridis_r"], LogNorm(1e-16, 1e-7)
    for ax, solver in zip(axes, solvers):
        places = [
            (record, i % COLUMNS, top + i // COLUMNS)
            for top, row in zip(first, of.values()) for i, record in enumerate(row[solver])
        ]  # fmt: skip
        for outcome, (marker, size) in MARKS.items():
            some = [place for place in places if place[0]["outcome"] == outcome]
            shade = [colours(norm(max(record["error"], 1e-16))) for record, *_ in some]
            x, y = [place[1] for place in some], [place[2] for place in some]
            solved = outcome in ("solved", "rounding")
            ax.scatter(x, y, size, c=shade if solved else "#d00000", marker=marker)
        ax.set_title(solver)
        ax.set(yticks=first[:-1], yticklabels=list(of), xticks=[], xlim=(-1, COLUMNS))
        ax.set_ylim(first[-1] - 0.6, -1)
        ax.grid(visible=False)
    figure.colorbar(matplotlib.cm.ScalarMappable(norm, colours), ax=axes, label="largest error found by the judge",
        shrink=0.8, aspect=25)  # fmt: skip
    part = "" if data["whole"] else " This is a part of the scenes; make stress runs all."
    yield (
        "stability",
        figure,
        (
            "Scenes by group: square, solved; diamond, solved as far as double precision allows; cross, refused with an exception; "
            f"disc, wrong.{part}"
        ),
    )


def tables(data):
    yield data["by_solver"]
    yield [
        {"wrong": data["third_state"], "largest error of an answer": data["worst"],
         "singular stiffness refused": f"{data['singular_refused']} of {data['singular']}"}
    ]  # fmt: skip
    yield [
        {key: record[key] for key in ("group", "name", "solver", "outcome", "error", "said")}
        for record in data["records"] if record["outcome"] != "solved" and record["group"] != SINGULAR
    ]  # fmt: skip
