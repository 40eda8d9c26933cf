# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The elliptic friction cone: its load function, and the Euclidean projection to the last digits."""

import mpmath as mp
import numpy as np
import pytest
from defined_maps import project
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI

from dolfinx_contact.law.friction import Friction
from dolfinx_contact.law.friction_cone import load_function, project_cone

EPS = np.finfo(float).eps
UNIT = EPS / 2  # unit of rounding


def lengths(a):
    """Row norms that neither overflow nor underflow."""
    largest = np.abs(a).max(axis=-1, keepdims=True)
    scale = np.where(largest > 0, largest, 1.0)
    return np.linalg.norm(a / scale, axis=-1) * scale[..., 0]


def nasty_points(rng, n, mu):
    """Points anywhere, and on or next to the cone, its polar cone, the apex and the axes."""
    t = rng.normal(size=(n, 2))
    on_axis = rng.random((n, 2)) < 0.2
    t[on_axis] *= np.where(
        rng.random(on_axis.sum()) < 0.3, 0, 10.0 ** rng.uniform(-17, 0, on_axis.sum())
    )
    normal = rng.normal(size=n)
    nearly = 1 + rng.normal(size=n) * 10.0 ** rng.uniform(-17, -1, n)
    kind = rng.integers(5, size=n)
    normal = np.select(
        [kind == 0, kind == 1, kind == 2],
        [
            lengths(t / mu) * nearly,
            -lengths(t * mu) * nearly,
            normal * 10.0 ** rng.uniform(-20, 0, n),
        ],
        normal,
    )
    tau = np.column_stack([t, normal])
    tau[:3] = [[0, 0, 0], [0, 0, 1], [0, 0, -1]]
    return tau


def exact_projection(tau, mu):
    """The projection with more than 50 digits, as a list of mpmath numbers.

    Stationarity with a multiplier l of (|M^-1 r_t|^2 - r_n^2) / 2 is r_t = (1 + l M^-2)^-1 tau_t and
    r_n (1 - l) = tau_n. With R = r_n this is a falling function of R; its root is bracketed to 50
    digits before it is believed.
    """
    tau, mu = [mp.mpf(x) for x in tau], [mp.mpf(m) for m in mu]
    size = mp.sqrt(sum(x * x for x in tau))
    if mp.sqrt(sum((m * x) ** 2 for m, x in zip(mu, tau))) <= -tau[2]:
        return [mp.mpf(0)] * 3
    if mp.sqrt(sum((x / m) ** 2 for m, x in zip(mu, tau))) <= tau[2]:
        return tau
    t, n = [x / size for x in tau[:2]], tau[2] / size

    def point(above):  # R = max(n, 0) + above
        R = max(n, 0) + above
        return [x * m * m * R / (m * m * R + R - n) for m, x in zip(mu, t)] + [R]

    def excess(above):
        x, y, R = point(above)
        return mp.sqrt((x / mu[0]) ** 2 + (y / mu[1]) ** 2) / R - 1

    root = mp.mpf(1)  # |r| <= |tau|
    while excess(root) <= 0 and root > mp.mpf(10) ** -54:
        root /= 2
    root = mp.findroot(excess, (root, 2 * root), solver="anderson", tol=1e-110, verify=False)
    width = mp.mpf(10) ** -51
    assert root < width or excess(root - width) > 0 > excess(root + width)
    return [size * x for x in point(root)]


@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="nothing parallel in it, and slow")
@pytest.mark.parametrize("magnitude", [1.0, 1e150, 1e-150])
@pytest.mark.parametrize("ratio", [1.0, 1 + 1e-7, 2.0, 1e4, 1e8])
def test_projection_to_four_units_of_rounding(ratio, magnitude):
    """The projected point is within 4 units of rounding of |tau| of a 50-digit reference: at the
    apex, on the axes, on both boundaries and near them, at any ratio and magnitude."""
    mp.mp.dps = 75
    rng = np.random.default_rng(7)
    for base in (1.0, 0.3, 1e-4, 1e8):
        for mu in ([base, base / ratio], [base / ratio, base]):
            tau = magnitude * nasty_points(rng, 24, np.array(mu))
            for point, r in zip(tau, project_cone(tau, mu)):
                exact = exact_projection(point, mu)
                error = mp.sqrt(sum((mp.mpf(a) - b) ** 2 for a, b in zip(r.tolist(), exact)))
                assert error <= 4 * UNIT * lengths(point), (mu, point)


@pytest.mark.parametrize("mu", [(0.3, 0.15), (0.2, 0.2), (1.5, 0.01), (0.1, 3.0)])
def test_projection_is_the_nearest_point(mu):
    """The nearest point of the cone as trying all rays finds it (to half the digits, as a
    maximum can be found); its load function is not positive."""
    rng = np.random.default_rng(8)
    tau = nasty_points(rng, 60, np.array(mu))
    r = project_cone(tau, mu)
    for point, found in zip(tau, r):
        error = np.linalg.norm(found - project(point, np.array(mu)))
        assert error <= 1e-6 * (1 + np.linalg.norm(point))
    assert np.all(load_function(r, mu) <= 8 * EPS * r[:, 2])


def test_load_function_is_equation_1():
    """f = |M^-1 r_t| - r_n [dSFMH07, Eq. (1)], also per node and in huge and tiny units."""
    rng = np.random.default_rng(9)
    r, mu = rng.normal(size=(50, 3)), rng.uniform(0.1, 1, size=(50, 2))
    expected = np.sqrt((r[:, 0] / mu[:, 0]) ** 2 + (r[:, 1] / mu[:, 1]) ** 2) - r[:, 2]
    for unit in (1.0, 1e150, 1e-150):
        assert load_function(unit * r, mu) == pytest.approx(unit * expected, rel=1e-13)
    assert np.array_equal(load_function(r, 0), -r[:, 2])


