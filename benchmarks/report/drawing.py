# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the figures of the report have in common."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

COLOURS = {  # Okabe and Ito: for all eyes
    "condensed Newton": "#0072b2",
    "fixed point, return": "#d55e00",
    "fixed point, bipotential": "#009e73",
    "elastic solve": "#555555",
    "solver=None": "#cc79a7",
}
MARKERS = dict(zip(COLOURS, "os^Dx"))
OURS, THEIRS = "#0072b2", "#d55e00"


def style(solver: str) -> dict:
    return dict(color=COLOURS[solver], marker=MARKERS[solver], ms=4, lw=1.4, label=solver)


def panels(count: int, columns: int = 3):
    """A figure with ``count`` panels and room for one legend above."""
    columns = min(columns, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(5 * columns, 4 * rows + 0.7), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes[count:]:
        ax.set_axis_off()
    return figure, axes[:count]


def legend(figure, ax) -> None:
    handles = ax.get_legend_handles_labels()
    figure.legend(*handles, loc="outside upper center", frameon=False, ncols=3)


def column(rows: list[dict], key: str, scale: float = 1.0) -> np.ndarray:
    """What the rows have under a key; nan, which is not drawn, for nothing."""
    return np.array([scale * (row.get(key) or np.nan) for row in rows])


def logarithmic(ax) -> None:
    """Both scales, if there is anything to draw."""
    if any((np.asarray(line.get_ydata(), dtype=float) > 0).any() for line in ax.lines):
        ax.set(xscale="log", yscale="log")


def bars(names: list[str], columns: int):
    """Panels for horizontal bars with these names, the first one above."""
    figure = Figure(figsize=(13, 0.45 * len(names) + 1.8), layout="constrained")
    axes = figure.subplots(1, columns, sharey=True)
    axes[0].set_yticks(range(len(names)), names)
    axes[0].invert_yaxis()
    for ax in axes:
        ax.set_xscale("log")
        ax.grid(axis="y", visible=False)
    return figure, axes
