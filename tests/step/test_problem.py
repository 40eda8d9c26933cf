# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact problems against what mechanics says of them: closed forms, symmetries, units, limits."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from dolfinx_contact.petsc.linear_solver import (
    DIRECT_OPTIONS,
    MULTIGRID_OPTIONS,
    SYMMETRIC_OPTIONS,
    LinearSolver,
)
from dolfinx_contact.solvers.fixed_point.fixed_point import half_step

pytestmark = pytest.mark.ranks
COMM = MPI.COMM_WORLD
PRESS = [(0, 0, -0.005), (0.001, 0.0005, -0.01), (0.002, -0.001, -0.006)]
CASES = {
    "A": {"mu": 0.2, "p": None},
    "B": {"mu": (0.3, 0.15), "p": None},
    "C": {"mu": (0.3, 0.15), "p": (0.05, 0.20)},
    "frictionless": {"mu": 0.0, "p": None},
}


def run(programme=PRESS, **options):
    """Reactions of all nodes after every step of a programme of top displacements, and the scene."""
    scene = scenes.block(**options)
    history = []
    for displacement in programme:
        scene.move_top(*displacement)
        step = scene.problem.solve()
        assert step.error <= scene.problem.tol
        history.append(scenes.gathered(scene.contact)[1])
    return np.array(history), scene


@pytest.mark.parametrize("case", CASES)
def test_every_step_obeys_the_law(case):
    """Gap, reaction and slip of a converged step satisfy the paper's if-then-else, node by node."""
    scene = scenes.block(**CASES[case])
    mu = np.broadcast_to(CASES[case]["mu"], 2)
    p = mu if CASES[case]["p"] is None else np.array(CASES[case]["p"])
    seen = set()
    for displacement in [*PRESS, (0.02, 0, -0.001), (0, 0, 0.001)]:
        scene.move_top(*displacement)
        step = scene.problem.solve()
        c = scene.contact
        load = 210e3 * 0.01  # forces of the order of E times length times displacement
        assert (c.reaction[:, 2] >= 0).all()
        assert (c.gap >= -1e-9).all()
        assert (np.abs(c.gap * c.reaction[:, 2]) <= 1e-9 * load).all()
        for r, slip, status in zip(c.reaction, c.slip_increment, c.status):
            seen.add(int(status))
            if status == dc.Status.OPEN:
                assert (r == 0).all()
            elif status == dc.Status.STICK:
                assert np.linalg.norm(slip) <= 1e-9
            elif mu[0] > 0:
                assert np.hypot(*(r[:2] / mu)) == pytest.approx(r[2], abs=1e-9 * load)
                direction = -(r[:2] / p**2)
                direction /= np.linalg.norm(direction)
                assert slip == pytest.approx(np.linalg.norm(slip) * direction, abs=1e-8)
            else:
                assert (r[:2] == 0).all()
        assert step.counts == tuple(
            scene.V.mesh.comm.allreduce(np.bincount(c.status, minlength=3)).tolist()
        )
        assert (c.bipotential_gap >= 0).all()
    seen = set.union(*scene.V.mesh.comm.allgather(seen))
    assert seen == ({0, 2} if case == "frictionless" else {0, 1, 2})


@pytest.mark.parametrize("case", CASES)
def test_ranks_do_not_change_the_answer(case):
    """The answer on all ranks together is that of one rank alone."""
    together, _ = run(**CASES[case])
    alone, _ = run(comm=MPI.COMM_SELF, **CASES[case])
    assert together.shape == alone.shape
    assert np.abs(together - alone).max() <= 1e-8 * np.abs(alone).max()


@pytest.mark.parametrize("seed", range(3))
def test_rotated_scene_gives_the_rotated_answer(seed):
    """Turning mesh, plane, axis and loads by any rotation leaves the local reactions as they were."""
    straight, scene = run()
    turn = scenes.rotation(seed)
    turned, other = run(turn=turn)
    x, _ = scenes.gathered(scene.contact)
    y, _ = scenes.gathered(other.contact)
    nearest = np.argmin(np.linalg.norm(x @ turn.T - y[:, None], axis=2), axis=1)
    assert np.linalg.norm(x[nearest] @ turn.T - y) < 1e-12
    assert np.abs(turned - straight[:, nearest]).max() <= 1e-8 * np.abs(straight).max()
    assert other.contact.force() == pytest.approx(turn @ scene.contact.force(), rel=1e-8)


