# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Displacement degrees of freedom of a function space, plain or mixed, by node."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from dolfinx import fem

from dolfinx_contact import compat


def displacement_part(V: fem.FunctionSpace):
    """Displacement part of a mixed space; ``V`` for a sub-space, None for a plain space.

    Args:
        V: Any function space.

    Raises:
        ValueError: A mixed space has no sub-space of continuous Lagrange elements with one
            component per dimension, or several.
    """
    gdim = V.mesh.geometry.dim
    if compat.is_part(V) and compat.value_size(V) == gdim and V.dofmap.index_map_bs == 1:
        return V
    if V.dofmap.index_map_bs > 1 or V.element.num_sub_elements < 2:
        return None
    parts = {i: V.sub(i) for i in range(V.element.num_sub_elements)}
    able = [
        i
        for i, part in parts.items()
        if compat.value_size(part) == gdim and compat.lagrange_degree(part) is not None
    ]
    if len(able) == 1:
        return parts[able[0]]
    if able:
        raise ValueError(
            f"V is a mixed space with several sub-spaces of {gdim} continuous Lagrange components, {able}, such as displacements and "
            f"rotations or velocities: give the one of the displacements, dc.Contact(V.sub({able[0]}), ...)."
        )
    raise ValueError(
        f"V is a mixed space, but none of its sub-spaces is continuous Lagrange with {gdim} components: contact needs "
        "displacements."
    )


class Displacements:
    """Nodes and degrees of freedom of the displacements in a function space ``V``.

    Args:
        V: A space of displacements, a mixed space (see ``displacement_part``), or a sub-space of
            one.

    Attributes:
        V: The space of displacements alone.  Node indices always refer to this space.
        mixed: Whether the given space has unknowns other than displacements.
        size: Number of owned degrees of freedom of all unknowns.
        owned: Number of owned degrees of freedom, global index of the first one, and number on all
            ranks together, for all unknowns.
        count: Number of owned displacement nodes.
        dim: Number of displacement components.
        degree: Polynomial degree of the displacement shape functions.
    """

    def __init__(self, V: fem.FunctionSpace):
        part, self.V, self._dofs = displacement_part(V), V, None
        self.mixed = part is not None
        index_map, bs = V.dofmap.index_map, V.dofmap.index_map_bs
        self.size = index_map.size_local * bs
        self.owned = self.size, index_map.local_range[0] * bs, index_map.size_global * bs
        if self.mixed:
            self.V, parent = part.collapse()
            self._dofs = np.array(parent, dtype=np.int32).reshape(-1, self.V.dofmap.index_map_bs)
        self.degree = compat.lagrange_degree(self.V)
        self.dim, self.count = self.V.dofmap.index_map_bs, self.V.dofmap.index_map.size_local

    @property
    def x(self) -> np.ndarray:
        """Positions of the displacement nodes, with ghosts, ``shape=(nodes, 3)``, length."""
        return self.V.tabulate_dof_coordinates()

    def dofs(self, nodes: np.ndarray) -> np.ndarray:
        """Local degrees of freedom of nodes in the given space, ``shape=(n, dim)``."""
        if self.mixed:
            return self._dofs[nodes]
        return self.dim * nodes[:, None] + np.arange(self.dim)

    def rows(self, values: np.ndarray) -> np.ndarray:
        """Displacements in a vector of owned degrees of freedom, ``shape=(nodes, dim)``."""
        values = values[self._dofs[: self.count].ravel()] if self.mixed else values
        return values.reshape(self.count, self.dim)

    def vectors(self, rows: np.ndarray) -> np.ndarray:
        """Vectors of owned degrees of freedom, ``shape=(owned dofs, m)``, from nodal values.

        Unknowns other than displacements are zero.

        Args:
            rows: Values at owned nodes, ``shape=(nodes, dim, m)``.
        """
        flat = rows.reshape(self.count * self.dim, rows.shape[-1])
        if not self.mixed:
            return flat
        vectors = np.zeros((self.size, flat.shape[1]))
        vectors[self._dofs[: self.count].ravel()] = flat
        return vectors

    def on_all_ranks(self, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Values at all nodes of this rank, with ghosts, from values at owned nodes.  Collective.

        Args:
            nodes: Local indices of owned nodes, ``shape=(n,)``.
            values: Values at these nodes, ``shape=(n,)``; other nodes have zero.
        """
        function = fem.Function(self.V)
        rows = function.x.array.reshape(-1, self.dim)
        rows[nodes, 0] = values
        function.x.scatter_forward()
        return rows[:, 0].copy()

    @cached_property
    def are(self) -> np.ndarray:
        """Mask of displacement degrees of freedom, ``shape=(owned dofs,)``."""
        return self.vectors(np.ones((self.count, self.dim, 1)))[:, 0] > 0.0
