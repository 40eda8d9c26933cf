# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Wear over many cycles: error of the volume against seconds, by jumps of fixed size and controlled ones."""

from __future__ import annotations

from benchmarks.measurement import Measurement
from benchmarks.report import drawing
from benchmarks.tables import chosen
from benchmarks.wear_cycles import PROGRAMMES, measured

TITLE = "Wear over many cycles"
CAPTION = (
    "Error of the worn volume after 1,000 cycles, against the same cycles simulated one by one, which took the seconds of the dotted line: "
    "dc.cycle_jump at accuracies of 0.05, 0.02 and 0.01, with its estimate, and explicit wear in jumps of 10 to 200 cycles."
)
KINDS = {
    "jump": ("explicit, fixed jumps", drawing.THEIRS, "o"),
    "accuracy": ("cycle_jump", drawing.OURS, "s"),
}


def plan(size: str) -> list[Measurement]:
    """All programmes; less of some of them where there is little time."""
    names = list(PROGRAMMES) if size == "full" else ["cylinder in partial slip", "block at a given approach"]  # fmt: skip
    cycles = dict(full=1000, quick=1000, smallest=40)[size]
    return [
        Measurement(f"wear/{name}", "benchmarks.report.wear:programme", dict(name=name, cycles=cycles), late=True)
        for name in names
    ]  # fmt: skip


def programme(name: str, cycles: int) -> list[dict]:
    return list(measured(name, cycles))


def evaluate(results: dict) -> dict:
    """Rows of all programmes."""
    return dict(rows=[row for rows in results.values() for row in rows])


def figure(data):
    """A panel for each programme."""
    names = list(dict.fromkeys(row["programme"] for row in data["rows"]))
    figure, axes = drawing.panels(len(names))
    for ax, name in zip(axes, names):
        some = [row for row in data["rows"] if row["programme"] == name]
        for key, (label, colour, marker) in KINDS.items():
            rows = [row for row in some if key in row]
            seconds = drawing.column(rows, "seconds")
            ax.plot(seconds, [row["true"]["volume"] for row in rows], color=colour, marker=marker, label=label)  # fmt: skip
            if key == "accuracy":
                estimated = [row["estimated"]["volume"] for row in rows]
                ax.plot(seconds, estimated, "x", color=colour, label="its estimate")
        ax.axvline(some[0]["one_by_one"], ls=":", color="#555555", label="one by one")
        drawing.logarithmic(ax)
        ax.set(title=name, xlabel="processor seconds", ylabel="error of the worn volume")
    drawing.legend(figure, axes[0])
    return figure


def tables(data):
    flat = [
        row
        | {of: row["true"][of] for of in ("volume", "depth", "profile")}
        | {f"estimated {of}": value for of, value in row.get("estimated", {}).items()}
        for row in data["rows"]
    ]
    keys = ("programme", "accuracy", "jump", "simulated", "seconds", "volume", "estimated volume", "depth", "estimated depth", "profile", "estimated profile")  # fmt: skip
    yield chosen(flat, {key: key for key in keys})
