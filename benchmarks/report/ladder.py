# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The economy ladder: one scene, ingredients removed one at a time; and what importing costs."""

from __future__ import annotations

import importlib.util
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from time import process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np

from benchmarks.measurement import Measurement, Memory, alone, counted, spread
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
    "certificate": (dict(case="C"), None),
    "no certificate": (dict(case="C", uncertified=True), "certificate"),
}
SAVES = 0.9  # a rung that takes more than this part of the one above saves nothing


def plan(size: str) -> list[Measurement]:
    repeat = dict(full=3, quick=1, smallest=1)[size]
    settings = dict(mesh={} if size != "smallest" else dict(divisions=2, layers=2))
    settings["steps"] = 8 if size != "smallest" else 2
    distinct = {json.dumps(kind): name for name, (kind, _) in reversed(RUNGS.items())}
    names = [name for name in RUNGS if name in distinct.values()]
    if size == "smallest":
        names = ["non-associated", "associated"]
    rungs = [
        Measurement(f"ladder/{name}_{k}".replace(" ", "_"), "benchmarks.report.ladder:rung",
            dict(kind=RUNGS[name][0], repetition=k, **settings))
        for k in range(repeat) for name in names
    ]  # fmt: skip
    return rungs + [
        Measurement("ladder/imports", "benchmarks.report.ladder:imports", dict(repeat=repeat))
    ]


def rung(kind: dict, mesh: dict, steps: int, repetition: int) -> dict:
    """One programme of the punch: operations, peak memory, processor seconds of set-up and steps."""
    if "friction" in kind:
        CASES["of the ladder"] = kind["friction"]
    punch = Punch(Parameters(case=kind.get("case", "of the ladder"), tol=1e-8), **mesh)
    displacements = programme(punch.parameters)[:steps]
    problem, contact = punch.problem, punch.contact
    history, scale = None, None
    if kind.get("uncertified"):
        dc.Contact.bipotential_gap = property(lambda self: np.zeros(len(self.nodes)))
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
    with counted() as counts:
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
                setup = dict(counts)
    nodes, dim = len(contact.nodes), contact.frame.shape[0]
    condensed = nodes * (1 if contact.friction.frictionless else dim)
    return dict(
        unknowns=problem.body.size, condensed=condensed if counts["condensed operators"] else 0,
        counts=counts, first=setup, bytes=memory.added(), seconds=seconds, iterations=iterations,
        solver=solver,
    )  # fmt: skip


def moving(punch):
    """The same body, its stiffness times a constant that changes from step to step."""
    from dolfinx import fem

    scale = fem.Constant(punch.mesh, 1.0)
    return dc.ContactProblem(scale * punch.F, punch.u, [punch.contact], bcs=punch.bcs, tol=1e-8), scale  # fmt: skip


def imports(repeat: int) -> dict:
    """Processor seconds, memory and modules of importing ``dolfinx_contact.problem``, which imports all but tables and
    plain arrays, and of ``import dolfinx``, interleaved."""
    script = (
        "import sys, resource; before = set(sys.modules); import {}; "
        "print(len(set(sys.modules) - before), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, "
        "*sorted({{m.split('.')[0] for m in set(sys.modules) - before}} - sys.stdlib_module_names))"
    )
    # the wheel dolfinx-solver-real wants to be imported before DOLFINx
    first = "dolfinx_solver, " if importlib.util.find_spec("dolfinx_solver") else ""
    ours, *others = "dolfinx_contact", "dolfinx", "dolfinx, dolfinx.fem.petsc, ufl"
    packages = {**{name: name for name in others}, ours: "dolfinx_contact.problem"}
    found = {package: dict(seconds=[]) for package in packages}
    for k in range(-1 if repeat > 1 else 0, repeat):
        for package, imported in packages.items():
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            done = subprocess.run([sys.executable, "-c", script.format(first + imported)], env=alone(),
                capture_output=True, text=True, check=True)  # fmt: skip
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            if k >= 0:  # the first one reads the disk
                used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
                found[package]["seconds"].append(used)
            count, peak, *names = done.stdout.split()
            found[package].update(modules=int(count), bytes=1024 * int(peak), packages=names)
    done = subprocess.run([sys.executable, "-X", "importtime", "-c", f"import {packages[ours]}"],
        env=alone(), capture_output=True, text=True, check=True)  # fmt: skip
    times = [line.split(":", 1)[1].split("|") for line in done.stderr.splitlines() if "|" in line]
    own = [
        dict(module=name.strip(), microseconds=int(self))
        for self, _, name in times if name.strip().startswith("dolfinx_contact")
    ]  # fmt: skip
    return dict(found=found, own=sorted(own, key=lambda row: -row["microseconds"]))


def evaluate(results: dict) -> dict:
    """One row a rung: medians over the repetitions, and ratios to the rung that it is compared with."""
    imported = results.get("ladder/imports")
    by_kind = {}
    for name, result in results.items():
        if name != "ladder/imports":
            by_kind.setdefault(name.rpartition("_")[0].split("/")[1].replace("_", " "), []).append(result)  # fmt: skip
    first = {json.dumps(kind): name for name, (kind, _) in reversed(RUNGS.items())}
    rows = {}
    for name, (kind, above) in RUNGS.items():
        runs = by_kind.get(first[json.dumps(kind)])
        if not runs:
            continue
        last = runs[0]
        steps = max(len(last["seconds"]) - 1, 1)
        row = dict(
            rung=name, compared_with=above, unknowns=last["unknowns"], condensed=last["condensed"],
            solver=last["solver"], set_up=spread([run["seconds"][0] for run in runs]),
            step=spread([np.mean(run["seconds"][1:]) for run in runs]),
            bytes=float(np.median([run["bytes"] for run in runs])),
            iterations=float(np.mean(last["iterations"])),
            counts={key: (value - last["first"][key]) / steps for key, value in last["counts"].items()},
        )  # fmt: skip
        if above in rows:
            other = rows[above]
            row["step_ratio"] = row["step"]["median"] / other["step"]["median"]
            row["set_up_ratio"] = row["set_up"]["median"] / other["set_up"]["median"]
            row["bytes_ratio"] = row["bytes"] / other["bytes"] if other["bytes"] else None
            row["saves"] = [
                what for what in ("step", "set_up", "bytes")
                if row[f"{what}_ratio"] is not None and row[f"{what}_ratio"] < SAVES
            ]  # fmt: skip
        rows[name] = row
    return dict(rows=list(rows.values()), imports=imported and import_cost(imported))


def import_cost(imported: dict) -> dict:
    """Medians, and what dolfinx_contact brings that ``import dolfinx`` does not."""
    found = imported["found"]
    rows = {
        package: dict(spread(of["seconds"]), modules=of["modules"], bytes=of["bytes"])
        for package, of in found.items()
    }
    packages = [set(of["packages"]) for of in found.values()]
    return dict(
        rows=rows, own_modules_ms=sum(row["microseconds"] for row in imported["own"]) / 1e3,
        slowest_own=imported["own"][:3], beyond_dolfinx=sorted(packages[-1] - packages[0]),
    )  # fmt: skip
