# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Total error of the paper's punch, mesh and increments and solver together, against seconds: ours and peers."""

from __future__ import annotations

from time import process_time

import numpy as np
from matplotlib.figure import Figure

from benchmarks.measurement import Measurement
from benchmarks.peers import best
from benchmarks.report.drawing import column
from benchmarks.tables import chosen
from studies.punch.accuracy import NotAccurate, accurate
from studies.punch.limits import LIMITS, build, graded, uniform
from studies.punch.model import Parameters, programme

TITLE = "Total error against seconds"
CAPTION = (
    "One cycle of the paper's punch, a quarter of it: relative error against the limits of mesh and increments, over processor "
    "seconds with mesh, forms and factors (n: cells along each side of the five blocks of the disc, 8 in the paper's mesh); without imports and compilers, but for CalculiX, whose whole process is counted. 15 "
    "increments unless the table says otherwise. Grey: less than half the width to which a limit is known, where an error says no "
    "more than that. Peers know isotropic friction alone, case A, and have the same graded meshes. Lines that cross the limit "
    "dip: the sign of an error is not drawn. Sums of tangential magnitudes and nodal pressures are not defined on C3D20R. The "
    "peak pressure is not shown: it is at the rim of the disc, where the pressure is singular, and grows with every finer mesh; "
    "the pressure at the centre takes its place, with a limit from our two finest meshes."
)
QUANTITIES = dict(
    normal="normal force, loaded", tangential="sum of tangential forces, loaded", dissipation="frictional work",
    centre="pressure at the centre, loaded",
)  # fmt: skip
TOL = 1e-8
# Mesh, order and divisions of a family; the paper's increments.
FAMILIES = {
    "uniform, first order": (uniform, 1, (4, 8, 16, 24)),
    "graded, first order": (graded, 1, (4, 8, 12, 16)),
    "graded, second order": (graded, 2, (2, 4, 6, 8)),
}
RECIPE, ADAPTED = "recipe: increments, tolerance and mesh balanced", "adapted"
# Divisions of the graded second order, times the paper's increments for the associated rule (A, B) and for another one (C), and
# tolerance: increments and mesh err by about the same (notes/2026-11-23-punch-limits.md), the solver by far less.
BALANCED = [[2, 1, 1, 1e-4], [4, 1, 2, 1e-4], [6, 2, 8, 1e-5], [8, 2, 8, 1e-5]]
ASKED = (0.05, 0.02, 0.01)
TOLERANCES = [1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1]
# Peer, divisions and times the paper's increments; what is finer takes more than three minutes.
PEERS = [
    ("GetFEM, Q1", 4, 1),
    ("GetFEM, Q1", 8, 1),
    ("GetFEM, Q2", 2, 1),
    ("GetFEM, Q2", 4, 1),
]
PEERS += [("CalculiX, C3D8", 4, 1), ("CalculiX, C3D8", 8, 1)]
PEERS += [("CalculiX, C3D20R", n, times) for n, times in ((2, 1), (2, 2), (4, 1), (4, 2))]
CAP = 170


def plan(size: str) -> list[Measurement]:
    home, cases = "benchmarks.report.total", "A" if size == "smallest" else "ABC"
    last = dict(full=None, quick=2, smallest=1)[size]
    plans = [
        Measurement(f"total/{name}", f"{home}:family", dict(name=name, divisions=list(of[2][:last]), cases=cases))
        for name, of in FAMILIES.items()
    ]  # fmt: skip
    plans.append(Measurement("total/recipe", f"{home}:recipe", dict(rows=BALANCED[:last], cases=cases)))  # fmt: skip
    asked = [0.5] if size == "smallest" else list(ASKED[:last])
    plans += [
        Measurement(f"total/adapted {case}", f"{home}:adapted", dict(case=case, asked=asked))
        for case in cases
    ]
    plans.append(Measurement("total/tolerance", f"{home}:tolerances", dict(tols=TOLERANCES[:last])))  # fmt: skip
    finest = [4, 2, 6] if size != "full" else [16, 10, 8]
    if size != "smallest":
        plans.append(Measurement("total/centre", f"{home}:centre", dict(finest=finest)))
    return plans + [
        Measurement(f"total/{peer} {n} {times}", "benchmarks.peers.best:best", late=n * times > 4,
            settings=dict(peer=peer, divisions=n, times=times, cap=CAP))
        for peer, n, times in PEERS if size == "full" or n * times == 2
    ]  # fmt: skip


