# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Friction of two textured sides: works of both, equal sides, common axes, the bound in other directions."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest

WAYS = np.linspace(0.0, np.pi, 37)
SLIP = np.column_stack((np.cos(WAYS), np.sin(WAYS)))
RNG = np.random.default_rng(7)
SIDES = [((0.3, 0.1), (0.1, 0.2)), ((0.2, 0.25), None), ((0.05, 0.4), (1.0, 0.7)), ((0.3, 0.3), (0.1, 0.4))]  # fmt: skip


def at_nodes(mu, p=None, angle=0.0):
    """A law for each of the slips, its axes turned."""
    turned = np.full(WAYS.shape, angle)
    axes = np.column_stack((np.cos(turned), np.sin(turned)))
    rows = [None if c is None else np.tile(c, (WAYS.size, 1)) for c in (mu, p)]
    return dc.Friction(*rows, axes=axes)


def works(law):
    """Per normal force and way, in each direction."""
    return (law.drag(SLIP) * SLIP).sum(axis=1)


@pytest.mark.parametrize("mu, p", SIDES)
@pytest.mark.parametrize("angle", [0.0, 0.4, 1.2])
def test_equal_sides_are_as_one(mu, p, angle):
    """Two sides of the same law and axes have its friction in every direction; of c times the coefficients its mean."""
    one = at_nodes(mu, p, angle)
    assert dc.Friction.of_pair(one, one).drag(SLIP) == pytest.approx(one.drag(SLIP), abs=1e-14)
    other = at_nodes(np.multiply(mu, 3.0), np.array(p or mu), angle)
    half = (one.drag(SLIP) + other.drag(SLIP)) / 2
    assert dc.Friction.of_pair(one, other).drag(SLIP) == pytest.approx(half, abs=1e-14)


@pytest.mark.parametrize("one", SIDES)
@pytest.mark.parametrize("other", SIDES)
def test_along_common_axes_works_are_the_mean(one, other):
    """With axes in common, or crossed, to rounding along both of them, whatever the slip rules."""
    for angle in (0.0, np.pi / 2):
        first, second = at_nodes(*one), at_nodes(*other, angle)
        pair = works(dc.Friction.of_pair(first, second))
        half = (works(first) + works(second)) / 2
        assert pair[[0, 18, 36]] == pytest.approx(half[[0, 18, 36]], rel=1e-12)


def test_elsewhere_works_are_at_most_the_mean():
    """Of associated sides with any axes, which as a pair are associated; the worst case is that of the documentation."""
    for _ in range(50):
        first, second = (at_nodes(RNG.uniform(0.05, 0.5, 2), None, RNG.uniform(0, np.pi)) for _ in range(2))  # fmt: skip
        pair = dc.Friction.of_pair(first, second)
        half = (works(first) + works(second)) / 2
        assert pair.associated
        assert (works(pair) <= half * (1 + 1e-12)).all() and (works(pair) >= 0.7 * half).all()
        swapped = dc.Friction.of_pair(second, first)
        assert works(swapped) == pytest.approx(works(pair), rel=1e-12)
    for ratio, less in ((2, 0.051), (3, 0.106)):
        first, second = at_nodes((ratio, 1.0)), at_nodes((1.0, ratio))
        part = works(dc.Friction.of_pair(first, second)) / (works(first) + works(second)) * 2
        assert 1 - part.min() == pytest.approx(less, abs=0.001)


def test_one_side_without_friction():
    """Half the coefficients of the other side, and its slip rule; of two such sides none."""
    law = dc.Friction((0.3, 0.1), (0.1, 0.2))
    half = dc.Friction.of_pair(law, 0.0)
    assert half.mu == pytest.approx(law.mu / 2) and half.Q == pytest.approx(law.Q)
    assert dc.Friction.of_pair(0.0, 0.0).frictionless
    assert dc.Friction.of_pair(0.2, 0.4).mu == pytest.approx([0.3, 0.3])


def test_what_makes_no_sense_is_refused():
    """Fields, and angles that are no numbers."""
    with pytest.raises(ValueError, match="pair that"):
        dc.Friction.of_pair(dc.Friction(lambda x: 0.1 + 0 * x[0]), 0.1)
    with pytest.raises(ValueError, match="angle"):
        dc.Friction.of_pair(0.1, 0.1, np.nan)
