# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Work and precision of the discretisation: meshes, increments and tolerances of the punch; closed forms."""

from __future__ import annotations

from time import process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import demo_hertz
import demo_partial_slip
import numpy as np
from punch import Parameters, Punch, programme
from report_run import Measurement
from scipy.optimize import brentq

TITLE = "Work and precision, discretisation"
MESHES = [(4, 2), (8, 4), (12, 6), (16, 8)]  # divisions and layers; the second is the paper's
TIMES = [1, 2, 4, 8]  # the paper's increments, 5 + 10
TOLERANCES = [1e-2, 1e-3, 1e-4, 1e-6, 1e-8]
TIGHT = 1e-10
CASE = "C"
QUANTITIES = ("normal", "dissipation", "stick")


def plan(size: str) -> list[Measurement]:
    if size == "smallest":
        cells = {"hertz": [8, 16]}
        families = [("mesh", m, 1, 1e-8) for m in ((2, 1), (4, 2))]
    else:
        full = size == "full"
        cells = {"hertz": [16, 32, 64], "partial slip": [16, 32, 64] if full else [16, 32]}
        families = [("mesh", m, 1, TIGHT) for m in (MESHES if full else MESHES[:2])]
        families += [("mesh", (8, 4), k, TIGHT) for k in (TIMES if full else TIMES[:3])[1:]]
        families += [("mesh", (8, 4), 1, tol) for tol in TOLERANCES]
    runs = [
        Measurement(f"meshes/punch_{d}_{k}_{tol:g}", "report_meshes:punch", dict(divisions=d, layers=n, times=k, tol=tol), late=d > 12)
        for _, (d, n), k, tol in families
    ]  # fmt: skip
    return runs + [
        Measurement(f"meshes/{kind}_{count}".replace(" ", "_"), "report_meshes:closed", dict(kind=kind, cells=count))
        for kind, counts in cells.items() for count in counts
    ]  # fmt: skip


def punch(divisions: int, layers: int, times: int, tol: float) -> dict:
    """One cycle: total reaction and edge of the stick zone when loaded, dissipation of the cycle."""
    parameters = Parameters(case=CASE, loading=5 * times, unloading=10 * times, tol=tol)
    body = Punch(parameters, divisions=divisions, layers=layers)
    start, iterations = process_time(), 0
    for k, displacement in enumerate(programme(parameters), start=1):
        iterations += body.press(displacement)["iterations"]
        if k == parameters.loading:
            contact, area = body.contact, body.contact.area
            normal = float(contact.reaction[:, 2].sum())
            stick = area[contact.status == dc.Status.STICK].sum() / area.sum()
    return dict(
        normal=normal, stick=float(parameters.radius * np.sqrt(stick)), iterations=iterations,
        dissipation=float(body.contact.dissipation.sum()), seconds=process_time() - start,
        unknowns=body.problem.body.size, h=parameters.radius / layers, increments=15 * times, tol=tol,
    )  # fmt: skip


def closed(kind: str, cells: int) -> dict:
    """Errors of the demos' problems against their closed forms."""
    start = process_time()
    if kind == "hertz":
        found = demo_hertz.press(cells, 16 * demo_hertz.A, demo_hertz.FORCE)
        errors = {name: float(found[name]) for name in ("force", "moment", "pressure")}
    else:
        of = demo_partial_slip
        problem, held = of.cylinder(of.E, of.NU, cells=cells)
        contact, stroke = problem.contacts[0], of.A**2 / (2 * of.R)
        held.value[:] = 0.0, -3.0 * stroke
        problem.solve()
        pressed = of.observe(contact)
        half = np.sqrt(4 * pressed["P"] * of.R / (np.pi * of.E_STAR))
        errors = dict(width=float(np.sqrt(4 * pressed["moment_p"] / pressed["P"]) / half - 1))
        for displacement in (0.3, 0.6):
            contact.plane.displacement = np.array([displacement * stroke, 0.0])
            problem.solve()
        exact, measured = of.sticking_part(of.observe(contact), pressed, 1)
        errors["slip zone"] = float(measured - exact)
    return dict(kind=kind, cells=cells, errors=errors, seconds=process_time() - start)


