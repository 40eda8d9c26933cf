# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What a contact step costs relative to one linear elastic solve of the same mesh.

The punch with ``FixedPoint()``: every iteration is one residual, one return map and one multigrid
cycle, and from the twentieth on one solve of the layers next to the plane.  The yardstick is
conjugate gradients with the same preconditioner on the same body, from zero to 1e-10, in the same
run; it is solved before and after the steps.  Seconds are processor seconds of the slowest rank.
Runs under mpirun.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "demos"))
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from mpi4py import MPI
from punch import CASES, Parameters, Punch, programme

from dolfinx_contact.linear_solver import MULTIGRID, LinearSolver


def elastic_solve(body, b, repeat: int, clock=process_time) -> dict:
    """Iterations and seconds of K u = b by conjugate gradients with multigrid, to 1e-10 from zero."""
    options = MULTIGRID | {"ksp_rtol": 1e-10}
    start = clock()
    solver = LinearSolver(body.K, options, "yardstick_", body._rigid_modes)
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


def measure(case: str, refine: int, steps: int | None, cycles: int, repeat: int, **mesh) -> dict:
    comm = MPI.COMM_WORLD
    before = peak_memory(comm)
    punch = Punch(Parameters(case=case, cycles=cycles, refine=refine), **mesh)
    punch.problem.solver = dc.FixedPoint()
    body = punch.problem.body
    body._options = MULTIGRID
    displacements = programme(punch.parameters)[:steps]
    punch.approach.value = -displacements[0]
    body.refresh()
    b, _ = body.load()
    yardsticks = [elastic_solve(body, b, repeat)]
    unknowns = punch.head()["unknowns"]
    if comm.rank == 0:
        print(
            f"case {case}, {unknowns} unknowns, {comm.size} rank(s): elastic solve "
            f"{yardsticks[0]['iterations']} iterations, {np.median(yardsticks[0]['seconds']):.3g} s",
            flush=True,
        )
    records = []
    for displacement in displacements:
        start = process_time()
        try:
            record = punch.press(displacement)
        except dc.NotConverged as failure:
            record = dict(displacement=displacement, failed=str(failure),
                          iterations=failure.step.iterations)  # fmt: skip
        record["seconds"] = comm.allreduce(process_time() - start, op=MPI.MAX)
        records.append(record)
        ratio = record["iterations"] / yardsticks[0]["iterations"]
        ratio_s = record["seconds"] / np.median(yardsticks[0]["seconds"])
        statuses = "{open} open, {stick} stick, {slip} slip, {error:.1e}"
        outcome = record.get("failed") or statuses.format(**record)
        if comm.rank == 0:
            print(
                f"  {displacement:.4f} mm  {record['iterations']:5d} cycles ({ratio:.2f})  {record['seconds']:8.2f} s "
                f"({ratio_s:.2f})  {outcome}",
                flush=True,
            )
        if "failed" in record:
            break
    yardsticks.append(elastic_solve(body, b, repeat))
    peak = peak_memory(comm)
    return dict(
        case=case, refine=refine, unknowns=unknowns, ranks=comm.size, elastic=yardsticks,
        steps=records, bytes_per_unknown=(peak - before) / unknowns,
    )  # fmt: skip


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", default="A,B,C,frictionless")
    parser.add_argument("--refine", type=int, nargs="*", default=[0, 1])
    parser.add_argument("--steps", type=int, help="only the first ones")
    parser.add_argument("--cycles", type=int, default=1)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", type=Path)
    parser.add_argument(
        "--divisions", type=int, default=8, help="of a block's side; half as many layers"
    )
    options = parser.parse_args(argv)
    CASES["frictionless"] = dict(mu=0.0)
    mesh = dict(divisions=options.divisions, layers=options.divisions // 2)
    results = []
    for refine in options.refine:
        for case in options.cases.split(","):
            results.append(
                measure(case, refine, options.steps, options.cycles, options.repeat, **mesh)
            )
            if options.json and MPI.COMM_WORLD.rank == 0:
                options.json.write_text(json.dumps(results, indent=1) + "\n")
    if MPI.COMM_WORLD.rank == 0:
        # Here, because records of the report are kept as long as what they were measured with is the same.
        from elastic_table import TITLES, row
        from quotes import table

        print(table(TITLES, map(row, results)))


if __name__ == "__main__":
    main()
