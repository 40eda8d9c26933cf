# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Mistakes that used to end in another library's words, or in none, are a ValueError that says what to do."""

import math
import os
import pickle

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem

import dolfinx_contact as dc

COMM = scenes.COMM
ONE = np.eye(3)


@pytest.fixture(scope="module")
def scene():
    return scenes.block(cells=(2, 2, 2))


def rebuilt(scene, **changes):
    arguments = {"F": scene.F, "u": scene.u, "contacts": [scene.contact], "bcs": scene.bcs}
    return dc.ContactProblem(**arguments | changes)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"contacts": None}, "contacts must be a list of dc.Contact objects, got None"),
        ({"contacts": 3}, "contacts must be a list"),
        ({"bcs": None}, r"bcs must be a list .*got None: \[\] for none"),
        ({"bcs": "one"}, r"write bcs=\[bc\]"),
        ({"bcs": [None]}, "bcs must hold what dirichletbc returns, got None"),
        ({"solver": dc.FixedPoint}, r"solver FixedPoint is a class: write solver=FixedPoint\(\)"),
        ({"tol": True}, "tol must be a finite number .*got True"),
        ({"tol": math.inf}, "tol must be a finite number .*got inf"),
        (
            {"internal": [3]},
            r"internal must be dc.InternalVariables\(state, ...\) or None, got \[3\]",
        ),
        ({"jit_options": "-O3"}, "jit_options must be a dictionary .*got '-O3'"),
        ({"form_compiler_options": 1}, "form_compiler_options must be a dictionary .*got 1"),
        ({"petsc_options": "lu"}, "petsc_options must be a dictionary .*got 'lu'"),
    ],
)
def test_problem_refuses(scene, changes, message):
    """What no problem can be made of names the argument, its value and what to write."""
    if changes.get("bcs") == "one":
        changes = {"bcs": scene.bcs[0]}
    with pytest.raises(ValueError, match=message):
        rebuilt(scene, **changes)


def test_u_of_another_mesh_is_refused(scene):
    """A displacement of another mesh does not belong to contacts and F."""
    other = scenes.block(cells=(2, 2, 2))
    for contacts in ([scene.contact], []):
        with pytest.raises(ValueError, match="another space"):
            rebuilt(scene, u=other.u, contacts=contacts, bcs=[])


@pytest.mark.parametrize("nu", [0.5, 0.6, 0.9, 2.0, -1.5])
def test_moduli_that_no_material_has_are_refused(nu):
    """A Poisson's ratio outside of (-1, 0.5) makes a body that gains energy: said before anything is solved."""
    scene = scenes.block(cells=(2, 2, 2))
    with np.errstate(all="ignore"):
        modulus, ratio = fem.Constant(scene.mesh, 210e3), fem.Constant(scene.mesh, nu)
    problem = rebuilt(
        scene, F=scenes.elasticity(scene.u, ufl.TestFunction(scene.V), modulus, ratio)
    )
    scene.move_top(0, 0, -0.01)
    with pytest.raises(ValueError, match="nu|moduli"):
        problem.solve()


@pytest.mark.parametrize(
    "make, message",
    [
        (
            lambda: dc.CondensedNewton(max_iterations=math.inf),
            "max_iterations must be a positive whole",
        ),
        (
            lambda: dc.CondensedNewton(newton_iterations=2.5),
            "newton_iterations must be a positive whole",
        ),
        (lambda: dc.FixedPoint(max_iterations=math.inf), "max_iterations must be a positive whole"),
        (lambda: dc.FixedPoint(rho=math.inf), "rho must be a positive number, got inf"),
        (lambda: dc.FixedPoint(depth=2.5), "depth must be a positive whole number, got 2.5"),
    ],
)
def test_solvers_refuse(make, message):
    """Options are finite, and whole where they count."""
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    "W, q, friction, options, message",
    [
        (np.zeros((0, 0)), np.zeros((0, 3)), dc.Friction(0.3), {}, "q is empty"),
        (ONE, ONE[2:], dc.Friction(0.3, axes=np.array([[1.0, 0.0]] * 2)), {}, "axes for 2 contacts, q has 1"),
        (np.eye(6), np.zeros((2, 3)), dc.Friction(0.3, axes=np.array([[1.0, 0.0]])), {}, "axes for 1 contacts, q has 2"),
        (ONE, np.ma.masked_less(ONE[2:], 0.5), dc.Friction(0.3), {}, "q has masked entries"),
        (np.diag([-1.0, 1.0, 1.0]), ONE[2:], dc.Friction(0.3), {}, "negative tangential diagonal entry, -1 at contact 0"),
        (ONE, ONE[2:], dc.Friction(0.3), {"tol": True}, "tol must be a positive number, got True"),
        (ONE, ONE[2:], dc.Friction(0.3), {"tol": math.inf}, "tol must be a positive number, got inf"),
    ],
)  # fmt: skip
def test_condensed_problems_refuse(W, q, friction, options, message):
    """Arrays that do not belong together, or have no meaning, are named."""
    with pytest.raises(ValueError, match=message):
        dc.solve_condensed(W, q, friction, **options)


