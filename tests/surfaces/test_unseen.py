# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What contact at nodes cannot see is told, once, and where it does not matter nothing is said."""

import re
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
import scenes
import two_bodies
import ufl
from dolfinx import fem, mesh
from ring_scenes import INNER, bend, clamp
from scenes import COMM, elasticity
from test_surfaces import block, by_distance

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace, second_order

E, NU = 1000.0, 0.3


@pytest.fixture(autouse=True)
def all_others_are_errors():
    """What a test does not expect fails it, whatever pytest was started with."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        yield


@pytest.mark.parametrize("d, radius, made", [(2, 0.003, "ball"), (3, 0.003, "ball"), (2, 0.1, "ball"), (3, 0.1, "function"), (2, 0.1, "driven"), (3, 0.1, "roll")])  # fmt: skip
def test_a_ball_smaller_than_a_facet_is_told_with_its_depth(d, radius, made):
    """Pressed into the middle of a facet a ball meets no node: 0 N, and the depth that is told is the approach."""
    middle = np.append(np.full(d - 1, 0.25), -radius)
    ball = dc.RigidCylinder(middle, (0, 1, 0), radius) if made == "roll" else dc.RigidSphere(middle, radius)  # fmt: skip
    scene = block(by_distance(ball) if made == "function" else ball, cells=[2] * d)
    if (
        made == "driven"
    ):  # on a spring along what it may move, which it does not: nothing pushes back
        ball.free, ball.stiffness = ("y",), 10.0
    with pytest.warns(UserWarning, match=r"goes 0\.0011 into the body between its nodes, near \(0\.25,.* no node feels it"):  # fmt: skip
        scene.step(*np.zeros(d - 1), -0.0011)
    assert scene.contact.force() == pytest.approx(np.zeros(d), abs=1e-12)
    scene.step(*np.zeros(d - 1), -0.0012)  # told once


@pytest.mark.parametrize("d", [2, 3])
def test_a_ball_that_nodes_feel_is_not_spoken_of(d):
    """On a node, and with some facets across the contact; a ball from inside, which touches at nodes alone, too."""
    for surface in (
        dc.RigidSphere(np.append(np.zeros(d - 1), -0.1), 0.1),
        dc.RigidSphere(np.append(np.full(d - 1, 0.125), -8.0), 8.0),
        dc.RigidSphere(np.append(np.zeros(d - 1), 8.0), 8.0, inside=True),
    ):
        scene = block(surface, cells=[4] * d)
        scene.step(*np.zeros(d - 1), -0.02)
        assert np.linalg.norm(scene.contact.force()) > 0.0


def on_waves(cells, crests, part=0.25):
    """A block of width 1 on two waves, pressed by a part of the pressure that flattens them; crests at nodes or troughs.

    Flat all over at ``p = pi E A / length`` [H. M. Westergaard, J. Appl. Mech. 6 (1939) A49].
    """
    height, length, sign = 1e-3, 0.5, 1.0 if crests else -1.0
    plane = dc.RigidPlane((0, 0), (0, 1), height=lambda y: height * (sign * np.cos(2 * np.pi * y[0] / length) - 1))  # fmt: skip
    corners = [np.array([-0.5, 0.0]), np.array([0.5, 1.0])]
    domain = mesh.create_rectangle(COMM, corners, [cells, max(cells // 2, 2)], mesh.CellType.quadrilateral)  # fmt: skip
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    foot, top = (
        mesh.locate_entities_boundary(domain, 1, lambda x, y=y: np.isclose(x[1], y)) for y in (0, 1)
    )
    bcs = [fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, top), V)]
    bcs += [clamp(V, 0, lambda x, s=s: np.isclose(x[0], s)) for s in (-0.5, 0.5)]
    contact = dc.Contact(V, foot, plane, dc.Friction(0.0))
    problem = dc.ContactProblem(elasticity(u, v, E, 0.0), u, contact, bcs=bcs)
    plane.free, plane.force = ("n",), (0, part * np.pi * E * height / length)
    return SimpleNamespace(problem=problem, contact=contact)


def test_waves_of_many_facets_touch_where_westergaard_says():
    """Under a quarter of the pressure that flattens them a third of a sine's length touches; nothing is said."""
    scene = on_waves(32, crests=True)
    step = scene.problem.solve()
    touching = step.counts.stick + step.counts.slip
    assert touching / 32 == pytest.approx(1 / 3, abs=2 / 32)


@pytest.mark.parametrize("crests, said", [(False, "goes 0.002 into the body"), (True, "recedes by 0.002 between nodes that touch")])  # fmt: skip
def test_waves_shorter_than_a_facet_are_told(crests, said):
    """All nodes in troughs, or all on crests: the whole height of the waves is missed."""
    scene = on_waves(2, crests)
    with pytest.warns(UserWarning, match=said):
        scene.problem.solve()


