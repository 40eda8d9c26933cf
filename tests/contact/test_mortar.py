# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Coefficients of two meshes that meet: sums, linear fields and resultants are exact whatever meshes, overlap and scale are."""

import numpy as np
import pytest

from dolfinx_contact import _kernel
from dolfinx_contact.contact.mortar import Side, rows_of
from dolfinx_contact.contact.shapes import monomials

UNIT = {
    ("line", 1): [(0,), (1,)],
    ("line", 2): [(0,), (1,), (0.5,)],
    ("triangle", 1): [(0, 0), (1, 0), (0, 1)],
    ("triangle", 2): [(0, 0), (1, 0), (0, 1), (0.5, 0.5), (0, 0.5), (0.5, 0)],
    ("square", 1): [(0, 0), (1, 0), (0, 1), (1, 1)],
    ("square", 2): [(i / 2, j / 2) for j in range(3) for i in range(3)],
}
CORNERS = {"line": [0, 1], "triangle": [0, 1, 2], "square": [0, 1, 2, 3]}
KINDS = list(UNIT)


def side(kind, cells, up, low=0.0, high=1.0, bend=0.0, scale=1.0):
    """An interval or square divided into facets, bent within itself, whose body is below it or above."""
    shape, degree = kind
    local = np.array(UNIT[kind], dtype=float)
    corners = np.array(CORNERS[shape])
    if kind == ("square", 2):
        corners = np.array([0, 2, 6, 8])
    dim = local.shape[1]
    grids = np.meshgrid(*[np.arange(n) for n in cells], indexing="ij")
    first = np.stack([g.ravel() for g in grids], axis=-1)
    places = first[:, None] + local
    if shape == "triangle":
        places = np.concatenate((places, first[:, None] + 1 - local))
    at = low + (high - low) * places / np.array(cells)
    number, nodes = np.unique(np.round(at.reshape(-1, dim), 12), axis=0, return_inverse=True)
    x = number + bend * np.prod(np.sin(np.pi * number), axis=1, keepdims=True)
    if degree == 2:  # facets stay straight
        hats = np.array([[1 - s.sum(), *s] for s in local]) if shape == "triangle" else None
        if shape == "line":
            hats = np.column_stack((1 - local[:, 0], local[:, 0]))
        if shape == "square":
            s, t = local.T
            hats = np.column_stack(((1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t))
        at = hats @ x[nodes.reshape(len(places), -1)][:, corners]
        x[nodes] = at.reshape(-1, dim)
    x = scale * np.column_stack((x, np.zeros(len(x))))
    nodes = nodes.reshape(len(places), -1)
    outwards = np.tile([*[0.0] * dim, 1.0 if up else -1.0], (len(nodes), 1))
    inverse = np.linalg.inv(monomials(local, len(corners), degree))
    return Side(nodes, x[nodes], outwards, local, corners, degree, inverse), x


def meeting(kind, other, cells=(3, 2), others=(2, 3), scale=1.0, bend=0.05, **where):
    dim = 1 if kind[0] == "line" else 2
    slave, x = side(kind, cells[:dim], False, bend=bend, scale=scale)
    master, y = side(other, others[:dim], True, bend=-bend, scale=scale, **where)
    return slave, x, master, y


PAIRS = [(a, b) for a in KINDS for b in KINDS if (a[0] == "line") == (b[0] == "line")]
NAMES = ["-".join(f"{s}{d}" for s, d in pair) for pair in PAIRS]


@pytest.mark.parametrize("pair", PAIRS, ids=NAMES)
def test_rows_carry_over_linear_fields(pair):
    """Rows sum up to one, and a linear field on the one side has its own values on the other: flat meshes do not slip or open."""
    slave, x, master, y = meeting(*pair)
    squares = any(shape == "square" for shape, _ in pair)  # whose inverse maps are no polynomials
    rows = rows_of([slave], [master], len(x), len(y))
    some = rows.covered
    assert some.sum() > len(x) / 2
    tolerance = 1e-9 if squares else 1e-12
    assert np.asarray(rows.m.sum(axis=1)).ravel()[some] == pytest.approx(1.0, abs=1e-12)
    field = np.array([0.3, -1.7, 0.0])[: x.shape[1]]
    integral = rows.area[some] * ((rows.m @ (y @ field)) - x @ field)[some]
    if pair[0] != ("triangle", 2) and pair[0][1] == 1:
        assert np.abs(integral).max() < tolerance
    assert abs(integral.sum()) < tolerance  # moments of an even pressure are the same on both sides


@pytest.mark.parametrize("pair", PAIRS, ids=NAMES)
def test_an_even_pressure_is_the_same_on_both_sides(pair):
    """Forces ``D p`` on the one side are the consistent ones of that pressure on the other: what makes a patch test exact."""
    slave, x, master, y = meeting(*pair)
    squares = any(shape == "square" for shape, _ in pair)
    rows = rows_of([slave], [master], len(x), len(y))
    own = rows_of([master], [slave], len(y), len(x)).whole
    kept = np.where(rows.covered, rows.area, 0.0)
    assert rows.area == pytest.approx(rows.whole, abs=1e-12)
    assert rows.m.T @ kept == pytest.approx(own, abs=1e-9 if squares else 1e-12)


@pytest.mark.parametrize("kind", KINDS, ids=[f"{s}{d}" for s, d in KINDS])
def test_part_of_a_surface_is_covered(kind):
    """Where the other side ends within facets, areas are those of the overlap, resultant and moment those of the pressure there."""
    slave, x, master, y = meeting(kind, kind, low=0.3, high=1.4, bend=0.0)
    rows = rows_of([slave], [master], len(x), len(y))
    dim = x.shape[1] - 1
    assert rows.area.sum() == pytest.approx(0.7**dim, rel=1e-12)
    assert rows.whole.sum() == pytest.approx(1.0, rel=1e-12)
    carried = np.where(rows.covered, rows.area, 0.0)
    there = rows.m.T @ carried
    assert there.sum() == pytest.approx(carried.sum(), rel=1e-12)
    if rows.covered.all() or kind == ("line", 1):
        middle = (there @ y)[:dim] / there.sum()
        assert middle == pytest.approx(0.65, abs=0.05)


def test_slivers_are_left_out():
    """A node next to nothing of whose facets is covered has no row, and all others are finite."""
    slave, x, master, y = meeting(("square", 1), ("square", 1), low=1 / 3 - 1e-9, high=1.5, bend=0)
    rows = rows_of([slave], [master], len(x), len(y))
    assert not rows.covered.all() and np.isfinite(rows.m.data).all()
    assert np.abs(rows.m.data).max() < 3.0
    alone = rows_of([slave], [], len(x), len(y))
    assert not alone.covered.any() and alone.m.nnz == 0
    none = rows_of([], [master], 0, len(y))
    assert none.area.size == 0


@pytest.mark.parametrize("scale", [1e-12, 1e12])
@pytest.mark.parametrize("kind", KINDS, ids=[f"{s}{d}" for s, d in KINDS])
def test_units_do_not_matter(kind, scale):
    """In other units of length coefficients are the same to rounding."""
    one, other = (rows_of([a], [b], len(x), len(y)) for a, x, b, y in (meeting(kind, kind, scale=s) for s in (1.0, scale)))  # fmt: skip
    assert np.abs((one.m - other.m).toarray()).max() < 1e-9
    factor = scale ** (1 if kind[0] == "line" else 2)
    assert other.area / factor == pytest.approx(one.area, rel=1e-9, abs=1e-12)


def test_clipping_against_areas_known():
    """Squares shifted by random ways have the product of their overlaps in common; turned by 45 degrees a closed form; apart nothing."""
    rng = np.random.default_rng(5)
    square = np.array([[0.0, 0.0], [1, 0], [1, 1], [0, 1]])
    ways = np.concatenate((rng.uniform(-1.2, 1.2, (200, 2)), [[0, 0], [1, 0], [1, 1], [0.5, 0]]))
    for by in (square, square[::-1]):
        corners, counts = _kernel.clip(np.tile(square, (len(ways), 1, 1)), by + ways[:, None])
        area = [shoelace(c[:n]) for c, n in zip(corners, counts)]
        expected = np.maximum(1 - np.abs(ways), 0).prod(axis=1)
        assert area == pytest.approx(expected, abs=1e-14)
    turn = np.array([[1, -1], [1, 1]]) / np.sqrt(2)
    corners, counts = _kernel.clip((square - 0.5)[None], ((square - 0.5) @ turn)[None])
    assert shoelace(corners[0, : counts[0]]) == pytest.approx(2 * (np.sqrt(2) - 1), abs=1e-14)
    triangle = square[None, :3]
    corners, counts = _kernel.clip(triangle, square[None])
    assert shoelace(corners[0, : counts[0]]) == pytest.approx(0.5)
    with pytest.raises(ValueError, match="shape"):
        _kernel.clip(triangle, square)


def shoelace(corners) -> float:
    x, y = np.asarray(corners).reshape(-1, 2).T
    return 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
