# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Blocks of rubber on a plane, held by symmetry or at the top, and what theory says of uniform states."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import ufl
from mpi4py import MPI
from scipy.optimize import brentq, fsolve

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh

from dolfinx_contact.compat import functionspace

G, LAME = 1.0, 2.0  # of rubber, in units of a modulus
HEIGHT = 0.8
MEASURE = {"quadrature_degree": 3}


def energy(u, modulus=1.0):
    """Neo-Hooke, G/2 (tr C - 3 - 2 ln J) + lambda/2 (ln J)^2; plane strain in two dimensions."""
    d = len(u)
    gradient = ufl.Identity(d) + ufl.grad(u)
    J = ufl.det(gradient)
    stretch = ufl.tr(gradient.T * gradient) + (3 - d)
    return modulus * (G / 2 * (stretch - 3 - 2 * ufl.ln(J)) + LAME / 2 * ufl.ln(J) ** 2)


def rubber(u, v, modulus=1.0):
    """Residual form of neo-Hooke."""
    dx = ufl.dx(domain=u.function_space.mesh, metadata=MEASURE)
    return ufl.derivative(energy(u, modulus) * dx, u, v)


def kirchhoff(stretches):
    """Principal Kirchhoff stresses of neo-Hooke."""
    return G * (np.square(stretches) - 1) + LAME * np.log(np.prod(stretches))


def sideways(stretch: float, gdim: int) -> float:
    """Stretch across of a block that is free to bulge."""
    fixed = [1.0] * (3 - gdim)
    return brentq(
        lambda t: kirchhoff([stretch] + [t] * (gdim - 1) + fixed)[1], 0.5, 3.0, xtol=1e-15
    )


def pressed(stretch: float, gdim: int) -> tuple[float, float]:
    """Force per reference area and stretch across of a block that is free to bulge."""
    across = sideways(stretch, gdim)
    stresses = kirchhoff([stretch] + [across] * (gdim - 1) + [1.0] * (3 - gdim))
    return -stresses[0] / stretch, across


def under_pressure(pressure: float, gdim: int) -> tuple[float, float]:
    """Stretch along and across of a block under a Cauchy pressure, free to bulge."""

    def left(stretches):
        along, across = stretches
        every = [along] + [across] * (gdim - 1) + [1.0] * (3 - gdim)
        stresses = kirchhoff(every)
        return [stresses[0] / np.prod(every) + pressure, stresses[1]]

    return tuple(fsolve(left, [1 - pressure / 3, 1.0], xtol=1e-12))


def block(
    form=rubber, cells=(3, 3, 2), mu=0.0, held=False, solver=None, tol=1e-9, length=1.0, modulus=1.0, cell=None,
    top=True, loads=lambda scene, v: 0.0, late=None, **options,
):  # fmt: skip
    """A block of edges 1, (1,) HEIGHT times ``length`` on a plane, free to bulge from two faces of symmetry.

    Args:
        form: ``form(u, v, modulus)``.
        held: Its top does not move sideways, and there is no symmetry.
        top: Whether the height of the top is given.
        loads: More of the residual form, ``loads(scene, v)``.
        late: Dictionary of options that ``form`` fills.
        options: Of the problem and, by their names, of ``InternalVariables``.
    """
    d = len(cells)
    high = np.array([1.0] * (d - 1) + [HEIGHT]) * length
    kinds = {2: mesh.CellType.quadrilateral, 3: mesh.CellType.hexahedron}
    create = mesh.create_box if d == 3 else mesh.create_rectangle
    domain = create(MPI.COMM_WORLD, [np.zeros(d), high], list(cells), cell or kinds[d])
    V = functionspace(domain, ("Lagrange", 1, (d,)))
    scene = SimpleNamespace(mesh=domain, V=V, u=fem.Function(V), d=d, length=length)

    def face(axis, at):
        return mesh.locate_entities_boundary(
            domain, d - 1, lambda x: np.isclose(x[axis], at, atol=1e-9 * length)
        )

    scene.top, scene.bottom = face(d - 1, high[-1]), face(d - 1, 0.0)
    tags = mesh.meshtags(domain, d - 1, np.sort(scene.top), np.ones(scene.top.size, dtype=np.int32))
    scene.ds = ufl.Measure("ds", domain=domain, subdomain_data=tags, metadata=MEASURE)(1)
    scene.moved = [fem.Constant(domain, 0.0) for _ in range(d)]
    zero = fem.Constant(domain, 0.0)

    def fix(axis, facets, value):
        part = V.sub(axis)
        return fem.dirichletbc(value, fem.locate_dofs_topological(part, d - 1, facets), part)

    bcs = [fix(d - 1, scene.top, scene.moved[-1])] if top else []
    for axis in range(d - 1):
        where = scene.top if held else face(axis, 0.0)
        bcs.append(fix(axis, where, scene.moved[axis] if held else zero))
    v = ufl.TestFunction(V)
    scene.F = form(scene.u, v, modulus) + loads(scene, v)
    axis = (1.0, 0.0, 0.0) if d == 3 else None
    scene.surface = dc.RigidPlane(point=np.zeros(d), normal=np.eye(d)[-1], axis=axis)
    friction = dc.Friction(mu=(mu, mu))
    scene.contact = dc.Contact(V, scene.bottom, scene.surface, friction)
    options |= dict(bcs=bcs, solver=solver, tol=tol, **(late or {}))
    named = {k: options.pop(k) for k in ("state", "before_residual", "after_step") if k in options}
    options["internal"] = dc.InternalVariables(**named) if named else None
    scene.problem = dc.ContactProblem(scene.F, scene.u, [scene.contact], **options)
    return scene


def move(scene, *displacement):
    """Displacement of the top, in units of ``length``."""
    for constant, value in zip(scene.moved[::-1], displacement[::-1]):
        constant.value = value * scene.length


def widest(scene):
    """Largest displacement sideways, in units of ``length``."""
    u = scene.u.x.array.reshape(-1, scene.d)[:, 0]
    return scene.problem.body.highest(u) / scene.length
