# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Time per load step of both solvers on the paper's punch, and how it grows with the contact.

Processor seconds of this process (one thread), because other programs may share the machine; all
rows of a table come from one run.  Set-up is measured apart: one factorisation of K, the condensed
operator with its inverse, and the factorisation with springs of the fixed point.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "demos"))
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from punch import Parameters, Punch, programme

from dolfinx_contact import _kernel
from dolfinx_contact.condensed import CondensedBody

SOLVERS = {"condensed": dc.CondensedNewton, "fixed point": dc.FixedPoint}


def seconds(action) -> float:
    start = process_time()
    action()
    return process_time() - start


def study(case: str, solver: str, steps: int | None, cycles: int, **mesh) -> dict:
    """Set-up and steps of one case."""
    punch = Punch(Parameters(case=case, cycles=cycles), **mesh)
    problem, body = punch.problem, punch.problem.body
    problem.solver = SOLVERS[solver]()
    displacements = programme(punch.parameters)[:steps]
    body.refresh()
    factor = seconds(lambda: body.solve(np.zeros(body.size)))
    operator = 0.0
    if solver == "condensed":
        # As the first step does it; thrown away, so that all steps are measured alike.
        problem.contacts[0].set_metric(body.K)
        operator = seconds(lambda: CondensedBody(body, problem.contacts))
    times, iterations, errors, totals = [], [], [], []
    for displacement in displacements:
        start = process_time()
        record = punch.press(displacement)
        times.append(process_time() - start)
        iterations.append(record["iterations"])
        errors.append(record["error"])
        totals.append((record["normal_reaction"], record["tangential_reaction_sum"]))
    times[0] -= operator  # the operator that the first step made for itself
    return dict(
        nodes=len(punch.contact.nodes), unknowns=body.size, factor=factor, operator=operator,
        times=np.array(times), iterations=np.array(iterations), error=max(errors),
        totals=np.array(totals),
    )  # fmt: skip


LAWS = {
    "frictionless": dict(mu=0.0),
    "isotropic, mu = 0.2": dict(mu=0.2),
    "associated, (0.3, 0.15)": dict(mu=(0.3, 0.15)),
    "case C": dict(mu=(0.3, 0.15), p=(0.05, 0.20)),
}


def laws(first: int = 2, last: int = 31) -> str:
    """Simpler laws on the same W and q, those of case C, each step from zero."""
    punch = Punch(Parameters(case="C", cycles=3))
    solver = punch.problem.solver = dc.CondensedNewton()
    for displacement in programme(punch.parameters)[:last]:
        punch.press(displacement)
    past = [q for q, _ in punch.problem._past][first - 1 : last]
    W = punch.problem._condensed.compliance()
    operators = {3: _kernel.CondensedOperator(W, 3), 1: _kernel.CondensedOperator(W[2::3, 2::3], 1)}
    lines = ["| law | set-up (ms) | iterations | median (ms) | spread (ms) | ms per iteration |"]
    lines.append("|---" * 6 + "|")
    setup = {dim: 1e3 * seconds(operator.prepare) for dim, operator in operators.items()}
    for name, law in LAWS.items():
        dim = 1 if name == "frictionless" else 3
        times, iterations = [], 0
        for q in past:
            start = process_time()
            found = solver.solve_condensed(operators[dim], dc.Friction(**law), q[:, -dim:], 1e-10)
            times.append(1e3 * (process_time() - start))
            iterations += found.iterations
        lines.append(
            f"| {name} | {setup[dim]:.0f} | {iterations / len(past):.1f} | {np.median(times):.1f} | "
            f"{min(times):.1f} – {max(times):.1f} | {sum(times) / iterations:.1f} |"
        )
    return "\n".join(lines)


def row(label: str, solver: str, result: dict) -> str:
    t = 1e3 * result["times"]
    return (
        f"| {label} | {result['nodes']} | {solver} | {result['factor']:.2f} | {result['operator']:.2f} | "
        f"{result['iterations'].mean():.1f} | {np.median(t):.0f} | {t[1:].min():.0f} – {t[1:].max():.0f} | "
        f"{t[1:].sum() / 1e3:.2f} | {result['error']:.0e} |"
    )


HEAD = (
    "| scene | contact nodes | solver | factor K (s) | W and inverse (s) | iterations a step | median (ms) | "
    "spread (ms) | all but the first (s) | worst error |\n" + "|---" * 10 + "|"
)


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=6)
    parser.add_argument("--cases", default="ABC")
    parser.add_argument("--growth", type=int, nargs="*", default=[4, 8, 12, 16], help="divisions")
    parser.add_argument("--laws", action="store_true", help="simpler laws on the same W and q")
    options = parser.parse_args(argv)
    if options.laws:
        print(laws(), flush=True)
    print(HEAD, flush=True)
    for case in options.cases:
        results = {}
        for solver in SOLVERS:
            results[solver] = study(case, solver, None, options.cycles)
            print(row(f"{case}, {options.cycles} cycles", solver, results[solver]), flush=True)
        newton, fixed = (results[solver]["totals"] for solver in SOLVERS)
        difference = (np.abs(newton - fixed) / np.abs(fixed)).max()
        print(f"Totals of {len(newton)} steps differ by at most {difference:.1e}.\n", flush=True)
    if options.growth:
        print(HEAD, flush=True)
    for divisions in options.growth:
        for solver in SOLVERS:
            result = study("C", solver, 8, 1, divisions=divisions, layers=2)
            print(row("C, 8 steps, 2 layers", solver, result), flush=True)


if __name__ == "__main__":
    main()
