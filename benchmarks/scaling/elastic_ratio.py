# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What a contact step costs relative to one linear elastic solve of the same mesh.

The punch with ``FixedPoint()``: every iteration is one residual, one return map and one multigrid
cycle, and from the twentieth on one solve of the layers next to the plane.  The yardstick is
conjugate gradients with the same preconditioner on the same body, from zero to 1e-10, in the same
run; it is solved before and after the steps.  Seconds are processor seconds of the slowest rank.
Runs under mpirun.  ``--refine --json FILE`` measures nothing and prints the table of a file.
"""

from __future__ import annotations

import argparse
import json
import os
from itertools import product
from pathlib import Path

import numpy as np
from mpi4py import MPI

import dolfinx_contact as dc
from benchmarks.measurement import commit, now, peak_memory, timed
from benchmarks.tables import table
from dolfinx_contact.petsc.linear_solver import MULTIGRID_OPTIONS, LinearSolver
from studies.punch import Parameters, Punch, programme

COMM = MPI.COMM_WORLD
TITLES = [
    "unknowns", "ranks", "elastic: iterations, s", "case", "cycles: first step", "first unloading", "worst", "mean",
    "seconds: first step, with set-up", "first unloading", "worst other", "mean, with set-up", "bytes per unknown",
]  # fmt: skip
UNLOADING, CYCLE = 5, 15  # the first step of unloading, and the steps of a cycle


def elastic_solve(punch, displacement: float, repeat: int) -> dict:
    """Iterations and seconds of K u = b by conjugate gradients with multigrid, to 1e-10 from zero."""
    body, seconds = punch.problem.body, []
    punch.move_top(displacement)
    body.refresh()
    b, _ = body.load()
    solver = LinearSolver(
        body.K, MULTIGRID_OPTIONS | {"ksp_rtol": 1e-10}, "yardstick_", body.rigid_modes
    )
    for _ in range(repeat):
        body.comm.Barrier()
        seconds.append(slowest(timed(solver.solve, b)[0]))
    iterations = solver.ksp.getIterationNumber()
    solver.destroy()
    return dict(iterations=iterations, seconds=seconds)


def slowest(seconds: float) -> float:
    return COMM.allreduce(seconds, op=MPI.MAX)


def step_to(punch, displacement: float) -> dict:
    """What a record has of a step; of one that was refused, what it said."""
    punch.move_top(displacement)
    try:
        step = punch.problem.solve()
    except (dc.NotConverged, MemoryError) as failure:
        iterations = failure.step.iterations if isinstance(failure, dc.NotConverged) else 0
        return dict(failed=f"{type(failure).__name__}: {failure}", iterations=iterations)
    counts = {key: int(count) for key, count in step.counts._asdict().items()}
    return counts | dict(error=step.error, iterations=step.iterations, solver=step.solver)


def measured(punch, displacements, repeat=1, before=None, kept=lambda record: None) -> dict:
    """Steps of the punch, and elastic solves before and after them.

    Args:
        repeat: How many elastic solves, each time.
        before: Bytes that do not count; None: all until the elastic solves, after which the first step assembles anew.
        kept: Called after every step with the record, so that a run that is killed leaves it.
    """
    elastic = [elastic_solve(punch, displacements[0], repeat)]
    record = dict(
        case=punch.parameters.case, unknowns=punch.head()["unknowns"], ranks=COMM.size, commit=commit(), date=now(),
        load=os.getloadavg()[0], elastic=elastic, steps=[], lowest=punch.parameters.lowest,
    )  # fmt: skip
    if before is None:
        punch.problem.body.forget()
        before = peak_memory(anew=True)
    for displacement in displacements:
        seconds, step = timed(step_to, punch, displacement)
        record["steps"].append(step | dict(seconds=slowest(seconds)))
        record["bytes_per_unknown"] = COMM.allreduce(peak_memory() - before) / record["unknowns"]
        kept(record)
        if "failed" in step:
            break
    elastic.append(elastic_solve(punch, displacements[0], repeat))
    kept(record)
    return record


def keep(file: Path, record: dict) -> None:
    """Write a record to the file, a line each, in place of the one of the same case, mesh and ranks."""

    records = [*(json.loads(file.read_text()) if file.exists() else []), record]
    kept = {
        (of["ranks"], of["unknowns"], of["case"], of.get("lowest") or 0.0): of for of in records
    }
    lines = (json.dumps(kept[key], separators=(",", ":")) for key in sorted(kept))
    file.write_text("[" + ",\n".join(lines) + "]\n")


def row(record: dict) -> list[str]:
    """Iterations and seconds over those of the elastic solve; means are over a whole cycle, or left out."""
    elastic, steps = record["elastic"], record["steps"]
    iterations = elastic[0]["iterations"]
    solve = float(np.median([seconds for run in elastic for seconds in run["seconds"]]))
    cycles = np.array([step["iterations"] for step in steps]) / iterations
    times = np.array([step["seconds"] for step in steps]) / solve
    turn = [f"{x[UNLOADING]:.2f}" if len(x) > UNLOADING else "–" for x in (cycles, times)]
    mean = [f"{x.mean():.2f}" if len(x) == CYCLE else "–" for x in (cycles, times)]
    failed = " not converged" * ("failed" in steps[-1])
    return [
        f"{record['unknowns']:,}", record["ranks"], f"{iterations}, {solve:.2g}",
        record["case"] + ", flat elements" * bool(record.get("lowest")),
        f"{cycles[0]:.2f}", turn[0], f"{cycles.max():.2f}{failed}", mean[0],
        f"{times[0]:.1f}", turn[1], f"{times[1:].max(initial=0.0):.2f}", mean[1], f"{record['bytes_per_unknown']:.0f}",
    ]  # fmt: skip


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--cases", default="A,B,C,frictionless")
    add("--refine", type=int, nargs="*", default=[0, 1])
    add("--steps", type=int, help="only the first ones")
    add("--repeat", type=int, default=3, help="elastic solves, before and after the steps")
    add(
        "--json",
        type=Path,
        help="where records go, each in place of its predecessor; the table is of all",
    )
    add("--divisions", type=int, default=8, help="of a block's side; half as many layers")
    add("--lowest", type=float, help="height of the elements on the plane, mm; else all are equal")
    options = parser.parse_args(argv)

    def kept(record):
        if COMM.rank == 0:
            print(
                record["case"], f"{record['unknowns']} unknowns:", record["steps"][-1], flush=True
            )
            if options.json:
                keep(options.json, record)

    results, mesh = [], dict(divisions=options.divisions, layers=options.divisions // 2)
    for refine, case in product(options.refine, options.cases.split(",")):
        before = peak_memory()
        parameters = Parameters(case=case, refine=refine, lowest=options.lowest)
        friction = dict(mu=0.0) if case == "frictionless" else None
        punch = Punch(parameters, solver=dc.FixedPoint(), friction=friction, **mesh)
        punch.problem.body.options = MULTIGRID_OPTIONS
        steps = programme(parameters)[: options.steps]
        results.append(measured(punch, steps, options.repeat, before, kept))
    if options.json:
        results = json.loads(options.json.read_text())
    if COMM.rank == 0:
        print(table(TITLES, map(row, results)))


if __name__ == "__main__":
    main()
