# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Clusters, pools and long runs: nothing hangs, leaks or goes on in different directions on different ranks.

A test that hangs here means that one rank raised and another waits for it.
"""

import gc
import logging
import multiprocessing

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh

import dolfinx_contact as dc

COMM = scenes.COMM
LAST = COMM.rank == COMM.size - 1
SEVERAL = pytest.mark.skipif(COMM.size == 1, reason="needs more than one rank")


def pressed(**options):
    scene = scenes.block(cells=(2, 2, 2), **options)
    scene.move_top(0.001, 0.0, -0.01)
    scene.problem.solve()
    return scene


def fails(_):
    """What a worker that finds no solution raises."""
    result = dc.solve_condensed(np.eye(3), np.array([[0.1, 0.0, -1.0]]), dc.Friction(0.3))
    raise dc.CondensedNotConverged(result)


@pytest.mark.slow
@pytest.mark.skipif(COMM.size > 1, reason="starts processes of its own")
def test_a_pool_of_processes_gets_the_failure():
    """What a worker raises arrives, instead of leaving the pool waiting for ever."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        with pytest.raises(dc.CondensedNotConverged, match="not converged") as caught:
            pool.map_async(fails, [0]).get(timeout=60)
    assert caught.value.best.reaction.shape == (1, 3)


