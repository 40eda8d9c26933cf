# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The bodies of the stress matrix: boxes on a plane, held at the top, at an end, or by soft springs."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import ufl
from mpi4py import MPI

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh

from dolfinx_contact.compat import functionspace


@dataclass(frozen=True)
class Move:
    """One load step of a scene, in its axes and in units of ``length``, ``E``.

    Attributes:
        top: Displacement of what is held, or of the springs' home.
        tilt: Turn of it about the y axis, small: ``u_z = tilt x``.
        load: Force per volume, for bodies with ``loads``; in units of ``E / length``.
        fresh: Whether the step starts from the undeformed body.
    """

    top: tuple = (0, 0, 0)
    tilt: float = 0.0
    load: tuple = (0, 0, 0)
    fresh: bool = False


def build(
    mu=0.2, p=None, cells=(4, 4, 2), E=210e3, nu=0.3, length=1.0, turn=None, aspect=1.0, jump=1.0,
    spring=None, edges=(1.0, 1.0, 0.6), tip=None, grade=1.0, coat=None, loads=False, touching=True,
):  # fmt: skip
    """A block, by default of edges 1, 1, 0.6 over ``aspect``, top held rigidly or by a soft ``spring``.

    Args:
        jump: Ratio of the moduli of neighbouring cells.
        spring: Stiffness of springs at the top over E / length; None holds the top.
        tip: Of a cantilever along x: its end is held instead of the top, and as much of the other end may touch.
        grade: Width of the largest cell over that of the smallest, in both directions of the plane.
        coat: Modulus over E, and thickness, of the lowest layer of cells.
        loads: Whether there is a force per volume.
        touching: Whether the problem has a contact at all.
    """
    turn = np.eye(3) if turn is None else turn
    domain, facets, top, soft = box(cells, edges, tip, grade, coat, aspect)
    modulus = fem.Function(functionspace(domain, ("Discontinuous Lagrange", 0)))
    modulus.x.array[:] = E * np.where(np.arange(modulus.x.array.size) % 2, jump, 1.0)
    if coat is not None:
        height = modulus.function_space.tabulate_dof_coordinates()[:, 2]
        modulus.x.array[height < soft] *= coat[0]
    domain.geometry.x[:] = length * domain.geometry.x @ turn.T
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    held, load = fem.Function(V), fem.Constant(domain, np.zeros(3))
    nu = fem.Constant(domain, float(nu))
    lmbda, shear = modulus * nu / ((1 + nu) * (1 - 2 * nu)), modulus / (2 * (1 + nu))
    eps = ufl.sym(ufl.grad(u))
    sigma = lmbda * ufl.tr(eps) * ufl.Identity(3) + 2 * shear * eps
    F = ufl.inner(sigma, ufl.sym(ufl.grad(v))) * ufl.dx
    if loads:
        F = F - ufl.inner(load, v) * ufl.dx
    bcs = []
    if spring is None:
        bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, top))]
    else:
        tags = mesh.meshtags(domain, 2, np.sort(top), np.ones(top.size, dtype=np.int32))
        ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)
        stiffness = fem.Constant(domain, spring * E / length)
        F = F + stiffness * ufl.inner(u - held, v) * ds(1)
    contact = None
    if touching:
        plane = dc.RigidPlane(point=(0, 0, 0), normal=turn[:, 2], axis=turn[:, 0])
        contact = dc.Contact(V, facets, plane, dc.Friction(mu=mu, p=p))
    x = V.tabulate_dof_coordinates() @ turn[:, 0]

    def move_top(move):
        move = move if isinstance(move, Move) else Move(top=tuple(move))
        moved = length / aspect * turn @ np.asarray(move.top, dtype=float)
        tilted = move.tilt * x[:, None] * turn[:, 2]
        held.x.array[:] = (moved + tilted).ravel()
        load.value[:] = E / length * turn @ np.asarray(move.load, dtype=float)

    return SimpleNamespace(
        V=V, u=u, F=F, bcs=bcs, contact=contact, move_top=move_top, turn=turn, axes=turn, held=held, facets=facets,
    )  # fmt: skip


def box(cells, edges, tip, grade, coat, aspect):
    """A mesh of hexahedra, facets that may touch, facets that are held, and the height of the coat."""
    half = np.array(edges) / 2
    low = np.array([-half[0], -half[1], 0.0])
    domain = mesh.create_box(
        MPI.COMM_SELF, [low, low + edges], cells, mesh.CellType.hexahedron
    )  # fmt: skip

    def bottom(x):
        return np.isclose(x[2], 0.0) & (True if tip is None else x[0] > half[0] - tip)

    def hold(x):
        return np.isclose(x[2], edges[2]) if tip is None else np.isclose(x[0], -half[0])

    facets, top = (mesh.locate_entities_boundary(domain, 2, where) for where in (bottom, hold))
    x = domain.geometry.x
    if grade != 1:
        for k in range(2):
            widths = np.geomspace(1, grade, cells[k])
            planes = np.append(0, np.cumsum(widths)) / widths.sum() * edges[k] - half[k]
            x[:, k] = np.interp(x[:, k], np.linspace(-half[k], half[k], cells[k] + 1), planes)
    if coat is not None:
        planes = np.append(0, np.linspace(coat[1], edges[2], cells[2]))
        x[:, 2] = np.interp(x[:, 2], np.linspace(0, edges[2], cells[2] + 1), planes)
    x[:, 2] /= aspect
    return domain, facets, top, None if coat is None else coat[1] / aspect
