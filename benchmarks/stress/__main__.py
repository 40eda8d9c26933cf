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
from pathlib import Path

from benchmarks.measurement import commit, now
from benchmarks.stress import matrix
from benchmarks.stress.matrix import SOLVERS, pairs
from benchmarks.stress.picture import draw, summary
from benchmarks.stress.rigs import corner_scenes, rig_scenes
from benchmarks.stress.scenes import scenes, small
from benchmarks.stress.two_bodies import pair_scenes

SHOWN = ("outcome", "solver", "group", "name", "said", "error", "slip_error", "reactions")


def main(argv=None) -> list[dict]:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("results/stress"))
    parser.add_argument("--every", type=int, default=1, help="run every n-th scene only")
    parser.add_argument(
        "--group", default="", help="scenes of groups with names that begin so only"
    )
    parser.add_argument("--solver", choices=SOLVERS, help="this solver only")
    parser.add_argument("--small", action="store_true", help="the same scenes on small bodies")
    options = parser.parse_args(argv)
    options.output.mkdir(parents=True, exist_ok=True)
    name = "stress-small" if options.small else "stress"
    log = options.output / f"{name}.jsonl"
    records = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    done = {(r["group"], r["name"], r["solver"]) for r in records}
    every = scenes() + rig_scenes() + corner_scenes() + pair_scenes()
    chosen = [s for s in every if s.group.startswith(options.group)][:: options.every]
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
            record = dict(solver=solver, measured=measured) | matrix.run(scene, SOLVERS[solver]())
            records.append(record)
            print(json.dumps(record), file=file, flush=True)
            said = f"{k}/{len(todo)} {record['outcome']:8} {record['seconds']:6.2f} s"
            print(f"{said}  {scene.group}: {scene.name} ({solver})", flush=True)
    (options.output / f"{name}.json").write_text(json.dumps(records, indent=1))
    with (options.output / f"{name}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, dict.fromkeys(key for record in records for key in record))
        writer.writeheader()
        writer.writerows(records)
    draw(records).savefig(options.output / f"{name}.png", dpi=150)
    print(summary(records))
    for record in records:
        if record["outcome"] != "solved":
            print(*(record.get(key, "") for key in SHOWN))
    return records


if __name__ == "__main__":
    main()
