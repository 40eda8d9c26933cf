# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Numbers of the report in README and docs: written between markers, from report.json, never by hand.

A marker is ``<!-- report:key -->text<!-- /report -->``; ``key`` is one of ``claims`` in report.json.
"""

from __future__ import annotations

import re
from pathlib import Path

MARKER = re.compile(r"<!-- report:([\w.-]+) -->(.*?)<!-- /report -->", re.DOTALL)


def marked(root: Path) -> list[Path]:
    """Files that may hold markers."""
    return [root / "README.md", *sorted((root / "docs").glob("*.md"))]


def found(root: Path) -> list[tuple[Path, str, str]]:
    """File, key and text of every marker."""
    return [
        (file, *match.groups())
        for file in marked(root)
        for match in MARKER.finditer(file.read_text())
    ]


def fill(root: Path, values: dict[str, str]) -> list[Path]:
    """Write what the markers stand for; gives the files that changed.

    Raises:
        KeyError: a marker whose claim was not measured.
    """
    changed = []
    for file in marked(root):
        text = file.read_text()
        new = MARKER.sub(lambda m: f"<!-- report:{m[1]} -->{values[m[1]]}<!-- /report -->", text)
        if new != text:
            file.write_text(new)
            changed.append(file)
    return changed


def claims(sections: dict) -> dict[str, str]:
    """Sentences and ratios that README and docs quote, by key; what was not measured is not there."""
    quoted = {}
    for name, section in sections.items():
        if section["data"]:
            quoted |= {f"{name}.{key}": text for key, text in QUOTES[name](section["data"])}
    return quoted


def ratio(value: float) -> str:
    """A ratio as a reader wants it: two digits."""
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}" if value >= 1 else f"{value:.2f}"


def _algebraic(data):
    for row in data["rows"]:
        scene = re.sub(r"\W+", "-", row["scene"])
        for solver in ("fixed point, return", "fixed point, bipotential"):
            newton, other = row["condensed Newton"]["seconds_to_1e_8"], row[solver]["seconds_to_1e_8"]  # fmt: skip
            if newton and other:
                yield f"{scene}.{solver.split()[-1]}-over-newton", ratio(other / newton)
        if row["pays_after"] is not None:
            yield f"{scene}.pays-after", f"{row['pays_after']:.0f}"


def _ladder(data):
    for row in data["rows"]:
        if "step_ratio" in row:
            yield f"{row['rung'].replace(' ', '-').replace(',', '')}", ratio(row["step_ratio"])
    if data["imports"]:
        ours, dolfinx = (data["imports"]["rows"][name]["median"] for name in ("dolfinx_contact", "dolfinx"))  # fmt: skip
        yield "import-over-dolfinx", ratio(ours / dolfinx)


def _stability(data):
    for solver, count in data.get("by_solver", {}).items():
        yield f"{solver.replace(' ', '-')}.solved", f"{count['solved']} of {count['scenes']}"
    yield "third-state", str(data.get("third_state", ""))


def _peers(data):
    for row in data["rows"]:
        if row.get("ratio"):
            yield f"{row['key']}.over-ours", ratio(row["ratio"])
            yield f"{row['key']}.error", f"{row['error']:.0e}" if row["error"] else "not judged"
            yield f"{row['key']}.ms", f"{1e3 * row['seconds']:.0f}"
            yield f"{row['key']}.ours-ms", f"{1e3 * row['ours']:.0f}"
            yield f"{row['key']}.done", row["done"]
            if row["force_error"] is not None:
                yield f"{row['key']}.difference", f"{row['force_error']:.1e}"


def _growth(data):
    for solver, fit in data["fits"].items():
        if fit["step"] is not None:
            yield f"{solver.replace(' ', '-').replace(',', '')}.exponent", f"{fit['step']:.2f}"
    of = [row for row in data["rows"] if row["solver"] == "fixed point, return"]
    if of:
        largest = max(of, key=lambda row: row["unknowns"])
        yield "largest", f"{largest['unknowns']:,}"
        yield "largest.over-elastic", ratio(largest["over_elastic"])


def _meshes(data):
    for answer in data["answers"]:
        yield f"dissipation-{answer['percent']:g}-percent", answer["text"]


QUOTES = dict(algebraic=_algebraic, meshes=_meshes, peers=_peers, growth=_growth, ladder=_ladder,
    stability=_stability)  # fmt: skip
