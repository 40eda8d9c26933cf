# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A ball on a half space of another material, a quarter of both: Hertz in three dimensions, cells at the contact of an eighth of its radius."""

import demo_ball_on_flat as demo
import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from helpers import hooke, point_force_field

import dolfinx_contact as dc
from dolfinx_contact import compat
from mechanics.two_blocks import pair

pytestmark = pytest.mark.slow
E, NU = (1000.0, 4000.0), (0.3, 0.25)  # of the ball and of the half space
R, A = demo.R, demo.A
SIZE, GRADING, CELLS = 5.8 * A, 2.6, (19, 20)  # of the side with the unknowns, and of the other
E_STAR = 1 / sum((1 - nu**2) / e for e, nu in zip(E, NU))
DIRECT = {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}


def bodies(cells):
    """The mesh of a quarter of both bodies, fine at the origin; facets of both that may touch; which cells are above."""
    domain, _, _, upper, lower, above = pair("hexahedron", [(n, n, n) for n in cells])
    x = domain.geometry.x
    x[:] = SIZE * np.sinh(GRADING * x) / np.sinh(GRADING)
    near = mesh.locate_entities_boundary(domain, 2, lambda x: (x[:2] < 1.6 * A).all(axis=0) & (x[2] < A))  # fmt: skip
    ball = np.unique(compat.cell_points(domain)[: above.size][above])
    x[ball, 2] += (1 - x[ball, 2] / SIZE) * (x[ball, :2] ** 2).sum(axis=1) / (2 * R)
    return domain, np.intersect1d(upper, near), np.intersect1d(lower, near), above


def far_field(x):
    """Displacements of half spaces under the force of the closed form, the ball comes nearer by ``A^2 / R``; at the rim it is above zero."""
    force, at = 4 * E_STAR * A**3 / (3 * R), [x[0], x[1], -np.abs(x[2])]
    above, below = (point_force_field(at, force, *of) for of in zip(E, NU))
    above[2] *= -1
    above[2] -= A**2 / R
    return np.where(x[2] > 1e-9 * SIZE, above, below)


def pressed(swapped):
    """The contact of a solved problem, the lower body's facets with the unknowns if ``swapped``."""
    domain, upper, lower, above = bodies(CELLS[::-1] if swapped else CELLS)
    V, DG = (compat.functionspace(domain, of) for of in (("Lagrange", 1, (3,)), ("DG", 0)))
    u, v, held = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    modulus, ratio = fem.Function(DG), fem.Function(DG)
    for of, values in ((modulus, E), (ratio, NU)):
        of.x.array[:] = np.where(above, *values)
    F = ufl.inner(hooke(ufl.sym(ufl.grad(u)), modulus, ratio), ufl.grad(v)) * ufl.dx
    held.interpolate(far_field)
    bcs = []
    for k in range(3):
        end = mesh.locate_entities_boundary(
            domain, 2, lambda x, k=k: np.isclose(np.abs(x[k]), SIZE)
        )
        bcs.append(fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, end)))
    for k in range(2):
        side = mesh.locate_entities_boundary(domain, 2, lambda x, k=k: np.isclose(x[k], 0.0))
        bcs.append(fem.dirichletbc(0.0, fem.locate_dofs_topological(V.sub(k), 2, side), V.sub(k)))
    slave, master = (lower, upper) if swapped else (upper, lower)
    surface = dc.DeformableSurface(V, master, sliding="small")
    contact = dc.Contact(V, slave, surface, dc.Friction(0.0))
    dc.ContactProblem(F, u, [contact], bcs=bcs, petsc_options=DIRECT).solve()
    return contact


def test_two_balls():
    """Peak pressure to 1 %, radius, by the second moment of the reactions, to 2 %, for the force found; sides swapped: peak and force to 0.5 %."""
    forces, peaks = [], []
    for swapped in (False, True):
        contact = pressed(swapped)
        normal, pressure, x = demo.on_all_ranks(contact.reaction[:, 2], contact.pressure, contact.x)
        forces.append(4 * abs(contact.force()[2]))
        peaks.append(pressure.max())
        a = (3 * forces[-1] * R / (4 * E_STAR)) ** (1 / 3)
        radius = np.sqrt(2.5 * (normal @ (x[:, :2] ** 2).sum(axis=1)) / normal.sum())
        h = SIZE * np.sinh(GRADING / CELLS[0]) / np.sinh(GRADING)
        assert h < 0.12 * a
        assert radius == pytest.approx(a, rel=0.02)
        assert peaks[-1] == pytest.approx(2 * E_STAR * a / (np.pi * R), rel=0.01)
    assert forces[1] == pytest.approx(forces[0], rel=0.005)
    assert peaks[1] == pytest.approx(peaks[0], rel=0.005)
