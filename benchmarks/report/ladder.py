# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The economy ladder: one scene, ingredients removed one at a time."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from time import process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from petsc4py import PETSc

from benchmarks.measurement import Measurement, Memory, counts, spread
from benchmarks.report.drawing import OURS, bars
from studies.punch import CASES, Parameters, Punch, programme

TITLE = "The economy ladder"
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
    repeat = dict(full=3, quick=1, smallest=1)[size]
    settings = dict(mesh={} if size != "smallest" else dict(divisions=2, layers=2))
    settings["steps"] = 8 if size != "smallest" else 2
    distinct = {json.dumps(kind): name for name, (kind, _) in reversed(RUNGS.items())}
    names = [name for name in RUNGS if name in distinct.values()]
    if size == "smallest":
        names = ["non-associated", "associated"]
    return [
        Measurement(f"ladder/{name}_{k}".replace(" ", "_"), "benchmarks.report.ladder:rung",
            dict(kind=RUNGS[name][0], repetition=k, **settings))
        for k in range(repeat) for name in names
    ]  # fmt: skip


def rung(kind: dict, mesh: dict, steps: int, repetition: int) -> dict:
    """One programme of the punch: operations, peak memory, processor seconds of set-up and steps."""
    if "friction" in kind:
        CASES["of the ladder"] = kind["friction"]
    punch = Punch(Parameters(case=kind.get("case", "of the ladder"), tol=1e-8), **mesh)
    displacements = programme(punch.parameters)[:steps]
    problem, contact = punch.problem, punch.contact
    history, scale = None, None
    if kind.get("moving"):
        problem, scale = moving(punch)
    if kind.get("recorded"):
        contact = dc.Contact(punch.V, punch.facet_tags.find(1), contact.plane, contact.friction, dc.Wear(3e-8))  # fmt: skip
        problem = dc.ContactProblem(punch.F, punch.u, [contact], bcs=punch.bcs, tol=1e-8)
        file = Path(tempfile.mkdtemp()) / "history.csv"
        history = dc.History(problem, file, [(7.5, 0, 0), (0, 7.5, 0)])
    if kind.get("away"):
        contact.plane.displacement = np.array([0.0, 0.0, -1e3])
    seconds, iterations, solver = [], [], "none"
    memory = Memory()
    PETSc.Log.begin()
    for k, displacement in enumerate(displacements):
        punch.approach.value = -displacement
        if scale is not None:
            scale.value = 1.0 + 1e-3 * k
        start = process_time()
        if kind.get("bare"):
            problem.body.refresh()
            problem.body.free_state(problem.body.load()[0])
            iterations.append(0)
        else:
            step = problem.solve()
            iterations.append(step.iterations)
            solver = step.solver
            if history is not None:
                history.record(step)
        seconds.append(process_time() - start)
        if k == 0:
            first = counts()
    nodes, dim = len(contact.nodes), contact.frame.shape[0]
    condensed = nodes * (1 if contact.friction.frictionless else dim)
    return dict(
        kind=kind, unknowns=problem.body.size, condensed=condensed if solver.startswith("Condensed") else 0,
        counts={key: value - first[key] for key, value in counts().items()}, bytes=memory.added(),
        seconds=seconds, iterations=iterations, solver=solver,
    )  # fmt: skip


def moving(punch):
    """The same body, its stiffness times a constant that changes from step to step."""
    from dolfinx import fem

    scale = fem.Constant(punch.mesh, 1.0)
    return dc.ContactProblem(scale * punch.F, punch.u, [punch.contact], bcs=punch.bcs, tol=1e-8), scale  # fmt: skip


def evaluate(results: dict) -> dict:
    """One row a rung: medians over the repetitions, and ratios to the rung that it is compared with."""
    by_kind = {}
    for result in results.values():
        by_kind.setdefault(json.dumps(result["kind"]), []).append(result)
    rows = {}
    for name, (kind, above) in RUNGS.items():
        runs = by_kind.get(json.dumps(kind))
        if not runs:
            continue
        last = runs[0]
        steps = max(len(last["seconds"]) - 1, 1)
        row = rows[name] = dict(
            rung=name, compared_with=above, unknowns=last["unknowns"], condensed=last["condensed"],
            solver=last["solver"], set_up=spread([run["seconds"][0] for run in runs]),
            step=spread([np.mean(run["seconds"][1:]) for run in runs]),
            bytes=float(np.median([run["bytes"] for run in runs])),
            iterations=float(np.mean(last["iterations"])),
            counts={key: value / steps for key, value in last["counts"].items()},
        )  # fmt: skip
        if above in rows:
            other = rows[above]
            row["step_ratio"] = row["step"]["median"] / other["step"]["median"]
            row["set_up_ratio"] = row["set_up"]["median"] / other["set_up"]["median"]
            row["bytes_ratio"] = row["bytes"] / other["bytes"] if other["bytes"] else None
    return dict(rows=list(rows.values()))


def figures(data):
    rows = data["rows"]
    figure, axes = bars([row["rung"] for row in rows], 3)
    for ax, key, title, scale in zip(
        axes, ("step", "set_up", "bytes"),
        ("one step [ms]", "first step with set-up [ms]", "memory beyond mesh and forms [MB]"), (1e3, 1e3, 1e-6),
    ):  # fmt: skip
        values = [max(scale * (row[key] if key == "bytes" else row[key]["median"]), 1e-3) for row in rows]  # fmt: skip
        ax.bar_label(ax.barh(range(len(rows)), values, color=OURS, height=0.65), fmt="%.3g", padding=3)  # fmt: skip
        ax.set(xlabel=title, xlim=(0.4 * min(values), 4 * max(values)))
        for k, row in enumerate(rows):  # a line above each scene that begins anew
            if k and row["compared_with"] is None:
                ax.axhline(k - 0.5, color="0.5", lw=0.8)
    yield (
        "ladder",
        figure,
        "What a step, its set-up and its memory cost as ingredients are removed one at a time.",
    )


def tables(data):
    yield [
        {
            "rung": row["rung"], "compared with": row["compared_with"], "step, ratio": row.get("step_ratio"),
            "set-up, ratio": row.get("set_up_ratio"), "memory, ratio": row.get("bytes_ratio"),
            "unknowns": row["unknowns"], "condensed": row["condensed"], "iterations a step": row["iterations"],
            **{f"{key} a step": value for key, value in row["counts"].items()},
        }
        for row in data["rows"]
    ]  # fmt: skip
