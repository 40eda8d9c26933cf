# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Programs of the punch that take long, on tiny meshes: they start, and their numbers are those of other programs."""

import csv
import json

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import pytest

pytest.importorskip("gmsh")
from mpi4py import MPI

from studies.punch import Parameters, Punch, effectivity, fine, programme
from studies.punch.limits import Run, build, cycle, uniform

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="programs that one rank runs")


@pytest.mark.slow
def test_six_cycles(monkeypatch, tmp_path):
    """A row for each cycle of each case; the work of the first is that of the program of one cycle, shares of area are shares."""
    tiny = uniform(2, order=1)
    monkeypatch.setattr(fine, "MESHES", {"tiny": (tiny, (1,))})
    fine.main(tmp_path / "table.csv")
    rows = list(csv.DictReader((tmp_path / "table.csv").read_text().splitlines()))
    assert [(row["case"], int(row["cycle"])) for row in rows] == [
        (case, k) for case in "ABC" for k in range(1, 7)
    ]
    assert all(
        0 <= float(row[f"sticking_{end}"]) <= 1 for row in rows for end in ("loaded", "unloaded")
    )
    punch, set_up = build(tiny)
    for case, row in zip("ABC", rows[::6]):
        run = Run(**{**vars(tiny), "case": case})
        assert float(row["work"]) == pytest.approx(cycle(punch, run, set_up).dissipation, rel=1e-6)


@pytest.mark.slow
def test_effectivity_of_the_punch(monkeypatch, tmp_path):
    """A record for each case; a graded reference estimates work and shear of coarse cells from half to three times the true ones."""
    for name, value in dict(MESHES=((2, 1),), FINE=(2, 4), GRADED=2).items():
        monkeypatch.setattr(effectivity, name, value)
    effectivity.main(tmp_path / "record.jsonl")
    records = [json.loads(line) for line in (tmp_path / "record.jsonl").read_text().splitlines()]
    assert [record["scene"] for record in records] == ["punch, A", "punch, B", "punch, C"]
    for record in records:
        rows = record["states"]["unloaded, graded cells"]
        assert (
            0.5 < rows["dissipation"]["effectivity"] < 3 and 0.5 < rows["shear"]["effectivity"] < 3
        )


class Counted:
    """A law that counts how often it is called."""

    def __init__(self, law, calls: list):
        self._law, self._calls = law, calls

    def __getattr__(self, name):
        def called(*arguments):
            self._calls.append(name)
            return getattr(self._law, name)(*arguments)

        return called


def test_the_fixed_point_asks_the_law_once_an_iteration(monkeypatch):
    """On the punch, case C, an iteration calls the kernel's laws 1.3 times, and a step eight times beside that, at most."""
    calls: list = []
    law = dc.Friction.law
    monkeypatch.setattr(dc.Friction, "law", lambda self, dim: Counted(law(self, dim), calls))
    punch = Punch(Parameters(case="C", tol=1e-8), solver=dc.FixedPoint())
    steps = []
    for displacement in programme(punch.parameters):
        punch.approach.value = -displacement
        steps.append(punch.problem.solve())
    iterations = sum(step.iterations for step in steps)
    assert iterations <= len(calls) <= 1.3 * iterations + 8 * len(steps), (len(calls), iterations)
