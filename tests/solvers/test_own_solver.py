# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The solver of docs/own_solver.md: nothing in the package has to change for it."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
import scenes

import dolfinx_contact as dc

PAGE = (Path(__file__).parents[2] / "docs" / "own_solver.md").read_text()


def damped(**options):
    """The class of the page, which ends where its scene begins."""
    code = re.search(r"```python\n(.*?)\ncube = ", PAGE, re.DOTALL).group(1)
    names: dict = {}
    exec(compile(code, "own_solver.md", "exec"), names)
    return names["Damped"](**options)


@pytest.mark.parametrize("case", [dict(mu=0.2, p=None), dict(mu=(0.3, 0.15), p=None)])
def test_it_solves_the_coarse_punch(case):
    """Pressed, dragged and raised, its reactions are those of the library's own solver."""
    own, other = (scenes.block(solver=solver, tol=1e-9, **case) for solver in (damped(), None))
    for top in ((0, 0, -0.005), (0.001, 0.0005, -0.01), (0.002, -0.001, -0.006)):
        for scene in (own, other):
            scene.move_top(*top)
            scene.problem.solve()
        found, expected = own.contact.reaction, other.contact.reaction
        bound = 1e-7 * other.problem.body.largest(np.abs(expected))
        assert np.abs(found - expected).max(initial=0.0) <= bound


def test_what_it_does_not_solve_is_not_taken_for_a_solution():
    """Stopped early, the step raises with the errors that the problem measured."""
    scene = scenes.block(solver=damped(most=3))
    scene.move_top(0, 0, -0.005)
    with pytest.raises(dc.NotConverged, match="after 2 iterations") as caught:
        scene.problem.solve()
    assert caught.value.step.error > scene.problem.tol


def test_it_is_short():
    """The page keeps its word: some 40 lines."""
    code = re.search(r"```python\n(.*?)\ncube = ", PAGE, re.DOTALL).group(1)
    assert len([line for line in code.splitlines() if line.strip()]) <= 45
    assert sys.modules["dolfinx_contact"] is dc
