# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Whole cycles of the punch: iterations and processor seconds of every step, and the first step that is refused.

Pressed and raised, and where ``--again`` pressed once more, tol 1e-10, by the default solver. A measurement of a step or two does not see
a solver that stalls later in the cycle.
"""

from __future__ import annotations

import argparse
from itertools import product

from benchmarks.measurement import timed
from benchmarks.scaling.elastic_ratio import step_to
from benchmarks.tables import table
from studies.punch import Parameters, Punch, programme

MESHES = {35_451: (16, 8), 114_231: (24, 12), 264_435: (32, 16)}  # divisions, layers
TITLES = ["unknowns", "case", "increments", "iterations, all", "iterations of each step", "s, all", "s of each step"]  # fmt: skip


def cycle(case: str, unknowns: int, loading: int, unloading: int, again: bool) -> list[dict]:
    """A record of each step, with its seconds; of a refused one, the last, what it says."""
    parameters = Parameters(case=case, loading=loading, unloading=unloading, cycles=1 + again)
    punch = Punch(parameters, **dict(zip(("divisions", "layers"), MESHES[unknowns], strict=True)))
    steps = []
    for displacement in programme(parameters)[: loading + unloading + again * loading]:
        seconds, step = timed(step_to, punch, displacement)
        steps.append(step | dict(seconds=seconds))
        if "failed" in step:
            break
    return steps


def line(case: str, unknowns: int, increments: tuple[int, int], steps: list[dict]) -> list[str]:
    """A row of the table."""
    iterations, seconds = ([step[key] for step in steps] for key in ("iterations", "seconds"))
    failed = f" REFUSED: {steps[-1]['failed']}" if "failed" in steps[-1] else ""
    return [
        f"{unknowns:,}", case, f"{increments[0]} + {increments[1]}", str(sum(iterations)),
        ", ".join(map(str, iterations)) + failed, f"{sum(seconds):.0f}", ", ".join(f"{s:.1f}" for s in seconds),
    ]  # fmt: skip


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", default="A,B,C")
    parser.add_argument("--unknowns", type=int, nargs="*", choices=MESHES, default=[*MESHES])
    parser.add_argument(
        "--increments", nargs="*", default=["5+10", "1+3"], help="loading+unloading"
    )
    parser.add_argument("--again", action="store_true", help="loaded again after the cycle")
    options = parser.parse_args(argv)
    rows = []
    for unknowns, case, both in product(
        options.unknowns, options.cases.split(","), options.increments
    ):
        increments = tuple(map(int, both.split("+")))
        rows.append(
            line(case, unknowns, increments, cycle(case, unknowns, *increments, options.again))
        )
        print(" | ".join(rows[-1]), flush=True)
    print(table(TITLES, rows))


if __name__ == "__main__":
    main()
