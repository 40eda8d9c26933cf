# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Names of cells and nodes that do not depend on how ranks share the mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import dolfinx
import numpy as np

from dolfinx_contact import compat

if TYPE_CHECKING:
    from dolfinx import fem
    from dolfinx.mesh import Mesh


def original_cells(mesh: Mesh) -> np.ndarray:
    """Index of each owned cell in the mesh as it was read or made, whatever the ranks.

    Raises:
        ValueError: DOLFINx does not know it, as of submeshes.
    """
    count = mesh.topology.index_map(mesh.topology.dim).size_local
    known = compat.read_cells(mesh)
    if len(known) < count:
        raise ValueError(
            "a checkpoint holds state and mixed unknowns by cells, and those of a submesh have no number in the mesh "
            "that was read: save them from a mesh of its own."
        )
    return np.array(known[:count], dtype=np.int64)


def original_nodes(V: fem.FunctionSpace) -> np.ndarray:
    """A number for each owned node by the mesh as it was read or made, whatever the ranks; ``V`` of degree 1 or 2.

    That of a vertex is its index there. The node of an edge, face or cell is named by two of its vertices that face each
    other, the lowest and its opposite: two entities of a mesh do not share both.
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
                original[nodes[:, own[0]]] = _name_of(vertices[:, corners])
    return original[: index_map.size_local]


def _name_of(vertices: np.ndarray) -> np.ndarray:
    """One number from the vertices of an entity, ``shape=(n, m)``, which face each other from both ends of a row."""
    low, rows = vertices.argmin(axis=1), np.arange(len(vertices))
    if vertices.shape[1] == 1:
        return vertices[:, 0]
    opposite = vertices[rows, vertices.shape[1] - 1 - low]
    return (vertices[rows, low].astype(np.int64) + 1 << 32) + opposite
