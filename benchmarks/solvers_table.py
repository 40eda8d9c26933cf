# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What docs/solvers.md quotes of the records of solvers.py: times of steps, growth, simpler laws, memory."""

from __future__ import annotations

import numpy as np
from quotes import ratio, table


def claims(parts: dict) -> dict[str, str]:
    """Tables and numbers by part and key; ``when`` says when, on what and at which load the part was measured."""
    found = {}
    for part, record in parts.items():
        low, high = sorted(record["load"])
        of = QUOTED[part](record["rows"])
        of["when"] = (
            f"{record['date'][:10]}, {record['processor']}, commit {record['commit']}, load average "
            f"{low:.1f} to {high:.1f}"
        )  # fmt: skip
        found |= {f"{part}.{key}": text for key, text in of.items()}
    return found


def _pairs(rows):
    """Row of the condensed Newton and of the fixed point, scene by scene."""
    return list(zip(rows[::2], rows[1::2]))


def _later(row) -> float:
    return sum(row["times"][1:])


def _ms(seconds, pattern=".0f") -> list[str]:
    """Median and spread in milliseconds."""
    t = 1e3 * np.array(seconds)
    median, least, largest = (format(x, pattern) for x in (np.median(t), t.min(), t.max()))
    return [median, f"{least} – {largest}"]


def _study(rows):
    lines = [
        [f"{row['case']}, {len(row['times'])} steps", row["solver"], f"{row['factor']:.2f}",
         f"{row['operator']:.2f}" if row["operator"] else "–", f"{np.mean(row['iterations']):.1f}",
         *_ms(row["times"][1:]), f"{_later(row):.2f}"]
        for row in rows
    ]  # fmt: skip
    titles = ["scene", "solver", "factor K (s)", "W and inverse (s)", "iterations a step", "median (ms)", "spread (ms)",
        "all but the first (s)"]  # fmt: skip
    newton, fixed = zip(*_pairs(rows))
    apart = [
        (np.abs(np.subtract(a["totals"], b["totals"])) / np.abs(b["totals"])).max()
        for a, b in zip(newton, fixed)
    ]
    return {
        "table": table(titles, lines),
        "condensed": f"{sum(map(_later, newton)):.1f} s",
        "fixed-point": f"{sum(map(_later, fixed)):.0f} s",
        "fixed-point-over-condensed": ratio(sum(map(_later, fixed)) / sum(map(_later, newton))),
        "apart": ", ".join(f"{x:.1e} ({row['case']})" for x, row in zip(apart, newton)),
    }


def _growth(rows):
    lines, share, kept = [], [], []
    for newton, fixed in _pairs(rows):
        nodes, steps = newton["nodes"], len(newton["times"]) - 1
        gain = (_later(fixed) - _later(newton)) / steps
        share.append((nodes, _later(newton) / _later(fixed)))
        lines.append([nodes, newton["unknowns"], f"{_later(newton):.2f}", f"{_later(fixed):.2f}",
            f"{newton['operator']:.2f}", f"{newton['operator'] / gain:.0f}" if gain > 0 else "never"])  # fmt: skip
        kept.append([nodes, newton["unknowns"], *(f"{newton[key] / 1e6:.0f}" for key in ("kept", "estimate", "peak"))])  # fmt: skip
    titles = ["contact nodes", "unknowns", "condensed (s)", "fixed point (s)", "W and inverse (s)",
        "paid back after steps"]  # fmt: skip
    sizes = ["contact nodes", "unknowns", "W and inverse kept (MB)", "estimate (MB)", "measured peak (MB)"]  # fmt: skip
    return {"table": table(titles, lines), "memory": table(sizes, kept), "even": _even(share)}


def _even(share) -> str:
    """Contact nodes at which both solvers take as long, from nodes and the ratio of their seconds, interpolated."""
    nodes, over = np.log(np.array(share)).T
    crosses = over[0] < 0 < over[-1]
    return f"{np.exp(np.interp(0.0, over, nodes)):.0f} nodes" if crosses else "no size"


def _cycle(rows):
    """Medians over the repetitions of all that a cycle takes but the factors of K, and of its later steps alone."""
    runs = {}
    for newton, fixed in _pairs(rows):
        runs.setdefault((newton["nodes"], newton["unknowns"]), []).append(
            [*(sum(row["times"]) + row["operator"] for row in (newton, fixed)), _later(newton), _later(fixed)]
        )  # fmt: skip
    medians = {size: np.median(seconds, axis=0) for size, seconds in runs.items()}
    lines = [[*size, *(f"{t:.2f}" for t in seconds)] for size, seconds in medians.items()]
    titles = ["contact nodes", "unknowns", "condensed (s)", "fixed point (s)", "condensed, all but the first (s)",
        "fixed point, all but the first (s)"]  # fmt: skip
    share = [(nodes, t[0] / t[1]) for (nodes, _), t in medians.items()]
    return {"table": table(titles, lines), "even": _even(share)}


def _laws(rows):
    lines = [
        [row["law"], f"{1e3 * row['inverse']:.0f}", f"{np.mean(row['iterations']):.1f}", *_ms(row["times"], ".1f"),
         f"{1e3 * sum(row['times']) / sum(row['iterations']):.1f}", f"{row['slipping']:.0f} of {row['nodes']}" if row["law"] != "frictionless" else "–"]
        for row in rows
    ]  # fmt: skip
    titles = ["law", "inverse (ms)", "iterations", "median (ms)", "spread (ms)", "ms per iteration", "slipping nodes"]  # fmt: skip
    return {"table": table(titles, lines)}


def _operator(rows):
    smooth, rough = (float(np.median(row["operator"])) for row in rows)
    factor = float(np.median([t for row in rows for t in row["factor"]]))
    return {
        "frictionless": f"{smooth:.3f} s", "friction": f"{rough:.3f} s", "factor": f"{factor:.3f} s",
        "frictionless-over-friction": ratio(smooth / rough), "friction-over-factor": ratio(rough / factor),
    }  # fmt: skip


QUOTED = {
    "study": _study, "growth": _growth, "punch": _growth, "frictionless": _cycle, "frictionless-punch": _cycle,
    "laws": _laws, "operator": _operator,
}  # fmt: skip
