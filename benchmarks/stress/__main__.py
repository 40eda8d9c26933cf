# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The stress matrix: every scene times every solver, every answer judged from the mechanics (mechanics/judge.py).

    python -m benchmarks.stress            # make stress

A run that is stopped continues where it was; ``--output`` then holds one line per scene and solver.
At the end: a table, ``stress.json``, ``stress.csv`` and ``stress.png``; ``stress-small`` with ``--small``.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections import Counter
from pathlib import Path

from benchmarks.measurement import commit, now
from benchmarks.stress import matrix
from benchmarks.stress.matrix import SOLVERS, TOL, pairs
from benchmarks.stress.scenes import scenes, small
from benchmarks.tables import table


def summary(records: list[dict]) -> str:
    """Table of outcomes by group and solver."""
    solvers, groups = (dict.fromkeys(r[key] for r in records) for key in ("solver", "group"))
    return table(["scenes", *solvers], [
        [group, *(_outcomes([r for r in records if r["solver"] == s and group in (r["group"], "all")]) for s in solvers)]
        for group in [*groups, "all"]
    ])  # fmt: skip


def _outcomes(records) -> str:
    count = Counter(r["outcome"] for r in records)
    others = "".join(f", {count[o]} {o}" for o in ("rounding", "WRONG") if count[o])
    return f"{count['solved']} / {len(records)}{others}" if records else "–"


def draw(records: list[dict], file: Path) -> None:
    """Judged error against seconds per step, by outcome and solver."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    for marker, solver in zip("os^", SOLVERS):
        of = [r for r in records if r["solver"] == solver and r["steps"]]
        x = [r["seconds"] / r["steps"] for r in of]
        y = [max(r["error"], r["slip_error"], 1e-17) for r in of]
        axes.plot(x, y, marker, ms=4, alpha=0.5, label=solver)
    axes.axhline(TOL, color="0.5", lw=1)
    axes.set(xscale="log", yscale="log", xlabel="seconds per step, with set-up and judge")
    axes.set(ylabel="worst error found by the judge")
    axes.legend()
    figure.savefig(file, dpi=150)
    plt.close(figure)


def main(argv=None) -> list[dict]:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("results/stress"))
    parser.add_argument("--every", type=int, default=1, help="run every n-th scene only")
    parser.add_argument("--first", type=int, default=0, help="start with this scene")
    parser.add_argument("--group", help="scenes of this group only")
    parser.add_argument("--solver", choices=SOLVERS, help="this solver only")
    parser.add_argument("--small", action="store_true", help="the same scenes on small bodies")
    options = parser.parse_args(argv)
    options.output.mkdir(parents=True, exist_ok=True)
    name = "stress-small" if options.small else "stress"
    log = options.output / f"{name}.jsonl"
    records = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    done = {(r["group"], r["name"], r["solver"]) for r in records}
    chosen = [s for s in scenes() if options.group in (None, s.group)]
    chosen = chosen[options.first :: options.every]
    if options.small:
        chosen = list(map(small, chosen))
    todo = [
        (scene, solver)
        for scene, solver in pairs(chosen, [options.solver] if options.solver else SOLVERS)
        if (scene.group, scene.name, solver) not in done
    ]
    measured = f"{now()[:10]}, {commit()}"
    with log.open("a") as file:
        for k, (scene, solver) in enumerate(todo, start=1):
            outcome = matrix.run(scene, SOLVERS[solver]())
            record = dict(group=scene.group, name=scene.name, solver=solver, measured=measured, **outcome)  # fmt: skip
            records.append(record)
            print(json.dumps(record), file=file, flush=True)
            print(
                f"{k}/{len(todo)} {record['outcome']:8} {record['seconds']:6.2f} s  "
                f"{scene.group}: {scene.name} ({solver})",
                flush=True,
            )
    (options.output / f"{name}.json").write_text(json.dumps(records, indent=1))
    with (options.output / f"{name}.csv").open("w", newline="") as file:
        columns = list(dict.fromkeys(key for record in records for key in record))
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(records)
    draw(records, options.output / f"{name}.png")
    print(summary(records))
    for record in records:
        if record["outcome"] != "solved":
            print(record["outcome"], record["solver"], record["group"], record["name"],
                  record.get("said", ""), record["error"], record["slip_error"], record["reactions"])  # fmt: skip
    return records


if __name__ == "__main__":
    main()
