# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The report's page: one HTML file, every figure in it as SVG, under each the sentence that its numbers make."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

from matplotlib import rc_context

from benchmarks.report import draw as solvers
from benchmarks.report import draw_sizes as sizes
from studies.punch import page as study_page

DRAWN = {  # figures with their sentences, and tables
    "algebraic": (solvers.algebraic, solvers.algebraic_tables),
    "meshes": (sizes.meshes, sizes.meshes_tables),
    "peers": (sizes.peers, sizes.peers_tables),
    "growth": (sizes.growth, sizes.growth_tables),
    "ladder": (solvers.ladder, solvers.ladder_tables),
    "stability": (solvers.stability, solvers.stability_tables),
}
STYLE = study_page.STYLE + "\nsvg { max-width: 100%; height: auto; } .bad { color: #b00020; }"
# Text stays text: a page of a tenth of the size, in which one can search.
DRAWING = {
    "font.size": 12,
    "svg.hashsalt": "report",
    "svg.fonttype": "none",
    "font.sans-serif": ["DejaVu Sans"],
    "axes.grid": True,
    "grid.alpha": 0.3,
}


def write(report: dict, file: Path, figures: Path) -> dict[str, str]:
    """Draw all sections and write the page.

    Returns:
        The sentence of each figure by its name.
    """
    for old in figures.glob("*.svg"):
        old.unlink()
    body, sentences = [head(report)], {}
    for number, (name, section) in enumerate(report["sections"].items(), start=1):
        body.append(f"<h2>{number}. {html.escape(section['title'])}</h2>")
        figures_of, tables_of = DRAWN[name]
        if section["data"]:
            with rc_context(DRAWING):
                for figure, drawing, sentence in figures_of(section["data"]):
                    drawing.savefig(figures / f"{figure}.svg", metadata={"Date": None})
                    sentences[figure] = sentence
                    body.append(picture(figures / f"{figure}.svg", sentence))
            body += [table(rows) for rows in tables_of(section["data"])]
        body += remarks(section)
    body.append(f"<h2>Machine</h2><code>{html.escape(json.dumps(report['machine'], indent=1))}</code>")  # fmt: skip
    title = '<meta charset="utf-8"><title>dolfinx_contact: error against run time</title>'
    file.write_text(
        f'<!doctype html><html lang="en"><head>{title}<style>{STYLE}</style></head><body>'
        + "\n".join(body) + "</body></html>\n"
    )  # fmt: skip
    return sentences


def head(report: dict) -> str:
    machine, size = report["machine"], report["size"]
    loads = [s["load"][0] for s in report["sections"].values() if s["load"][0] is not None]
    short = (
        "" if size == "full" else f"<p class='bad'>This is the {size} report: less is measured.</p>"
    )
    return (
        f"<h1>dolfinx_contact: error against run time</h1>{short}<p>{report['date']}; "
        f"{html.escape(machine['processor'])}, {machine['cores']} cores, {machine['memory_gb']} GB; "
        f"{html.escape(machine['compiler'])}; DOLFINx {machine['dolfinx']}, PETSc {machine['petsc']}, "
        f"dolfinx_contact {machine['dolfinx_contact']} ({machine['commit']}). Times are processor seconds of one "
        "thread; each section states the load. Work and precision, the ladder and "
        "imports are medians of repeated, interleaved runs, with the least and the largest; a step of peers and growth is "
        "the mean of a programme that ran once; meshes are medians of three where they take seconds and ran once where "
        f"they take longer (load average up to {max(loads, default=0):.1f}). Raw numbers: "
        "report/report.json.</p>"
    )  # fmt: skip


def remarks(section: dict) -> list[str]:
    """What failed, what was not run, when it was measured."""
    lines = [
        f"<p class='bad'>Failed: {html.escape(name)}: {html.escape(said[-300:])}</p>"
        for name, said in section["failed"].items()
    ]
    if section["not_run"]:
        lines.append(
            f"<p class='bad'>Not run, there was no time: {html.escape(', '.join(section['not_run']))}.</p>"
        )
    if section["older"]:
        lines.append(
            "<p class='bad'>Made with code that has changed since, there was no time to repeat them: "
            f"{html.escape(', '.join(section['older']))}.</p>"
        )
    if dated := section["measured"]:
        when = "; ".join(f"{day}" + (f" ({count})" if len(dated) > 1 else "") for day, count in dated.items())  # fmt: skip
        lines.append(
            f"<p>Measured {html.escape(when)}, in {section['seconds']:.0f} s, at a load average of up to "
            f"{section['load'][0]:.1f}.</p>"
        )
    return lines


def picture(file: Path, sentence: str) -> str:
    """The SVG itself, without what only a file of its own needs."""
    svg = file.read_text()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    # Identifiers of two figures in one page must not meet.
    svg = re.sub(r'\bid="', f'id="{file.stem}-', svg)
    svg = re.sub(r"url\(#", f"url(#{file.stem}-", svg)
    svg = re.sub(r'xlink:href="#', f'xlink:href="#{file.stem}-', svg)
    return f"<figure>{svg}<figcaption><b>{html.escape(sentence)}</b></figcaption></figure>"


def table(rows: list[dict]) -> str:
    """Dictionaries as rows; numbers to three digits."""
    if not rows:
        return ""
    lines = ["<tr>" + "".join(f"<th>{html.escape(key)}</th>" for key in rows[0]) + "</tr>"]
    for row in rows:
        lines.append("<tr>" + "".join(cell(row.get(key)) for key in rows[0]) + "</tr>")
    return "<table>" + "\n".join(lines) + "</table>"


def cell(value) -> str:
    if value is None:
        return "<td>–</td>"
    if isinstance(value, float):
        return f"<td>{value:.3g}</td>"
    if isinstance(value, int):
        return f"<td>{value}</td>"
    return f'<td class="text">{html.escape(str(value))}</td>'
