# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Figures and tables of meshes, peers and growth; each figure with its name and the sentence of its numbers."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from benchmarks.report.draw import legend, panels, style

NOISE = 1e-9  # relative; ten times the tolerance of the runs


def peers(data):
    rows = data["rows"]
    absent = "; ".join(data["absent"])
    if not rows:
        return
    names = [
        f"{row['peer']}, {row['case']}, " + (f"{row['unknowns']} unknowns, {_steps(row)}" if row["unknowns"] else "condensed")
        for row in rows
    ][::-1]  # fmt: skip
    figure = Figure(figsize=(13, 0.5 * len(rows) + 1.9), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    theirs = np.array([row["seconds"] for row in rows])[::-1]
    ours = np.array([row["ours"] for row in rows])[::-1]
    places = np.arange(len(rows))
    axes[0].barh(
        places + 0.2,
        theirs,
        height=0.38,
        color="#d55e00",
        label="the peer, its error by our measure",
    )
    axes[0].barh(places - 0.2, ours, height=0.38, color="#0072b2", label="we, at equal error")
    for place, row in zip(places, rows[::-1]):
        text = f"{row['ratio']:.3g} times ours" if row["ratio"] else f"stopped: {row['done']} steps"
        axes[0].text(1.15 * max(row["seconds"], row["ours"]), place, text, va="center", fontsize=10)
    axes[0].set(xscale="log", xlabel="processor seconds a step", yticks=places, yticklabels=names)
    axes[0].set_xlim(right=60 * max(theirs.max(), ours.max()))
    for key, shift, colour, label in (
        ("error", 0.2, "#d55e00", "_"), ("own", -0.2, "#999999", "as the peer reports its error")
    ):  # fmt: skip
        errors = np.array([row[key] or np.nan for row in rows])[::-1]
        axes[1].barh(places + shift, np.maximum(errors, 1e-16), height=0.38, color=colour, label=label)  # fmt: skip
    axes[1].set(xscale="log", xlabel="largest error of the peer", xlim=(1e-16, 10))  # fmt: skip
    for ax in axes:
        ax.grid(axis="y", visible=False)
    handles, labels = zip(*(pair for ax in axes for pair in zip(*ax.get_legend_handles_labels()) if pair[1] != "_"))  # fmt: skip
    figure.legend(handles, labels, loc="outside upper center", frameon=False, ncols=3)
    done = [row for row in rows if row["ratio"]]
    parts = [
        f"{row['peer']} {row['case']}" + (f" ({row['unknowns']} unknowns, {_steps(row)})" if row["unknowns"] else "")
        + f" {row['ratio']:.2g}" for row in done
    ]  # fmt: skip
    stopped = [f"{row['peer']} ({row['done']}: {row['said'][:80]})" for row in rows if not row["ratio"]]  # fmt: skip
    slower = [row["peer"] for row in done if row["ratio"] < 1]
    yield "peers", figure, (
        f"Seconds a step over ours at equal error (Siconos: at the same tol): {'; '.join(parts) or 'none finished'}."
        + (f" Faster than we: {', '.join(slower)}." if slower else " No peer is faster.")
        + (f" Stopped: {'; '.join(stopped)}." if stopped else "")
        + " Set-ups are included, but for Siconos, which is given W. Only case A can be compared with GetFEM and CalculiX, which know isotropic friction alone."
        + (f" Absent: {absent}." if absent else "")
    )  # fmt: skip


def _steps(row) -> str:
    """How many steps the programme has; where it is one, the set-ups of both weigh most."""
    count = row["done"].split()[-1]
    return f"{count} step" + "s" * (count != "1")


def peers_tables(data):
    if data["absent"]:
        yield [{"not compared": text} for text in data["absent"]]
    yield [
        {
            "peer": row["peer"], "case": row["case"], "unknowns": row["unknowns"], "configuration": row["setting"],
            "s a step": row["seconds"], "ours at equal error": row["ours"], "ours at 1e-8": row["ours_tight"],
            "ratio": row["ratio"], "steps done": row["done"], "our error": row["error"],
            "its own": row["own"], "ours, judged alike": row.get("our_error"), "total reactions, or reactions (Siconos), differ by": row["force_error"], "said": row["said"],
        }
        for row in data["rows"]
    ]  # fmt: skip


def growth(data):
    rows = data["rows"]
    figure, axes = panels(3, 3, (4.4, 4.0))
    for ax, key, title in zip(
        axes, ("step", "iterations", "bytes"), ("processor seconds a step", "iterations a step", "memory beyond mesh and forms [MB]")
    ):  # fmt: skip
        for solver in data["fits"]:
            of = [row for row in rows if row["solver"] == solver]
            if key != "step" and solver == "elastic solve":
                continue
            y = np.array([row[key] for row in of]) * (1e-6 if key == "bytes" else 1)
            fit = data["fits"][solver].get(key)
            label = solver + (f", exponent {fit:.2f}" if fit is not None and key == "step" else "")
            ax.plot([row["unknowns"] for row in of], y, **{**style(solver), "label": label})
        # Where other work had taken the memory before, the quick report finds none that was added.
        some = any((row[key] or 0) > 0 for row in rows)
        ax.set(xscale="log", yscale="log" if some else "linear", xlabel="unknowns", ylabel=title)
    legend(figure, axes[0], ncols=2)
    sizes = {
        solver: [row["unknowns"] for row in rows if row["solver"] == solver]
        for solver in data["fits"]
    }
    fits = "; ".join(
        f"{solver} {fit['step']:.2f}" + (f" (memory {fit['bytes']:.2f})" if fit["bytes"] else "")
        + f" from {min(sizes[solver]):,} to {max(sizes[solver]):,}"
        + (f", from {last[0]:,} on {last[1]:.2f}" if (last := last_exponent(rows, solver)) and last[0] > min(sizes[solver]) else "")
        for solver, fit in data["fits"].items() if fit["step"] is not None
    )  # fmt: skip
    largest = max(rows, key=lambda row: (row["unknowns"], row["bytes"]))
    chosen = []
    for what in ("a cycle", "many steps"):
        of = [choice for choice in data["choices"] if choice["what"] == what]
        wrong = [
            f"{c['unknowns']:,} ({c['auto']} takes {c['loss']:.2g} times {c['best']})" for c in of if not c["right"]
        ]  # fmt: skip
        chosen.append(f"for {what} at {len(of) - len(wrong)} of {len(of)} sizes" + f", not at {', '.join(wrong)}" * bool(wrong))  # fmt: skip
    yield "growth", figure, (
        (f"Seconds a step grow with the unknowns to the power of: {fits}. " if fits else "")
        + f"At {largest['unknowns']:,} unknowns one of these steps (pressed in one, raised by two of the paper's ten) takes "
        f"{largest['over_elastic']:.1f} elastic solves ({largest['solver']}) and {largest['bytes'] / largest['unknowns'] / 1e3:.1f} kB an unknown. "
        + (f"solver=None takes the fastest {'; '.join(chosen)}." if data["choices"] else "What solver=None takes was not measured.")
        + "".join(f" Refused: {text}." for text in data["refused"])
    )  # fmt: skip


def growth_tables(data):
    yield [
        {
            "solver": row["solver"], "unknowns": row["unknowns"], "contact nodes": row["nodes"] or None,
            "s a step": row["step"], "over an elastic solve": row["over_elastic"], "set-up [s]": row["setup"] or None,
            "iterations a step": row["iterations"] or None, "MB": row["bytes"] / 1e6 or None,
        }  # an elastic solve: seconds alone were measured
        for row in data["rows"]
    ]  # fmt: skip


def meshes(data):
    yield from _punch(data)
    yield from _closed_forms(data)


def _punch(data):
    names = dict(
        normal="total reaction", dissipation="work of friction", stick="edge of the stick zone"
    )
    if not data["meshes"]:
        return
    families = dict(meshes="width of a cell [mm]", increments="increments of a cycle", tolerances="tolerance")  # fmt: skip
    figure, axes = panels(4, 2, (5.6, 4.0))
    for ax, (family, label) in zip(axes, families.items()):
        rows = data[family]
        x = [row["x"] for row in rows]
        for (key, name), (colour, marker) in zip(names.items(), (("#0072b2", "o"), ("#d55e00", "s"), ("#009e73", "^"))):  # fmt: skip
            order = data["orders"].get(family, {}).get(key)
            # what the tolerance leaves is no error of mesh or increments
            y = [e if (e := row[f"{key}_error"]) is not None and e > NOISE else np.nan for row in rows]  # fmt: skip
            if np.isfinite(y).any():
                said = f", order {order:.1f}" if order is not None else ""
                ax.plot(x, y, marker=marker, color=colour, label=name + said)
        ax.set(xscale="log", yscale="log", xlabel=label, ylabel="relative error")
        if family != "tolerances":
            ax.set_xticks(x, [f"{v:.3g}" for v in x])
            ax.minorticks_off()
        _labelled(ax, "upper left" if family == "meshes" else "best")
    for (family, colour), marker in zip((("meshes", "#0072b2"), ("increments", "#d55e00"), ("tolerances", "#009e73")), "os^"):  # fmt: skip
        rows = [row for row in data[family] if (row["dissipation_error"] or 0.0) > NOISE]
        axes[3].plot([row["seconds"]["median"] for row in rows], [row["dissipation_error"] for row in rows],
            marker=marker, color=colour, label=f"{family} refined")  # fmt: skip
    axes[3].axhline(0.01, color="0.6", lw=1)
    axes[3].axhline(0.001, color="0.6", lw=1)
    axes[3].set(xscale="log", yscale="log", xlabel="processor seconds of a cycle", ylabel="error of the work of friction")  # fmt: skip
    _labelled(axes[3])
    paper = next((row for row in data["meshes"] if row["refine"] == 0), data["meshes"][-1])
    parts = [
        f"{100 * row['dissipation_error']:.2g} % from {what}"
        for row, what in (
            (paper, "the mesh"),
            (data["increments"][0] if data["increments"] else {}, "the increments"),
        )
        if row.get("dissipation_error")
    ]
    change = ", ".join(f"{100 * row['change']:+.2f} % on {row['unknowns']:,} unknowns" for row in data["twice"])  # fmt: skip
    yield "discretisation", figure, (
        f"Punch, case {data['case']}, one cycle, work of friction. "
        + (f"On the paper's mesh with its increments it is off by {' and '.join(parts)}. " if parts else "")
        + (" ".join(answer["text"] for answer in data["answers"]) or "What an accuracy costs was not measured.")
        + (f" Twice the increments change it by {change}." if change else "")
    )  # fmt: skip


def _labelled(ax, place="best"):
    """Whole decades, and the legend."""
    low, high = np.log10(ax.get_ylim())
    ax.set_ylim(10 ** np.floor(low), 10 ** np.ceil(high))
    if ax.get_legend_handles_labels()[1]:
        ax.legend(fontsize=9, loc=place)


def _closed_forms(data):
    families = [name for name in ("hertz", "partial slip") if data["closed"].get(name)]
    if not families:
        return
    figure, axes = panels(len(families), 2, (5.5, 3.9))
    parts = []
    for ax, family in zip(axes, families):
        of = data["closed"][family]
        for (name, errors), marker in zip(of["errors"].items(), "os^"):
            order = of["orders"][name] if len(errors) > 2 else None  # two meshes fit any order
            said = f"order {order:.2f}" if order is not None else "no order"
            ax.plot(of["cells"], np.abs(errors), marker=marker, label=f"{name}, {said}")
            parts.append(f"{family}, {name}: {said} ({abs(errors[-1]):.1e})")
        ax.set(
            xscale="log",
            yscale="log",
            xlabel="cells from the middle to the side",
            ylabel="error, closed form",
        )
        ax.set_xticks(of["cells"], [str(c) for c in of["cells"]])
        ax.minorticks_off()
        ax.set_title(family)
        ax.legend(fontsize=10)
    yield "closed_forms", figure, (
        "Against the closed forms, order on the last two meshes (error on the finest): " + "; ".join(parts) + "."
        + (" No order: fewer than three meshes, or the error does not fall from mesh to mesh." if "no order" in " ".join(parts) else "")
    )  # fmt: skip


def meshes_tables(data):
    for family in ("meshes", "increments", "tolerances"):
        yield [
            {
                family: f"{row['unknowns']:,} unknowns" if family == "meshes" else f"{row['x']:g}", "total reaction [N]": row["normal"], "work of friction [N mm]": row["dissipation"],
                "stick edge [mm]": row["stick"], "s": row["seconds"]["median"],
                **{f"error of {key}": row[f"{key}_error"] for key in ("normal", "dissipation", "stick")},
            }
            for row in data[family]
        ]  # fmt: skip


def last_exponent(rows: list[dict], solver: str) -> tuple[int, float] | None:
    """Growth of the seconds of a step over a solver's three largest sizes, and the smallest of these."""
    of = sorted((row["unknowns"], row["step"]) for row in rows if row["solver"] == solver)[-3:]
    return (of[0][0], float(np.polyfit(*np.log(np.transpose(of)), 1)[0])) if len(of) == 3 else None
