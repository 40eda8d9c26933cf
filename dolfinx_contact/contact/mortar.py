# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
r"""Two meshes that meet and do not match: which nodes of the one side a node of the other presses on, and how much.

Facets of both sides are projected on the plane of a facet of the first, the slave, and clipped there; on the common part
stand points of a Gauss rule [Puso, Laursen, CMAME 193, 2004].  From the points of a slave facet ``e`` alone follow

.. math:: M_e = \sum_q w_q N N^T, \quad D_e = diag(\sum_q w_q N), \quad \psi = D_e M_e^{-1} N,

the dual shape functions, which are biorthogonal and sum up to one whatever part of a facet is covered
[Cichosz, Bischoff, CMAME 200, 2011], and with them the coefficients of the contact operator

.. math:: D_{aa} = \sum_e \int_e N_a, \quad m_{ab} = \int \psi_a N_b / D_{aa}

[Wohlmuth, SIAM J. Numer. Anal. 38, 2000].  Arrays in, arrays out; needs NumPy and SciPy alone.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from dolfinx_contact import _kernel
from dolfinx_contact.contact.shapes import monomials

# Points of Gauss's rule in each direction of a triangle or interval: products of quadratic functions are integrated exactly;
# and at most where quadrilaterals are no parallelograms, whose inverse maps are no polynomials, to ten digits.
POINTS, MORE = 4, 10

# Facets of the slave side at a time.
BLOCK = 4096

# Part of a node's area that has to be covered, by the degree: with less, rows sum up to one by terms that are several times larger,
# up to 3 in first order, 7 in second.
COVERED = {1: 0.05, 2: 0.2}

# Area of a node over the largest that is none: of vertices of triangles of second order.
NOTHING = 1e-9

# Cosine of the angle between normals beyond which facets do not face each other.
FACING = -0.1

# Departure from a straight facet, over its size, that is rounding.
STRAIGHT = 1e-12


# Arrays of a ``Side`` with a row for each facet.
BY_FACET = ("nodes", "x", "outwards", "density")


class Side(NamedTuple):
    """Facets of one shape of one side.

    Args:
        nodes: Numbers, ``shape=(m, k)``.
        x: Where they are, ``shape=(m, k, gdim)``.
        outwards: Unit normals, away from the body, ``shape=(m, gdim)``.
        local: Where the nodes are on the reference facet, ``shape=(k, gdim - 1)``.
        corners: Which of them are corners, in the order of a unit interval, triangle or square, ``shape=(c,)``.
        degree: Of the shape functions.
        density: Of the surface measure, at the nodes, ``shape=(m, k)``; None is one.
    """

    nodes: np.ndarray
    x: np.ndarray
    outwards: np.ndarray
    local: np.ndarray
    corners: np.ndarray
    degree: int
    density: np.ndarray | None = None

    def some(self, which: np.ndarray | slice) -> Side:
        """Those of the facets that a slice or a mask names."""
        named = {name: getattr(self, name) for name in BY_FACET}
        rows = {name: array[which] for name, array in named.items() if array is not None}
        return self._replace(**rows)

    def moved(self, x: np.ndarray) -> Side:
        """The facets with nodes elsewhere, ``shape=(m, k, gdim)``; the body stays on its side of them."""
        before, now = (_normals(at[:, _cyclic(self.corners)]) for at in (self.x, x))
        side = np.sign((before * self.outwards).sum(axis=1, keepdims=True))
        return self._replace(x=x, outwards=side * now)

    @property
    def inverse(self) -> np.ndarray:
        """Coefficients of the shape functions, a row for each monomial, ``shape=(k, k)``."""
        return np.linalg.inv(monomials(self.local, len(self.corners), self.degree))


class Pieces(NamedTuple):
    """Straight pieces of facets: whole ones, or quarters of curved ones; corners in cyclic order."""

    x: np.ndarray  # (p, c, gdim)
    local: np.ndarray  # of the corners on the reference facet, (p, c, dim)
    facet: np.ndarray  # (p,)
    normal: np.ndarray  # (p, gdim)
    middle: np.ndarray  # (p, gdim)
    radius: np.ndarray  # (p,)


class Rows(NamedTuple):
    """Coefficients of ``n`` slave nodes.

    Args:
        area: ``D_aa``, of their covered part, ``shape=(n,)``.
        whole: The same, had they been covered wholly, ``shape=(n,)``.
        m: Sparse, ``shape=(n, master nodes)``; rows sum up to one, those of nodes hardly covered are empty.
        covered: Which nodes have a row, ``shape=(n,)``.
    """

    area: np.ndarray
    whole: np.ndarray
    m: sparse.csr_matrix
    covered: np.ndarray


def rows_of(slaves: list[Side], masters: list[Side], nodes: np.ndarray, count: int) -> Rows:
    """The coefficients ``D_aa`` and ``m_ab``.

    Args:
        slaves: All facets that have any of the nodes.
        masters: Those of the other side.
        nodes: Numbers of the slave nodes whose rows are wanted, sorted, ``shape=(n,)``.
        count: Numbers of all nodes of the other side are below.
    """
    area, whole = np.zeros(nodes.size), np.zeros(nodes.size)
    m = sparse.csr_matrix((nodes.size, count))
    opposite = [(side, pieces_of(side)) for side in masters]
    for side in slaves:
        for start in range(0, len(side.nodes), BLOCK):
            block = side.some(slice(start, start + BLOCK))
            pieces, to_nodes = pieces_of(block), _to_nodes(block, nodes)
            whole += to_nodes @ _own_integrals(block, pieces).ravel()
            D, part = _coupled(block, pieces, opposite, count)
            area += to_nodes @ D.ravel()
            m = m + to_nodes @ part
    least = max((COVERED[side.degree] for side in slaves), default=0.0)
    covered = area > np.maximum(least * whole, NOTHING * whole.max(initial=0.0))
    inverse = np.divide(1.0, area, out=np.zeros_like(area), where=covered)
    m = (sparse.diags(inverse) @ m).tocsr()
    m.eliminate_zeros()
    return Rows(area, whole, m, covered)


def _to_nodes(side: Side, nodes: np.ndarray) -> sparse.csr_matrix:
    """Sums at nodes of values at the nodes of facets, ``shape=(n, m k)``."""
    flat = side.nodes.ravel()
    at = np.searchsorted(nodes, flat)
    at[at == nodes.size] = 0
    mine = np.flatnonzero(nodes[at] == flat) if nodes.size else np.zeros(0, dtype=int)
    return sparse.csr_matrix((np.ones(mine.size), (at[mine], mine)), (nodes.size, flat.size))


def _coupled(side: Side, pieces: Pieces, opposite: list, count: int) -> tuple:
    """``D_e`` of slave facets, ``shape=(m, k)``, and ``sum_q w psi N'``, sparse, ``shape=(m k, count)``."""
    (m, k), met = side.nodes.shape, []
    D, M = np.zeros((m, k)), np.zeros((m, k, k))
    for other, others in opposite:
        a, b = candidates(pieces, others)
        of_piece, products, mixed = _integrals(side, pieces, other, others, a, b)
        facet = pieces.facet[a]
        D += _by_facets(facet, of_piece, m)
        M += _by_facets(facet, products, m)
        met.append((facet, mixed, other.nodes[others.facet[b]]))
    dual = D[:, :, None] * np.linalg.pinv(M, 1e-13, hermitian=True)
    coupling = sparse.csr_matrix((m * k, count))
    for facet, mixed, columns in met:
        values = dual[facet] @ mixed
        rows = (k * facet[:, None] + np.arange(k))[:, :, None]
        at = [np.broadcast_to(index, values.shape).ravel() for index in (rows, columns[:, None])]
        coupling = coupling + sparse.csr_matrix((values.ravel(), tuple(at)), coupling.shape)
    return D, coupling


