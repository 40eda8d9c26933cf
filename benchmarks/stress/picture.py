# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The stress matrix as a table and as one picture."""

from __future__ import annotations

from collections import Counter

from matplotlib.figure import Figure

from benchmarks.tables import table

MARKS = {"solved": "#0072b2", "rounding": "#e69f00", "refused": "#555555", "WRONG": "#d00000"}


def summary(records: list[dict]) -> str:
    """Table of outcomes by group and solver."""
    solvers, groups = (list(dict.fromkeys(r[key] for r in records)) for key in ("solver", "group"))
    lines = []
    for group in [*groups, "all"]:
        of = [r for r in records if group in (r["group"], "all")]
        lines.append([group, *(outcomes([r for r in of if r["solver"] == s]) for s in solvers)])
    return table(["scenes", *solvers], lines)


def outcomes(records: list[dict]) -> str:
    count = Counter(record["outcome"] for record in records)
    others = [f"{count[outcome]} {outcome}" for outcome in ("rounding", "WRONG") if count[outcome]]
    return ", ".join([f"{count['solved']} / {len(records)}", *others]) if records else "–"


def draw(records: list[dict]) -> Figure:
    """A mark for each scene, group by group, at the largest error that the judge found; a panel for each solver."""
    solvers, groups = (list(dict.fromkeys(r[key] for r in records)) for key in ("solver", "group"))
    figure = Figure(figsize=(15, 0.3 * len(groups) + 2), layout="constrained")
    axes = figure.subplots(1, len(solvers), sharex=True, sharey=True, squeeze=False)[0]
    for ax, solver in zip(axes, solvers):
        for outcome, colour in MARKS.items():
            of = [r for r in records if (r["solver"], r["outcome"]) == (solver, outcome)]
            error = [max(r["error"], r.get("slip_error", 0.0), 1e-17) for r in of]
            places = [groups.index(r["group"]) for r in of]
            ax.plot(error, places, "o", color=colour, alpha=0.5, label=outcome)
        ax.set(xscale="log", title=solver, xlabel="largest error found by an independent check")
        ax.set_yticks(range(len(groups)), groups)
    axes[0].invert_yaxis()
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure
