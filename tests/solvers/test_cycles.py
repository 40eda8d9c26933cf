# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Whole cycles of the paper's punch on fine meshes: every step is solved, not only the first ones."""

import pytest
import scenes

from benchmarks.scaling.cycles import cycle

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(scenes.COMM.size > 1, reason="counts of one process"),
]


@pytest.mark.parametrize("increments", [(5, 10), (1, 3)])
@pytest.mark.parametrize("case", ["A", "B", "C"])
def test_every_step_of_a_cycle_is_solved(case, increments):
    """At 35,451 unknowns a cycle and the loading after it reach 1e-10 in every step."""
    steps = cycle(case, 35_451, *increments, again=True)
    assert len(steps) == 2 * increments[0] + increments[1]
    assert [step for step in steps if "failed" in step or step["error"] > 1e-10] == []


def test_a_cycle_at_264435_unknowns_ends():
    """Case C pressed at once and raised in ten steps: one of these steps was refused after 1,000 iterations."""
    steps = cycle("C", 264_435, 1, 10, again=False)
    assert len(steps) == 11 and "failed" not in steps[-1]
