# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Slip of nodes that land or open within a step: one step does what many do, body or surface moved."""

import numpy as np
import pytest
from dolfinx import mesh
from way_scenes import COMM, slab

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from dolfinx_contact.contact.contact_step import step_of

# The plate stands for two springs: that it is strained by a fifth is no matter.
pytestmark = [pytest.mark.ranks, pytest.mark.filterwarnings("ignore:the body is strained")]
MU, SHEAR, PRESS = 0.3, 1e4, 2e4  # of the plate: stiffness along and across, force per length


def total(values) -> float:
    return COMM.allreduce(float(np.sum(values)))


def plate(solver=None, **options):
    """A plate 0.5 above a plane."""
    plane = dc.RigidPlane((0, 0, -0.5), (0, 0, 1))
    return slab([0, 0, 0], [1, 1, 0.05], [4, 4, 1], plane, MU, solver=solver, **options)


def led(scene, moved, places):
    """Plane or plate led to places of the plane, one step each; force, mean path and work."""
    for place in places:
        if moved == "surface":
            scene.surface.displacement = place
            scene.problem.solve()
        else:
            scene.step(*-np.asarray(place, dtype=float))
    contact = scene.contact
    return contact.force(), total(contact.slip_path) / 25, total(contact.dissipation)


SOLVERS = pytest.mark.parametrize("solver", [None, dc.FixedPoint()], ids=["default", "fixed point"])


@SOLVERS
@pytest.mark.parametrize("moved", ["surface", "body"])
def test_who_lands_obliquely_slips_from_there_on(moved, solver):
    """Sideways by 0.05 on the way down by 0.501: the plate is sheared by what is left when it lands, and sticks."""
    left = 0.05 * (1 - 0.5 / 0.501)
    for places in ([(0.05, 0, 0.501)], [(0.05 - left, 0, 0.5), (0.05, 0, 0.501)]):
        force, path, work = led(plate(solver), moved, places)
        assert force == pytest.approx([SHEAR * left, 0, PRESS * 0.001], rel=1e-6, abs=1e-6)
        assert path == work == 0.0


@SOLVERS
@pytest.mark.parametrize("moved", ["surface", "body"])
def test_who_lands_sliding_does_the_work_after_landing(moved, solver):
    """Force at the end, path and work are those of a step up to the landing and one from there."""
    landed, end = np.array([5.0, 0, 0.5]), np.array([5.1, 0, 0.51])
    sides = [led(plate(solver), moved, places) for places in ([end], [landed, end])]
    force, path, work = sides[1]
    assert force == pytest.approx([MU * PRESS * 0.01, 0, PRESS * 0.01], rel=1e-6, abs=1e-6)
    assert path == pytest.approx(0.1 - MU * 0.01 * PRESS / SHEAR, rel=1e-3)
    # on the straight way from the first place less is left after landing
    share = 1 - 0.5 / 0.51
    force, path, work_of_one = sides[0]
    assert force == pytest.approx([MU * PRESS * 0.01, 0, PRESS * 0.01], rel=1e-6, abs=1e-6)
    assert path == pytest.approx(5.1 * share - MU * 0.01 * PRESS / SHEAR, rel=1e-3)
    assert work_of_one / work == pytest.approx(path / sides[1][1], rel=1e-3)


@SOLVERS
@pytest.mark.parametrize("moved", ["surface", "body"])
def test_who_takes_off_obliquely_slips_until_then(moved, solver):
    """A plate pressed in by 0.01 is left sideways by 1 while it is taken off by 1.01: a hundredth of that is slip."""
    force, path, work = led(plate(solver), moved, [(0, 0, 0.51), (1, 0, -0.5)])
    assert (force == 0.0).all()
    assert path == pytest.approx(0.01 / 1.01, rel=1e-6)
    assert 0.0 < work <= MU * PRESS * 0.01 * 0.01 / 1.01


def test_wear_of_a_flight_is_none():
    """Nor is any left by landing where nothing slips after it."""
    scene = plate()
    scene.contact.wear = dc.Wear(1e-3)
    led(scene, "surface", [(0.05, 0, 0.501)])
    assert not scene.contact.wear_depth.any()


def test_a_ball_that_comes_obliquely():
    """From below and aside, in steps to where it first touches or at once: the same force, within 2 % of its normal part."""
    forces, way = [], np.array([0.02, 0.0, 0.23])
    for parts in ([1.0], [0.2 / 0.23, *(0.2 + 0.03 * np.linspace(0.1, 1, 6)) / 0.23]):
        ball = dc.RigidSphere((0.5, 0.5, -0.6), 0.4)
        scene = slab([0, 0, 0], [1, 1, 0.5], [8, 8, 4], ball, 0.4)
        for part in parts:
            ball.displacement = part * way
            scene.problem.solve()
        forces.append(scene.contact.force())
    assert forces[0] == pytest.approx(forces[1], abs=0.02 * forces[1][2])
    assert forces[1][0] > 0.02 * forces[1][2]


def test_what_does_not_matter_costs_no_repetition(monkeypatch):
    """A plate pressed straight down and up again is solved once a step."""
    scene, times = plate(), []
    of = dc.ContactProblem.load_step
    monkeypatch.setattr(dc.ContactProblem, "load_step", lambda *a: times.append(1) or of(*a))
    for place in ((0, 0, 0.51), (0, 0, 0.4), (0, 0, 0.52)):
        scene.surface.displacement = place
        scene.problem.solve()
    assert len(times) == 3


def test_what_rounding_is_does_not_depend_on_whose_a_node_is():
    """A rank that has the node at the origin alone takes its last digits for no more of a gap than the others."""
    square = mesh.create_unit_square(COMM, 3, 3, mesh.CellType.quadrilateral)
    V = functionspace(square, ("Lagrange", 1, (2,)))
    foot = mesh.locate_entities_boundary(square, 1, lambda x: np.isclose(x[1], 0))
    contact = dc.Contact(V, foot, dc.RigidPlane((0, 0), (0, 1)), MU)
    at_rest = np.zeros(2 * V.dofmap.index_map.size_local)
    assert not any(COMM.allgather(step_of(contact).may_close(at_rest)))
    assert len(set(COMM.allgather(step_of(contact).gap_rounding(at_rest)))) == 1
