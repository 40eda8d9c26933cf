# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Work of friction in the study: energy balance, cycles, wear, convergence; figures and tables."""

import numpy as np
from matplotlib.colors import LogNorm

from studies.punch.contact_map import paint
from studies.punch.figures import COLOURS, NAMES, Figures, write_csv
from studies.punch.measures import total
from studies.punch.run import Run

TERMS = {  # column of the history: label and style
    "elastic_change": ("elastic energy, $\\Delta W$", "#0072b2", "-"),
    "dissipation_end": ("dissipation $D$, end of step", "#d55e00", "-"),
    "half_du_K_du": ("$\\frac{1}{2}\\Delta u\\cdot K\\,\\Delta u$", "#009e73", "--"),
    "closing": ("closing nodes, $\\Sigma r_n x_n^{before}$", "#cc79a7", ":"),
    "work_of_friction": ("work of friction", "#e69f00", "--"),
}


def relative_residual(run: Run) -> np.ndarray:
    """What the balance of each step leaves open, over its largest term."""
    terms = [run.table[key] for key in ("platen_work", *TERMS)]
    return np.abs(run.table["residual"]) / np.abs(terms).max(axis=0)


def energy(figures: Figures) -> None:
    """Terms of the balance, accumulated, and what it leaves open per step."""
    runs = figures.runs
    with figures.drawn("energy", (4.8 * len(runs), 9)) as figure:
        axes = figure.subplots(2, len(runs), sharex=True, sharey="row", squeeze=False)
        for (above, below), (case, run) in zip(axes.T, runs.items()):
            at = np.arange(len(run.table) + 1) / run.unloaded(1)
            platen = {"platen_work": ("work of the platen", "black", "-")}
            for key, (label, colour, style) in (platen | TERMS).items():
                above.semilogy(at[1:], np.cumsum(run.table[key]), style, color=colour, label=label)
            below.semilogy(at[1:], np.maximum(relative_residual(run), 1e-17), ".", color="black")
            below.axhline(run.parameters.tol, color="#d55e00", linewidth=1)
            below.text(0, 6 * run.parameters.tol, "tolerance of a step", color="#d55e00")
            above.set(title=NAMES[case], ylabel="accumulated [N mm]", ylim=(1, None))
            below.set(xlabel="cycles", ylabel="|open balance| / largest term", ylim=(1e-17, 1e-7))
        for ax in axes.flat:
            ax.label_outer()
        handles = axes[0, 0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=3, frameon=False)
        figure.suptitle("The work of the platen is the sum of the next four terms of the legend")
    names = ("step", "cycle", "displacement", "platen_work", *TERMS, "residual", "residual_mean")
    figures.write("energy", lambda run: [{name: run.table[name] for name in names}])


def cycles(figures: Figures, wear: float) -> list[dict]:
    """Per case and cycle: work of friction, its ratio to the cycle before, wear, drift; figure and table."""
    rows = []
    for case, run in figures.runs.items():
        for c in range(1, run.parameters.cycles + 1):
            work, before = total(run, c), total(run, c - 1) if c > 1 else np.nan
            ends = [run.fields(run.unloaded(k))["displacement"] for k in (c - 1, c) if k]
            drift = np.linalg.norm((ends[-1] - ends[0])[:, :2], axis=1).max() if c > 1 else np.nan
            rows.append(dict(
                case=case, cycle=c, dissipation_Nmm=work, of_previous_cycle=work / before,
                worn_volume_mm3=wear * work, largest_drift_um=1e3 * float(drift),
            ))  # fmt: skip
    with figures.drawn("cycles", (14, 4.4)) as figure:
        work, settled, drift = figure.subplots(1, 3)
        for case in figures.runs:
            names = ("cycle", "dissipation_Nmm", "of_previous_cycle", "largest_drift_um")
            mine = [[row[name] for name in names] for row in rows if row["case"] == case]
            n, works, ratio, drifts = np.transpose(mine)
            work.plot(n, works, label=NAMES[case], **_style(case))
            settled.semilogy(n[1:], np.abs(ratio[1:] - 1), **_style(case))
            drift.semilogy(n[1:], drifts[1:], **_style(case))
        work.set(title="Work of friction per cycle", ylabel="N mm", ylim=(0, None))
        settled.set(title="Its change to the cycle before", ylabel="relative")
        drift.set(title="Largest drift of a node per cycle", ylabel="µm")
        for ax in (work, settled, drift):
            ax.set(xlabel="cycle", xticks=range(1, figures.cycles + 1))
        work.legend()
    return rows


