# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Growth: seconds, iterations and memory of a step of the punch against unknowns, solver by solver."""

from __future__ import annotations

from time import process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np

from benchmarks.measurement import Measurement, Memory
from benchmarks.scaling.elastic_ratio import elastic_solve as yardstick
from studies.punch import Parameters, Punch, programme

TITLE = "Growth"
SOLVERS = {
    "condensed Newton": dc.CondensedNewton,
    "fixed point, return": dc.FixedPoint,
    "fixed point, bipotential": lambda: dc.FixedPoint(map="bipotential"),
    "solver=None": lambda: None,
}
# Divisions and layers of the mesh, and up to which size each solver is measured: beyond, it only costs time.
SIZES = [(2, 2), (4, 2), (8, 4), (12, 6), (16, 8), (24, 12), (32, 16), (48, 24)]
LAST = {"condensed Newton": 5, "fixed point, bipotential": 5, "solver=None": 5}
CYCLE = 15  # steps of the paper's cycle
FREE = 1.1  # the choice of solver=None is right if no other solver is faster by more than this


def plan(size: str) -> list[Measurement]:
    sizes = dict(full=SIZES[1:], quick=SIZES[1:4], smallest=SIZES[:2])[size]
    names = ["fixed point, return"] if size == "smallest" else SOLVERS
    return [
        Measurement(
            f"growth/{name}_{divisions}".replace(" ", "_"), "benchmarks.scaling.growth:steps",
            dict(name=name, divisions=divisions, layers=layers), late=divisions > 16,
        )
        for divisions, layers in sizes for name in names
        if SIZES.index((divisions, layers)) < LAST.get(name, len(SIZES))
    ]  # fmt: skip


def steps(name: str, divisions: int, layers: int) -> dict:
    """Case C: pressed in one step, raised by two of the paper's ten, so that two of three reverse slip; tol 1e-8.

    Beside them, in the same process, one linear elastic solve of the same body: conjugate gradients with the
    library's multigrid, from zero to 1e-10.
    """
    parameters = Parameters(case="C", loading=1, tol=1e-8)
    punch = Punch(parameters, divisions=divisions, layers=layers)
    problem, displacements = punch.problem, programme(parameters)[:3]
    solver = SOLVERS[name]()
    if solver is not None:
        problem.solver = solver
    elastic = [elastic_solve(punch)]
    problem.body.forget()  # the first step assembles for itself
    memory = Memory()
    seconds, iterations, said, chosen = [], [], "", ""
    for displacement in displacements:
        punch.approach.value = -displacement
        start = process_time()
        try:
            step = problem.solve()
        except (dc.NotConverged, MemoryError) as failure:
            said = f"{type(failure).__name__}: {str(failure)[:150]}"
            break
        seconds.append(process_time() - start)
        iterations.append(step.iterations)
        chosen = step.solver
    added = memory.added()
    elastic.append(elastic_solve(punch))
    again = float("nan")
    if not said:  # the first step once more, to know its set-up
        problem.reset()
        punch.approach.value = -displacements[0]
        start = process_time()
        problem.solve()
        again = process_time() - start
    return dict(
        unknowns=problem.body.size, nodes=len(punch.contact.nodes), seconds=seconds, first_again=again,
        iterations=iterations, bytes=added, elastic=elastic, said=said, chosen=chosen,
    )  # fmt: skip


def elastic_solve(punch) -> float:
    """Processor seconds of K u = b by conjugate gradients with multigrid, set-up left out."""
    body = punch.problem.body
    punch.approach.value = -punch.parameters.depth
    body.refresh()
    b, _ = body.load()
    return yardstick(body, b, 1, process_time)["seconds"][0]


def evaluate(results: dict) -> dict:
    """Rows by solver and size, exponents, and whether ``solver=None`` takes the best at each size."""
    rows, refused, elastic = [], [], {}
    for name, result in results.items():
        solver = next(s for s in SOLVERS if f"/{s}_".replace(" ", "_") in name)
        elastic.setdefault(result["unknowns"], []).extend(result["elastic"])
        if result["said"]:
            refused.append(f"{solver} at {result['unknowns']} unknowns ({result['said'][:90]})")
            continue
        warm = [result["first_again"], *result["seconds"][1:]]
        rows.append(dict(
            solver=solver, unknowns=result["unknowns"], nodes=result["nodes"], step=float(np.mean(warm)),
            setup=max(result["seconds"][0] - result["first_again"], 0.0), bytes=result["bytes"],
            iterations=float(np.mean(result["iterations"])), chosen=result["chosen"],
        ))  # fmt: skip
    for unknowns, seconds in elastic.items():
        rows.append(dict(solver="elastic solve", unknowns=unknowns, nodes=0, step=float(np.median(seconds)),
            setup=0.0, bytes=0, iterations=0.0, chosen=""))  # fmt: skip
    rows.sort(key=lambda row: (row["solver"], row["unknowns"]))
    for row in rows:
        row["over_elastic"] = row["step"] / float(np.median(elastic[row["unknowns"]]))
    return dict(rows=rows, refused=refused, fits=fits(rows), choices=choices(rows))


def fits(rows: list[dict]) -> dict:
    """Exponents of the growth with the unknowns, least squares of logarithms, from 1e3 unknowns on."""
    found = {}
    for solver in (*SOLVERS, "elastic solve"):
        of = [row for row in rows if row["solver"] == solver and row["unknowns"] > 500]
        if solver == "solver=None" or not of:
            continue
        found[solver] = {
            key: float(np.polyfit(np.log([r["unknowns"] for r in of]), np.log([r[key] for r in of]), 1)[0])
            if len(of) > 1 and all(r[key] > 0 for r in of) else None
            for key in ("step", "iterations", "bytes")
        }  # fmt: skip
    return found


def choices(rows: list[dict]) -> list[dict]:
    """At each size, for a cycle with its set-up and for many steps: the best solver, what ``solver=None`` took, its price."""
    found = []
    for auto in (row for row in rows if row["solver"] == "solver=None"):
        others = [
            row for row in rows
            if row["unknowns"] == auto["unknowns"] and row["solver"] in list(SOLVERS)[:3]
        ]  # fmt: skip
        taken = auto["chosen"].split()[0]
        name = {"CondensedNewton": "condensed Newton", "FixedPoint": "fixed point, return"}[taken]
        same = next((row for row in others if row["solver"] == name), auto)
        if len(others) < 2:
            continue
        for what, cost in (
            ("a cycle", lambda row: row["setup"] + CYCLE * row["step"]),
            ("many steps", lambda row: row["step"]),
        ):
            best = min(others, key=cost)
            loss = cost(same) / cost(best)
            found.append(dict(unknowns=auto["unknowns"], what=what, auto=taken, best=best["solver"], loss=loss,
                right=loss <= FREE))  # fmt: skip
    return found
