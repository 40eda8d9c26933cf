# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Nodes of a surface that may touch, their areas, and values at them as functions for output."""

from __future__ import annotations

import warnings

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import meshtags
from mpi4py import MPI

from dolfinx_contact import compat
from dolfinx_contact.collective import raised_together

# Of the largest integral of a shape function over reference facets: below this it is rounding.
ZERO = 1e-10

# What an even pressure may make at a node that is left out, over the largest at others, before a user is told.
UNEVEN = 0.01


def areas(V, facets: np.ndarray, reference: bool = False) -> np.ndarray:
    """Integral of each shape function over facets, in the first component of an array on ``V``.  Collective.

    Args:
        V: The space.
        facets: Local indices.
        reference: Whether all facets count as large as the reference facet.
    """
    mesh, fdim = V.mesh, V.mesh.topology.dim - 1
    mine = np.unique(facets[facets < mesh.topology.index_map(fdim).size_local])
    tags = meshtags(mesh, fdim, mine, np.ones(mine.size, dtype=np.int32))
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tags)(1)
    work, shape = fem.Function(V), ufl.TestFunction(V)[0]
    if reference:
        shape = shape / abs(ufl.classes.FacetJacobianDeterminant(mesh))
    compat.assemble_into(work.x, fem.form(shape * ds))
    return work.x.array.copy()


def contact_nodes(V, facets: np.ndarray) -> np.ndarray:
    """Owned nodes of facets that carry a part of an even pressure.  Collective.

    An even pressure p makes the force ``p A_i`` at a node, ``A_i`` the integral of its shape function. With first order,
    and with second order on quadrilaterals and on edges, all are positive. Those of the vertices of triangles of second
    order are zero, and the middles of their edges are the points of a rule that integrates quadratic functions exactly: the
    vertices are left out. It is the element that decides, on the reference facet, so that a curved one cannot change it.

    Raises:
        ValueError: on all ranks, if an integral is negative: such a node would have to pull.
    """
    nodes = fem.locate_dofs_topological(V, V.mesh.topology.dim - 1, facets)
    nodes = np.unique(nodes[nodes < V.dofmap.index_map.size_local])
    if compat.lagrange_degree(V) == 1:
        return nodes
    comm, weights = V.mesh.comm, areas(V, facets, reference=True)[V.mesh.geometry.dim * nodes]
    zero = ZERO * comm.allreduce(np.abs(weights).max(initial=0.0), op=MPI.MAX)
    with raised_together(comm):
        if (weights < -zero).any():
            node = int(np.argmin(weights))
            raise ValueError(
                f"V has degree {compat.lagrange_degree(V)}, and the integral of the shape function of the node at "
                f"{V.tabulate_dof_coordinates()[nodes[node]].tolist()} over the facets is negative: under an even pressure "
                "it would have to pull, which contact cannot. Take degree 1 or 2."
            )
    kept = weights > zero
    _warn_of_curved_edges(V, facets, nodes[kept], nodes[~kept])
    return nodes[kept]


def _warn_of_curved_edges(V, facets: np.ndarray, kept: np.ndarray, left_out: np.ndarray) -> None:
    """Tell that an even pressure acts on nodes that are left out.  Collective."""
    comm, dim = V.mesh.comm, V.mesh.geometry.dim
    if comm.allreduce(left_out.size) == 0:
        return
    acting = np.abs(areas(V, facets))
    most = [acting[dim * of].max(initial=0.0) for of in (left_out, kept)]
    missed, largest = (comm.allreduce(float(of), op=MPI.MAX) for of in most)
    if missed > UNEVEN * largest:
        warnings.warn(
            f"edges of contact facets are curved: an even pressure would make forces of up to {missed / largest:.1%} of "
            "the largest at vertices of second-order tetrahedra, which are no contact nodes. Results are off by about that "
            "there. Take smaller cells there, or bricks.",
            stacklevel=4,
        )


def scalar(V, nodes: np.ndarray, values, name: str, elsewhere: float):
    """Values at some nodes of ``V`` as a scalar Function.  Collective."""
    scalars, parent = V.sub(0).collapse()
    node = np.ravel(parent) // V.dofmap.index_map_bs
    function = fem.Function(scalars, name=name)
    function.x.array[:] = elsewhere
    function.x.array[np.argsort(node)[nodes]] = values
    function.x.scatter_forward()
    return function
