# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact facets between their nodes: positions there, and where a body would stand that is as smooth as its normals say.

Contact is asked for at nodes alone.  Between them a facet is what the shape functions of the displacements make of its
nodes, and a rigid surface may be nearer or farther than its gaps at the nodes tell.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from dolfinx import fem

from dolfinx_contact import compat
from dolfinx_contact.contact.shapes import monomials

if TYPE_CHECKING:
    from dolfinx_contact.contact.displacements import Displacements

# Points per direction of a facet: those of Gauss's rule, which no wave has at the same phase.
GAUSS_POINTS = 5

# Cosine of an angle between normals of a facet and of the body at its vertices above which an edge is a sharp one.
SHARP_EDGE = np.cos(np.deg2rad(20.0))


class Facets(NamedTuple):
    """Facets of one shape that this rank owns."""

    nodes: np.ndarray  # local nodes of each, (m, k)
    x: np.ndarray  # where these are, (m, k, gdim)
    local: np.ndarray  # where these are on the reference facet, (k, dim)
    vertices: np.ndarray  # which of them are vertices, (v,)
    dim: int  # of a facet
    degree: int  # of the shape functions
    inverse: np.ndarray  # of the matrix of monomials at the nodes, (k, k)
    at_nodes: np.ndarray  # linear shape functions of the vertices at the nodes, (k, v)
    bend: np.ndarray  # (n_b - n_a) . (x_b - x_a) of normals and positions of vertices, (m, v, v)
    curve: (
        np.ndarray
    )  # twice the smaller one of both parts of it, where they have one sign: none beside an edge
    sharp: np.ndarray  # whether a vertex is on a sharp edge, (m,)
    size: np.ndarray  # diameters, (m,)
    outwards: np.ndarray  # unit normals, (m, gdim)

    def shapes(self, at: np.ndarray) -> np.ndarray:
        """Shape functions at points of the unit square or interval, ``shape=(..., dim)``: ``(..., k)``."""
        return monomials(self._local(at), len(self.vertices), self.degree) @ self.inverse

    def hats(self, at: np.ndarray) -> np.ndarray:
        """Linear shape functions of the vertices, ``shape=(..., v)``, at the same points."""
        corners = _corners(self.dim, len(self.vertices))
        inverse = np.linalg.inv(monomials(corners, len(corners), 1))
        return monomials(self._local(at), len(corners), 1) @ inverse

    def sag_at_nodes(self) -> np.ndarray:
        """The same at the nodes, ``shape=(m, k)``, of what is round; not beside edges, blunt or sharp."""
        hats = self.at_nodes
        return 0.25 * ((hats @ self.curve) * hats).sum(axis=-1) * ~self.sharp[:, None]

    def some(self, which: np.ndarray) -> Facets:
        """Those of them that a mask or indices name."""
        rows = ("nodes", "x", "bend", "curve", "sharp", "size", "outwards")
        return self._replace(**{name: getattr(self, name)[which] for name in rows})

    def _local(self, at: np.ndarray) -> np.ndarray:
        """The unit square as a triangle, if facets are triangles."""
        if self.dim == 1 or len(self.vertices) == 4:
            return at
        return np.stack((at[..., 0], at[..., 1] * (1.0 - at[..., 0])), axis=-1)

    def sag(self, hats: np.ndarray) -> np.ndarray:
        """How far a smooth body with these normals at the vertices stands out of the facets, length, ``shape=(m, q)``.

        ``sum_{a<b} w_a w_b (n_b - n_a) . (x_b - x_a) / 2``, on an arc of radius R and chord h at its middle h^2 / 8R.

        Args:
            hats: Linear shape functions ``w`` of the vertices, ``shape=(q, v)``, or ``(m, q, v)``.
        """
        return 0.25 * ((hats @ self.bend) * hats).sum(axis=-1)


def facets_of(displacements: Displacements, facets: np.ndarray) -> list[Facets]:
    """Facets, local indices, of which those that this rank owns count, those of each shape together.  Collective."""
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
        )  # normals on arcs are nearer to that of the shorter chord
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
    """Normals of facets, away from the middles of their cells, as long as the facets are large."""
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
    """Points of the unit square or interval, ``shape=(q, dim)``."""
    along = 0.5 + 0.5 * np.polynomial.legendre.leggauss(GAUSS_POINTS)[0]
    return np.stack(np.meshgrid(*[along] * dim, indexing="ij"), axis=-1).reshape(-1, dim)


def _corners(dim: int, count: int) -> np.ndarray:
    if dim == 1:
        return np.array([[0.0], [1.0]])
    return np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])[:count]


def _along(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Coordinates on a facet of the reference cell, of which its corners have those of ``_corners``."""
    dim = points.shape[1] - 1
    axes = corners[1 : dim + 1] - corners[0]
    return np.linalg.lstsq(axes.T, (points - corners[0]).T, rcond=None)[0].T
