# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Where the error of the punch sits: one cycle on a quarter of it, with one thing changed at a time.

``python -m studies.punch.limits FILE`` makes the runs of ``PLAN`` that the table FILE (CSV) does not have, and appends a row each.
Forces and work are those of the whole punch.  docs/accuracy.md says what follows.
"""

import csv
import sys
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from time import process_time

import dolfinx_contact as dc
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS
from studies.punch.accuracy import mesh_options
from studies.punch.model import Parameters, Punch, programme

# What the runs tend to with mesh and increments, and half of the width that is left: N when loaded; N mm.  Judgements from two
# sequences of meshes, no bounds (notes/2026-11-23-punch-limits.md).
LIMITS = {
    "A": dict(normal=(727.8e3, 0.7e3), tangential=(134.86e3, 0.05e3), dissipation=(395.6, 0.7)),
    "B": dict(normal=(728.2e3, 0.7e3), tangential=(135.2e3, 0.1e3), dissipation=(353.0, 2.0)),
    "C": dict(normal=(723.3e3, 0.6e3), tangential=(124.98e3, 0.05e3), dissipation=(511.7, 2.5)),
}


@dataclass(frozen=True)
class Run:
    """What is changed: cells as in ``punch_mesh``, lengths over block and height (1: uniform), increments over the paper's."""

    case: str = "A"
    order: int = 2
    divisions: int = 4
    layers: int = 8
    rim: float = 1 / 16
    lowest: float = 1 / 64
    factor: float = 1.0


@dataclass(frozen=True)
class Cycle:
    """What is measured, N and N mm: sums of normal and tangential reactions when loaded and at the end; work of friction; processor seconds."""

    unknowns: int
    normal_loaded: float
    tangential_loaded: float
    normal_unloaded: float
    tangential_unloaded: float
    dissipation: float
    peak_pressure: float
    set_up: float
    seconds: float


def graded(divisions: int, **changed) -> Run:
    """The mesh of ``--accuracy``, see ``accuracy.mesh_options``."""
    options = mesh_options(divisions)
    return Run(
        divisions=divisions,
        layers=options["layers"],
        rim=options["rim"],
        lowest=options["layers"] ** -2,
        **changed,
    )


def uniform(divisions: int, **changed) -> Run:
    """Cells as in the paper, refined."""
    return Run(divisions=divisions, layers=divisions // 2, rim=1.0, lowest=1.0, **changed)


def build(run: Run, quarter: bool = True, tol: float = 1e-8) -> tuple[Punch, float]:
    """The punch on a run's mesh, with the compliance of its contact nodes, and the processor seconds that they took.  Collective."""
    begin = process_time()
    start = Parameters()
    height = None if run.lowest == 1 else run.lowest * start.height
    parameters = replace(start, case=run.case, tol=tol, lowest=height)
    mesh = dict(
        divisions=run.divisions,
        layers=run.layers,
        order=run.order,
        rim=None if run.rim == 1 else run.rim,
    )
    punch = Punch(
        parameters,
        solver=dc.CondensedNewton(),
        petsc_options=DIRECT_OPTIONS,
        quarter=quarter,
        **mesh,
    )
    punch.press(start.depth)  # the first step makes it
    return punch, process_time() - begin


def cycle(punch: Punch, run: Run, set_up: float) -> Cycle:
    """One cycle of a run on a punch of its mesh.  Collective."""
    begin = process_time()
    names = ("loading", "unloading")
    punch.restart(
        case=run.case,
        **{name: max(1, round(run.factor * getattr(Parameters, name))) for name in names},
    )
    records, peak, loading = [], 0.0, punch.parameters.loading
    for displacement in programme(punch.parameters):
        records.append(punch.press(displacement))
        if len(records) == loading:
            peak = max(punch.comm.allgather(float(punch.contact.pressure.max(initial=0.0))))
    sums = ("normal_reaction", "tangential_reaction_sum")
    forces = [records[at][name] for at in (loading - 1, -1) for name in sums]
    seconds = process_time() - begin
    return Cycle(punch.problem.body.size, *forces, punch.dissipation(), peak, set_up, seconds)


def plan() -> list[Run]:
    """Each source of error by itself, in A, B, C; the cheap ones first."""
    runs = []
    for case in "ABC":
        of = dict(case=case)
        runs += [graded(n, factor=k, **of) for n in (2, 4, 6, 8) for k in (1, 2, 4, 8, 16)]
        runs += [graded(10, factor=k, **of) for k in (1, 4)]
        runs += [graded(n, order=1, factor=k, **of) for n in (4, 8, 12, 16) for k in (1, 4)]
        runs += [uniform(n, order=1, factor=k, **of) for n in (4, 8, 16) for k in (1, 4)]
        runs += [uniform(n, order=2, factor=k, **of) for n in (2, 4, 8) for k in (1, 4)]
        runs += [
            replace(graded(n, **of), rim=rim, factor=4)
            for n in (4, 6)
            for rim in (1 / 8, 1 / 16, 1 / 36, 1 / 64, 1 / 128)
        ]
        runs += [replace(graded(4, **of), lowest=low, factor=4) for low in (1 / 16, 1 / 256)]
        runs += [replace(graded(4, **of), layers=16, lowest=1 / 64, factor=4)]
    return sorted(
        dict.fromkeys(runs), key=lambda run: (run.order * run.divisions) ** 4 * run.layers
    )


def read(path: Path) -> dict[Run, Cycle]:
    """The table of a file; nothing if there is none."""
    if not path.exists():
        return {}
    with path.open() as file:
        return {made(Run, row): made(Cycle, row) for row in csv.DictReader(file)}


def made(kind, row):
    """A Run or a Cycle of a row of the table."""
    types = {"str": str, "int": int, "float": float}
    return kind(**{of.name: types.get(of.type, of.type)(row[of.name]) for of in fields(kind)})


def main(path: Path) -> None:
    known, punches = read(path), {}
    names = [of.name for kind in (Run, Cycle) for of in fields(kind)]
    for run in plan():
        if run in known:
            continue
        mesh = replace(run, case="A", factor=1.0)
        if mesh not in punches:
            punches = {mesh: build(mesh)}  # one at a time
        row = asdict(run) | asdict(cycle(punches[mesh][0], run, punches[mesh][1]))
        new = not path.exists()
        with path.open("a", newline="") as file:
            table = csv.DictWriter(file, names, lineterminator="\n")
            if new:
                table.writeheader()
            table.writerow(row)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
