# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What a run leaves behind: dissipation, worn depth, tables, checkpoints."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scenes

import dolfinx_contact as dc
from dolfinx_contact.compat import partitioner

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
PROGRAMME = [(0, 0, -0.005), (0.001, 0.0005, -0.01), (0.002, -0.001, -0.006), (0.003, 0, -0.004)]


def shared(path):
    """The same path on all ranks: that of rank 0."""
    return COMM.bcast(path, root=0)


def drag(scene, strokes):
    """Press the block, then displace the plane along x under it; the strokes are absolute."""
    scene.move_top(0, 0, -0.001)
    scene.problem.solve()
    for stroke in strokes:
        scene.surface.displacement = (stroke, 0, 0)
        scene.problem.solve()


def test_dissipation_of_a_dragged_block_is_force_times_path():
    """Once the block slides, work of friction is mu N times the stroke; slip is the stroke."""
    scene = scenes.block(mu=0.3, p=None)
    drag(scene, [1.0, 3.0, 5.0])  # the elastic body follows within the first strokes
    c = scene.contact
    before, path = COMM.allreduce(c.dissipation.sum()), c.slip_path.copy()
    scene.surface.displacement = (7.0, 0, 0)
    scene.problem.solve()
    work = COMM.allreduce(c.dissipation.sum()) - before
    assert work == pytest.approx(0.3 * c.force()[2] * 2.0, rel=1e-9)
    assert c.slip_path - path == pytest.approx(2.0, rel=1e-9)


def test_no_friction_no_dissipation():
    """Frictionless contact dissipates nothing, whatever slips."""
    scene = scenes.block(mu=0.0, p=None)
    drag(scene, [0.1])
    assert (scene.contact.dissipation == 0).all()
    assert (scene.contact.slip_path > 0).all()


def test_work_of_a_proportional_load_is_exact():
    """Where forces grow with the load and slips point where they did, one increment is enough."""
    work = []
    for increments in (1, 2, 4):
        scene = scenes.block(mu=(0.3, 0.15), p=None)
        for k in range(increments):
            scene.move_top(0, 0, -0.01 * (k + 1) / increments)
            scene.problem.solve()
        work.append(COMM.allreduce(scene.contact.dissipation.sum()))
    assert work[0] > 0
    assert work[1:] == pytest.approx(work[:1] * 2, rel=1e-7)


def test_nodal_areas_fill_the_surface():
    """Areas of the contact nodes sum to the surface; pressures times areas to the force."""
    for scene, surface in (
        (scenes.block(), 1.0),
        (scenes.block(cells=(5, 2), mu=0.2, p=None), 1.0),
    ):
        c = scene.contact
        assert COMM.allreduce(c.area.sum()) == pytest.approx(surface, rel=1e-12)
        assert (c.area > 0).all()
        scene.move_top(*[0] * (len(c.frame) - 1), -0.01)
        scene.problem.solve()
        assert COMM.allreduce((c.pressure * c.area).sum()) == pytest.approx(
            c.force()[-1], rel=1e-12
        )
        function = c.function(c.pressure, "pressure")
        x = function.function_space.tabulate_dof_coordinates()
        for position, pressure in zip(c.x, c.pressure):
            node = np.argmin(np.linalg.norm(x - position, axis=1))
            assert function.x.array[node] == pressure


@pytest.mark.parametrize("coefficient", [1e-6, (2e-6, 1e-7)])
def test_worn_depth_opens_the_gap_and_conserves_volume(coefficient):
    """Volume worn is coefficient times work, in each direction; the gap of the next step has it."""
    scene = scenes.block(mu=0.3, p=None, wear=dc.Wear(coefficient, explicit=True))
    c = scene.contact
    drag(scene, [0.5])
    volume = COMM.allreduce(c.wear_depth @ c.area)
    k = np.broadcast_to(coefficient, 2)
    if k[0] == k[1]:
        assert volume == pytest.approx(k[0] * COMM.allreduce(c.dissipation.sum()), rel=1e-12)
    assert volume > 0
    force = c.force()[2]
    depth, gap0 = c.wear_depth.copy(), c.x[:, 2]
    scene.surface.displacement = (1.0, 0, 0)
    scene.problem.solve()
    assert c.force()[2] < force  # the same approach presses less on a worn surface
    assert c.gap == pytest.approx(gap0 + depth + c.displacement[:, 2], abs=1e-15)


def test_worn_volume_is_coefficient_times_work_per_direction():
    """The sum of depth times area is the sum over both directions, whatever the areas."""
    rng = np.random.default_rng(7)
    work, area = rng.random((20, 2)), 0.1 + rng.random(20)
    volume = dc.Wear((2e-4, 1e-5)).depth(work, area) @ area
    assert volume == pytest.approx(2e-4 * work[:, 0].sum() + 1e-5 * work[:, 1].sum(), rel=1e-12)


def test_without_wear_nothing_is_computed_for_it(monkeypatch):
    """Without wear a step assembles no nodal areas, and no depth is worn."""

    def area(contact):
        raise AssertionError("areas are needed for wear only")

    monkeypatch.setattr(dc.Contact, "area", property(area))
    scene = scenes.block(mu=0.3, p=None)
    drag(scene, [0.5])
    assert not scene.contact.wear_depth.any()


