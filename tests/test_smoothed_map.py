# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The smoothed map: the return map with the corner between sticking and slipping rounded off.

Its properties at a great many random states are tested in C++ (cpp/tests/test_smoothed_map.cpp).
"""

import mpmath
import numpy as np
import pytest
import twin

from dolfinx_contact._kernel import make_law
from dolfinx_contact.law.friction import Friction

EPS = np.finfo(float).eps
PER_NODE = 10.0 ** np.random.default_rng(0).uniform(-1, 1, size=(2, 48, 2))
LAWS = {
    "isotropic": (0.2, None, 3),
    "associated": ((0.3, 0.15), None, 3),
    "non-associated": ((0.3, 0.15), (0.05, 0.20), 3),
    "equal mu": ((0.2, 0.2), (1e-3, 1.0), 3),
    "wild": ((1e-3, 1e3), (1e4, 1e-4), 3),
    "per node": (*PER_NODE, 3),
    "isotropic per node": (PER_NODE[0, :, :1], None, 3),
    "plane": (0.5, None, 2),
    "plane per node": (PER_NODE[0, :, :1], None, 2),
}
ROUNDINGS = (1e2, 1.0, 1e-3, 1e-9)


class Scene:
    """A law and 48 random states: trial reactions inside and outside of the cone, on its axis, on the
    principal axes, on its boundary, open nodes, the apex, no slip."""

    def __init__(self, name, seed):
        rng = np.random.default_rng(seed)
        mu, p, dim = LAWS[name]
        n, t = 48, dim - 1
        coefficients = [
            np.array(np.broadcast_to(c, (n, t) if np.ndim(c) == 2 else t), float)
            for c in (mu, mu if p is None else p)
        ]
        self.law = make_law(*coefficients, dim)
        self.mu = np.array(np.broadcast_to(mu, (n, t)))
        self.p = np.array(np.broadcast_to(mu if p is None else p, (n, t)))
        self.q = (self.p / self.p.max(axis=1, keepdims=True)) ** 2
        x = rng.normal(size=(n, t))
        x[:6] = 0
        x[6:12, 0] = 0
        R = rng.uniform(0.2, 2, n)
        x[12:16] /= np.linalg.norm(x[12:16], axis=1)[:, None] / R[12:16, None]
        self.r = np.column_stack([self.mu * x, R])
        self.gap = np.where(rng.random(n) < 0.5, 0.0, rng.uniform(-0.2, 0.2, n))
        self.slip = self.mu * rng.normal(size=(n, t)) * 10.0 ** rng.uniform(-8, 1, size=(n, 1))
        self.slip[:20], self.gap[:16] = 0, 0
        self.gap[20:24] = 100  # open
        self.r[24] = 0  # the apex
        self.rho_n, self.rho_t = rng.uniform(0.5, 2, size=(2, n))

    @property
    def state(self):
        return self.r, self.gap, self.slip, self.rho_n, self.rho_t

    def slip_length(self, t):
        """Length in the metric of the slip rule, that of M^-1 t with weights q."""
        return np.linalg.norm(np.sqrt(self.q) * t[:, : self.mu.shape[1]] / self.mu, axis=1)

    def slack(self, r):
        return r[:, -1] - np.linalg.norm(r[:, :-1] / self.mu, axis=1)


@pytest.mark.parametrize("name", LAWS)
def test_map_is_the_twins(name):
    """The map is the twin's, which bisects the definition; its branch is that of the return map."""
    s = Scene(name, seed=1)
    exact, branch = s.law.return_map(*s.state)
    assert set(branch) == {0, 1, 2}
    for rounding, nodes in zip(ROUNDINGS, np.arange(48).reshape(12, 4).T):
        found, status = s.law.smoothed_map(*s.state, rounding)
        assert np.array_equal(status, branch)
        for i in nodes:
            state = s.mu[i], s.p[i], *(a[i] for a in s.state)
            expected = twin.smoothed_map(*state, rounding)
            error = np.abs(found[i] - expected) / np.append(s.mu[i], 1)
            assert error.max() <= 1e-13 * expected[-1]