def memory() -> float:
    """Resident memory, MB."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


@pytest.mark.slow
@pytest.mark.parametrize("solver", [dc.CondensedNewton(), dc.FixedPoint()])
@pytest.mark.parametrize("end", ["dropped", "closed"])
def test_problems_leave_nothing_behind(end, solver):
    """Problems of 735 unknowns, closed or just dropped, two hundred on one rank, take no more memory than one: 50 MB for
    a thousand."""
    scene = scenes.block(cells=(6, 6, 4), solver=solver)
    assert scene.V.dofmap.index_map.size_global * 3 == 735
    scene.move_top(0.001, 0.0, -0.01)

    def once():
        scene.contact.reset()  # its history is that of the problem before
        problem = dc.ContactProblem(scene.F, scene.u, scene.contact, bcs=scene.bcs, solver=solver)
        problem.solve()
        if end == "closed":
            problem.close()

    for _ in range(10):
        once()
    gc.collect()
    before, count = memory(), 200 if COMM.size == 1 else 40
    for _ in range(count):
        once()
    assert memory() - before < 0.05 * count


@pytest.mark.slow
def test_meshes_leave_nothing_behind():
    """A run that makes a mesh for each problem and closes it, as the class asks for on several ranks, does not grow."""

    def once():
        scene = scenes.block(cells=(2, 2, 2))
        scene.move_top(0.001, 0.0, -0.01)
        with scene.problem:
            scene.problem.solve()

    for _ in range(10):
        once()
    gc.collect()
    before = memory()
    for _ in range(40):
        once()
    gc.collect()
    assert (
        memory() - before < 8.0
    )  # 20 MB that PETSc and DOLFINx were seen to keep of a hundred meshes


@pytest.mark.slow
def test_changed_moduli_leave_nothing_behind():
    """A modulus that changes in every step takes no more memory than one that stays."""
    scene = scenes.block(cells=(6, 6, 4))
    scene.move_top(0.001, 0.0, -0.01)
    for k in range(210):
        scene.modulus.value = 210e3 * (1 + 1e-4 * k)
        scene.problem.solve()
        if k == 10:
            gc.collect()
            before = memory()
    assert memory() - before < 10.0


def test_a_closed_problem_says_so():
    """After close, or with, results stay and nothing can be solved; closing twice is closing."""
    scene = pressed()
    reaction = scene.contact.reaction
    with scene.problem as problem:
        assert problem is scene.problem
    scene.problem.close()
    assert scene.contact.reaction is reaction
    for verb in (scene.problem.solve, scene.problem.reset, lambda: scene.problem.save("x.npz")):
        with pytest.raises(ValueError, match="has been closed"):
            verb()


def test_a_table_that_cannot_be_written_is_an_error_on_all_ranks(tmp_path):
    """A folder that is gone, on the rank that writes, raises on all; the row is kept and written later."""
    scene, folder = pressed(), COMM.bcast(tmp_path, root=0) / "later"
    if COMM.rank == 0:
        folder.mkdir()
    history = dc.History(scene.problem, folder / "run.csv")
    step = scene.problem.solve()
    if COMM.rank == 0:
        folder.rmdir()
    with pytest.raises(FileNotFoundError):
        history.record(step)
    COMM.barrier()
    if COMM.rank == 0:
        folder.mkdir()
    history.record(step)
    COMM.barrier()
    assert dc.History(scene.problem, folder / "run.csv", resume=2).rows == history.rows
    with pytest.raises(ValueError, match="columns are not those of the first row.*'load'"):
        history.record(step, load=1.0)
    assert len(history.rows) == 2


@pytest.mark.parametrize(
    "content", ["step,a\n1\n2,3,4\n", "step,a\n7,1\n", "\xff\x00", "", "a,b\n1,2\n"]
)
def test_a_broken_table_is_not_resumed(tmp_path, content):
    """Rows that are torn, or not those of the steps, are refused on all ranks."""
    scene, path = pressed(), COMM.bcast(tmp_path, root=0) / "run.csv"
    if COMM.rank == 0:
        path.write_bytes(content.encode("latin-1"))
    COMM.barrier()
    with pytest.raises(ValueError, match="cannot resume"):
        dc.History(scene.problem, path, resume=1)
    COMM.barrier()
    if COMM.rank == 0:
        assert path.read_bytes() == content.encode("latin-1")  # left as it is


@pytest.mark.parametrize("arguments, message", [({"contact": 1}, "contact 1: the problem has 1"), ({"resume": 1.5}, "resume must be"), ({"resume": -1}, "resume must be")])  # fmt: skip
def test_tables_refuse(arguments, message):
    """Contacts and rows that are not there are named."""
    with pytest.raises(ValueError, match=message):
        dc.History(pressed().problem, **arguments)


class Odd(Exception):
    """An error that cannot be made from a message, as other packages have them."""

    def __init__(self, one, two):
        super().__init__(one, two)


@pytest.mark.parametrize("kind", [RuntimeError, Odd])
@pytest.mark.parametrize("solver", [dc.CondensedNewton(), dc.FixedPoint()])
def test_a_monitor_that_raises_on_one_rank_ends_the_step_on_all(kind, solver):
    """Its error is that of the step, and the last converged state is in place."""
    scene = pressed(solver=solver)
    u = scene.u.x.array.copy()

    def monitor(*_):
        if LAST:
            raise kind("no", "more") if kind is Odd else kind("no more")

    scene.problem.monitor = monitor
    scene.move_top(0.002, 0.0, -0.02)
    with pytest.raises((kind, RuntimeError), match="no"):
        scene.problem.solve()
    assert np.array_equal(scene.u.x.array, u)
    scene.problem.monitor = None
    scene.problem.solve()


@SEVERAL
@pytest.mark.parametrize(
    "what", ["tol", "solver", "max_seconds", "contacts", "petsc_options", "monitor", "bcs"]
)
def test_arguments_that_differ_between_ranks_are_refused(what):
    """What must be the same on all ranks is compared before it leads them apart."""
    scene = scenes.block(cells=(2, 2, 2))
    changes = {
        "tol": {"tol": 1e-7},
        "solver": {"solver": dc.FixedPoint()},
        "max_seconds": {"solver": dc.CondensedNewton(max_seconds=10.0)},
        "contacts": {"contacts": []},
        "petsc_options": {"petsc_options": {"pc_type": "lu"}},
        "bcs": {"bcs": []},
        "monitor": {},
    }[what]
    base = {
        "contacts": [scene.contact],
        "bcs": scene.bcs,
        "solver": dc.CondensedNewton(),
        "tol": 1e-8,
    }
    with pytest.raises(ValueError, match="differs between ranks"):
        problem = dc.ContactProblem(scene.F, scene.u, **base | (changes if LAST else {}))
        problem.monitor = print if LAST else None
        problem.solve()


@SEVERAL
@pytest.mark.parametrize("what", ["tol", "solver", "load", "modulus"])
def test_what_differs_between_ranks_from_a_step_on_is_refused(what):
    """So is what is changed between steps on one rank; put right, the run goes on."""
    scene = pressed(solver=dc.FixedPoint())
    old = scene.problem.tol, scene.problem.solver
    if LAST:
        if what == "tol":
            scene.problem.tol = 1e-7
        elif what == "solver":
            scene.problem.solver = dc.FixedPoint(max_seconds=10.0)
        elif what == "load":
            scene.force.value[2] = -1.0
        else:
            scene.modulus.value = 200e3
    with pytest.raises(ValueError, match="differs between ranks"):
        scene.problem.solve()
    scene.problem.tol, scene.problem.solver = old
    scene.force.value[2], scene.modulus.value = 0.0, 210e3
    scene.problem.solve()


@SEVERAL
@pytest.mark.parametrize("kind", [np.array, "constant"])
def test_boundary_values_that_differ_between_ranks_are_refused(kind):
    """A constant that a condition holds is compared as those of F are, also when it is changed between steps."""
    scene = scenes.block(cells=(2, 2, 2))
    top = mesh.locate_entities_boundary(scene.mesh, 2, lambda x: np.isclose(x[2], 0.6))
    value = np.array([0.0, 0.0, -0.01]) - (kind != "constant") * 1e-3 * LAST
    value = fem.Constant(scene.mesh, value) if kind == "constant" else value
    held = fem.dirichletbc(value, fem.locate_dofs_topological(scene.V, 2, top), scene.V)
    problem = dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=[held])
    if kind == "constant":
        problem.solve()
        value.value[0] = 1e-3 * LAST
    with pytest.raises(ValueError, match="boundary condition differs between ranks"):
        problem.solve()
    if kind == "constant":
        value.value[0] = 1e-3
        problem.solve()


@SEVERAL
def test_of_functions_the_owners_values_count():
    """Ghosts that were not brought up to date, of boundary values, loads and moduli, change nothing."""
    found = []
    for stale in (False, True):
        scene = scenes.block(cells=(3, 3, 2))
        load = fem.Function(scene.V)
        load.x.array[:] = np.tile((100.0, 0.0, 0.0), load.x.array.size // 3)
        F = scene.F - ufl.inner(load, ufl.TestFunction(scene.V)) * ufl.dx
        scene.problem = dc.ContactProblem(F, scene.u, [scene.contact], bcs=scene.bcs, tol=1e-10)
        scene.move_top(0.001, 0.0, -0.01)
        if stale:
            owned = scene.problem.body.size
            load.x.array[owned:] = scene.held.x.array[owned:] = 1e3 * (1 + COMM.rank)
        scene.problem.solve()
        found.append(scenes.gathered(scene.contact)[1])
    assert np.allclose(*found, atol=1e-9 * np.abs(found[0]).max())


@pytest.mark.parametrize("solver", [None, dc.CondensedNewton(), dc.FixedPoint()])
def test_every_solver_calls_the_monitor(solver):
    """With the errors of the states it judges, the last of which is that of the record."""
    scene, seen = scenes.block(cells=(2, 2, 2), solver=solver), []
    scene.problem.monitor = lambda *line: seen.append(line)
    scene.move_top(0.001, 0.0, -0.01)
    step = scene.problem.solve()
    assert [line[0] for line in seen] == sorted({line[0] for line in seen})
    assert min(line[1] for line in seen) <= scene.problem.tol
    assert seen[-1][2] == step.counts
    assert step.iterations > 0


def test_a_step_is_a_line_of_the_log(caplog):
    """Standard logging has one line a step on rank 0, with what failed, too; nothing without being asked."""
    scene = scenes.block(cells=(2, 2, 2))
    with caplog.at_level(logging.INFO, logger="dolfinx_contact"):
        for top in ((0, 0, -0.005), (0.001, 0, -0.01)):
            scene.move_top(*top)
            scene.problem.solve()
        scene.problem.solver = dc.FixedPoint(max_iterations=1)
        scene.move_top(0.003, 0, -0.02)
        with pytest.raises(dc.NotConverged):
            scene.problem.solve()
    lines = [record.getMessage() for record in caplog.records if record.name == "dolfinx_contact"]
    assert len(lines) == (3 if COMM.rank == 0 else 0)
    if COMM.rank == 0:
        assert lines[0].startswith("step solved: error") and "CondensedNewton" in lines[0]
        assert lines[2].startswith("step failed: NotConverged: not converged")


def test_reprs_have_sizes_and_settings():
    """What is printed in an interactive session says what it is."""
    scene = scenes.block(cells=(2, 2, 2), solver=dc.CondensedNewton(max_seconds=5.0))
    assert "81 unknowns" in repr(scene.problem) and "max_seconds=5.0" in repr(scene.problem)
    nodes = len(scene.contact.nodes)
    assert f"{nodes} nodes" in repr(scene.contact) and "Friction(mu=(0.3, 0.15)" in repr(
        scene.contact
    )
    assert repr(dc.FixedPoint(depth=3)).startswith("FixedPoint(map='return', rho=None, depth=3")


def warned(make, message):
    """What ``make`` returns, after one warning that says this."""
    with pytest.warns(UserWarning, match=message) as said:
        made = make()
    assert len(said) == 1
    return made


def test_a_normal_that_faces_the_wrong_way_is_warned_of():
    """Seen from a plane turned over the whole body lies below it: said once, when the problem is made."""
    scene = scenes.block(cells=(2, 2, 2))
    for point, message in (((0, 0, 0), "turn the normal"), ((0, 0, 0.3), "starts .* deep inside")):
        normal = (0, 0, -1) if point == (0, 0, 0) else (0, 0, 1)
        plane = dc.RigidPlane(point, normal, (1, 0, 0))
        contact = dc.Contact(scene.V, scene.facets, plane, dc.Friction(0.3))
        warned(lambda: dc.ContactProblem(scene.F, scene.u, contact, bcs=scene.bcs), message)  # noqa: B023


def test_a_displacement_far_larger_than_the_body_is_warned_of():
    """Units that do not fit together show in the first step, and are named once."""
    scene = scenes.block(cells=(2, 2, 2))
    scene.move_top(0, 0, 100.0)
    warned(scene.problem.solve, "times the size of the body, 1: check the units")
    scene.move_top(0, 0, 101.0)
    scene.problem.solve()


def test_misspelt_petsc_options_are_warned_of():
    """An option that PETSc never reads is named once; those that it reads are not."""
    options = {"ksp_type": "cg", "ksp_rtol": 1e-12, "pc_type": "jacobi", "ksp_max_itt": 3}
    scene = scenes.block(cells=(2, 2, 2), petsc_options=options, solver=dc.FixedPoint())
    scene.move_top(0, 0, -0.01)
    warned(scene.problem.solve, r"petsc_options \['ksp_max_itt'\] were not read")
    scene.modulus.value = 200e3
    scene.problem.solve()
