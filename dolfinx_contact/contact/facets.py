# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Shape functions of contact facets, and deviation of facets from a smooth body.

Contact conditions hold at the nodes only.  Between nodes, the shape functions of the displacements
interpolate a facet, so a rigid surface may be nearer or farther than the nodal gaps indicate.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from dolfinx import fem

from dolfinx_contact import compat
from dolfinx_contact.contact.shapes import monomials

if TYPE_CHECKING:
    from dolfinx_contact.contact.displacements import Displacements

# Sampling points per direction of a facet.  Gauss points, as no periodic profile has the same phase
# at all of them.
GAUSS_POINTS = 5

# An edge is sharp if the normals of a facet and of the body at a vertex differ by more than 20
# degrees, that is, if the cosine of their angle is below this value.
SHARP_EDGE = np.cos(np.deg2rad(20.0))


class Facets(NamedTuple):
    """This rank's ``m`` facets of one shape, with ``k`` nodes and ``v`` vertices each."""

    nodes: np.ndarray  # local node indices, (m, k)
    x: np.ndarray  # positions of the nodes, (m, k, gdim)
    local: np.ndarray  # positions of the nodes on the reference facet, (k, dim)
    vertices: np.ndarray  # indices of the nodes that are vertices, (v,)
    dim: int  # topological dimension of a facet
    degree: int  # polynomial degree of the shape functions
    inverse: np.ndarray  # inverse of the matrix of monomials at the nodes, (k, k)
    at_nodes: np.ndarray  # linear shape functions of the vertices at the nodes, (k, v)
    bend: np.ndarray  # (n_b - n_a) . (x_b - x_a) of normals and positions of vertices, (m, v, v)
    # Twice the smaller of the terms n_b . (x_b - x_a) and -n_a . (x_b - x_a), (m, v, v); zero if
    # their signs differ, as beside an edge
    curve: np.ndarray
    sharp: np.ndarray  # whether a vertex is on a sharp edge, (m,)
    size: np.ndarray  # diameters, (m,)
    outwards: np.ndarray  # outward unit normals, (m, gdim)

    def shapes(self, at: np.ndarray) -> np.ndarray:
        """Values of the shape functions, ``shape=(..., k)``.

        Args:
            at: Points of the unit square or interval, ``shape=(..., dim)``; for triangles, the
                unit square is mapped onto the unit triangle.
        """
        return monomials(self._local(at), len(self.vertices), self.degree) @ self.inverse

    def hats(self, at: np.ndarray) -> np.ndarray:
        """Values of the linear shape functions of the vertices, ``shape=(..., v)``.

        Args:
            at: Points of the unit square or interval, as in ``shapes``, ``shape=(..., dim)``.
        """
        corners = _corners(self.dim, len(self.vertices))
        inverse = np.linalg.inv(monomials(corners, len(corners), 1))
        return monomials(self._local(at), len(corners), 1) @ inverse

    def sag_at_nodes(self) -> np.ndarray:
        """Distance of a smooth body from the facets at the nodes, ``shape=(m, k)``, length.

        As ``sag``, but for round parts of the body: zero next to edges, blunt or sharp.
        """
        hats = self.at_nodes
        return 0.25 * ((hats @ self.curve) * hats).sum(axis=-1) * ~self.sharp[:, None]

    def some(self, which: np.ndarray) -> Facets:
        """The facets selected by a mask or indices."""
        rows = ("nodes", "x", "bend", "curve", "sharp", "size", "outwards")
        return self._replace(**{name: getattr(self, name)[which] for name in rows})

    def _local(self, at: np.ndarray) -> np.ndarray:
        """Points of the reference facet; a triangle is mapped from the unit square."""
        if self.dim == 1 or len(self.vertices) == 4:
            return at
        return np.stack((at[..., 0], at[..., 1] * (1.0 - at[..., 0])), axis=-1)

    def sag(self, hats: np.ndarray) -> np.ndarray:
        """Distance by which a smooth body with the vertex normals protrudes from facets.

        It is ``sum_{a<b} w_a w_b (n_b - n_a) . (x_b - x_a) / 2``; for an arc of radius R and chord
        h, this is ``h^2 / 8R`` in the middle.

        Args:
            hats: Linear shape functions ``w`` of the vertices, ``shape=(q, v)`` or ``(m, q, v)``.

        Returns:
            ``shape=(m, q)``, positive outwards.
        """
        return 0.25 * ((hats @ self.bend) * hats).sum(axis=-1)


