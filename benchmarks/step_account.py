# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the study's 270 steps cost at least: operations counted, their rates measured here, beside the time they take.

    python -m benchmarks.step_account [--output results/step_account.json]

Every iterate's contacts say how many unknowns its Newton system has, the smaller of both eliminations.  Factors are
counted only where the numbers of open, sticking and slipping contacts differ from those of the iterate before: factors
serve no other states, so at least so many are made.  An iterate is two products with W or its inverse.  Rates are those of
SciPy's LAPACK and BLAS: sgetrf, since factors are in single precision, and dsymv, which reads a triangle as the kernel does.
Back-solves with K and assemblies of F are those of the steps.  Processor seconds of one thread.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path
from time import process_time

import numpy as np
from scipy.linalg import blas, lapack

import dolfinx_contact as dc
from benchmarks.measurement import commit, now
from dolfinx_contact.bodies.elastic import ElasticBody
from studies.punch import CASES, Parameters, Punch, programme

PARTS = {"search": dc.CondensedNewton, "solve": ElasticBody, "residual": ElasticBody}
OWN = {name: getattr(owner, name) for name, owner in PARTS.items()}


def unknowns(counts) -> int:
    """Of Newton's system with so many contacts open, sticking and slipping: open or sticking ones are eliminated."""
    opened, sticking, slipping = counts
    return 3 * min(opened, sticking) + 2 * slipping


def run(case: str, monitor=None) -> dict:
    """Seconds of all steps, of the first one, which makes W, and seconds and calls of the parts of all others."""
    seconds, calls, steps = Counter(), Counter(), []

    def watched(name):
        def method(*arguments, **options):
            if name == "search" and monitor is not None:
                arguments = (*arguments[:-1], monitor)
            start = process_time()
            found = OWN[name](*arguments, **options)
            seconds[name] += process_time() - start
            calls[name] += 1
            return found

        return method

    punch = Punch(Parameters(case=case, cycles=6), solver=dc.CondensedNewton())
    try:
        for name, owner in PARTS.items():
            setattr(owner, name, watched(name))
        for displacement in programme(punch.parameters):
            punch.approach.value = -displacement
            start = process_time()
            punch.problem.solve()
            steps.append(process_time() - start)
            if len(steps) == 1:
                seconds.clear(), calls.clear()
    finally:
        for name, owner in PARTS.items():
            setattr(owner, name, OWN[name])
    return dict(
        case=case, steps=len(steps), all=sum(steps), first=steps[0], seconds=dict(seconds),
        calls=dict(calls), size=3 * len(punch.contact.nodes),
    )  # fmt: skip


def counted(case: str) -> tuple[int, list[int]]:
    """Iterates of all steps, and the unknowns of the systems that need factors of their own."""
    seen: list[tuple] = []
    run(case, lambda residual, counts: seen.append(tuple(counts)))
    changed = [b for a, b in zip([None, *seen], seen) if a != b]
    return len(seen), [unknowns(counts) for counts in changed]


def rate(work, operations: float) -> float:
    """Operations a processor second; the best of nine."""
    best = np.inf
    for _ in range(9):
        start = process_time()
        work()
        best = min(best, process_time() - start)
    return operations / best


def account(case: str) -> dict:
    """The floor of each part of the steps after the first one, and its time."""
    found, (iterates, systems) = run(case), counted(case)
    size, typical = found["size"], int(np.median([m for m in systems if m] or [1]))
    rng = np.random.default_rng(0)
    A = np.asfortranarray(
        rng.normal(size=(typical, typical)) + typical * np.eye(typical), np.float32
    )
    W, x = np.asfortranarray(rng.normal(size=(size, size))), rng.normal(size=size)
    factors = rate(lambda: lapack.sgetrf(A), 2 / 3 * typical**3)
    products = rate(lambda: blas.dsymv(1.0, W, x), 2.0 * size**2)
    flops = sum(2 / 3 * m**3 for m in systems)
    floor = dict(factors=flops / factors, products=2 * iterates * 2.0 * size**2 / products)
    floor |= {name: found["seconds"][name] for name in ("solve", "residual")}
    return found | dict(
        iterates=iterates, factorisations=len(systems), typical=typical, gflop=flops / 1e9,
        gflops_factors=factors / 1e9, gflops_products=products / 1e9, floor=floor,
        share=sum(floor.values()) / (found["all"] - found["first"]),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("results/step_account.json"))
    options = parser.parse_args()
    rows = [account(case) for case in CASES]
    options.output.parent.mkdir(parents=True, exist_ok=True)
    record = dict(commit=commit(), date=now(), rows=rows)
    options.output.write_text(json.dumps(record, indent=1) + "\n")
    for row in rows:
        print(row)
    later = sum(row["all"] - row["first"] for row in rows)
    floor = sum(sum(row["floor"].values()) for row in rows)
    print(f"steps after the first ones {later:.2f} s, floor {floor:.2f} s, "
          f"first ones {sum(row['first'] for row in rows):.2f} s")  # fmt: skip


if __name__ == "__main__":
    main()
