# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Error against run time: every solver, the peers beside it, the price of every ingredient.

    make report              # half an hour and more; docs/report.html, docs/report/
    make report QUICK=1      # minutes; results/report-quick/

Every measurement has a process of its own, one thread, and is kept under results/; a run that is stopped
continues; what was measured with other settings, or with code that has changed since, is measured anew.  All times are
processor seconds, so that other programs on the machine disturb them least.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path
from time import monotonic

import dolfinx_contact as dc  # noqa: F401  before DOLFINx, which one of its wheels needs

# isort: split
from matplotlib import rc_context
from tqdm import tqdm

from benchmarks.measurement import ROOT, compute, current, machine, now, stored
from benchmarks.peers import compare as peers
from benchmarks.report import algebraic, ladder, meshes, stability
from benchmarks.scaling import growth
from studies import page

# Each has TITLE, plan(size), evaluate(results), figures(data) with captions, and tables(data).
SECTIONS = dict(
    algebraic=algebraic, meshes=meshes, peers=peers, growth=growth, ladder=ladder, stability=stability
)  # fmt: skip
DRAWING = {"font.size": 12, "svg.hashsalt": "report", "axes.grid": True, "grid.alpha": 0.3}


def arguments(argv=None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)  # fmt: skip
    add = parser.add_argument
    sizes = ("full", "quick", "smallest")
    add("--size", choices=sizes, default="full", help="smallest: minutes less, for the tests")
    add("--sections", nargs="+", choices=SECTIONS, default=list(SECTIONS))
    add("--minutes", type=float, default=float("inf"), help="begin no measurement after these")
    add("--measurements", type=Path, help="where measurements are kept (default: results/report)")
    add("--output", type=Path, help="of the page (default: docs, or results/report-quick)")
    add("--redraw", action="store_true", help="measure nothing, draw what report.json of the output has")  # fmt: skip
    return parser.parse_args(argv)


def run(plans: dict, directory: Path, minutes: float) -> dict:
    """Records by section and measurement; None, or one made with older code, for what there was no time for."""
    end = monotonic() + 60 * minutes
    records = {section: {} for section in plans}
    todo = [(section, measurement) for section, plan in plans.items() for measurement in plan]
    with tqdm(total=len(todo), unit="measurement", smoothing=0.1, disable=None) as bar:
        for section, measurement in sorted(todo, key=lambda pair: pair[1].late):
            bar.set_description(measurement.name)
            record = stored(measurement, directory)
            if not (record and current(record)) and monotonic() < end:
                record = compute(measurement, directory)
            records[section][measurement.name] = record
            bar.update()
    return records


def evaluated(records: dict) -> dict:
    """What the page shows of each section, with what failed and what was not run."""
    data = {}
    for section, of in records.items():
        results = {name: r["result"] for name, r in of.items() if r and "result" in r}
        data[section] = dict(
            title=SECTIONS[section].TITLE,
            data=SECTIONS[section].evaluate(results) if results else None,
            failed={name: r["failed"] for name, r in of.items() if r and "failed" in r},
            not_run=[name for name, r in of.items() if r is None],
            measured=dict(Counter(when for r in of.values() if r for when in dates(r))),
            older=[name for name, r in of.items() if r and "made_with" in r and not current(r)],
            seconds=sum(r["seconds"] for r in of.values() if r),
            load=[max((max(r["load"]) for r in of.values() if r), default=None)],
        )
    return data


def dates(record: dict) -> list[str]:
    """Day and commit of a record; those of its parts where it was put together from others."""
    result = record.get("result")
    parts = result.get("measured") if isinstance(result, dict) else None
    return parts or [f"{record['date'][:10]}, {record['commit']}"]


def write(report: dict, file: Path, directory: Path) -> dict[str, str]:
    """Draw all sections and write the page; the captions of the figures by their names."""
    for old in directory.glob("*.svg"):
        old.unlink()
    captions, short = {}, f"This is the {report['size']} report: less is measured."
    parts = [
        page.paragraph(short if report["size"] != "full" else "", "bad"),
        page.paragraph(f"{report['date']}. Times are processor seconds of one thread. Repeated runs are interleaved and shown by "
            "their median; a step of peers and growth is the mean of a programme that ran once. All numbers: report/report.json."),
    ]  # fmt: skip
    for name, section in report["sections"].items():
        parts.append(f"<h2>{section['title']}</h2>")
        if section["data"]:
            with rc_context(DRAWING):
                for figure, drawing, caption in SECTIONS[name].figures(section["data"]):
                    drawing.savefig(directory / f"{figure}.svg", metadata={"Date": None})
                    captions[figure] = caption
                    parts.append(page.picture(directory / f"{figure}.svg", caption))
            parts += map(page.table, SECTIONS[name].tables(section["data"]))
        parts += remarks(section)
    parts += ["<h2>Machine</h2>", page.table([{"": k, " ": v} for k, v in report["machine"].items()])]  # fmt: skip
    page.write(file, "dolfinx_contact: error against run time", parts)
    return captions


def remarks(section: dict) -> list[str]:
    """What failed, what was not run, when it was measured."""
    said = [f"Failed: {name}: {text[-300:]}" for name, text in section["failed"].items()]
    if section["not_run"]:
        said.append(f"Not run, there was no time: {', '.join(section['not_run'])}.")
    if section["older"]:
        said.append(f"Made with code that has changed since: {', '.join(section['older'])}.")
    when = "; ".join(f"{day} ({count})" for day, count in section["measured"].items())
    return [page.paragraph(text, "bad") for text in said] + [
        page.paragraph(f"Measured {when}, in {section['seconds']:.0f} s, at a load average of up to {section['load'][0] or 0:.1f}.")
    ]  # fmt: skip


def main(argv=None) -> Path:
    options = arguments(argv)
    quick = ROOT / "results" / "report-quick"
    kept = ROOT / "results" / "report" if options.size == "full" else quick / "measurements"
    output = options.output or (ROOT / "docs" if options.size == "full" else quick)
    figures = output / "report"
    file = figures / "report.json"
    if options.redraw:
        report = json.loads(file.read_text())
    else:
        plans = {name: SECTIONS[name].plan(options.size) for name in options.sections}
        records = run(plans, options.measurements or kept, options.minutes)
        report = dict(date=now(), size=options.size, machine=machine(), sections=evaluated(records))
    figures.mkdir(parents=True, exist_ok=True)
    report["figures"] = write(report, output / "report.html", figures)
    file.write_text(json.dumps(report, indent=1) + "\n")
    print(f"page      {output / 'report.html'}\nfigures   {figures}")
    return output / "report.html"


if __name__ == "__main__":
    main()
