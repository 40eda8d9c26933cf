# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A block whose top is held, on a plane, ball or roller that force drives: scenes for tests and benchmarks."""

from __future__ import annotations

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import ufl

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem

from dolfinx_contact.compat import functionspace
from mechanics.material import elasticity
from mechanics.scenes import box

STRAIN = 1e-3  # that a weight of one makes under a plane, about


class Load(NamedTuple):
    """One load step.

    Attributes:
        weight: In units of the scene's.
        shear: Force along x, in units of what friction along x carries under this weight.
        at: Where the weight acts, x and y, over the edge of the block: a moment.
        stroke: Displacement along x if it is prescribed, over the edge.
    """

    weight: float = 1.0
    shear: float = 0.0
    at: tuple = (0.0, 0.0)
    stroke: float = 0.0


def build_rig(
    kind="plane", free=("t1", "n"), weight=1.0, radius=1.0, offset=(0.0, 0.0), mu=0.2, p=None, cells=(4, 4, 2), E=210e3,
    nu=0.3, length=1.0,
):  # fmt: skip
    """A block of edges 1, 1, 0.6 times ``length`` over a surface that touches z = 0 from below.

    Args:
        kind: "plane", "ball" or "roller", the latter two with ``radius`` over the length of a cell, beside the middle by ``offset``.
        free: Names of the surface's free motions.
        weight: Times that which strains the block by about ``STRAIN``; under smaller balls as much less as their square is.
    """
    domain, foot, top, _ = box(cells, (1.0, 1.0, 0.6), None, 1.0, None, 1.0)
    domain.geometry.x[:] *= length
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v, held = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    F = elasticity(u, v, fem.Constant(domain, E), fem.Constant(domain, nu))
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, top))]
    R = length * radius / cells[0]
    centre = length * np.array([*offset, 0.0]) - [0, 0, R]
    surface, point = {
        "plane": lambda: (dc.RigidPlane(np.zeros(3), (0, 0, 1), (1, 0, 0)), np.zeros(3)),
        "ball": lambda: (dc.RigidSphere(centre, R, axis=(1, 0, 0)), centre),
        "roller": lambda: (dc.RigidCylinder(centre, (0, 1, 0), R), centre),
    }[kind]()
    surface.free = free
    contact = dc.Contact(V, foot, surface, dc.Friction(mu=mu, p=p))
    unit = weight * STRAIN * E * (length if kind == "plane" else min(length, R)) ** 2
    # A roller's axis, its first direction of friction, is across the way.
    carried = np.broadcast_to(mu, 2)[1 if kind == "roller" else 0]

    def apply(load: Load) -> SimpleNamespace:
        """Drive the surface; what it is to be in balance with."""
        force = load.weight * unit * np.array([load.shear * carried, 0.0, 1.0])
        moment = load.weight * unit * length * np.array([load.at[1], -load.at[0], 0.0])
        surface.force = force
        surface.moment = moment if surface.spins else None
        moved = surface.displacement.copy()
        if not {"t1", "x"} & set(free):
            moved[0] = length * load.stroke
        surface.displacement = moved
        return SimpleNamespace(force=force, moment=moment, moved=moved)

    return SimpleNamespace(
        V=V, u=u, F=F, bcs=bcs, held=held, contact=contact, surface=surface, facets=foot, mesh=domain, apply=apply, kind=kind,
        radius=R, point=point, free=free,
    )  # fmt: skip
