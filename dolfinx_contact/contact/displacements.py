# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The displacements among the unknowns of a function space: which degrees of freedom belong to which node."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from dolfinx import fem

from dolfinx_contact import compat


def displacement_part(V: fem.FunctionSpace):
    """The sub-space of a mixed space that holds displacements; None of any other space.

    Args:
        V: Any function space.

    Raises:
        ValueError: a mixed space none of whose sub-spaces is continuous Lagrange with a component per dimension, or more than one.
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
    """Nodes and components of the displacements of a space ``V``.

    Args:
        V: A space of displacements; or a mixed space, see ``displacement_part``, or a sub-space of one.

    Attributes:
        V: The space of displacements alone, whose numbering of nodes is meant everywhere.
        mixed: Whether there are other unknowns.
        size: Owned degrees of freedom of all unknowns.
        owned: The same, the global number of the first, and how many all ranks have.
        count: Owned nodes of the displacements.
        dim: Their components.
        degree: Of their shape functions.
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
        """Positions of the nodes, ghosts included, ``shape=(nodes, 3)``."""
        return self.V.tabulate_dof_coordinates()

    def dofs(self, nodes: np.ndarray) -> np.ndarray:
        """Degrees of freedom of nodes, ``shape=(n, dim)``, in the numbering of all unknowns."""
        if self.mixed:
            return self._dofs[nodes]
        return self.dim * nodes[:, None] + np.arange(self.dim)

    def rows(self, values: np.ndarray) -> np.ndarray:
        """Of values of owned degrees of freedom those of the displacements, ``shape=(nodes, dim)``."""
        values = values[self._dofs[: self.count].ravel()] if self.mixed else values
        return values.reshape(self.count, self.dim)

    def vectors(self, rows: np.ndarray) -> np.ndarray:
        """Values of owned nodes, ``shape=(nodes, dim, m)``, as ``shape=(owned dofs, m)``; other unknowns are zero."""
        flat = rows.reshape(self.count * self.dim, rows.shape[-1])
        if not self.mixed:
            return flat
        vectors = np.zeros((self.size, flat.shape[1]))
        vectors[self._dofs[: self.count].ravel()] = flat
        return vectors

    def everywhere(self, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Values at some owned nodes, ``shape=(n,)``, at all nodes that this rank knows, ghosts included, zero elsewhere.  Collective."""
        function = fem.Function(self.V)
        rows = function.x.array.reshape(-1, self.dim)
        rows[nodes, 0] = values
        function.x.scatter_forward()
        return rows[:, 0].copy()

    @cached_property
    def are(self) -> np.ndarray:
        """Which owned degrees of freedom are displacements, booleans."""
        return self.vectors(np.ones((self.count, self.dim, 1)))[:, 0] > 0.0
