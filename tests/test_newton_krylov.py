"""Newton's method of the fixed point: its linear systems, its line search, and what it is for."""

import numpy as np
import pytest
import scenes
from test_surface_layer import linearised

import dolfinx_contact as dc
from dolfinx_contact import fixed_point, newton_krylov
from dolfinx_contact.linear_solver import MULTIGRID
from dolfinx_contact.newton_krylov import NewtonKrylov

CASE_C = dict(mu=(0.3, 0.15), p=(0.05, 0.2))


@pytest.fixture
def newton():
    """Equations of a step, linearised in Newton's metric, and Newton's method for them."""
    equations, x = linearised("return", petsc_options=MULTIGRID, **CASE_C)
    equations.newton_metric(10.0, 0.1)
    equations.linearise(x)
    method = NewtonKrylov(equations)
    yield method, equations, x
    method.close()


def test_step_solves_the_linearised_residual(newton):
    """What GMRES leaves of the linear system is as small as asked for, and nothing moves where it is fixed."""
    method, equations, x = newton
    residual, _ = equations.residual(x)
    dx, _, iterations = method.step(x, residual)
    assert 0 < iterations <= newton_krylov.INNER
    left = equations.size(residual - equations.tangent(dx))
    assert left <= 1.01 * newton_krylov.ACCURACY * equations.size(residual)
    assert not dx[equations.body.fixed].any()


def test_the_part_of_a_step_makes_the_residual_smaller(newton):
    """The length is 1 or a half of the shortest that is too long, by the residual computed anew."""
    method, equations, x = newton
    residual, _ = equations.residual(x)
    dx, length, _ = method.step(x, residual)
    anew = equations.size(equations.residual(x + length * dx)[0])
    assert 0.0 < length <= 1.0 and anew < equations.size(residual)
    assert equations.along(x, dx)(length) == pytest.approx(anew, rel=1e-9)
    if length < 1.0:
        before = equations.size(residual)
        assert not equations.along(x, dx)(2 * length) <= (1 - 2e-4 * length) * before


def test_no_step_is_taken_uphill(newton, monkeypatch):
    """A direction in which the residual only grows gives length 0."""
    method, equations, x = newton
    residual, _ = equations.residual(x)
    along = equations.along
    monkeypatch.setattr(equations, "along", lambda x, dx: along(x, -dx))
    assert method.step(x, residual)[1] == 0.0


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


def test_newtons_method_finds_what_the_fixed_point_finds(early):
    """Left to Newton's method, every step ends in the reactions that the fixed point finds alone."""
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
    in_vain = -(-fixed_point.PATIENCE // 7)
    assert len(asked) == 3 * in_vain  # three steps
