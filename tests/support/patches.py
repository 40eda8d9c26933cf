# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Blocks of every cell under an even stress on a plane, whose exact state is known: patch tests."""

from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.mesh import CellType
from scenes import COMM, MPI, elasticity, rotation

from dolfinx_contact.compat import functionspace, second_order

E, NU = 210e3, 0.3
G, LAME = E / (2 + 2 * NU), E * NU / ((1 + NU) * (1 - 2 * NU))
MU, P = np.array([0.3, 0.15]), np.array([0.05, 0.2])
PRESSURE = 1e-3 * E
CELLS = {
    "triangle": (CellType.triangle, (3, 2)),
    "quadrilateral": (CellType.quadrilateral, (3, 2)),
    "tetrahedron": (CellType.tetrahedron, (2, 2, 2)),
    "hexahedron": (CellType.hexahedron, (2, 2, 2)),
    "prism": (CellType.prism, (2, 2, 2)),
}


def turned(d: int) -> np.ndarray:
    """A rotation of the whole scene that no axis survives."""
    return rotation(1) if d == 3 else np.array([[0.8, -0.6], [0.6, 0.8]])


def box(cell: str, distorted=True, curved=False, comm=COMM):
    """The unit square or cube, inner nodes and nodes in the faces moved within it; facets of its bottom and top."""
    kind, cells = CELLS[cell]
    d = len(cells)
    make = mesh.create_rectangle if d == 2 else mesh.create_box
    domain = make(comm, [np.zeros(d), np.ones(d)], cells, kind)
    domain = second_order(domain) if curved else domain
    bottom, top = (
        mesh.locate_entities_boundary(domain, d - 1, lambda x, z=z: np.isclose(x[d - 1], z)) for z in (0, 1)
    )  # fmt: skip
    if distorted:
        x = domain.geometry.x
        waves = np.sin(np.pi * x[:, :d])
        wave = waves[:, : d - 1].prod(
            axis=1
        )  # not zero on the bottom, where it moves nodes along it
        if curved and cell == "tetrahedron":
            wave = wave * waves[:, -1]  # there the facets stay as they are, see docs/method.md
        x[:, : d - 1] += 0.06 * wave[:, None] * np.array([1.0, -0.7])[: d - 1]
        x[:, d - 1] += 0.05 * waves.prod(axis=1)
    return domain, bottom, top


def even_state(d: int, slips: bool):
    """Gradient of a displacement of even stress on the plane, the traction of the plane, and the slip; the scene's axes."""
    if d == 2:
        along, slip = MU[:1], np.array([-2e-3])
    else:
        along = MU * np.array([np.cos(0.7), np.sin(0.7)])  # |M^-1 r_t| = r_n
        slip = -1e-4 * along / P**2  # along -P^-2 r_t
    along, slip = (along, slip) if slips else (0.5 * along, 0 * slip)
    traction = PRESSURE * np.append(along, 1.0)
    gradient = np.zeros((d, d))
    gradient[:-1, -1] = -traction[:-1] / G
    gradient[-1, -1] = -PRESSURE / (LAME + 2 * G)
    return gradient, traction, np.append(slip, 0.0)


def even_block(cell, slips, tilted, curved=False, distorted=True, comm=COMM):
    """A block under an even stress, turned: mesh, its gradient, traction and slip, and the work of its sides' tractions."""
    domain, bottom, top = box(cell, distorted, curved, comm)
    d = domain.geometry.dim
    turn = turned(d) if tilted else np.eye(d)
    domain.geometry.x[:, :d] = domain.geometry.x[:, :d] @ turn.T
    gradient, traction, slip = even_state(d, slips)
    gradient = turn @ gradient @ turn.T
    strain = (gradient + gradient.T) / 2
    pressure = LAME * np.trace(strain)
    sigma = pressure * np.eye(d) + 2 * G * strain
    # the sides are loaded; the forces that this makes on top and bottom are carried by support and plane
    sides = np.setdiff1d(mesh.exterior_facet_indices(domain.topology), np.union1d(bottom, top))
    tags = mesh.meshtags(domain, d - 1, sides, np.ones(sides.size, dtype=np.int32))
    ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)(1)
    load = fem.Constant(domain, sigma) * ufl.FacetNormal(domain)
    plane = dc.RigidPlane(np.zeros(d), turn[:, -1], turn[:, 0] if d == 3 else None)
    assert np.allclose(plane.frame, turn.T)
    friction = dc.Friction(MU, P) if d == 3 else dc.Friction(MU[0])
    return SimpleNamespace(
        mesh=domain, top=top, surface=plane, traction=traction, slip=slip, pressure=pressure,
        # exact for these curved bricks; what UFL takes by itself makes FFCx warn of so many points
        dx=ufl.dx(metadata={"quadrature_degree": 6}) if curved else ufl.dx,
        moved=lambda x: gradient @ x[:d] + (turn @ slip)[:, None],
        work=lambda v: ufl.inner(load, v) * ds,
        contact=lambda V: dc.Contact(V, bottom, plane, friction),
    )  # fmt: skip


def solved(block, F, u, bc, **options):
    """``block`` with its problem, contact, Function and the one step that ends in its state."""
    contact = block.contact(u.function_space)
    problem = dc.ContactProblem(F, u, contact, bcs=[bc], **options)
    made = dict(V=u.function_space, u=u, contact=contact, problem=problem)
    return SimpleNamespace(**vars(block) | made, step=problem.solve())


def pressed(
    cell,
    degree,
    slips,
    tilted,
    curved=False,
    distorted=True,
    solver=None,
    tol=1e-12,
    comm=COMM,
    **options,
):
    """A block under the tractions of an even stress, its top held where that puts it: one step of a ContactProblem."""
    block = even_block(cell, slips, tilted, curved, distorted, comm)
    d = block.mesh.geometry.dim
    V = functionspace(block.mesh, ("Lagrange", degree, (d,)))
    u, v, held = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    block.exact = block.moved(V.tabulate_dof_coordinates().T).T
    held.x.array[:] = block.exact.ravel()
    F = elasticity(u, v, E, NU, block.dx) - block.work(v)
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, d - 1, block.top))
    return solved(block, F, u, bc, solver=solver, tol=tol, **options)


def passes_patch_test(found) -> None:
    """Displacements, statuses, reactions and slips are those of the even stress."""
    size = found.u.x.array.size // len(found.slip)
    error = np.abs(found.u.x.array - found.exact.ravel()).max(initial=0.0)
    assert error <= 1e-10 * np.abs(found.exact).max(initial=1e-3), (error, size)
    carries_even_stress(found)


def carries_even_stress(found) -> None:
    """Statuses, reactions and slips are those of the even stress."""
    contact = found.contact
    force = contact.area[:, None] * found.traction
    scale = COMM.allreduce(np.abs(force).max(initial=0.0), op=MPI.MAX)
    assert np.abs(contact.reaction - force).max(initial=0.0) <= 1e-10 * scale
    slips = found.slip.any()
    assert (contact.status == (dc.Status.SLIP if slips else dc.Status.STICK)).all()
    assert np.abs(contact.slip_increment - found.slip[:-1]).max(initial=0.0) <= 1e-12