def test_wear_of_a_dragged_block_follows_archard():
    """With Archard's K and hardness H: volume = K N s / H for a normal force N and a sliding path s."""
    K, H, mu = 1e-6, 1e3, 0.3
    scene = scenes.block(mu=mu, p=None, wear=dc.Wear(K / (mu * H)))
    drag(scene, [1.0])
    c = scene.contact
    before, normal = COMM.allreduce(c.wear_depth @ c.area), c.force()[2]
    scene.surface.displacement = (2.0, 0, 0)
    scene.problem.solve()
    normal = 0.5 * (normal + c.force()[2])
    volume = COMM.allreduce(c.wear_depth @ c.area) - before
    assert volume == pytest.approx(K * normal * 1.0 / H, rel=1e-5)


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf, "much", (1, 2, 3), 1j, True])
def test_wear_refuses(bad):
    """A wear coefficient is one or two finite numbers >= 0."""
    with pytest.raises(ValueError, match="wear coefficient"):
        dc.Wear(bad)
    if bad is True:
        with pytest.raises(ValueError, match="wear must be a Wear"):
            scenes.block(wear=1e-4)


def test_history_is_a_table_of_the_run(tmp_path):
    """Rows have the totals of contact and step, and follow the node nearest to a point."""
    scene = scenes.block()
    path = shared(tmp_path) / "run.csv"
    history = dc.History(scene.problem, path, points=[(0.3, 0.2, 0.0)])
    for displacement in PROGRAMME:
        scene.move_top(*displacement)
        row = history.record(scene.problem.solve(), depth=-displacement[2])
    assert history.positions == pytest.approx(np.array([[0.25, 0.25, 0.0]]))
    assert history.column("step").tolist() == [1, 2, 3, 4]
    assert history.column("depth").tolist() == [0.005, 0.01, 0.006, 0.004]
    assert row["contact0_force_z"] == scene.contact.force()[2]
    assert row["contact0_tangential_reaction_sum"] == pytest.approx(scenes.totals(scene.contact)[1])
    assert row["open"] + row["stick"] + row["slip"] == 25
    x = np.concatenate(COMM.allgather(scene.contact.x))
    r = np.concatenate(COMM.allgather(scene.contact.reaction))
    node = np.argmin(np.linalg.norm(x - history.positions[0], axis=1))
    assert [row[f"node0_reaction_{d}"] for d in ("t1", "t2", "n")] == r[node].tolist()
    COMM.barrier()
    again = dc.History(scene.problem, path, points=[(0.3, 0.2, 0.0)], resume=3)
    assert again.rows == history.rows[:3]
    with pytest.raises(
        ValueError, match="no column 'dissipation'; there are .*contact0_dissipation"
    ):
        history.column("dissipation")
    with pytest.raises(ValueError, match="cannot resume"):
        dc.History(scene.problem, path, resume=9)
    with pytest.raises(ValueError, match="points must have shape"):
        dc.History(scene.problem, points=[(0.0, 0.0)])


@pytest.mark.parametrize("name, message", [("none/run.csv", "no folder .*none for run.csv"), ("none/a/run.csv", "no folder"), (".", "is a folder")])  # fmt: skip
def test_a_table_without_a_folder_is_refused_before_the_run(tmp_path, name, message):
    """A path that rank 0 cannot write to is a ValueError of all ranks when the table is made, not of its first row."""
    scene = scenes.block(cells=(2, 2, 1))
    with pytest.raises(ValueError, match=message):
        dc.History(scene.problem, shared(tmp_path) / name)


def test_checkpoint_continues_the_run(tmp_path):
    """A problem that takes up a checkpoint gets the results of one that was never interrupted."""
    path = shared(tmp_path) / "state.npz"
    straight, resumed = (scenes.block(wear=dc.Wear(1e-4)) for _ in range(2))
    for k, displacement in enumerate(PROGRAMME):
        straight.move_top(*displacement)
        straight.problem.solve()
        if k == 1:
            straight.problem.save(path)
    resumed.problem.load(path)
    for displacement in PROGRAMME[2:]:
        resumed.move_top(*displacement)
        resumed.problem.solve()
    for name in ("reaction", "slip_increment", "dissipation", "wear_depth", "slip_path"):
        here, there = (getattr(s.contact, name) for s in (straight, resumed))
        if COMM.size == 1:
            assert np.array_equal(here, there), name
        else:
            assert here == pytest.approx(there, rel=1e-8, abs=1e-8 * np.abs(here).max(initial=0))


