# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Two deformable bodies that turn against each other: long steps slip along arcs, not along chords."""

import numpy as np
import pytest
from dolfinx import fem, mesh
from mpi4py import MPI
from two_bodies import COMM, blocks, dc, rubber

from dolfinx_contact.compat import functionspace
from dolfinx_contact.contact import mortar_points
from mechanics.two_blocks import box, joined

pytestmark = pytest.mark.ranks

MU = 0.2


def rings(swapped):
    """A rubber ring pressed into another one, R = 1; ``turn(angle)`` turns the inner one by its core."""
    over = 0.01
    parts = [box("quadrilateral", (0.0, low), (2 * np.pi, high), (n, 1)) for low, high, n in ((0.6, 1 + over, 24), (2.0, 2.4, 30))]  # fmt: skip
    domain = joined(parts)

    def near(r):
        return mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[1], r))

    core, shaft, bore, rim = map(near, (0.6, 1 + over, 2.0, 2.4))
    x = domain.geometry.x
    outer = x[:, 1] > 1.5
    angle, r = x[:, 0] + 0.05 * outer, x[:, 1] - outer
    x[:, 0], x[:, 1] = r * np.cos(angle), r * np.sin(angle)
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, turned = fem.Function(V), fem.Function(V)
    ends = (turned, core), (fem.Function(V), rim)
    bcs = [fem.dirichletbc(of, fem.locate_dofs_topological(V, 1, at)) for of, at in ends]
    slave, master = (bore, shaft) if swapped else (shaft, bore)
    contact = dc.Contact(V, slave, dc.DeformableSurface(V, master), MU)
    problem = dc.ContactProblem(rubber(u, 100.0, 100.0), u, [contact], bcs=bcs, tol=1e-7)
    at = V.tabulate_dof_coordinates()[:, :2]

    def turn(angle):
        cos, sin = np.cos(angle), np.sin(angle)
        turned.x.array[:] = (at @ np.array([[cos, sin], [-sin, cos]]) - at).ravel()
        return problem.solve()

    return turn, contact


def work(contact) -> float:
    return COMM.allreduce(contact.dissipation.sum())


@pytest.mark.parametrize("swapped", [False, True], ids=["shaft", "bore"])
@pytest.mark.parametrize("step", [1.5, pytest.param(0.4, marks=pytest.mark.slow)])
def test_work_of_a_turn(swapped, step):
    """That of all nodes' friction along the arc, whichever side carries the unknowns: of the chord it would be a third less."""
    turn, contact = rings(swapped)
    for angle in (0.0, step):
        turn(angle)
    before = work(contact)
    turn(2 * step)
    pressed = COMM.allreduce(contact.reaction[:, -1].sum())
    assert work(contact) - before == pytest.approx(MU * pressed * step, rel=0.01)


def test_a_turn_that_is_too_long(monkeypatch):
    """Beyond two radians, where solvers seldom get, a step is refused; shown with a lower limit."""
    monkeypatch.setattr(mortar_points, "LONGEST_TURN", 0.3)
    turn, _ = rings(False)
    for angle in (0.0, 0.2):
        turn(angle)
    with pytest.raises(dc.NotConverged, match="turn against each other by 0.4"):
        turn(0.6)


@pytest.mark.parametrize("swapped", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["upper", "lower"])  # fmt: skip
def test_a_block_that_spins(swapped):
    """A block turned about the normal in one step slips as far as in four: along chords it would be 2.6 % less."""
    found = []
    for steps in (1, 4):
        scene = blocks("hexahedron", 1, ((2, 2, 1), (4, 4, 1)), mu=MU, size=(1.0, 2.0), sliding="large", swapped=swapped, form=rubber, moduli=(100.0, 100.0), tol=1e-7)  # fmt: skip
        top, V = fem.Function(scene.V), scene.V
        dofs = fem.locate_dofs_topological(V, 2, scene.ends[0])
        scene.problem.bcs = [fem.dirichletbc(top, dofs), *scene.bcs[1:]]
        x = V.tabulate_dof_coordinates()
        for angle in np.linspace(0.0, 0.9, steps + 1):
            cos, sin = np.cos(angle), np.sin(angle)
            turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
            top.x.array[:] = ((x - [1.0, 1.0, 0.0]) @ turn - x + [1.0, 1.0, -0.05]).ravel()
            scene.problem.solve()
        path = scene.contact.slip_path.max(initial=0.0)
        found.append(COMM.allreduce(path, op=MPI.MAX))
    assert found[0] == pytest.approx(found[1], rel=5e-3)