@pytest.mark.parametrize(
    "length, modulus", [(1e-3, 1e6), (1e9, 1.0), (1e-9, 1.0), (1, 1e9), (1, 1e-9)]
)
def test_units_scale_the_answer_and_nothing_else(length, modulus):
    """Lengths and moduli in other units: reactions scale by modulus times length squared."""
    reference, _ = run()
    scaled, _ = run(length=length, E=210e3 * modulus)
    expected = reference * modulus * length**2
    assert np.abs(scaled - expected).max() <= 1e-8 * np.abs(expected).max()


@pytest.mark.slow
def test_scale_of_p_and_metric_do_not_change_the_answer():
    """Only the ratio p_y/p_x is physical, and rho is numerical."""
    reference, _ = run()
    for options in (
        {"p": (0.05e9, 0.20e9)},
        {"solver": dc.FixedPoint(map="bipotential", rho=0.5, max_iterations=2000)},
        {"solver": dc.FixedPoint(map="bipotential", rho=5.0, max_iterations=2000)},
    ):
        other, _ = run(**options)
        assert np.abs(other - reference).max() <= 1e-8 * np.abs(reference).max()


def test_lifted_body_feels_nothing():
    """A body off the plane has no reactions and costs no iteration; it comes back to the same answer."""
    scene = scenes.block()
    scene.move_top(0, 0, 0.1)
    step = scene.problem.solve()
    assert step.iterations == 0
    assert step.error <= 1e-10
    assert step.counts == (25, 0, 0)
    assert (scene.contact.reaction == 0).all()
    assert scene.contact.gap == pytest.approx(0.1, rel=1e-12)
    scene.move_top(0, 0, -0.005)
    scene.problem.solve()
    there_again = scenes.gathered(scene.contact)[1]
    scene.move_top(0, 0, 0.1)
    assert scene.problem.solve().iterations == 0
    scene.move_top(0, 0, -0.005)
    scene.problem.solve()
    # From the same place above the plane, the way down is the same.
    assert scenes.gathered(scene.contact)[1] == pytest.approx(
        there_again, abs=1e-8 * there_again.max()
    )


def test_dragged_block_pulls_along_its_slip_rule():
    """Plane displaced by d under a held block: all nodes slip, and r_t is along P^2 d, on the cone.

    The plane moves along d relative to the body, so -Delta u_t = d and P^-2 r_t is along d.
    """
    mu, p = np.array([0.3, 0.15]), np.array([0.05, 0.2])
    scene = scenes.block(mu=mu, p=p)
    scene.move_top(0, 0, -0.001)
    scene.problem.solve()
    d = np.array([3.0, 1.0])
    for k in range(1, 4):
        scene.surface.displacement = (k * d[0], k * d[1], 0)
        step = scene.problem.solve()
    assert step.counts.slip == 25
    direction = p**2 * d
    r = scene.contact.reaction
    for node in r:
        # The body gives way elastically by 1e-3 of the stroke in the first step, not after it.
        scale = node[2] / np.hypot(*(direction / mu))
        assert node[:2] == pytest.approx(scale * direction, rel=1e-5)
    total = scene.contact.force()
    assert np.hypot(*(total[:2] / mu)) == pytest.approx(total[2], rel=1e-9)


def test_plane_moves_as_if_the_body_moved_the_other_way():
    """Only relative motion counts: plane up by d, or top down by d."""
    reference, _ = run(programme=[(0, 0, -0.005), (0.001, 0, -0.008)])
    scene = scenes.block()
    for displacement in [(0, 0, 0.005), (-0.001, 0, 0.008)]:
        scene.surface.displacement = displacement
        scene.problem.solve()
    other = scenes.gathered(scene.contact)[1]
    assert other == pytest.approx(reference[-1], abs=1e-8 * np.abs(reference).max())