def test_a_height_that_only_nodes_have_is_taken_as_it_is():
    """A table of heights at the nodes, NaN between them, says nothing about what is between."""

    def table(y):
        return np.where(np.isclose(np.round(4 * y[0]), 4 * y[0], atol=1e-3), 1e-4 * y[0], np.nan)

    scene = block(dc.RigidPlane((0, 0), (0, 1), height=table), cells=[4, 2])
    scene.step(0, -1e-3)
    assert scene.contact.force()[1] > 0.0


@pytest.mark.parametrize("slope, told", [(0.06, False), (0.25, True)])
def test_a_height_that_is_steep_is_told(slope, told):
    """A face that rises to one side of the block: the normal of its plane stays, which neglects as much of the reactions."""
    scene = block(dc.RigidPlane((0, 0), (0, 1), height=lambda y: slope * (y[0] - 0.5)), cells=[8, 4])  # fmt: skip
    if told:
        with pytest.warns(
            UserWarning, match=r"slopes by 0\.25 where nodes press on it, and its normal"
        ):
            scene.step(0, -0.05)
    else:
        scene.step(0, -0.05)
    assert scene.contact.force()[1] > 0.0
    scene.step(0, -0.06)  # told once


def ring(order, curved, interference, cells=(2, 12), uneven=0.0):
    """Half a ring held outside, on a shaft that is too large; its problem and the pressure of Lamé."""
    domain = mesh.create_rectangle(COMM, [np.zeros(2), np.ones(2)], cells, mesh.CellType.quadrilateral)  # fmt: skip
    x = domain.geometry.x
    x[:, 1] += uneven * np.sin(2 * np.pi * x[:, 1])
    domain = second_order(domain) if curved else domain
    V = functionspace(domain, ("Lagrange", order, (2,)))
    inside = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[0], 0.0))
    bcs = [clamp(V, 0, lambda x: np.isclose(np.abs(x[1] - 0.5), 0.5))]
    bcs += [clamp(V, axis, lambda x: np.isclose(x[0], 1.0)) for axis in (0, 1)]
    bend(domain)
    u, v = fem.Function(V), ufl.TestFunction(V)
    shaft = dc.RigidSphere((0, 0), INNER + interference)
    contact = dc.Contact(V, inside, shaft, dc.Friction(0.0))
    problem = dc.ContactProblem(elasticity(u, v, E, NU), u, contact, bcs=bcs)
    A, B = np.linalg.solve([[1.0, 1.0], [INNER, 1 / INNER]], [0.0, interference])
    G = E / (2 * (1 + NU))
    pressure = -2 * G * (A / (1 - 2 * NU) - B / INNER**2)
    return SimpleNamespace(problem=problem, contact=contact, pressure=pressure)


def mean_pressure(contact):
    force, area = COMM.allreduce(np.array([contact.reaction[:, -1].sum(), contact.area.sum()]))
    return force / area


@pytest.mark.parametrize("uneven", [0.0, 0.05])
def test_a_round_body_of_second_order_on_straight_cells_is_told(uneven):
    """Nodes amid the edges stand h^2 / 8R inside a bore, more than the interference: its pressure is far from Lamé's."""
    scene, t = ring(2, False, 1e-3, uneven=uneven), np.linspace(0, 1, 13)
    chord = (
        np.pi * INNER * np.diff(t + uneven * np.sin(2 * np.pi * t))[1:-1].max()
    )  # not those at the ends
    with pytest.warns(UserWarning, match=r"second order on straight-sided") as told:
        scene.problem.solve()
    stand = float(re.search(r"stand ([0-9.e-]+) off the round", str(told[0].message)).group(1))
    assert stand == pytest.approx(chord**2 / (8 * INNER), rel=0.03)
    assert mean_pressure(scene.contact) > 2 * scene.pressure
    scene.problem.solve()  # told once


@pytest.mark.parametrize("d", [2, 3])
def test_a_blunt_edge_is_not_round(d):
    """A roof of 10 degrees pressed on its ridge and a face: straight cells of second order are what it is made of."""
    create, kind = ((mesh.create_rectangle, mesh.CellType.triangle), (mesh.create_box, mesh.CellType.hexahedron))[d - 2]  # fmt: skip
    domain = create(COMM, [np.zeros(d), np.ones(d)], [4, 2, 2][:d], kind)
    foot, top = (
        mesh.locate_entities_boundary(domain, d - 1, lambda x, z=z: np.isclose(x[d - 1], z))
        for z in (0, 1)
    )
    x = domain.geometry.x
    x[:, d - 1] += np.tan(np.deg2rad(10)) * np.abs(x[:, 0] - 0.5) * (1 - x[:, d - 1])
    V = functionspace(domain, ("Lagrange", 2, (d,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    held = fem.Constant(domain, -1e-5 * np.eye(d)[-1])
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, d - 1, top), V)]
    for normal in (np.eye(d)[-1], np.array([np.sin(np.deg2rad(10)), *np.zeros(d - 2), np.cos(np.deg2rad(10))])):  # fmt: skip
        plane = dc.RigidPlane(0.5 * np.eye(d)[0], normal)
        contact = dc.Contact(V, foot, plane, 0.0)
        problem = dc.ContactProblem(elasticity(u, v, E, NU), u, contact, bcs=bcs)
        problem.solve()
        assert np.linalg.norm(contact.force()) > 0.0


