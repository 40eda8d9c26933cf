# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The bi-potential maps, in the paper's and in scaled variables, and the gap as a certificate."""

import numpy as np
import pytest
from defined_maps import bipotential, bipotential_map, return_map, scaled_map
from hypothesis import given
from hypothesis import strategies as st

from dolfinx_contact.law.bipotential import bipotential_gap
from dolfinx_contact.law.friction import Friction
from mechanics.judge_law import law_defects

EPS = np.finfo(float).eps
LAWS = {
    "isotropic": (0.2, None),
    "associated": ((0.3, 0.15), None),
    "non-associated": ((0.3, 0.15), (0.05, 0.20)),
    "crossed": ((0.4, 0.04), (0.01, 0.1)),
    "steep": ((1.5, 3.0), (1.0, 0.5)),
}


def states(friction, n, seed, lawful=False):
    """Reactions in the cone, gaps and slip increments: any, or those that obey the law."""
    rng = np.random.default_rng(seed)
    e = rng.normal(size=(n, 2))
    e[: n // 8] *= [1, 0]
    e /= np.linalg.norm(e, axis=1)[:, None]
    R = rng.uniform(0.1, 2, n)
    inside = np.where(rng.random(n) < 0.5, 1.0, rng.random(n))
    gap = np.where(rng.random(n) < 0.5, 0.0, rng.random(n))
    slip = rng.normal(size=(n, 2)) * 10.0 ** rng.uniform(-8, 1, size=(n, 1))
    if lawful:
        status = rng.integers(3, size=n)
        R[status == 0] = 0
        gap[status != 0] = 0
        slip[status == 1] = 0
        inside[status == 2] = 1
        d = friction.mu * e / friction.p**2
        d /= np.linalg.norm(d, axis=1)[:, None]
        length = np.linalg.norm(slip, axis=1)[:, None]
        slip[status == 2] = (-length * d)[status == 2]
    r = np.column_stack([(R * inside)[:, None] * friction.mu * e, R])
    return r, gap, slip


def maps(law, r, gap, slip, rho):
    return {
        "paper": law.bipotential_map(r, gap, slip, rho)[0],
        "scaled": law.scaled_map(r, gap, slip, rho)[0],
        "return": law.return_map(r, gap, slip, rho, 0.3 * rho)[0],
    }


@pytest.mark.parametrize("name", LAWS)
def test_maps_are_those_of_their_definitions(name):
    """All three maps, at any state of the cone and any metric, are those of definitions, which know the paper's
    formulas and how to try all rays."""
    mu, p = LAWS[name]
    friction = Friction(mu, p)
    r, gap, slip = states(friction, 60, seed=1)
    rho = np.random.default_rng(2).uniform(0.1, 10, len(r))
    found = maps(friction.law(3), r, gap, slip, rho)
    m, q = np.broadcast_to(mu, 2), np.broadcast_to(mu if p is None else p, 2)
    q = q / np.max(q / m)  # the paper's maps depend on the scale of p as on that of rho
    for i in range(len(r)):
        expected = {
            "paper": bipotential_map(m, q, r[i], gap[i], slip[i], rho[i]),
            "scaled": scaled_map(m, q, r[i], gap[i], slip[i], rho[i]),
            "return": return_map(m, q, r[i], gap[i], slip[i], rho[i], 0.3 * rho[i]),
        }
        size = np.linalg.norm(r[i]) + rho[i] * (np.linalg.norm(slip[i]) + gap[i])
        for kind in expected:
            error = np.linalg.norm(found[kind][i] - expected[kind])
            assert error <= 1e-6 * size * (10 if kind == "return" else 1), (kind, i)


@pytest.mark.parametrize("name", LAWS)
def test_fixed_points_are_the_law(name):
    """All three maps leave a pair alone if the judge finds that it obeys the law, whatever the metric, and
    move it if it does not; its gap and slip defect vanish."""
    mu, p = LAWS[name]
    friction = Friction(mu, p)
    law = friction.law(3)

    def defects(r, gap, slip):
        """What the judge finds, of nodes with stiffness one."""
        return np.max(law_defects(r, gap, slip, 1.0, np.tile(np.eye(2), (len(r), 1, 1)), friction.mu, friction.p), axis=0)  # fmt: skip

    r, gap, slip = states(friction, 300, seed=3, lawful=True)
    branch = np.where(r[:, 2] == 0, 0, np.where(np.any(slip != 0, axis=1), 2, 1)).astype(np.uint8)
    size = np.linalg.norm(r, axis=1) + np.linalg.norm(slip, axis=1) + gap
    assert (defects(r, gap, slip) <= 1e-9 * size).all()
    for rho in (np.full(len(r), rho) for rho in (0.01, 1.0, 100.0)):
        for kind, moved in maps(law, r, gap, slip, rho).items():
            error = np.linalg.norm(moved - r, axis=1)
            assert np.all(error <= 1e-12 * (1 + rho) * size), kind
    assert np.all(bipotential_gap(r, gap, slip, friction) <= 1e-14 * size**2)
    assert np.all(np.abs(law.slip_defect(r, slip, branch)).max(axis=1) <= 1e-13 * size)

    r, gap, slip = states(friction, 300, seed=4)
    unlawful = defects(r, gap, slip) > 1e-3
    assert sum(unlawful) > 200
    for kind, moved in maps(law, r, gap, slip, np.ones(len(r))).items():
        assert np.linalg.norm(moved - r, axis=1)[unlawful].min() > 1e-12, kind


@pytest.mark.parametrize("name", LAWS)
def test_gap_is_the_bipotentials(name):
    """The gap is b_c(-du, r) + du . r as the paper writes it, up to the cancellation in that sum."""
    mu, p = LAWS[name]
    friction = Friction(mu, p)
    r, gap, slip = states(friction, 200, seed=5)
    found = bipotential_gap(r, gap, slip, friction)
    assert np.all(found >= 0)
    for i in range(len(r)):
        expected = bipotential(friction.mu, friction.p, r[i], gap[i], slip[i])
        size = np.linalg.norm(r[i]) * (np.linalg.norm(slip[i]) + gap[i])
        assert abs(found[i] - expected) <= 1e-14 * size


def test_gap_has_no_cancellation():
    """A slip turned by a small angle a from the law's has a gap of r_n |w| a^2 / 2 to 6 digits, far
    below the rounding of the sum's terms."""
    friction = Friction(0.5)
    for a in (1e-3, 1e-6, 1e-9, 1e-12):
        r = np.array([[0.5, 0.0, 1.0]])
        slip = np.array([[-np.cos(a), -np.sin(a)]])
        found = bipotential_gap(r, np.zeros(1), slip, friction)[0]
        assert found == pytest.approx(0.5 * a**2 / 2, rel=1e-6)


def test_gap_of_an_inadmissible_pair_is_infinite():
    """Outside the cone or with penetration the bi-potential is infinite."""
    friction = Friction(0.5)
    r = np.array([[0.6, 0, 1], [0, 0, -1.0], [0, 0, 1], [0, 0, 1]])
    gap = np.array([0, 0, -1e-9, 0])
    found = bipotential_gap(r, gap, np.zeros((4, 2)), friction)
    assert np.array_equal(found, [np.inf, np.inf, np.inf, 0])


@pytest.mark.slow
@given(st.integers(0, 10**6), st.sampled_from(sorted(LAWS)))
def test_scaled_map_in_its_own_metric(seed, name):
    """Where nothing moves the scaled map is a projection of (M^-1 r_t, r_n): repeated without effect,
    decomposing after Moreau, non-expansive."""
    friction = Friction(*LAWS[name])
    x, y = np.random.default_rng(seed).normal(size=(2, 20, 3))
    M, zero = np.append(friction.mu, 1.0), np.zeros(20)

    def project(x):
        return friction.law(3).scaled_map(M * x, zero, np.zeros((20, 2)), zero + 1)[0] / M

    tol = 16 * EPS * (np.linalg.norm(x, axis=1) + np.linalg.norm(y, axis=1))
    at, z = project(x), x - project(x)
    assert np.all(np.linalg.norm(at[:, :2], axis=1) <= at[:, 2] * (1 + 8 * EPS))
    assert np.all(np.linalg.norm(z[:, :2], axis=1) + z[:, 2] <= tol)
    assert np.all(np.abs(np.sum(at * z, axis=1)) <= tol * np.linalg.norm(x, axis=1))
    assert np.all(np.linalg.norm(project(at) - at, axis=1) <= tol)
    change = np.linalg.norm(at - project(y), axis=1)
    assert np.all(change <= np.linalg.norm(x - y, axis=1) + tol)


@given(st.integers(0, 10**6), st.sampled_from(sorted(LAWS)), st.integers(-9, 9))
def test_scale_of_p_and_of_units(seed, name, exponent):
    """Multiplying p by a power of ten, or forces, lengths and the metric by powers of two, changes
    nothing or scales the result."""
    mu, p = LAWS[name]
    friction = Friction(mu, p)
    r, gap, slip = states(friction, 8, seed)
    rho = np.full(8, 0.7)
    before = maps(friction.law(3), r, gap, slip, rho)
    work = bipotential_gap(r, gap, slip, friction)
    same = Friction(mu, np.multiply(mu if p is None else p, 10.0**exponent))
    force, length = 2.0**60, 2.0**-40
    for kind, moved in maps(same.law(3), r, gap, slip, rho).items():
        size = 1e-13 * (1 + np.abs(r).max() + np.abs(slip).max())
        assert np.abs(moved - before[kind]).max() <= size
    scaled = (force * r, length * gap, length * slip)
    for kind, moved in maps(friction.law(3), *scaled, rho * force / length).items():
        assert np.array_equal(moved, force * before[kind])
    assert np.array_equal(bipotential_gap(*scaled, friction), force * length * work)


@pytest.mark.parametrize("name", LAWS)
def test_jacobians_from_python(name):
    """Derivatives through the bindings are limits of differences of the maps (the C++ tests look at
    every branch and kink); results are those of the maps."""
    mu, p = LAWS[name]
    law = Friction(mu, p).law(3)
    r, gap, slip = states(Friction(mu, p), 200, seed=6)
    slip = np.where(np.linalg.norm(slip, axis=1)[:, None] < 0.1, 0.3, slip)
    rho, h = np.ones(len(r)), 1e-6
    calls = {
        "bipotential": (law.bipotential_map, law.bipotential_jacobian, (rho,)),
        "scaled": (law.scaled_map, law.scaled_jacobian, (rho,)),
        "return": (law.return_map, law.return_jacobian, (rho, rho)),
    }
    for function, jacobian, metric in calls.values():
        value, branch, by_r, by_w = jacobian(r, gap, slip, *metric)
        assert np.abs(value - function(r, gap, slip, *metric)[0]).max() <= 1e-13
        dr, dw = np.random.default_rng(7).normal(size=(2, len(r), 3))
        ends = [
            function(r + s * dr, gap + s * dw[:, 2], slip + s * dw[:, :2], *metric) for s in (h, -h)
        ]
        smooth = (ends[0][1] == branch) & (ends[1][1] == branch) & (value[:, 2] > 0.05)
        assert smooth.sum() > 50
        expected = np.einsum("nij,nj->ni", by_r, dr) + np.einsum("nij,nj->ni", by_w, dw)
        difference = (ends[0][0] - ends[1][0]) / (2 * h)
        assert np.abs(difference - expected)[smooth].max() <= 1e-6


def test_two_dimensions():
    """In the plane the law is |r_t| <= mu r_n with slip against r_t: maps, gap and slip defect."""
    law = Friction(0.5).law(2)
    r = np.array([[0.5, 1.0], [-0.5, 1.0], [0.1, 1.0], [0, 0]])
    slip, gap = np.array([[-0.2], [0.3], [0], [5.0]]), np.array([0, 0, 0, 0.1])
    rho = np.full(4, 3.0)
    for moved, branch in (
        law.bipotential_map(r, gap, slip, rho),
        law.scaled_map(r, gap, slip, rho),
        law.return_map(r, gap, slip, rho, rho),
    ):
        assert moved == pytest.approx(r, abs=1e-15)
        assert np.array_equal(branch, [2, 2, 1, 0])
    assert np.array_equal(bipotential_gap(r, gap, slip, Friction(0.5)), np.zeros(4))
    assert np.array_equal(law.slip_defect(r, slip, branch), np.zeros((4, 1)))
    assert law.slip_defect(r, -slip, branch)[:, 0] == pytest.approx([0.4, -0.6, 0, 0])
    tau = np.array([[2.0, 1.0], [-2.0, -0.5]])
    assert law.project(tau)[0] == pytest.approx(np.array([[0.8, 1.6], [-0.2, 0.4]]))


def test_wrong_arguments():
    """Wrong shapes are ValueErrors with the shapes; a law per node wants its number of nodes."""
    r, gap, slip = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 2))
    for wrong, named in (
        ((r, np.zeros(2), slip, Friction(0.2)), "gap must have shape (3,), not (2,)"),
        ((r, gap, np.zeros((3, 3)), Friction(0.2)), "slip_increment must have shape (3, 2)"),
        ((r, gap, slip, "0.2"), "Friction"),
        ((r, gap, slip.astype(complex), Friction(0.2)), "complex"),
        ((r, gap, slip, Friction(np.ones((2, 2)))), "3 nodes"),
    ):
        with pytest.raises(ValueError) as error:
            bipotential_gap(*wrong)
        assert named in str(error.value)
    law = Friction(0.2).law(3)
    with pytest.raises(ValueError, match=r"rho must have shape \(3,\)"):
        law.bipotential_map(r, gap, slip, np.ones(2))