def test_plane_strain_punch_has_the_same_names():
    """Two dimensions: arrays lose a column, the law is Coulomb's, nothing else changes."""
    scene = scenes.block(cells=(6, 3), mu=0.2, p=None)
    for top in [(0, -0.005), (0.002, -0.008)]:
        scene.move_top(*top)
        assert scene.problem.solve().error <= 1e-10
    c = scene.contact
    assert c.reaction.shape[1:] == (2,) and c.slip_increment.shape[1:] == (1,)
    slipping, sticking = c.status == dc.Status.SLIP, c.status == dc.Status.STICK
    t, n = c.reaction.T
    assert np.abs(t[slipping]) == pytest.approx(0.2 * n[slipping], rel=1e-9)
    assert (t[slipping] * c.slip_increment[slipping, 0] <= 0).all()
    assert (np.abs(c.slip_increment[sticking]) <= 1e-10).all()
    assert (n[c.status != dc.Status.OPEN] > 0).all()
    assert c.force() == pytest.approx(
        scene.mesh.comm.allreduce(c.reaction.sum(axis=0)) @ c.frame, rel=1e-12
    )
    assert scene.mesh.comm.allreduce(int(slipping.sum())) > 0


def test_matrix_is_rebuilt_only_when_it_changes():
    """A new load keeps the factorisation, a new modulus replaces it, and reset starts afresh."""
    scene = scenes.block()
    scene.move_top(0, 0, -0.005)
    scene.problem.solve()
    first = scenes.gathered(scene.contact)[1]
    body = scene.problem.body
    assert body.refresh() == 1
    scene.modulus.value = 420e3
    scene.problem.reset()
    assert (scene.u.x.array == 0).all() and (scene.contact.reaction == 0).all()
    scene.problem.solve()
    assert scenes.gathered(scene.contact)[1] == pytest.approx(2 * first, abs=1e-8 * first.max())
    assert body.refresh() == 2


def test_a_modulus_that_changes_on_one_rank_alone_changes_the_next_step():
    """Softer cells at one end: without friction the step ends as one of a body that was soft there from the start."""
    found = []
    for change in (False, True):
        scene = scenes.block(mu=0.0, p=None)
        stiff = fem.Function(functionspace(scene.mesh, ("DG", 0)))
        stiff.x.array[:] = 1000.0
        middles = stiff.function_space.tabulate_dof_coordinates()[:, 0]
        u = fem.Function(scene.V)
        F = scenes.elasticity(u, ufl.TestFunction(scene.V), stiff, 0.3)
        contact = dc.Contact(scene.V, scene.facets, scene.surface, dc.Friction(0.0))
        problem = dc.ContactProblem(F, u, [contact], bcs=scene.bcs, tol=1e-10)
        scene.move_top(0, 0, -0.01)
        if change:
            problem.solve()
        stiff.x.array[middles < -0.3] = 100.0
        problem.solve()
        found.append(scenes.by_position(SimpleNamespace(contact=contact), "reaction"))
    assert np.abs(found[0] - found[1]).max() < 1e-7 * np.abs(found[0]).max()


@pytest.mark.parametrize(
    "cap, iterations",
    [(dict(rho=1.0, max_iterations=3), 3), (dict(max_seconds=1e-9), 0)],
)
def test_failed_step_leaves_the_last_state_and_its_record(cap, iterations):
    """A step that does not converge raises with its error and iterations; nothing computed is lost."""
    scene = scenes.block(solver=dc.FixedPoint(**cap))
    scene.move_top(0, 0, 0.001)
    scene.problem.solve()
    u = scene.u.x.array.copy()
    scene.move_top(0.001, 0, -0.01)
    with pytest.raises(dc.NotConverged, match=f"after {iterations} iterations") as caught:
        scene.problem.solve()
    step = caught.value.step
    assert step.error > scene.problem.tol and step.iterations == iterations
    assert np.array_equal(scene.u.x.array, u)
    assert (scene.contact.reaction == 0).all()
    scene.problem.solver = dc.FixedPoint()
    assert scene.problem.solve().error <= scene.problem.tol


