# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Meshes of body and contact surface with results, in VTK's conventions, gathered on rank 0."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from dolfinx import fem

from dolfinx_contact import compat
from dolfinx_contact.contact.facets import facets_of
from dolfinx_contact.contact.fields import per_area
from dolfinx_contact.contact.state import Status

if TYPE_CHECKING:
    from mpi4py import MPI

    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.displacements import Displacements

# VTK's cell types by dimension, number of vertices and number of nodes.
VTK_TYPES = {
    (1, 2, 2): 3,
    (2, 3, 3): 5,
    (2, 4, 4): 9,
    (3, 4, 4): 10,
    (3, 8, 8): 12,
    (3, 6, 6): 13,
    (1, 2, 3): 21,
    (2, 3, 6): 22,
    (2, 4, 9): 28,
    (3, 4, 10): 24,
    (3, 8, 27): 29,
}
VTK_LINE3 = 21
VTK_TRIANGLE6 = 22

# VTK's order of the vertices where it differs from DOLFINx's, by dimension and number of vertices;
# and for each further node of a second-order cell, the vertices in VTK's order whose centroid is
# the position of the node.
SQUARE_ORDER = (0, 1, 3, 2)
VERTEX_ORDERS = {(2, 4): SQUARE_ORDER, (3, 8): (*SQUARE_ORDER, *(4 + k for k in SQUARE_ORDER))}
RING_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0)]
MIDDLE_NODES = {
    (1, 2): [(0, 1)],
    (2, 3): [(0, 1), (1, 2), (2, 0)],
    (2, 4): [*RING_EDGES, (0, 1, 2, 3)],
    (3, 4): [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    (3, 8): [
        *RING_EDGES,
        *((a + 4, b + 4) for a, b in RING_EDGES),
        (0, 4),
        (1, 5),
        (2, 6),
        (3, 7),
        (0, 3, 7, 4),
        (1, 2, 6, 5),
        (0, 1, 5, 4),
        (3, 2, 6, 7),
        (0, 1, 2, 3),
        (4, 5, 6, 7),
        tuple(range(8)),
    ],
}


class Mesh(NamedTuple):
    """Mesh with values at nodes and cells, gathered on rank 0; arrays are empty on all other ranks.

    Attributes:
        x: Positions of the nodes, ``shape=(n, 3)``, undeformed, global frame, length.
        cells: Nodes of the cells in VTK's order, ``shape=(m, k)``, by VTK's cell type.
        at_nodes: Nodal values by name, ``shape=(n,)``, ``(n, 3)`` or ``(n, 9)``.
        at_cells: Cell values by name, ``shape=(cells,)``, ``(cells, 3)`` or ``(cells, 9)``.
    """

    x: np.ndarray
    cells: dict[int, np.ndarray]
    at_nodes: dict[str, np.ndarray]
    at_cells: dict[str, np.ndarray]


def vtk_order(points: np.ndarray, vertices: np.ndarray) -> tuple[int, np.ndarray]:
    """Return VTK's cell type of a reference cell, and the indices of its nodes in VTK's order.

    Args:
        points: Positions of the nodes in the reference cell, ``shape=(k, dim)``.
        vertices: Indices of the nodes that are vertices, in DOLFINx's order.
    """
    dim, count = points.shape[1], len(vertices)
    corners = points[vertices[list(VERTEX_ORDERS.get((dim, count), range(count)))]]
    middles = MIDDLE_NODES[dim, count] if len(points) > count else []
    places = np.array([*corners, *(corners[list(ends)].mean(axis=0) for ends in middles)])
    apart = np.linalg.norm(places[:, None] - points, axis=2)
    return VTK_TYPES[dim, count, len(points)], apart.argmin(axis=1)


def gathered(comm: MPI.Comm, *arrays: np.ndarray) -> list[np.ndarray]:
    """Gather rows of arrays from all ranks, in the order of ranks, on rank 0.  Collective.

    On all other ranks, the returned arrays have no rows.
    """
    found = [comm.gather(array, root=0) for array in arrays]
    return [
        array[:0] if rows is None else np.concatenate(rows) for rows, array in zip(found, arrays)
    ]


# Quantities recovered at the vertices of second-order tetrahedra, which are not contact nodes.
RECOVERED_NAMES = ("pressure", "shear_traction", "slip", "wear_depth")


def padded(values: np.ndarray) -> np.ndarray:
    """Extend two-dimensional vectors and tensors to three dimensions by zeros.

    Arrays of ``shape=(n, 2)`` become ``(n, 3)``, and ``(n, 4)`` become ``(n, 9)``.  Other arrays
    are returned unchanged.
    """
    size = values.shape[1]
    if size == 4:
        whole = np.zeros((len(values), 3, 3))
        whole[:, :2, :2] = values.reshape(-1, 2, 2)
        return whole.reshape(-1, 9)
    return np.column_stack((values, np.zeros(len(values)))) if size == 2 else values


def scalar_or_rows(values: np.ndarray) -> np.ndarray:
    return values[:, 0] if values.shape[1] == 1 else padded(values)


class BodyMesh:
    """Mesh of a body, whose nodes are the nodes of the displacement space.  Collective.

    Args:
        displacements: The ``Displacements`` of the body.
    """

    def __init__(self, displacements: Displacements) -> None:
        V = displacements.V
        self._displacements, self._V, self._comm = displacements, V, V.mesh.comm
        self._points, topology = compat.interpolation_points(V), V.mesh.topology
        self._count = topology.index_map(topology.dim).size_local
        self._local = compat.cell_nodes(V)
        size, layout = topology.connectivity(topology.dim, 0).links(0).size, V.dofmap.dof_layout
        vertices = np.array([layout.entity_dofs(0, k)[0] for k in range(size)])
        self._type, order = vtk_order(self._points, vertices)
        nodes = self._local[: self._count][:, order]
        index_map = V.dofmap.index_map
        numbers = index_map.local_to_global(nodes.ravel().astype(np.int32)).reshape(nodes.shape)
        self._x, self._cells = gathered(self._comm, displacements.x[: displacements.count], numbers)

    def __call__(self, u: fem.Function, fields: dict[str, Any]) -> Mesh:
        """Return the mesh with the displacement and further fields as values.  Collective.

        Args:
            u: Function of all unknowns.
            fields: Further fields by name.  Functions of Lagrange spaces become nodal values, other
                UFL expressions become cell values, evaluated at the midpoints of the cells.
        """
        owned = u.x.array[: self._displacements.size]
        at_nodes = {
            "displacement": gathered(self._comm, padded(self._displacements.rows(owned)))[0]
        }
        at_cells = {}
        for name, field in fields.items():
            continuous = isinstance(field, fem.Function) and compat.lagrange_degree(
                field.function_space
            )
            found = self._nodal_values(field) if continuous else self._cell_values(field)
            (at_nodes if continuous else at_cells)[name] = gathered(
                self._comm, scalar_or_rows(found)
            )[0]
        cells = {self._type: self._cells} if self._comm.rank == 0 else {}
        return Mesh(self._x, cells, at_nodes, at_cells)

    def _nodal_values(self, field: fem.Function) -> np.ndarray:
        """Return the values of a field at this rank's owned nodes, ``shape=(n, components)``."""
        cells = np.arange(len(self._local), dtype=np.int32)
        found = compat.cell_values(fem.Expression(field, self._points), self._V.mesh, cells)
        k = self._local.shape[1]
        found = found.reshape(len(cells), k, -1) if len(cells) else np.zeros((0, k, 1))
        values = np.zeros((self._displacements.x.shape[0], found.shape[2]))
        values[self._local.ravel()] = found.reshape(-1, found.shape[2])
        return values[: self._displacements.count]

    def _cell_values(self, field: fem.Function) -> np.ndarray:
        """Return a field at the midpoints of owned cells, ``shape=(cells, components)``."""
        middle = self._points.mean(axis=0, keepdims=True)
        cells = np.arange(self._count, dtype=np.int32)
        return compat.cell_values(fem.Expression(field, middle), self._V.mesh, cells)


class SurfaceMesh:
    """Mesh of the facets of a contact, with the nodes of the displacement space.  Collective.

    Args:
        contact: The contact.
    """

    def __init__(self, contact: Contact) -> None:
        self._contact, self._comm = contact, contact.comm
        displacements, V = contact.displacements, contact.displacements.V
        found: dict[int, list[np.ndarray]] = {}
        for facets in facets_of(displacements, contact.facets):
            kind, order = vtk_order(facets.local, facets.vertices)
            index_map = V.dofmap.index_map
            nodes = facets.nodes[:, order]
            numbers = index_map.local_to_global(nodes.ravel().astype(np.int32))
            found.setdefault(kind, []).append(numbers.reshape(nodes.shape))
        every = self._comm.gather(
            {kind: np.concatenate(parts) for kind, parts in found.items()}, root=0
        )
        kinds = sorted({kind for one in every or [] for kind in one})
        cells = {k: np.concatenate([one[k] for one in every if k in one]) for k in kinds}
        numbers = np.concatenate([nodes.ravel() for nodes in cells.values()] or [np.empty(0, int)])
        self._numbers = self._comm.bcast(np.unique(numbers), root=0)
        self._cells = {k: np.searchsorted(self._numbers, nodes) for k, nodes in cells.items()}
        first, end = V.dofmap.index_map.local_range
        inside = (self._numbers >= first) & (self._numbers < end)
        self._owned = self._numbers[inside] - first
        (self._x,) = gathered(self._comm, displacements.x[self._owned])
        at = np.searchsorted(self._owned, contact.nodes)
        assert np.array_equal(self._owned[at], contact.nodes), "a contact node is on no facet"
        self._at = at

    def __call__(self, u: fem.Function) -> Mesh:
        """Return the mesh of the contact surface with results as nodal values.  Collective.

        Vectors are in global components.  Vertices of second-order tetrahedra are not contact
        nodes.  Their values are recovered from the midpoints of the edges, see ``recovered``.

        Args:
            u: Function of all unknowns.
        """
        contact, displacements = self._contact, self._contact.displacements
        frames, reaction = contact.points.frames, contact.reaction
        shear = np.einsum("ni,nij->nj", reaction[:, :-1], frames[:, :-1])
        moved = displacements.rows(u.x.array[: displacements.size])[self._owned]
        local = {
            "pressure": contact.pressure,
            "shear_traction": padded(per_area(shear, contact.area)),
            "slip": padded(np.einsum("ni,nij->nj", contact.slip_increment, frames[:, :-1])),
            "status": contact.status,
            "wear_depth": contact.wear_depth,
            "dissipation": contact.dissipation,
            "reaction": padded(np.einsum("ni,nij->nj", reaction, frames)),
            "normal": padded(frames[:, -1]),
            "covered": contact.covered,
            "contact_node": np.ones(contact.nodes.size, dtype=np.int32),
        }
        values = {
            name: gathered(self._comm, self._at_facet_nodes(array))[0]
            for name, array in local.items()
        }
        gap = self._gaps(moved)
        values["gap"], values["displacement"] = gathered(self._comm, gap, padded(moved))
        if VTK_TRIANGLE6 in self._cells:
            names = (*RECOVERED_NAMES, "gap") if contact.surface.deformable else RECOVERED_NAMES
            recovered(self._x, self._cells[VTK_TRIANGLE6], values, names)
        if VTK_LINE3 in self._cells:
            recover_on_axis(self._cells[VTK_LINE3], values)
        return Mesh(self._x, self._cells, values, {})

    def _at_facet_nodes(self, values: np.ndarray) -> np.ndarray:
        """Return values at all facet nodes that this rank owns.

        The values are zero at nodes that are not contact nodes.

        Args:
            values: Values at this rank's contact nodes, ``shape=(n, ...)``.
        """
        found = np.zeros((self._owned.size, *values.shape[1:]), dtype=values.dtype)
        found[self._at] = values
        return found

    def _gaps(self, moved: np.ndarray) -> np.ndarray:
        """Return the gaps of all facet nodes that this rank owns, ``shape=(k,)``, length.

        At nodes that are not contact nodes, the gap is the distance of the displaced node from the
        surface in its present position.  Unknown gaps are NaN.

        Args:
            moved: Displacements of the nodes, ``shape=(k, gdim)``, global frame, length.
        """
        contact, gap = self._contact, self._contact.gap
        gaps = self._at_facet_nodes(np.where(np.isinf(gap), np.nan, gap))  # not drawn
        others = np.setdiff1d(np.arange(self._owned.size), self._at)
        if others.size:
            dim = moved.shape[1]
            x = contact.displacements.x[self._owned[others], :dim] + moved[others]
            found = contact.geometry.distances(x)
            gaps[others] = np.where(np.isinf(found), np.nan, found)
        return gaps


def recover_on_axis(lines: np.ndarray, values: dict[str, np.ndarray]) -> None:
    """Recover pressure, wear depth and status at nodes on the axis of symmetry, in place.

    These nodes are not contact nodes.  Pressure and wear depth are extrapolated by the parabola
    through the other two nodes of the edge with its vertex on the axis.  The status is that of the
    midpoint.

    Args:
        lines: Nodes of second-order edges, ends first, ``shape=(m, 3)``.
        values: Nodal values by name.  Nodes with ``contact_node`` equal to 1 keep their values.
    """
    free = values["contact_node"] == 0
    for first, other, middle in np.concatenate((lines, lines[:, [1, 0, 2]])):
        if free[first] and not (free[other] or free[middle]):
            for name in ("pressure", "wear_depth"):
                top = (4.0 * values[name][middle] - values[name][other]) / 3.0
                values[name][first] = max(top, 0.0)
            values["status"][first] = values["status"][middle]


def recovered(
    x: np.ndarray,
    triangles: np.ndarray,
    values: dict[str, np.ndarray],
    names: tuple[str, ...] = RECOVERED_NAMES,
) -> None:
    r"""Recover values at vertices of second-order triangles from midpoints of edges, in place.

    .. math:: v_i = \sum_T A_T (m_{ij} + m_{ki} - m_{jk}) \Big/ \sum_T A_T

    On each triangle ``T``, a linear function interpolates the values at the three midpoints.  The
    value at a vertex is the average over the adjacent triangles, weighted by their area ``A_T``.
    The integral of a second-order function over a triangle does not depend on the vertex values.
    With the recovered values, linear interpolation between all nodes has the same integral over the
    surface.  Pressure and wear depth are cut off at zero.  The status of a vertex is the most
    frequent status of the adjacent midpoints.

    Args:
        x: Positions of the nodes, ``shape=(n, 3)``, length.
        triangles: Nodes of the triangles in VTK's order, ``shape=(m, 6)``.
        values: Nodal values by name.  Nodes with ``contact_node`` equal to 1 keep their values.
        names: Names of the values to recover.
    """
    free = values["contact_node"] == 0
    corners, middles = triangles[:, :3], triangles[:, 3:]
    sides = x[corners[:, 1:]] - x[corners[:, :1]]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    total = np.zeros(len(x))
    np.add.at(total, corners, area[:, None])
    free &= total > 0.0
    for name in names:
        array = values[name]
        m = array[middles]
        linear = m + np.roll(m, 1, axis=1) - np.roll(m, -1, axis=1)
        sums = np.zeros_like(array)
        np.add.at(sums, corners, np.einsum("m,mk...->mk...", area, linear))
        array[free] = (sums[free].T / total[free]).T
        if name in ("pressure", "wear_depth"):
            np.maximum(array, 0.0, out=array)
    votes = np.zeros((len(x), len(Status)), dtype=int)
    for around in (middles, np.roll(middles, 1, axis=1)):
        np.add.at(votes, (corners, values["status"][around]), 1)
    values["status"][free] = votes[free].argmax(axis=1)
