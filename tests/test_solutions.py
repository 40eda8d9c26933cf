"""Programs of the documentation that compare solvers and variants of them (benchmarks/variants.py and what it runs)."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gmsh")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "benchmarks"))
import agreement
import hard_step
import scenes
import solutions

import dolfinx_contact as dc

pytestmark = pytest.mark.skipif(scenes.COMM.size > 1, reason="programs for one rank")


@pytest.mark.parametrize("case", "ABC")
def test_fixed_point_agrees_with_newton(case):
    """Totals and every node's reactions over a cycle of the coarse punch, both preconditioners, to 1e-8."""
    for nodal, totals in agreement.differences(case, tol=1e-11, refine=-1).values():
        assert 0 < nodal <= 1e-8 and totals <= 1e-8


def test_a_step_with_several_solutions():
    """Under a crossed rule the block's first reversal has several solutions, far apart, each
    with errors below 1e-8 by a judge that shares nothing with the solver."""
    scene = scenes.block(mu=(1.0, 0.1), p=(0.01, 1.0), solver=dc.CondensedNewton())
    problem, contact = scene.problem, scene.contact
    for x, y in ((0.004, 0.002), (-0.004, 0.002)):
        scene.move_top(x, y, -0.01)
        problem.solve()
    W = problem._condensed.compliance()
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


def test_a_variant_is_another_method_for_as_long_as_it_runs(tmp_path):
    """Without its tangent, with Newton's method at once, and with another smoother, the fixed point comes to the same forces
    another way; after that it is what it was."""
    step, usual = hard_step.HardStep(tmp_path / "loaded.npz", refine=-1), hard_step.AS_IT_IS
    smoother = hard_step.Variant("smoother", options={"mg_levels_ksp_max_it": 3})
    variants = [usual, usual.without_tangent(), hard_step.NEWTON[-1], smoother, usual]
    first, without, *others, last = [step.row(variant) for variant in variants]
    for other in (without, *others):
        assert other["solved"] and other["error"] != first["error"]
        assert other["tangential"] == pytest.approx(first["tangential"], rel=1e-8)
    assert without["iterations"] > first["iterations"] == last["iterations"]
    assert last["error"] == first["error"]
