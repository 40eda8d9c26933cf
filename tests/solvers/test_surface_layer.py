# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The linearised contact near the plane: its Jacobian, its block, and what it is for."""

import math
import resource
from types import SimpleNamespace

import numpy as np
import pytest
import scenes

import dolfinx_contact as dc
from dolfinx_contact.law.maps import BipotentialMap, ReturnMap
from dolfinx_contact.petsc.linear_solver import MULTIGRID_OPTIONS
from dolfinx_contact.solvers.fixed_point.preconditioner import ContactPreconditioner
from dolfinx_contact.solvers.fixed_point.surface_layer import SurfaceLayer
from dolfinx_contact.solvers.search import Search

LAWS = [(0.0, None), (0.2, None), ((0.3, 0.15), None), ((0.3, 0.15), (0.05, 0.2))]


def linearised(map, turn=None, **options):
    """A load step of a pressed and sheared block, maps, the preconditioner, and a state with all statuses."""
    scene = scenes.block(cells=(6, 6, 3), turn=turn, **options)
    scene.move_top(0.001, 0.0005, -0.005)
    scene.problem.solve()
    last = scene.u.x.array[: scene.problem.body.size].copy()
    scene.move_top(0.002, 0.0, -0.003)
    step = scene.problem.load_step()
    x = last + 0.3 * (step.body.solve(step.b) - last)
    x[step.body.fixed] = step.b[step.body.fixed]
    rho = [contact.stiffness.normal for contact in step.contacts]
    maps = [BipotentialMap(r) if map == "bipotential" else ReturnMap(r, r) for r in rho]
    return step, maps, ContactPreconditioner(step, maps), x


@pytest.mark.parametrize("map", ["return", "bipotential"])
@pytest.mark.parametrize("mu, p", LAWS)
def test_tangent_is_the_derivative_of_the_residual(map, mu, p):
    """J x is the difference quotient of the fixed point's residual, in any direction, in a turned frame."""
    step, maps, preconditioner, x = linearised(map, turn=scenes.rotation(), mu=mu, p=p)
    body = step.body
    before = step.evaluate(x, maps)
    preconditioner.linearise(step, step.derivatives(before, maps))
    rng = np.random.default_rng(scenes.COMM.rank)
    for _ in range(3):
        direction = rng.normal(size=x.size) * np.abs(body.norm(x)) / np.sqrt(x.size)
        direction[body.fixed] = 0.0
        h = 1e-7
        after = step.evaluate(x + h * direction, maps)
        quotient = -(after.residual - before.residual) / h
        product = preconditioner.tangent(direction)
        assert body.norm(quotient - product) <= 1e-5 * body.norm(product)


@pytest.mark.parametrize("mu, p", LAWS)
def test_block_is_solved_exactly(mu, p):
    """The correction of the layers leaves no residual there, on any number of ranks."""
    step, maps, _, x = linearised("return", mu=mu, p=p)
    body = step.body
    layer = SurfaceLayer(body, [contact.points for contact in step.contacts], "block_")
    layer.linearise(step, step.derivatives(step.evaluate(x, maps), maps))
    residual = np.random.default_rng(scenes.COMM.rank).normal(size=x.size)
    residual[body.fixed] = 0.0
    correction, left = layer.correct(residual)
    by_all_of_it = residual - layer.multiply(correction, body.multiply(correction))
    assert body.norm(left - by_all_of_it) <= 1e-12 * body.norm(residual)
    near = body.total(np.array([layer.dofs.size]))[0]
    planes = 7 * 7 * 3  # nodes of one horizontal plane
    assert near == 2 * planes or scenes.COMM.size > 1 and near <= 2 * planes
    assert body.norm(left[layer.dofs]) <= 1e-10 * body.norm(residual)