@pytest.mark.parametrize("name", LAWS)
def test_fixed_points_do_not_depend_on_the_metric(name):
    """du_i = -s r_i / q_i with s (r_n - |M^-1 r_t|) = rounding is a fixed point for all rho, and no
    longer one for another slip or with a gap."""
    s = Scene(name, seed=2)
    rng = np.random.default_rng(3)
    r = s.r.copy()
    r[24, -1] = 1
    r[:, :-1] *= (rng.uniform(0, 0.99, 48) * r[:, -1] / (1e-9 + r[:, -1] - s.slack(r)))[:, None]
    for rounding in ROUNDINGS:
        slip = -rounding * (r[:, :-1] / s.q) / s.slack(r)[:, None]
        zero, one = np.zeros(48), np.ones(48)
        for rho_n, rho_t in ((1e-3, 1e3), (1.0, 1.0), (10.0, 1e-2)):
            moved, _ = s.law.smoothed_map(r, zero, slip, rho_n * one, rho_t * one, rounding)
            size = s.slip_length(r) + rho_t * s.slip_length(slip)
            error = s.slip_length(moved - r)
            assert np.all(error <= 64 * EPS * size * r[:, -1] / s.slack(r))
            assert np.array_equal(moved[:, -1], r[:, -1])
        for gap, factor in ((0.01 * one, 1.0), (zero, 1.1)):
            moved, _ = s.law.smoothed_map(r, gap, factor * slip, one, one, rounding)
            moves = np.linalg.norm(moved - r, axis=1) > 0
            assert np.all(moves[np.any(slip != 0, axis=1) | (gap > 0)])


@pytest.mark.parametrize("name", LAWS)
def test_limit_is_the_return_map(name):
    """The distance from the return map, in the metric of the slip rule, is at most sqrt(rho_t rounding
    R): zero in the limit. Without rounding map and derivatives are those of the return map to the last
    digit."""
    s = Scene(name, seed=4)
    exact, branch = s.law.return_map(*s.state)
    size = s.slip_length(s.r) + s.rho_t * s.slip_length(s.slip)
    for rounding in 10.0 ** -np.arange(-2, 41, 2):
        found, _ = s.law.smoothed_map(*s.state, rounding)
        bound = np.sqrt(s.rho_t * rounding * exact[:, -1])
        assert np.all(s.slip_length(found - exact) <= bound + 8 * EPS * size)
    for a, b in zip(s.law.smoothed_map(*s.state, 0), (exact, branch)):
        assert np.array_equal(a, b)
    for a, b in zip(s.law.smoothed_jacobian(*s.state, 0.0), s.law.return_jacobian(*s.state)):
        assert np.array_equal(a, b)


def test_distance_at_the_corner():
    """Where sticking ends, |M^-1 tau| = R, the distance is sqrt(rho_t rounding R) to first order: the
    bound is sharp, and there is no rounding error in it."""
    law, one = Friction(0.5).law(3), np.ones(1)
    r, zero = np.array([[0.3 * 2, 0.4 * 2, 2.0]]), np.zeros(1)
    for rounding in (1e-6, 1e-12, 1e-18, 1e-24):
        found, _ = law.smoothed_map(r, zero, np.zeros((1, 2)), one, one, rounding)
        distance = np.linalg.norm(found[0] - r[0]) / 0.5
        bound = np.sqrt(2 * rounding)
        assert abs(distance - bound) <= bound**2 + 8 * EPS


@pytest.mark.parametrize("name", LAWS)
def test_reaction_is_strictly_inside_of_the_cone(name):
    """|M^-1 r_t| < r_n on all nodes in contact, whose slack is at least rho_t rounding over the largest
    lambda; open nodes have no reaction."""
    s = Scene(name, seed=5)
    for rounding in ROUNDINGS:
        found, branch = s.law.smoothed_map(*s.state, rounding)
        assert np.all(found[branch == 0] == 0)
        # lambda R <= |z| + rho_t rounding, as lambda |x| <= |z| and lambda (R - |x|) = rho_t rounding
        z = np.linalg.norm((s.r[:, :-1] - s.rho_t[:, None] * s.slip) / s.mu, axis=1)
        eps, R = s.rho_t * rounding, found[:, -1]
        least = eps * R / (z + eps)
        assert np.all((s.slack(found) >= least - 8 * EPS * R)[branch != 0])
        seen = (branch != 0) & (least > 16 * EPS * R)
        assert np.all(s.slack(found)[seen] > 0) and seen.sum() > 20


