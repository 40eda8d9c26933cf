# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Blocks in Taylor-Hood's mixed form, displacement and pressure, on planes."""

from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from patches import LAME, G, even_block, solved
from ring_scenes import bend, between_planes, clamped_middle, half_ring
from scenes import COMM

from dolfinx_contact import compat


def taylor_hood(domain, *more, pressure=("Lagrange", 1)):
    """Displacements of second order, pressures of first; ``more`` are further elements."""
    displacement = ("Lagrange", 2, (domain.geometry.dim,))
    return compat.mixed_functionspace(domain, [displacement, pressure, *more])


def held(W, facets, values=None, component=None):
    """A condition on displacements, or one of their components, at facets; ``values(x)``, None is zero."""
    part = W.sub(0) if component is None else W.sub(0).sub(component)
    whole, _ = part.collapse()
    where = fem.locate_dofs_topological((part, whole), W.mesh.topology.dim - 1, facets)
    value = fem.Function(whole)
    if values is not None:
        value.interpolate(values)
    return fem.dirichletbc(value, where, part), value


def elasticity(w, test, G, compliance, dx=ufl.dx, sign=1.0):
    """Internal virtual work of isotropic elasticity, ``p = lambda div u``; ``compliance`` is ``1 / lambda``."""
    (u, p), (v, q) = ufl.split(w), ufl.split(test)
    strain = ufl.sym(ufl.grad(u))
    work = 2 * G * ufl.inner(strain, ufl.sym(ufl.grad(v))) + p * ufl.div(v)
    return (work + sign * q * (ufl.div(u) - compliance * p)) * dx


def pressed(cell, slips, tilted, curved=False, solver=None, sign=1.0, **options):
    """A block under the tractions of an even stress, as ``patches.pressed``, in the mixed form."""
    even = even_block(cell, slips, tilted, curved)
    W = taylor_hood(even.mesh)
    w, test = fem.Function(W), ufl.TestFunction(W)
    bc, even.exact = held(W, even.top, even.moved)
    F = elasticity(w, test, G, 1 / LAME, even.dx, sign) - even.work(ufl.split(test)[0])
    return solved(even, F, w, bc, solver=solver, tol=1e-12, **options)


def block(
    n=4,
    compliance=0.02,
    mu=0.3,
    length=1.0,
    modulus=1.0,
    pressure=1.0,
    whole=True,
    load=None,
    confined=False,
    solver=None,
    tol=1e-8,
    comm=None,
    owners=None,
    **options,
):
    """A block of 2 by 1 on a plane in plane strain, its top moved by ``press(x, y)``, in shares of its height.

    Args:
        compliance: Shear modulus over lambda.
        length, modulus, pressure: Units; the last one of the unknown pressure alone, over the modulus.
        whole: Whether the top is held along the plane, too; else the side x = 0 is.
        confined: Whether the side x = 2 is held along x, too.
        owners: Partitioner; None is DOLFINx's.
        load: Force per volume, over modulus and length, of a block that nothing else holds than the plane.
    """
    corners, cells = [np.zeros(2), length * np.array([2.0, 1.0])], (2 * n, n)
    shared = {} if owners is None else {"partitioner": owners}
    domain = mesh.create_rectangle(comm or COMM, corners, cells, mesh.CellType.quadrilateral, **shared)  # fmt: skip
    bottom, top, side = (
        mesh.locate_entities_boundary(domain, 1, lambda x, i=i, at=at: np.isclose(x[i], at * length))
        for i, at in ((1, 0), (1, 1), (0, 0))
    )  # fmt: skip
    W = taylor_hood(domain)
    w, test = fem.Function(W), ufl.TestFunction(W)
    (u, p), (v, q) = ufl.split(w), ufl.split(test)
    strain, unit = ufl.sym(ufl.grad(u)), fem.Constant(domain, modulus * pressure)
    G, C = fem.Constant(domain, modulus), fem.Constant(domain, compliance / modulus)
    F = 2 * G * ufl.inner(strain, ufl.sym(ufl.grad(v))) + unit * p * ufl.div(v)
    F = (F + q * (ufl.div(u) - C * unit * p)) * ufl.dx
    bcs = [held(W, top)] if whole else [held(W, top, component=1), held(W, side, component=0)]
    if confined:
        far = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[0], 2 * length))
        bcs.append(held(W, far, component=0))
    if load is not None:
        bcs, weight = [], fem.Constant(domain, modulus / length * np.array(load))
        F = F - ufl.inner(weight, v) * ufl.dx
    plane = dc.RigidPlane((0, 0), (0, 1))
    contact = dc.Contact(W, bottom, plane, dc.Friction(mu))
    problem = dc.ContactProblem(F, w, contact, bcs=[bc for bc, _ in bcs], solver=solver, tol=tol, **options)  # fmt: skip

    def press(*share):
        values = bcs[0][1].x.array
        if whole:
            values[:] = np.tile(length * np.array(share), values.size // 2)
        else:
            values[:] = length * share[-1]
        return problem.solve()

    return SimpleNamespace(
        w=w, W=W, F=F, contact=contact, problem=problem, press=press, mesh=domain
    )


def ring(
    bulk,
    mu=0.0,
    cells=(2, 8),
    steps=12,
    tol=1e-9,
    jacobian=False,
    pressure=("Lagrange", 1),
    volume=5,
):
    """Half a ring of rubber of shear modulus 1 between two planes, height down by 30 %; as ``rubber_seal`` in test_bodies_of_users.py.

    Args:
        bulk: Bulk modulus; None is incompressible.
        jacobian: Whether the change of volume is an unknown, too.
        pressure: Its element.
        volume: Degree to which what changes the volume is integrated.
    """
    domain, sides = half_ring(2, cells, curved=True)
    W = taylor_hood(domain, *([("Lagrange", 1)] if jacobian else []), pressure=pressure)
    bcs = clamped_middle(W.sub(0))
    bend(domain)
    w = fem.Function(W)
    u, p, *theta = ufl.split(w)
    gradient = ufl.Identity(2) + ufl.grad(u)
    J = ufl.det(gradient)
    energy = (ufl.tr(gradient.T * gradient) - 2 - 2 * ufl.ln(J)) / 2
    if jacobian:
        of_volume = p * (J - 1 - theta[0]) + bulk / 2 * theta[0] ** 2
    else:
        of_volume = p * (J - 1) - (0 if bulk is None else p**2 / (2 * bulk))
    dx = [ufl.dx(metadata={"quadrature_degree": degree}) for degree in (5, volume)]
    F = ufl.derivative(energy * dx[0] + of_volume * dx[1], w, ufl.TestFunction(W))
    found = between_planes(F, w, sides, bcs, mu, tol)
    found.w, found.J, found.mesh = w, J, domain
    found.steps = [found.press(depth) for depth in 0.3 * np.arange(1, steps + 1) / steps]
    return found
