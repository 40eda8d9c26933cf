# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Supports along a tangential direction that is none of the frame's: the law of the direction that is left."""

from types import SimpleNamespace

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
SOLVERS = {"condensed": dc.CondensedNewton, "fixed point": dc.FixedPoint}
AXES = [(1.0, 0.0, 0.0), (1.0, 0.6, 0.0), (0.2, -1.0, 0.0), (1.0, 1.0, 0.0)]


def block(friction, axis, solver, held="side", length=1.0, E=210e3):
    """A cube on a plane with a given axis; a driven head; of its side x = 0 or of its foot the displacement along y or x is zero.

    Returns:
        The problem, its contact, the Function that holds the head's displacement, and what the support holds.
    """
    domain = mesh.create_box(COMM, [np.zeros(3), np.ones(3)], [3, 4, 2], mesh.CellType.hexahedron)
    domain.geometry.x[:] *= length
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v, head = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    top, foot, side = (
        mesh.locate_entities_boundary(
            domain, 2, lambda x, i=i, at=at: np.isclose(x[i], at * length, atol=1e-9 * length)
        )
        for i, at in ((2, 1.0), (2, 0.0), (0, 0.0))
    )
    bcs = [fem.dirichletbc(head, fem.locate_dofs_topological(V, 2, top))]
    component, where = (V.sub(0), side) if held == "side" else (V.sub(1), foot)
    across = fem.Constant(domain, 0.0)
    bcs.append(fem.dirichletbc(across, fem.locate_dofs_topological(component, 2, where), component))
    contact = dc.Contact(V, foot, dc.RigidPlane((0, 0, 0), (0, 0, 1), axis=axis), friction)
    F = scenes.elasticity(u, v, E, 0.3)
    return (
        dc.ContactProblem(F, u, [contact], bcs=bcs, solver=SOLVERS[solver](), tol=1e-10),
        contact,
        head,
        across,
    )


def reactions(contact):
    """Places and reactions of all nodes, global components."""
    x, r = scenes.gathered(contact)
    return x, r @ contact.frame


def drive(head, *displacement):
    head.x.array.reshape(-1, 3)[:] = displacement


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("units", [(1.0, 1.0), (1e-6, 1e9)])
def test_isotropic_friction_does_not_see_the_axes_of_the_frame(solver, units):
    """Half a cube behind its plane of symmetry: the same reactions in space whatever the plane's axis."""
    length, E = units
    found = []
    for axis in AXES:
        problem, contact, head, _ = block(dc.Friction(0.3), axis, solver, length=length, E=E)
        for step in ((0.0, 0.0, -0.01), (0.0, 0.004, -0.01), (0.0, -0.002, -0.012)):
            drive(head, *np.multiply(step, length))
            problem.solve()
        found.append(reactions(contact)[1])
        slip = COMM.allreduce(contact.slip_path.sum(), op=MPI.SUM)
        found.append(np.full((1, 3), slip * E * length))
    size = np.abs(found[0]).max()
    for r, path in zip(found[2::2], found[3::2]):
        assert np.abs(r - found[0]).max() < 1e-7 * size
        assert np.abs(path - found[1]).max() < 1e-6 * np.abs(found[1]).max()


def drag(law, angle, slip):
    """P^2 s / |M^-1 P^2 s| of slips in space, ``shape=(n, 2)``, axes at an angle to x."""
    mu, p = np.array(law["mu"]), np.array(law.get("p", law["mu"]))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    along = p**2 * (slip @ turn.T)
    return along / np.linalg.norm(along / mu, axis=1)[:, None] @ turn