def _style(case: str) -> dict:
    return dict(color=COLOURS[case], marker="osD"["ABC".index(case)])


def maps(figures: Figures, wear: float) -> None:
    """Density of the work of friction in the first and last cycle and in all; worn depth."""
    last = figures.cycles

    def density(first, last):
        return lambda run: (run.dissipation(last) - run.dissipation(first - 1)) / run.area

    works = {"cycle 1": density(1, 1)}
    if last > 1:
        works |= {f"cycle {last}": density(last, last), "all cycles": density(1, last)}
    depth = {"depth_nm": lambda run: 1e6 * wear * density(1, last)(run)}
    worn = f"Worn depth after {last} cycles, coefficient {wear:g} mm³/(N mm)"
    _densities(figures, "dissipation", "Work of friction per area", works, "N mm / mm²")
    _densities(figures, "wear", worn, depth, "nm")


def _densities(figures: Figures, name, title, columns, label) -> None:
    """Positive nodal fields, functions of a run by heading, on one logarithmic scale."""
    top = max(field(run).max() for field in columns.values() for run in figures.runs.values())
    colours = dict(cmap="cividis", norm=LogNorm(1e-3 * top, top))

    def show(ax, run, field):
        return paint(ax, run.disc(1), np.maximum(field(run), 1e-3 * top), **colours)

    def tables(run):
        at = dict(x=run.x[:, 0], y=run.x[:, 1], area=run.area)
        return [at | {key: field(run) for key, field in columns.items()}]

    figures.discs(name, title, columns, show, label)
    figures.write(name, tables)


def comparison(runs: dict[str, dict[str, Run]], failures=()) -> list[dict]:
    """Work of friction in the first cycle, for all variants, the failed ones too."""
    rows = []
    for name, cases in runs.items():
        for case, run in cases.items():
            own, work = run.parameters, total(run, 1)
            rows.append(dict(
                variant=name, case=case, first_cycle_Nmm=work, of_base=work / total(runs["base"][case], 1),
                last_cycle=own.cycles, last_cycle_Nmm=total(run, own.cycles), increments=own.loading + own.unloading,
                contact_nodes=len(run.x), iterations_per_step=float(run.table["iterations"].mean()),
                seconds_per_step=float(run.table["seconds"].mean()), largest_error=float(run.table["error"].max()),
                energy_left_open=float(relative_residual(run).max()), not_converged="",
            ))  # fmt: skip
    return rows + [dict.fromkeys(rows[0], np.nan) | failure for failure in failures]


def convergence(figures: Figures, rows: list[dict]) -> None:
    """Dissipation of the first cycle against increments and mesh, where there are several."""
    rows = [row for row in rows if not row["not_converged"]]
    panels = {
        key: [row for row in rows if row["variant"] == "base" or part in row["variant"]]
        for key, part in {"increments": " increments", "contact_nodes": "mesh "}.items()
    }
    shown = [row for row in rows if any(row in panel for panel in panels.values())]
    if {row["variant"] for row in shown} == {"base"}:
        return
    with figures.drawn("convergence", (11, 4.6)) as figure:
        axes = figure.subplots(1, 2, sharey=True)
        for ax, (key, panel) in zip(axes, panels.items()):
            for case in figures.runs:
                points = [
                    (row[key], row["first_cycle_Nmm"]) for row in panel if row["case"] == case
                ]
                ax.semilogx(*zip(*sorted(points)), label=NAMES[case], **_style(case))
            ticks = sorted({row[key] for row in panel})
            ax.set_xticks(ticks, [str(size) for size in ticks])
            ax.minorticks_off()
            ax.set(xlabel=key.replace("_", " "))
        axes[0].set(ylabel="work of friction, first cycle [N mm]", ylim=(0, None))
        axes[0].legend()
    write_csv(figures.directory / "convergence.csv", shown)