@pytest.mark.parametrize("exponent", [-290, -150, 0, 150, 290])
def test_closed_form_to_rounding(exponent):
    """In the plane lambda is the root of a quadratic equation: the reaction is that of 60 digits to two
    units of rounding of R, inside, outside and within rounding of the boundary, at any magnitude."""
    rng = np.random.default_rng(6)
    mu, scale, n = 0.5, 10.0**exponent, 60
    R = rng.uniform(0.5, 2, n) * scale
    z = R * (1 + rng.choice([-1, 1], n) * 10.0 ** rng.uniform(-17, 0, n))
    z[:10] *= 10.0 ** rng.uniform(-10, 10, 10)
    r, zero, one = np.column_stack([mu * z, R]), np.zeros(n), np.ones(n)
    for small in (1e-17, 1e-8, 1.0):
        found, _ = Friction(mu).law(2).smoothed_map(r, zero, zero[:, None], one, one, small * scale)
        with mpmath.workdps(60):
            for i in range(n):
                Z, radius, eps = (mpmath.mpf(float(v)) for v in (z[i], R[i], small * scale))
                b = radius - Z - eps
                lam = (mpmath.sqrt(b * b + 4 * eps * radius) - b) / (2 * radius)
                assert abs(found[i, 0] / mu - Z / (1 + lam)) <= 2 * EPS * radius


@pytest.mark.parametrize("name", LAWS)
def test_units_only_scale_the_answer(name):
    """Forces and lengths in other units, by powers of ten from 1e-140 to 1e140, change the reaction by
    the unit of force, the derivatives by that of stiffness; p by any factor changes nothing."""
    s = Scene(name, seed=7)
    r, branch, by_r, by_motion = s.law.smoothed_jacobian(*s.state, 0.1)
    inside = branch != 0
    M = np.column_stack([s.mu * np.sqrt(1 / s.q), np.ones(48)])
    size = s.slip_length(s.r) + s.rho_t * s.slip_length(s.slip) + r[:, -1]
    for force, length in ((1e140, 1.0), (1e-140, 1.0), (1e3, 1e-100), (1e-60, 1e40)):
        stiffness = force / length
        state = force * s.r, length * s.gap, length * s.slip
        rho = stiffness * s.rho_n, stiffness * s.rho_t
        found = s.law.smoothed_jacobian(*state, *rho, length * 0.1)
        error = np.abs(found[0] / force - r) / M
        assert np.all(error <= 64 * EPS * size[:, None])
        for unit, a, b in ((1, found[2], by_r), (stiffness, found[3], by_motion)):
            change = (a / unit - b) / M[:, :, None] * M[:, None, :]
            assert np.abs(change[inside]).max() <= 1e-12 * (1 + size.max())
    scaled = make_law(s.mu, 1e9 * s.p, s.r.shape[1]).smoothed_map(*s.state, 0.1)[0]
    assert np.all(np.abs(scaled - r) / M <= 64 * EPS * size[:, None])


