# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Half a thick ring (x > 0) between two planes that come down from above and up from below."""

from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from dolfinx import fem, mesh
from scenes import COMM

from dolfinx_contact.compat import second_order

INNER, DEEP = 0.6, 0.2  # of the ring of outer radius 1: inner radius, length of half of it


def clamp(V, axis, where, value=0.0):
    """A condition on one component at the nodes of a place."""
    part = V.sub(axis)
    whole, _ = part.collapse()
    dofs = fem.locate_dofs_geometrical((part, whole), where)
    held = fem.Function(whole)
    held.x.array[:] = value
    return fem.dirichletbc(held, dofs, part)


def half_ring(gdim, cells, curved=False):
    """The ring before it is bent, in quadrilaterals or bricks, straight or curved, and the facets that may touch above and below."""
    size = [*cells, 1][:gdim]
    kind = mesh.CellType.quadrilateral if gdim == 2 else mesh.CellType.hexahedron
    create = mesh.create_rectangle if gdim == 2 else mesh.create_box
    domain = create(COMM, [np.zeros(gdim), np.ones(gdim)], size, kind)
    domain = second_order(domain) if curved else domain

    def touching(side):
        return mesh.locate_entities_boundary(
            domain, gdim - 1, lambda x: np.isclose(x[0], 1.0) & (side * (x[1] - 0.5) > 0.1)
        )

    return domain, (touching(1), touching(-1))


def clamped_middle(V):
    """Conditions of symmetry of a ring that is not bent yet: its ends along x, its middle along y."""
    return [
        clamp(V, 0, lambda x: np.isclose(np.abs(x[1] - 0.5), 0.5)),
        clamp(V, 1, lambda x: np.isclose(x[1], 0.5)),
    ]


def bend(domain) -> None:
    x = domain.geometry.x
    radius, angle = INNER + (1 - INNER) * x[:, 0], np.pi * (x[:, 1] - 0.5)
    x[:, 0], x[:, 1], x[:, 2] = radius * np.cos(angle), radius * np.sin(angle), DEEP * x[:, 2]


def between_planes(F, u, sides, bcs, mu, tol):
    """The problem; ``press(depth)`` is one step of planes that have moved inwards by so much."""
    V, contacts = u.function_space, []
    gdim = V.mesh.geometry.dim
    for side, mine in zip((1.0, -1.0), sides):
        normal, axis = np.zeros(gdim), np.eye(gdim)[0]
        normal[1] = -side
        plane = dc.RigidPlane(-normal, normal, axis if gdim == 3 else None)
        contacts.append(dc.Contact(V, mine, plane, dc.Friction((mu, mu))))
    problem = dc.ContactProblem(F, u, contacts, bcs=bcs, tol=tol)

    def press(depth):
        for contact in contacts:
            contact.surface.displacement = depth * contact.surface.normal
        return problem.solve()

    return SimpleNamespace(problem=problem, contacts=contacts, press=press)
