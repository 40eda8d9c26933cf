"""Newton's method of the fixed point: its linear systems and its line search."""

import pytest
from test_surface_layer import linearised

from dolfinx_contact import newton_krylov
from dolfinx_contact.linear_solver import MULTIGRID
from dolfinx_contact.newton_krylov import NewtonKrylov

CASE_C = dict(mu=(0.3, 0.15), p=(0.05, 0.2))


@pytest.fixture
def newton():
    """Equations of a step, linearised with a rounded law, and Newton's method for them."""
    equations, x = linearised("return", petsc_options=MULTIGRID, **CASE_C)
    equations.round_off(1e-3)
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
