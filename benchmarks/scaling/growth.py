# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Growth: seconds, iterations and memory of a step of the punch against unknowns, solver by solver."""

from __future__ import annotations

from time import process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np

from benchmarks.measurement import Measurement, Memory
from benchmarks.report.drawing import legend, logarithmic, panels, style
from benchmarks.scaling.elastic_ratio import elastic_solve as yardstick
from mechanics.convergence import exponent
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
    return yardstick(body, b, 1)["seconds"][0]


def evaluate(results: dict) -> dict:
    """Rows by solver and size, and exponents."""
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
    return dict(rows=rows, refused=refused, exponents=exponents(rows))


def exponents(rows: list[dict]) -> list[dict]:
    """Of the growth with the unknowns, from 500 of them on, solver by solver."""
    found = []
    for solver in dict.fromkeys(row["solver"] for row in rows):
        of = [row for row in rows if row["solver"] == solver and row["unknowns"] > 500]
        sizes = [row["unknowns"] for row in of]
        found.append(dict(solver=solver, from_unknowns=min(sizes, default=0), to_unknowns=max(sizes, default=0)) | {
            key: exponent(sizes, [row[key] for row in of]) if len(of) > 1 and all(row[key] > 0 for row in of) else None
            for key in ("step", "iterations", "bytes")
        })  # fmt: skip
    return found


def figures(data):
    figure, axes = panels(3, 3, (4.4, 4.0))
    titles = "processor seconds a step", "iterations a step", "memory beyond mesh and forms [MB]"
    for ax, key, title in zip(axes, ("step", "iterations", "bytes"), titles):
        for solver in dict.fromkeys(row["solver"] for row in data["rows"]):
            of = [row for row in data["rows"] if row["solver"] == solver and row[key] > 0]
            y = np.array([row[key] for row in of]) * (1e-6 if key == "bytes" else 1)
            if of or key == "step":  # an elastic solve: seconds alone were measured
                ax.plot([row["unknowns"] for row in of], y, **style(solver))
        # Where other work had taken the memory before, the quick report finds none that was added.
        logarithmic(ax)
        ax.set(xlabel="unknowns", ylabel=title)
    legend(figure, axes[0], 3)
    yield (
        "growth",
        figure,
        "Punch, case C, pressed in one step and raised by two of the paper's ten: cost of a step against unknowns.",
    )


def tables(data):
    yield data["exponents"]
    yield [
        {
            "solver": row["solver"], "takes": row["chosen"], "unknowns": row["unknowns"], "contact nodes": row["nodes"] or None,
            "s a step": row["step"], "over an elastic solve": row["over_elastic"], "set-up [s]": row["setup"] or None,
            "iterations a step": row["iterations"] or None, "MB": row["bytes"] / 1e6 or None,
        }
        for row in data["rows"]
    ]  # fmt: skip
    yield [{"refused": text} for text in data["refused"]]
