# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Two blocks in one mesh, one on the other, whose meshes do not match, for tests and benchmarks."""

from __future__ import annotations

from inspect import signature

import numpy as np
import ufl
from mpi4py import MPI

import dolfinx_contact.compat as compat  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import mesh
from dolfinx.mesh import CellType, create_mesh

KINDS = {
    "triangle": CellType.triangle,
    "quadrilateral": CellType.quadrilateral,
    "tetrahedron": CellType.tetrahedron,
    "hexahedron": CellType.hexahedron,
}


def box(cell: str, low, high, cells):
    """A rectangle or box on this rank alone."""
    make = mesh.create_rectangle if len(cells) == 2 else mesh.create_box
    return make(MPI.COMM_SELF, [np.array(low, float), np.array(high, float)], cells, KINDS[cell])


def joined(parts, comm=MPI.COMM_WORLD):
    """One mesh of several with the same cells, on a communicator."""
    d = parts[0].geometry.dim
    x, cells, count = [], [], 0
    for part in parts if comm.rank == 0 else ():
        x.append(part.geometry.x[:, :d])
        cells.append(count + compat.cell_points(part))
        count += len(x[-1])
    x = np.concatenate(x) if x else np.zeros((0, d))
    nodes = compat.cell_points(parts[0]).shape[1]
    cells = np.concatenate(cells) if cells else np.zeros((0, nodes))
    cell = parts[0].topology.cell_name()
    if hasattr(ufl, "VectorElement"):
        element = ufl.Mesh(ufl.VectorElement("Lagrange", cell, 1))
    else:
        import basix.ufl

        element = basix.ufl.element("Lagrange", cell, 1, shape=(d,))
    given = {"x": x, "domain" if "domain" in signature(create_mesh).parameters else "e": element}
    return create_mesh(comm, cells.astype(np.int64), **given)


def pair(cell, cells, size=(1.0, 1.0), gap=0.0, comm=MPI.COMM_WORLD):
    """A block on another one: the mesh, facets of top, bottom, upper and lower side of the interface, and which cells are above."""
    d, fdim = len(cells[0]), len(cells[0]) - 1
    low = np.append([(size[1] - size[0]) / 2] * fdim, gap)
    upper = (low, low + np.append([size[0]] * fdim, 1.0))
    lower = (np.append([0.0] * fdim, -1.0), np.append([size[1]] * fdim, 0.0))
    domain = joined([box(cell, *upper, cells[0]), box(cell, *lower, cells[1])], comm)
    count = domain.topology.index_map(d).size_local + domain.topology.index_map(d).num_ghosts
    height = domain.geometry.x[compat.cell_points(domain)[:count]].mean(axis=1)[:, fdim]

    def near(z, above=None):
        facets = mesh.locate_entities_boundary(domain, fdim, lambda x: np.isclose(x[fdim], z))
        domain.topology.create_connectivity(fdim, d)
        links = domain.topology.connectivity(fdim, d)
        of = np.array([links.links(f)[0] for f in facets], dtype=int)
        return facets if above is None else facets[(height[of] > 0.0) == above]

    ends = near(1.0 + gap), near(-1.0), near(gap, True), near(0.0, False)
    return domain, *ends, height > 0.0
