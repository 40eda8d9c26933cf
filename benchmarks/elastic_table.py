# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What docs/method.md quotes of the records of elastic_ratio.py: ratios to an elastic solve, growth, two ranks."""

from __future__ import annotations

import numpy as np
from quotes import exponent, measured, ratio, table

TITLES = [
    "unknowns", "ranks", "elastic: iterations, s", "case", "cycles: first step", "first unloading", "worst", "mean",
    "seconds: first step, with set-up", "first unloading", "worst other", "mean, with set-up", "bytes per unknown",
]  # fmt: skip
FLAT = ", flat elements"  # at the plane, see element_height.py
BEYOND = 500_000  # unknowns; case C with equally high elements is harder from there on
# Libraries in the records that set up a hierarchy for the springs, too.
TWICE = {"f8083f5", "7c640d6", "4e5ac98"}
UNLOADING, CYCLE = 5, 15  # the first step of unloading, and the steps of a cycle


def numbers(record: dict) -> dict:
    """Cycles and seconds of the steps, and what an elastic solve of the same run takes."""
    elastic = record["elastic"]
    iterations = elastic[0]["iterations"]
    solve = float(np.median([t for run in elastic for t in run["seconds"]]))
    seconds = np.array([step["seconds"] for step in record["steps"]])
    cycles = np.array([step["iterations"] for step in record["steps"]]) / iterations
    return dict(record, iterations=iterations, solve=solve, cycles=cycles, times=seconds / solve, seconds=seconds,
        whole=len(cycles) == CYCLE, set_up=float(np.median([run["setup"] for run in elastic])) / solve)  # fmt: skip


def case(run: dict) -> str:
    return run["case"] + FLAT * bool(run.get("lowest"))


def row(record: dict) -> list[str]:
    """Ratios to the elastic solve; means are over a whole cycle, or left out."""
    of = numbers(record)
    cycles, times = of["cycles"], of["times"]
    turn = [f"{x[UNLOADING]:.2f}" if len(x) > UNLOADING else "–" for x in (cycles, times)]
    mean = [f"{x.mean():.2f}" if of["whole"] else "–" for x in (cycles, times)]
    failed = " not converged" * ("failed" in record["steps"][-1])
    return [
        f"{of['unknowns']:,}", of["ranks"], f"{of['iterations']}, {of['solve']:.2g}", case(of),
        f"{cycles[0]:.2f}", turn[0], f"{cycles.max():.2f}{failed}", mean[0],
        f"{times[0]:.1f}", turn[1], f"{times[1:].max(initial=0.0):.2f}", mean[1], f"{of['bytes_per_unknown']:.0f}",
    ]  # fmt: skip


def claims(records: list[dict]) -> dict[str, str]:
    """Table and numbers by key; but for the table and ``ranks``, of runs on one rank beyond 30,000 unknowns."""
    runs = [numbers(record) for record in records]
    beyond = [run for run in runs if run["unknowns"] > 30_000 and run["ranks"] == 1]
    large = [run for run in beyond if not run.get("lowest")]
    flat = [run for run in beyond if run.get("lowest") and run["whole"]]
    whole = [run for run in large if run["whole"]]
    set_up = {n: np.median([run["set_up"] for run in large if run["unknowns"] == n])
        for n in dict.fromkeys(run["unknowns"] for run in large)}  # fmt: skip
    return {
        "table": table(TITLES, map(row, records)),
        "when": measured(records),
        **worst([run for run in whole if run["case"] != "C"], ""),
        **worst([run for run in whole if run["case"] == "C" and run["unknowns"] < BEYOND], "C-"),
        "flat": "; ".join(
            f"{run['unknowns']:,} unknowns ({run['lowest']:g} mm) worst {run['times'][1:].max():.2f}, mean {run['times'].mean():.2f}"
            for run in flat
        ),
        "first-step": between(run["times"][0] for run in beyond if run["commit"] not in TWICE),
        "first-step-twice": between(run["times"][0] for run in beyond if run["commit"] in TWICE),
        "set-up": ", ".join(f"{ratio(value)} at {unknowns:,}" for unknowns, value in set_up.items()),
        "exponents": "; ".join(exponents(whole + flat)),
        "ranks": ". ".join(by_ranks(runs)),
        "ranks-cycles": "; ".join(counts(runs)),
        "bandwidth": bandwidth(*(run["bandwidth"] for run in list(pairs(runs))[-1])),
    }  # fmt: skip


