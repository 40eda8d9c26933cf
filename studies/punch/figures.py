# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Figures of the study, each as SVG and PNG, with the data behind it as CSV."""

import csv
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from studies.punch.contact_map import LEGEND, STICK, draw_zones
from studies.punch.measures import force, slip_of_point, tracked
from studies.punch.run import Run

COLOURS = {"A": "#0072b2", "B": "#d55e00", "C": "#009e73"}  # Okabe and Ito: for all eyes
NAMES = {"A": "A isotropic", "B": "B associated", "C": "C non-associated"}
STYLE = {"font.size": 13, "hatch.linewidth": 0.6, "svg.hashsalt": "study", "axes.grid": True, "grid.alpha": 0.3}  # fmt: skip


def write_csv(file: Path, rows: list[dict]) -> None:
    with open(file, "w", newline="") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


class Figures:
    """Draws ``runs``, the paper's programme by case, into ``directory``, which is made if missing."""

    def __init__(self, runs: dict[str, Run], directory: Path):
        self.runs, self.directory = runs, directory
        directory.mkdir(parents=True, exist_ok=True)
        self.first = next(iter(runs.values()))
        self.cycles = self.first.parameters.cycles

    @contextmanager
    def drawn(self, name: str, size):
        """A figure to draw into, which is then written, as the same bytes every day."""
        with rc_context(STYLE):
            figure = Figure(figsize=size, layout="constrained")
            yield figure
            for suffix, metadata in {"svg": {"Date": None}, "png": None}.items():
                figure.savefig(self.directory / f"{name}.{suffix}", dpi=110, metadata=metadata)

    def write(self, name: str, tables) -> None:
        """The CSV of a figure; ``tables(run)`` are dictionaries of columns, or single numbers, by name."""
        rows = []
        for case, run in self.runs.items():
            for table in tables(run):
                columns = [column.tolist() for column in np.broadcast_arrays(*table.values())]
                rows += [{"case": case, **dict(zip(table, row))} for row in zip(*columns)]
        write_csv(self.directory / f"{name}.csv", rows)

    def discs(self, name, title, columns, show, label, legend=None) -> None:
        """Discs, one row a case, or side by side if ``columns`` are one.

        ``show(axes, run, column)`` draws the disc of a case and of one of ``columns``, which are named by their
        headings, and returns what a colour bar needs; ``label`` is that of the colours.
        """
        cases, n = len(self.runs), len(columns)
        high, wide = (cases, n) if n > 1 else (1, cases)
        with self.drawn(name, (3.4 * wide + 1.4, 3.6 * high + 1.2)) as figure:
            axes = figure.subplots(high, wide, squeeze=False)
            for line, (case, run) in zip(axes.reshape(cases, n), self.runs.items()):
                for ax, (heading, column) in zip(line, columns.items()):
                    image = show(ax, run, column)
                    for collection in ax.collections:  # 1280 polygons: as pixels within the SVG
                        collection.set_rasterized(not isinstance(collection, LineCollection))
                    heading = heading if n > 1 else ""
                    ax.set_title(f"{NAMES[case]}\n{heading}" if ax is line[0] else f"\n{heading}")
            figure.colorbar(image, ax=axes, label=label, shrink=0.7, aspect=30, extend="min")
            figure.suptitle(title)
            if legend:
                figure.legend(**legend)

    def zones(self, name, title, steps) -> None:
        """Load function at steps, functions of a run by heading."""

        def tables(run):
            for step in (step_of(run) for step_of in steps.values()):
                disc = run.disc(step)
                (x, y), (slip_x, slip_y), f = disc.x.T, disc.slip_increment.T, disc.load_function
                yield dict(step=step, x=x, y=y, f=f, f_over_area=f / run.area, status=disc.status,
                           inwards=disc.inward().astype(int), slip_x=slip_x, slip_y=slip_y)  # fmt: skip

        def show(ax, run, step_of):
            return draw_zones(ax, run.disc(step_of(run)))

        self.discs(name, title, steps, show, "load function $f$ / mean pressure", LEGEND)
        self.write(name, tables)

    def figure3(self) -> None:
        cycles = [c for c in (1, 3, 4, 6) if c < self.cycles] + [self.cycles]
        steps = {f"unloaded, cycle {c}": lambda run, c=c: run.unloaded(c) for c in cycles}
        self.zones("fig3", "Load function $f$ at the ends of unloadings", steps)

    def unloading(self, cycle: int, name: str) -> None:
        """The maps within one unloading: where stick zones appear, and how reverse slip advances."""
        n = self.first.parameters.unloading
        shown = sorted({round(part * n) for part in (0, 0.1, 0.4, 0.7, 1)})
        heading = f"{{}} of {n} unloading steps".format
        steps = {heading(k): lambda run, k=k: run.loaded(cycle) + k for k in shown}
        self.zones(name, f"Load function $f$ during the unloading of cycle {cycle}", steps)

    def lines(self, name, title, draw, labels) -> None:
        """One panel a case with common axes, which have ``labels``; ``draw(axes, run)`` draws one."""
        with self.drawn(name, (4.8 * len(self.runs) + 1.2, 4.2)) as figure:
            axes = figure.subplots(1, len(self.runs), sharex=True, sharey=True, squeeze=False)[0]
            for ax, (case, run) in zip(axes, self.runs.items()):
                draw(ax, run)
                ax.set(title=NAMES[case], xlabel=labels[0], ylabel=labels[1])
                ax.label_outer()
            handles = axes[0].get_legend_handles_labels()
            figure.legend(*handles, loc="outside right center", frameon=False)
            figure.suptitle(title)

    def point(self, node: int) -> None:
        """Figures 4 to 7 for a tracked node; node 0 is P."""
        wanted = [self.first.parameters.target, *self.first.points][node]
        x = self.first.x[np.linalg.norm(self.first.x - wanted, axis=1).argmin()]
        label = f"{'P' if node == 0 else f'node {node}'} at ({x[0]:.2f}, {x[1]:.2f}) mm"
        by_cycle, by_time = "full: loading, dashed: unloading", "shaded: sticks"

        def history(run):
            u_x, u_y = tracked(run, "displacement", node)
            r_tx, r_ty = tracked(run, "reaction", node)
            sticks = np.r_[False, run.table[f"node{node}_status"] == STICK].astype(int)
            return dict(cycles=np.arange(len(u_x)) / run.unloaded(1), u_x=1e3 * u_x, u_y=1e3 * u_y, r_tx=r_tx,
                        r_ty=r_ty, force=force(run), slip=1e3 * slip_of_point(run, node), sticks=sticks)  # fmt: skip

        def by_cycles(x, y, unit=1.0):
            return lambda ax, run: self._by_cycle(ax, run, history(run)[x], unit * history(run)[y])

        def by_times(**columns):
            return lambda ax, run: _by_time(ax, history(run), columns)

        for number, title, draw, labels in (
            (4, f"Trajectory of {label}; {by_cycle}", by_cycles("u_x", "u_y"), ("$u_x$ [µm]", "$u_y$ [µm]")),
            (5, f"Friction at {label}; {by_time}", by_times(r_tx="$r_{tx}$", r_ty="$r_{ty}$"),
                ("cycles", "friction force [N]")),
            (6, f"Slip of {label}; {by_time}", by_times(u_x="$u_x$", u_y="$u_y$", slip="$|u_t|$"),
                ("cycles", "slip [µm]")),
            (7, f"Applied force against slip of {label}; {by_cycle}", by_cycles("slip", "force", 1e-3),
                ("$|u_t|$ [µm]", "applied force [kN]")),
        ):  # fmt: skip
            name = f"fig{number}" + (f"_node{node}" if node else "")
            self.lines(name, title, draw, labels)
            self.write(name, lambda run: [history(run)])

    def _by_cycle(self, ax, run, horizontal, vertical) -> None:
        """Loadings as full lines, unloadings dashed, from light to dark with the cycles."""
        for c in range(1, self.cycles + 1):
            shade = 0.15 + 0.85 * (c - 1) / max(self.cycles - 1, 1)
            style = dict(color=colormaps["viridis_r"](shade), marker=".", linewidth=1.5)
            up = slice(run.unloaded(c - 1), run.loaded(c) + 1)
            down = slice(run.loaded(c), run.unloaded(c) + 1)
            ax.plot(horizontal[up], vertical[up], "-", label=f"cycle {c}", **style)
            ax.plot(horizontal[down], vertical[down], "--", **style)


def _by_time(ax, history, columns) -> None:
    """Columns with their labels against the programme in cycles, shaded where the node sticks."""
    at, styles = history["cycles"], (("-", "black"), ("--", "#d55e00"), (":", "#555555"))
    for (name, label), (style, colour) in zip(columns.items(), styles):
        ax.plot(at, history[name], style, color=colour, label=label)
    for k in np.flatnonzero(history["sticks"]):
        ax.axvspan(at[k - 1], at[k], color="#4a90c4", alpha=0.3, linewidth=0)