def _by_facets(facet: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Sums over the pairs of each facet, ``shape=(count, ...)``."""
    pairs = len(facet)
    sums = sparse.csr_matrix((np.ones(pairs), (facet, np.arange(pairs))), (count, pairs))
    return (sums @ values.reshape(pairs, -1)).reshape(count, *values.shape[1:])


def _own_integrals(side: Side, pieces: Pieces) -> np.ndarray:
    """Integrals of the shape functions over facets, ``shape=(m, k)``."""
    every = np.arange(len(pieces.x))
    whole, *_ = _integrals(side, pieces, side, pieces, every, every)
    return _by_facets(pieces.facet, whole, len(side.nodes))


# -- pieces of facets --------------------------------------------------------------------------


def pieces_of(side: Side) -> Pieces:
    """Straight pieces of facets: those of second order in quarters where any is curved."""
    cyclic, m = _cyclic(side.corners), len(side.nodes)
    hats = monomials(side.local, len(side.corners), 1) @ np.linalg.inv(
        monomials(side.local[side.corners], len(side.corners), 1)
    )
    straight = hats @ side.x[:, side.corners]
    size = np.abs(side.x - side.x[:, :1]).max(initial=0.0)
    curved = side.degree > 1 and np.abs(side.x - straight).max(initial=0.0) > STRAIGHT * size
    parts = _quarters(side.local, side.corners) if curved else [cyclic]
    x = np.concatenate([side.x[:, part] for part in parts])
    local = np.concatenate([np.broadcast_to(side.local[part], (m, *side.local[part].shape)) for part in parts])  # fmt: skip
    facet = np.tile(np.arange(m), len(parts))
    middle = x.mean(axis=1)
    radius = np.linalg.norm(x - middle[:, None], axis=2).max(axis=1, initial=0.0)
    normal = _normals(x)
    normal *= np.where((normal * side.outwards[facet]).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    return Pieces(x, local, facet, normal, middle, radius)


def _cyclic(corners: np.ndarray) -> np.ndarray:
    """Corners of a unit square in cyclic order."""
    return corners[[0, 1, 3, 2]] if len(corners) == 4 else corners


def _quarters(local: np.ndarray, corners: np.ndarray) -> list[np.ndarray]:
    """Nodes of the halves of an interval, the quarters of a triangle or square, in cyclic order."""

    def at(*points: Any) -> np.ndarray:
        return np.array([np.abs(local - point).sum(axis=1).argmin() for point in points])

    if local.shape[1] == 1:
        return [at([0.0], [0.5]), at([0.5], [1.0])]
    h = 0.5
    if len(corners) == 3:
        return [
            at((0, 0), (h, 0), (0, h)), at((h, 0), (1, 0), (h, h)),
            at((0, h), (h, h), (0, 1)), at((h, h), (0, h), (h, 0)),
        ]  # fmt: skip
    square = [(0, 0), (h, 0), (h, h), (0, h)]
    return [at(*[(x + i, y + j) for x, y in square]) for i in (0, h) for j in (0, h)]


def _normals(x: np.ndarray) -> np.ndarray:
    """Unit normals of intervals, triangles and quadrilaterals, ``shape=(p, gdim)``."""
    if x.shape[2] == 2:
        along = x[:, 1] - x[:, 0]
        normal = np.column_stack((along[:, 1], -along[:, 0]))
    elif x.shape[1] == 3:
        normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    else:
        normal = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.divide(normal, length, np.zeros_like(normal), where=length > 0)


def candidates(pieces: Pieces, others: Pieces) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of pieces that may have a common part: near each other, as near as any, and facing."""
    if not len(pieces.x) or not len(others.x):
        return np.zeros((2, 0), dtype=int)
    tree = cKDTree(others.middle)
    nearest, _ = tree.query(pieces.middle)
    near = tree.query_ball_point(
        pieces.middle, 1.01 * (nearest + pieces.radius + 2 * others.radius.max())
    )
    a = np.repeat(np.arange(len(near)), [len(found) for found in near])
    b = np.concatenate([np.asarray(found, dtype=int) for found in near])
    facing = (pieces.normal[a] * others.normal[b]).sum(axis=1) < FACING
    return a[facing], b[facing]


# -- integrals over common parts ---------------------------------------------------------------


def _integrals(
    side: Side, pieces: Pieces, other: Side, others: Pieces, a: np.ndarray, b: np.ndarray
) -> tuple:
    """Integrals over the common parts of pairs of pieces, in the plane of the first: of shape functions, of products, and with the other side's."""
    axes, origin = _axes(pieces.normal)[a], pieces.middle[a][:, None]
    axes = axes.transpose(0, 2, 1)
    one, two = ((x - origin) @ axes for x in (pieces.x[a], others.x[b]))
    at, weight = _gauss(max(_points(one), _points(two)))
    here = one, pieces.local[a], side.inverse, side.degree
    there = two, others.local[b], other.inverse, other.degree
    density = np.zeros(0) if side.density is None else side.density[pieces.facet[a]]
    return _kernel.common_integrals(*here, *there, at, weight, density)


def _points(corners: np.ndarray) -> int:
    """Points of a rule for pieces with these corners: the less they are parallelograms the more, for twelve digits."""
    if corners.shape[1] < 4 or not len(corners):
        return POINTS
    bent = np.abs(corners[:, 0] - corners[:, 1] + corners[:, 2] - corners[:, 3]).max(axis=1)
    bent = (bent / np.ptp(corners, axis=1).max(axis=1)).max()
    if bent <= STRAIGHT:
        return POINTS
    return int(np.clip(np.ceil(2.5 + 6 / np.log10(1 / min(bent, 0.5))), POINTS, MORE))


def _axes(normal: np.ndarray) -> np.ndarray:
    """Unit vectors across unit vectors, ``shape=(p, gdim - 1, gdim)``."""
    if normal.shape[1] == 2:
        return np.stack((normal[:, 1], -normal[:, 0]), axis=-1)[:, None]
    first = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first -= (first * normal).sum(axis=1, keepdims=True) * normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack((first, np.cross(normal, first)), axis=1)


@lru_cache
def _gauss(points: int) -> tuple[np.ndarray, np.ndarray]:
    at, weight = np.polynomial.legendre.leggauss(points)
    return 0.5 + 0.5 * at, 0.5 * weight
