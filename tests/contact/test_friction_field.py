# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Friction given by callables and Functions is that of arrays with their values at the contact nodes."""

import pickle

import numpy as np
import pytest
import scenes
from dolfinx import fem

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace

pytestmark = pytest.mark.ranks
COMM = scenes.COMM


def rough(x):
    """A coefficient that varies, and is zero somewhere."""
    return np.maximum(0.3 + 0.4 * x[0] - 0.2 * x[1], 0.1) * (x[0] > -0.4)


def pair(x):
    """Two coefficients."""
    return np.stack((0.3 + 0.2 * x[0], 0.2 + 0.1 * x[1] ** 2))


def grooves(x):
    """Directions in space, of any length and with a part along the normal: those of a lathe."""
    return np.stack((-x[1] - 3.0, x[0], 0.7 + 0 * x[0]))


def pushed(law, dim=3, solver=None):
    """A block with a law, pressed and pushed to slide in part."""
    scene = scenes.block(cells=(4, 4, 2) if dim == 3 else (6, 3), mu=0.1, p=None, solver=solver)
    scene.contact.friction = law(scene) if callable(law) else law
    for top in ((0, 0, -0.005), (0.002, 0.001, -0.006)):
        scene.move_top(*(top if dim == 3 else (top[0], top[2])))
        scene.problem.solve()
    return scene


def same(scene, other):
    a, b = scene.contact.reaction, other.contact.reaction
    assert a == pytest.approx(b, abs=1e-9 * np.abs(b).max(initial=1.0))


@pytest.mark.parametrize("field", [rough, pair])
@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
def test_a_callable_is_the_array_of_its_values(field, solver):
    """One value per point, or two; the contact has the values."""
    scene = pushed(dc.Friction(mu=field), solver=solver)

    def as_array(scene):
        return dc.Friction(
            mu=np.broadcast_to(field(scene.contact.x.T), (2, len(scene.contact.x))).T
        )

    other = pushed(as_array, solver=solver)
    assert np.array_equal(scene.contact.friction.mu, other.contact.friction.mu)
    same(scene, other)


def test_in_the_plane():
    """In two dimensions x has three rows, too."""
    law = dc.Friction(mu=lambda x: 0.2 + 0.1 * x[0] + x[2])
    scene = pushed(law, dim=2)
    assert scene.contact.friction.mu[:, 0] == pytest.approx(0.2 + 0.1 * scene.contact.x[:, 0])


def test_a_function_is_its_values_at_the_nodes():
    """Functions of one component and of two, interpolated into continuous spaces, first and second order."""
    for field, shape, degree in ((rough, (), 1), (pair, (2,), 1), (pair, (2,), 2)):

        def law(scene, field=field, shape=shape, degree=degree):
            element = ("Lagrange", degree, shape) if shape else ("Lagrange", degree)
            f = fem.Function(functionspace(scene.mesh, element))
            f.interpolate(field)
            return dc.Friction(mu=f, p=(0.05, 0.2))

        scene = pushed(law)
        same(scene, pushed(dc.Friction(mu=field, p=(0.05, 0.2))))


def test_grooves_are_directions_in_space():
    """A direction is projected on the plane, and need be neither a unit vector nor know the plane's axis."""
    law = dc.Friction(mu=(0.3, 0.15), axes=grooves)

    def as_array(scene):
        along = grooves(scene.contact.x.T)[:2]
        return dc.Friction(mu=(0.3, 0.15), axes=(along / np.linalg.norm(along, axis=0)).T)

    scene = pushed(law)
    same(scene, pushed(as_array))
    same(scene, pushed(dc.Friction(mu=(0.3, 0.15), axes=lambda x: grooves(x)[:2])))
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1))
    free = dc.Contact(scene.V, scene.facets, plane, law)
    assert free.friction.axes @ free.frame[:2] == pytest.approx(scene.contact.friction.axes @ scene.contact.frame[:2])  # fmt: skip


def test_sliding_force_is_the_sum_of_what_each_place_carries():
    """A block that slides as a whole is resisted by the sum of mu r_n."""
    scene = pushed(dc.Friction(mu=rough))
    for stroke in (0.5, 1.0):
        scene.surface.displacement = (stroke, 0, 0)
        scene.problem.solve()
    carried = COMM.allreduce((rough(scene.contact.x.T) * scene.contact.reaction[:, 2]).sum())
    assert scene.contact.force()[0] == pytest.approx(carried, rel=1e-9)


