# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Work and precision of the discretisation: meshes, increments and tolerances of the punch."""

from __future__ import annotations

from time import process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np

from benchmarks.measurement import Measurement, spread
from benchmarks.report.drawing import logarithmic, panels
from mechanics.convergence import richardson
from studies.punch import Parameters, Punch, programme

TITLE = "Work and precision, discretisation"
PAPER = 0  # level of the paper's mesh; each level halves the cells
MESHES = [-1, 0, 1, 2]
TIMES = [1, 2, 4, 8]  # the paper's increments, 5 + 10
TOLERANCES = [1e-2, 1e-3, 1e-4, 1e-6, 1e-8]
TIGHT = 1e-10
CASE = "C"
QUANTITIES = ("normal", "dissipation", "stick")
NOISE = 1e-9  # relative; ten times the tolerance of the runs
AGAIN = 20.0  # seconds: what takes less is repeated, three times at most


def plan(size: str) -> list[Measurement]:
    full = size == "full"
    if size == "smallest":
        kinds = [(-2, 1, 1e-8), (-1, 1, 1e-8)]
    else:
        kinds = [(refine, 1, TIGHT) for refine in (MESHES if full else MESHES[:3])]
        kinds += [(PAPER, times, TIGHT) for times in (TIMES if full else TIMES[:3])[1:]]
        # The same increments on other meshes: do the two errors depend on each other?
        kinds += [(refine, 2, TIGHT) for refine in ((-1, 1) if full else (-1,))]
        kinds += [(PAPER, 1, tol) for tol in TOLERANCES]
    return [
        Measurement(f"meshes/punch_{refine}_{times}_{tol:g}", "benchmarks.report.meshes:punch",
            dict(refine=refine, times=times, tol=tol), late=refine > 1)
        for refine, times, tol in kinds
    ]  # fmt: skip


def punch(refine: int, times: int, tol: float) -> dict:
    """One cycle: total reaction and radius of the stick zone when loaded, work of friction of the cycle.

    Seconds are those of all steps with assembly, factorisation and condensed operator, without the mesh.
    """
    parameters = Parameters(case=CASE, loading=5 * times, unloading=10 * times, tol=tol, refine=refine)  # fmt: skip
    seconds = []
    while not seconds or len(seconds) < 3 and sum(seconds) < AGAIN:
        body = Punch(parameters)
        start, iterations = process_time(), 0
        for k, displacement in enumerate(programme(parameters), start=1):
            iterations += body.press(displacement)["iterations"]
            if k == parameters.loading:
                contact, area = body.contact, body.contact.area
                normal = float(contact.reaction[:, 2].sum())
                stick = area[contact.status == dc.Status.STICK].sum() / area.sum()
        seconds.append(process_time() - start)
    return dict(
        normal=normal, stick=float(parameters.radius * np.sqrt(stick)), iterations=iterations,
        dissipation=float(body.contact.dissipation.sum()), seconds=spread(seconds), refine=refine,
        unknowns=body.problem.body.size, nodes=len(contact.nodes), h=2.5 / 2**refine, increments=15 * times, tol=tol,
    )  # fmt: skip


def evaluate(results: dict) -> dict:
    """Rows and errors of each family, and orders."""
    runs = list(results.values())
    tight = min((run["tol"] for run in runs), default=None)

    def rows(step, **fixed):
        of = [r for r in runs if all(r[key] == value for key, value in fixed.items())]
        of = [dict(r, x=r[step]) for r in of]
        return sorted(of, key=lambda r: r["increments"] if step == "increments" else -r["x"])

    families = dict(
        meshes=rows("h", increments=15, tol=tight),
        increments=rows("increments", refine=PAPER, tol=tight),
        tolerances=rows("tol", refine=PAPER, increments=15),
    )
    orders = {}
    for family, of in families.items():
        orders[family] = {}
        for key in QUANTITIES:
            if family == "tolerances":
                limit = of[-1][key] if of else None
            else:
                widths = [r["x"] if family == "meshes" else 1 / r["x"] for r in of]
                limit, orders[family][key] = richardson(widths, [r[key] for r in of])
            for row in of:
                row[f"{key}_error"] = (
                    abs(row[key] / limit - 1) if limit and row[key] != limit else None
                )
    twice = [
        dict(unknowns=r["unknowns"], change=r["dissipation"] / once["dissipation"] - 1)
        for r in sorted(runs, key=lambda r: r["unknowns"])
        for once in families["meshes"]
        if r["increments"] == 30 and r["tol"] == tight and once["refine"] == r["refine"]
    ]
    return dict(**families, orders=orders, case=CASE, twice=twice)


def figures(data):
    names = dict(normal="total reaction", dissipation="work of friction", stick="edge of the stick zone")  # fmt: skip
    families = dict(meshes="width of a cell [mm]", increments="increments of a cycle", tolerances="tolerance")  # fmt: skip
    figure, axes = panels(4, 2, (5.6, 4.0))
    for ax, (family, label), marker in zip(axes, families.items(), "os^"):
        rows = data[family]
        for key, name in names.items():
            order = data["orders"][family].get(key)
            errors = [above_noise(row, key) for row in rows]
            ax.plot([row["x"] for row in rows], errors, marker=marker, label=name + (f", order {order:.1f}" if order else ""))  # fmt: skip
        ax.set(xlabel=label, ylabel="relative error")
        seconds = [row["seconds"]["median"] for row in rows]
        axes[3].plot(seconds, [above_noise(row, "dissipation") for row in rows], marker=marker, label=f"{family} refined")  # fmt: skip
    axes[3].set(xlabel="processor seconds of a cycle", ylabel="error of the work of friction")
    for ax in axes:
        logarithmic(ax)
        ax.legend(fontsize=9)
    yield (
        "discretisation",
        figure,
        (
            f"Punch, case {data['case']}, one cycle: error of mesh, increments and tolerance against Richardson's limits."
        ),
    )


def above_noise(row: dict, key: str) -> float:
    """What the tolerance leaves is no error of mesh or increments."""
    error = row[f"{key}_error"]
    return error if error is not None and error > NOISE else np.nan


def tables(data):
    for family in ("meshes", "increments", "tolerances"):
        yield [
            {
                family: f"{row['unknowns']:,} unknowns" if family == "meshes" else row["x"], "total reaction [N]": row["normal"],
                "work of friction [N mm]": row["dissipation"], "stick edge [mm]": row["stick"], "s": row["seconds"]["median"],
                **{f"error of {key}": row[f"{key}_error"] for key in QUANTITIES},
            }
            for row in data[family]
        ]  # fmt: skip
    yield [{"unknowns": row["unknowns"], "twice the increments change the work by": row["change"]} for row in data["twice"]]  # fmt: skip
