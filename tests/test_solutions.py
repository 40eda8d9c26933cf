"""Programs of the documentation that compare solvers (benchmarks/agreement.py, benchmarks/solutions.py)."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("gmsh")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "benchmarks"))
import agreement
import scenes

pytestmark = pytest.mark.skipif(scenes.COMM.size > 1, reason="programs for one rank")


@pytest.mark.parametrize("case", "ABC")
def test_fixed_point_agrees_with_newton(case):
    """Totals and every node's reactions over a cycle of the coarse punch, both preconditioners, to 1e-8."""
    for nodal, totals in agreement.differences(case, tol=1e-11, refine=-1).values():
        assert 0 < nodal <= 1e-8 and totals <= 1e-8
