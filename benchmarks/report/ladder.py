# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The economy ladder: one scene, ingredients removed one at a time."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

import dolfinx_contact as dc
from benchmarks.measurement import Measurement, counts, mesh_of, peak_memory, spread, timed
from benchmarks.report.drawing import OURS, bars
from benchmarks.tables import chosen
from studies.punch import Parameters, Punch, programme

TITLE = "The economy ladder"
CAPTION = "What a step, its set-up and its memory cost as ingredients are removed one at a time."
# What every rung is made of, and the rung it is compared with: what is there once more than here.
RUNGS = {
    "non-associated": (dict(case="C"), None),
    "associated": (dict(case="B"), "non-associated"),
    "isotropic": (dict(case="A"), "associated"),
    "all nodes stick": (dict(friction=dict(mu=1.0)), "isotropic"),
    "frictionless": (dict(friction=dict(mu=0.0)), "isotropic"),
    "contact never reached": (dict(friction=dict(mu=0.0), away=True), "frictionless"),
    "no contact at all": (dict(friction=dict(mu=0.0), bare=True), "contact never reached"),
    "matrix new in every step": (dict(case="C", moving=True), None),
    "matrix constant": (dict(case="C"), "matrix new in every step"),
    "recording and wear": (dict(case="C", recorded=True), None),
    "no recording, no wear": (dict(case="C"), "recording and wear"),
}


def plan(size: str) -> list[Measurement]:
    kinds = {}
    for name, (kind, _) in RUNGS.items():  # each kind once, by its first name
        kinds.setdefault(json.dumps(kind), (name, kind))
    rungs = list(kinds.values())
    settings = dict(mesh=mesh_of(size), steps=2 if size == "smallest" else 8)
    return [
        Measurement(f"ladder/{name} {k}", "benchmarks.report.ladder:rung", dict(kind=kind, repetition=k, **settings))
        for k in range(3 if size == "full" else 1)
        for name, kind in (rungs[:2] if size == "smallest" else rungs)
    ]  # fmt: skip


def rung(kind: dict, mesh: dict, steps: int, repetition: int) -> dict:
    """One programme of the punch: operations, peak memory, processor seconds of set-up and steps."""
    parameters = Parameters(case=kind.get("case", "C"), tol=1e-8)
    punch = Punch(parameters, friction=kind.get("friction"), **mesh)
    problem, contact, history = punch.problem, punch.contact, None
    scale = fem.Constant(punch.mesh, 1.0)
    if kind.get("moving"):  # the stiffness times a constant that changes from step to step
        problem = dc.ContactProblem(scale * punch.F, punch.u, [contact], bcs=punch.bcs, tol=1e-8)
    if kind.get("recorded"):
        facets, file = punch.facet_tags.find(1), Path(tempfile.mkdtemp()) / "history.csv"
        contact = dc.Contact(punch.V, facets, contact.surface, contact.friction, wear=dc.Wear(3e-8))
        problem = dc.ContactProblem(punch.F, punch.u, [contact], bcs=punch.bcs, tol=1e-8)
        history = dc.History(problem, file, points=[(7.5, 0, 0), (0, 7.5, 0)])
    if kind.get("away"):
        contact.surface.displacement = np.array([0.0, 0.0, -1e3])

    def solved() -> tuple[int, str]:
        if kind.get("bare"):
            problem.body.refresh()
            problem.body.free_state(problem.body.load()[0])
            return 0, "none"
        step = problem.solve()
        if history is not None:
            history.record(step)
        return step.iterations, step.solver

    seconds, iterations, before = [], [], peak_memory(anew=True)
    PETSc.Log.begin()
    for k, displacement in enumerate(programme(punch.parameters)[:steps]):
        punch.move_top(displacement)
        scale.value = 1.0 + 1e-3 * k
        spent, (count, solver) = timed(solved)
        seconds.append(spent)
        iterations.append(count)
        if k == 0:
            first = counts()
    rows = len(contact.nodes) * (1 if contact.friction.frictionless else 3)
    return dict(
        kind=kind, unknowns=problem.body.size, condensed=rows if solver.startswith("Condensed") else 0,
        counts={key: value - first[key] for key, value in counts().items()}, bytes=peak_memory() - before,
        seconds=seconds, iterations=iterations, solver=solver,
    )  # fmt: skip


def evaluate(results: dict) -> dict:
    """One row a rung: medians over the repetitions, and ratios to the rung that it is compared with."""
    rows = {}
    for name, (kind, above) in RUNGS.items():
        runs = [result for result in results.values() if result["kind"] == kind]
        if not runs:
            continue
        last, other = runs[0], rows.get(above)
        steps = max(len(last["seconds"]) - 1, 1)
        row = rows[name] = dict(
            rung=name, compared_with=above, unknowns=last["unknowns"], condensed=last["condensed"],
            solver=last["solver"], set_up=spread([run["seconds"][0] for run in runs]),
            step=spread([np.mean(run["seconds"][1:]) for run in runs]),
            bytes=float(np.median([run["bytes"] for run in runs])),
            iterations=float(np.mean(last["iterations"])),
            counts={key: value / steps for key, value in last["counts"].items()},
        )  # fmt: skip
        if other:
            row["bytes_ratio"] = row["bytes"] / other["bytes"] if other["bytes"] else None
    return dict(rows=list(rows.values()))


def figure(data):
    rows = data["rows"]
    figure, axes = bars([row["rung"] for row in rows], 3)
    shown = {
        "one step [ms]": [1e3 * row["step"]["median"] for row in rows],
        "first step with set-up [ms]": [1e3 * row["set_up"]["median"] for row in rows],
        "memory beyond mesh and forms [MB]": [1e-6 * row["bytes"] for row in rows],
    }
    for ax, (title, values) in zip(axes, shown.items()):
        values = np.maximum(values, 1e-3)
        ax.bar_label(ax.barh(range(len(rows)), values, color=OURS, height=0.65), fmt="%.3g", padding=3)  # fmt: skip
        ax.set(xlabel=title, xlim=(0.4 * min(values), 4 * max(values)))
        for k, row in enumerate(rows):  # a line above each scene that begins anew
            if k and row["compared_with"] is None:
                ax.axhline(k - 0.5, color="0.5", lw=0.8)
    return figure


def ratio(row: dict, rows: dict[str, dict], key: str) -> str | None:
    """A ratio of times, and whether the repetitions of the two rungs overlap: then no difference was seen."""
    other = rows.get(row["compared_with"])
    if other is None:
        return None
    here, there = row[key], other[key]
    apart = here["least"] > there["largest"] or here["largest"] < there["least"]
    return f"{here['median'] / there['median']:.2f}" + ("" if apart else " (within the spread)")


def tables(data):
    rows = {row["rung"]: row for row in data["rows"]}
    shown = [
        row | {f"{key}_ratio": ratio(row, rows, key) for key in ("step", "set_up")}
        for row in data["rows"]
    ]
    titles = dict(
        rung="rung", compared_with="compared with", step_ratio="step, ratio", set_up_ratio="set-up, ratio",
        bytes_ratio="memory, ratio", unknowns="unknowns", condensed="condensed", iterations="iterations a step",
    )  # fmt: skip
    yield chosen(shown, titles)
    yield [{"a step of": row["rung"], **row["counts"]} for row in data["rows"]]
