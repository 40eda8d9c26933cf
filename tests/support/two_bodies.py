# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Two blocks in one mesh, one on the other, whose meshes do not match."""

from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from patches import MU, P, even_state, turned
from scenes import COMM

from dolfinx_contact.compat import functionspace
from mechanics.two_blocks import pair

E, NU = 210e3, 0.3


def largest(values) -> float:
    """Largest magnitude over all ranks."""
    return max(COMM.allgather(float(np.abs(values).max(initial=0.0))))


def moduli_of(domain, above, moduli):
    """Young's modulus by cells, its Lame parameter and shear modulus."""
    modulus = fem.Function(functionspace(domain, ("DG", 0)))
    modulus.x.array[:] = np.where(above, *moduli)
    return modulus * NU / ((1 + NU) * (1 - 2 * NU)), modulus / (2 * (1 + NU))


def blocks(cell="hexahedron", degree=1, cells=((2, 2, 2), (3, 3, 2)), mu=0.3, p=None, swapped=False, moduli=(E, E), solver=None, tol=1e-10, axis=None, gap=0.0, size=(1.0, 1.0), comm=COMM, sliding="small", form=None, held=True, **options):  # fmt: skip
    """A block on another one; the bottom is held, or moves by ``foot``, the top moves by ``way``.

    Args:
        swapped: Whether the lower one's facets carry the unknowns.
        size: Lengths of upper and lower block along the surface.
        form: Residual of displacement and Lame's constants; None is linear elasticity.
        held: Whether the top is moved; else it carries the even force ``load``.
    """
    domain, top, bottom, upper, lower, above = pair(cell, cells, size, gap, comm)
    d = domain.geometry.dim
    V = functionspace(domain, ("Lagrange", degree, (d,)))
    u, way, foot = fem.Function(V), *(fem.Constant(domain, np.zeros(d)) for _ in range(2))
    ends = ((way, top), (foot, bottom))
    bcs = [fem.dirichletbc(by, fem.locate_dofs_topological(V, d - 1, at), V) for by, at in ends[not held:]]  # fmt: skip
    slave, master = (lower, upper) if swapped else (upper, lower)
    surface = dc.DeformableSurface(V, master, axis=axis, sliding=sliding)
    contact = dc.Contact(V, slave, surface, dc.Friction(mu, p))
    lame, shear = moduli_of(domain, above, moduli)
    F = work(u, V, lame, shear) * ufl.dx if form is None else form(u, lame, shear)
    load, tags = fem.Constant(domain, np.zeros(d)), mesh.meshtags(domain, d - 1, np.sort(top), np.ones(top.size, np.int32))  # fmt: skip
    if not held:
        ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)(1)
        F -= ufl.inner(load, ufl.TestFunction(V)) * ds
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, solver=solver, tol=tol, **options)
    return SimpleNamespace(domain=domain, V=V, u=u, contact=contact, problem=problem, way=way, foot=foot, load=load, bcs=bcs, F=F, ends=(top, bottom))  # fmt: skip


def rubber(u, lame, shear):
    """Neo-Hooke: ``mu / 2 (tr C - d - 2 ln J) + lambda / 2 (ln J)^2``."""
    d = len(u)
    G = ufl.Identity(d) + ufl.grad(u)
    log = ufl.ln(ufl.det(G))
    energy = shear / 2 * (ufl.tr(G.T * G) - d - 2 * log) + lame / 2 * log**2
    return ufl.derivative(
        energy * ufl.dx(metadata={"quadrature_degree": 4}), u, ufl.TestFunction(u.function_space)
    )


def stress(w, lame, shear):
    strain = ufl.sym(ufl.grad(w))
    return 2 * shear * strain + lame * ufl.tr(strain) * ufl.Identity(len(w))


def work(u, V, lame, shear):
    return ufl.inner(stress(u, lame, shear), ufl.grad(ufl.TestFunction(V)))


def patch(cell, degree, slips, moduli=(E, E), tilted=True, swapped=False, cells=None, solver=None, comm=COMM):  # fmt: skip
    """Two blocks under one even stress, meshes distorted and turned; the exact displacement, and the traction in the local frame."""
    d = 2 if cell in ("triangle", "quadrilateral") else 3
    cells = cells or (((3, 2), (4, 2)) if d == 2 else ((2, 2, 1), (3, 2, 1)))
    domain, top, bottom, upper, lower, above = pair(cell, cells, comm=comm)
    x, turn = domain.geometry.x, turned(d) if tilted else np.eye(d)
    wave = np.sin(np.pi * x[:, : d - 1]).prod(axis=1, keepdims=True)
    x[:, : d - 1] += 0.06 * wave * np.array([1.0, -0.7])[: d - 1]
    x[:, :d] = x[:, :d] @ turn.T
    _, traction, slip = even_state(d, slips)
    V = functionspace(domain, ("Lagrange", degree, (d,)))
    lame, shear = moduli_of(domain, above, moduli)
    exact = fem.Function(V)
    cells_of = V.dofmap
    for part, modulus, moved in ((~above, moduli[1], 0.0), (above, moduli[0], 1.0)):
        G = modulus / (2 * (1 + NU))
        gradient = np.zeros((d, d))
        gradient[:-1, -1] = -traction[:-1] / G
        gradient[-1, -1] = -traction[-1] / (G * (2 + 2 * NU / (1 - 2 * NU)))
        nodes = np.unique(np.concatenate([[], *(cells_of.cell_dofs(k) for k in np.flatnonzero(part))]).astype(int))  # fmt: skip
        at = V.tabulate_dof_coordinates()[nodes, :d] @ turn
        rows = (at @ gradient.T + moved * slip) @ turn.T
        exact.x.array[(d * nodes[:, None] + np.arange(d)).ravel()] = rows.ravel()
    u, v = fem.Function(V), ufl.TestFunction(V)
    held = [fem.locate_dofs_topological(V, d - 1, facets) for facets in (top, bottom)]
    bcs = [fem.dirichletbc(exact, dofs) for dofs in held]
    middle = np.union1d(upper, lower)
    outer = np.setdiff1d(mesh.locate_entities_boundary(domain, d - 1, lambda x: np.full(x.shape[1], True)), middle)  # fmt: skip
    tags = mesh.meshtags(domain, d - 1, outer.astype(np.int32), np.ones(outer.size, np.int32))
    ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)
    outside = ufl.inner(ufl.dot(stress(exact, lame, shear), ufl.FacetNormal(domain)), v) * ds(1)
    slave, master = (lower, upper) if swapped else (upper, lower)
    axis = turn[:, 0] if d == 3 else None
    surface = dc.DeformableSurface(V, master, axis=axis, sliding="small")
    friction = dc.Friction(MU, P) if d == 3 else dc.Friction(MU[0])
    contact = dc.Contact(V, slave, surface, friction)
    F = work(u, V, lame, shear) * ufl.dx - outside
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, solver=solver, tol=1e-10)
    return SimpleNamespace(contact=contact, problem=problem, u=u, exact=exact, traction=traction, slip=slip, turn=turn)  # fmt: skip
