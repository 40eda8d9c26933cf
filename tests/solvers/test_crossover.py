# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The default solver is the cheaper one, as far as that was measured; the default linear solver knows the dimension."""

import json
from pathlib import Path

import pytest
import scenes
from petsc4py import PETSc

from dolfinx_contact.petsc.linear_solver import preconditioner
from dolfinx_contact.solvers.automatic import most_nodes

ROWS = json.loads(
    (Path(__file__).parents[2] / "notes/records/crossover-2026-11-24.json").read_text()
)


@pytest.mark.parametrize("row", ROWS, ids=lambda r: f"{r['body']}-{r['friction']}-{r['nodes']}")
def test_the_rule_takes_the_cheaper_solver(row):
    """Of every measured body, thin or thick, with friction or without, the solver that the numbers of
    contact nodes and unknowns choose took no more than a tenth longer than the other one."""
    condensed = row["nodes"] <= most_nodes(row["unknowns"], row["friction"])
    chosen, other = ("condensed", "fixed_point") if condensed else ("fixed_point", "condensed")
    assert row[chosen] <= 1.1 * row[other]


@pytest.mark.parametrize("cells, kind", [((2, 2), "lu"), ((2, 2, 2), "gamg")])
def test_a_plane_body_is_factorised_where_a_solid_one_has_multigrid(cells, kind):
    """Of 60,000 unknowns and the block size that the stiffness of such a body has, which is its dimension."""
    problem = scenes.block(cells=cells, mu=0.3, p=None).problem
    problem.body.refresh()
    A = PETSc.Mat().create()
    A.setSizes((60_000, 60_000))
    A.setBlockSize(problem.body.K.getBlockSize())
    assert preconditioner(A, None, "of_dimension_") == kind
