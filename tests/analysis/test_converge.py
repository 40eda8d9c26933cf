# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Refining until a number is accurate: sequences of known order, then the force of Hertz's ball against its closed form."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import pytest
from demo_hertz import FORCE, A
from helpers import rounded_body
from test_estimate import ball


@pytest.mark.parametrize("order", [1, 1.5, 2, 3])
@pytest.mark.parametrize("accuracy", [0.1, 0.01, 1e-3])
def test_sequences_of_known_order(order, accuracy):
    """Errors of any order between 1 and 3 in the mesh and 1 or 2 in the increments: the answer is as accurate as asked for."""
    for in_parts in (1, 2):
        found = dc.converge(
            lambda n, parts, q=in_parts: 1.0 + n**-order + 0.1 * parts**-q,
            accuracy,
            [2**k for k in range(14)],
            halvings=12,
        )
        assert found.reached and found.error <= accuracy
        assert abs(found.value - 1.0) <= (1 + 1e-9) * found.error * found.value
        assert found.error == found.mesh_error + found.increment_error


def test_no_history():
    """Without halvings every mesh is computed once, with whole increments; what does not suffice says so."""
    found = dc.converge(lambda n, parts: 1.0 + 1 / n, 1e-3, [2, 4, 8])
    assert not found.reached and list(found.tried) == [(2, 1), (4, 1), (8, 1)]
    assert found.value == 1.125 and found.increment_error == 0
    assert found.mesh_error == pytest.approx(0.125 / 1.125)
    with pytest.warns(UserWarning, match="no error is seen"):
        exact = dc.converge(lambda n, parts: 2.0, 1e-3, "abc", halvings=1)
    assert exact.reached and exact.error == 0 and len(exact.tried) == 3


def test_what_cannot_be_meant():
    """Accuracy, meshes and values are checked."""
    with pytest.raises(ValueError, match="accuracy must be a positive"):
        dc.converge(lambda n, parts: 1.0, 0.0, [1, 2])
    with pytest.raises(ValueError, match="at least two"):
        dc.converge(lambda n, parts: 1.0, 0.1, [1])
    with pytest.raises(ValueError, match=r"other than zero, got .* for \(1, 1\)"):
        dc.converge(lambda n, parts: 0.0, 0.1, [1, 2])


@pytest.mark.parametrize("accuracy", [0.03, 0.01])
def test_the_force_of_hertz(accuracy):
    """The loop stops where the force is as accurate as asked for, and not more than eight times better: one mesh earlier it was not."""

    def force(cells, parts):
        scene = rounded_body(1000.0, A, 16 * A, cells, half=True, order=2)
        with ball(*scene, 1) as problem:
            problem.solve()
            return problem.contacts[0].force()[1]

    found = dc.converge(force, accuracy, [4, 8, 16, 32, 64])
    error = abs(found.value - FORCE) / FORCE
    assert found.reached and accuracy / 8 < error < 2 * accuracy
    assert 0.5 < found.error / error < 3
