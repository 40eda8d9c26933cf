# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Error against run time: every solver, and the peers beside it.

    make report              # half an hour and more; results/report/report.html
    make report QUICK=1      # minutes; results/report-quick/report.html

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

from matplotlib import rc_context
from tqdm import tqdm

from benchmarks.measurement import ROOT, compute, current, machine, now, stored
from benchmarks.peers import compare as peers
from benchmarks.peers import two_cylinders
from benchmarks.report import algebraic, ladder, stability, total, wear
from benchmarks.scaling import growth
from studies import page

# Each has TITLE, plan(size), evaluate(results), figure(data) with its CAPTION, and tables(data).
SECTIONS = dict(
    total=total, algebraic=algebraic, peers=peers, cylinders=two_cylinders, growth=growth, ladder=ladder, stability=stability, wear=wear
)  # fmt: skip
DRAWING = {"font.size": 12, "svg.hashsalt": "report", "axes.grid": True, "grid.alpha": 0.3}
INTRODUCTION = (
    "Times are processor seconds of one thread. Repeated runs are interleaved and shown by their median; a step of "
    "peers and growth is the mean of a programme that ran once. All numbers: report/report.json."
)
NAMED = dict(not_run="Not run, there was no time", older="Made with code that has changed since")


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


def evaluated(section: str, records: dict) -> dict:
    """What the page shows of a section, with what failed and what was not run."""
    made = {name: record for name, record in records.items() if record}
    results = {name: record["result"] for name, record in made.items() if "result" in record}
    return dict(
        title=SECTIONS[section].TITLE,
        data=SECTIONS[section].evaluate(results) if results else None,
        failed={name: record["failed"] for name, record in made.items() if "failed" in record},
        not_run=[name for name in records if name not in made],
        measured=Counter(when for record in made.values() for when in dates(record)),
        older=[name for name in results if not current(made[name])],
        seconds=sum(record["seconds"] for record in made.values()),
        load=[max((max(record["load"]) for record in made.values()), default=None)],
    )


def dates(record: dict) -> list[str]:
    """Day and commit of a record; those of its parts where it was put together from others."""
    result = record.get("result")
    parts = result.get("measured") if isinstance(result, dict) else None
    return parts or [f"{record['date'][:10]}, {record['commit']}"]


def write(report: dict, file: Path, directory: Path) -> dict[str, str]:
    """Draw all sections and write the page; the captions of the figures by their names."""
    for old in directory.glob("*.svg"):
        old.unlink()
    captions, parts = {}, []
    if report["size"] != "full":
        parts.append(page.paragraph(f"This is the {report['size']} report: less is measured.", "bad"))  # fmt: skip
    parts.append(page.paragraph(f"{report['date']}. {INTRODUCTION}"))
    for name, section in report["sections"].items():
        of, data, drawing = SECTIONS[name], section["data"], directory / f"{name}.svg"
        parts.append(f"<h2>{section['title']}</h2>")
        if data:
            with rc_context(DRAWING):
                of.figure(data).savefig(drawing, metadata={"Date": None})
            captions[name] = of.CAPTION
            parts.append(page.picture(drawing, of.CAPTION))
            parts += map(page.table, of.tables(data))
        parts += remarks(section, report["machine"])
    machine_rows = [{"": key, " ": value} for key, value in report["machine"].items()]
    parts += ["<h2>Machine</h2>", page.table(machine_rows)]
    page.write(file, "dolfinx_contact: error against run time", parts)
    return captions


def joined(old: dict, report: dict) -> dict:
    """A report with the sections of an older one that it does not have; those say on which machine, if on another one."""
    sections = {}
    for name in SECTIONS:
        if name in report["sections"]:
            sections[name] = report["sections"][name]
        elif name in old["sections"]:
            sections[name] = dict(machine=old["machine"]) | old["sections"][name]
    return report | dict(sections=sections)


def remarks(section: dict, machine: dict) -> list[str]:
    """What failed, what was not run, when it was measured, and what its machine had other than the report's."""
    bad = [f"Failed: {name}: {text[-300:]}" for name, text in section["failed"].items()]
    for key, said in NAMED.items():
        if section[key]:
            bad.append(f"{said}: {', '.join(section[key])}.")
    when = "; ".join(
        f"{day} ({count} record{'s' if count > 1 else ''})"
        for day, count in section["measured"].items()
    )
    load = f"at a load average of up to {section['load'][0] or 0:.1f}"
    measured = page.paragraph(f"Measured {when}, in {section['seconds']:.0f} s, {load}.")
    if other := {
        key: value
        for key, value in section.get("machine", {}).items()
        if machine.get(key) != value and key != "commit"  # which stands beside the date
    }:
        measured += page.paragraph(
            "Machine: " + ", ".join(f"{key} {value}" for key, value in other.items()) + "."
        )
    return [*(page.paragraph(text, "bad") for text in bad), measured]


def main(argv=None) -> Path:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)  # fmt: skip
    add = parser.add_argument
    sizes = ("full", "quick", "smallest")
    add("--size", choices=sizes, default="full", help="smallest: minutes less, for the tests")
    add("--sections", nargs="+", choices=SECTIONS, default=list(SECTIONS))
    add("--minutes", type=float, default=float("inf"), help="begin no measurement after these")
    add("--measurements", type=Path, help="where measurements are kept (default: in the output)")
    add("--output", type=Path, help="of the page (default: results/report or results/report-quick)")
    add("--keep", action="store_true", help="sections that are not measured: as report.json of the output has them")  # fmt: skip
    add("--redraw", action="store_true", help="measure nothing, draw what report.json of the output has")  # fmt: skip
    options = parser.parse_args(argv)
    output = options.output or ROOT / "results" / (
        "report" if options.size == "full" else "report-quick"
    )
    kept = options.measurements or output / "measurements"
    figures = output / "report"
    file = figures / "report.json"
    if options.redraw:
        report = json.loads(file.read_text())
    else:
        plans = {name: SECTIONS[name].plan(options.size) for name in options.sections}
        records = run(plans, kept, options.minutes)
        sections = {name: evaluated(name, of) for name, of in records.items()}
        report = dict(date=now(), size=options.size, machine=machine(), sections=sections)
        if options.keep and file.exists():
            report = joined(json.loads(file.read_text()), report)
    figures.mkdir(parents=True, exist_ok=True)
    report["figures"] = write(report, output / "report.html", figures)
    file.write_text(json.dumps(report, indent=1) + "\n")
    print(f"page      {output / 'report.html'}\nfigures   {figures}")
    return output / "report.html"


if __name__ == "__main__":
    main()
