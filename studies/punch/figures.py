"""Figures of the study, each as SVG and PNG, with the data behind it as CSV."""

from __future__ import annotations

import csv
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from studies.punch.contact_map import (
    INWARD,
    OPEN,
    SLIP,
    STICK,
    ZONES,
    draw_zones,
    frame_disc,
    paint,
)  # fmt: skip
from studies.punch.measures import force, inward, slip_of_point
from studies.punch.run import Run

COLOURS = {"A": "#0072b2", "B": "#d55e00", "C": "#009e73"}  # Okabe and Ito: for all eyes
NAMES = {"A": "A isotropic", "B": "B associated", "C": "C non-associated"}
STYLE = {"font.size": 13, "hatch.linewidth": 0.6, "svg.hashsalt": "study"}


def write_csv(file: Path, rows: list[dict]) -> None:
    with open(file, "w", newline="") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


class Figures:
    """Draws into a directory.

    Args:
        runs: The paper's programme by case.
        directory: Where to write; made if missing.
    """

    def __init__(self, runs: dict[str, Run], directory: Path):
        self.runs, self.directory = runs, directory
        directory.mkdir(parents=True, exist_ok=True)
        self.cycles = next(iter(runs.values())).parameters.cycles

    @contextmanager
    def drawn(self, name: str, size):
        """A figure to draw into, which is then written."""
        with rc_context(STYLE):
            figure = Figure(figsize=size, layout="constrained")
            yield figure
            for suffix, metadata in (
                ("svg", {"Date": None}),
                ("png", None),
            ):  # the same bytes every day
                figure.savefig(self.directory / f"{name}.{suffix}", dpi=110, metadata=metadata)

    def _maps(self, columns, name, title) -> None:
        """Load function at steps, one row a case; ``columns`` are titles and functions of a run."""
        rows = []
        with self.drawn(name, (3.4 * len(columns) + 1.4, 3.6 * len(self.runs) + 1.2)) as figure:
            axes = figure.subplots(len(self.runs), len(columns), squeeze=False)
            for line, (case, run) in zip(axes, self.runs.items()):
                for ax, (label, step_of) in zip(line, columns):
                    step = step_of(run)
                    disc = run.disc(step)
                    reverse = inward(disc)
                    image = draw_zones(ax, disc, reverse)
                    for collection in ax.collections:  # 1280 polygons: as pixels within the SVG
                        collection.set_rasterized(not isinstance(collection, LineCollection))
                    ax.set_title(f"{NAMES[case]}\n{label}" if ax is line[0] else f"\n{label}")
                    rows += [
                        dict(case=case, step=step, x=x, y=y, f=f, f_over_area=f / a, status=int(s),
                             inwards=int(b), slip_x=du[0], slip_y=du[1])
                        for (x, y), f, a, s, b, du in zip(disc.x, disc.load_function, run.area,
                            disc.status, reverse, disc.slip_increment)
                    ]  # fmt: skip
            bar = dict(shrink=0.7, aspect=30, extend="min")
            figure.colorbar(image, ax=axes, label="load function $f$ / mean pressure", **bar)
            outward = Patch(facecolor=ZONES[SLIP].get_facecolor(), label="slip outwards, $f=0$")
            handles = [ZONES[STICK], outward, INWARD, ZONES[OPEN]]
            figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
            figure.suptitle(title)
        write_csv(self.directory / f"{name}.csv", rows)

    def figure3(self) -> None:
        cycles = [c for c in (1, 3, 4, 6) if c < self.cycles] + [self.cycles]
        columns = [(f"unloaded, cycle {c}", lambda run, c=c: run.unloaded(c)) for c in cycles]
        self._maps(columns, "fig3", "Load function $f$ at the ends of unloadings")

    def unloading(self, cycle: int, name: str) -> None:
        """The maps within one unloading: where stick zones appear, and how reverse slip advances."""
        n = next(iter(self.runs.values())).parameters.unloading
        shown = sorted({round(part * n) for part in (0, 0.1, 0.4, 0.7, 1)})
        columns = [
            (f"{k} of {n} unloading steps", lambda run, k=k: run.loaded(cycle) + k) for k in shown
        ]
        self._maps(columns, name, f"Load function $f$ during the unloading of cycle {cycle}")

    def lines(self, name, title, draw, data) -> None:
        """One panel a case with common axes, and ``data(run)``, columns by name, as CSV."""
        with self.drawn(name, (4.8 * len(self.runs) + 1.2, 4.2)) as figure:
            axes = figure.subplots(1, len(self.runs), sharex=True, sharey=True, squeeze=False)[0]
            for ax, (case, run) in zip(axes, self.runs.items()):
                draw(ax, run)
                ax.set_title(NAMES[case])
                ax.grid(alpha=0.3)
                ax.label_outer()
            handles = axes[0].get_legend_handles_labels()
            figure.legend(*handles, loc="outside right center", frameon=False)
            figure.suptitle(title)
        rows = []
        for case, run in self.runs.items():
            columns = {key: np.asarray(values).tolist() for key, values in data(run).items()}
            rows += [dict(case=case, **dict(zip(columns, row))) for row in zip(*columns.values())]
        write_csv(self.directory / f"{name}.csv", rows)

    def point(self, node: int) -> None:
        """Figures 4 to 7 for a tracked node; node 0 is P."""
        suffix, x = "" if node == 0 else f"_node{node}", self._position(node)
        label = f"{'P' if node == 0 else f'node {node}'} at ({x[0]:.2f}, {x[1]:.2f}) mm"
        dashes = "; full: loading, dashed: unloading"

        def trajectory(ax, run):
            self._by_cycle(ax, run, *_history(run, node, "displacement", 1e3))
            ax.set(xlabel="$u_x$ [µm]", ylabel="$u_y$ [µm]")

        def friction(ax, run):
            r = _history(run, node, "reaction")
            self._by_time(ax, run, node, {"$r_{tx}$": r[0], "$r_{ty}$": r[1]})
            ax.set(ylabel="friction force [N]")

        def slip(ax, run):
            u, slipped = _history(run, node, "displacement", 1e3), 1e3 * slip_of_point(run, node)
            self._by_time(ax, run, node, {"$u_x$": u[0], "$u_y$": u[1], "$|u_t|$": slipped})
            ax.set(ylabel="slip [µm]")

        def curve(ax, run):
            self._by_cycle(ax, run, 1e3 * slip_of_point(run, node), 1e-3 * force(run))
            ax.set(xlabel="$|u_t|$ [µm]", ylabel="applied force [kN]")

        def data(run):
            (u_x, u_y), r = (
                _history(run, node, "displacement", 1e3),
                _history(run, node, "reaction"),
            )
            return dict(cycles=_time(run), u_x=u_x, u_y=u_y, r_tx=r[0], r_ty=r[1], force=force(run),
                slip=1e3 * slip_of_point(run, node), sticks=_sticks(run, node).astype(int))  # fmt: skip

        for number, title, draw in (
            (4, f"Trajectory of {label}{dashes}", trajectory),
            (5, f"Friction at {label}; shaded: sticks", friction),
            (6, f"Slip of {label}; shaded: sticks", slip),
            (7, f"Applied force against slip of {label}{dashes}", curve),
        ):
            self.lines(f"fig{number}{suffix}", title, draw, data)

    def _by_cycle(self, ax, run, horizontal, vertical) -> None:
        """Loadings as full lines, unloadings dashed, from light to dark with the cycles."""
        for c in range(1, self.cycles + 1):
            shade = 0.15 + 0.85 * (c - 1) / max(self.cycles - 1, 1)
            style = dict(color=colormaps["viridis_r"](shade), marker=".", linewidth=1.5)
            up = slice(run.unloaded(c - 1), run.loaded(c) + 1)
            down = slice(run.loaded(c), run.unloaded(c) + 1)
            ax.plot(horizontal[up], vertical[up], "-", label=f"cycle {c}", **style)
            ax.plot(horizontal[down], vertical[down], "--", **style)

    def _by_time(self, ax, run, node, columns) -> None:
        """Against the programme in cycles, shaded where the node sticks."""
        at, styles = _time(run), (("-", "black"), ("--", "#d55e00"), (":", "#555555"))
        for (name, values), (style, colour) in zip(columns.items(), styles):
            ax.plot(at, values, style, color=colour, label=name)
        for k in np.flatnonzero(_sticks(run, node)):
            ax.axvspan(at[k - 1], at[k], color="#4a90c4", alpha=0.3, linewidth=0)
        ax.set(xlabel="cycles")

    def _position(self, node):
        run = next(iter(self.runs.values()))
        wanted = [run.parameters.target, *run.points][node]
        return run.x[np.linalg.norm(run.x - wanted, axis=1).argmin()]

    def densities(self, name, title, columns, label, across=None) -> None:
        """Positive nodal fields on the disc, logarithmic; one row a case.

        Args:
            name, title: Of the figure.
            columns: Functions of a run by title.
            label: Of the colours.
            across: Cases side by side, with these titles; None for one below the other.
        """
        shape = (len(columns), len(self.runs)) if across else (len(self.runs), len(columns))
        values = {
            (case, key): function(run)
            for case, run in self.runs.items()
            for key, function in columns.items()
        }
        top = max(field.max() for field in values.values())
        colours = dict(cmap="cividis", norm=LogNorm(1e-3 * top, top))
        with self.drawn(name, (3.6 * shape[1] + 1.6, 3.5 * shape[0] + 0.8)) as figure:
            axes = figure.subplots(*shape, squeeze=False)
            for line, (case, run) in zip(axes.T if across else axes, self.runs.items()):
                disc = run.disc(run.unloaded(1))
                everywhere = np.ones(disc.faces.size, dtype=bool)
                for ax, key in zip(line, columns):
                    field = np.maximum(values[case, key], 1e-3 * top)
                    image = paint(ax, disc, field, everywhere, **colours)
                    image.set_rasterized(True)
                    frame_disc(ax, disc)
                    below = across[case] if across else key
                    ax.set_title(f"{NAMES[case]}\n{below}" if ax is line[0] else f"\n{below}")
            figure.colorbar(image, ax=axes, label=label, shrink=0.7, aspect=30, extend="min")
            figure.suptitle(title)
        rows = []
        for case, run in self.runs.items():
            for k, (x, y) in enumerate(run.x.tolist()):
                row = dict(case=case, x=x, y=y, area=float(run.area[k]))
                rows.append({**row, **{key: float(values[case, key][k]) for key in columns}})
        write_csv(self.directory / f"{name}.csv", rows)


def _history(run, node, quantity, factor=1.0) -> np.ndarray:
    """Both tangential components at a tracked node, from the undeformed state on."""
    both = [run.table[f"node{node}_{quantity}_{t}"] for t in ("t1", "t2")]
    return factor * np.c_[[0.0, 0.0], both]


def _time(run) -> np.ndarray:
    """The programme in cycles."""
    return np.arange(len(run.table["step"]) + 1) / run.unloaded(1)


def _sticks(run, node) -> np.ndarray:
    return np.r_[False, run.table[f"node{node}_status"] == STICK]
