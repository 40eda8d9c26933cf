# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Work and precision of the discretisation: meshes, increments and tolerances of the punch."""

from __future__ import annotations

import numpy as np

import dolfinx_contact as dc
from benchmarks.measurement import Measurement, spread, timed
from benchmarks.report.drawing import column, logarithmic, panels
from benchmarks.tables import chosen
from mechanics.convergence import richardson
from studies.punch import Parameters, Punch, programme

TITLE = "Work and precision, discretisation"
CAPTION = (
    "Punch, case C, one cycle: error of mesh, increments and tolerance against Richardson's limits."
)
PAPER = 0  # level of the paper's mesh; each level halves the cells
# Level of the mesh, times the paper's increments, 5 + 10, and tolerance.  Twice the increments on other meshes: do the
# two errors depend on each other?
QUICK = [(-1, 1, 1e-10), (0, 1, 1e-10), (1, 1, 1e-10), (0, 2, 1e-10), (0, 4, 1e-10), (-1, 2, 1e-10)]
QUICK += [(PAPER, 1, tol) for tol in (1e-2, 1e-3, 1e-4, 1e-6, 1e-8)]
FULL = [*QUICK, (2, 1, 1e-10), (0, 8, 1e-10), (1, 2, 1e-10)]
RUNS = dict(full=FULL, quick=QUICK, smallest=[(-2, 1, 1e-8), (-1, 1, 1e-8)])
QUANTITIES = dict(normal="total reaction", dissipation="work of friction", stick="edge of the stick zone")  # fmt: skip
FAMILIES = dict(meshes="width of a cell [mm]", increments="increments of a cycle", tolerances="tolerance")  # fmt: skip
NOISE = 1e-9  # relative; ten times the tolerance of the runs
AGAIN = 20.0  # seconds: what takes less is repeated, three times at most


def plan(size: str) -> list[Measurement]:
    return [
        Measurement(f"meshes/punch_{refine}_{times}_{tol:g}", "benchmarks.report.meshes:punch",
            dict(refine=refine, times=times, tol=tol), late=refine > 1)
        for refine, times, tol in RUNS[size]
    ]  # fmt: skip


def punch(refine: int, times: int, tol: float) -> dict:
    """One cycle: total reaction and radius of the stick zone when loaded, work of friction of the cycle.

    Seconds are those of all steps with assembly, factorisation and condensed operator, without the mesh.
    """
    steps, seconds = dict(loading=5 * times, unloading=10 * times), []
    while not seconds or len(seconds) < 3 and sum(seconds) < AGAIN:
        body = Punch(Parameters(case="C", **steps, tol=tol, refine=refine))
        spent, found = timed(cycle, body)
        seconds.append(spent)
    return found | dict(
        seconds=spread(seconds), refine=refine, unknowns=body.problem.body.size, nodes=len(body.contact.nodes),
        h=2.5 / 2**refine, increments=15 * times, tol=tol,
    )  # fmt: skip


def cycle(body: Punch) -> dict:
    contact, iterations = body.contact, 0
    for k, displacement in enumerate(programme(body.parameters), start=1):
        iterations += body.press(displacement)["iterations"]
        if k == body.parameters.loading:
            normal = float(contact.reaction[:, 2].sum())
            stick = contact.area[contact.status == dc.Status.STICK].sum() / contact.area.sum()
    radius = float(body.parameters.radius * np.sqrt(stick))
    work = float(contact.dissipation.sum())
    return dict(normal=normal, dissipation=work, stick=radius, iterations=iterations)


def evaluate(results: dict) -> dict:
    """Rows and errors of each family, and orders."""
    runs = sorted(results.values(), key=lambda run: run["unknowns"])
    tight = min((run["tol"] for run in runs), default=None)

    def rows(step, **fixed):
        of = [dict(r, x=r[step]) for r in runs if fixed.items() <= r.items()]
        return sorted(of, key=lambda r: r["x"] if step == "increments" else -r["x"])

    families = dict(
        meshes=rows("h", increments=15, tol=tight),
        increments=rows("increments", refine=PAPER, tol=tight),
        tolerances=rows("tol", refine=PAPER, increments=15),
    )
    orders = {family: {} for family in families}
    for family, of in families.items():
        for key in QUANTITIES:
            values = [r[key] for r in of]
            if family == "tolerances":
                limit = values[-1] if of else None
            else:
                widths = [r["x"] if family == "meshes" else 1 / r["x"] for r in of]
                limit, orders[family][key] = richardson(widths, values)
            for row in of:
                known = limit and row[key] != limit
                row[f"{key}_error"] = abs(row[key] / limit - 1) if known else None
    twice = [
        dict(unknowns=r["unknowns"], change=r["dissipation"] / once["dissipation"] - 1)
        for r in runs if r["increments"] == 30 and r["tol"] == tight
        for once in families["meshes"] if once["refine"] == r["refine"]
    ]  # fmt: skip
    return dict(**families, orders=orders, case="C", twice=twice)


def figure(data):
    figure, axes = panels(4, columns=2)
    for ax, (family, label), marker in zip(axes, FAMILIES.items(), "os^"):
        rows, orders = data[family], data["orders"][family]
        for key, name in QUANTITIES.items():
            error = column(rows, f"{key}_error")
            error[error <= NOISE] = np.nan  # what the tolerance leaves is of neither of them
            said = f"{name}, order {orders[key]:.1f}" if orders.get(key) else name
            ax.plot(column(rows, "x"), error, marker=marker, label=said)
            if key == "dissipation":
                seconds = [row["seconds"]["median"] for row in rows]
                axes[3].plot(seconds, error, marker=marker, label=f"{family} refined")
        ax.set(xlabel=label, ylabel="relative error")
    axes[3].set(xlabel="processor seconds of a cycle", ylabel="error of the work of friction")
    for ax, family in zip(axes, (*FAMILIES, None)):
        logarithmic(ax)
        ax.legend(fontsize=9)
        if family in ("meshes", "increments") and ax.get_xscale() == "log":
            widths = column(data[family], "x")
            ax.set_xticks(widths, [f"{width:.3g}" for width in widths])
            ax.set_xticks([], minor=True)
    return figure


def tables(data):
    shown = {"normal": "total reaction [N]", "dissipation": "work of friction [N mm]"}
    shown |= {"stick": "stick edge [mm]", "seconds": "s"}
    shown |= {f"{key}_error": f"error of {key}" for key in QUANTITIES}
    for family in FAMILIES:
        rows = [dict(row, seconds=row["seconds"]["median"]) for row in data[family]]
        yield chosen(rows, {"unknowns" if family == "meshes" else "x": family, **shown})
    said = "twice the increments change the work by"
    yield chosen(data["twice"], dict(unknowns="unknowns", change=said))
