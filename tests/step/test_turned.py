# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A linear body that turns grows by theta^2 / 2: told where contact feels it, and nowhere else."""

import warnings

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from way_scenes import COMM, ring, stretched

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace

pytestmark = pytest.mark.ranks
TURNS = (
    r"the body has turned by {:.3g} rad.*grows by .* = {:.2g} of its size, which is {:.2g} times"
)


@pytest.fixture(autouse=True)
def all_others_are_errors():
    """What a test does not expect fails it, whatever pytest was started with."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        yield


def mean_pressure(contact):
    force, area = COMM.allreduce(np.array([contact.reaction[:, -1].sum(), contact.area.sum()]))
    return force / area


@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
@pytest.mark.parametrize("fit, told", [(2e-4, True), (2e-3, False)])
def test_a_ring_that_goes_along_with_its_shaft_loses_pressure_and_says_so(fit, told, solver):
    """By 0.01 rad: pressure falls by theta^2 / 2 over the interference, a quarter; of ten times that a fortieth, no matter."""
    shaft = dc.RigidSphere((0, 0), 0.3 * (1 + fit))
    scene = ring([0.3, 0.4, 0.5], shaft, 1.0, solver=solver)
    scene.problem.solve()
    before, angle = mean_pressure(scene.contact), 0.01
    shaft.rotation, grown = angle, angle**2 / 2
    if told:
        with pytest.warns(UserWarning, match=TURNS.format(angle, grown, grown / fit)):
            scene.problem.solve()
    else:
        scene.problem.solve()
    assert 1 - mean_pressure(scene.contact) / before == pytest.approx(grown / fit, rel=0.02)
    scene.problem.solve()  # told once


@pytest.mark.parametrize("angle", [0.01, 0.011, 0.012])
def test_a_ring_does_not_stray_from_its_shaft(angle):
    """Turned farther than the shaft it would be wide enough to lose contact: a state without forces, not the one that the turn leads to."""
    fit, grown = 3e-4, angle**2 / 2
    shaft = dc.RigidSphere((0, 0), 0.3 * (1 + fit))
    scene = ring([0.3, 0.4, 0.5], shaft, 1.0)
    scene.problem.solve()
    before, shaft.rotation = mean_pressure(scene.contact), angle
    with pytest.warns(UserWarning, match="the body has turned by"):
        scene.problem.solve()
    assert 1 - mean_pressure(scene.contact) / before == pytest.approx(grown / fit, rel=0.001)


def loose(d, planes, mu):
    """A block of edge 1 that contacts alone hold, on planes at its ends; its problem, contacts and force per volume."""
    create, kind = ((mesh.create_rectangle, mesh.CellType.quadrilateral), (mesh.create_box, mesh.CellType.hexahedron))[d - 2]  # fmt: skip
    domain = create(COMM, [np.zeros(d), np.ones(d)], [2] * d, kind)
    V = functionspace(domain, ("Lagrange", 1, (d,)))
    (u, F), weight, contacts = stretched(V), fem.Constant(domain, np.zeros(d)), []
    for end, plane in zip((0.0, 1.0), planes):
        facets = mesh.locate_entities_boundary(domain, d - 1, lambda x, z=end: np.isclose(x[d - 1], z))  # fmt: skip
        contacts.append(dc.Contact(V, facets, plane, mu))
    F -= ufl.inner(weight, ufl.TestFunction(V)) * ufl.dx
    return dc.ContactProblem(F, u, contacts), contacts, weight


def test_a_block_that_tilts_with_its_floor_grows_freely():
    """Under its weight, by 0.02 rad: strains are a thousandth of theta^2 / 2, and reactions those of statics."""
    floor = dc.RigidPlane((0, 0), (0, 1))
    problem, (contact,), weight = loose(2, [floor], 0.3)
    weight.value[1] = -2e-4
    problem.solve()
    floor.rotation = 0.02
    problem.solve()
    assert contact.force() == pytest.approx([0, 2e-4], abs=1e-10)


@pytest.mark.parametrize("d, angle, told", [(2, 1e-3, False), (2, 0.03, True), (3, 0.03, True)])
def test_a_block_between_planes_cannot_grow(d, angle, told):
    """Clamped between two planes that turn together: growth by theta^2 / 2 over the strain of the clamp, or much less than that."""
    clamp, up = 1e-3, np.eye(d)[-1]
    planes = [dc.RigidPlane(np.full(d, 0.5), side * up) for side in (1, -1)]

    def put(angle):
        tilted = np.cos(angle) * up - np.sin(angle) * np.eye(d)[0]
        for plane, side in zip(planes, (1, -1)):
            plane.rotation = angle if d == 2 else (0, -angle, 0)
            plane.displacement = -side * (0.5 - clamp / 2) * tilted

    put(0.0)
    problem, contacts, _ = loose(d, planes, 0.5)
    problem.solve()
    before, grown = mean_pressure(contacts[0]), angle**2 / 2
    put(angle)
    if told:
        with pytest.warns(UserWarning, match=TURNS.format(angle, grown, grown / clamp)):
            problem.solve()
    else:
        problem.solve()
    assert mean_pressure(contacts[0]) / before - 1 == pytest.approx(grown / clamp, rel=0.1)