@pytest.mark.slow
def test_wrong_derivative_is_never_taken_for_convergence():
    """The reported equilibrium residual is assembled from F itself: a wrong J cannot hide."""
    import ufl

    scene = scenes.block()
    du, v = ufl.TrialFunction(scene.V), ufl.TestFunction(scene.V)
    wrong = scenes.elasticity(du, v, 210e3, 0.25)
    problem = dc.ContactProblem(
        scene.F,
        scene.u,
        [scene.contact],
        bcs=scene.bcs,
        J=wrong,
        solver=dc.FixedPoint(max_iterations=50),
    )
    scene.move_top(0, 0, -0.01)
    with pytest.raises(dc.NotConverged):
        problem.solve()


@pytest.mark.slow
def test_options_of_compilation_reach_the_compilers(tmp_path):
    """Forms are compiled where ``jit_options`` say, as ``form_compiler_options`` say, and stay what they are."""
    folder = Path(COMM.bcast(str(tmp_path)))
    reactions = []
    for name, given in (("a", {}), ("b", {"epsilon": 1e-10})):
        jit, kept = {"cache_dir": str(folder / name)}, dict(given)
        scene = scenes.block(cells=(2, 2, 2))
        problem = dc.ContactProblem(scene.F, scene.u, scene.contact, bcs=scene.bcs, form_compiler_options=given, jit_options=jit)  # fmt: skip
        assert given == kept and list(jit) == ["cache_dir"]
        scene.move_top(0.002, 0, -0.01)
        problem.solve()
        reactions.append(scenes.gathered(scene.contact)[1])
    np.testing.assert_allclose(*reactions, atol=1e-9 * np.abs(reactions[0]).max())
    COMM.barrier()
    forms = [{file.stem for file in (folder / name).glob("libffcx_forms_*.c")} for name in "ab"]
    assert (
        min(map(len, forms)) >= 2
    )  # residual and tangent; ranks may number what is in them differently
    assert not forms[0] & forms[1]


def test_linear_solver_is_the_users_choice():
    """petsc_options reach PETSc: conjugate gradients with multigrid give the same reactions."""
    reference, _ = run()
    options = {"ksp_type": "cg", "pc_type": "gamg", "ksp_rtol": 1e-12}
    other, scene = run(petsc_options=options, petsc_options_prefix="mine_")
    assert np.abs(other - reference).max() <= 1e-8 * np.abs(reference).max()
    step = scene.problem.solve()
    assert step.solver == dc.SolverName.FIXED_POINT
    assert step.reason.startswith("without a factorisation")
    for solver, told in (
        (None, "ksp_max_it.*factorisation"),
        (dc.CondensedNewton(), "factorisation"),
    ):
        with pytest.raises(dc.LinearSolverError, match=told):
            run(petsc_options={**options, "ksp_max_it": 1}, solver=solver)


def test_symmetric_stiffness_is_factorised_as_such():
    """Fewer entries of factors, for none of the zeros that supports make; LU where the other triangle differs; the answers of LU."""
    _, scene = run()
    K = scene.problem.body.K
    row, _ = K.getOwnershipRange()
    columns, values = K.getRow(row)
    beside = columns[np.argmax(np.abs(values) * (columns != row))]
    b = np.random.default_rng(row).normal(size=scene.problem.body.size)
    for change, kind, fewer in ((0.0, "cholesky", 0.7), (1e-6, "lu", 1.0)):
        A = K.copy()
        A.setValue(row, beside, change * np.abs(values).max(), PETSc.InsertMode.ADD_VALUES)
        A.assemble()
        ours, plain = (
            LinearSolver(A, options, "factors_", None) for options in (None, DIRECT_OPTIONS)
        )
        assert ours.ksp.getPC().getType() == kind
        x, expected = ours.solve(b), plain.solve(b)
        assert np.abs(x - expected).max(initial=0.0) <= 1e-10 * np.abs(expected).max(initial=1.0)
        entries, of_all = (
            each.ksp.getPC().getFactorMatrix().getMumpsInfog(29) for each in (ours, plain)
        )
        assert entries < fewer * of_all
        for each in (ours, plain):
            each.destroy()