@pytest.mark.parametrize("order, curved", [(1, False), (2, True)])
def test_a_round_body_that_is_round_at_its_nodes_has_the_pressure_of_lame(order, curved):
    """Of first order, or with curved edges: within 3 % of the closed form, and nothing is said."""
    scene = ring(order, curved, 1e-3, (4, 12))
    scene.problem.solve()
    assert mean_pressure(scene.contact) == pytest.approx(scene.pressure, rel=0.03)


def test_straight_cells_are_good_enough_where_much_is_pressed_in():
    """The same nodes under an interference of many times what they stand off are no matter, nor is a flat foot."""
    scene = ring(2, False, 0.05, (4, 24))
    scene.problem.solve()
    assert mean_pressure(scene.contact) == pytest.approx(scene.pressure, rel=0.1)
    flat = block(dc.RigidPlane((0, 0), (0, 1)), order=2, cells=[2, 2])
    flat.step(0, -1e-9)


def worn(parts, d, **options):
    """A column pressed by 0.01 and rubbed by half its height in some steps: depths worn, over the approach."""
    plane = dc.RigidPlane(np.zeros(d), np.eye(d)[-1])
    scene = block(plane, 0.1, cells=[1] * d)
    scene.contact.wear = dc.Wear(2 / (1000 * 0.1 * 0.5), **options)  # E k mu s / height = 2
    scene.step(*np.zeros(d - 1), -0.01)
    for k in range(parts):
        plane.displacement = (k + 1) / parts * 0.5 * np.eye(d)[0]
        scene.step(*np.zeros(d - 1), -0.01)
    total, count = COMM.allreduce(np.array([scene.contact.wear_depth.sum(), scene.contact.nodes.size]))  # fmt: skip
    return total / count / 0.01


@pytest.mark.parametrize("d", [2, 3])
def test_wear_in_leaps_is_told_with_the_number_of_steps(d):
    """Explicit wear in one step takes more off than was pressed in, in many steps 1 - exp(-2) of it, Archard's law; else a step is about that of
    backward Euler."""
    with pytest.warns(UserWarning, match="times its reaction.*Divide steps like this one into 2 or more"):  # fmt: skip
        assert worn(1, d, explicit=True) > 1.9
    assert worn(16, d, explicit=True) == pytest.approx(1 - np.exp(-2), rel=0.05)
    for parts in (1, 2, 16):
        assert worn(parts, d) == pytest.approx(1 - (1 + 2 / parts) ** -parts, rel=0.03)


@pytest.mark.parametrize("d", [2, 3])
def test_a_surface_that_is_nowhere_near_is_told_once(d):
    """In another unit of length, with the smallest gap; near ones, and those that something touched, are not spoken of."""
    for surface in (
        dc.RigidPlane(-0.5 * np.eye(d)[-1], np.eye(d)[-1]),
        dc.RigidSphere(-1.5 * np.eye(d)[-1], 1.0),
    ):
        scene = block(surface, cells=[2] * d)
        with pytest.warns(UserWarning, match="no node touches: the smallest gap is 0.5, in a body of size 1"):  # fmt: skip
            scene.step(*np.zeros(d))
        scene.step(*np.zeros(d))
    scene = block(dc.RigidPlane(np.zeros(d), np.eye(d)[-1]), cells=[2] * d)
    for way in (0.09, -0.01, 0.5):
        scene.step(*np.zeros(d - 1), way)


@pytest.mark.parametrize("d", [2, 3])
def test_a_surface_that_is_missed_is_a_line_of_the_log_once(d, caplog):
    """Missed by a tenth of the body the surface may be on its way: no warning, but its gap, once; not where it touches at first, or with no gap."""
    for begin, lines in (([0.1, 0.2, -0.01, 0.1], 1), ([-0.01, 0.1], 0), ([0.0, -0.01], 0)):
        scene = block(dc.RigidPlane(np.zeros(d), np.eye(d)[-1]), cells=[2] * d)
        caplog.clear()
        for way in begin:
            scene.step(*np.zeros(d - 1), way)
        told = [line for line in caplog.messages if "no node touches" in line]
        assert told == lines * (COMM.rank == 0) * ["no node touches yet: the smallest gap is 0.1, in a body of size 1"]  # fmt: skip


