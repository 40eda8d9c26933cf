# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A rigid pin that fills the hole of an elastic ring, all around: the pressure of Lamé, torsion, the torque at which it turns.

The ring is held at its outer radius ``b``; the pin, of radius ``a + d``, is pressed in.  In plane strain ``u_r = A r + B / r``
with ``u_r(a) = d``, ``u_r(b) = 0``; turned by ``w`` without slip ``u_t = C (r - b^2 / r)`` with ``u_t(a) = a w``; it turns at
the torque ``2 pi a^2 mu p`` [S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, 1970, Sections 28 and 31].
"""

from types import SimpleNamespace

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace, model_to_mesh
from mechanics.material import elasticity

gmsh = pytest.importorskip("gmsh")
COMM = scenes.COMM
E, NU, INNER, OUTER, MU, TOO_LARGE = 1000.0, 0.3, 1.0, 2.0, 0.25, 1e-3
G = E / (2 * (1 + NU))


def ring_mesh(around: int = 16, through: int = 16):
    """Quadrilaterals, so many in a quarter and through the thickness, alike all around."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    if COMM.rank == 0:
        model = gmsh.model.geo
        middle = model.addPoint(0, 0, 0)
        rings = [[model.addPoint(r * c, r * s, 0) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))] for r in (INNER, OUTER)]  # fmt: skip
        arcs = [[model.addCircleArc(ring[k], middle, ring[(k + 1) % 4]) for k in range(4)] for ring in rings]  # fmt: skip
        spokes = [model.addLine(rings[0][k], rings[1][k]) for k in range(4)]
        surfaces = []
        for k in range(4):
            loop = model.addCurveLoop([spokes[k], arcs[1][k], -spokes[(k + 1) % 4], -arcs[0][k]])
            surfaces.append(model.addPlaneSurface([loop]))
        for curves, cells in ((arcs[0] + arcs[1], around), (spokes, through)):
            for curve in curves:
                model.mesh.setTransfiniteCurve(curve, cells + 1)
        for surface in surfaces:
            model.mesh.setTransfiniteSurface(surface)
            model.mesh.setRecombine(2, surface)
        model.synchronize()
        gmsh.model.addPhysicalGroup(2, surfaces)
        gmsh.model.mesh.generate(2)
    found = model_to_mesh(gmsh.model, COMM, 0).mesh
    gmsh.finalize()
    return found


def ring(solver):
    """Held outside; a pin that is too large inside, turned by an angle."""
    domain = ring_mesh()
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    inside, outside = (
        mesh.locate_entities_boundary(domain, 1, lambda x, r=r: np.isclose(np.hypot(x[0], x[1]), r))
        for r in (INNER, OUTER)
    )
    bc = fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, outside), V)
    pin = dc.RigidSphere((0, 0), INNER + TOO_LARGE)
    contact = dc.Contact(V, inside, pin, dc.Friction(MU))
    problem = dc.ContactProblem(elasticity(u, v, E, NU), u, [contact], bcs=[bc], solver=solver)
    return SimpleNamespace(problem=problem, contact=contact, pin=pin)


def torque(contact) -> float:
    return float(np.ravel(contact.moment())[0])


@pytest.mark.parametrize("solver", [None, dc.FixedPoint()], ids=["default", "fixed point"])
def test_a_pin_all_around_has_the_pressure_and_the_torque_of_closed_forms(solver):
    """Pressure and torsion to 1 %, even all around to 1e-6; the torque at which all slips is mu times radius times force."""
    scene = ring(solver)
    contact, pin, problem = scene.contact, scene.pin, scene.problem
    assert problem.solve().counts.open == 0
    lame = 2 * G * NU / (1 - 2 * NU)
    part = TOO_LARGE / (INNER - OUTER**2 / INNER)  # A, B = -A b^2
    pressure = -2 * (lame + G) * part - 2 * G * part * OUTER**2 / INNER**2
    normal = contact.reaction[:, -1]
    carried = COMM.allreduce(normal.sum())
    assert carried == pytest.approx(pressure * 2 * np.pi * INNER, rel=0.01)
    assert np.abs(normal * COMM.allreduce(normal.size) / carried - 1).max(initial=0.0) < 1e-6
    assert np.linalg.norm(contact.force()) < 1e-8 * carried

    small = 0.2 * MU * TOO_LARGE
    pin.rotation = small
    step = problem.solve()
    assert step.counts.slip == 0
    turned = small / (1 - OUTER**2 / INNER**2)  # C, the shear stress is 2 G C b^2 / r^2
    stuck = 2 * np.pi * INNER**2 * 2 * G * turned * OUTER**2 / INNER**2
    assert abs(torque(contact)) == pytest.approx(abs(stuck), rel=0.01)

    pin.rotation = 10 * small
    step = problem.solve()
    assert step.counts.stick == step.counts.open == 0
    carried = COMM.allreduce(contact.reaction[:, -1].sum())
    assert abs(torque(contact)) == pytest.approx(MU * carried * INNER, rel=2 * TOO_LARGE)
