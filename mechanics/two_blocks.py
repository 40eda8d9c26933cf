# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Two blocks in one mesh, one on the other, whose meshes do not match, for tests and benchmarks."""

from __future__ import annotations

from inspect import signature
from types import SimpleNamespace

import numpy as np
import ufl
from mpi4py import MPI

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh
from dolfinx.mesh import CellType, create_mesh

from dolfinx_contact import compat
from mechanics.material import elasticity

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


def build_two(
    cell="quadrilateral", degree=1, cells=((4, 2), (5, 2)), moduli=(1.0, 1.0), E=210e3, nu=0.3, mu=0.3, p=None, size=(1.0, 1.0),
    gap=0.0, shift=0.0, squeezed=1.0, radius=None, turn=None, length=1.0, swapped=False, sliding="large",
):  # fmt: skip
    """Linear elastic blocks of height one, the lower one from z = -1 to 0; its foot is held, ``move_top`` moves the head of the upper one.

    Args:
        moduli: Young's moduli of the upper and lower block over ``E``.
        size: Edges of both along the interface.
        gap: Between them; they overlap if it is negative.
        shift: Of the upper block along the first axis.
        squeezed: Factor of all heights: slender cells.
        radius: Of the upper block's lower face.
        turn: Rotation of the whole scene, ``shape=(d, d)``.
        swapped: Whether the lower block is the slave.
    """
    domain, top, bottom, upper, lower, above = pair(cell, cells, size, gap, MPI.COMM_SELF)
    d, x = domain.geometry.dim, domain.geometry.x
    turn = np.eye(d) if turn is None else turn[:d, :d]
    high = np.unique(compat.cell_points(domain)[: above.size][above])
    if radius is not None:
        off, height = x[high, 0] - size[1] / 2, x[high, d - 1] - gap
        x[high, d - 1] += (1 - height) * off**2 / (2 * radius)
    x[high, 0] += shift
    x[:, d - 1] *= squeezed
    x[:, :d] = length * x[:, :d] @ turn.T
    V = compat.functionspace(domain, ("Lagrange", degree, (d,)))
    u, v, held = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    modulus, moduli = fem.Function(compat.functionspace(domain, ("DG", 0))), E * np.array(moduli)
    modulus.x.array[:] = np.where(above, *moduli)
    F = elasticity(u, v, modulus, fem.Constant(domain, float(nu)))
    dofs = [fem.locate_dofs_topological(V, d - 1, facets) for facets in (top, bottom)]
    bcs = [fem.dirichletbc(held, dofs[0]), fem.dirichletbc(np.zeros(d), dofs[1], V)]
    slave, master = (lower, upper) if swapped else (upper, lower)
    surface = dc.DeformableSurface(V, master, axis=turn[:, 0] if d == 3 else None, sliding=sliding)
    contact = dc.Contact(V, slave, surface, dc.Friction(mu, p))

    height = length * squeezed

    def move_top(way):
        """By a displacement over the height of a block, scene's axes."""
        held.x.array[:] = np.tile(height * turn @ np.array(way, dtype=float), held.x.array.size // d)  # fmt: skip

    plain = nu == 0.0 and size[0] == size[1] and radius is None and shift == 0.0
    return SimpleNamespace(
        V=V, u=u, F=F, bcs=bcs, held=held, contact=contact, mesh=domain, slave=slave, master=master, turn=turn, length=length,
        height=height, gap=gap * height, mu=mu, p=p, sliding=sliding, radius=radius, move_top=move_top, sign=-1.0 if swapped else 1.0,
        moduli=moduli, thin=1 / squeezed**2, area=(length * size[0]) ** (d - 1), bars=moduli / height if plain else None,
    )  # fmt: skip
