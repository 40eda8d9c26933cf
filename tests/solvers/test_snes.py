# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""PETSc's SNES on body and contact together: the answers of SparseNewton, options, failures."""

import numpy as np
import pytest
import ufl
from nonlinear_scenes import HEIGHT, MPI, block, move, rubber

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from petsc4py import PETSc

from mechanics.material import elasticity

PATH = ((0.0, 0.0, -0.1), (0.05, 0.03, -0.2), (0.2, 0.03, -0.15), (0.2, 0.03, -0.05))


def hooke(u, v, modulus):
    return elasticity(u, v, modulus, 0.3)


def forces(solver, **options):
    """Force of the plane after each step of a path with friction, and who solved it."""
    scene = block(mu=0.3, held=True, solver=solver, tol=1e-10, **options)
    found = []
    for where in PATH:
        move(scene, *where)
        step = scene.problem.solve()
        assert step.error <= 1e-10 and step.forward_error <= 1e-10
        found.append(scene.contact.force())
    return np.array(found), step


@pytest.mark.filterwarnings("ignore:the body is strained")  # as rubber may be
@pytest.mark.parametrize("form", [None, hooke], ids=["rubber", "linear"])
@pytest.mark.parametrize(
    "options", [{}, {"snes_linesearch_type": "basic"}, {"snes_type": "newtontr"}]
)
def test_it_finds_what_sparse_newton_finds(form, options):
    """Pressed, dragged and unloaded with friction: the same forces, and the record names the method."""
    which = {} if form is None else {"form": form}
    found, step = forces(dc.SNES(options), **which)
    expected, _ = forces(dc.SparseNewton(), **which)
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())
    assert step.solver == dc.SolverName.SNES
    assert options.get("snes_type", "newtonls") in step.reason


def test_units_do_not_matter():
    """In other units the step has the same number of iterations and the same forces."""
    results = []
    for length, modulus in ((1.0, 1.0), (1e-6, 1e9), (1e4, 1e-3)):
        scene = block(mu=0.3, held=True, solver=dc.SNES(), length=length, modulus=modulus)
        move(scene, 0.02, 0.01, -0.2)
        step = scene.problem.solve()
        results.append((step.iterations, *(scene.contact.force() / (modulus * length**2))))
    np.testing.assert_allclose(results[1:], results[:1] * 2, rtol=1e-8)


@pytest.mark.parametrize("where", ["argument", "database"])
def test_options_have_an_effect(where, capfd):
    """One iteration is not enough, PETSc's reason is named, the last state stays; monitors print. What stands in PETSc's
    database under the problem's prefix goes before the argument."""
    given = {"snes_max_it": 1, "snes_monitor": None}
    database, prefix = PETSc.Options("pressed_"), "pressed_"
    scene = block(mu=0.3, held=True, solver=dc.SNES({"snes_max_it": 50}), petsc_options_prefix=prefix)  # fmt: skip
    move(scene, *PATH[0])
    scene.problem.solve()
    before = scene.u.x.array.copy(), scene.contact.reaction.copy()
    capfd.readouterr()
    move(scene, *PATH[1])
    if where == "database":
        for name, value in given.items():
            database[name] = value
    else:
        scene.problem.solver = dc.SNES(given)
    try:
        with pytest.raises(dc.NotConverged, match="SNES: newtonls, DIVERGED_MAX_IT"):
            scene.problem.solve()
    finally:
        for name in given:
            del database[name]
    assert np.array_equal(scene.u.x.array, before[0])
    assert np.array_equal(scene.contact.reaction, before[1])
    if MPI.COMM_WORLD.rank == 0:
        assert "1 SNES Function norm" in capfd.readouterr().out
    scene.problem.solver = dc.SNES()
    scene.problem.solve()
    assert MPI.COMM_WORLD.rank or "SNES" not in capfd.readouterr().out  # options are gone again


def test_options_that_nobody_reads():
    """A misspelt option is named."""
    scene = block(held=True, solver=dc.SNES({"snes_linesearch_tipe": "l2"}))
    move(scene, *PATH[0])
    with pytest.warns(UserWarning, match="snes_linesearch_tipe.*misspelt"):
        scene.problem.solve()


def test_a_step_that_is_too_large_is_refused():
    """A top pushed through the plane: an error, and the next step as if nothing had been."""
    expected, _ = forces(dc.SNES())
    scene = block(mu=0.3, held=True, solver=dc.SNES(), tol=1e-10)
    move(scene, *PATH[0])
    scene.problem.solve()
    move(scene, 0.0, 0.0, -1.5 * HEIGHT)
    with pytest.raises(dc.NotConverged, match="SNES: "):
        scene.problem.solve()
    move(scene, *PATH[1])
    scene.problem.solve()
    np.testing.assert_allclose(scene.contact.force(), expected[1], rtol=1e-8)


class Breaking:
    """What the user's function raises at its n-th call."""

    def __init__(self, calls):
        self.left = calls

    def __call__(self, u):
        self.left -= 1
        if self.left == 0:
            raise ValueError("the material broke")


def test_errors_of_callbacks_come_through():
    """What before_residual raises within SNES is raised by the step, which can be taken again."""
    breaking, late = Breaking(10**6), {}

    def form(u, v, modulus):
        F = rubber(u, v, modulus)
        late.update(
            J=ufl.derivative(F, u, ufl.TrialFunction(u.function_space)), before_residual=breaking
        )
        return F

    scene = block(form, mu=0.3, held=True, solver=dc.SNES(), tol=1e-10, late=late)
    for where in PATH[:2]:
        move(scene, *where)
        breaking.left = 10**6
        scene.problem.solve()
    expected, used = scene.contact.force(), 10**6 - breaking.left
    scene.problem.reset()
    for where in PATH[:2]:
        move(scene, *where)
        breaking.left = used - 3
        with pytest.raises(ValueError, match="the material broke"):
            scene.problem.solve()
        breaking.left = 10**6
        scene.problem.solve()
    np.testing.assert_allclose(scene.contact.force(), expected, rtol=1e-8)


def test_refusals():
    """Options that are no dictionary, and planes driven by force, are refused by name."""
    with pytest.raises(ValueError, match="petsc_options must be a dictionary"):
        dc.SNES("-snes_monitor")
    scene = block(hooke, solver=dc.SNES())
    scene.surface.free, scene.surface.force = ("n",), (0, 0, 0.01)
    with pytest.raises(ValueError, match=r"SNES\(\) does not know planes driven by force"):
        scene.problem.solve()
