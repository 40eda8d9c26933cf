# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Friction: what its forms mean and what it refuses."""

import pickle

import numpy as np
import pytest

from dolfinx_contact.law.friction import Friction


def test_scalar_is_isotropic_and_associated():
    """One coefficient means the same in both directions, slipping against the force."""
    friction = Friction(0.2)
    assert np.array_equal(friction.mu, [0.2, 0.2]) and np.array_equal(friction.p, [0.2, 0.2])
    assert friction.isotropic and friction.associated and not friction.frictionless
    assert [friction.law(dim).kind for dim in (2, 3)] == ["isotropic", "isotropic"]


def test_zero_is_frictionless():
    """mu = 0 is the frictionless law in both dimensions."""
    for mu in (0, 0.0, (0, 0), np.zeros((4, 2))):
        friction = Friction(mu)
        assert friction.frictionless
        assert [friction.law(dim).kind for dim in (2, 3)] == ["frictionless", "frictionless"]


def test_p_omitted_is_associated():
    """Without p the slip rule is associated: p = mu."""
    friction = Friction((0.3, 0.15))
    assert np.array_equal(friction.p, friction.mu) and friction.associated
    assert not friction.isotropic and friction.law(3).kind == "associated"


def test_p_is_normalised_whatever_its_scale():
    """max(p / mu) = 1 for every scale of p; the ratio of the two p is what was given."""
    reference = Friction((0.3, 0.15), (0.05, 0.20))
    assert reference.law(3).kind == "nonassociated" and not reference.associated
    for scale in 10.0 ** np.arange(-9, 10, 3):
        friction = Friction((0.3, 0.15), (0.05 * scale, 0.20 * scale))
        assert np.max(friction.p / friction.mu) == pytest.approx(1.0, rel=1e-15)
        assert friction.p == pytest.approx(reference.p, rel=1e-15)
        assert Friction((0.3, 0.15), (3 * scale, 1.5 * scale)).associated


def test_k_is_the_exponent_of_the_paper():
    """k gives p_y / p_x = (mu_y / mu_x)^k; k = 1 is associated."""
    mu = (0.3, 0.15)
    for k in (-3, 0, 0.5, 2):
        p = Friction(mu, k=k).p
        assert p[1] / p[0] == pytest.approx((mu[1] / mu[0]) ** k, rel=1e-14)
    assert Friction(mu, k=1).associated


def test_isotropic_mu_with_other_p_is_not_isotropic():
    """Isotropy needs equal mu and equal p."""
    friction = Friction(0.2, p=(0.1, 0.2))
    assert not friction.isotropic and friction.law(3).kind == "nonassociated"
    with pytest.raises(ValueError, match="two dimensions"):
        friction.law(2)


def test_coefficients_per_node():
    """Arrays of shape (n, 2) give each node its pair, frictionless nodes among them, and p is
    normalised node by node; one pair p serves all nodes."""
    mu = np.array([[0.3, 0.15], [0.0, 0.0], [0.2, 0.2]])
    friction = Friction(mu, p=(0.05, 0.20))
    assert friction.p.shape == (3, 2) and friction.law(3).nodes == 3
    assert np.array_equal(friction.p[0], Friction(mu[0], p=(0.05, 0.20)).p)
    assert Friction(mu).law(3).kind == "associated"
    assert Friction((0.3, 0.15), p=np.ones((4, 2))).mu.shape == (4, 2)


@pytest.mark.parametrize("rule", [{}, dict(p=(0.05, 0.20)), dict(p=np.ones((0, 2))), dict(k=2)])
def test_coefficients_of_no_node(rule):
    """A rank without contact nodes has coefficients per node as well: none, and a law for none."""
    friction = Friction(np.ones((0, 2)), **rule)
    assert friction.mu.shape == friction.p.shape == friction.Q.shape == (0, 2)
    law = friction.law(3)
    assert law.nodes == 0 and law.load_function(np.ones((0, 3))).shape == (0,)
    with pytest.raises(ValueError, match="0"):
        law.load_function(np.ones((1, 3)))