def facets_of(displacements: Displacements, facets: np.ndarray) -> list[Facets]:
    """Geometry of the facets that this rank owns, grouped by shape.  Collective.

    Args:
        displacements: Nodes and degrees of freedom of the displacement space.
        facets: Local facet indices; those of other ranks are ignored.
    """
    V, topology = displacements.V, displacements.V.mesh.topology
    fdim = topology.dim - 1
    for dims in ((fdim, fdim + 1), (fdim + 1, fdim), (fdim + 1, 0)):
        topology.create_connectivity(*dims)
    mine = np.unique(facets[facets < topology.index_map(fdim).size_local])
    cell_of, within = topology.connectivity(fdim, fdim + 1), topology.connectivity(fdim + 1, fdim)
    cells = np.array([cell_of.links(facet)[0] for facet in mine], dtype=int)
    places = [list(within.links(cell)).index(facet) for cell, facet in zip(cells, mine)]
    layout, nodes, points = (
        V.dofmap.dof_layout,
        compat.cell_nodes(V),
        compat.interpolation_points(V),
    )
    x, shapes = V.tabulate_dof_coordinates()[:, : fdim + 1], {}
    count = topology.connectivity(fdim + 1, 0).links(0).size if mine.size else 0
    tips = np.array([layout.entity_dofs(0, vertex)[0] for vertex in range(count)])
    for place in sorted(set(places)):
        closure = np.array(layout.entity_closure_dofs(fdim, place))
        same = cells[np.array(places) == place]
        corners = np.flatnonzero(np.isin(closure, tips))
        local = _along(points[closure], points[closure[corners]])
        key = (len(corners), len(closure), corners.tobytes(), np.round(local, 9).tobytes())
        shapes.setdefault(key, (corners, local, [], []))
        shapes[key][2].append(nodes[same][:, closure])
        shapes[key][3].append(x[nodes[same]].mean(axis=1))
    groups = [(c, at, np.concatenate(n), np.concatenate(m)) for c, at, n, m in shapes.values()]
    return _with_normals(V, x, groups, fdim)


def _with_normals(V: fem.FunctionSpace, x: np.ndarray, groups: list, fdim: int) -> list[Facets]:
    normals, total = [], fem.Function(V)
    sums = total.x.array.reshape(-1, fdim + 1)
    for corners, _, nodes, middle in groups:
        at = x[nodes[:, corners]]
        outwards = _outwards(at, middle)
        outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
        normals.append(outwards)
        outwards = (
            outwards / _diameters(at)[:, None]
        )  # weight 1 / size: on an arc, the normal is nearer to the shorter chord's
        for corner in corners:
            np.add.at(sums, nodes[:, corner], outwards)
    compat.add_to_owners(total.x)
    total.x.scatter_forward()
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    smooth = np.divide(sums, length, np.zeros_like(sums), where=length > 0)
    found, degree = [], compat.lagrange_degree(V)
    for (corners, local, nodes, _), own in zip(groups, normals):
        at, n = x[nodes[:, corners]], smooth[nodes[:, corners]]
        ends = (n[:, None] * (at[:, None] - at[:, :, None])).sum(axis=-1)
        other = ends.transpose(0, 2, 1)
        both = np.where(ends * other > 0.0, np.minimum(np.abs(ends), np.abs(other)), 0.0)
        flat = monomials(_corners(fdim, len(corners)), len(corners), 1)
        found.append(
            Facets(
                nodes,
                x[nodes],
                local,
                corners,
                fdim,
                degree,
                np.linalg.inv(monomials(local, len(corners), degree)),
                monomials(local, len(corners), 1) @ np.linalg.inv(flat),
                ends + other,
                2.0 * np.sign(ends) * both,
                (np.einsum("mi,mvi->mv", own, n) < SHARP_EDGE).any(axis=1),
                _diameters(at),
                own,
            )
        )
    return found


def _diameters(corners: np.ndarray) -> np.ndarray:
    return np.linalg.norm(corners[:, None] - corners[:, :, None], axis=-1).max(axis=(1, 2))


def _outwards(corners: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Outward normals of facets, ``shape=(m, gdim)``, with a length proportional to the facet area.

    Args:
        corners: Positions of the vertices, ``shape=(m, v, gdim)``.
        middle: Midpoints of the adjacent cells, ``shape=(m, gdim)``.
    """
    first = corners[:, 1] - corners[:, 0]
    if corners.shape[2] == 2:
        normal = np.column_stack((first[:, 1], -first[:, 0]))
    elif corners.shape[1] == 3:
        normal = np.cross(first, corners[:, 2] - corners[:, 0])
    else:
        normal = np.cross(corners[:, 3] - corners[:, 0], corners[:, 2] - corners[:, 1])
    side = ((corners.mean(axis=1) - middle) * normal).sum(axis=1)
    return normal * np.where(side < 0.0, -1.0, 1.0)[:, None]


def gauss(dim: int) -> np.ndarray:
    """Gauss points of the unit square or interval, ``shape=(q, dim)``."""
    along = 0.5 + 0.5 * np.polynomial.legendre.leggauss(GAUSS_POINTS)[0]
    return np.stack(np.meshgrid(*[along] * dim, indexing="ij"), axis=-1).reshape(-1, dim)


def _corners(dim: int, count: int) -> np.ndarray:
    if dim == 1:
        return np.array([[0.0], [1.0]])
    return np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])[:count]


def _along(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Coordinates of points on the reference facet, ``shape=(k, dim)``.

    Args:
        points: Points on a facet of the reference cell, ``shape=(k, dim + 1)``.
        corners: Vertices of this facet, in the order of ``_corners``, ``shape=(v, dim + 1)``.
    """
    dim = points.shape[1] - 1
    axes = corners[1 : dim + 1] - corners[0]
    return np.linalg.lstsq(axes.T, (points - corners[0]).T, rcond=None)[0].T
