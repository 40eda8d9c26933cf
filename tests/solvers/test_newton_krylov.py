"""Newton's method of the fixed point: its linear systems and its line search."""

import math

import numpy as np
import pytest
from test_surface_layer import linearised

import dolfinx_contact as dc
from dolfinx_contact.petsc.linear_solver import MULTIGRID
from dolfinx_contact.solvers.fixed_point import newton_krylov
from dolfinx_contact.solvers.fixed_point.newton_krylov import NewtonKrylov, search_by_newton
from dolfinx_contact.solvers.search import Search

CASE_C = dict(mu=(0.3, 0.15), p=(0.05, 0.2))


@pytest.fixture
def newton():
    """A load step, linearised, its maps, and Newton's method for them."""
    step, maps, preconditioner, x = linearised("return", petsc_options=MULTIGRID, **CASE_C)
    preconditioner.linearise(step.derivatives(x, maps))
    method = NewtonKrylov(step, preconditioner)
    yield method, step, maps, preconditioner, x
    method.close()


def test_step_solves_the_linearised_residual(newton):
    """What GMRES leaves of the linear system is as small as asked for, and nothing moves where it is fixed."""
    method, step, maps, preconditioner, x = newton
    residual = step.out_of_balance(x, maps)
    dx, _, iterations = method.step(x, residual, maps)
    assert 0 < iterations <= newton_krylov.INNER
    left = step.size(residual - preconditioner.tangent(dx))
    assert left <= 1.01 * newton_krylov.ACCURACY * step.size(residual)
    assert not dx[step.body.fixed].any()


def test_the_part_of_a_step_makes_the_residual_smaller(newton):
    """The length is 1 or a half of the shortest that is too long, by the residual computed anew."""
    method, step, maps, _, x = newton
    residual = step.out_of_balance(x, maps)
    dx, length, _ = method.step(x, residual, maps)
    anew = step.size(step.out_of_balance(x + length * dx, maps))
    assert 0.0 < length <= 1.0 and anew < step.size(residual)
    assert step.along(x, dx, maps)(length) == pytest.approx(anew, rel=1e-9)
    if length < 1.0:
        before = step.size(residual)
        assert not step.along(x, dx, maps)(2 * length) <= (1 - 2e-4 * length) * before


def test_no_step_is_taken_uphill(newton, monkeypatch):
    """A direction in which the residual only grows gives length 0."""
    method, step, maps, _, x = newton
    residual = step.out_of_balance(x, maps)
    along = step.along
    monkeypatch.setattr(step, "along", lambda x, dx, *known: along(x, -dx, *known))
    assert method.step(x, residual, maps)[1] == 0.0


def test_newtons_method_alone_finds_the_reactions(newton):
    """From far off, without the fixed point, its steps end at the solution that the fixed point finds."""
    _, step, maps, preconditioner, x = newton
    search = Search(step, x, math.inf)
    search_by_newton(search, preconditioner, x)
    assert search.over
    found = [contact.reaction.copy() for contact in step.contacts]
    bound = dc.FixedPoint().bind(step.body, step.contacts, step.stiffness, {})
    step.measure(bound.solve(step).x)
    bound.destroy()
    for contact, reaction in zip(step.contacts, found):
        largest = step.body.largest(np.abs(contact.reaction))
        assert np.abs(reaction - contact.reaction).max(initial=0.0) <= 1e-8 * largest