LAWS = [dict(mu=(0.4, 0.1)), dict(mu=(0.4, 0.1), p=(0.05, 0.2)), dict(mu=(0.2, 0.2))]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("angle", [0.3, 2.5])
def test_a_guided_foot_has_the_friction_of_the_slip_rule(solver, law, angle):
    """Every node slides along x: by the rule friction is d(x), across x, too; moved across, it follows the slip in both."""
    axis = (np.cos(angle), np.sin(angle), 0.0)
    problem, contact, head, across = block(dc.Friction(**law), axis, solver, held="foot")
    drive(head, 0.0, 0.0, -0.01)
    problem.solve()
    for way, moved in ((1.0, 0.0), (-1.0, 0.0), (1.0, 0.2), (-1.0, -0.4), (-1.5, -0.4)):
        drive(head, 0.5 * way, moved, -0.01)
        given, across.value = moved - across.value, moved
        before = COMM.allreduce(contact.dissipation.sum(), op=MPI.SUM)
        step = problem.solve()
        x, r = reactions(contact)
        slip = (
            scenes.by_position(SimpleNamespace(contact=contact), "slip_increment")
            @ contact.frame[:2, :2]
        )
        assert np.abs(slip[:, 1] - given).max() < 1e-12
        expected = -r[:, 2:] * drag(law, angle, slip)
        touching = r[:, 2] > 0.0
        assert step.counts.stick == 0 and touching.sum() > 10
        assert np.abs(r[:, :2] - expected).max() < 1e-8 * r[:, 2].max()
        assert max(step.error, step.slip_error) < 1e-10
        assert np.abs(contact.force()[:2] - expected.sum(axis=0)).max() < 1e-8 * r[:, 2].sum()
        done = COMM.allreduce(contact.dissipation.sum(), op=MPI.SUM) - before
        assert done > 0.3 * -(expected * slip).sum() > 0.0


def test_another_law_is_cut_too():
    """Laws exchanged between steps, fields of friction, nodes without any: e.M^2 e / |M e| of the law at hand."""
    problem, contact, head, _ = block(
        dc.Friction((0.4, 0.1)), (1.0, 1.0, 0.0), "condensed", held="foot"
    )
    drive(head, 0.5, 0.0, -0.01)
    for law, at in (
        (dc.Friction((0.4, 0.1)), lambda x: 0.0 * x[:, 0] + np.hypot(0.4, 0.1) / 2),
        (dc.Friction((0.2, 0.3)), lambda x: 0.0 * x[:, 0] + np.hypot(0.2, 0.3) / 2),
        (dc.Friction(lambda x: 0.1 + 0.2 * x[1]), lambda x: np.sqrt(0.5) * (0.1 + 0.2 * x[:, 1])),
        (dc.Friction(lambda x: 0.4 * (x[1] > 0.4)), lambda x: np.sqrt(0.5) * 0.4 * (x[:, 1] > 0.4)),
        (dc.Friction(0.0), lambda x: 0.0 * x[:, 0]),
    ):
        problem.reset()
        contact.friction = law
        problem.solve()
        x, r = reactions(contact)
        expected = at(x) * np.sqrt(2.0)
        assert np.abs(r[:, 0] + expected * r[:, 2]).max() < 1e-7 * r[:, 2].max()


def test_a_support_oblique_to_the_plane_is_refused():
    """Held along a direction that is neither in the plane nor its normal, a node can neither slide nor lift off freely; zeros
    that a mesh generator writes as 2e-17 are zeros in the message."""
    scene = scenes.block()
    scene.mesh.geometry.x[:, 2] += 2e-17
    plane = dc.RigidPlane((0, 0, 0), (0.3, 0, 1), axis=(0, 1, 0))
    contact = dc.Contact(scene.V, scene.facets, plane, dc.Friction(0.3))
    side = mesh.locate_entities_boundary(scene.mesh, 2, lambda x: np.isclose(x[0], -0.5))
    Vx = scene.V.sub(0)
    bc = fem.dirichletbc(
        fem.Constant(scene.mesh, 0.0), fem.locate_dofs_topological(Vx, 2, side), Vx
    )
    with pytest.raises(
        ValueError, match=r"node at \(-0.5, [^,]*, 0\) is held .* oblique to the plane"
    ):
        dc.ContactProblem(scene.F, scene.u, [contact], bcs=[*scene.bcs, bc])