def air(records: list[dict]) -> dict[str, str]:
    """Of ``elastic_ratio.py --air``: the steps in which contact opens and closes, in elastic solves."""
    phases = {
        "first step": [0], "first unloading": [UNLOADING], "to 0.002 mm, worst": range(UNLOADING + 1, CYCLE),
        "into the air": [CYCLE], "closing again": [CYCLE + 1], "second unloading": [-1],
    }  # fmt: skip
    lines = []
    for run in map(numbers, records):
        cells = [f"{run['cycles'][of].max():.2f}, {run['times'][of].max():.2f}" for of in phases.values()]  # fmt: skip
        lines.append([f"{run['unknowns']:,}", case(run), *cells])
    return {"table": table(["unknowns", "case", *phases], lines), "when": measured(records)}


def between(values) -> str:
    values = list(values)
    return f"{min(values):.1f} to {max(values):.1f}"


def worst(whole: list[dict], name: str) -> dict[str, str]:
    """The worst step but the first, and the worst mean with set-up, of whole cycles."""
    return {
        f"{name}worst-seconds": f"{max(run['times'][1:].max() for run in whole):.2f}",
        f"{name}worst-cycles": f"{max(run['cycles'][1:].max() for run in whole):.2f}",
        f"{name}worst-mean": f"{max(run['times'].mean() for run in whole):.2f}",
    }


def exponents(runs: list[dict]):
    """Growth of the cost of a cycle with the unknowns, in brackets of an elastic solve, from each size to the next.

    Of libraries that do the same at the set-up.
    """
    sizes = sorted({run["unknowns"] for run in runs})

    def like(run):
        return case(run), run["commit"] in TWICE

    for few, many in zip(sizes, sizes[1:]):
        found = []
        for small, large in ((a, b) for a in runs for b in runs if like(a) == like(b)):
            if (small["unknowns"], large["unknowns"]) == (few, many):
                power, elastic = (
                    exponent([(few, cost(small)), (many, cost(large))])
                    for cost in (lambda run: run["seconds"].sum(), lambda run: run["solve"])
                )
                found.append(f"{case(small)} {power:.2f} ({elastic:.2f})")
        if found:
            yield f"from {few:,} to {many:,} unknowns {', '.join(found)}"


def pairs(runs: list[dict]):
    """Runs on two ranks, each behind the same run on one."""
    for two in (run for run in runs if run["ranks"] == 2):
        same = [run for run in runs if run["ranks"] == 1 and all(run.get(key) == two.get(key) for key in ("case", "unknowns", "lowest"))]  # fmt: skip
        yield from ((one, two) for one in same)


def named(run: dict) -> str:
    return f"{run['unknowns']:,} unknowns, case {case(run)}"


def by_ranks(runs: list[dict]):
    """What two ranks gain."""
    what = {
        "elastic solve": lambda run: run["solve"],
        "first step with set-up": lambda run: run["seconds"][0],
        "a cycle of the first unloading": lambda run: run["seconds"][UNLOADING] / run["steps"][UNLOADING]["iterations"],
    }  # fmt: skip
    for pair in pairs(runs):
        gains = []
        for name, seconds in what.items():
            one, two = map(seconds, pair)
            gains.append(f"{name} {one:.3g} s to {two:.3g} s, {ratio(one / two)} times as fast")
        yield f"{named(pair[1])}: {'; '.join(gains)}"


def counts(runs: list[dict]):
    """Iterations of all steps that took any, on one rank and on two, and whether they are within a quarter."""
    for pair in pairs(runs):
        found = [[step["iterations"] for step in run["steps"]] for run in pair]
        found = [both for both in zip(*found) if max(both) > 0]
        apart = sum(abs(one - two) > 0.25 * one for one, two in found)
        listed = ", ".join(f"{one}/{two}" for one, two in found)
        yield f"{named(pair[1])}: {listed}, further apart than a quarter in {apart or 'none'} of them"


def bandwidth(one: float, two: float) -> str:
    """Bytes per second of one rank and of two."""
    return f"{one / 1e9:.1f} GB/s on one rank and {two / 1e9:.1f} on two, {ratio(two / one)} times as many"
