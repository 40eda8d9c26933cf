# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Growth: seconds, iterations and memory of a step of the punch against unknowns, solver by solver."""

from __future__ import annotations

import numpy as np

from benchmarks.measurement import SOLVERS, Measurement, timed
from benchmarks.report.drawing import column, legend, logarithmic, panels, style
from benchmarks.scaling.elastic_ratio import measured, step_to
from benchmarks.tables import chosen
from studies.punch import Parameters, Punch, programme

TITLE = "Growth"
CAPTION = "Punch, case C, pressed in one step and raised by two of the paper's ten: cost of a step against unknowns."
ALL = SOLVERS | {"solver=None": lambda: None}
# Divisions and layers of the mesh; but for one solver those beyond the fifth only cost time.
SIZES = [(2, 2), (4, 2), (8, 4), (12, 6), (16, 8), (24, 12), (32, 16), (48, 24)]
FARTHEST = "fixed point, return"


def plan(size: str) -> list[Measurement]:
    sizes = dict(full=SIZES[1:], quick=SIZES[1:4], smallest=SIZES[:2])[size]
    return [
        Measurement(
            f"growth/{name}_{divisions}", "benchmarks.scaling.growth:steps",
            dict(name=name, divisions=divisions, layers=layers), late=divisions > 16,
        )
        for divisions, layers in sizes for name in ALL
        if name == FARTHEST or size != "smallest" and (divisions, layers) in SIZES[:5]
    ]  # fmt: skip


def steps(name: str, divisions: int, layers: int) -> dict:
    """Case C: pressed in one step, raised by two of the paper's ten, so that two of three reverse slip; tol 1e-8.

    Beside them, in the same process, one linear elastic solve of the same body: conjugate gradients with the
    library's multigrid, from zero to 1e-10.
    """
    parameters = Parameters(case="C", loading=1, tol=1e-8)
    punch = Punch(parameters, solver=ALL[name](), divisions=divisions, layers=layers)
    displacements = programme(parameters)[:3]
    record = measured(punch, displacements)
    steps, said, again = record["steps"], record["steps"][-1].get("failed", ""), float("nan")
    if not said:  # the first step once more, to know its set-up
        punch.problem.reset()
        again, _ = timed(step_to, punch, displacements[0])
    return dict(
        unknowns=record["unknowns"], nodes=len(punch.contact.nodes), seconds=[step["seconds"] for step in steps],
        iterations=[step["iterations"] for step in steps], first_again=again, said=said, chosen=steps[0].get("solver"),
        elastic=[of["seconds"][0] for of in record["elastic"]], bytes=record["bytes_per_unknown"] * record["unknowns"],
    )  # fmt: skip


def evaluate(results: dict) -> dict:
    """Rows by solver and size, and exponents."""
    rows, refused, elastic = [], [], {}
    for name, result in results.items():
        solver = name.split("/")[1].rpartition("_")[0]
        elastic.setdefault(result["unknowns"], []).extend(result["elastic"])
        if result["said"]:
            refused.append(f"{solver} at {result['unknowns']} unknowns ({result['said'][:90]})")
            continue
        rows.append(dict(
            solver=solver, step=float(np.mean([result["first_again"], *result["seconds"][1:]])),
            setup=max(result["seconds"][0] - result["first_again"], 0.0),
            **{key: result[key] for key in ("unknowns", "nodes", "bytes", "chosen")},
            iterations=float(np.mean(result["iterations"])),
        ))  # fmt: skip
    for unknowns, seconds in elastic.items():
        rows.append(dict(solver="elastic solve", unknowns=unknowns, step=float(np.median(seconds))))
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
        line = dict(solver=solver, from_unknowns=min(sizes, default=0), to_unknowns=max(sizes, default=0))  # fmt: skip
        for key in ("step", "iterations", "bytes"):
            values = [row[key] for row in of if row.get(key)]
            line[key] = exponent(sizes, values) if len(sizes) == len(values) > 1 else None
        found.append(line)
    return found


def exponent(sizes, values) -> float:
    """p of ``value = c size^p``, by least squares of logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def figure(data):
    figure, axes = panels(3)
    titles = "processor seconds a step", "iterations a step", "memory beyond mesh and forms [MB]"
    for ax, key, title, unit in zip(axes, ("step", "iterations", "bytes"), titles, (1, 1, 1e-6)):
        for solver in dict.fromkeys(row["solver"] for row in data["rows"]):
            of = [row for row in data["rows"] if row["solver"] == solver]
            ax.plot(column(of, "unknowns"), column(of, key, unit), **style(solver))
        logarithmic(ax)
        ax.set(xlabel="unknowns", ylabel=title)
    legend(figure, axes[0])
    return figure


def tables(data):
    titles = dict(
        solver="solver", chosen="takes", unknowns="unknowns", nodes="contact nodes", step="s a step",
        over_elastic="over an elastic solve", setup="set-up [s]", iterations="iterations a step", MB="MB",
    )  # fmt: skip
    yield data["exponents"]
    # What was not measured of an elastic solve may be there as a zero.
    rows = [dict(row, MB=1e-6 * row.get("bytes", 0)) for row in data["rows"]]
    yield chosen([{key: value or None for key, value in row.items()} for row in rows], titles)
    yield [{"refused": text} for text in data["refused"]]
