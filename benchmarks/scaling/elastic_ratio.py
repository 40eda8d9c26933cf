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
import resource
from pathlib import Path
from time import perf_counter, process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from mpi4py import MPI

from benchmarks.measurement import commit, now
from benchmarks.tables import table
from dolfinx_contact.petsc.linear_solver import MULTIGRID, LinearSolver
from studies.punch import CASES, Parameters, Punch, programme

TITLES = [
    "unknowns", "ranks", "elastic: iterations, s", "case", "cycles: first step", "first unloading", "worst", "mean",
    "seconds: first step, with set-up", "first unloading", "worst other", "mean, with set-up", "bytes per unknown",
]  # fmt: skip
UNLOADING, CYCLE = 5, 15  # the first step of unloading, and the steps of a cycle


def elastic_solve(body, b, repeat: int, clock=process_time) -> dict:
    """Iterations and seconds of K u = b by conjugate gradients with multigrid, to 1e-10 from zero."""
    options = MULTIGRID | {"ksp_rtol": 1e-10}
    start = clock()
    solver = LinearSolver(body.K, options, "yardstick_", body.rigid_modes)
    setup = clock() - start
    seconds = []
    for _ in range(repeat):
        body.comm.Barrier()
        start = clock()
        solver.solve(b)
        seconds.append(body.comm.allreduce(clock() - start, op=MPI.MAX))
    iterations = solver.ksp.getIterationNumber()
    solver.destroy()
    return dict(iterations=iterations, seconds=seconds, setup=setup)


def peak_memory(comm) -> int:
    """Bytes, all ranks."""
    return comm.allreduce(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)


def bandwidth(comm, repeat: int = 5) -> float:
    """Bytes per second of a + b -> c, all ranks at a time: what products with large matrices are bound by."""
    a, b, c = (np.ones(20_000_000) for _ in range(3))
    seconds = []
    for _ in range(repeat):
        comm.Barrier()
        start = perf_counter()
        np.add(a, b, out=c)
        seconds.append(comm.allreduce(perf_counter() - start, op=MPI.MAX))
    return comm.size * 3 * c.nbytes / min(seconds)


def measure(
    case: str, refine: int, lowest, steps: int | None, air: bool, repeat: int, kept, **mesh
) -> dict:
    """Ratios of one run; ``kept(record)`` is called after every step, so that a run that is killed leaves them."""
    comm = MPI.COMM_WORLD
    before = peak_memory(comm)
    punch = Punch(Parameters(case=case, refine=refine, lowest=lowest), **mesh)
    punch.problem.solver = dc.FixedPoint()
    body = punch.problem.body
    body.options = MULTIGRID
    displacements = (into_the_air() if air else programme(punch.parameters))[:steps]
    punch.approach.value = -displacements[0]
    body.refresh()
    b, _ = body.load()
    record = dict(
        case=case, unknowns=punch.head()["unknowns"], ranks=comm.size, commit=commit(), date=now(),
        load=[os.getloadavg()[0]], elastic=[elastic_solve(body, b, repeat)], steps=[],
        lowest=lowest,
    )  # fmt: skip
    iterations, solve = record["elastic"][0]["iterations"], np.median(record["elastic"][0]["seconds"])  # fmt: skip
    if comm.rank == 0:
        print(
            f"case {case}, {record['unknowns']} unknowns, {comm.size} rank(s): elastic solve "
            f"{iterations} iterations, {solve:.3g} s",
            flush=True,
        )
    for displacement in displacements:
        start = process_time()
        try:
            of = punch.press(displacement)
            of = {key: of[key] for key in ("open", "stick", "slip", "error", "iterations", "tangential_reaction_sum")}  # fmt: skip
        except dc.NotConverged as failure:
            of = dict(failed=str(failure), iterations=failure.step.iterations)
        of["seconds"] = comm.allreduce(process_time() - start, op=MPI.MAX)
        record["steps"].append(of)
        record["bytes_per_unknown"] = (peak_memory(comm) - before) / record["unknowns"]
        kept(record)
        outcome = of.get("failed") or "{open} open, {stick} stick, {slip} slip, {error:.1e}".format(**of)  # fmt: skip
        if comm.rank == 0:
            print(
                f"  {displacement:.4f} mm  {of['iterations']:5d} cycles ({of['iterations'] / iterations:.2f})  "
                f"{of['seconds']:8.2f} s ({of['seconds'] / solve:.2f})  {outcome}",
                flush=True,
            )
        if "failed" in of:
            break
    record["elastic"].append(elastic_solve(body, b, repeat))
    record["bandwidth"] = bandwidth(comm)
    record["load"].append(os.getloadavg()[0])
    kept(record)
    return record


