# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Run scenes, and write what they give to record.json, to which test_golden.py compares:

    export PYTHONPATH=.:tests/support OMP_NUM_THREADS=1
    python tests/golden/record.py [SCENE ...]
    mpiexec -n 2 python tests/golden/record.py [SCENE ...]

Only where behaviour is meant to change, with the names of the scenes that are meant to; without names, all are made anew. The
message of the commit says why they change. The first line writes all but the iteration counts on two ranks, which differ where
solvers go from node to node in the order of the ranks; the second line adds these.
"""

import json
import sys
import warnings
from pathlib import Path
from typing import NamedTuple

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import dolfinx
import numpy as np
from golden_scenes import COMM, SCENES

RECORD = Path(__file__).with_name("record.json")
DEFAULT = dict(tol=1e-8, geometry_tol=1e-3)
FORCE, SUM = 1e-8, 1e-6  # to which forces, and work and worn volume, are compared
DIGITS = 1e-3  # of these, to which they are written


class Row(NamedTuple):
    """What a step leaves, sums over nodes and ranks.

    Attributes:
        forces: Of each contact its resultant, and the sum of the lengths of its nodes' reactions.
        moved: Displacement and rotation of surfaces that force drives.
        work: Frictional work so far.
        worn: Volume that each side of the contacts has lost so far.
        counts: Nodes open, sticking, slipping.
        iterations: Of the solver; None if the step is refused.
        solver: That found the step; None if it is refused.
    """

    forces: list
    moved: list
    work: float
    worn: list
    counts: list
    iterations: int | None
    solver: str | None


def cases():
    """Scenes and the solvers that they run with, None the default one."""
    return [(name, solver) for name, scene in SCENES.items() for solver in (None, *scene.solvers)]


def title(name, solver) -> str:
    return name if solver is None else f"{name}, {solver}"


def rows(name, solver, tight) -> list[Row]:
    """All steps of a scene.  Collective."""
    scene = SCENES[name]
    options = dict(scene.tight if tight else DEFAULT)
    options["solver"] = None if solver is None else getattr(dc, solver)()
    found = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of strains, rounding, nodes that are left out
        for problem in scene.steps(**options):
            try:
                step = problem.solve()
            except dc.NotConverged:
                step = None
            found.append(row(problem.contacts, step))
    return found


def row(contacts, step) -> Row:
    """What the contacts have after a step, None if it was refused.  Collective."""
    forces, moved, counts, sums = [], [], np.zeros(3, dtype=int), np.zeros(3)
    for contact in contacts:
        lengths = float(np.linalg.norm(contact.reaction, axis=1).sum())
        forces += [*contact.force().tolist(), COMM.allreduce(lengths)]
        if contact.surface.free:
            moved += [*contact.surface.displacement.tolist(), *contact.surface.rotation.tolist()]
        counts += np.bincount(COMM.allreduce(contact.status.tolist()), minlength=3)
        sums += [COMM.allreduce(float(contact.dissipation.sum())), *contact.worn_volume()]
    solver, iterations = (str(step.solver), step.iterations) if step else (None, None)
    return Row(forces, moved, float(sums[0]), sums[1:].tolist(), counts.tolist(), iterations, solver)  # fmt: skip


def parts(steps, field) -> np.ndarray:
    """A field of all steps, ``shape=(steps, numbers)``."""
    return np.array([getattr(step, field) for step in steps], dtype=float).reshape(len(steps), -1)


COMPARED = dict(forces=FORCE, moved=FORCE, work=SUM, worn=SUM)  # of the largest number of the run


def rounded(values, tolerance) -> list:
    """Numbers to the digits that are compared, and one or two more."""
    largest = np.abs(values).max(initial=0.0)
    digits = 0 if largest == 0.0 else int(np.ceil(-np.log10(largest * tolerance * DIGITS)))
    return [[round(value, digits) + 0.0 for value in step] for step in values.tolist()]


def recorded(name, solver) -> dict:
    """What is written of a case on one rank.  Collective."""
    tight, usual = (rows(name, solver, kind) for kind in (True, False))
    fields = {field: rounded(parts(tight, field), tol) for field, tol in COMPARED.items()}
    fields = {field: values for field, values in fields.items() if np.any(values)}
    return fields | dict(steps=[[*step.counts, step.iterations, step.solver] for step in usual])


def on_two_ranks(case, name, solver) -> dict:
    """The same with the iteration counts of two ranks, if they are others.  Collective."""
    found = [step.iterations for step in rows(name, solver, False)]
    case.pop("two", None)
    return case if found == [step[3] for step in case["steps"]] else case | dict(two=found)


def write(record) -> None:
    """One line per field of a case."""
    lines = []
    for case in sorted(record["cases"]):
        fields = [f"  {json.dumps(f)}: {json.dumps(v, separators=(',', ':'))}" for f, v in record["cases"][case].items()]  # fmt: skip
        lines.append(f"{json.dumps(case)}: {{\n" + ",\n".join(fields) + "}")
    release = f'"release": {json.dumps(record["release"])}'
    RECORD.write_text(f'{{{release}, "cases": {{\n' + ",\n".join(lines) + "\n}}\n")


def main(names) -> None:
    anew = not names and COMM.size == 1
    record = {"cases": {}} if anew else json.loads(RECORD.read_text())
    record["release"] = dolfinx.__version__
    for name, solver in cases():
        if names and name not in names:
            continue
        case = title(name, solver)
        if COMM.rank == 0:
            print(case, flush=True)
        record["cases"][case] = recorded(name, solver) if COMM.size == 1 else on_two_ranks(record["cases"][case], name, solver)  # fmt: skip
    if COMM.rank == 0:
        write(record)


if __name__ == "__main__":
    main(sys.argv[1:])