sizes = st.floats(1e-60, 1) | st.floats(0.1, 1) | st.sampled_from([0.0, 1.0])
components = st.tuples(sizes, st.sampled_from([1, -1])).map(np.prod)
points = st.tuples(components, components, components).map(np.array)
coefficients = st.floats(1e-4, 1e4) | st.sampled_from([0.2, 1.0])
pairs = st.tuples(coefficients, coefficients).map(np.array)
powers = st.integers(-480, 480).map(lambda e: 2.0**e)


@given(points, points, pairs, powers)
def test_properties_of_the_projection(a, b, mu, scale):
    """Admissible, idempotent, Moreau's decomposition, non-expansive, homogeneous, equivariant under
    reflection."""
    r, s = project_cone(scale * np.array([a, b]), mu) / scale
    size = np.linalg.norm(a) + np.linalg.norm(b)
    tol = 16 * EPS * size
    assert load_function(r[None], mu)[0] <= 8 * EPS * r[2]
    assert np.linalg.norm(project_cone(r[None], mu)[0] - r) <= tol
    z = a - r
    assert abs(z @ r) <= tol * size
    assert np.linalg.norm(mu * z[:2]) + z[2] <= tol * (1 + mu.max())
    assert np.linalg.norm(r - s) <= np.linalg.norm(a - b) + tol
    assert np.array_equal(project_cone(a[None], mu)[0], r)
    for mirror in ((-1, 1, 1), (1, -1, 1)):
        assert np.array_equal(project_cone((mirror * a)[None], mu)[0], mirror * r)


@given(points, pairs, st.floats(-17, -1), points)
def test_projection_is_continuous_across_branches(a, mu, exponent, direction):
    """A small step moves the projection by no more than its length, whatever branch it leads to."""
    t, n = a[:2], a[2]
    step = 10.0**exponent * direction
    for start in ([*t, np.linalg.norm(t / mu)], [*t, -np.linalg.norm(t * mu)], [0, 0, 0], [*t, n]):
        start = np.array(start)
        r, s = project_cone(np.array([start, start + step]), mu)
        size = np.linalg.norm(start) + np.linalg.norm(step)
        assert np.linalg.norm(r - s) <= np.linalg.norm(step) + 8 * EPS * size


def test_frictionless_projection():
    """mu = 0 projects on the half line r_t = 0, r_n >= 0, for all nodes or for some of them."""
    tau = np.array([[1.0, 2, 3], [1, 2, -3], [0, 0, 0], [0, 0, 1]])
    expected = np.array([[0, 0, 3], [0, 0, 0], [0, 0, 0], [0, 0, 1.0]])
    assert np.array_equal(project_cone(tau, 0), expected)
    some = np.array([[0.0, 0], [0, 0], [0.3, 0.2], [0.3, 0.2]])
    assert np.array_equal(project_cone(tau, some), expected)


def test_infinite_points():
    """A row that is infinite or NaN gives NaN and leaves the other rows alone."""
    for mu in (0.2, (0.3, 0.1)):
        for bad in (np.inf, -np.inf, np.nan):
            for component in range(3):
                tau = np.ones((3, 3))
                tau[1, component] = bad
                r = project_cone(tau, mu)
                assert np.isnan(r[1]).all() and np.isfinite(r[[0, 2]]).all()


def test_principal_axes_per_node():
    """A groove angle at each node turns the cone: projecting turned points gives turned points."""
    rng = np.random.default_rng(11)
    angle, tau = rng.uniform(0, 2 * np.pi, 60), rng.normal(size=(60, 3))
    axes = np.column_stack([np.cos(angle), np.sin(angle)])
    turn = np.zeros((60, 3, 3))
    turn[:, :2, :2] = np.stack([axes, np.column_stack([-axes[:, 1], axes[:, 0]])], axis=1)
    turn[:, 2, 2] = 1
    straight = project_cone(np.einsum("nij,nj->ni", turn, tau), (0.3, 0.1))
    turned, _ = Friction((0.3, 0.1), axes=axes).law(3).project(tau)
    assert turned == pytest.approx(np.einsum("nji,nj->ni", turn, straight), abs=1e-14)


@pytest.mark.parametrize(
    "tau, mu, named",
    [
        (np.zeros((3, 2)), 0.2, ("tau", "(n, 3)", "(3, 2)")),
        (np.zeros(3), 0.2, ("tau", "(3,)")),
        (np.zeros((3, 3), complex), 0.2, ("tau", "complex128")),
        (np.zeros((3, 3), np.longdouble), 0.2, ("tau", "digits")),
        (np.full((3, 3), "1"), 0.2, ("tau", "real numbers")),
        (np.zeros((3, 3), bool), 0.2, ("tau", "bool")),
        (np.zeros((3, 3)), -0.2, ("mu", "-0.2")),
        (np.zeros((3, 3)), (0.2, 0), ("mu", "(0.2, 0)")),
        (np.zeros((3, 3)), np.ones((2, 2)), ("tau", "3", "2")),
    ],
    ids=repr,
)
def test_a_mistake_is_a_value_error_with_its_value(tau, mu, named):
    """Wrong shapes and types are refused with what was given and what is wanted."""
    for function in (project_cone, load_function):
        with pytest.raises(ValueError) as error:
            function(tau, mu)
        for part in named[1:]:
            assert part in str(error.value)
