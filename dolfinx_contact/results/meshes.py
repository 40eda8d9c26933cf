# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Body and contact surface as VTK knows meshes, gathered on rank 0, with the values that files and pictures show."""

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

# VTK's cells by number of vertices and of nodes; a tetrahedron and a quadrilateral differ by their dimension, the first number.
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

# VTK's order of vertices, and the vertices (in that order) in whose middle each further node is.
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
    """A mesh and values at its nodes and cells; on ranks other than 0 empty.

    Attributes:
        x: Positions of the nodes, ``shape=(n, 3)``, undeformed, global frame.
        cells: Nodes of the cells of each VTK type, in VTK's order, ``shape=(m, k)``.
        at_nodes: Arrays by name, ``shape=(n,)`` or ``(n, 3)``.
        at_cells: Arrays by name, ``shape=(cells,)``, ``(cells, 3)`` or ``(cells, 9)``.
    """

    x: np.ndarray
    cells: dict[int, np.ndarray]
    at_nodes: dict[str, np.ndarray]
    at_cells: dict[str, np.ndarray]


def vtk_order(points: np.ndarray, vertices: np.ndarray) -> tuple[int, np.ndarray]:
    """VTK's type of a cell, and its nodes in VTK's order.

    Args:
        points: Positions of the nodes in the reference cell, ``shape=(k, dim)``.
        vertices: Which of them are vertices, in DOLFINx's order.
    """
    dim, count = points.shape[1], len(vertices)
    corners = points[vertices[list(VERTEX_ORDERS.get((dim, count), range(count)))]]
    middles = MIDDLE_NODES[dim, count] if len(points) > count else []
    places = np.array([*corners, *(corners[list(ends)].mean(axis=0) for ends in middles)])
    apart = np.linalg.norm(places[:, None] - points, axis=2)
    return VTK_TYPES[dim, count, len(points)], apart.argmin(axis=1)


def gathered(comm: MPI.Comm, *arrays: np.ndarray) -> list[np.ndarray]:
    """Rows of all ranks, in the order of ranks, on rank 0; none elsewhere.  Collective."""
    found = [comm.gather(array, root=0) for array in arrays]
    return [
        array[:0] if rows is None else np.concatenate(rows) for rows, array in zip(found, arrays)
    ]


# What vertices of second-order tetrahedra, which are no contact nodes, are given.
RECOVERED_NAMES = ("pressure", "shear_traction", "slip", "wear_depth")


def padded(values: np.ndarray) -> np.ndarray:
    """Vectors and tensors of two dimensions, ``shape=(n, 2)`` or ``(n, 4)``, with zeros as the third component."""
    size = values.shape[1]
    if size == 4:
        whole = np.zeros((len(values), 3, 3))
        whole[:, :2, :2] = values.reshape(-1, 2, 2)
        return whole.reshape(-1, 9)
    return np.column_stack((values, np.zeros(len(values)))) if size == 2 else values


def scalar_or_rows(values: np.ndarray) -> np.ndarray:
    return values[:, 0] if values.shape[1] == 1 else padded(values)


class BodyMesh:
    """The mesh of a body, with the nodes of its displacements.  Collective.

    Args:
        displacements: The ``Displacements``.
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
        """The mesh with the displacement and other fields.  Collective.

        Args:
            u: Function of all unknowns.
            fields: Functions of Lagrange spaces, whose values at the nodes are taken, and other UFL expressions, whose values
                in the middle of each cell are; by name.
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
            found = self._nodal(field) if continuous else self._of_cells(field)
            (at_nodes if continuous else at_cells)[name] = gathered(
                self._comm, scalar_or_rows(found)
            )[0]
        cells = {self._type: self._cells} if self._comm.rank == 0 else {}
        return Mesh(self._x, cells, at_nodes, at_cells)

    def _nodal(self, field: fem.Function) -> np.ndarray:
        """At owned nodes, ``shape=(n, components)``."""
        cells = np.arange(len(self._local), dtype=np.int32)
        found = compat.cell_values(fem.Expression(field, self._points), self._V.mesh, cells)
        k = self._local.shape[1]
        found = found.reshape(len(cells), k, -1) if len(cells) else np.zeros((0, k, 1))
        values = np.zeros((self._displacements.x.shape[0], found.shape[2]))
        values[self._local.ravel()] = found.reshape(-1, found.shape[2])
        return values[: self._displacements.count]

    def _of_cells(self, field: fem.Function) -> np.ndarray:
        """In the middle of owned cells, ``shape=(cells, components)``."""
        middle = self._points.mean(axis=0, keepdims=True)
        cells = np.arange(self._count, dtype=np.int32)
        return compat.cell_values(fem.Expression(field, middle), self._V.mesh, cells)


class SurfaceMesh:
    """The contact surface of a contact: its facets, with the nodes of the displacements.  Collective.

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
        """The surface with the state of the contact.  Collective.

        Vectors are in global components.  Vertices of second-order tetrahedra, which are no contact nodes, have values that are
        recovered from the middles of edges, see ``recovered``.
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
            name: gathered(self._comm, self._placed(array))[0] for name, array in local.items()
        }
        gap = self._gaps(moved)
        values["gap"], values["displacement"] = gathered(self._comm, gap, padded(moved))
        if VTK_TRIANGLE6 in self._cells:
            names = (*RECOVERED_NAMES, "gap") if contact.surface.deformable else RECOVERED_NAMES
            recovered(self._x, self._cells[VTK_TRIANGLE6], values, names)
        if VTK_LINE3 in self._cells:
            recovered_on_axis(self._cells[VTK_LINE3], values)
        return Mesh(self._x, self._cells, values, {})

    def _placed(self, values: np.ndarray) -> np.ndarray:
        """Values at contact nodes at those of all nodes of the facets that this rank owns, zero at others."""
        found = np.zeros((self._owned.size, *values.shape[1:]), dtype=values.dtype)
        found[self._at] = values
        return found

    def _gaps(self, moved: np.ndarray) -> np.ndarray:
        """Of all nodes: of those that are no contact nodes the distance from the surface where it stands."""
        contact, gap = self._contact, self._contact.gap
        gaps = self._placed(np.where(np.isinf(gap), np.nan, gap))  # pictures leave it out
        others = np.setdiff1d(np.arange(self._owned.size), self._at)
        if others.size:
            dim = moved.shape[1]
            x = contact.displacements.x[self._owned[others], :dim] + moved[others]
            found = contact.geometry.distances(x)
            gaps[others] = np.where(np.isinf(found), np.nan, found)
        return gaps


def recovered_on_axis(lines: np.ndarray, values: dict[str, np.ndarray]) -> None:
    """Give nodes on an axis of symmetry, which carry nothing, the pressure and depth of a parabola with its top there, in place.

    Args:
        lines: Nodes of second-order edges, ends first, ``shape=(m, 3)``.
        values: By name; ``contact_node`` says which nodes stay as they are.
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
    r"""Give vertices of second-order triangles values that fit those at the middles of edges, in place.

    .. math:: v_i = \sum_T A_T (m_{ij} + m_{ki} - m_{jk}) \Big/ \sum_T A_T

    On each triangle ``T`` around the vertex the linear function through the three middles, and its mean by area.  The integral of the
    second-order function does not depend on vertices; that of linear pieces between all nodes is the same.  Quantities that
    cannot be negative are cut off at zero.  The status is the one that most of the middles around have.

    Args:
        x: Positions of nodes.
        triangles: Nodes in VTK's order, ``shape=(m, 6)``.
        values: By name; ``contact_node`` says which nodes stay as they are.
        names: Of those that are recovered.
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
