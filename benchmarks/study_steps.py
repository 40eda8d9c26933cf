# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The study's 270 steps, cases A, B and C on the paper's mesh: where their time goes, beside another clone's.

    python -m benchmarks.study_steps [--beside DIRECTORY] [--repetitions 3]

Processor seconds of one thread, CondensedNewton, ``problem.solve`` alone.  DIRECTORY is a clone with its own .venv;
both run in turn, in processes of their own.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import process_time

import numpy as np

import dolfinx_contact as dc
from benchmarks.measurement import ROOT, run_alone
from studies.punch import CASES, Parameters, Punch, programme

PARTS = ("steps", "first", "kernel", "iterations")
SEARCH = (
    "search" if hasattr(dc.CondensedNewton, "search") else "solve_condensed"
)  # an older clone's


def study() -> dict:
    """Seconds of all steps, of the first ones (which make W), and of the kernel; its iterations; by case."""
    spent, own = [], getattr(dc.CondensedNewton, SEARCH)

    def watched(self, *arguments, **options):
        start = process_time()
        found = own(self, *arguments, **options)
        result = found[0] if isinstance(found, tuple) else found
        spent.append((process_time() - start, result.iterations))
        return found

    setattr(dc.CondensedNewton, SEARCH, watched)
    answer = {}
    for case in CASES:
        punch, steps = Punch(Parameters(case=case, cycles=6), solver=dc.CondensedNewton()), []
        spent.clear()
        for displacement in programme(punch.parameters):
            punch.approach.value = -displacement
            start = process_time()
            punch.problem.solve()
            steps.append(process_time() - start)
        kernel, iterations = np.sum(spent, axis=0)
        answer[case] = dict(zip(PARTS, (sum(steps), steps[0], kernel, int(iterations))))
        answer[case]["force"] = punch.contact.force().tolist()
    return answer


def measured(clone: Path) -> dict:
    """``study`` in a clone: this program, that package."""
    program = f"import runpy; runpy.run_path({__file__!r}, run_name='__main__')"
    found = run_alone([clone / ".venv/bin/python", "-c", program, "--alone"], cwd=clone)
    if found.returncode:
        raise RuntimeError(found.stderr[-500:])
    return json.loads(found.stdout.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--beside", type=Path)
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--alone", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.alone:
        print(json.dumps(study()))
        return
    clones = [ROOT] + [options.beside] * (options.beside is not None)
    runs = [[measured(clone.resolve()) for clone in clones] for _ in range(options.repetitions)]
    for k, clone in enumerate(clones):
        for part in PARTS:
            by_case = {case: [run[k][case][part] for run in runs] for case in CASES}
            median = {case: float(np.median(values)) for case, values in by_case.items()}
            total = [sum(values) for values in zip(*by_case.values())]
            print(clone.name, part, {case: round(v, 3) for case, v in median.items()},
                  "all:", *(f"{value:.3f}" for value in total))  # fmt: skip


if __name__ == "__main__":
    main()