def family(name: str, divisions: list, cases: str) -> list[dict]:
    """A cycle of each case on each mesh with the paper's increments."""
    make, order, _ = FAMILIES[name]
    build(make(divisions[0], order=order))  # compiles and imports, which is not counted
    rows = []
    for n in divisions:
        punch, set_up = build(make(n, order=order), tol=TOL)
        rows += [
            cycle(punch, case, 1) | dict(divisions=n, tol=TOL, set_up=set_up) for case in cases
        ]
    return counted(rows, name)


def recipe(rows: list, cases: str) -> list[dict]:
    build(graded(2))
    found = []
    for n, associated, other, tol in rows:
        punch, set_up = build(graded(n), tol=tol)
        for case in cases:
            times = other if case == "C" else associated
            found.append(cycle(punch, case, times) | dict(divisions=n, tol=tol, set_up=set_up))
    return counted(found, RECIPE)


def adapted(case: str, asked: list) -> list[dict]:
    """The punch to an accuracy that is asked for; seconds of all its meshes."""
    build(graded(2))
    rows = []
    for accuracy in asked:
        start = process_time()
        try:
            found = accurate(Parameters(case=case, tol=TOL), accuracy)
        except NotAccurate as short:
            found = short.found
        seconds = process_time() - start
        loaded = found.records[found.punch.parameters.loading - 1]
        rows.append(forces(found.punch, loaded) | dict(
            case=case, asked=accuracy, estimated=found.error, divisions=max(n for n, *_ in found.tried), set_up=0.0,
            increments=len(found.records), dissipation=found.dissipation, seconds=seconds, tol=TOL,
        ))  # fmt: skip
    return counted(rows, ADAPTED)


def tolerances(tols: list) -> list[dict]:
    """One cycle of C on one mesh, solved to one tolerance after the other."""
    rows = []
    for tol in tols:
        punch, set_up = build(graded(4), tol=tol)
        rows.append(cycle(punch, "C", 2) | dict(divisions=4, tol=tol, set_up=set_up))
    return counted(rows, "tolerance")


def centre(finest: list) -> dict:
    """Pressure at the centre on the finest meshes, first and second order, and half of what is left to know."""
    first, second, coarser = finest
    found = {}
    for run in (graded(first, order=1), graded(second), graded(coarser)):
        punch, _ = build(run, tol=TOL)
        found[run] = {case: cycle(punch, case, 1)["centre"] for case in "ABC"}
    one, two, three = found.values()
    return {
        case: (two[case], max(abs(one[case] - two[case]), abs(three[case] - two[case])))
        for case in two
    }


def cycle(punch, case: str, times: int) -> dict:
    """One cycle with ``times`` the paper's increments: quantities, and processor seconds without the set-up."""
    start, of = process_time(), Parameters()
    punch.restart(case=case, loading=times * of.loading, unloading=times * of.unloading)
    row = {}
    for number, displacement in enumerate(programme(punch.parameters), start=1):
        record = punch.press(displacement)
        if number == punch.parameters.loading:
            middle = np.linalg.norm(punch.contact.x[:, :2], axis=1).argmin()
            row = forces(punch, record) | dict(centre=float(punch.contact.pressure[middle]))
    row |= dict(dissipation=punch.dissipation(), increments=number, case=case)
    return row | dict(seconds=process_time() - start)


def forces(punch, loaded: dict) -> dict:
    names = dict(normal="normal_reaction", tangential="tangential_reaction_sum")
    return {key: loaded[name] for key, name in names.items()} | dict(
        unknowns=punch.problem.body.size
    )


def counted(rows: list, name: str) -> list[dict]:
    """Rows of a family, the set-up in the seconds of each."""
    return [row | dict(family=name, seconds=row["seconds"] + row["set_up"]) for row in rows]


def evaluate(results: dict) -> dict:
    """All rows with their errors, relative to the limits; the limits, and half their widths."""
    known = {case: dict(of) for case, of in LIMITS.items()}
    for case, (value, half) in results.get("total/centre", {}).items():
        known[case]["centre"] = (value, half)
    rows, absent, stopped = [], [], []
    for result in results.values():
        for row in result if isinstance(result, list) else [result]:
            if "absent" in row:
                absent.append(row["absent"])
            elif row.get("said"):
                stopped.append(row)
            elif "case" in row:
                rows.append(row | errors(row, known[row["case"]]))
    for row in rows:
        row.setdefault("family", row.get("peer"))
    tolerance = [row for row in rows if row["family"] == "tolerance"]
    return dict(rows=[row for row in rows if row["family"] != "tolerance"], tolerance=tolerance, limits=known,
        absent=sorted(set(absent)), stopped=stopped)  # fmt: skip


