# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Nonlinear bodies in contact: closed forms, exact balances, quadratic convergence, refusals."""

import nonlinear_scenes as scenes
import numpy as np
import pytest
import ufl
from nonlinear_scenes import HEIGHT, block, move
from scipy.optimize import brentq

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem

from dolfinx_contact.bodies.elastic import ElasticBody
from dolfinx_contact.extend import Solver
from dolfinx_contact.petsc.linear_solver import MULTIGRID_OPTIONS
from dolfinx_contact.solvers.base import SolverResult
from mechanics.material import elasticity

pytestmark = pytest.mark.ranks
SOLVERS = {
    "default": None,
    "sparse": dc.SparseNewton(),
    "fixed point": dc.FixedPoint(),
    "condensed": dc.CondensedNewton(),
}
CELLS = {2: (4, 3), 3: (3, 3, 2)}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("gdim", [2, 3])
def test_rubber_between_frictionless_planes(gdim, solver):
    """Force and bulge are those of the uniform state, at 40 % compression in two steps, and after unloading."""
    scene = block(cells=CELLS[gdim], solver=SOLVERS[solver])
    for down in (0.2, 0.4, 0.1):
        move(scene, -down * HEIGHT)
        step = scene.problem.solve()
        force, across = scenes.pressed(1 - down, gdim)
        assert scene.contact.force()[-1] == pytest.approx(force, rel=1e-7)
        assert scenes.widest(scene) == pytest.approx(across - 1, rel=1e-7)
        assert step.counts.open == 0 and step.error <= 1e-9
    move(scene, 0.0)
    scene.problem.solve()
    assert abs(scene.contact.force()[-1]) < 1e-7 * force


def test_rubber_with_multigrid():
    """Without a factorisation the fixed point solves the linearised steps, and the answer is the same."""
    scene = block(cells=(4, 3), petsc_options=MULTIGRID_OPTIONS)
    move(scene, -0.3 * HEIGHT)
    step = scene.problem.solve()
    assert step.solver == dc.SolverName.FIXED_POINT and "linearised" in step.reason
    assert scene.contact.force()[1] == pytest.approx(scenes.pressed(0.7, 2)[0], rel=1e-7)


@pytest.mark.parametrize("length, modulus", [(1e-6, 1e9), (1e4, 1e-3)])
def test_units_do_not_matter(length, modulus):
    """The same step in other units has the same number of iterations and the same numbers."""
    results = []
    for unit in ((1.0, 1.0), (length, modulus)):
        scene = block(mu=0.3, held=True, length=unit[0], modulus=unit[1])
        move(scene, 0.02, 0.01, -0.2)
        step = scene.problem.solve()
        force = scene.contact.force() / (unit[1] * unit[0] ** 2)
        results.append((step.iterations, step.counts, force))
    (n, counts, one), (m, others, other) = results
    assert n == m and counts == others
    np.testing.assert_allclose(one, other, rtol=1e-8)


def test_errors_fall_as_squares():
    """Once all statuses have settled, an error is that before it squared, up to a factor."""
    scene, errors = block(mu=0.3, held=True, tol=1e-13), []
    scene.problem.monitor = lambda iteration, error, counts: errors.append((error, counts))
    for down in (0.1, 0.2):
        errors.clear()
        move(scene, 0.0, 0.0, -down)
        scene.problem.solve()
        settled = [error for error, counts in errors if counts == errors[-1][1]]
        falling = [(a, b) for a, b in zip(settled, settled[1:]) if a < 0.1 and b > 1e-13]
        assert len(falling) >= 1
        assert all(b < 3 * a**1.8 for a, b in falling), settled


@pytest.mark.parametrize("solver", ["sparse", "fixed point"])
def test_a_block_that_slides(solver):
    """Friction is mu times the normal force along the path; supports carry both, by the form itself."""
    scene = block(mu=0.3, held=True, solver=SOLVERS[solver])
    for move_to in ((0.0, 0.0, -0.1), (0.3, 0.0, -0.1), (0.6, 0.0, -0.1)):
        move(scene, *move_to)
        step = scene.problem.solve()
    assert step.counts.stick == step.counts.open == 0
    force, reaction = scene.contact.force(), scene.contact.reaction
    sizes = np.linalg.norm(reaction[:, :2], axis=1)
    np.testing.assert_allclose(sizes, 0.3 * reaction[:, 2], rtol=1e-7)
    assert force[0] == pytest.approx(-0.3 * force[2], rel=1e-3)
    body = scene.problem.body
    supports = body.residual(scene.u.x.array[: body.size])
    carried = np.zeros(body.size)
    carried[body.fixed] = supports[body.fixed]
    total = body.total(carried.reshape(-1, 3).sum(axis=0))
    np.testing.assert_allclose(total, -force, atol=1e-7 * force[2])


