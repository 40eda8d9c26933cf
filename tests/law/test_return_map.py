# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The return map: projection of the tangential reaction in the metric of the slip rule.

That it is the one of its definition, and has the law as its fixed points, is tested in test_bipotential.py.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dolfinx_contact.law.friction import Friction

EPS = np.finfo(float).eps
coefficients = st.floats(1e-3, 1e3)
pairs = st.tuples(coefficients, coefficients)
vectors = st.tuples(st.floats(-1, 1), st.floats(-1, 1)).map(
    lambda v: np.where(np.abs(v) < 1e-60, 0.0, v)
)


def returned(friction, tau, R):
    """Results for trial reactions (tau, R) where nothing moves."""
    r = np.column_stack([tau, np.full(len(tau), R)])
    zero, one = np.zeros(len(r)), np.ones(len(r))
    return friction.law(3).return_map(r, zero, np.zeros((len(r), 2)), one, one)


@given(vectors, vectors, pairs, pairs, st.floats(1e-3, 1e3))
def test_projection_in_the_metric_of_the_slip_rule(a, b, mu, p, R):
    """Admissible, repeated without effect, and non-expansive in the metric P M^-1: hence continuous
    across the branches."""
    friction = Friction(mu, p)
    r, _ = returned(friction, np.array([a, b]), R)
    assert np.all(np.linalg.norm(r[:, :2] / mu, axis=1) <= R * (1 + 4 * EPS))
    assert np.all(r[:, 2] == R)
    weight = np.array(p) / max(p) / mu
    size = np.linalg.norm(weight * a) + np.linalg.norm(weight * b)
    again, _ = returned(friction, r[:, :2], R)
    assert np.linalg.norm(weight * (again - r)[:, :2]) <= 16 * EPS * size
    change = np.linalg.norm(weight * (r[0] - r[1])[:2])
    assert change <= np.linalg.norm(weight * (a - b)) + 16 * EPS * size


@pytest.mark.parametrize("mu, p", [((0.3, 0.15), (0.05, 0.2)), ((0.2, 0.2), (1e-3, 1.0))])
def test_change_is_along_the_slip_rule(mu, p):
    """On the boundary the trial reaction is brought back against P^-2 r_t, whatever the scale of p."""
    rng = np.random.default_rng(1)
    tau = rng.normal(size=(200, 2))
    r, branch = returned(Friction(mu, p), tau, 0.7)
    slips = branch == 2
    assert slips.sum() > 100
    back, along = (tau - r[:, :2])[slips], (r[:, :2] / np.square(p))[slips]
    cross = back[:, 0] * along[:, 1] - back[:, 1] * along[:, 0]
    assert np.abs(cross).max() <= 1e-12 * np.abs(along).max()
    assert np.all(np.sum(back * along, axis=1) >= 0)
    for scale in (1e-9, 1e9):
        scaled, _ = returned(Friction(mu, np.multiply(p, scale)), tau, 0.7)
        assert np.abs(scaled - r).max() <= 1e-13


def test_normal_part():
    """R = max(0, r_n - rho_n x_n), with its own metric; open nodes have no tangential reaction."""
    law = Friction((0.3, 0.15), (0.05, 0.2)).law(3)
    r = np.array([[0.1, 0, 1.0], [0.1, 0, 1], [0.1, 0, 1], [0, 0, 0]])
    gap, slip = np.array([0.1, 0.5, 1.0, -0.25]), np.zeros((4, 2))
    found, branch = law.return_map(r, gap, slip, np.full(4, 2.0), np.full(4, 9.0))
    assert found[:, 2] == pytest.approx([0.8, 0, 0, 0.5])
    assert np.array_equal(branch, [1, 0, 0, 1]) and np.all(found[1:3] == 0)
