# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Numbering of cells and nodes that does not depend on the partition of the mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import dolfinx
import numpy as np

from dolfinx_contact import compat

if TYPE_CHECKING:
    from dolfinx import fem
    from dolfinx.mesh import Mesh


def original_cells(mesh: Mesh) -> np.ndarray:
    """Return the index of each owned cell in the mesh as it was read or created, for any partition.

    Raises:
        ValueError: DOLFINx does not store it, for example for submeshes.
    """
    count = mesh.topology.index_map(mesh.topology.dim).size_local
    known = compat.read_cells(mesh)
    if len(known) < count:
        raise ValueError(
            "a checkpoint holds state and mixed unknowns by cells, and those of a submesh have no number in the mesh "
            "that was read: save them from a mesh of its own."
        )
    return np.array(known[:count], dtype=np.int64)


def original_node_numbers(V: fem.FunctionSpace) -> np.ndarray:
    """Return a number of each owned node that does not depend on the partition of the mesh.

    For a vertex, it is the vertex's index in the mesh as it was read or created.  The node of an
    edge, face or cell is identified by two opposite vertices, one of which has the lowest index: no
    two entities of a mesh have both in common.

    Args:
        V: Function space of degree 1 or 2.

    Raises:
        ValueError: the degree is higher.
    """
    nodes, topology = compat.cell_nodes(V), V.mesh.topology
    index_map, layout = V.dofmap.index_map, V.dofmap.dof_layout
    original = np.zeros(index_map.size_local + index_map.num_ghosts, dtype=np.int64)
    count = dolfinx.cpp.mesh.cell_num_entities(topology.cell_type, 0)
    points = compat.cell_points(V.mesh)[: len(nodes), :count]
    vertices = np.asarray(V.mesh.geometry.input_global_indices)[points]
    for dim in range(topology.dim + 1):
        for entity in range(dolfinx.cpp.mesh.cell_num_entities(topology.cell_type, dim)):
            own = layout.entity_dofs(dim, entity)
            if len(own) > 1:
                raise ValueError("nodes are named by their mesh for spaces of degree 1 and 2 only.")
            if len(own) == 1 and len(nodes) > 0:  # a rank may have no cells
                corners = [k for k in layout.entity_closure_dofs(dim, entity) if k < count]
                original[nodes[:, own[0]]] = _entity_numbers(vertices[:, corners])
    return original[: index_map.size_local]


def _entity_numbers(vertices: np.ndarray) -> np.ndarray:
    """Return one number for each entity, computed from the indices of its vertices.

    Args:
        vertices: ``shape=(n, m)``, ordered so that columns ``k`` and ``m - 1 - k`` are opposite
            vertices.
    """
    low, rows = vertices.argmin(axis=1), np.arange(len(vertices))
    if vertices.shape[1] == 1:
        return vertices[:, 0]
    opposite = vertices[rows, vertices.shape[1] - 1 - low]
    return (vertices[rows, low].astype(np.int64) + 1 << 32) + opposite