@pytest.mark.parametrize("name", LAWS)
def test_derivatives_are_limits_of_differences(name):
    """Derivatives are those of central differences with steps far below the rounding, at any rounding,
    at the corner, without slip; on the axis, where their derivative jumps, to first order. There is no
    kink but that of opening."""
    s = Scene(name, seed=8)
    rng = np.random.default_rng(9)
    scale = np.column_stack([s.mu / np.sqrt(s.q).max(axis=1)[:, None], np.ones(48)])
    for rounding in (10.0, 1.0, 0.1, 1e-3):
        value, branch, by_r, by_motion = s.law.smoothed_jacobian(*s.state, rounding)
        assert np.array_equal(value, s.law.smoothed_map(*s.state, rounding)[0])
        closed = (branch != 0) & (value[:, -1] > 0.1)
        assert closed.sum() > 35
        h = 1e-4 * min(rounding, 0.1)
        dr, dw = scale * rng.uniform(-1, 1, size=(2, *scale.shape))
        ends = [
            s.law.smoothed_map(
                s.r + step * dr,
                s.gap + step * dw[:, -1],
                s.slip + step * dw[:, :-1],
                s.rho_n,
                s.rho_t,
                rounding,
            )[0]
            for step in (h, -h)
        ]
        expected = np.einsum("nij,nj->ni", by_r, dr) + np.einsum("nij,nj->ni", by_motion, dw)
        error = np.abs((ends[0] - ends[1]) / (2 * h) - expected) / scale
        axial = value[:, -1] - s.slack(value) < 1e-3
        assert error[closed & ~axial].max() <= 1e-6
        assert error[closed & axial].max() <= 10 * h
        assert np.all(by_r[branch == 0] == 0) and np.all(by_motion[branch == 0] == 0)


def test_turned_axes():
    """With a principal direction of its own at each node, map and derivatives are those in the turned
    frame."""
    s = Scene("non-associated", seed=10)
    angle = np.random.default_rng(11).uniform(0, 7, 48)
    c, d, zero = np.cos(angle), np.sin(angle), np.zeros(48)
    turn = np.moveaxis(np.array([[c, -d, zero], [d, c, zero], [zero, zero, zero + 1]]), 2, 0)
    law = make_law(s.mu, s.p, 3, np.column_stack([c, d]))
    expected = s.law.smoothed_jacobian(*s.state, 0.1)
    r = np.einsum("nij,nj->ni", turn, s.r)
    slip = np.einsum("nij,nj->ni", turn[:, :2, :2], s.slip)
    found = law.smoothed_jacobian(r, s.gap, slip, s.rho_n, s.rho_t, 0.1)
    assert found[0] == pytest.approx(np.einsum("nij,nj->ni", turn, expected[0]), abs=1e-12)
    for i in (2, 3):
        turned = turn @ expected[i] @ np.swapaxes(turn, 1, 2)
        assert np.abs(found[i] - turned).max() <= 1e-11
    assert law.smoothed_map(r, s.gap, slip, s.rho_n, s.rho_t, 0.1)[0] == pytest.approx(found[0])


def test_without_friction():
    """Without friction, for all nodes or for one of a field, the reaction is normal and so is its
    derivative."""
    state = np.ones((2, 3)), np.array([0.25, 2.0]), np.ones((2, 2)), np.full(2, 2.0), np.ones(2)
    for mu in (0.0, [[0.0, 0.0], [0.0, 0.0]]):
        r, branch, by_r, by_motion = Friction(mu).law(3).smoothed_jacobian(*state, 0.1)
        assert np.array_equal(r, [[0, 0, 0.5], [0, 0, 0]])
        assert np.array_equal(branch, [2, 0])
        normal = np.diag([0.0, 0.0, 1.0])
        assert np.array_equal(by_r, [normal, 0 * normal])
        assert np.array_equal(by_motion, [-2 * normal, 0 * normal])
    mixed = Friction([[0.0, 0.0], [0.3, 0.2]]).law(3)
    r, branch = mixed.smoothed_map(*(a[[0, 0]] for a in state), 0.1)
    assert np.array_equal(r[0], [0, 0, 0.5]) and branch[0] == 2
    assert np.array_equal(r, mixed.smoothed_jacobian(*(a[[0, 0]] for a in state), 0.1)[0])


def test_wrong_rounding():
    """A rounding that is negative or not finite is refused with its value."""
    s = Scene("isotropic", seed=12)
    for bad, said in ((-0.5, "-0.5"), (np.nan, "nan"), (np.inf, "inf")):
        for function in (s.law.smoothed_map, s.law.smoothed_jacobian):
            with pytest.raises(ValueError, match=f"rounding must be .*, not {said}"):
                function(*s.state, bad)