def test_three_solvers_agree_and_obey_the_law():
    """Reactions are those of the form, in the cone, along slip, and zero where the gap is open; NumPy checks them."""
    answers = []
    for solver in ("sparse", "fixed point", "condensed"):
        scene = block(mu=0.2, held=True, solver=SOLVERS[solver], tol=1e-10)
        for displacement in ((0.0, 0.0, -0.15), (0.1, 0.05, -0.1)):
            move(scene, *displacement)
            scene.problem.solve()
        body, contact = scene.problem.body, scene.contact
        r = body.residual(scene.u.x.array[: body.size]).reshape(-1, 3)[contact.nodes]
        scale = body.norm(r)
        tangential, slip = np.linalg.norm(r[:, :2], axis=1), contact.slip_increment
        assert (np.abs(r[:, 2] * contact.gap) < 1e-8 * scale).all()
        assert (contact.gap > -1e-8).all()
        assert (tangential <= 0.2 * r[:, 2] + 1e-8 * scale).all()
        lengths = np.linalg.norm(slip, axis=1)
        against = np.einsum("ni,ni->n", r[:, :2], slip) + 0.2 * r[:, 2] * lengths
        assert (np.abs(against) < 1e-8 * scale).all()
        answers.append(contact.force())
    np.testing.assert_allclose(answers[1:], answers[:1] * 2, atol=1e-8 * np.abs(answers).max())


def test_the_plane_pushes_with_the_derivative_of_the_energy():
    """Without friction the force is the derivative of the stored energy by the approach; no path matters."""
    energies, forces = [], []
    for way in ((-0.1999,), (-0.2001,), (-0.1, -0.2), (-0.25, -0.2)):
        scene = block(cells=(4, 3), held=True, tol=1e-11)
        for down in way:
            move(scene, 0.0, down)
            scene.problem.solve()
        dx = ufl.dx(domain=scene.mesh, metadata=scenes.MEASURE)
        stored = fem.assemble_scalar(fem.form(scenes.energy(scene.u) * dx))
        energies.append(float(scene.problem.body.total([stored])[0]))
        forces.append(scene.contact.force()[1])
    assert forces[2] == pytest.approx(forces[3], rel=1e-9)
    assert forces[2] == pytest.approx((energies[1] - energies[0]) / 2e-4, rel=1e-6)


