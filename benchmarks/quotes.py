# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Numbers in README and docs: written between markers from the records in docs, never by hand.

    python benchmarks/quotes.py      # writes them all anew

A marker is ``<!-- source.key -->text<!-- end -->``, or the same with the text on lines of its own.  Texts are made from
what was measured, but for the study's, which are kept as tools/study-docs makes them.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
MARKER = re.compile(r"<!-- ([\w.-]+) -->(\n?)(.*?)(\n?)<!-- end -->", re.DOTALL)


def texts(root: Path = ROOT) -> dict[str, str]:
    """What every marker stands for, by key."""
    import elastic_table
    import kernel_table
    import report_claims
    import solvers_table
    import variants_table

    def read(file):
        return json.loads((root / "docs" / file).read_text())

    sources = {
        "report": report_claims.claims(read("report/report.json")["sections"]),
        "air": elastic_table.air(read("elastic_air.json")),
        "elastic": elastic_table.claims(read("elastic_ratio.json")),
        "solvers": solvers_table.claims(read("solvers.json")),
        "variants": variants_table.claims(read("variants.json")),
        "kernel": kernel_table.claims((root / "docs/kernel_bench.csv").read_text()),
        "ferrari": kernel_table.ferrari(read("ferrari.json")),
        "study": read("study/study.json"),
    }
    return {f"{name}.{key}": text for name, of in sources.items() for key, text in of.items()}


def ratio(value: float) -> str:
    """A ratio as a reader wants it: two digits."""
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}" if value >= 1 else f"{value:.2f}"


def table(titles, lines) -> str:
    """Titles and lines of cells in Markdown."""
    return "\n".join(f"| {' | '.join(map(str, x))} |" for x in (titles, ["---"] * len(titles), *lines))  # fmt: skip


def measured(records: list[dict]) -> str:
    """When records were measured, on what, with which library and at which load."""
    days, processors, commits = (
        " and ".join(dict.fromkeys(record[key][:length] for record in records if key in record))
        for key, length in (("date", 10), ("processor", None), ("commit", None))
    )
    loads = [load for record in records for load in record["load"]]
    where = f"{processors}, " if processors else ""
    return f"{days}, {where}commit {commits}, load average {min(loads):.1f} to {max(loads):.1f}"


def exponent(pairs) -> float:
    """Slope of a straight line through the logarithms of pairs, least squares."""
    return float(np.polyfit(*np.log(np.transpose(pairs)), 1)[0])


def marked(root: Path) -> list[Path]:
    """Files that may hold markers."""
    return [root / "README.md", *sorted((root / "docs").glob("*.md"))]


def filled(text: str, of: dict[str, str]) -> str:
    """``text`` with what its markers stand for.

    Raises:
        KeyError: a marker whose number was not measured.
    """
    return MARKER.sub(lambda m: f"<!-- {m[1]} -->{m[2]}{of[m[1]]}{m[4]}<!-- end -->", text)


def fill(root: Path = ROOT, of: dict[str, str] | None = None) -> list[Path]:
    """Write what the markers stand for; gives the files that changed.  Raises as ``filled``."""
    of = of or texts(root)
    new = {file: filled(file.read_text(), of) for file in marked(root)}
    changed = [file for file in new if new[file] != file.read_text()]
    for file in changed:
        file.write_text(new[file])
        print(f"filled    {file}")
    return changed


if __name__ == "__main__":
    fill()