def evaluate(results: dict) -> dict:
    """Rows and errors of each family, orders, closed forms, and what an accuracy costs."""
    runs = [result for name, result in results.items() if "/punch_" in name]
    best = min((run["tol"] for run in runs), default=None)
    base = dict(h=2.5, increments=15, tol=best)
    families = dict(
        meshes=sorted((r for r in runs if r["increments"] == 15 and r["tol"] == best), key=lambda r: -r["h"]),
        increments=sorted((r for r in runs if r["h"] == base["h"] and r["tol"] == best), key=lambda r: r["increments"]),
        tolerances=sorted((r for r in runs if r["h"] == base["h"] and r["increments"] == 15), key=lambda r: -r["tol"]),
    )  # fmt: skip
    steps = dict(meshes="h", increments="increments", tolerances="tol")
    labels = dict(meshes="{unknowns} unknowns", increments="{increments}", tolerances="{tol:g}")
    orders, tables = {}, {}
    for family, of in families.items():
        orders[family] = {}
        rows = [dict(r, x=r[steps[family]], label=labels[family].format(**r)) for r in of]
        for key in QUANTITIES:
            if family == "tolerances":
                limit = rows[-1][key] if rows else None
            else:
                limit, orders[family][key] = richardson([(r["x"], r[key]) for r in rows])
            for row in rows:
                row[f"{key}_error"] = (
                    abs(row[key] / limit - 1) if limit and row[key] != limit else None
                )
        tables[family] = rows
    return dict(**tables, orders=orders, case=CASE, closed=closed_forms(results),
        answers=[answer(tables, orders, percent) for percent in (1.0, 0.1)])  # fmt: skip


def richardson(points: list) -> tuple[float | None, float | None]:
    """Limit and order p of the last three values, ``value = limit + c width^p``, the widths in any ratios.

    Where they do not go one way, or no p between 0.3 and 5 fits, there is no order and the finest is the limit.
    """
    if len(points) < 3:
        return (points[-1][1] if points else None), None
    (h1, a), (h2, b), (h3, c) = (
        (x if points[0][0] > points[-1][0] else 1 / x, v) for x, v in points[-3:]
    )
    if (b - a) * (c - b) <= 0:
        return c, None

    def defect(p):
        return (b - a) / (c - b) - (h2**p - h1**p) / (h3**p - h2**p)

    if defect(0.3) * defect(5.0) > 0:
        return c, None
    order = float(brentq(defect, 0.3, 5.0))
    return c + (c - b) * h3**order / (h2**order - h3**order), order


def closed_forms(results: dict) -> dict:
    """By demo: cells, errors and, where they fall from mesh to mesh, the order on the last two."""
    found = {}
    for kind in ("hertz", "partial slip"):
        of = sorted(
            (r for r in results.values() if r.get("kind") == kind), key=lambda r: r["cells"]
        )
        if len(of) > 1:
            errors = {name: [r["errors"][name] for r in of] for name in of[0]["errors"]}
            orders = {
                n: float(np.log2(abs(e[-2] / e[-1]))) if np.all(np.diff(np.abs(e)) < 0) else None
                for n, e in errors.items()
            }
            found[kind] = dict(cells=[r["cells"] for r in of], errors=errors, orders=orders,
                seconds=[r["seconds"] for r in of])  # fmt: skip
    return found


def answer(tables: dict, orders: dict, percent: float) -> dict:
    """Mesh, increments and tolerance for an accuracy of the dissipation, each with a third of the error."""
    wanted, parts, chosen = percent / 300, [], {}
    for family, what in (
        ("meshes", "unknowns"),
        ("increments", "increments"),
        ("tolerances", "tol"),
    ):
        known = [row for row in tables[family] if row["dissipation_error"] is not None]
        good = [row for row in known if row["dissipation_error"] <= wanted]
        # All finer ones must be good, too: one that is good by chance does not count.
        while good and any(r not in good for r in known[known.index(good[0]) :]):
            good.pop(0)
        name = dict(meshes="mesh of {} unknowns", increments="{} increments a cycle", tolerances="tolerance {:g}")[family]  # fmt: skip
        if good:
            chosen[family] = good[0]
            parts.append(name.format(good[0][what]))
        elif known:
            last, order = known[-1], orders[family].get("dissipation")
            text = f"more than {name.format(last[what])} (error there {100 * last['dissipation_error']:.2g} %"
            if order:
                text += f"; at its order {order:.1f} about {(last['dissipation_error'] / wanted) ** (1 / order):.1f} times finer"
            parts.append(text + ")")
        else:
            parts.append(f"no answer about {family}: not measured")
    cost = "what it costs was not measured"
    if len(chosen) == 3:
        seconds = chosen["meshes"]["seconds"] * chosen["increments"]["increments"] / 15
        seconds *= chosen["tolerances"]["seconds"] / tables["tolerances"][-1]["seconds"]
        cost = f"about {seconds:.0f} s"
    return dict(
        percent=percent,
        parts=parts,
        text=f"For {percent:g} % in dissipation: {', '.join(parts)}; {cost}.",
    )
