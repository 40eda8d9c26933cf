# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Directions of friction belong to a body and are carried by its surface, however they are given: scenes turned as a whole, or one body alone."""

import warnings

import numpy as np
import pytest
import ufl
from dolfinx import fem
from two_bodies import E, dc, largest, rubber, stress

from dolfinx_contact.compat import functionspace
from dolfinx_contact.contact.contact_step import step_of
from mechanics.two_blocks import pair

pytestmark = pytest.mark.ranks

MU, MIDDLE = (0.3, 0.1), np.array([1.0, 1.0, 0.0])
ALONG = np.array([np.cos(0.4), np.sin(0.4), 0.0])  # of the grooves


def directions(x):
    return np.outer(ALONG, np.ones(x.shape[1]))


def components(x):
    return directions(x)[:2]  # in the frame, whose axis is x


def given(how, V):
    """Axes of friction in one of the ways to say them."""
    if how == "function":
        axes = fem.Function(V)
        axes.interpolate(directions)
        return axes
    return dict(directions=directions, components=components)[how]


class Pair:
    """A block of rubber on a larger one; ends are put where they are told, both turned by an angle each."""

    def __init__(self, how, owner, cells=((2, 2, 1), (3, 3, 1))):
        domain, top, bottom, upper, lower, _ = pair("hexahedron", cells, (1.0, 2.0))
        self.V = V = functionspace(domain, ("Lagrange", 1, (3,)))
        self.u, self.way = fem.Function(V), fem.Function(V)
        F = rubber(self.u, 100.0, 100.0)
        ends = fem.locate_dofs_topological(V, 2, np.concatenate((top, bottom)))
        axis = ALONG if how in ("axis", "array") else (1, 0, 0)
        friction = dc.Friction(MU)
        if how not in ("axis", "array"):
            friction = dc.Friction(MU, axes=given(how, V), of=owner)
        self.contact = dc.Contact(V, upper, dc.DeformableSurface(V, lower, axis=axis), friction)
        if how == "array":
            self.contact.friction = dc.Friction(MU, axes=np.tile([1.0, 0.0], (len(self.contact.nodes), 1)))  # fmt: skip
        self.problem = dc.ContactProblem(F, self.u, [self.contact], bcs=[fem.dirichletbc(self.way, ends)])  # fmt: skip
        self.x = V.tabulate_dof_coordinates()

    def put(self, upper, lower, slid=(0.0, 0.0)):
        """Turn blocks by these angles about the vertical, the upper one slid along itself; friction over force of the upper block's frame."""
        moved = np.empty_like(self.x)
        for angle, some in ((upper, self.x[:, 2] > 0.5), (lower, self.x[:, 2] <= 0.5)):
            c, s = np.cos(angle), np.sin(angle)
            turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
            away = np.where(self.x[some, 2:] > 0.5, [*slid, -0.01], 0.0)
            moved[some] = (self.x[some] - MIDDLE + away) @ turn + MIDDLE
        self.way.x.array[:] = (moved - self.x).ravel()
        self.problem.solve()
        c, s = np.cos(upper), np.sin(upper)
        force = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ self.contact.force()
        return force[:2] / force[2]


WAYS = [("axis", "body"), ("array", "body"), ("directions", "body"), ("components", "body"), ("function", "body"),
        ("directions", "surface"), ("components", "surface")]  # fmt: skip


@pytest.mark.parametrize("how, owner", WAYS)
def test_a_scene_turned_as_a_whole(how, owner):
    """Pressed, turned, then slid obliquely over the grooves: friction is the same in axes that turn with the scene."""
    found = []
    for angle in (0.0, 0.9):
        scene = Pair(how, owner)
        for part in (0.0, 0.5, 1.0):
            scene.put(part * angle, part * angle)
        for slid in (0.12, 0.3):
            ratio = scene.put(angle, angle, (slid, 0.1 * slid))
        found.append(ratio)
    assert np.abs(found[0] - found[1]).max() <= 1e-3
    assert 0.1 < np.linalg.norm(found[0]) < 0.3


@pytest.mark.parametrize("how, owner", [("directions", "body"), ("axis", "body"), ("directions", "surface")])  # fmt: skip
@pytest.mark.parametrize("turned", ["upper", "lower"])
def test_one_body_turned_alone(how, owner, turned):
    """Slid along what were the grooves after a quarter turn of one block: across them if they are its own, along them if not."""
    scene = Pair(how, owner)
    both = np.array([turned == "upper", turned == "lower"]) * np.pi / 2
    for part in np.linspace(0.0, 1.0, 5):
        scene.put(*part * both)
    c, s = np.cos(both[0]), np.sin(both[0])
    along = (
        np.array([[c, s], [-s, c]]) @ ALONG[:2]
    )  # in space as the grooves were, said in the upper block's frame
    for slid in (0.15, 0.3, 0.45):
        ratio = scene.put(*both, slid * along)
    own = (turned == "upper") == (owner == "body")
    assert np.linalg.norm(ratio) == pytest.approx(0.1 if own else 0.3, rel=0.06)


