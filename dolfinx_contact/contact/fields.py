# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Nodal areas of a surface, and values at its nodes as functions for output."""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import meshtags

from dolfinx_contact import compat


def areas(V, facets: np.ndarray) -> np.ndarray:
    """Integral of each shape function over facets, in the first component of an array on ``V``.  Collective."""
    mesh, fdim = V.mesh, V.mesh.topology.dim - 1
    mine = np.unique(facets[facets < mesh.topology.index_map(fdim).size_local])
    tags = meshtags(mesh, fdim, mine, np.ones(mine.size, dtype=np.int32))
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tags)(1)
    work = fem.Function(V)
    compat.assemble_into(work.x, fem.form(ufl.TestFunction(V)[0] * ds))
    return work.x.array.copy()


def scalar(V, nodes: np.ndarray, values, name: str, elsewhere: float):
    """Values at some nodes of ``V`` as a scalar Function.  Collective."""
    scalars, parent = V.sub(0).collapse()
    node = np.ravel(parent) // V.dofmap.index_map_bs
    function = fem.Function(scalars, name=name)
    function.x.array[:] = elsewhere
    function.x.array[np.argsort(node)[nodes]] = values
    function.x.scatter_forward()
    return function