@pytest.mark.parametrize("d", [2, 3])
def test_a_second_surface_that_is_nowhere_near_is_a_line_of_the_log_once(d, caplog):
    """One of two surfaces far beyond the body, while the other is touched: its gap, once; a near one is not spoken of."""
    across = np.eye(d)[0]
    for away, lines in ((7.0, 1), (0.2, 0)):
        scene = scenes.block(cells=[2] * d, mu=0.3, p=None)
        side = mesh.locate_entities_boundary(scene.mesh, d - 1, lambda x: np.isclose(x[0], 0.5))
        wall = dc.Contact(scene.V, side, dc.RigidPlane((0.5 + away) * across, -across), 0.3)
        with pytest.warns(UserWarning, match="are left out"):  # the held edge of the side
            problem = dc.ContactProblem(scene.F, scene.u, [scene.contact, wall], bcs=scene.bcs)
        caplog.clear()
        for way in (-0.01, -0.02):
            scene.move_top(*np.zeros(d - 1), way)
            problem.solve()
        told = [line for line in caplog.messages if "no node touches RigidPlane" in line]
        assert len(told) == lines * (COMM.rank == 0)
        assert all("the smallest gap is 7, in a body of size 1" in line for line in told)


def test_facets_that_look_away_from_each_other_are_a_line_of_the_log_once(caplog):
    """The foot of a body and that of the one below: no node is opposite the other side, in whatever place."""
    scene = two_bodies.blocks("quadrilateral", cells=((2, 2), (3, 2)), gap=0.1)
    away = dc.DeformableSurface(scene.V, scene.ends[1], sliding="small")
    contact = dc.Contact(scene.V, scene.contact.facets, away, 0.3)
    problem = dc.ContactProblem(scene.F, scene.u, [contact], bcs=scene.bcs)
    for _ in range(2):
        problem.solve()
    told = [line for line in caplog.messages if "none is opposite the other body" in line]
    assert len(told) == (COMM.rank == 0)


@pytest.mark.parametrize("d", [2, 3])
def test_a_normal_along_the_facets_is_told(d):
    """A plane whose normal is sideways: gaps along the foot, from zero on, and nothing that could close them."""
    scene = block(dc.RigidPlane(-0.5 * np.eye(d)[0], np.eye(d)[0]), cells=[2] * d)
    with pytest.warns(UserWarning, match="no node touches, and no facet of the contact faces RigidPlane"):  # fmt: skip
        scene.step(*np.zeros(d - 1), -0.01)
    scene.step(*np.zeros(d - 1), -0.02)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("order", [1, 2])
def test_strains_that_are_not_small_are_told_once(d, order):
    """A block squeezed by a part is strained by as much, and told from a fifth on; moved as far without strain, or by less, it is not.

    A linear strain e is half of e off the logarithmic one, as a part of it: a tenth at a fifth.
    """
    for part in (0.22, 0.45, 0.95):
        scene = block(dc.RigidPlane(np.zeros(d), np.eye(d)[-1]), cells=[2] * d, order=order)
        scene.step(*0.95 * np.eye(d)[0])
        scene.step(*np.zeros(d - 1), -0.18)
        with pytest.warns(UserWarning, match=f"the body is strained by {part:.0%}"):
            scene.step(*np.zeros(d - 1), -part)
        scene.step(*np.zeros(d - 1), -part - 0.01)


def test_a_beam_bent_by_many_times_its_thickness_is_not_strained_much():
    """Strains are those of the cells, not displacements over the thickness of the body; of a nonlinear body nothing is said."""
    domain = mesh.create_rectangle(COMM, [np.zeros(2), np.array([1.0, 0.02])], [16, 2], mesh.CellType.quadrilateral)  # fmt: skip
    V = functionspace(domain, ("Lagrange", 2, (2,)))
    foot, end = (
        mesh.locate_entities_boundary(domain, 1, where)
        for where in (lambda x: np.isclose(x[1], 0.0) & (x[0] > 0.8), lambda x: np.isclose(x[0], 0))
    )
    plane = dc.RigidPlane((0, 0), (0, 1))
    u, v = fem.Function(V), ufl.TestFunction(V)
    bcs = [fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, end), V)]
    contact = dc.Contact(V, foot, plane, 0.0)
    problem = dc.ContactProblem(elasticity(u, v, E, NU), u, contact, bcs=bcs)
    plane.displacement = (0, 0.1)
    problem.solve()
    assert problem.body.largest(np.abs(u.x.array)) > 4 * 0.02
    squeezed = block(dc.RigidPlane((0, 0), (0, 1)), nonlinear=True)
    squeezed.step(0, -0.6)