@pytest.mark.parametrize("solver", [dc.FixedPoint(), dc.CondensedNewton()])
def test_checkpoint_is_taken_up_however_the_mesh_is_shared(tmp_path, solver):
    """Written by all ranks, read by one alone or by all with all cells on one: the same steps follow."""
    path = shared(tmp_path) / "state.npz"
    last = COMM.size - 1
    straight, alone, elsewhere = scenes_alike = [
        scenes.block(comm=comm, partitioner=owners, solver=solver, wear=dc.Wear(1e-4))
        for comm, owners in (
            (COMM, None),
            (scenes.MPI.COMM_SELF, None),
            (COMM, partitioner(lambda cells, size: np.full(cells, last), 8)),
        )
    ]
    for k, displacement in enumerate(PROGRAMME):
        for scene in scenes_alike if k > 1 else [straight]:
            scene.move_top(*displacement)
            scene.problem.solve()
        if k == 1:
            straight.problem.save(path)
            COMM.barrier()
            alone.problem.load(path)
            elsewhere.problem.load(path)
    for name in ("reaction", "slip_increment", "dissipation", "wear_depth", "slip_path"):
        expected = scenes.by_position(straight, name)
        for scene in (alone, elsewhere):
            size = np.abs(expected).max()
            assert scenes.by_position(scene, name) == pytest.approx(
                expected, rel=0, abs=1e-7 * size
            ), name


def test_checkpoints_of_other_problems_are_refused(tmp_path):
    """Another mesh, or a file that is none, is a ValueError on all ranks."""
    path = shared(tmp_path) / "state.npz"
    scenes.block(cells=(2, 2, 2)).problem.save(path)
    scene = scenes.block()
    with pytest.raises(ValueError, match="checkpoint"):
        scene.problem.load(path)
    if COMM.rank == 0:
        np.savez(path, ranks=COMM.size + 1)
    COMM.barrier()
    with pytest.raises(ValueError, match="no checkpoint"):
        scene.problem.load(path)
    with pytest.raises(FileNotFoundError):
        scene.problem.load(shared(tmp_path) / "nothing.npz")


KILLED = """
import sys, os, signal
import dolfinx_contact
import scenes, numpy as np
from pathlib import Path
state = Path({state!r})
scene = scenes.block(comm=scenes.MPI.COMM_SELF)
done = 0
if state.exists():
    scene.problem.load(state)
    done = int(Path({count!r}).read_text())
for k, displacement in enumerate({programme!r}):
    if k < done:
        continue
    scene.move_top(*displacement)
    scene.problem.solve()
    scene.problem.save(state)
    Path({count!r}).write_text(str(k + 1))
    if k == int(sys.argv[1]):
        os.kill(os.getpid(), signal.SIGKILL)
np.save({result!r}, scene.contact.reaction)
"""


@pytest.mark.slow
@pytest.mark.skipif(COMM.size > 1, reason="starts processes of its own")
def test_killed_run_continues_to_the_same_bits(tmp_path):
    """A process that is killed after a step, started again, ends with the bits of one never killed."""
    # Started under mpiexec, a child must not take itself for a rank of this run.
    launchers = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "HYDI_", "MPIR_", "MPICH_")
    alone = {k: v for k, v in os.environ.items() if not k.startswith(launchers)}
    root = Path(__file__).parents[2]
    path = (
        root / "tests/support",
        root,
        alone.get("PYTHONPATH", ""),
    )  # of scenes, and of what they are made of
    alone["PYTHONPATH"] = os.pathsep.join(map(str, path))
    results = []
    for name, kills in (("straight", [-1]), ("killed", [0, 2, -1])):
        folder = tmp_path / name
        folder.mkdir()
        script = folder / "run.py"
        script.write_text(
            KILLED.format(
                state=str(folder / "state.npz"),
                count=str(folder / "count"),
                result=str(folder / "result.npy"),
                programme=PROGRAMME,
            )
        )
        for kill in kills:
            done = subprocess.run(
                [sys.executable, script, str(kill)], capture_output=True, env=alone, timeout=100
            )
            assert done.returncode == (0 if kill == -1 else -9), done.stderr.decode()
        results.append(np.load(folder / "result.npy"))
    assert np.array_equal(*results)


@pytest.mark.parametrize("solver", [None, dc.FixedPoint()], ids=["default", "fixed point"])
@pytest.mark.parametrize("driven", [False, True], ids=["displacement", "force"])
def test_nothing_slips_while_nothing_moves(driven, solver):
    """A step without any change calls sticking what touches and works nothing; a millionth of the way slips again."""
    scene = scenes.block(cells=(3, 3, 2), mu=(0.3, 0.3), p=None, solver=solver)
    plane, contact = scene.surface, scene.contact
    if driven:
        plane.free, plane.force = ("n",), (0.0, 0.0, 100.0)
    else:
        scene.move_top(0.0, 0.0, -1e-3)
    steps, work = [], []
    for way in (5e-3, 6e-3, 6e-3, 6e-3, 6e-3 + 1e-8):
        plane.displacement = (way, 0.0, plane.displacement[2])
        steps.append(scene.problem.solve().counts)
        work.append(COMM.allreduce(contact.dissipation.sum()))
    assert steps[1].slip == steps[4].slip > 0 == steps[1].open
    assert steps[2] == steps[3] == (0, sum(steps[1]), 0)
    assert work[3] == pytest.approx(work[1], rel=1e-8)
    assert work[4] > work[3]