def into_the_air() -> list[float]:
    """Pressed, raised nearly to where contact ends, into the air, pressed again, and the first step up."""
    steps = programme(Parameters(cycles=2, unload_to=0.002))
    return steps[:15] + [-0.01] + steps[15:21]


def keep(file: Path, record: dict) -> None:
    """Write a record to the file, a line each, in place of the one of the same case, mesh and ranks."""

    def which(of):
        return of["ranks"], of["unknowns"], of["case"], of.get("lowest") or 0.0

    records = {which(of): of for of in (json.loads(file.read_text()) if file.exists() else [])}
    records[which(record)] = record
    lines = (json.dumps(records[key], separators=(",", ":")) for key in sorted(records))
    file.write_text("[" + ",\n".join(lines) + "]\n")


def numbers(record: dict) -> dict:
    """Cycles and seconds of the steps, and what an elastic solve of the same run takes."""
    elastic = record["elastic"]
    iterations = elastic[0]["iterations"]
    solve = float(np.median([t for run in elastic for t in run["seconds"]]))
    seconds = np.array([step["seconds"] for step in record["steps"]])
    cycles = np.array([step["iterations"] for step in record["steps"]]) / iterations
    return dict(record, iterations=iterations, solve=solve, cycles=cycles, times=seconds / solve, seconds=seconds,
        whole=len(cycles) == CYCLE, set_up=float(np.median([run["setup"] for run in elastic])) / solve)  # fmt: skip


def row(record: dict) -> list[str]:
    """Ratios to the elastic solve; means are over a whole cycle, or left out."""
    of = numbers(record)
    cycles, times = of["cycles"], of["times"]
    turn = [f"{x[UNLOADING]:.2f}" if len(x) > UNLOADING else "–" for x in (cycles, times)]
    mean = [f"{x.mean():.2f}" if of["whole"] else "–" for x in (cycles, times)]
    failed = " not converged" * ("failed" in record["steps"][-1])
    return [
        f"{of['unknowns']:,}", of["ranks"], f"{of['iterations']}, {of['solve']:.2g}", of["case"] + ", flat elements" * bool(of.get("lowest")),
        f"{cycles[0]:.2f}", turn[0], f"{cycles.max():.2f}{failed}", mean[0],
        f"{times[0]:.1f}", turn[1], f"{times[1:].max(initial=0.0):.2f}", mean[1], f"{of['bytes_per_unknown']:.0f}",
    ]  # fmt: skip


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", default="A,B,C,frictionless")
    parser.add_argument("--refine", type=int, nargs="*", default=[0, 1])
    parser.add_argument("--steps", type=int, help="only the first ones")
    parser.add_argument("--air", action="store_true", help="the contact opens and closes again; into a file of its own")  # fmt: skip
    parser.add_argument("--repeat", type=int, default=3, help="elastic solves, before and after the steps")  # fmt: skip
    parser.add_argument(
        "--json",
        type=Path,
        help="where records go, each in place of its predecessor; the table is of all in it",
    )
    parser.add_argument(
        "--divisions", type=int, default=8, help="of a block's side; half as many layers"
    )
    parser.add_argument("--lowest", type=float, help="height of the elements on the plane, mm; else all are equal")  # fmt: skip
    options = parser.parse_args(argv)
    CASES["frictionless"] = dict(mu=0.0)
    mesh = dict(divisions=options.divisions, layers=options.divisions // 2)
    writes = options.json and MPI.COMM_WORLD.rank == 0
    results = []
    for refine in options.refine:
        for case in options.cases.split(","):
            results.append(
                measure(
                    case, refine, options.lowest, options.steps, options.air, options.repeat,
                    lambda record: writes and keep(options.json, record), **mesh,
                )
            )  # fmt: skip
    if MPI.COMM_WORLD.rank == 0:
        print(
            table(
                TITLES, map(row, json.loads(options.json.read_text()) if options.json else results)
            )
        )


if __name__ == "__main__":
    main()
