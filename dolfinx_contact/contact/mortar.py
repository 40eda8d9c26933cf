# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
r"""Dual mortar coefficients between the nodes of two non-matching contact surfaces.

Each master facet is projected onto the plane of a slave facet and clipped there; a Gauss rule
integrates over the common part [Puso, Laursen, CMAME 193, 2004].  The integration points of a slave
facet ``e`` give its dual shape functions

.. math:: M_e = \sum_q w_q N N^T, \quad D_e = diag(\sum_q w_q N), \quad \psi = D_e M_e^{-1} N,

which are biorthogonal and sum up to one even if the facet is only partly covered
[Cichosz, Bischoff, CMAME 200, 2011].  With them, the coefficients of the contact operator are

.. math:: D_{aa} = \sum_e \int_e N_a, \quad m_{ab} = \int \psi_a N_b / D_{aa}

[Wohlmuth, SIAM J. Numer. Anal. 38, 2000].  Input and output are NumPy arrays.  The compiled kernel
(``mortar/rows.h``) does the search, clipping, integration and summation.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from dolfinx_contact import _kernel
from dolfinx_contact.contact.shapes import monomials

# Smallest and largest number of Gauss points per direction of a triangle or interval.  The smallest
# integrates products of linear shape functions exactly.  More are used for quadrilaterals that are
# not parallelograms, whose inverse maps are not polynomials.
GAUSS_POINTS = 2
MORE_GAUSS_POINTS = 10

# Smallest covered fraction of a node's area, by polynomial degree.  With less, coefficients of a
# row still sum up to one, but single ones are several times larger: up to 3 for degree 1, 7 for 2.
LEAST_COVERED = {1: 0.05, 2: 0.2}

# Nodal area, relative to the largest one, that counts as zero.  The vertices of second-order
# triangles have zero area up to rounding.
NO_AREA = 1e-9

# Deviation from a straight facet, relative to its size, that may be rounding.
STRAIGHT_FACET = 1e-12

# Fields of ``Side`` with one row per facet.
BY_FACET = ("nodes", "x", "outwards", "density")


class Side(NamedTuple):
    """``m`` facets of the same shape, with ``k`` nodes each, on one contact side.

    Args:
        nodes: Node numbers, ``shape=(m, k)``; -1 for nodes that are not used.
        x: Positions of the nodes, ``shape=(m, k, gdim)``.
        outwards: Outward normals, ``shape=(m, gdim)``: unit vectors, or with the facet area as
            length after ``moved``.
        local: Positions of the nodes on the reference facet, ``shape=(k, gdim - 1)``.
        corners: Indices of the nodes that are corners, in the order of a unit interval, triangle or
            square, ``shape=(c,)``.
        degree: Polynomial degree of the shape functions.
        inverse: Coefficients of the shape functions, one row per monomial, ``shape=(k, k)``.
        density: Weight of the surface measure at the nodes, ``shape=(m, k)``; None means one.
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
        """The facets selected by a slice, mask or index array."""
        named = {name: getattr(self, name) for name in BY_FACET}
        rows = {name: array[which] for name, array in named.items() if array is not None}
        return self._replace(**rows)

    def moved(self, x: np.ndarray, inside_out: np.ndarray) -> Side:
        """The facets at new nodal positions; normals have the facet area as length.

        Args:
            x: New positions, ``shape=(m, k, gdim)``.
            inside_out: Orientations of the facets, as the property of this name returns them.
        """
        return self._replace(x=x, outwards=inside_out * self._areas(x))

    @property
    def inside_out(self) -> np.ndarray:
        """Facet orientations, ``shape=(m, 1)``: -1 if the corners circle the inward normal."""
        return np.sign((self._areas(self.x) * self.outwards).sum(axis=1, keepdims=True))

    def _areas(self, x: np.ndarray) -> np.ndarray:
        """Area times unit normal of facets with nodes at ``x``, ``shape=(m, gdim)``."""
        x = x[:, _cyclic(self.corners)]
        one, other = x[:, 1] - x[:, 0], x[:, -1] - x[:, 0]
        if x.shape[2] == 2:
            return np.column_stack((one[:, 1], -one[:, 0]))
        if x.shape[1] == 4:
            one, other = x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]
        return 0.5 * np.cross(one, other)


class Rows(NamedTuple):
    """Mortar coefficients of ``n`` slave nodes.

    Args:
        area: Nodal areas ``D_aa`` of the covered part of the slave facets, ``shape=(n,)``.
        whole: Nodal areas of the entire slave facets, ``shape=(n,)``.
        m: Coefficients ``m_ab``, sparse, ``shape=(n, master nodes)``.  Each row sums up to one, or
            is empty if the node is not covered enough.
        covered: Whether each node has a row, ``shape=(n,)``, bool.
    """

    area: np.ndarray
    whole: np.ndarray
    m: sparse.csr_matrix
    covered: np.ndarray


def rows_of(slaves: list[Side], masters: list[Side], own: int, count: int) -> Rows:
    """Mortar coefficients ``D_aa`` and ``m_ab`` of the slave nodes ``0 ... own - 1``.

    Args:
        slaves: All slave facets with at least one of these nodes; other nodes are numbered -1.
        masters: All master facets.
        own: Number of slave nodes.
        count: Number of master nodes.
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
    """Incidence matrix that sums facet values at nodes, sparse, ``shape=(count, m)``.

    Entry (a, e) is one if facet e has node a.
    """
    facet, corner = np.nonzero(side.nodes >= 0)
    return sparse.csr_matrix(
        (np.ones(facet.size), (side.nodes[facet, corner], facet)), (count, len(side.nodes))
    )


def _for_kernel(side: Side) -> tuple:
    """Arguments of the compiled kernel for the facets of ``side``."""
    density = np.zeros(0) if side.density is None else side.density
    return (
        side.x,
        side.outwards,
        side.local,
        side.inverse,
        density,
        side.nodes,
        _straight_parts(side),
        side.degree,
    )


@lru_cache
def _rules() -> list[tuple[np.ndarray, np.ndarray]]:
    """Points and weights of all Gauss rules on the unit interval, smallest rule first."""
    rules = [
        np.polynomial.legendre.leggauss(points)
        for points in range(GAUSS_POINTS, MORE_GAUSS_POINTS + 1)
    ]
    return [(0.5 + 0.5 * at, 0.5 * weights) for at, weights in rules]


# -- pieces of facets --------------------------------------------------------------------------


def _straight_parts(side: Side) -> np.ndarray:
    """Node indices at the corners of straight parts of each facet, cyclic, ``shape=(parts, c)``.

    Second-order facets are divided into halves (2-D) or quarters (3-D) if any of them is curved.
    """
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
    """Corner indices in cyclic order; those of a square are permuted, others unchanged."""
    return corners[[0, 1, 3, 2]] if len(corners) == 4 else corners


def _quarters(local: np.ndarray, corners: np.ndarray) -> list[np.ndarray]:
    """Corner nodes, cyclic, of the halves or quarters of a second-order facet."""

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
