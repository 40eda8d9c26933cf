# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Figures and tables of solvers: work and precision, the economy ladder, stability.

Each figure comes with its name and the sentence that its numbers make.
"""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator

COLOURS = {  # Okabe and Ito: for all eyes
    "condensed Newton": "#0072b2",
    "fixed point, return": "#d55e00",
    "fixed point, bipotential": "#009e73",
    "elastic solve": "#555555",
}
MARKERS = dict(zip(COLOURS, "os^D"))
REACHED = 1e-8
COLUMNS = 24  # scenes in a line of the stress matrix


def style(solver: str) -> dict:
    return dict(color=COLOURS[solver], marker=MARKERS[solver], ms=4, lw=1.4, label=solver)


def panels(count: int, columns: int = 3, size=(4.4, 3.7)):
    """A figure with ``count`` panels and room for one legend above."""
    columns = min(columns, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(size[0] * columns, size[1] * rows + 0.7), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes[count:]:
        ax.set_axis_off()
    return figure, axes[:count]


def legend(figure, ax, **options) -> None:
    handles, labels = ax.get_legend_handles_labels()
    options = dict(ncols=len(labels)) | options
    figure.legend(handles, labels, loc="outside upper center", frameon=False, **options)  # fmt: skip


def algebraic(data):
    rows = data["rows"]
    figure, axes = panels(len(rows))
    for ax, row in zip(axes, rows):
        for solver, curve in row["curves"].items():
            seconds = np.array(curve["seconds"])
            lower, upper = seconds - curve["least"], np.array(curve["largest"]) - seconds
            ax.errorbar(1e3 * seconds, np.maximum(curve["error"], 1e-16), xerr=1e3 * np.abs([lower, upper]),
                elinewidth=0.4, errorevery=max(1, len(seconds) // 12), markevery=max(1, len(seconds) // 25),
                **style(solver))  # fmt: skip
        ax.axhline(REACHED, color="0.6", lw=1)
        ax.set(xscale="log", yscale="log", xlabel="processor time of the step [ms]", ylabel="error")
        ax.yaxis.set_major_locator(LogLocator(numticks=8))
        ax.set_title(
            f"{row['scene']}: step {row['watched']}, {row['unknowns']} unknowns", fontsize=11
        )
    legend(figure, axes[0])
    wins = {}
    for row in rows:
        wins.setdefault(row["best"], []).append(row["scene"])
    parts = [f"{solver} in {', '.join(scenes)}" for solver, scenes in wins.items() if solver]
    never = [
        f"{solver} in {row['scene']}"
        for row in rows for solver in row["curves"] if row[solver]["seconds_to_1e_8"] is None
    ]  # fmt: skip
    yield "precision", figure, (
        f"First at an error of {REACHED:g}: " + "; ".join(parts) + "."
        + (f" Never there: {', '.join(never)}." if never else " Every solver gets there in every scene.")
    )  # fmt: skip

    figure, axes = panels(len(rows))
    refused = []
    for ax, row in zip(axes, rows):
        for solver, run in row["runs"].items():
            ax.plot(
                np.arange(1, len(run["seconds"]) + 1), np.cumsum(run["seconds"]), **style(solver)
            )
            if run["said"]:
                ax.plot(len(run["seconds"]), sum(run["seconds"]), "x", color="black", ms=12, mew=2)
                refused.append(f"{solver} in {row['scene']} (step {len(run['seconds'])})")
        ax.set(yscale="log", xlabel="steps", ylabel="processor seconds so far")
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set_title(row["scene"], fontsize=11)
    legend(figure, axes[0])
    after = {row["scene"]: pays_after(row["runs"]) for row in rows}
    pays = [f"{scene} after {steps}" for scene, steps in after.items() if steps]
    never = [scene for scene, steps in after.items() if not steps]
    yield "setup", figure, (
        "Set-up included, the condensed Newton has taken less than the return map, in steps: "
        + (", ".join(pays) or "nowhere") + (f"; not within the programme of {', '.join(never)}" if never else "") + "."
        + (f" Refused (cross): {'; '.join(refused)}." if refused else "")
    )  # fmt: skip


def algebraic_tables(data):
    table = []
    for row in data["rows"]:
        for solver in row["curves"]:
            of = row[solver]
            table.append({
                "scene": row["scene"], "solver": solver, "to 1e-8 [ms]": _ms(of["seconds_to_1e_8"]),
                "over the best": of["ratio"], "set-up [ms]": _ms(of["setup"]),
                "median step [ms]": _ms(of["step"] and of["step"]["median"]),
                "fastest": _ms(of["step"] and of["step"]["least"]),
                "slowest": _ms(of["step"] and of["step"]["largest"]),
                "programme [s]": of["all"], "iterations": of["iterations"], "worst error": of["error"],
                "refused": of["refused"][:60],
            })  # fmt: skip
    yield table


def _ms(seconds):
    return None if seconds is None else 1e3 * seconds


def ladder(data):
    rows = data["rows"]
    names = [row["rung"] for row in rows][::-1]
    figure = Figure(figsize=(13, 0.42 * len(rows) + 1.6), layout="constrained")
    axes = figure.subplots(1, 3, sharey=True)
    for ax, key, title, scale in zip(
        axes, ("step", "set_up", "bytes"),
        ("one step [ms]", "first step with set-up [ms]", "memory beyond mesh and forms [MB]"),
        (1e3, 1e3, 1e-6),
    ):  # fmt: skip
        values = np.array([row[key] if key == "bytes" else row[key]["median"] for row in rows])[
            ::-1
        ]
        values = np.maximum(values, 1e-3 / scale)
        ax.barh(names, scale * values, color="#0072b2", height=0.65)
        ends = values
        if key != "bytes":
            low, high = (
                np.array([row[key][end] for row in rows])[::-1] for end in ("least", "largest")
            )
            ends = high
            ax.errorbar(scale * values, names, xerr=scale * np.array([values - low, high - values]),
                fmt="none", ecolor="black", elinewidth=1)  # fmt: skip
        for name, end, value in zip(names, ends, values):
            ax.text(1.1 * scale * end, name, f"{scale * value:.3g}", va="center", fontsize=10)
        ax.set(xscale="log", xlabel=title)
        ax.set_xlim(0.4 * scale * values.min(), 4 * scale * ends.max())
        ax.grid(axis="y", visible=False)
        for k, row in enumerate(rows):  # a line above each scene that begins anew
            if k and row["compared_with"] is None:
                ax.axhline(len(rows) - k - 0.5, color="0.5", lw=0.8)
    compared = [row for row in rows if "saves" in row]
    said = {what: [] for what in ("saved", "nothing", "free")}
    for row in compared:
        text = f"{row['rung']} {row['step_ratio']:.2g} of {row['compared_with']}"
        # What can be switched off, and saves no time then, costs none: that is as it should be.
        free = row["rung"].startswith("no ") and "step" not in row["saves"]
        said["saved" if "step" in row["saves"] else "free" if free else "nothing"].append(text)
    yield "ladder", figure, (
        f"Time of a step: {'; '.join(said['saved']) or 'no rung saves any'}. Memory is saved by: "
        f"{', '.join(row['rung'] for row in compared if 'bytes' in row['saves']) or 'nothing'}. "
        + "".join(
            f"{row['compared_with']} takes {1 / row['bytes_ratio']:.1f} times the memory of {row['rung']}. "
            for row in compared if row["rung"] == "matrix constant" and "bytes" in row["saves"]
        )
        + (f"Saves less than 10 % of the time: {'; '.join(said['nothing'])}. " if said["nothing"] else "Every rung saves time. ")
        + (f"Costs next to nothing, for without it: {'; '.join(said['free'])}." if said["free"] else "")
    ).strip()  # fmt: skip
    if data["imports"]:
        yield _imports(data["imports"])


def _imports(data):
    found = data["rows"]
    figure = Figure(figsize=(8, 2.6), layout="constrained")
    ax = figure.subplots()
    names = [f"import {name}" for name in found][::-1]
    values = [of["median"] for of in found.values()][::-1]
    ends = np.abs([[of[end] - of["median"] for of in found.values()][::-1] for end in ("least", "largest")])  # fmt: skip
    ax.barh(names, values, xerr=ends, color="#0072b2", height=0.6)
    ax.set(xlabel="processor seconds")
    ax.grid(axis="y", visible=False)
    ours, least, most = (found[n] for n in ("dolfinx_contact", *list(found)[:2]))
    beyond = ", ".join(name for name in data["beyond_dolfinx"] if not name.startswith("_"))
    return "imports", figure, (
        f"import dolfinx_contact takes {ours['median']:.2f} s, {ours['median'] / least['median']:.2f} times "
        f"import dolfinx and {ours['median'] / most['median']:.2f} times that with what every script of DOLFINx imports; "
        f"its own modules are {data['own_modules_ms']:.0f} ms of it; beyond dolfinx it brings {beyond}."
    )  # fmt: skip


def ladder_tables(data):
    yield [
        {
            "rung": row["rung"], "compared with": row["compared_with"], "step, ratio": row.get("step_ratio"),
            "set-up, ratio": row.get("set_up_ratio"), "memory, ratio": row.get("bytes_ratio"),
            "unknowns": row["unknowns"], "condensed": row["condensed"], "iterations a step": row["iterations"],
            **{f"{key} a step": value for key, value in row["counts"].items()},
        }
        for row in data["rows"]
    ]  # fmt: skip


def stability(data):
    records = data["records"]
    solvers = list(dict.fromkeys(record["solver"] for record in records))
    of = {}
    for record in records:
        of.setdefault(record["group"], {s: [] for s in solvers})[record["solver"]].append(record)
    # From above: the first line of each group, of as many as its longest row of scenes needs.
    lines = [-(-max(map(len, row.values())) // COLUMNS) for row in of.values()]
    first = np.cumsum([0, *(count + 0.6 for count in lines)])
    figure = Figure(figsize=(15, 0.21 * first[-1] + 1.4), layout="constrained")
    axes = figure.subplots(1, len(solvers), sharey=True, squeeze=False)[0]
    colours = matplotlib.colormaps["viridis_r"]
    norm = LogNorm(1e-16, 1e-7)
    for ax, solver in zip(axes, solvers):
        places = [
            (record, i % COLUMNS, top + i // COLUMNS)
            for top, row in zip(first, of.values()) for i, record in enumerate(row[solver])
        ]  # fmt: skip
        for outcome, marker, size, look in (
            ("solved", "s", 60, dict(linewidths=0)),
            ("refused", "x", 45, dict(linewidths=2)),
            ("WRONG", "o", 70, {}),
        ):
            some = [place for place in places if place[0]["outcome"] == outcome]
            shade = [colours(norm(max(record["error"], 1e-16))) for record, *_ in some]
            x, y = [place[1] for place in some], [place[2] for place in some]
            ax.scatter(x, y, size, c=shade if outcome == "solved" else "#d00000", marker=marker, **look)  # fmt: skip
        ax.set_title(solver)
        ax.set(yticks=first[:-1], yticklabels=list(of), xticks=[], xlim=(-1, COLUMNS))
        ax.set_ylim(first[-1] - 0.6, -1)
        ax.grid(visible=False)
    figure.colorbar(matplotlib.cm.ScalarMappable(norm, colours), ax=axes, label="largest error found by the judge",
        shrink=0.8, aspect=25)  # fmt: skip
    count = data["by_solver"]
    counted = "; ".join(f"{s} {c['solved']} of {c['scenes']}" for s, c in count.items())
    third = data["third_state"]
    part = (
        ""
        if data["whole"]
        else f" This is a part of the {data['all_scenes']} scenes; make stress runs all."
    )
    yield "stability", figure, (
        f"Solved: {counted}; the others refused with an exception (cross). "
        + ("There is no third state: no answer is wrong" if third == 0 else f"{third} answers are WRONG or not refused (disc)")
        + f". Largest error of an answer {data['worst']:.1e}. Singular stiffness refused: "
        f"{data['singular_refused']} of {data['singular']}.{part}"
    )  # fmt: skip


def stability_tables(data):
    yield [
        {key: record[key] for key in ("group", "name", "solver", "outcome", "error", "said")}
        for record in data["not_solved"]
    ]


def pays_after(runs: dict) -> int | None:
    """Steps of the programme from which on the condensed Newton has taken less than the return map, all set-up included."""
    newton, fixed = (np.cumsum(runs[s]["seconds"]) for s in ("condensed Newton", "fixed point, return"))  # fmt: skip
    steps = min(len(newton), len(fixed))
    behind = np.flatnonzero(newton[:steps] > fixed[:steps])
    first = int(behind[-1]) + 2 if len(behind) else 1
    return first if first <= steps else None