def test_axes_per_node():
    """Principal axes are kept as unit vectors; they matter only where friction is not isotropic, and
    have no meaning in two dimensions."""
    axes = np.array([[1.0, 0.0], [0.6, 0.8]])
    friction = Friction((0.3, 0.1), axes=axes)
    assert np.array_equal(friction.axes, axes) and friction.law(3).nodes == 2
    assert np.array_equal(pickle.loads(pickle.dumps(friction)).axes, axes)
    assert Friction(0.3, axes=axes).law(3).kind == "isotropic"
    with pytest.raises(ValueError, match="give no axes"):
        Friction(0.3, axes=axes).law(2)


def test_immutable_and_unchanged_by_a_pickle():
    """Nothing of a Friction can be assigned, and a copy by pickle is the same law."""
    for friction in (Friction((0.3, 0.15), (0.05, 0.2)), Friction(0), Friction(np.ones((2, 2)))):
        with pytest.raises(AttributeError):
            friction.mu = 1
        with pytest.raises(ValueError):
            friction.mu[:] = 1
        copy = pickle.loads(pickle.dumps(friction))
        assert np.array_equal(copy.mu, friction.mu) and copy.p == pytest.approx(
            friction.p, rel=4e-16
        )


@pytest.mark.parametrize(
    "arguments, named",
    [
        (dict(mu=-0.1), ("mu", "-0.1")),
        (dict(mu=(0.3, np.nan)), ("mu", "mu[1] is nan")),
        (dict(mu=[(0.3, 0.2)] * 99 + [(0.3, np.nan)]), ("mu[99, 1] is nan",)),
        (dict(mu=-np.inf), ("mu", "inf")),
        (dict(mu=0.3 + 0.1j), ("mu", "0.1j")),
        (dict(mu=True), ("mu", "True")),
        (dict(mu=(True, 0.2)), ("mu", "True")),
        (dict(mu="0.3"), ("mu", "0.3")),
        (dict(mu=None), ("mu", "None")),
        (dict(mu=(1, 2, 3)), ("mu", "(3,)")),
        (dict(mu=()), ("mu", "(0,)")),
        (dict(mu=np.ones((0, 3))), ("mu", "(0, 3)")),
        (dict(mu=np.ones((0, 2, 2))), ("mu", "(0, 2, 2)")),
        (dict(mu=0.3, p=()), ("p", "(0,)")),
        (dict(mu=np.ones((2, 2)), p=np.ones((0, 2))), ("p", "(0, 2)", "(2, 2)")),
        (dict(mu=[[1, 2], [1]]), ("mu", "[1]")),
        (dict(mu=np.ones((2, 3))), ("mu", "(2, 3)")),
        (dict(mu=(0.3, 0)), ("mu", "(0.3, 0)", "small coefficient")),
        (dict(mu=[[0.1, 0.1], [0, 0.1]]), ("mu", "small coefficient")),
        (dict(mu=1e-60), ("mu", "1e-60")),
        (dict(mu=0.3, p=0), ("p", "0", "omit")),
        (dict(mu=0.3, p=(-1, 1)), ("p", "-1")),
        (dict(mu=0.3, p=(1, np.inf)), ("p", "inf")),
        (dict(mu=0.3, p=(1, 1j)), ("p", "1j")),
        (dict(mu=0.3, p=(1e-60, 1)), ("p", "1e-60")),
        (dict(mu=np.ones((2, 2)), p=np.ones((3, 2))), ("p", "(3, 2)")),
        (dict(mu=0.3, p=(1, 2), k=1), ("p", "k", "not both")),
        (dict(mu=0.3, k=np.inf), ("k", "inf")),
        (dict(mu=0.3, k=np.nan), ("k", "nan")),
        (dict(mu=0.3, k=True), ("k", "True")),
        (dict(mu=0.3, k=(1, 2)), ("k", "(1, 2)")),
        (dict(mu=0.3, axes=np.ones((2, 2))), ("axes", "1.41421", "unit vectors")),
        (dict(mu=0.3, axes=np.array([[np.nan, 0]])), ("axes", "nan")),
        (dict(mu=0.3, axes=np.ones(2)), ("axes", "(2,)")),
        (dict(mu=np.ones((3, 2)), axes=np.array([[1.0, 0]])), ("axes", "1", "3")),
    ],
    ids=repr,
)
def test_a_mistake_is_a_value_error_with_its_value(arguments, named):
    """Every wrong coefficient is refused by a message with the parameter and what was given."""
    with pytest.raises(ValueError) as error:
        Friction(**arguments)
    for part in named:
        assert part in str(error.value)
