# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The fixed point with one multigrid cycle per iteration: the same on any number of ranks, however they share."""

import numpy as np
import pytest
import scenes
from mpi4py import MPI
from petsc4py import PETSc

import dolfinx_contact as dc
from dolfinx_contact.compat import partitioner
from dolfinx_contact.petsc import linear_solver
from dolfinx_contact.petsc.linear_solver import MULTIGRID_OPTIONS

pytestmark = pytest.mark.ranks
PRESS = [(0, 0, -0.005), (0.001, 0.0005, -0.01), (0.002, -0.001, -0.006)]
# Cells of the block, and who owns them: flat elements are shared out like tiles, tall stacks by height.
SHARES = {
    "contact on all ranks": ((3, 12, 3), None),
    "contact on one rank": ((2, 2, 24), None),
    "all cells on one rank": ((6, 6, 4), partitioner(lambda cells, size: np.zeros(cells), 8)),
}


def run(comm, cells, owners=None):
    """Reactions and iterations after every step, the scene, and its ranks with cells and contact nodes."""
    scene = scenes.block(
        comm, cells, solver=dc.FixedPoint(), petsc_options=MULTIGRID_OPTIONS,
        partitioner=owners,
    )  # fmt: skip
    reactions, iterations = [], []
    for displacement in PRESS:
        scene.move_top(*displacement)
        step = scene.problem.solve()
        assert max(step.error, step.slip_error) <= scene.problem.tol
        reactions.append(scenes.gathered(scene.contact)[1])
        iterations.append(step.iterations)
    cells = comm.allgather(scene.mesh.topology.index_map(3).size_local)
    nodes = comm.allgather(len(scene.contact.nodes))
    return np.array(reactions), np.array(iterations), np.count_nonzero([cells, nodes], axis=1)


@pytest.mark.parametrize("share", SHARES)
def test_ranks_change_neither_the_answer_nor_the_iterations(share):
    """Reactions are those of one rank alone to 1e-8, iterations within a quarter, whoever owns what."""
    cells, owners = SHARES[share]
    together, counts, having = run(scenes.COMM, cells, owners)
    alone, counts_alone, _ = run(MPI.COMM_SELF, cells)
    size = scenes.COMM.size
    expected = {
        "contact on all ranks": [size, size],
        "contact on one rank": [size, 1],
        "all cells on one rank": [1, 1],
    }
    assert having.tolist() == expected[share]  # ranks with cells, with contact nodes
    assert np.abs(together - alone).max() <= 1e-8 * np.abs(alone).max()
    assert (np.abs(counts - counts_alone) <= np.maximum(0.25 * counts_alone, 1)).all()


def pressed(*displacement, **options):
    """A block after one step, with multigrid."""
    scene = scenes.block(petsc_options=MULTIGRID_OPTIONS, **options)
    scene.move_top(*displacement)
    scene.problem.solve()
    return scene


def test_three_digits_of_the_free_state_are_enough_where_it_presses(monkeypatch):
    """Where contact is certain the elastic solve ends after three digits, and the answer is the same."""
    roughly = pressed(0, 0, -0.005, solver=dc.FixedPoint())
    iterations = roughly.problem.body.ksp.getIterationNumber()
    monkeypatch.setattr(linear_solver, "ROUGH_TOLERANCE", 0.0)
    exactly = pressed(0, 0, -0.005, solver=dc.FixedPoint())
    assert iterations < 0.5 * exactly.problem.body.ksp.getIterationNumber()
    assert not roughly.problem.body.last_free_state.exact
    reactions, expected = (scenes.gathered(scene.contact)[1] for scene in (roughly, exactly))
    assert np.abs(reactions - expected).max() <= 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("height, solver", [(1e-5, None), (-1e-5, None), (-0.005, "condensed")])
def test_all_digits_of_the_free_state_where_they_count(height, solver):
    """Just above and just below the plane, and for the condensed operator, the free state is exact."""
    solver = dc.CondensedNewton() if solver else dc.FixedPoint()
    scene = pressed(0.001, 0, height, solver=solver)
    body = scene.problem.body
    known = body.last_free_state
    assert known.exact
    left = body.norm(known.load - body.multiply(known.displacement))
    assert left <= 1e-10 * body.norm(known.load)
    counts = scene.problem.counts()
    assert (counts.open == sum(counts)) == (height > 0)


def test_an_interrupted_rough_solve_leaves_tolerance_and_start_as_they_were():
    """Ctrl-C during a rough solve from a start: others that use the same KSP solve to all digits from zero."""
    body = pressed(0, 0, -0.005, solver=dc.FixedPoint()).problem.body

    def interrupt(*_):
        raise KeyboardInterrupt

    body.ksp.setMonitor(interrupt)
    # PETSc 3.18 lets what a callback raises through, 3.25 raises an error of its own from it.
    with pytest.raises((KeyboardInterrupt, PETSc.Error)):
        body.solve(body.last_free_state.load, rough=True, start=body.last_free_state.displacement)
    assert body.ksp.getTolerances()[0] == MULTIGRID_OPTIONS["ksp_rtol"]
    assert not body.ksp.getInitialGuessNonzero()


