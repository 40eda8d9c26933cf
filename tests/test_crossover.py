# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The default solver is the cheaper one, as far as that was measured."""

import json
from pathlib import Path

import pytest

from dolfinx_contact.solvers.automatic import CROSSOVER, WITHOUT_FRICTION

ROWS = json.loads(
    (Path(__file__).parents[1] / "notes/records/crossover-2026-11-23.json").read_text()
)


@pytest.mark.parametrize("row", ROWS, ids=lambda r: f"{r['body']}-{r['friction']}-{r['nodes']}")
def test_the_rule_takes_the_cheaper_solver(row):
    """Of every measured body, thin or thick, with friction or without, the solver that the number of
    contact nodes chooses took no more than a tenth longer than the other one."""
    condensed = row["nodes"] <= (CROSSOVER if row["friction"] else WITHOUT_FRICTION)
    chosen, other = ("condensed", "fixed_point") if condensed else ("fixed_point", "condensed")
    assert row[chosen] <= 1.1 * row[other]
