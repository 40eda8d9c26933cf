# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The default solver is the cheaper one, as far as that was measured; the default linear solver knows the dimension."""

import json
from pathlib import Path

import numpy as np
import pytest
import scenes
from petsc4py import PETSc

import dolfinx_contact as dc
from dolfinx_contact import problem_input
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS, preconditioner
from dolfinx_contact.solvers import automatic
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


@pytest.mark.parametrize("most", [2, 400])
def test_many_contact_nodes_have_multigrid_and_factors_for_the_fallback(most, monkeypatch):
    """A solid body with many contact nodes has multigrid by default; if the fixed point fails, factors of its own are
    there for the condensed operator, and the step ends where it ends with factors alone."""
    settings = dict(cells=(8, 8, 4), mu=0.3, p=0.2)
    expected = scenes.block(**settings)
    monkeypatch.setattr(problem_input, "CROWDED_SIZE", 100)
    monkeypatch.setattr(automatic, "most_nodes", lambda unknowns, friction: 50)
    monkeypatch.setattr(automatic, "_fixed_point", lambda: dc.FixedPoint(max_iterations=most))
    many = scenes.block(**settings)
    for scene in (expected, many):
        scene.move_top(0.002, 0.001, -0.005)
    step = many.problem.solve()
    assert not expected.problem.body.multigrid_is_faster and many.problem.body.multigrid_is_faster
    assert many.problem.body.ksp.getPC().getType() == "mg"
    assert step.solver == (
        dc.SolverName.FIXED_POINT if most > 2 else dc.SolverName.CONDENSED_NEWTON
    )
    assert step.error <= 1e-8 and expected.problem.solve().error <= 1e-8
    force, size = expected.contact.force(), np.abs(expected.contact.force()).max()
    np.testing.assert_allclose(many.contact.force(), force, atol=1e-6 * size)
    work = [s.problem.body.total(s.contact.dissipation.sum()) for s in (many, expected)]
    assert work[0] == pytest.approx(work[1], rel=1e-5) and work[1] > 0.0


@pytest.mark.parametrize(
    "options, cells, solver",
    [
        (DIRECT_OPTIONS, (8, 8, 4), None),
        (None, (8, 8), None),
        (None, (8, 8, 4), dc.CondensedNewton()),
    ],
)
def test_what_the_user_chooses_and_plane_bodies_have_factors(options, cells, solver, monkeypatch):
    """However many nodes are in contact: options and solvers of the user go first, a plane body is factorised."""
    monkeypatch.setattr(problem_input, "CROWDED_SIZE", 100)
    monkeypatch.setattr(automatic, "most_nodes", lambda unknowns, friction: 5)
    scene = scenes.block(cells=cells, mu=0.3, p=None, petsc_options=options, solver=solver)
    assert not scene.problem.body.multigrid_is_faster
    scene.move_top(*[0.002, 0.001, -0.005][3 - len(cells) :])
    scene.problem.solve()
    assert scene.problem.body.exact


def test_a_body_without_contacts_is_not_crowded(monkeypatch):
    """Whatever its size: it has the solver that its unknowns ask for."""
    monkeypatch.setattr(problem_input, "CROWDED_SIZE", 100)
    scene = scenes.block(cells=(8, 8, 4))
    problem = dc.ContactProblem(scene.F, scene.u, [], bcs=scene.bcs)
    problem.solve()
    assert problem.body.exact and not problem.body.multigrid_is_faster
