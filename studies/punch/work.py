"""Work of friction in the study: energy balance, cycles, wear, convergence; figures and tables."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from studies.punch.figures import COLOURS, NAMES, STYLE, Figures, write_csv
from studies.punch.measures import total
from studies.punch.run import Run

TERMS = {  # column of the history: label and style
    "elastic_change": ("elastic energy, $\\Delta W$", "#0072b2", "-"),
    "dissipation_end": ("dissipation $D$, end of step", "#d55e00", "-"),
    "half_du_K_du": ("$\\frac{1}{2}\\Delta u\\cdot K\\,\\Delta u$", "#009e73", "--"),
    "closing": ("closing nodes, $\\Sigma r_n x_n^{before}$", "#cc79a7", ":"),
    "work_of_friction": ("work of friction", "#e69f00", "--"),
}


def relative_residual(run: Run, name: str = "residual") -> np.ndarray:
    """What the balance of each step leaves open, over its largest term."""
    terms = [run.table[key] for key in ("platen_work", *TERMS)]
    return np.abs(run.table[name]) / np.abs(terms).max(axis=0)


def energy(figures: Figures) -> None:
    """Terms of the balance, accumulated, and what it leaves open per step."""
    runs = figures.runs
    with rc_context(STYLE):
        figure = Figure(figsize=(4.8 * len(runs), 11), layout="constrained")
        axes = figure.subplots(3, len(runs), sharex=True, sharey="row", squeeze=False)
        for (above, middle, below), (case, run) in zip(axes.T, runs.items()):
            at = np.arange(len(run.table["step"]) + 1) / run.unloaded(1)
            work = np.r_[0, np.cumsum(run.table["platen_work"])]
            above.plot(at, work, color="black", linewidth=2, label="work of the platen")
            for key, (label, colour, style) in TERMS.items():
                values = np.r_[0, np.cumsum(run.table[key])]
                above.plot(at, values, style, color=colour, label=label)
                if key not in ("elastic_change", "half_du_K_du"):
                    middle.plot(at, values, style, color=colour)
            above.set(title=NAMES[case], ylabel="accumulated [N mm]")
            middle.set(ylabel="the small terms [N mm]")
            below.semilogy(at[1:], np.maximum(relative_residual(run), 1e-17), ".", color="black")
            below.axhline(run.parameters.tol, color="#d55e00", linewidth=1)
            below.text(0, 6 * run.parameters.tol, "tolerance of a step", color="#d55e00")
            below.set(xlabel="cycles", ylabel="|open balance| / largest term", ylim=(1e-17, 1e-7))
            for ax in (above, middle, below):
                ax.grid(alpha=0.3)
                ax.label_outer()
        handles = axes[0, 0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=3, frameon=False)
        figure.suptitle(
            "Energy balance: the work of the platen is the sum of the next four terms of the legend"
        )
        figures.save(figure, "energy")
    names = ("step", "cycle", "displacement", "platen_work", *TERMS, "residual",
             "platen_work_mean", "dissipation_mean", "closing_mean", "residual_mean")  # fmt: skip
    rows = [
        {"case": case, **{name: float(run.table[name][k]) for name in names}}
        for case, run in runs.items()
        for k in range(len(run.table["step"]))
    ]
    write_csv(figures.directory / "energy.csv", rows)


def cycle_table(runs: dict[str, Run], wear: float) -> list[dict]:
    """Per case and cycle: work of friction, its ratio to the cycle before, wear, drift."""
    rows = []
    for case, run in runs.items():
        for c in range(1, run.parameters.cycles + 1):
            steps = slice(run.unloaded(c - 1), run.unloaded(c))
            work, before = total(run, c), total(run, c - 1) if c > 1 else np.nan
            ends = [run.fields(run.unloaded(k))["displacement"] for k in (c - 1, c) if k]
            drift = np.linalg.norm((ends[-1] - ends[0])[:, :2], axis=1).max() if c > 1 else np.nan
            rows.append(
                {
                    "case": case,
                    "cycle": c,
                    "dissipation_Nmm": work,
                    "of_previous_cycle": work / before,
                    "end_of_step_rule_Nmm": float(run.table["dissipation_end"][steps].sum()),
                    "worn_volume_mm3": wear * work,
                    "largest_drift_um": 1e3 * drift,
                    "seconds": float(run.table["seconds"][steps].sum()),
                }
            )
    return rows


def cycles(figures: Figures, wear: float) -> list[dict]:
    """Work of friction per cycle and how it settles, and the drift of the nodes."""
    rows = cycle_table(figures.runs, wear)
    with rc_context(STYLE):
        figure = Figure(figsize=(14, 4.4), layout="constrained")
        work, settled, drift = figure.subplots(1, 3)
        for case in figures.runs:
            mine = [row for row in rows if row["case"] == case]
            n, D = [row["cycle"] for row in mine], [row["dissipation_Nmm"] for row in mine]
            style = dict(color=COLOURS[case], marker="osD"["ABC".index(case)], label=NAMES[case])
            work.plot(n, D, **style)
            change = [abs(row["of_previous_cycle"] - 1) for row in mine]
            settled.semilogy(n[1:], change[1:], **style)
            drift.semilogy(n[1:], [row["largest_drift_um"] for row in mine][1:], **style)
        work.set(title="Work of friction per cycle", ylabel="N mm", ylim=(0, None))
        settled.set(title="Its change to the cycle before", ylabel="relative")
        drift.set(title="Largest drift of a node per cycle", ylabel="µm")
        drift.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        drift.yaxis.set_major_formatter("{x:g}")
        drift.yaxis.set_minor_formatter(NullFormatter())
        for ax in (work, settled, drift):
            ax.set(xlabel="cycle", xticks=range(1, figures.cycles + 1))
            ax.grid(alpha=0.3)
        work.legend()
        figures.save(figure, "cycles")
    write_csv(figures.directory / "cycles.csv", rows)
    return rows


def maps(figures: Figures, wear: float) -> None:
    """Density of the work of friction in the first and last cycle and in all; worn depth."""
    last = figures.cycles
    columns = {"cycle 1": lambda run: run.dissipation(1) / run.area}
    if last > 1:
        columns[f"cycle {last}"] = lambda run: (
            (run.dissipation(last) - run.dissipation(last - 1)) / run.area
        )
        columns["all cycles"] = lambda run: run.dissipation(last) / run.area
    title = "Work of friction per area"
    figures.densities("dissipation", title, columns, "N mm / mm²")

    def depth(run):
        return 1e6 * wear * run.dissipation(last) / run.area

    title = f"Worn depth after {last} cycles, coefficient {wear:g} mm³/(N mm)"
    volumes = {
        case: f"{wear * run.dissipation(last).sum():.3g} mm³" for case, run in figures.runs.items()
    }
    figures.densities("wear", title, {"depth_nm": depth}, "nm", across=volumes)


def comparison(runs: dict[str, dict[str, Run]], failures=()) -> list[dict]:
    """Work of friction in the first cycle, with both rules, for all variants, the failed ones too."""
    base, rows = runs["base"], []
    for name, cases in runs.items():
        for case, run in cases.items():
            first, last = slice(0, run.unloaded(1)), run.parameters.cycles
            work = total(run, 1)
            rows.append(
                {
                    "variant": name,
                    "case": case,
                    "first_cycle_Nmm": work,
                    "of_base": work / total(base[case], 1),
                    "end_of_step_rule_Nmm": float(run.table["dissipation_end"][first].sum()),
                    "last_cycle": last,
                    "last_cycle_Nmm": total(run, last),
                    "contact_nodes": len(run.x),
                    "iterations_per_step": float(run.table["iterations"].mean()),
                    "seconds_per_step": float(run.table["seconds"].mean()),
                    "not_converged": "",
                }
            )
    for failure in failures:
        rows.append(dict.fromkeys(rows[0], np.nan) | failure)
    return rows


def mesh_orders(runs: dict[str, dict[str, Run]]) -> list[dict]:
    """Work of friction in the first cycle against the mesh, whose width halves from row to row.

    With changes a = D1 - D0 and b = D2 - D1 between three meshes the observed order is log2(a / b) and the
    limit, if that order lasted, D2 + b^2 / (a - b) [L. F. Richardson 1911]; nan where changes do not fall.
    """
    rows = []
    for case in runs["base"]:
        meshes = [cases[case] for name, cases in runs.items()
                  if case in cases and name.startswith(("base", "mesh "))]  # fmt: skip
        work = {run.parameters.refine: total(run, 1) for run in meshes}
        for run in sorted(meshes, key=lambda run: run.parameters.refine):
            level, order, limit = run.parameters.refine, np.nan, np.nan
            before, change = (
                work.get(k, np.nan) - work.get(k - 1, np.nan) for k in (level - 1, level)
            )
            if before * change > 0 and abs(before) > abs(change):
                order = float(np.log2(before / change))
                limit = work[level] + change**2 / (before - change)
            rows.append(
                {
                    "case": case,
                    "refine": level,
                    "contact_nodes": len(run.x),
                    "first_cycle_Nmm": work[level],
                    "change_relative": change / work.get(level - 1, np.nan),
                    "observed_order": order,
                    "limit_at_that_order_Nmm": limit,
                }
            )
    return rows


def convergence(figures: Figures, rows: list[dict], runs) -> bool:
    """Dissipation of the first cycle against increments and mesh; False if there is nothing."""
    base = next(iter(runs["base"].values())).parameters
    panels = [("increments per cycle", []), ("contact nodes", [])]
    for name, cases in runs.items():
        parameters = next(iter(cases.values())).parameters
        steps = parameters.loading + parameters.unloading
        same = (parameters.top, parameters.unload_to) == (base.top, base.unload_to)
        if same and parameters.refine == base.refine:
            panels[0][1].append((steps, name))
        if same and steps == base.loading + base.unloading:
            panels[1][1].append((len(next(iter(cases.values())).x), name))
    if max(len({size for size, _ in shown}) for _, shown in panels) < 2:
        return False
    of = {(row["variant"], row["case"]): row for row in rows}
    with rc_context(STYLE):
        figure = Figure(figsize=(11, 4.6), layout="constrained")
        for ax, (label, shown) in zip(figure.subplots(1, 2, sharey=True), panels):
            for case in figures.runs:
                mine = sorted((size, name) for size, name in shown if (name, case) in of)
                sizes = [size for size, _ in mine]
                style = dict(color=COLOURS[case], marker="osD"["ABC".index(case)])
                for key, dash, rule in (
                    ("first_cycle_Nmm", "-", "the library's rule"),
                    ("end_of_step_rule_Nmm", ":", "end of step"),
                ):
                    work = [of[name, case][key] for _, name in mine]
                    ax.semilogx(sizes, work, dash, label=f"{case}, {rule}", **style)
            ticks = sorted({size for size, _ in shown})
            ax.set_xticks(ticks, [str(size) for size in ticks])
            ax.minorticks_off()
            ax.set(xlabel=label)
            ax.grid(alpha=0.3)
        figure.axes[0].set(ylabel="work of friction, first cycle [N mm]", ylim=(0, None))
        figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside right center")
        figures.save(figure, "convergence")
    shown = {name for _, panel in panels for _, name in panel}
    write_csv(
        figures.directory / "convergence.csv", [row for row in rows if row["variant"] in shown]
    )
    return True
