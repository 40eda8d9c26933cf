# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Two blocks in one mesh, one on the other, whose meshes do not match."""

from inspect import signature
from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.mesh import CellType, create_mesh
from scenes import COMM, MPI, elasticity

from dolfinx_contact.compat import cell_points, functionspace

E, NU = 1000.0, 0.3
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


def joined(parts, comm=COMM):
    """One mesh of several with the same cells, on a communicator."""
    d = parts[0].geometry.dim
    x, cells, count = [], [], 0
    for part in parts if comm.rank == 0 else ():
        x.append(part.geometry.x[:, :d])
        cells.append(count + cell_points(part))
        count += len(x[-1])
    x = np.concatenate(x) if x else np.zeros((0, d))
    nodes = cell_points(parts[0]).shape[1]
    cells = np.concatenate(cells) if cells else np.zeros((0, nodes))
    cell = parts[0].topology.cell_name()
    if hasattr(ufl, "VectorElement"):
        element = ufl.Mesh(ufl.VectorElement("Lagrange", cell, 1))
    else:
        import basix.ufl

        element = basix.ufl.element("Lagrange", cell, 1, shape=(d,))
    given = {"x": x, "domain" if "domain" in signature(create_mesh).parameters else "e": element}
    return create_mesh(comm, cells.astype(np.int64), **given)


def blocks(cell="hexahedron", degree=1, cells=((2, 2, 2), (3, 3, 2)), mu=0.3, p=None, swapped=False, move=None, moduli=(E, E), solver=None, tol=1e-10, axis=None, gap=0.0, size=(1.0, 1.0), comm=COMM):  # fmt: skip
    """An upper block, ``[0, 1]^(d-1) x [0, 1]``, on a lower one below it; the bottom is held, the top moves.

    Args:
        swapped: Whether the lower one's facets carry the unknowns.
        move: Function that moves the mesh's coordinates in place.
        size: Lengths of upper and lower block along the surface.
    """
    d = len(cells[0])
    ends = [(np.zeros(d), np.append([s] * (d - 1), h)) for s, h in zip(size, (1.0, 1.0))]
    lower = (np.append(ends[1][0][:-1], -1.0), np.append(ends[1][1][:-1], 0.0))
    shift = (size[1] - size[0]) / 2
    low, high = ends[0][0].copy(), ends[0][1].copy()
    low[:-1] += shift
    high[:-1] += shift
    low[-1], high[-1] = gap, 1.0 + gap
    domain = joined([box(cell, low, high, cells[0]), box(cell, *lower, cells[1])], comm)
    fdim = d - 1

    def near(z):
        return mesh.locate_entities_boundary(domain, fdim, lambda x: np.isclose(x[d - 1], z))

    top, bottom, middle = near(1.0 + gap), near(-1.0), np.union1d(near(0.0), near(gap))
    domain.topology.create_connectivity(fdim, d)
    at = mesh.compute_midpoints if hasattr(mesh, "compute_midpoints") else None
    cells_of = domain.topology.connectivity(fdim, d)
    owner = np.array([cells_of.links(f)[0] for f in middle], dtype=int)
    centre = domain.geometry.x[cell_points(domain)[owner]].mean(axis=1)[:, d - 1]
    of_upper, of_lower = middle[centre > gap / 2], middle[centre < gap / 2]
    del at
    modulus = fem.Function(functionspace(domain, ("DG", 0)))
    count = domain.topology.index_map(d).size_local + domain.topology.index_map(d).num_ghosts
    heights = domain.geometry.x[cell_points(domain)[:count]].mean(axis=1)[:, d - 1]
    modulus.x.array[:] = np.where(heights > gap / 2, *moduli)
    if move is not None:
        move(domain.geometry.x)
    V = functionspace(domain, ("Lagrange", degree, (d,)))
    u = fem.Function(V)
    way = fem.Constant(domain, np.zeros(d))
    bcs = [fem.dirichletbc(way, fem.locate_dofs_topological(V, fdim, top), V)]
    bcs.append(fem.dirichletbc(np.zeros(d), fem.locate_dofs_topological(V, fdim, bottom), V))
    slave, master = (of_lower, of_upper) if swapped else (of_upper, of_lower)
    surface = dc.DeformableSurface(V, master, axis=axis)
    contact = dc.Contact(V, slave, surface, dc.Friction(mu, p))
    v, eps = ufl.TestFunction(V), lambda w: ufl.sym(ufl.grad(w))
    lame, shear = modulus * NU / ((1 + NU) * (1 - 2 * NU)), modulus / (2 * (1 + NU))
    stress = 2 * shear * eps(u) + lame * ufl.tr(eps(u)) * ufl.Identity(d)
    F = ufl.inner(stress, eps(v)) * ufl.dx
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, solver=solver, tol=tol)
    return SimpleNamespace(domain=domain, V=V, u=u, contact=contact, problem=problem, way=way, top=top, bottom=bottom, F=F, surface=surface)  # fmt: skip


__all__ = ["blocks", "joined", "elasticity"]
