# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The study's figures, tables and its page."""

from pathlib import Path

from studies import page
from studies.punch import work
from studies.punch.figures import Figures, write_csv
from studies.punch.run import Run
from studies.punch.statements import STATEMENTS, ask

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
    "dissipation": "Work of friction per area, on one logarithmic scale; what is below it has its lowest colour.",
    "wear": "Archard's worn depth: coefficient times work of friction over nodal area.",
    "cycles": "How the work of friction settles.",
    "energy": "The energy balance and what it leaves open in each step: docs/dissipation.md says what it proves.",
    "convergence": "Work of friction in the first cycle against increments and mesh.",
}
SOURCE = (
    "G. de Saxcé, Z.-Q. Feng, Z. Mróz, M. Hjiaj, Comportement hystérétique du frottement anisotrope, "
    "18e Congrès Français de Mécanique, 2007, Section 3, computed anew."
)
DECIDED = (
    "Every statement is decided by a number, in every run: the base runs and, where computed (--explore), "
    "variants of what the paper leaves open. The bounds are ours; all numbers are in figures/answers.csv."
)


def report(runs: dict[str, dict[str, Run]], output: Path, wear: float, failures=()) -> None:
    """Draw all figures, write all tables and the page.

    ``runs`` by variant and case, the paper's programme is ``base``; ``wear`` is worn volume per work of friction,
    mm^3/(N mm); ``failures`` are the variants that did not converge.
    """
    base = runs["base"]
    figures = Figures(base, output / "figures")
    for old in figures.directory.glob("*"):
        old.unlink()
    figures.figure3()
    figures.unloading(1, "unloading1")
    if figures.cycles > 1:
        figures.unloading(figures.cycles, "unloading_last")
    for node in range(1 + len(figures.first.points)):
        figures.point(node)
    work.maps(figures, wear)
    work.energy(figures)
    variants = work.comparison(runs, failures)
    work.convergence(figures, variants)
    answers = ask({name: cases for name, cases in runs.items() if name != "mesh coarsened"})
    tables = dict(
        variants=variants, cycles=work.cycles(figures, wear), answers=answers,
        statements=verdicts(answers),
    )  # fmt: skip
    for name, rows in tables.items():
        write_csv(figures.directory / f"{name}.csv", rows)
    parts = [
        page.paragraph(SOURCE),
        "<h2>What the paper says, and what holds</h2>", page.paragraph(DECIDED), page.table(tables["statements"]),
        "<h2>Figures</h2>", *pictures(figures.directory),
        "<h2>Work of friction and wear, cycle by cycle</h2>", page.table(tables["cycles"]),
        page.paragraph(f"Worn volume at {wear:g} mm³/(N mm); depth and volume are proportional to it."),
        "<h2>Variants</h2>", page.table(variants),
        "<h2>Parameters</h2>", page.table(settings(base)),
    ]  # fmt: skip
    title = f"Cyclic punch with anisotropic friction: cases {', '.join(base)}"
    page.write(output / "study.html", title, parts)


def pictures(directory: Path) -> list[str]:
    """All that was drawn, in the order of the captions; then other tracked nodes."""
    drawn = {file.stem: file for file in sorted(directory.glob("*.svg"))}
    order = [name for name in CAPTIONS if name in drawn]
    return [
        page.picture(
            drawn[name], CAPTIONS.get(name, "Another tracked node."), f"{directory.name}/{name}.csv"
        )
        for name in dict.fromkeys([*order, *drawn])
    ]


def verdicts(answers: list[dict]) -> list[dict]:
    """One row a statement: in how many of the runs it holds, by case, and what that makes it."""
    rows = []
    for statement in STATEMENTS:
        mine = [row for row in answers if row["statement"] == statement.key]
        holds = {row["case"]: [] for row in mine}
        for row in mine:
            holds[row["case"]].append(row["holds"])
        base = [f"{row['case']} {row['value']:.3g}" for row in mine if row["variant"] == "base"]
        found = {row["holds"] for row in mine}
        if mine:
            rows.append({
                "where": statement.where, "statement": statement.text, "decided by": statement.measure,
                "verdict": "depends" if len(found) > 1 else "holds in all" if found == {1} else "holds in none",
                "runs in which it holds": ", ".join(f"{case} {sum(of)}/{len(of)}" for case, of in holds.items()),
                "values of the base runs": ", ".join(base),
            })  # fmt: skip
    return rows


def settings(base: dict[str, Run]) -> list[dict]:
    """What was computed and by what, one column a case."""
    rows = {}
    for case, run in base.items():
        for key, of in run.head.items():
            for name, value in (of if isinstance(of, dict) else {key: of}).items():
                rows.setdefault(name, {"": name})[case] = value
    return list(rows.values())
