# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Both solvers come to the same answer where there is one, and a step with several solutions has several."""

import numpy as np
import pytest

pytest.importorskip("gmsh")
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import scenes

from benchmarks import solutions
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS, MULTIGRID_OPTIONS
from studies.punch import Parameters, Punch, programme

pytestmark = pytest.mark.skipif(scenes.COMM.size > 1, reason="programs for one rank")


def results(punch, displacement) -> tuple[np.ndarray, np.ndarray]:
    """Nodal reactions, and total force with the sum of tangential norms, after a step."""
    punch.press(displacement)
    r = punch.contact.reaction
    return r, np.append(r.sum(axis=0), np.linalg.norm(r[:, :2], axis=1).sum())


@pytest.mark.parametrize("case", "ABC")
def test_fixed_point_agrees_with_newton(case):
    """Totals and every node's reactions over a cycle of the coarse punch, by Newton's method and by the
    fixed point with either preconditioner, each with its own history, are the same to 1e-8 of the largest."""
    parameters = Parameters(case=case, refine=-1, tol=1e-11)
    newton = Punch(parameters, solver=dc.CondensedNewton())
    others = [Punch(parameters, solver=dc.FixedPoint()) for _ in range(2)]
    for punch, options in zip(others, (DIRECT_OPTIONS, MULTIGRID_OPTIONS)):
        punch.problem.body.options = options
    largest = np.zeros(2)
    for displacement in programme(parameters):
        expected = results(newton, displacement)
        largest = np.maximum(largest, [np.abs(part).max() for part in expected])
        for punch in others:
            found = results(punch, displacement)
            apart = np.array([np.abs(a - b).max() for a, b in zip(found, expected)])
            assert (apart > 0).any() and (apart <= 1e-8 * largest).all()


def test_a_step_with_several_solutions():
    """Under a crossed rule the block's first reversal has several solutions, far apart, each
    with errors below 1e-8 by a judge that shares nothing with the solver."""
    scene = scenes.block(mu=(1.0, 0.1), p=(0.01, 1.0), solver=dc.CondensedNewton())
    problem, contact = scene.problem, scene.contact
    for x, y in ((0.004, 0.002), (-0.004, 0.002)):
        scene.move_top(x, y, -0.01)
        problem.solve()
    W = problem.bound().compliance()
    w = np.column_stack((contact.slip_increment, contact.gap))
    q = w - (W @ contact.reaction.ravel()).reshape(w.shape)
    found = solutions.solutions(W, q, contact.friction, contact.reaction, starts=20, seed=1)
    assert len(found) >= 2
    for reaction, _, errors in found:
        assert max(errors) <= 1e-8
        equal = [
            np.abs(reaction - other).max() < 1e-2 * np.abs(reaction).max() for other, *_ in found
        ]
        assert sum(equal) == 1