@pytest.mark.parametrize("gdim", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_pressure_that_follows(gdim):
    """Under a pressure on the deformed top the stress is uniform, the reaction pressure times deformed area."""

    def follower(scene, v):
        gradient = ufl.Identity(gdim) + ufl.grad(scene.u)
        normal = ufl.FacetNormal(scene.mesh)
        pressed = ufl.det(gradient) * ufl.inv(gradient).T * normal
        scene.pressure = fem.Constant(scene.mesh, 0.0)
        return scene.pressure * ufl.inner(pressed, v) * scene.ds

    scene = block(cells=CELLS[gdim], top=False, loads=lambda s, v: follower(s, v) + soft(s, v))
    for pressure in (0.3, 0.8):
        scene.pressure.value = pressure
        scene.problem.solve()
        _, across = scenes.under_pressure(pressure, gdim)
        assert scenes.widest(scene) == pytest.approx(across - 1, rel=1e-6)
        area = across ** (gdim - 1)
        assert scene.contact.force()[-1] == pytest.approx(pressure * area, rel=1e-6)


def soft(scene, v, stiffness=1e-9):
    """Springs that hold the height of a body for as long as nothing presses."""
    return stiffness * scene.u[scene.d - 1] * v[scene.d - 1] * scene.ds


def test_nonlinear_foundation():
    """A block on cubic springs at its top: the reaction is the force of both in equilibrium."""

    def spring(stretched):
        return 0.1 * stretched + 5.0 * stretched**3

    def springs(scene, v):
        scene.home = fem.Constant(scene.mesh, 0.0)
        return spring(scene.u[1] - scene.home) * v[1] * scene.ds

    scene = block(cells=(3, 2), top=False, loads=springs)
    for home in (-0.1, -0.4, 0.2):
        scene.home.value = home
        step = scene.problem.solve()
        force = 0.0
        if home < 0:
            stretch = brentq(
                lambda s, to=home: scenes.pressed(s, 2)[0] - spring(HEIGHT * (s - 1) - to), 0.3, 1
            )
            force = scenes.pressed(stretch, 2)[0]
        assert scene.contact.force()[1] == pytest.approx(force, rel=1e-7, abs=1e-9)
    assert step.counts.open == scene.problem.body.total(scene.contact.nodes.size)


def test_thermal_strain():
    """A block that is heated between frictionless planes presses with E alpha T; its body stays linear."""
    E, nu, heat = 3.0, 0.25, []

    def heated(u, v, modulus):
        heat.append(fem.Constant(u.function_space.mesh, 0.0))
        strain = ufl.sym(ufl.grad(u)) - heat[0] * ufl.Identity(3)
        lame = E * nu / ((1 + nu) * (1 - 2 * nu))
        stress = lame * ufl.tr(strain) * ufl.Identity(3) + E / (1 + nu) * strain
        return ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx

    scene = block(heated)
    for value in (0.01, -0.01, 0.02):
        heat[0].value = value
        scene.problem.solve()
        assert scene.contact.force()[2] == pytest.approx(max(E * value, 0.0), rel=1e-7, abs=1e-9)
    assert type(scene.problem.body) is ElasticBody


@pytest.mark.slow
def test_a_step_that_is_too_large_is_refused():
    """A top pushed through the plane: an error, the last state in place, and the next step as if nothing had been."""
    forces = []
    for tried in (False, True):
        scene = block(mu=0.3, held=True)
        move(scene, 0.0, 0.0, -0.1)
        scene.problem.solve()
        if tried:
            before = scene.u.x.array.copy(), scene.contact.reaction.copy()
            move(scene, 0.0, 0.0, -1.5 * HEIGHT)
            with pytest.raises(dc.NotConverged):
                scene.problem.solve()
            assert np.array_equal(scene.u.x.array, before[0])
            assert np.array_equal(scene.contact.reaction, before[1])
        move(scene, 0.0, 0.0, -0.2)
        scene.problem.solve()
        forces.append(scene.contact.force()[2])
    assert forces[1] == pytest.approx(forces[0], rel=1e-9)


def test_a_guess_that_is_the_solution():
    """A first step that starts at its solution, within the tolerance, has no tangent yet: it makes one, and goes on."""
    for form in (scenes.rubber, elasticity_of_rubber):
        first = block(form, cells=(4, 3), held=True, mu=0.3, tol=1e-12)
        move(first, 0.02, -0.1)
        first.problem.solve()
        again = block(form, cells=(4, 3), held=True, mu=0.3, solver=SOLVERS["sparse"])
        move(again, 0.02, -0.1)
        again.u.x.array[:] = first.u.x.array
        assert again.problem.solve().iterations <= 1
        np.testing.assert_allclose(again.contact.force(), first.contact.force(), rtol=1e-8)


def elasticity_of_rubber(u, v, modulus):
    return elasticity(u, v, modulus, 0.3)


class Lazy(Solver):
    """A solver that hands back where the step starts, and takes that for the solution."""

    nonlinear = True

    def bind(self, step):
        return self

    def update(self, step):
        pass

    def solve(self, step, starts):
        return SolverResult(step.start(), 0, 0.0, "Lazy")

    def close(self):
        pass


def test_boundary_values_that_were_not_reached_are_no_solution():
    """The last state is in equilibrium, and is no answer for another height of the top."""
    scene = block(cells=(4, 3))
    move(scene, -0.1)
    scene.problem.solve()
    scene.problem.solver = Lazy()
    scene.problem.solve()  # nothing has moved
    move(scene, -0.2)
    with pytest.raises(dc.NotConverged):
        scene.problem.solve()


class Lost(Lazy):
    """Linearises at a senseless displacement, and hands back one that nothing balances."""

    def solve(self, step, starts):
        x, body = step.start().x.copy(), step.body
        x[body.fixed] = step.b[body.fixed]
        body.linearise(1e40 * np.random.default_rng(0).standard_normal(x.size))
        return SolverResult(step.measure(x), 0, 0.0, "Lost")


def test_a_senseless_trial_does_not_make_forces_small():
    """Rounding is not that of the tangent where a solver got lost: a state out of balance stays one."""

    def green(u, v, modulus):
        E = ufl.sym(ufl.grad(u)) + ufl.grad(u).T * ufl.grad(u) / 2
        return ufl.derivative((ufl.inner(E, E) + ufl.tr(E) ** 2) * ufl.dx(metadata=scenes.MEASURE), u, v)  # fmt: skip

    scene = block(green, cells=(4, 3), solver=Lost())
    move(scene, -0.1)
    with pytest.raises(dc.NotConverged):
        scene.problem.solve()


@pytest.mark.parametrize("options", [None, MULTIGRID_OPTIONS], ids=["factorised", "multigrid"])
def test_no_contact_at_all(options):
    """A rubber block that hangs from its top goes with it, as far as one likes in one step."""
    scene = block(cells=(4, 3), held=True)
    bcs = scene.problem.body.bcs
    problem = dc.ContactProblem(scene.F, scene.u, [], bcs=bcs, petsc_options=options)
    move(scene, 3.0, -2.0)
    problem.solve()
    np.testing.assert_allclose(scene.u.x.array.reshape(-1, 2) - [3.0, -2.0], 0.0, atol=1e-9)


def test_linear_forms_are_recognised():
    """A linear form, written as an energy, too, has the elastic body: assembled once, factorised once."""

    def quadratic(u, v, modulus):
        strain = ufl.sym(ufl.grad(u))
        work = modulus * (ufl.inner(strain, strain) + 0.5 * ufl.tr(strain) ** 2) * ufl.dx
        return ufl.derivative(work, u, v)

    def hooke(u, v, modulus):
        return elasticity(u, v, modulus, 0.3)

    for form in (quadratic, hooke):
        scene = block(form, held=True, mu=0.3)
        for down in (0.01, 0.02):
            move(scene, 0.0, 0.0, -down)
            scene.problem.solve()
        assert type(scene.problem.body) is ElasticBody
        assert scene.problem.body.refresh() == 1
    assert type(block().problem.body) is not ElasticBody


def test_small_loads_are_those_of_the_linear_body():
    """The force of rubber and that of the linear body differ in proportion to the load."""

    def hooke(u, v, modulus):
        strain = ufl.sym(ufl.grad(u))
        stress = 2 * scenes.G * strain + scenes.LAME * ufl.tr(strain) * ufl.Identity(len(u))
        dx = ufl.dx(domain=u.function_space.mesh, metadata=scenes.MEASURE)
        return ufl.inner(stress, ufl.sym(ufl.grad(v))) * dx

    def forces(down):
        for form in (scenes.rubber, hooke):
            scene = block(form, cells=(4, 3), held=True, mu=0.3, tol=1e-11)
            move(scene, 0.0, -down)
            scene.problem.solve()
            yield scene.contact.force()[1]

    differences = [a / b - 1 for a, b in (forces(down) for down in (2e-3, 1e-3))]
    assert abs(differences[0]) < 0.01
    assert differences[0] / differences[1] == pytest.approx(2.0, rel=0.05)


def test_a_run_goes_on_from_a_checkpoint(tmp_path):
    """What follows is what would have followed."""
    forces = []
    path = scenes.MPI.COMM_WORLD.bcast(tmp_path, root=0) / "state.npz"
    for stop in (False, True):
        scene = block(mu=0.3, held=True)
        for down in (0.1, 0.2, 0.15):
            if stop and down == 0.2:
                scene.problem.save(path)
                scene = block(mu=0.3, held=True)
                scene.problem.load(path)
            move(scene, 0.05, 0.0, -down)
            scene.problem.solve()
        forces.append(scene.contact.force())
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-9, atol=1e-12)