def placed(owner, u_of, cells):
    """Axes in space of a pair moved by a field, where they are used, and the contact."""
    scene = Pair("directions", owner, cells)
    contact, u = scene.contact, fem.Function(scene.V)
    u.interpolate(u_of)
    found = contact.geometry.projected(u.x.array[: contact.points.size].copy())
    given = directions(contact.x.T)
    lines = contact.geometry.directions(given, owner, found.points).T
    there = ~found.points.alone
    return lines[there], found, contact, there


@pytest.mark.parametrize("owner", ["body", "surface"])
def test_lines_of_the_material(owner):
    """Turned and sheared evenly, directions are those of the deformation gradient; axes that have turned since the step began are counted."""
    G = np.array([[0.8, -0.6, 0.0], [0.65, 0.75, 0.0], [0.0, 0.0, 1.0]])
    lines, found, contact, there = placed(owner, lambda x: G @ x - x, ((2, 2, 1), (3, 3, 1)))
    assert largest(lines - G @ ALONG) <= 1e-12
    turned = contact.laws.turned(step_of(contact), found.home, found.frame, found.points)
    e = G @ ALONG
    off = np.abs(np.cross(ALONG, e / np.linalg.norm(e))[2])
    assert largest(turned[there] - off) <= 1e-12


@pytest.mark.parametrize("owner", ["body", "surface"])
def test_a_twisted_body(owner):
    """Both blocks twist by an angle that grows along x: directions turn by the angle of their place, not by the mean; to second order."""

    def twist(x):
        angle = 0.8 * (x[0] - 1.0)
        return np.array([0 * x[0], np.cos(angle) * (x[1] - 1.0) + 1.0 - x[1], np.sin(angle) * (x[1] - 1.0)])  # fmt: skip

    off = []
    for n in (4, 8):
        lines, found, contact, there = placed(
            owner, twist, ((n, n, 1), (n + n // 2, n + n // 2, 1))
        )
        x, y = contact.x[there, 0], contact.x[there, 1] - 1.0
        angle = 0.8 * (x - 1.0)
        slope = np.array([np.ones_like(x), -0.8 * np.sin(angle) * y, 0.8 * np.cos(angle) * y])
        across = np.array([0 * x, np.cos(angle), np.sin(angle)])
        expected = (ALONG[0] * slope + ALONG[1] * across).T
        inside = np.abs(contact.x[there, :2] - 1.0).max(axis=1) < 0.45
        off.append(largest((lines - expected)[inside]))
    assert off[1] < 0.02 and off[1] < off[0] / 3


@pytest.mark.parametrize("how, owner, told", [("directions", "body", True), ("function", "body", True), ("directions", "surface", False), ("axis", None, False)])  # fmt: skip
def test_a_body_that_turns_on_a_rigid_plane(how, owner, told):
    """A plane does not carry axes that a field gives for the body: told as soon as the body has turned; others belong to the plane."""
    domain, top, _, upper, _, _ = pair("hexahedron", ((2, 2, 1), (3, 3, 1)), (1.0, 2.0))
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, way = fem.Function(V), fem.Function(V)
    F = ufl.inner(stress(u, 0.0, E / 2), ufl.grad(ufl.TestFunction(V))) * ufl.dx
    below = fem.locate_dofs_geometrical(V, lambda x: x[2] < -0.25)
    bcs = [
        fem.dirichletbc(way, fem.locate_dofs_topological(V, 2, top)),
        fem.dirichletbc(way, below),
    ]
    friction = dc.Friction(MU) if how == "axis" else dc.Friction(MU, axes=given(how, V), of=owner)
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1), axis=ALONG)
    contact = dc.Contact(V, upper, plane, friction)
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs)
    x = V.tabulate_dof_coordinates()
    messages = []
    for angle in (0.0, 0.02, 0.2):
        turn = angle * np.column_stack((1.0 - x[:, 1], x[:, 0] - 1.0, 0 * x[:, 0]))
        way.x.array[:] = (turn - [0.0, 0.0, 1e-3]).ravel()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            problem.solve()
        messages.append(
            [str(one.message) for one in caught if "axes of friction" in str(one.message)]
        )
    assert [len(found) for found in messages] == [0, 0, int(told)]
    assert not told or "turned by 0.2 rad" in messages[-1][0]
