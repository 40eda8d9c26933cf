# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What README and docs quote of the report; quotes.py writes it there."""

from __future__ import annotations

import re

import numpy as np
import stress_table
from quotes import exponent, ratio, table


def claims(sections: dict) -> dict[str, str]:
    """Sentences and ratios by key, from the sections of report.json; what was not measured is not there."""
    return {
        f"{name}.{key}": text
        for name, quoted in QUOTED.items()
        if sections.get(name) and sections[name]["data"]
        for key, text in quoted(sections[name]["data"])
    }


def _algebraic(data):
    for row in data["rows"]:
        scene = re.sub(r"\W+", "-", row["scene"])
        newton, fixed = (row[s]["seconds_to_1e_8"] for s in ("condensed Newton", "fixed point, return"))  # fmt: skip
        if newton and fixed:
            yield f"{scene}.return-over-newton", ratio(fixed / newton)
        if after := pays_after(row["runs"]):
            yield f"{scene}.pays-after", str(after)


def pays_after(runs: dict) -> int | None:
    """Steps of the programme from which on the condensed Newton has taken less than the return map, all set-up included."""
    newton, fixed = (np.cumsum(runs[s]["seconds"]) for s in ("condensed Newton", "fixed point, return"))  # fmt: skip
    steps = min(len(newton), len(fixed))
    behind = np.flatnonzero(newton[:steps] > fixed[:steps])
    first = int(behind[-1]) + 2 if len(behind) else 1
    return first if first <= steps else None


def _ladder(data):
    for row in data["rows"]:
        if "step_ratio" in row:
            yield f"{row['rung'].replace(' ', '-').replace(',', '')}", ratio(row["step_ratio"])
    if data["imports"]:
        ours, dolfinx = (data["imports"]["rows"][name]["median"] for name in ("dolfinx_contact", "dolfinx"))  # fmt: skip
        yield "import-over-dolfinx", ratio(ours / dolfinx)


def _peers(data):
    judged = [row for row in data["rows"] if row["key"].startswith("siconos")]
    titles = ["case", "Siconos (ms)", "converged", "its largest error by our judge", "`CondensedNewton` (ms)", "ratio",
        "reactions differ by"]  # fmt: skip
    yield "siconos", table(titles, [
        [row["case"], f"{1e3 * row['seconds']:.0f}", row["done"], f"{row['error']:.0e}", f"{1e3 * row['ours']:.0f}",
         ratio(row["ratio"]), f"{row['force_error']:.1e}"] for row in judged
    ])  # fmt: skip
    for row in data["rows"]:
        if row.get("ratio"):
            yield f"{row['key']}.over-ours", ratio(row["ratio"])
            yield f"{row['key']}.error", f"{row['error']:.0e}" if row["error"] else "not judged"


def _growth(data):
    for solver, fit in data["fits"].items():
        if fit["step"] is not None:
            key = solver.replace(" ", "-").replace(",", "")
            yield f"{key}.exponent", f"{fit['step']:.2f}"
            if last := last_exponent(data["rows"], solver):
                yield f"{key}.last-exponent", f"{last[1]:.2f}"
    of = [row for row in data["rows"] if row["solver"] == "fixed point, return"]
    if of:
        largest = max(of, key=lambda row: row["unknowns"])
        yield "largest", f"{largest['unknowns']:,}"
        yield "largest.over-elastic", ratio(largest["over_elastic"])


def last_exponent(rows: list[dict], solver: str) -> tuple[int, float] | None:
    """Growth of the seconds of a step over a solver's three largest sizes, and the smallest of these."""
    of = sorted((row["unknowns"], row["step"]) for row in rows if row["solver"] == solver)[-3:]
    return (of[0][0], exponent(of)) if len(of) == 3 else None


def _meshes(data):
    for answer in data["answers"]:
        yield f"dissipation-{answer['percent']:g}-percent", answer["text"]


QUOTED = dict(
    algebraic=_algebraic, meshes=_meshes, peers=_peers, growth=_growth, ladder=_ladder, stability=stress_table.claims
)  # fmt: skip
