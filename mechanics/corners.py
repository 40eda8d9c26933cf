# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A block in a groove of two planes, whose edge belongs to both contacts: scenes for tests and benchmarks."""

from __future__ import annotations

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import ufl
from mpi4py import MPI

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh

from dolfinx_contact.compat import functionspace
from mechanics.material import elasticity

STRAIN = 1e-3  # that a displacement of one makes, about


class Push(NamedTuple):
    """One load step: displacement of what is held, in units of ``STRAIN`` and of the edge.

    Attributes:
        across: From one face of the groove to the other.
        down: Into the groove.
        along: Along the groove, in three dimensions.
        turn: Turn about the edge of the groove.
    """

    across: float = 0.0
    down: float = 1.0
    along: float = 0.0
    turn: float = 0.0


def build_corner(
    angle=90.0, cells=(4, 4), mu=0.2, p=None, E=210e3, nu=0.3, length=1.0, held=True, gap=0.0, turned=0.0, comm=MPI.COMM_WORLD
):  # fmt: skip
    """A body with faces of ``length`` that meet at an angle and lie on the planes of a groove.

    Args:
        angle: Of the groove, degrees.
        cells: Along both faces, and in three dimensions along the groove; an edge as long as the others then.
        mu, p: One for both contacts, or a list of two.
        held: Whether the two other faces are held; else nothing but contact holds the body, under ``force`` per volume.
        gap: Of both planes at first, over ``length``.
        turned: Degrees, about the edge of the groove.
    """
    d = len(cells)
    ends, kind = [np.zeros(d), np.ones(d)], mesh.CellType.quadrilateral
    domain = (
        mesh.create_rectangle(comm, ends, cells, kind)
        if d == 2
        else mesh.create_box(comm, ends, cells, mesh.CellType.hexahedron)
    )
    sides = [
        mesh.locate_entities_boundary(domain, d - 1, lambda x, k=k, end=end: np.isclose(x[k], end))
        for end in (0, 1)
        for k in (0, 1)
    ]
    half, x = np.deg2rad(angle) / 2, domain.geometry.x
    c, s = np.cos(np.deg2rad(turned)), np.sin(np.deg2rad(turned))
    axes = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])[:d, :d]  # across, up, along
    right, left = (axes[0] * sign * np.sin(half) + axes[1] * np.cos(half) for sign in (1, -1))
    padded = np.zeros((3, 3))
    padded[:d, :d] = (right, left, *axes[2:])
    x[:] = length * x @ padded
    V = functionspace(domain, ("Lagrange", 1, (d,)))
    u, v, top, force = fem.Function(V), ufl.TestFunction(V), fem.Function(V), fem.Constant(domain, np.zeros(d))  # fmt: skip
    F = elasticity(u, v, fem.Constant(domain, E), fem.Constant(domain, nu)) - ufl.inner(force, v) * ufl.dx  # fmt: skip
    bcs = []
    if held:
        facets = np.unique(np.concatenate(sides[2:]))
        bcs = [fem.dirichletbc(top, fem.locate_dofs_topological(V, d - 1, facets))]
    normals = [(axes[1] * np.sin(half) - sign * axes[0] * np.cos(half)) for sign in (1, -1)]
    mus, ps = (value if isinstance(value, list) else [value] * 2 for value in (mu, p))
    axis = None if d == 2 else axes[2]
    contacts = [
        dc.Contact(V, side, dc.RigidPlane(-gap * length * n, n, axis), dc.Friction(one, q))
        for side, n, one, q in zip(sides[1::-1], normals, mus, ps)
    ]

    built = SimpleNamespace(
        V=V, u=u, F=F, bcs=bcs, held=top, force=force, contacts=contacts, normals=normals, axes=axes, mesh=domain,
        mu=mus, p=ps, E=E, length=length, angle=angle, sides=sides, gap=gap * length, cells=cells,
    )  # fmt: skip
    built.apply = lambda push: move(built, push)
    return built


def move(scene, push: Push) -> None:
    """Move what is held."""
    d, axes = len(scene.cells), scene.axes
    at = scene.V.tabulate_dof_coordinates()[:, :d]
    way = push.across * axes[0] - push.down * axes[1]
    if d == 3:
        way = way + push.along * axes[2]
    turn = np.outer(at @ axes[0], axes[1]) - np.outer(at @ axes[1], axes[0])
    moved = STRAIN * (scene.length * way + push.turn * turn)
    scene.held.x.array[: moved.size] = moved.ravel()
    scene.held.x.scatter_forward()
