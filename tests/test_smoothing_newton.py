"""Newton's method with a rounded law: its residual and derivative, and that it finds what the fixed point finds."""

import numpy as np
import pytest
import scenes
from test_surface_layer import linearised

import dolfinx_contact as dc
from dolfinx_contact import smoothing_newton
from dolfinx_contact.newton_krylov import NewtonKrylov

CASE_C = dict(mu=(0.3, 0.15), p=(0.05, 0.2))


@pytest.mark.parametrize("rounding, drag", [(0.3, 0.0), (1e-3, 0.0), (1e-3, 0.05)])
def test_tangent_is_the_derivative_of_the_rounded_residual(rounding, drag):
    """J x is the difference quotient, springs that pull back included, in a turned frame."""
    equations, x = linearised("return", turn=scenes.rotation(), **CASE_C)
    home = equations.problem._states[0]
    equations.round_off(rounding, drag, home)
    equations.linearise(x)
    rng = np.random.default_rng(scenes.COMM.rank)
    direction = rng.normal(size=x.size) * np.abs(x).max()
    direction[equations.body.fixed] = 0.0
    h = 1e-6 * rounding
    difference = equations.out_of_balance(x + h * direction) - equations.out_of_balance(
        x - h * direction
    )
    expected = -equations.tangent(direction) * 2 * h
    size = equations.size(expected)
    assert equations.size(difference - expected) < 1e-4 * size


def test_without_rounding_it_is_the_residual_of_the_law():
    """Rounding 0 and no springs: forces out of balance and error are those of the return map."""
    equations, x = linearised("return", **CASE_C)
    equations.round_off(0.1, 0.1, x)
    equations.round_off(0.0)
    smoothed, error = equations.residual(x)
    equations._set_metric("return", 10.0, 0.1)
    residual, expected = equations.residual(x)
    assert error == expected
    assert np.array_equal(smoothed, residual)


def test_springs_pull_back_and_not_at_home():
    """At home they change nothing; elsewhere their forces are stiffness times slip from there."""
    equations, x = linearised("return", **CASE_C)
    home = x.copy()
    equations.round_off(0.1)
    free = equations.out_of_balance(x)
    equations.round_off(0.1, 0.1, home)
    assert np.array_equal(equations.out_of_balance(home), free)
    away = x + 1e-3 * np.abs(x).max()
    away[equations.body.fixed] = x[equations.body.fixed]
    dragged = equations.out_of_balance(away)
    equations.round_off(0.1)
    forces = dragged - equations.out_of_balance(away)
    for contact, stiffness in zip(equations.problem.contacts, equations.problem._stiffness):
        local = forces[contact._dofs] @ contact.frame.T
        slip = (away - home)[contact._dofs] @ contact.frame.T
        expected = -0.1 * stiffness[:, None] * slip[:, :-1]
        bound = 1e-9 * np.abs(expected).max(initial=1e-300)
        assert local[:, :-1] == pytest.approx(expected, rel=0, abs=bound)
        assert np.abs(local[:, -1]).max(initial=0.0) <= bound


def pressed(**options):
    """Reactions of all nodes in three steps of a block that is pressed and dragged."""
    scene = scenes.block(cells=(6, 6, 3), solver=dc.FixedPoint(**options), **CASE_C)
    reactions = []
    for motion in ((0, 0, -0.01), (0.002, 0.001, -0.009), (0.0, 0.0, -0.008)):
        scene.move_top(*motion)
        scene.problem.solve()
        reactions.append(scenes.by_position(scene, "reaction"))
    return reactions


@pytest.fixture
def early(monkeypatch):
    """No tangent is ever good enough: every step is left to Newton's method, and early."""
    monkeypatch.setattr("dolfinx_contact.fixed_point.EVERY", 3)
    monkeypatch.setattr("dolfinx_contact.fixed_point.FALL", 0.0)


@pytest.mark.parametrize("dragged", [False, True])
def test_newtons_method_finds_what_the_fixed_point_finds(early, monkeypatch, dragged):
    """Left to it, every step ends in the reactions that the fixed point finds alone; dragged from the first, too."""
    if dragged:
        monkeypatch.setattr(smoothing_newton, "SHORT", 2.0)
    for found, expected in zip(pressed(), pressed(newton=False)):
        assert found == pytest.approx(expected, rel=0, abs=1e-7 * np.abs(expected).max())


def test_where_newtons_method_fails_the_fixed_point_goes_on(early, monkeypatch):
    """With no way down in any direction the search ends, is not repeated, and the step is solved all the same."""
    asked = []

    def nowhere(self, x, residual):
        asked.append(1)
        return np.zeros_like(x), 0.0, 7

    monkeypatch.setattr(NewtonKrylov, "step", nowhere)
    pressed()
    stiffened = int(np.ceil(np.log(smoothing_newton.STIFFEST / smoothing_newton.DRAG) / np.log(4)))
    assert len(asked) == 3 * (1 + 1 + stiffened)  # three steps: sharp, rounded off, with springs