def test_a_factorisation_short_of_workspace_is_done_with_more():
    """MUMPS with a tenth of its estimate gives up; the answer is the one of ample workspace, of K and of an indefinite matrix."""
    _, scene = run()
    K = scene.problem.body.K
    b = np.random.default_rng(7 + K.comm.rank).normal(size=scene.problem.body.size)
    for shift in (0.0, 0.3 * K.getDiagonal().max()[1]):
        A = K.copy()
        A.shift(-shift)
        ample, short = (
            LinearSolver(A, SYMMETRIC_OPTIONS | {"mat_mumps_icntl_14": percent}, "workspace_", None)
            for percent in (900, -90)
        )
        x, expected = short.solve(b), ample.solve(b)
        assert np.abs(x - expected).max(initial=0.0) <= 1e-10 * np.abs(expected).max(initial=1.0)
        for each in (ample, short):
            each.destroy()


def test_a_singular_matrix_is_no_matter_of_workspace():
    """A zero row makes MUMPS fail for good: solving raises, with PETSc's reason and that of MUMPS."""
    A = PETSc.Mat().createAIJ(((None, 12), (None, 12)), comm=MPI.COMM_WORLD)
    A.setUp()
    first, last = A.getOwnershipRange()
    for row in range(first, last):
        A.setValue(row, row, float(row > 0))
    A.assemble()
    solver = LinearSolver(A, DIRECT_OPTIONS, "singular_", None)
    with pytest.raises(dc.LinearSolverError, match=r"-11.* INFOG\(1\) = -10"):
        solver.solve(np.ones(last - first))
    solver.destroy()


@pytest.mark.parametrize("case", CASES)
def test_one_multigrid_cycle_per_iteration_is_enough(case):
    """Without any inner solve, multigrid and fixed point together reach what a factorisation reaches."""
    reference, _ = run(**CASES[case])
    other, _ = run(petsc_options=MULTIGRID_OPTIONS, solver=dc.FixedPoint(), **CASES[case])
    assert np.abs(other - reference).max() <= 1e-8 * np.abs(reference).max()


def test_same_scene_twice_gives_the_same_bits():
    """On one rank nothing depends on time, memory addresses or a random number."""
    first, _ = run(comm=MPI.COMM_SELF)
    second, _ = run(comm=MPI.COMM_SELF)
    assert np.array_equal(first, second)


def test_reactions_balance_the_applied_force():
    """Total reaction plus support reaction plus weight vanish: equilibrium of the whole body."""
    scene = scenes.block()
    scene.force.value[:] = (0, 0, -50.0)
    scene.move_top(0.001, 0, -0.004)
    scene.problem.solve()
    body = scene.problem.body
    internal = body.internal_force(scene.u.x.array)
    support = np.zeros_like(internal)
    support[body.fixed] = internal[body.fixed]
    total = body.total(support.reshape(-1, 3).sum(axis=0)) + scene.contact.force()
    assert total[:2] == pytest.approx(0.0, abs=1e-8 * scene.contact.force()[2])
    assert total[2] == pytest.approx(50.0 * 0.6, rel=1e-6)
    function = scene.contact.reaction_function()
    summed = body.total(function.x.array[: body.size].reshape(-1, 3).sum(axis=0))
    assert summed == pytest.approx(scene.contact.force(), rel=1e-12)


def test_half_the_way_of_a_step():
    """Of a step that is linear, since all nodes stick, half the way leads to the mean of both ends, with half of what boundary values change."""
    scene = scenes.block(cells=(3, 3, 2), mu=np.inf, p=None, solver=dc.FixedPoint(), tol=1e-12)
    scene.move_top(0, 0, -0.01)
    scene.problem.solve()
    before = scene.u.x.array[: scene.problem.body.size].copy()
    scene.move_top(0.001, 0.0005, -0.008)
    half = half_step(scene.problem.load_step())
    scene.problem.solve()
    mean = 0.5 * (before + scene.u.x.array[: scene.problem.body.size])
    state = half.evaluate(mean, half.error_maps)
    assert half.held(mean) and half.size(state.residual) <= 1e-9 * half.scale(state)
