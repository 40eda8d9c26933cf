"""The study's page: one HTML file with all figures, tables and parameters, and no other files."""

from __future__ import annotations

import base64
import csv
import html
import json
from pathlib import Path

import numpy as np

from studies.punch import work
from studies.punch.figures import Figures, write_csv
from studies.punch.run import Run
from studies.punch.statements import STATEMENTS, ask

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 1500px; margin: 2em auto; padding: 0 1em; }
img { max-width: 100%; } table { border-collapse: collapse; margin: 1em 0; }
td, th { border: 1px solid #bbb; padding: 0.2em 0.6em; text-align: right; vertical-align: top; }
td.text, th.text { text-align: left; } figure { margin: 2em 0; }
"""

CAPTIONS = {  # in the order of the page; what to see in each figure stands in docs/study.md
    "fig3": "Figure 3. The load function f on the mesh's own faces; each node has the quarters around "
    "it. Outlined: stick zones. Arrows: slip of the last increment.",
    "unloading1": "The same within the first unloading: the central zone, the zone that appears at the "
    "rim, and reverse slip advancing inwards behind it.",
    "unloading_last": "The same within the last unloading.",
    "fig4": "Figure 4. Trajectory of P in the contact plane.",
    "fig5": "Figure 5. Friction force at P against the programme.",
    "fig6": "Figure 6. Slip of P against the programme; shaded where P sticks.",
    "fig7": "Figure 7. Applied force against slip of P.",
    "dissipation": "Work of friction per area, on one logarithmic scale; what is "
    "below it has its lowest colour.",
    "wear": "Archard's worn depth: coefficient times work of friction over nodal area.",
    "cycles": "How the work of friction settles.",
    "energy": "The energy balance and what it leaves open in each step.",
    "convergence": "Work of friction in the first cycle against increments and mesh.",
}

ENERGY = """<p>Equilibrium at the end of a step times the increment of displacement gives, because r<sub>n</sub>
x<sub>n</sub> = 0 there: <b>work of the platen = change of elastic energy + dissipation with forces of
the end of the step + ½ Δu·K Δu + Σ r<sub>n</sub> x<sub>n</sub>(before)</b>. The force of the platen is taken from the
reactions, the elastic energy from an integral over the body, so the sum closes only if equilibrium,
complementarity and the bookkeeping of slip do. It is no evidence that the increments are small enough: ½ Δu·K Δu, which forces of
the end of the step add, is not small, most of it the bulk's compression. With means of old and new forces that term vanishes by
algebra; the trapezoidal balance therefore closes for any increments, and its closing is no evidence either.
The work of friction of all tables is neither dissipation of a balance: it is the library's rule, never negative at
any node and exact for rigid sliding (docs/dissipation.md); how it converges is in the table of variants.</p>"""


def report(runs: dict[str, dict[str, Run]], output: Path, wear: float, failures=()) -> None:
    """Draw all figures, write all tables and the page.

    Args:
        runs: By variant and case; ``base`` is the paper's programme.
        output: Directory of the study.
        wear: Worn volume per work of friction, mm^3/(N mm).
        failures: The variants that did not converge.
    """
    base = runs["base"]
    figures = Figures(base, output / "figures")
    for old in figures.directory.glob("*"):
        old.unlink()
    figures.figure3()
    figures.unloading(1, "unloading1")
    if figures.cycles > 1:
        figures.unloading(figures.cycles, "unloading_last")
    nodes = 1 + len(next(iter(base.values())).points)
    for node in range(nodes):
        figures.point(node)
    work.maps(figures, wear)
    work.cycles(figures, wear)
    work.energy(figures)
    here = figures.directory
    compared = work.comparison(runs, failures)
    write_csv(here / "mesh.csv", work.mesh_orders(runs))
    work.convergence(figures, compared, runs)
    write_csv(here / "variants.csv", compared)
    answers = ask({name: cases for name, cases in runs.items() if name != "mesh coarsened"})
    write_csv(here / "answers.csv", answers)
    write_csv(here / "statements.csv", verdicts(answers))
    write_csv(here / "times.csv", times(base))
    (output / "study.html").write_text(page(base, here, wear), encoding="utf-8")


def verdicts(answers: list[dict]) -> list[dict]:
    """One row a statement: in how many of the runs it holds, by case, and what that makes it."""
    rows = []
    for statement in STATEMENTS:
        mine = [row for row in answers if row["statement"] == statement.key]
        if not mine:
            continue
        holds = [row["holds"] for row in mine]
        verdict = "holds in all" if all(holds) else "depends" if any(holds) else "holds in none"
        counts, base = [], []
        for case in dict.fromkeys(row["case"] for row in mine):
            here = [row["holds"] for row in mine if row["case"] == case]
            counts.append(f"{case} {sum(here)}/{len(here)}")
            base += [
                f"{case} {row['value']:.3g}"
                for row in mine
                if row["case"] == case and row["variant"] == "base"
            ]
        rows.append(
            {
                "where": statement.where,
                "statement": statement.text,
                "decided by": statement.measure,
                "verdict": verdict,
                "runs in which it holds": ", ".join(counts),
                "values of the base runs": ", ".join(base),
            }
        )
    return rows


def times(base: dict[str, Run]) -> list[dict]:
    """Wall times and largest errors of the base runs."""
    return [
        {
            "case": case,
            "steps": len(run.table["step"]),
            "seconds": float(run.table["seconds"].sum()),
            "seconds_per_step": float(run.table["seconds"].mean()),
            "slowest_step": float(run.table["seconds"].max()),
            "iterations": int(run.table["iterations"].sum()),
            "largest_error": float(run.table["error"].max()),
            "largest_slip_error": float(run.table["slip_error"].max()),
            "energy_left_open": float(work.relative_residual(run).max()),
        }
        for case, run in base.items()
    ]


def page(base: dict[str, Run], directory: Path, wear: float) -> str:
    """The page, from the files in ``directory``: its numbers are those of the CSV files."""
    first = next(iter(base.values()))
    cases = ", ".join(base)
    parts = [
        f"<h1>Cyclic punch with anisotropic friction: cases {cases}</h1>",
        "<p>G. de Saxcé, Z.-Q. Feng, Z. Mróz, M. Hjiaj, <i>Comportement hystérétique du frottement "
        "anisotrope</i>, 18e Congrès Français de Mécanique, 2007, Section 3, computed anew.</p>",
        "<h2>What the paper says, and what holds</h2>",
        "<p>Every statement is decided by a number, in every run: the base runs and, where computed "
        "(--explore), variants of what the paper leaves open. The bounds are ours; the numbers of all runs are in "
        "figures/answers.csv.</p>",
        table(directory / "statements.csv"),
        "<h2>Figures</h2>",
    ]
    names = {file.stem: None for file in sorted(directory.glob("*.svg"))}
    extra = [name for name in names if name not in CAPTIONS]
    for name in [*CAPTIONS, *extra]:
        if name not in names:
            continue
        if name == "energy":
            parts += ["<h2>Energy balance</h2>", ENERGY]
        caption = CAPTIONS.get(name, f"Another tracked node: {name}.")
        parts.append(picture(directory / f"{name}.svg", caption))
    parts += [
        "<h2>Work of friction and wear, cycle by cycle</h2>",
        table(directory / "cycles.csv"),
        "<p>Ranked by the work of all cycles: "
        + "; ".join(f"{case} {work:.1f} N mm" for case, work in ranking(directory / "cycles.csv"))
        + f". Worn volume at {wear:g} mm³/(N mm); depth and volume are proportional to it.</p>",
        "<h2>Variants</h2>",
        table(directory / "variants.csv"),
        "<p>Against the mesh: order of the last three meshes, and the limit if that order lasted.</p>",
        table(directory / "mesh.csv"),
        "<h2>Times and errors</h2>",
        table(directory / "times.csv"),
        "<h2>Parameters</h2>",
        "<p>Nodes of the maps, with the density of work of each: figures/dissipation.csv.</p>",
        parameters(base),
    ]
    head = f'<meta charset="utf-8"><title>Cyclic punch, {first.parameters.cycles} cycles</title>'
    body = "\n".join(parts)
    return f'<!doctype html><html lang="en"><head>{head}<style>{STYLE}</style></head><body>{body}</body></html>\n'


def parameters(base: dict[str, Run]) -> str:
    """What was computed and by what, one column a case."""
    heads = {}
    for case, run in base.items():
        heads[case] = {}
        for key, value in run.head.items():
            heads[case].update(value if isinstance(value, dict) else {key: value})
    lines = [f"<tr><th></th>{''.join(f'<th>{case}</th>' for case in heads)}</tr>"]
    for key in next(iter(heads.values())):
        cells = "".join(f"<td>{html.escape(json.dumps(head[key]))}</td>" for head in heads.values())
        lines.append(f'<tr><td class="text">{html.escape(key.replace("_", " "))}</td>{cells}</tr>')
    return "<table>" + "\n".join(lines) + "</table>"


def picture(file: Path, caption: str) -> str:
    data = base64.b64encode(file.read_bytes()).decode()
    image = f'<img src="data:image/svg+xml;base64,{data}" alt="{html.escape(caption)}">'
    return (
        f"<figure>{image}<figcaption>{html.escape(caption)} ({file.stem}.csv)</figcaption></figure>"
    )


def table(file: Path) -> str:
    """A CSV file as an HTML table, its numbers to four digits."""
    with open(file, newline="") as stream:
        rows = list(csv.reader(stream))
    lines = []
    for k, row in enumerate(rows):
        tag, cells = "th" if k == 0 else "td", []
        for text in row:
            try:
                cells.append(f"<{tag}>{shown(text)}</{tag}>")
            except ValueError:
                cells.append(f'<{tag} class="text">{html.escape(text.replace("_", " "))}</{tag}>')
        lines.append("<tr>" + "".join(cells) + "</tr>")
    return "<table>" + "\n".join(lines) + "</table>"


def shown(text: str) -> str:
    """A number of a CSV file as the page shows it; ValueError if it is none."""
    value = float(text)
    if np.isnan(value):
        return "–"
    return text if text.lstrip("-").isdigit() else f"{value:.4g}"


def ranking(file: Path) -> list[tuple[str, float]]:
    """Cases by the work of all cycles, most first, from ``cycles.csv``."""
    sums: dict[str, float] = {}
    with open(file, newline="") as stream:
        for row in csv.DictReader(stream):
            sums[row["case"]] = sums.get(row["case"], 0.0) + float(row["dissipation_Nmm"])
    return sorted(sums.items(), key=lambda item: -item[1])
