# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What a load step costs whose plane force drives, over the same step with the plane's displacement given.

    python -m benchmarks.force_steps [--refine 1] [--solver FixedPoint] [--output results/force_steps.json]

The punch's cycle twice in one run, the top held and the plane moved: by the displacement, and by the forces that
this took. Both have the same reactions, or an assertion fails. Processor seconds of one thread.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import process_time

import numpy as np

import dolfinx_contact as dc
from benchmarks.measurement import commit, now
from studies.punch import CASES, Parameters, Punch, programme


def cycle(parameters: Parameters, solver: str, values, free=()) -> tuple[list, list, list]:
    """Seconds, reactions and normal forces of the steps in which the plane has each displacement, or each force if ``free``."""
    punch = Punch(parameters, solver=getattr(dc, solver)())
    plane, contact = punch.contact.surface, punch.contact
    plane.free = free
    seconds, reactions, forces = [], [], []
    for value in values:
        setattr(plane, "force" if free else "displacement", (0.0, 0.0, value))
        start = process_time()
        punch.problem.solve()
        seconds.append(process_time() - start)
        reactions.append(contact.reaction.copy())
        forces.append(contact.force()[2])
    return seconds, reactions, forces


def compare(case: str, solver: str, refine: int) -> dict:
    """Both cycles of a case: seconds of the first step and of all others."""
    parameters = Parameters(case=case, refine=refine)
    given, expected, forces = cycle(parameters, solver, programme(parameters))
    driven, found, _ = cycle(parameters, solver, forces, ("n",))
    apart = max(np.abs(r - s).max() / np.abs(s).max() for r, s in zip(found, expected))
    assert apart < 1e-6, f"other reactions: {apart:.1e} apart"
    rows = {"displacement": given, "force": driven}
    return dict(case=case, apart=apart, ratio=sum(driven[1:]) / sum(given[1:])) | {
        name: dict(first=seconds[0], others=sum(seconds[1:])) for name, seconds in rows.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--solver", default="CondensedNewton", choices=("CondensedNewton", "FixedPoint")
    )
    parser.add_argument("--refine", type=int, default=0)
    parser.add_argument("--output", type=Path)
    options = parser.parse_args()
    rows = [compare(case, options.solver, options.refine) for case in CASES]
    for row in rows:
        print(
            f"case {row['case']}: a step by force costs {row['ratio']:.2f} of one by displacement, reactions {row['apart']:.0e} apart"
        )
    if options.output:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        found = dict(
            commit=commit(), date=now(), solver=options.solver, refine=options.refine, rows=rows
        )
        options.output.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