@pytest.mark.parametrize("solver", [dc.FixedPoint, dc.CondensedNewton])
def test_lifted_from_hardly_any_load(solver):
    """The error of an open state is over the last reactions, however small beside what lifts the body off."""
    scene = pressed(0, 0, -0.005, solver=solver())
    for height in (-5e-6, 0.02):
        scene.move_top(0.001, 0, height)
        step = scene.problem.solve()
        assert max(step.error, step.slip_error) <= scene.problem.tol
    assert step.counts.open == sum(step.counts)


def test_monitor_follows_error_and_statuses():
    """The monitor sees every residual, on all ranks alike; its last line is what the step says."""
    scene = scenes.block(solver=dc.FixedPoint(), petsc_options=MULTIGRID_OPTIONS)
    seen = []
    scene.problem.monitor = lambda *line: seen.append(line)
    scene.move_top(0, 0, -0.005)
    step = scene.problem.solve()
    assert [line[0] for line in seen] == list(range(len(seen)))
    assert len(seen) > step.iterations
    assert seen[-1][1] == max(step.error, step.slip_error) and seen[-1][2] == step.counts
    assert len(set(map(str, scenes.COMM.allgather(seen)))) == 1


def test_options_of_the_command_line_go_before_ours():
    """What a user puts into PETSc's database under the prefix is not overwritten, and stays there."""
    database = PETSc.Options("mine_")
    database["ksp_rtol"] = 1e-3
    try:
        scene = scenes.block(petsc_options=MULTIGRID_OPTIONS, petsc_options_prefix="mine_")
        scene.problem.body.refresh()
        assert scene.problem.body.ksp.getTolerances()[0] == 1e-3
        assert database.hasName("ksp_rtol") and not database.hasName("pc_type")
    finally:
        del database["ksp_rtol"]


@pytest.mark.skipif(scenes.COMM.size > 1, reason="ranks add in the order in which messages arrive")
def test_checkpoint_continues_to_the_same_bits(tmp_path):
    """Fixed point, multigrid and tangent start every step from checkpointed arrays only."""

    def scene():
        return scenes.block(
            cells=(8, 8, 4), solver=dc.FixedPoint(), petsc_options=MULTIGRID_OPTIONS
        )

    programme = [(0, 0, -0.01), (0, 0, -0.0092), (0.0005, 0.0002, -0.0085), (0, 0, -0.008)]
    whole, part = scene(), scene()
    for displacement in programme:
        whole.move_top(*displacement)
        whole.problem.solve()
    for displacement in programme[:2]:
        part.move_top(*displacement)
        part.problem.solve()
    part.problem.save(tmp_path / "checkpoint.npz")
    resumed = scene()
    resumed.problem.load(tmp_path / "checkpoint.npz")
    for displacement in programme[2:]:
        resumed.move_top(*displacement)
        assert resumed.problem.solve().iterations > 0
    assert np.array_equal(whole.u.x.array, resumed.u.x.array)
    assert np.array_equal(whole.contact.reaction, resumed.contact.reaction)


def test_a_step_that_stalls_is_refused_with_its_reason():
    """Tall elements under a strongly crossed slip rule, reversed: refused with few iterations for an attempt, and said why and what was tried."""
    scene = scenes.block(
        cells=(16, 16, 2), mu=(0.3, 0.03), p=(1e-3, 1.0), petsc_options=MULTIGRID_OPTIONS,
        solver=dc.FixedPoint(max_iterations=40), tol=1e-8,
    )  # fmt: skip
    scene.move_top(0.001, 0.0005, -0.01)
    assert scene.problem.solve().error <= 1e-8
    scene.move_top(-0.001, 0.0005, -0.01)
    with pytest.raises(dc.NotConverged) as refused:
        scene.problem.solve()
    assert 400 < refused.value.step.iterations <= 3 * 8 * 40
    assert refused.match("the law is not met at .* have changed their status in the last 50")
    assert refused.match("elements at the surface are 4.8 times as high as wide")
    assert refused.match(
        r"rho 1 \(0\), from the start \(40\), half the way \(120\), nodes put back \(160\)"
    )


def test_a_body_that_is_hard_for_its_preconditioner_is_named():
    """Iterations preconditioned by Jacobi, as bad as multigrid on a graded mesh: the refusal counts those of the body alone, and advises factors."""
    options = dict(ksp_type="cg", pc_type="jacobi", ksp_rtol=1e-10)
    solver = dc.FixedPoint(max_iterations=15)
    scene = scenes.block(cells=(12, 12, 6), solver=solver, petsc_options=options)
    scene.move_top(0.001, 0.0005, -0.01)
    with pytest.raises(
        dc.NotConverged, match=r"the body takes \d\d+ iterations .*'mumps'"
    ) as refused:
        scene.problem.solve()
    assert refused.value.step.iterations <= 120
