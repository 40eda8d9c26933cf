# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Both solvers on thin and thick bodies, with and without friction: where do they take equally long?

    python -m benchmarks.crossover [--divisions 8 10 12] [--output results/crossover.json]

One cycle of the punch, 5 + 10 steps, processor seconds of one thread with all set-up but the mesh.  Thin bodies have
two layers of elements, thick ones those of the punch.  What is in the record is not measured again.
"""

from __future__ import annotations

import argparse
import json
from itertools import product
from pathlib import Path

import numpy as np

import dolfinx_contact as dc
from benchmarks.measurement import commit, now, timed
from benchmarks.tables import chosen
from studies.punch import Parameters, Punch, programme

SOLVERS = dict(condensed=dc.CondensedNewton, fixed_point=dc.FixedPoint)
KEYS = ("body", "friction", "divisions")


def measure(body: str, friction: bool, divisions: int) -> dict:
    """Seconds of both solvers for one cycle of case C, or of contact without friction."""
    row = dict(body=body, friction=friction, divisions=divisions)
    for name, solver in SOLVERS.items():
        punch = Punch(
            Parameters(case="C", tol=1e-8),
            solver=solver(),
            friction=None if friction else dict(mu=0.0),
            divisions=divisions,
            layers=2 if body == "thin" else divisions // 2,
        )

        def press(punch=punch):
            for displacement in programme(punch.parameters):
                punch.press(displacement)

        row[name] = timed(press)[0]
        row |= dict(nodes=len(punch.contact.nodes), unknowns=punch.problem.body.size)
        punch.problem.close()
    return row | dict(measured=f"{now()[:10]}, {commit()}")


def crossings(rows: list[dict]) -> list[dict]:
    """Nodes cubed over unknowns where both take equally long, interpolated between the two sizes around it.

    A family that ends before its crossing gives the largest value that was measured, as a bound.
    """
    found = []
    for body, friction in product(("thin", "thick"), (True, False)):
        family = [r for r in rows if (r["body"], r["friction"]) == (body, friction)]
        if not family:
            continue
        family.sort(key=lambda r: r["nodes"])
        share = [np.log(r["nodes"] ** 3 / r["unknowns"]) for r in family]
        ratio = [np.log(r["condensed"] / r["fixed_point"]) for r in family]
        over = next((k for k, value in enumerate(ratio) if value > 0), None)
        if over is None:
            at, bound = share[-1], "more than"
        elif over == 0:
            at, bound = share[0], "less than"
        else:
            at, bound = float(np.interp(0.0, ratio[over - 1 : over + 1], share[over - 1 : over + 1])), ""  # fmt: skip
        found.append(dict(body=body, friction=friction, bound=bound, share=float(np.exp(at))))
    return found


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--divisions", type=int, nargs="+", default=[8, 10, 12, 14])
    parser.add_argument("--output", type=Path, default=Path("results/crossover.json"))
    options = parser.parse_args(argv)
    rows = json.loads(options.output.read_text()) if options.output.exists() else []
    options.output.parent.mkdir(parents=True, exist_ok=True)
    for divisions, body, friction in product(options.divisions, ("thin", "thick"), (True, False)):
        if any(tuple(row[key] for key in KEYS) == (body, friction, divisions) for row in rows):
            continue
        rows.append(measure(body, friction, divisions))
        options.output.write_text(json.dumps(rows, indent=1) + "\n")
        print(rows[-1], flush=True)
    for row in rows:
        row["share"] = row["nodes"] ** 3 / row["unknowns"]
    titles = dict(body="body", friction="friction", nodes="contact nodes", unknowns="unknowns",
                  share="nodes^3 / unknowns", condensed="condensed (s)", fixed_point="fixed point (s)")  # fmt: skip
    for table in (chosen(rows, titles), crossings(rows)):
        for row in table:
            print(row)


if __name__ == "__main__":
    main()
