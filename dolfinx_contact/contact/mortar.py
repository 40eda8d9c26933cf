# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
r"""Two meshes that meet and do not match: which nodes of the one side a node of the other presses on, and how much.

Facets of both sides are projected on the plane of a facet of the first, the slave, and clipped there; on the common part
stand points of a Gauss rule [Puso, Laursen, CMAME 193, 2004].  From the points of a slave facet ``e`` alone follow

.. math:: M_e = \sum_q w_q N N^T, \quad D_e = diag(\sum_q w_q N), \quad \psi = D_e M_e^{-1} N,

the dual shape functions, which are biorthogonal and sum up to one whatever part of a facet is covered
[Cichosz, Bischoff, CMAME 200, 2011], and with them the coefficients of the contact operator

.. math:: D_{aa} = \sum_e \int_e N_a, \quad m_{ab} = \int \psi_a N_b / D_{aa}

[Wohlmuth, SIAM J. Numer. Anal. 38, 2000].  Arrays in, arrays out; search, clipping, integrals and sums are in the kernel, ``mortar/rows.h``.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from dolfinx_contact import _kernel
from dolfinx_contact.contact.shapes import monomials

# Points of Gauss's rules in each direction of a triangle or interval: as many as integrate products of shape functions exactly, and
# more where quadrilaterals are no parallelograms, whose inverse maps are no polynomials.
GAUSS_POINTS = 2
MORE_GAUSS_POINTS = 10

# Part of a node's area that has to be covered, by the degree: with less, rows sum up to one by terms that are several times larger,
# up to 3 in first order, 7 in second.
LEAST_COVERED = {1: 0.05, 2: 0.2}

# Area of a node over the largest that is none: of vertices of triangles of second order.
NO_AREA = 1e-9

# Departure from a straight facet, over its size, that is rounding.
STRAIGHT_FACET = 1e-12


# Arrays of a ``Side`` with a row for each facet.
BY_FACET = ("nodes", "x", "outwards", "density")


class Side(NamedTuple):
    """Facets of one shape of one side.

    Args:
        nodes: Numbers, negative is none, ``shape=(m, k)``.
        x: Where they are, ``shape=(m, k, gdim)``.
        outwards: Normals, away from the body, ``shape=(m, gdim)``; of facets that have ``moved`` as long as these are large.
        local: Where the nodes are on the reference facet, ``shape=(k, gdim - 1)``.
        corners: Which of them are corners, in the order of a unit interval, triangle or square, ``shape=(c,)``.
        degree: Of the shape functions.
        inverse: Their coefficients, a row for each monomial, ``shape=(k, k)``.
        density: Of the surface measure, at the nodes, ``shape=(m, k)``; None is one.
    """

    nodes: np.ndarray
    x: np.ndarray
    outwards: np.ndarray
    local: np.ndarray
    corners: np.ndarray
    degree: int
    inverse: np.ndarray
    density: np.ndarray | None = None

    def some(self, which: np.ndarray | slice) -> Side:
        """Those of the facets that a slice or a mask names."""
        named = {name: getattr(self, name) for name in BY_FACET}
        rows = {name: array[which] for name, array in named.items() if array is not None}
        return self._replace(**rows)

    def moved(self, x: np.ndarray, inside_out: np.ndarray) -> Side:
        """The facets with nodes elsewhere, ``shape=(m, k, gdim)``; the body stays on its side of them, see ``inside_out``."""
        return self._replace(x=x, outwards=inside_out * self._areas(x))

    @property
    def inside_out(self) -> np.ndarray:
        """Signs, negative where the corners in their order turn about the inward normal, ``shape=(m, 1)``."""
        return np.sign((self._areas(self.x) * self.outwards).sum(axis=1, keepdims=True))

    def _areas(self, x: np.ndarray) -> np.ndarray:
        """Areas times normals of facets with these nodes."""
        x = x[:, _cyclic(self.corners)]
        one, other = x[:, 1] - x[:, 0], x[:, -1] - x[:, 0]
        if x.shape[2] == 2:
            return np.column_stack((one[:, 1], -one[:, 0]))
        if x.shape[1] == 4:
            one, other = x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]
        return 0.5 * np.cross(one, other)


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


def rows_of(slaves: list[Side], masters: list[Side], own: int, count: int) -> Rows:
    """The coefficients ``D_aa`` and ``m_ab``.

    Args:
        slaves: All facets that have any of the nodes whose rows are wanted; others have no number.
        masters: Those of the other side.
        own, count: Numbers of all slave nodes, and of all nodes of the other side, are below.
    """
    sides = ([_for_kernel(side) for side in body] for body in (slaves, masters))
    area, whole, *csr = _kernel.mortar_rows(*sides, own, _rules())
    m = sparse.csr_matrix((own, count))
    m.data, m.indices, m.indptr = csr  # in order: nothing to check
    least = max((LEAST_COVERED[side.degree] for side in slaves), default=0.0)
    covered = area > np.maximum(least * whole, NO_AREA * whole.max(initial=0.0))
    inverse = np.divide(1.0, area, out=np.zeros_like(area), where=covered)
    m.data *= np.repeat(inverse, np.diff(m.indptr))
    m.eliminate_zeros()
    return Rows(area, whole, m, covered)


def at_nodes(side: Side, count: int) -> sparse.csr_matrix:
    """Sums at numbered nodes of what the facets that have them carry, ``shape=(count, m)``."""
    facet, corner = np.nonzero(side.nodes >= 0)
    return sparse.csr_matrix(
        (np.ones(facet.size), (side.nodes[facet, corner], facet)), (count, len(side.nodes))
    )


def _for_kernel(side: Side) -> tuple:
    """Facets as the kernel takes them."""
    density = np.zeros(0) if side.density is None else side.density
    return (
        side.x,
        side.outwards,
        side.local,
        side.inverse,
        density,
        side.nodes,
        _cuts(side),
        side.degree,
    )


@lru_cache
def _rules() -> list[tuple[np.ndarray, np.ndarray]]:
    """Points and weights of Gauss's rules on the unit interval."""
    rules = [
        np.polynomial.legendre.leggauss(points)
        for points in range(GAUSS_POINTS, MORE_GAUSS_POINTS + 1)
    ]
    return [(0.5 + 0.5 * at, 0.5 * weights) for at, weights in rules]


# -- pieces of facets --------------------------------------------------------------------------


def _cuts(side: Side) -> np.ndarray:
    """Nodes at the corners of straight pieces, in cyclic order, ``shape=(parts, c)``: facets of second order in quarters where any is curved."""
    corners = side.corners
    if side.degree == 1:
        return _cyclic(corners)[None]
    hats = monomials(side.local, len(corners), 1) @ np.linalg.inv(
        monomials(side.local[corners], len(corners), 1)
    )
    size = np.abs(side.x - side.x[:, :1]).max(initial=0.0)
    curved = np.abs(side.x - hats @ side.x[:, corners]).max(initial=0.0) > STRAIGHT_FACET * size
    return np.array(_quarters(side.local, corners) if curved else [_cyclic(corners)])


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
            at((0, 0), (h, 0), (0, h)),
            at((h, 0), (1, 0), (h, h)),
            at((0, h), (h, h), (0, 1)),
            at((h, h), (0, h), (h, 0)),
        ]
    square = [(0, 0), (h, 0), (h, h), (0, h)]
    return [at(*[(x + i, y + j) for x, y in square]) for i in (0, h) for j in (0, h)]
