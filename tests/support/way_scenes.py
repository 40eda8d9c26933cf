# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Scenes in which node and surface go far within a step: a slab held at its head, and a ring on a shaft."""

from inspect import signature
from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from scenes import COMM

from dolfinx_contact.compat import functionspace

E = 1000.0


def stretched(V):
    """``u`` and the form of a body without Poisson's ratio."""
    u, v = fem.Function(V), ufl.TestFunction(V)
    return u, E * ufl.inner(ufl.sym(ufl.grad(u)), ufl.grad(v)) * ufl.dx


def slab(low, high, cells, surface, friction=0.0, **options):
    """A box held and moved at its head (last axis), whose foot meets a surface."""
    d = len(low)
    create, kind = ((mesh.create_box, mesh.CellType.hexahedron) if d == 3 else (mesh.create_rectangle, mesh.CellType.quadrilateral))  # fmt: skip
    domain = create(COMM, [np.array(low, float), np.array(high, float)], cells, kind)
    V = functionspace(domain, ("Lagrange", 1, (d,)))
    u, F = stretched(V)
    foot, head = (mesh.locate_entities_boundary(domain, d - 1, lambda x, z=z: np.isclose(x[d - 1], z)) for z in (low[-1], high[-1]))  # fmt: skip
    held = fem.Constant(domain, np.zeros(d))
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, d - 1, head), V)
    contact = dc.Contact(V, foot, surface, friction)
    problem = dc.ContactProblem(F, u, [contact], bcs=[bc], **options)

    def step(*where):
        held.value = np.array(where, dtype=float)
        return problem.solve()

    return SimpleNamespace(contact=contact, problem=problem, step=step, held=held, u=u, surface=surface)  # fmt: skip


def ring_mesh(radii, around=48):
    """Quadrilaterals between circles, all around."""
    t = 2 * np.pi * np.arange(around) / around
    k, next_ = np.arange(around), (np.arange(around) + 1) % around
    x = np.concatenate([np.column_stack((r * np.cos(t), r * np.sin(t))) for r in radii])
    cells = np.concatenate([around * j + np.column_stack((k, next_, around + k, around + next_)) for j in range(len(radii) - 1)])  # fmt: skip
    if COMM.rank > 0:
        x, cells = x[:0], cells[:0]
    if hasattr(ufl, "VectorElement"):  # legacy UFL elements
        element = ufl.Mesh(ufl.VectorElement("Lagrange", ufl.quadrilateral, 1))
    else:
        import basix.ufl

        element = basix.ufl.element("Lagrange", "quadrilateral", 1, shape=(2,))
    name = "domain" if "domain" in signature(mesh.create_mesh).parameters else "e"
    return mesh.create_mesh(COMM, cells, x=x, **{name: element})


def ring(radii, shaft, friction, held=None, touching=None, **options):
    """A ring on a shaft or in a bore, at the circle of radius ``touching``; held at another one or by contact alone."""
    domain = ring_mesh(radii)

    def circle(r):
        return mesh.locate_entities_boundary(
            domain, 1, lambda x: np.isclose(np.hypot(x[0], x[1]), r, rtol=0.02)
        )

    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, F = stretched(V)
    bcs = []
    if held is not None:
        dofs = fem.locate_dofs_topological(V, 1, circle(held))
        bcs = [fem.dirichletbc(np.zeros(2), dofs, V)]
    contact = dc.Contact(V, circle(touching or radii[0]), shaft, friction)
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, **options)
    return SimpleNamespace(contact=contact, problem=problem, u=u, surface=shaft)