def test_without_friction_a_tangential_force_is_outside_the_cone():
    """The gap of the bi-potential is infinite for it, and at a frictionless node of a field finite without it."""
    r, gap, slip = (
        np.array([[0.1, 0.0, 1.0], [0.0, 0.0, 1.0]]),
        np.array([0.0, 0.5]),
        np.ones((2, 2)),
    )
    field = np.array([[0.0, 0.0], [0.0, 0.0]])
    mixed = np.array([[0.3, 0.2], [0.0, 0.0]])
    assert dc.law.bipotential_gap(r, gap, slip, dc.Friction(0.0)).tolist() == [math.inf, 0.5]
    assert dc.law.bipotential_gap(r, gap, slip, dc.Friction(field)).tolist() == [math.inf, 0.5]
    found = dc.law.bipotential_gap(r, gap, slip, dc.Friction(mixed))
    alone = dc.law.bipotential_gap(r[:1], gap[:1], slip[:1], dc.Friction((0.3, 0.2)))
    assert found.tolist() == [alone[0], 0.5]


def test_projection_of_the_largest_and_of_unaligned_numbers():
    """Every finite point has a projection, which scales with it; arrays may lie anywhere in memory."""
    tau = np.array(
        [
            [1.7e308, -1e308, 1.2e308],
            [1e308, 0.0, -1.7e308],
            [1.0, 2.0, 0.5],
            [np.nan, 0, 0],
            [np.inf, 0, 0],
        ]
    )
    found, small = (
        dc.law.project_cone(points, (0.3, 0.15)) for points in (tau, tau[:3] * 2.0**-900)
    )
    assert np.isfinite(found[:3]).all() and np.isnan(found[3:]).all()
    assert np.allclose(found[:3] * 2.0**-900, small, rtol=1e-14, atol=0)
    room = np.zeros(3 * 24 + 1, dtype=np.uint8)
    unaligned = room[1:].view(np.float64).reshape(3, 3)
    unaligned[:] = tau[2]
    assert np.array_equal(
        dc.law.project_cone(unaligned, 0.3), dc.law.project_cone(tau[[2, 2, 2]], 0.3)
    )


def test_a_checkpoint_needs_a_name(scene, tmp_path):
    """No file is left behind by a mistake, and what is no checkpoint is called so."""
    with pytest.raises(ValueError, match="path must be a file name, got None"):
        scene.problem.save(None)
    assert not os.path.exists("None.unfinished")
    path = COMM.bcast(tmp_path, root=0) / "broken.npz"
    for content in (b"", b"PK\x03\x04 torn", b"text"):
        if COMM.rank == 0:
            path.write_bytes(content)
        COMM.barrier()
        with pytest.raises(ValueError, match="is no checkpoint"):
            scene.problem.load(path)
        COMM.barrier()


def test_failures_travel_between_processes():
    """What is raised can be pickled, as a pool of processes does, with all that it carries."""
    W, q = np.eye(3), np.array([[0.1, 0.0, -1.0]])
    result = dc.solve_condensed(W, q, dc.Friction(0.3))
    lost = pickle.loads(pickle.dumps(dc.CondensedNotConverged(result)))
    assert np.array_equal(lost.best.reaction, result.reaction) and lost.tried == result.tried
    scene = scenes.block(cells=(2, 2, 2), solver=dc.FixedPoint(max_iterations=1))
    scene.move_top(0.01, 0, -0.01)
    with pytest.raises(dc.NotConverged) as caught:
        scene.problem.solve()
    lost = pickle.loads(pickle.dumps(caught.value))
    assert str(lost) == str(caught.value) and lost.step == caught.value.step
    assert np.array_equal(lost.displacement, caught.value.displacement)
    assert np.array_equal(lost.reactions[0], caught.value.reactions[0])
