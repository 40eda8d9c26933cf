# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Forces, statuses, iteration counts, frictional work and worn volume of small scenes of every kind are those of the record.

Where one of these tests fails, behaviour has changed. If that is meant, record.py says how the record is made anew.
"""

import json

import dolfinx
import numpy as np
import pytest
from record import COMM, COMPARED, RECORD, SCENES, cases, parts, rows, title

pytestmark = [pytest.mark.ranks, pytest.mark.usefixtures("same_lines")]
GOLDEN = json.loads(RECORD.read_text())
CASES = [pytest.param(*case, id=title(*case)) for case in cases()]


def iterations(case, ranks) -> list:
    """Iteration counts of the steps, None where one is refused."""
    alone = [step[3] for step in case["steps"]]
    return case.get("two", alone) if ranks == 2 else alone


@pytest.mark.parametrize("name, solver", CASES)
def test_forces_work_and_wear_are_those_of_the_record(name, solver):
    """With small tolerances, to 1e-8 of the largest force or displacement of the run, 1e-6 of work and worn volume."""
    found, case = rows(name, solver, tight=True), GOLDEN["cases"][title(name, solver)]
    assert len(found) == len(case["steps"])
    for field, tolerance in COMPARED.items():
        values = parts(found, field)
        expected = np.array(case.get(field, 0 * values))
        apart = np.abs(values - expected).max(initial=0.0)
        assert apart <= tolerance * np.abs(expected).max(initial=0.0), field


@pytest.mark.parametrize("name, solver", CASES)
def test_statuses_and_iteration_counts_are_those_of_the_record(name, solver):
    """With the default tolerances; iterations and solver on the record's release of DOLFINx, on two ranks with one more or less."""
    found, case = rows(name, solver, tight=False), GOLDEN["cases"][title(name, solver)]
    assert [step.counts for step in found] == [step[:3] for step in case["steps"]]
    if dolfinx.__version__ != GOLDEN["release"] or COMM.size > 2:
        return
    assert [step.solver for step in found] == [step[4] for step in case["steps"]]
    pairs = list(zip((step.iterations for step in found), iterations(case, COMM.size)))
    assert all(a == b or abs(a - b) <= COMM.size - 1 for a, b in pairs), pairs


def test_the_record_has_these_scenes_alone():
    """Neither is one missing, nor is one left that is no longer run; and it is small."""
    assert sorted(GOLDEN["cases"]) == sorted(title(*case) for case in cases())
    assert len(SCENES) >= 40
    assert RECORD.stat().st_size < 60e3
