# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Time per load step of both solvers on the paper's punch, and how it grows with the contact.

    python benchmarks/solvers.py --parts laws --json docs/solvers.json     # one part anew, the others stay

Processor seconds of this process (one thread), because other programs may share the machine; all
rows of a part come from one run.  Set-up is measured apart: one factorisation of K, and the condensed
operator with its inverse.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "demos"))
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from punch import CASES, Parameters, Punch, programme
from report_run import Memory, commit, machine, now
from solvers_operator import assembly, first_steps, operator, shares, timed
from solvers_table import claims

from dolfinx_contact import _kernel
from dolfinx_contact.condensed import CondensedBody, memory

SOLVERS = {"condensed": dc.CondensedNewton, "fixed point": dc.FixedPoint}
LAWS = {
    "frictionless": dict(mu=0.0),
    "isotropic, mu = 0.2": dict(mu=0.2),
    "associated, (0.3, 0.15)": dict(mu=(0.3, 0.15)),
    "case C": CASES["C"],
}


def steps(case: str, solver: str, count: int | None = None, cycles: int = 1, **mesh) -> dict:
    """Set-up and the first ``count`` steps of one case."""
    punch = Punch(Parameters(case=case, cycles=cycles), **mesh)
    problem, body = punch.problem, punch.problem.body
    problem.solver = SOLVERS[solver]()
    body.refresh()
    factor, _ = timed(body.solve, np.zeros(body.size))
    used, operator = Memory(), 0.0
    if solver == "condensed":
        # As the first step does it; thrown away, so that all steps are measured alike.
        operator, _ = timed(CondensedBody, body, problem.contacts)
    done = [
        timed(punch.press, displacement) for displacement in programme(punch.parameters)[:count]
    ]
    times, records = map(list, zip(*done))
    times[0] -= operator  # the operator that the first step made for itself
    nodes = len(punch.contact.nodes)
    return dict(
        case=case, solver=solver, nodes=nodes, unknowns=body.size, factor=factor, operator=operator, times=times,
        iterations=[record["iterations"] for record in records], error=max(record["error"] for record in records),
        totals=[(record["normal_reaction"], record["tangential_reaction_sum"]) for record in records],
        kept=8 * 3 * nodes * (3 * nodes + 1), estimate=memory(nodes, 3, body.size), peak=used.added(),
    )  # fmt: skip


def study() -> list[dict]:
    """Six cycles of each case."""
    return [steps(case, solver, cycles=6) for case in "ABC" for solver in SOLVERS]


def growth(meshes: list) -> list[dict]:
    """Eight steps of case C on ever finer meshes, given by divisions and layers."""
    return [
        steps("C", solver, 8, divisions=divisions, layers=layers)
        for divisions, layers in meshes for solver in SOLVERS
    ]  # fmt: skip


def cycle(meshes: list, case: str = "frictionless", repeat: int = 3) -> list[dict]:
    """One cycle on ever finer meshes, time and again, interleaved."""
    return [
        steps(case, solver, divisions=divisions, layers=layers)
        for _ in range(repeat) for divisions, layers in meshes for solver in SOLVERS
    ]  # fmt: skip


def laws(first: int = 2, last: int = 31) -> list[dict]:
    """Simpler laws on the same W and q, those of case C, each step from zero."""
    punch = Punch(Parameters(case="C", cycles=3))
    solver = punch.problem.solver = dc.CondensedNewton()
    for displacement in programme(punch.parameters)[:last]:
        punch.press(displacement)
    past = [q for q, _ in punch.problem._past][first - 1 : last]
    W = punch.problem._condensed.compliance()
    operators = {3: _kernel.CondensedOperator(W, 3), 1: _kernel.CondensedOperator(W[2::3, 2::3], 1)}
    inverse = {dim: timed(operator.prepare)[0] for dim, operator in operators.items()}
    rows = []
    for name, law in LAWS.items():
        dim = 1 if name == "frictionless" else 3
        done = [
            timed(solver.solve_condensed, operators[dim], dc.Friction(**law), q[:, -dim:], 1e-10)
            for q in past
        ]
        times, found = map(list, zip(*done))
        rows.append(dict(
            law=name, inverse=inverse[dim], times=times, iterations=[of.iterations for of in found], nodes=len(past[0]),
            slipping=float(np.mean([(of.status == dc.Status.SLIP).sum() for of in found])),
        ))  # fmt: skip
    return rows


TWO_LAYERS = [(divisions, 2) for divisions in (4, 8, 12, 16)]
PUNCH = [(divisions, divisions // 2) for divisions in (8, 12, 16)]
FINER = (8, 10, 12, 14, 16)  # divisions
PARTS = {
    "study": study,
    "growth": lambda: growth(TWO_LAYERS),
    "punch": lambda: growth(PUNCH),
    "frictionless": lambda: cycle([(divisions, 2) for divisions in FINER]),
    "frictionless-punch": lambda: cycle([(divisions, divisions // 2) for divisions in FINER]),
    "cycle-C": lambda: cycle([(divisions, 2) for divisions in FINER[:3]], "C"),
    "laws": laws,
    "operator": operator,
    "assembly": assembly,
    "shares": shares,
    "first-steps": lambda: first_steps([16, 20, 24]),
}


def main(argv=None, parts=PARTS, claims=claims, description=__doc__) -> None:
    """Measure parts, and put each into the records as soon as it is there."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawTextHelpFormatter)  # fmt: skip
    parser.add_argument("--parts", nargs="+", choices=parts, default=list(parts))
    parser.add_argument("--json", type=Path, help="records to put the parts into")
    options = parser.parse_args(argv)
    CASES["frictionless"] = LAWS["frictionless"]
    file = options.json
    records = json.loads(file.read_text()) if file and file.exists() else {}
    for part in options.parts:
        load = [os.getloadavg()[0]]
        rows = parts[part]()
        load.append(os.getloadavg()[0])
        records[part] = dict(rows=rows, date=now(), commit=commit(), processor=machine()["processor"], load=load)  # fmt: skip
        for key, text in claims({part: records[part]}).items():
            print(f"{key}: {text}\n", flush=True)
        if file:
            file.write_text(json.dumps(records, indent=1) + "\n")


if __name__ == "__main__":
    main()