def errors(row: dict, limits: dict) -> dict:
    """Relative errors of what a row has; None where it says that a quantity is not defined."""
    if lacking := [
        key for key in ("normal", "tangential", "dissipation", "seconds") if key not in row
    ]:
        raise ValueError(f"the row {row} lacks {lacking}: measure it again.")
    return {
        f"{key}_error": abs(row[key] / limits[key][0] - 1)
        for key in QUANTITIES
        if row.get(key) is not None and key in limits
    }


STYLES = {
    "uniform, first order": ("#555555", "s-"),
    "graded, first order": ("#e69f00", "^-"),
    "graded, second order": ("#0072b2", "o-"),
    RECIPE: ("#009e73", "D-"),
    ADAPTED: ("#cc79a7", "*--"),
} | dict(
    zip(best.BRICKS, [("#d55e00", "1:"), ("#d55e00", "x-"), ("#7a4a00", "2:"), ("#7a4a00", "+-")])
)
LEAST = 1e-5  # of an error that is drawn


def figure(data):
    cases = sorted({row["case"] for row in data["rows"]})
    figure = Figure(figsize=(19, 4.4 * len(cases) + 1.2), layout="constrained")
    grid = figure.subplots(len(cases), len(QUANTITIES), sharex=True, sharey="col", squeeze=False)
    handles = {}
    for case, line in zip(cases, grid):
        for ax, (key, title) in zip(line, QUANTITIES.items()):
            ax.set(xscale="log", yscale="log", title=f"{case}: {title}")
            for name, (colour, style) in STYLES.items():
                for label, rows in curves(data["rows"], name, case):
                    x, y = column(rows, "seconds"), np.maximum(column(rows, f"{key}_error"), LEAST)
                    handles[label] = ax.plot(x, y, style, color=colour, ms=7, mew=1.8)[0]
            if key in data["limits"][case]:
                value, half = data["limits"][case][key]
                ax.axhspan(LEAST, half / value, color="0.5", alpha=0.2, lw=0)
            ax.set_ylim(bottom=LEAST)
        line[0].set_ylabel("relative error")
    for ax in grid[-1]:
        ax.set_xlabel("processor seconds, set-up included")
    figure.legend(handles.values(), handles, loc="outside upper center", frameon=False, ncols=3)
    return figure


def curves(rows: list[dict], name: str, case: str):
    """A line of a family with the same increments over the paper's; the recipe and the adapted runs are one line."""
    of = [row for row in rows if row["family"] == name and row["case"] == case]
    alike = name in (RECIPE, ADAPTED)
    for increments in [None] if alike else sorted({row["increments"] for row in of}):
        line = [row for row in of if alike or row["increments"] == increments]
        label = name if increments in (None, 15) else f"{name}, {increments} increments"
        if line:
            yield label, sorted(line, key=lambda row: row["seconds"])


def tables(data):
    titles = dict(
        family="family", case="case", divisions="n", increments="increments", tol="tolerance", asked="asked", estimated="estimated",
        unknowns="unknowns", seconds="s",
    )  # fmt: skip
    titles |= {f"{key}_error": f"error of {name}" for key, name in QUANTITIES.items()}
    yield chosen(data["rows"], titles)
    yield limit_rows(data["limits"])
    titles = dict(
        tol="tolerance, case C, n = 4, 30 increments",
        seconds="s",
        dissipation="frictional work [N mm]",
    )
    yield chosen(data["tolerance"], titles)
    yield chosen(
        data["stopped"],
        dict(
            peer="did not end",
            divisions="n",
            increments="increments",
            done="steps done",
            said="said",
        ),
    )
    yield [{"not compared": text} for text in data["absent"]]


def limit_rows(limits: dict) -> list[dict]:
    units = dict(normal="N", tangential="N", dissipation="N mm", centre="MPa")
    return [
        {"limit": case}
        | {
            f"{QUANTITIES[key]} [{units[key]}]": f"{value:.6g} ± {float(f'{half:.2g}'):g}"
            for key, (value, half) in of.items()
        }
        for case, of in limits.items()
    ]
