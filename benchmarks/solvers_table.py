# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What docs/solvers.md quotes of the records of solvers.py: times of steps, growth, simpler laws, memory."""

from __future__ import annotations

import numpy as np
from quotes import exponent, measured, ratio, table


def claims(parts: dict) -> dict[str, str]:
    """Tables and numbers by part and key; ``when`` says when, on what and at which load the part was measured."""
    found = {}
    for part, record in parts.items():
        of = QUOTED[part](record["rows"]) | {"when": measured([record])}
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


MEMORY = {"kept": "kept (MB)", "estimate": "estimate (MB)", "peak": "measured peak (MB)"}


def _memory(row) -> list[str]:
    """What W and its inverse keep, what the default reckons with, and the peak, in megabytes."""
    return [f"{row[key] / 1e6:.0f}" for key in MEMORY]


def _growth(rows):
    lines, share = [], []
    for newton, fixed in _pairs(rows):
        nodes, steps = newton["nodes"], len(newton["times"]) - 1
        gain = (_later(fixed) - _later(newton)) / steps
        share.append((nodes, _later(newton) / _later(fixed)))
        lines.append([nodes, newton["unknowns"], f"{_later(newton):.2f}", f"{_later(fixed):.2f}", f"{newton['operator']:.2f}",
            f"{newton['operator'] / gain:.0f}" if gain > 0 else "never", *_memory(newton)])  # fmt: skip
    titles = ["contact nodes", "unknowns", "condensed (s)", "fixed point (s)", "W and inverse (s)",
        "paid back after steps", *MEMORY.values()]  # fmt: skip
    return {"table": table(titles, lines), "even": _even(share)}


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


def _assembly(rows):
    """Ratios to the first of the ways."""
    seconds = {row["way"]: float(np.median(row["seconds"])) for row in rows}
    over = {way.replace(" ", "-"): ratio(value / seconds["blocks"]) for way, value in seconds.items()}  # fmt: skip
    return {
        "blocks": f"{seconds['blocks']:.2f} s", "dense-over-blocks": over["dense"],
        "one-by-one-over-blocks": over["one-by-one"], "apart": f"{max(row['apart'] for row in rows):.0e}",
    }  # fmt: skip


def _shares(rows):
    titles = ["case", "a step (ms)", "Newton's method (ms)", "back-solves with K (ms)", "F (ms)", "all else (ms)",
        "an iteration (ms)"]  # fmt: skip
    lines, others = [], 0.0
    for row in rows:
        whole, of, steps = sum(row["times"]), row["seconds"], len(row["times"])
        spent = [whole, of["newton"], of["back_solves"], of["F"], whole - sum(of.values())]
        others += whole - of["newton"]
        each = of["newton"] / sum(row["iterations"])
        lines.append([row["case"], *(f"{1e3 * t / steps:.1f}" for t in spent), f"{1e3 * each:.1f}"])
    return {"table": table(titles, lines), "without-newton": f"{others:.1f} s"}


def _first_steps(rows):
    titles = ["contact nodes", "unknowns", "W (s)", "inverse (s)", "Newton's method (s)", "iterations", "slipping nodes",
        "error"]  # fmt: skip
    lines, inverse, each = [], [], []
    for row in rows:
        of, nodes = row["seconds"], row["nodes"]
        inverse.append((nodes, of["operator"] - of["W"]))
        each.append((nodes, of["newton"] / row["iterations"]))
        lines.append([nodes, row["unknowns"], *(f"{t:.1f}" for t in (of["W"], inverse[-1][1], of["newton"])),
            row["iterations"], row["slipping"], f"{row['error']:.0e}"])  # fmt: skip
    alone = all(len(row["branches"]) == 1 for row in rows)
    said = (
        "Newton's method itself solved all"
        if alone
        else "Not all were solved by Newton's method itself"
    )
    return {
        "table": table(titles, lines), "solved": said,
        "inverse-grows": f"{exponent(inverse):.1f}", "iteration-grows": f"{exponent(each):.1f}",
    }  # fmt: skip


QUOTED = {
    "study": _study, "growth": _growth, "punch": _growth, "frictionless": _cycle, "frictionless-punch": _cycle,
    "cycle-C": _cycle, "laws": _laws, "operator": _operator, "assembly": _assembly, "shares": _shares,
    "first-steps": _first_steps,
}  # fmt: skip
