# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Figures and tables of meshes, peers and growth; each figure with its name and the sentence of its numbers."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from report_draw import legend, panels, style

NOISE = 1e-9  # relative; ten times the tolerance of the runs


def peers(data):
    rows = data["rows"]
    absent = "; ".join(data["absent"])
    if not rows:
        return
    names = [
        f"{row['peer']}, {row['case']}" + (f", {row['unknowns']} unknowns" if row["unknowns"] else ", condensed")
        for row in rows
    ][::-1]  # fmt: skip
    figure = Figure(figsize=(13, 0.5 * len(rows) + 1.9), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    theirs = np.array([row["seconds"] for row in rows])[::-1]
    ours = np.array([row["ours"] for row in rows])[::-1]
    places = np.arange(len(rows))
    axes[0].barh(places + 0.2, theirs, height=0.38, color="#d55e00", label="the peer")
    axes[0].barh(places - 0.2, ours, height=0.38, color="#0072b2", label="we, at equal error")
    for place, row in zip(places, rows[::-1]):
        text = f"{row['ratio']:.3g} times ours" if row["ratio"] else f"stopped: {row['done']} steps"
        axes[0].text(1.15 * max(row["seconds"], row["ours"]), place, text, va="center", fontsize=10)
    axes[0].set(xscale="log", xlabel="processor seconds a step", yticks=places, yticklabels=names)
    axes[0].set_xlim(right=12 * max(theirs.max(), ours.max()))
    errors = np.array([row["error"] or row["force_error"] or np.nan for row in rows])[::-1]
    axes[1].barh(places, np.maximum(errors, 1e-16), height=0.5, color="#d55e00", label="_")
    for place, row in zip(places, rows[::-1]):
        if row["error"] is None:
            axes[1].text(
                1.3 * row["force_error"], place, "difference of reactions", va="center", fontsize=10
            )
    axes[1].set(xscale="log", xlabel="largest error of the peer in our measure", xlim=(1e-14, 10))
    for ax in axes:
        ax.grid(axis="y", visible=False)
    legend(figure, axes[0])
    done = [row for row in rows if row["ratio"]]
    parts = [
        f"{row['peer']} {row['case']}" + (f" ({row['unknowns']} unknowns)" if row["unknowns"] else "")
        + f" {row['ratio']:.2g}" for row in done
    ]  # fmt: skip
    stopped = [f"{row['peer']} ({row['done']}: {row['said'][:80]})" for row in rows if not row["ratio"]]  # fmt: skip
    slower = [row["peer"] for row in done if row["ratio"] < 1]
    yield "peers", figure, (
        f"Seconds a step over ours at equal error: {'; '.join(parts) or 'none finished'}."
        + (f" Faster than we: {', '.join(slower)}." if slower else " No peer is faster.")
        + (f" Stopped: {'; '.join(stopped)}." if stopped else "")
        + " Only case A can be compared with GetFEM and CalculiX, which know isotropic friction alone."
        + (f" Absent: {absent}." if absent else "")
    )  # fmt: skip


def peers_tables(data):
    if data["absent"]:
        yield [{"not compared": text} for text in data["absent"]]
    yield [
        {
            "peer": row["peer"], "case": row["case"], "unknowns": row["unknowns"], "configuration": row["setting"],
            "s a step": row["seconds"], "ours at equal error": row["ours"], "ours at 1e-8": row["ours_tight"],
            "ratio": row["ratio"], "steps done": row["done"], "our error": row["error"],
            "total reactions, or reactions (Siconos), differ by": row["force_error"], "said": row["said"],
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
        ax.set(xscale="log", yscale="log", xlabel="unknowns", ylabel=title)
    legend(figure, axes[0], ncols=2)
    fits = "; ".join(f"{solver} {fit['step']:.2f}" for solver, fit in data["fits"].items() if fit["step"] is not None)  # fmt: skip
    wrong = [choice for choice in data["choices"] if not choice["right"]]
    yield "growth", figure, (
        (f"Seconds a step grow with the unknowns to the power of: {fits}. " if fits else "")
        + (f"solver=None takes the fastest at {len(data['choices']) - len(wrong)} of {len(data['choices'])} sizes"
           if data["choices"] else "What solver=None takes was not measured")
        + (": not at " + ", ".join(
            f"{c['unknowns']} ({c['auto']}, {c['loss']:.2g} times {c['best']})" for c in wrong) if wrong else "")
        + "." + ("".join(f" Refused: {text}." for text in data["refused"]))
    )  # fmt: skip


def growth_tables(data):
    yield [
        {
            "solver": row["solver"], "unknowns": row["unknowns"], "contact nodes": row["nodes"],
            "s a step": row["step"], "over an elastic solve": row["over_elastic"], "set-up [s]": row["setup"],
            "iterations a step": row["iterations"], "MB": row["bytes"] / 1e6,
        }
        for row in data["rows"]
    ]  # fmt: skip


def meshes(data):
    yield from _punch(data)
    yield from _closed_forms(data)


def _punch(data):
    names = dict(normal="total reaction", dissipation="dissipation", stick="edge of the stick zone")
    if not data["meshes"]:
        return
    figure, axes = panels(3, 3)
    for ax, (family, label) in zip(axes, (("meshes", "width of a cell [mm]"), ("increments", "increments of a cycle"),
                                          ("tolerances", "tolerance"))):  # fmt: skip
        rows = data[family]
        if not any(row[f"{key}_error"] for row in rows for key in names):
            ax.set_title(f"{family}: not measured", fontsize=11)
            ax.set_axis_off()
            continue
        for (key, name), (colour, marker) in zip(names.items(), (("#0072b2", "o"), ("#d55e00", "s"), ("#009e73", "^"))):  # fmt: skip
            x = np.array([row["x"] for row in rows])
            y = np.array(
                [row[f"{key}_error"] if row[f"{key}_error"] is not None else np.nan for row in rows]
            )
            order = data["orders"].get(family, {}).get(key)
            y[y < NOISE] = np.nan  # what the tolerance leaves is no error of mesh or increments
            if np.isnan(y).all():
                continue
            ax.plot(x, y, marker=marker, color=colour,
                label=name + (f", order {order:.1f}" if order is not None else ""))  # fmt: skip
        ax.set(xscale="log", yscale="log", xlabel=label, ylabel="error over the limit")
        low, high = np.log10(ax.get_ylim())
        ax.set_ylim(10 ** np.floor(low), 10 ** np.ceil(high))
        if family != "tolerances":
            ax.set_xticks([row["x"] for row in rows], [f"{row['x']:.3g}" for row in rows])
            ax.minorticks_off()
        ax.legend(fontsize=9)
    answered = " ".join(answer["text"] for answer in data["answers"])
    yield "discretisation", figure, f"Punch, case {data['case']}, one cycle. {answered}"


def _closed_forms(data):
    families = [name for name in ("hertz", "partial slip") if data["closed"].get(name)]
    if not families:
        return
    figure, axes = panels(len(families), 2, (5.5, 3.9))
    parts = []
    for ax, family in zip(axes, families):
        of = data["closed"][family]
        for (name, errors), marker in zip(of["errors"].items(), "os^"):
            order = of["orders"][name]
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
        + (" No order: the error does not fall from mesh to mesh." if "no order" in " ".join(parts) else "")
    )  # fmt: skip


def meshes_tables(data):
    for family in ("meshes", "increments", "tolerances"):
        yield [
            {
                family: row["label"], "total reaction [N]": row["normal"], "dissipation [N mm]": row["dissipation"],
                "stick edge [mm]": row["stick"], "s": row["seconds"],
                **{f"error of {key}": row[f"{key}_error"] for key in ("normal", "dissipation", "stick")},
            }
            for row in data[family]
        ]  # fmt: skip