def test_sparse_newton_on_a_linear_body():
    """The answer of the condensed problem, in fewer iterations than nodes, with the matrix assembled once."""
    answers = []
    for solver in (dc.SparseNewton(), dc.CondensedNewton()):
        scene = block(lambda u, v, E: elasticity(u, v, E, 0.3), mu=0.3, held=True, solver=solver)
        for displacement in ((0.0, 0.0, -0.02), (0.002, 0.001, -0.02)):
            move(scene, *displacement)
            step = scene.problem.solve()
        answers.append(scene.contact.force())
    assert scene.problem.body.refresh() == 1 and step.iterations < 16
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-7 * np.abs(answers).max())
    with pytest.raises(ValueError, match="max_iterations"):
        dc.SparseNewton(max_iterations=0)


@pytest.mark.parametrize("solver", [None, dc.CondensedNewton(), dc.FixedPoint()])
def test_a_plane_driven_by_force_presses_rubber(solver):
    """The plane comes as far as the uniform state of the same force; ``SparseNewton`` alone says that it does not know."""
    stretch = 0.9
    force, _ = scenes.pressed(stretch, 2)
    scene = scenes.block(cells=(2, 2), solver=solver)
    scene.surface.free, scene.surface.force = ("n",), (0.0, force)
    scenes.move(scene, 0.0, 0.0)
    scene.problem.solve()
    assert scene.surface.displacement[1] == pytest.approx((1 - stretch) * scenes.HEIGHT, rel=1e-6)
    assert scene.contact.force()[1] == pytest.approx(force, rel=1e-7)
    scene.problem.solver = dc.SparseNewton()
    with pytest.raises(ValueError, match="SparseNewton"):
        scene.problem.solve()
