# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The steps of the punch's first cycles: what CondensedNewton takes within them, and Siconos for the same condensed problems.

    python -m benchmarks.peers.siconos_steps FILE

Ours starts as in any run, from states that the problem keeps: the last ones, extrapolated, and those of the cycle before.
Siconos (NSN_AC) starts from the solution of the step before, as the comparison in ``compare.py`` lets both do.  Processor
seconds of one thread; errors of both from ``W``, ``q`` and the reactions alone (mechanics/judge.py).
"""

import json
import sys
from functools import partial
from pathlib import Path

import numpy as np

import dolfinx_contact as dc
from benchmarks.measurement import commit, now, timed
from benchmarks.peers import by_siconos
from benchmarks.peers.compare import by_system
from mechanics import judge
from studies.punch import CASES, Parameters, Punch, programme

TOL = 1e-10
CYCLES = dict(A=2, B=2, C=1)  # Siconos had not ended the second one of C after five minutes


class Watched(dc.CondensedNewton):
    """Keeps the processor seconds of every solve, of all solvers: one is made anew from another's options."""

    seconds: list[float] = []

    def search(self, *arguments, **options):
        seconds, found = timed(partial(super().search, *arguments, **options))
        self.seconds.append(seconds)
        return found


def main(file: Path) -> None:
    problems, ours = dict(tol=TOL), {}
    for case, law in CASES.items():
        Watched.seconds.clear()
        solver = Watched()
        punch = Punch(Parameters(case=case, cycles=CYCLES[case], tol=10 * TOL), solver=solver)
        for displacement in programme(punch.parameters):
            punch.press(displacement)
        bound = punch.problem.bound()
        q, r, _ = zip(*bound.past)
        assert len(q) == len(solver.seconds), "a step was solved twice, or its state is not kept"
        q, r = (np.reshape(part, (len(part), -1, 3)) for part in (q, r))
        problems |= {f"{case}q": q, f"{case}r": r, f"{case}law": np.array([law["mu"], law["p"]])}
        problems.setdefault("W", bound.compliance())
        ours[case] = np.array(solver.seconds)
    found, rows = by_system(by_siconos.__file__, problems), []
    for case in CASES:
        q, law, theirs = problems[f"{case}q"], problems[f"{case}law"], found[f"{case}seconds"]
        errors = [
            max(judge.condensed(problems["W"], a, *law, b, 10 * TOL).error for a, b in zip(q, r))
            for r in (problems[f"{case}r"], found[f"{case}reaction"])
        ]
        rows.append(dict(
            case=case, steps=len(q), ours=float(ours[case].mean()), theirs=float(theirs.mean()), error=errors[0], their_error=errors[1],
            ratio=float(theirs.mean() / ours[case].mean()), median_ratio=float(np.median(theirs) / np.median(ours[case])),
            converged=int(found[f"{case}converged"].sum()),
        ))  # fmt: skip
        print(rows[-1], flush=True)
    file.write_text(json.dumps(dict(commit=commit(), date=now(), rows=rows), indent=1) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