def test_another_field_between_steps():
    """A field assigned between steps counts from the next one on."""
    scene = pushed(dc.Friction(0.2))
    other = pushed(dc.Friction(0.2))
    scene.contact.friction = dc.Friction(mu=lambda x: 0.1 + 0.1 * (x[0] > 0))
    other.contact.friction = dc.Friction(
        mu=np.tile(0.1 + 0.1 * (other.contact.x[:, :1] > 0), (1, 2))
    )
    for one in (scene, other):
        one.move_top(0.004, 0, -0.006)
        one.problem.solve()
    same(scene, other)


def test_what_a_field_is_before_a_contact_has_it():
    """It says so, can be pickled, and its values are asked for in vain."""
    law = dc.Friction(mu=rough, k=2.0)
    assert repr(law) == "<Friction with mu as a field>"
    assert pickle.loads(pickle.dumps(law)).given()["mu"] is rough
    with pytest.raises(AttributeError, match="contact.friction has the values"):
        law.mu  # noqa: B018
    with pytest.raises(ValueError, match="there are no positions here"):
        dc.solve_condensed(np.eye(3), np.zeros((1, 3)), law)


def discontinuous(scene):
    return dc.Friction(mu=fem.Function(functionspace(scene.mesh, ("Discontinuous Lagrange", 0))))


def of_ufl(scene):
    return dc.Friction(0.3 / (1 + fem.Function(scene.V)[0]))


MISTAKES = {
    "an expression of UFL": (of_ufl, "mu is an expression of UFL.*interpolate it"),
    "a Constant": (lambda scene: dc.Friction(fem.Constant(scene.mesh, 0.3)), "of a Constant its value"),
    "axes of UFL": (lambda scene: dc.Friction((0.3, 0.1), axes=scene.u / 2), "axes is an expression"),
    "another argument": (lambda scene: dc.Friction(mu=lambda x, velocity: x[0]), "mu is called with x, and pressure, .*wear_depth if it has .*'velocity'"),
    "a keyword": (lambda scene: dc.Friction(0.3, p=lambda x, pressure, *, time: x[0]), "p is called with x, and .*'time'"),
    "no argument": (lambda scene: dc.Friction(mu=lambda: 0.3), "mu is called with x"),
    "axes of the pressure": (lambda scene: dc.Friction((0.3, 0.1), axes=lambda x, pressure: x), "axes is called with x alone: .*'pressure'"),
    "three values": (lambda scene: dc.Friction(mu=lambda x: x + 1.0), "mu must give one value"),
    "words": (lambda scene: dc.Friction(mu=lambda x: "rough"), "real numbers"),
    "negative": (lambda scene: dc.Friction(mu=lambda x: x[0] - 10), "must not be negative"),
    "not a number": (lambda scene: dc.Friction(mu=lambda x: x[0] * np.nan), "finite"),
    "of cells": (discontinuous, "continuous Lagrange"),
    "along the normal": (lambda scene: dc.Friction((0.3, 0.1), axes=lambda x: np.stack((0 * x[0], 0 * x[0], 1 + x[0]))), "no direction along"),
    "one number of axes": (lambda scene: dc.Friction((0.3, 0.1), axes=lambda x: x[0]), "axes must give"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_fields_that_make_no_sense_are_refused(mistake):
    """A ValueError on all ranks; the law stays what it was."""
    law, message = MISTAKES[mistake]
    scene = scenes.block(cells=(2, 2, 2))
    before = scene.contact.friction
    with pytest.raises(ValueError, match=message):
        scene.contact.friction = law(scene)
    assert scene.contact.friction is before
    with pytest.raises(ValueError, match=message):
        dc.Contact(scene.V, scene.facets, scene.surface, law(scene))


def test_wear_of_another_argument_is_refused():
    """A wear coefficient is a function of x alone."""
    scene = scenes.block(cells=(2, 2, 2))
    for field in (lambda x, pressure: 1e-8 + 0 * x[0], lambda x, velocity: x[0]):
        with pytest.raises(ValueError, match="wear coefficient is called with x alone"):
            scene.contact.wear = dc.Wear(field)
    assert scene.contact.wear is None


def test_a_mistake_on_one_rank_is_raised_on_all():
    """A field that fails on the last rank fails on every rank."""
    scene = scenes.block(cells=(2, 2, 2))
    owners = COMM.allgather(len(scene.contact.nodes) > 0)
    last = int(np.flatnonzero(owners)[-1])
    with pytest.raises(ValueError, match="mu must give"):
        scene.contact.friction = dc.Friction(mu=lambda x: x if COMM.rank == last else x[0] + 1)