def test_near_a_solution_the_contact_is_linearised_at_once(monkeypatch):
    """Steps of steady sliding, which begin near their solutions, take fewer iterations with a tangent from the start, and end where they do without."""

    def slid(near):
        monkeypatch.setattr("dolfinx_contact.solvers.fixed_point.fixed_point.NEAR_ERROR", near)
        scene = scenes.block(
            cells=(8, 8, 3), mu=(0.3, 0.15), p=(0.05, 0.2), petsc_options=MULTIGRID_OPTIONS, solver=dc.FixedPoint()
        )  # fmt: skip
        for k in range(5):
            scene.move_top(0.004 * k, 0.002 * k, -0.005)
            step = scene.problem.solve()
        return step.iterations, scene.contact.reaction

    (late, one), (soon, other) = slid(0.0), slid(0.1)
    assert soon <= 0.75 * late
    assert np.abs(one - other).max(initial=0.0) <= 1e-6 * np.abs(one).max(initial=1.0)


def test_tangent_saves_iterations_where_slip_is_far_from_the_normal(monkeypatch):
    """Loading and unloading under a strongly non-associated rule take fewer iterations with the tangent."""

    def iterations(every):
        monkeypatch.setattr(
            "dolfinx_contact.solvers.fixed_point.fixed_point.TANGENT_INTERVAL", every
        )
        monkeypatch.setattr("dolfinx_contact.solvers.fixed_point.fixed_point.NEAR_ERROR", 0.0)
        scene = scenes.block(
            cells=(14, 14, 5), mu=(0.3, 0.15), p=(0.02, 0.3), petsc_options=MULTIGRID_OPTIONS,
            solver=dc.FixedPoint(),
        )  # fmt: skip
        count = 0
        for depth in (0.01, 0.0092, 0.0085):
            scene.move_top(0, 0, -depth)
            count += scene.problem.solve().iterations
        return count

    assert iterations(20) < 0.85 * iterations(10**6)


@pytest.mark.slow
@pytest.mark.skipif(scenes.COMM.size > 1, reason="memory of one process")
def test_replaced_solvers_give_their_memory_back(monkeypatch):
    """A stiffness that changes in every step does not leave the factorisations of the last ones behind."""

    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * resource.getpagesize()

    monkeypatch.setattr(
        "dolfinx_contact.solvers.fixed_point.fixed_point.TANGENT_INTERVAL", 5
    )  # the layers are factorised too
    scene = scenes.block(cells=(12, 12, 8), solver=dc.FixedPoint())

    def solve(k):
        scene.modulus.value = 210e3 * (1 + 0.01 * k)
        scene.move_top(0, 0, -0.01 * (1 - 0.05 * (k % 3)))
        scene.problem.solve()

    for k in range(4):
        solve(k)
    before, factor = resident(), 13 * 13 * 9 * 3 * 300 * 8  # some hundreds of entries a row: 11 MB
    for k in range(4, 12):
        solve(k)
    # The allocator takes 26 MB once, at some step (40 steps were watched); a leak takes 8 factors and more.
    assert resident() - before < 4 * factor


class _State:
    """A state with an error."""

    is_far, nodes = False, ()

    def __init__(self, error):
        errors = dict(largest=error, balance=error, change=0.0, acts=True)
        self.errors = self.balance = SimpleNamespace(**errors, within=lambda tol: False)


def test_an_attempt_has_a_best_state_of_its_own():
    """A search that begins anew goes on from the best state since then, not from that of a lost attempt, and returns the best of all."""
    states = [_State(error) for error in (1e-3, 1e-5, 1e-2, 1e-1, 1e-4)]
    step = SimpleNamespace(tol=1e-10, tell=lambda state: None)
    search = Search(step, states[0], math.inf)

    def seen(*places):
        for k in places:
            search.see(states[k])
            search.count(1)

    search.begin(search.best, 400, 2)
    seen(0, 1, 2, 3, 3)
    assert not search.goes_on and search.best is search.nearest is states[1]
    search.begin(states[3], 400, 2)
    assert search.goes_on and search.nearest is states[3]
    seen(3, 2, 4)
    assert search.goes_on and search.nearest is states[4] and search.best is states[1]
