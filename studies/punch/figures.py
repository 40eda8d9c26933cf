"""Figures of the study, each as SVG and PNG, with the data behind it as CSV."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from studies.punch.contact_map import INWARD, OPEN, SLIP, STICK, ZONES, _colour, _frame, draw_zones
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

    def save(self, figure: Figure, name: str) -> None:
        for suffix in ("svg", "png"):
            # undated: the same figure has the same bytes
            metadata = {"Date": None} if suffix == "svg" else None
            figure.savefig(self.directory / f"{name}.{suffix}", dpi=110, metadata=metadata)

    def _maps(self, columns, name, title) -> None:
        """Load function at steps, one row a case; ``columns`` are titles and functions of a run."""
        size = 3.4 * len(columns) + 1.4, 3.6 * len(self.runs) + 1.2
        rows = []
        with rc_context(STYLE):
            figure = Figure(figsize=size, layout="constrained")
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
            self.save(figure, name)
        write_csv(self.directory / f"{name}.csv", rows)

    def figure3(self) -> None:
        cycles = [c for c in (1, 3, 4, 6) if c < self.cycles] + [self.cycles]
        columns = [
            (f"unloaded, cycle {c}", lambda run, c=c: run.unloaded(c))
            for c in dict.fromkeys(c for c in cycles if c in (1, 3, 4, 6) or c == self.cycles)
        ]
        self._maps(columns, "fig3", "Load function $f$ at the ends of unloadings")

    def unloading(self, cycle: int, name: str) -> None:
        """The maps within one unloading: where stick zones appear, and how reverse slip advances."""
        n = next(iter(self.runs.values())).parameters.unloading
        shown = sorted({round(part * n) for part in (0, 0.1, 0.4, 0.7, 1)})
        columns = [
            (f"{k} of {n} unloading steps", lambda run, k=k: run.loaded(cycle) + k) for k in shown
        ]
        self._maps(columns, name, f"Load function $f$ during the unloading of cycle {cycle}")

    def lines(self, name, title, draw, rows, height=4.2) -> None:
        """One panel a case with common axes."""
        with rc_context(STYLE):
            figure = Figure(figsize=(4.8 * len(self.runs) + 1.2, height), layout="constrained")
            axes = figure.subplots(1, len(self.runs), sharex=True, sharey=True, squeeze=False)[0]
            for ax, (case, run) in zip(axes, self.runs.items()):
                draw(ax, run)
                ax.set_title(NAMES[case])
                ax.grid(alpha=0.3)
                ax.label_outer()
            handles = axes[0].get_legend_handles_labels()
            figure.legend(*handles, loc="outside right center", frameon=False)
            figure.suptitle(title)
            self.save(figure, name)
        write_csv(
            self.directory / f"{name}.csv",
            [{"case": case, **row} for case, run in self.runs.items() for row in rows(run)],
        )

    def point(self, node: int) -> None:
        """Figures 4 to 7 for a tracked node; node 0 is P."""
        suffix, x = "" if node == 0 else f"_node{node}", self._position(node)
        label = f"{'P' if node == 0 else f'node {node}'} at ({x[0]:.2f}, {x[1]:.2f}) mm"

        def u(run):  # µm, from the undeformed state on
            both = [run.table[f"node{node}_displacement_{t}"] for t in ("t1", "t2")]
            return 1e3 * np.c_[[0.0, 0.0], both]

        def r(run):  # N
            both = [run.table[f"node{node}_reaction_{t}"] for t in ("t1", "t2")]
            return np.c_[[0.0, 0.0], both]

        def programme(run):  # in cycles
            return np.arange(len(run.table["step"]) + 1) / run.unloaded(1)

        def columns(**of):
            def rows(run):
                values = {key: np.asarray(function(run)) for key, function in of.items()}
                return [
                    dict(zip(values, row)) for row in zip(*(v.tolist() for v in values.values()))
                ]

            return rows

        def by_cycle(ax, run, horizontal, vertical):
            """Loadings as full lines, unloadings dashed, from light to dark with the cycles."""
            for c in range(1, self.cycles + 1):
                colour = self._shade(c)
                for first, last, dash in (
                    (run.unloaded(c - 1), run.loaded(c), "-"),
                    (run.loaded(c), run.unloaded(c), "--"),
                ):
                    part = slice(first, last + 1)
                    name = f"cycle {c}" if dash == "-" else None
                    style = dict(color=colour, linestyle=dash, marker=".", linewidth=1.5)
                    ax.plot(horizontal[part], vertical[part], label=name, **style)

        def trajectory(ax, run):
            by_cycle(ax, run, *u(run))
            ax.set(xlabel="$u_x$ [µm]", ylabel="$u_y$ [µm]")

        def against_programme(quantity, ylabel, names):
            def draw(ax, run):
                styles = ("-", "black"), ("--", "#d55e00"), (":", "#555555")
                for values, name, (style, colour) in zip(quantity(run), names, styles):
                    ax.plot(programme(run), values, style, color=colour, label=name)
                stick = np.r_[False, run.table[f"node{node}_status"] == STICK]
                self._shade_steps(ax, programme(run), stick)
                ax.set(xlabel="cycles", ylabel=ylabel)

            return draw

        def slips(run):
            return np.r_[u(run), 1e3 * slip_of_point(run, node)[None]]

        def curve(ax, run):
            by_cycle(ax, run, 1e3 * slip_of_point(run, node), 1e-3 * force(run))
            ax.set(xlabel="$|u_t|$ [µm]", ylabel="applied force [kN]")

        dashes = "; full: loading, dashed: unloading"
        self.lines("fig4" + suffix, f"Trajectory of {label}{dashes}", trajectory,
            columns(cycles=programme, u_x=lambda run: u(run)[0], u_y=lambda run: u(run)[1]))  # fmt: skip
        self.lines("fig5" + suffix, f"Friction at {label}; shaded: sticks",
            against_programme(r, "friction force [N]", ("$r_{tx}$", "$r_{ty}$")),
            columns(cycles=programme, r_tx=lambda run: r(run)[0], r_ty=lambda run: r(run)[1]))  # fmt: skip
        self.lines("fig6" + suffix, f"Slip of {label}; shaded: sticks",
            against_programme(slips, "slip [µm]", ("$u_x$", "$u_y$", "$|u_t|$")),
            columns(cycles=programme, slip=lambda run: slips(run)[2],
                sticks=lambda run: np.r_[0, run.table[f"node{node}_status"] == STICK]))  # fmt: skip
        self.lines("fig7" + suffix, f"Applied force against slip of {label}{dashes}", curve,
            columns(cycles=programme, force=force, slip=lambda run: slips(run)[2]))  # fmt: skip

    def _position(self, node):
        run = next(iter(self.runs.values()))
        wanted = [run.parameters.target, *run.points][node]
        return run.x[np.linalg.norm(run.x - wanted, axis=1).argmin()]

    def _shade(self, cycle: int):
        """From light to dark blue-green, legible for all eyes."""
        return colormaps["viridis_r"](0.15 + 0.85 * (cycle - 1) / max(self.cycles - 1, 1))

    @staticmethod
    def _shade_steps(ax, at, stick) -> None:
        for k in np.flatnonzero(stick):
            ax.axvspan(at[k - 1], at[k], color="#4a90c4", alpha=0.3, linewidth=0)

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
        with rc_context(STYLE):
            size = 3.6 * shape[1] + 1.6, 3.5 * shape[0] + 0.8
            figure = Figure(figsize=size, layout="constrained")
            axes = figure.subplots(*shape, squeeze=False)
            for line, (case, run) in zip(axes.T if across else axes, self.runs.items()):
                disc = run.disc(run.unloaded(1))
                everywhere = np.ones(disc.faces.size, dtype=bool)
                for ax, key in zip(line, columns):
                    field = np.maximum(values[case, key], 1e-3 * top)
                    image = _colour(ax, disc, field, everywhere, **colours)
                    image.set_rasterized(True)
                    _frame(ax, disc)
                    below = across[case] if across else key
                    ax.set_title(f"{NAMES[case]}\n{below}" if ax is line[0] else f"\n{below}")
            figure.colorbar(image, ax=axes, label=label, shrink=0.7, aspect=30, extend="min")
            figure.suptitle(title)
            self.save(figure, name)
        rows = []
        for case, run in self.runs.items():
            for k, (x, y) in enumerate(run.x.tolist()):
                row = dict(case=case, x=x, y=y, area=float(run.area[k]))
                rows.append({**row, **{key: float(values[case, key][k]) for key in columns}})
        write_csv(self.directory / f"{name}.csv", rows)
