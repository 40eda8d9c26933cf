# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Files of checkpoints: what is broken, cut or made by hand is refused, and the state stays what it was."""

import os

import numpy as np
import pytest
import scenes

import dolfinx_contact as dc

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
# A file may lack the first ones; the others have no row for each node.
OPTIONAL = ("digest", "load", "free", "rough", "starts", "contact0_law_of_last_step")
OF_NO_NODE = ("ranks", "digest", "starts", "stiffness", "version", "starts_tied", "contact0_law_of_last_step")  # fmt: skip


@pytest.fixture(scope="module")
def scene():
    scene = scenes.block(cells=(2, 2, 1), wear=dc.Wear(1e-6), tol=1e-8)
    for x in (0.0, 0.01):
        scene.move_top(x, 0, -0.01)
        scene.problem.solve()
    return scene


@pytest.fixture
def saved(scene, tmp_path):
    """Name of a checkpoint, and what is in it."""
    path = COMM.bcast(tmp_path, root=0) / "state.npz"
    scene.problem.save(path)
    COMM.barrier()
    with np.load(path) as file:
        return path, dict(file)


def rewritten(path, file):
    COMM.barrier()
    if COMM.rank == 0:
        np.savez(path, **file)
    COMM.barrier()


@pytest.mark.parametrize("harm", ["NaN", "cut", "missing", "complex", "more", "text"])
def test_every_array_is_checked(harm, scene, saved):
    """Whichever array has NaN, lacks its last row, is not there, is complex, text, or has an axis more: a ValueError on all
    ranks that names it, before anything has changed."""
    path, file = saved
    reaction, u = scene.contact.reaction, scene.u.x.array.copy()
    harmed = 0
    for name, array in file.items():
        other = {
            "NaN": lambda a: np.where(np.arange(a.size).reshape(a.shape) == 0, np.nan, a),
            "cut": lambda a: a[:-1] if a.ndim else None,
            "missing": lambda a: None,
            "complex": lambda a: a + 1j,
            "more": lambda a: a[..., None],
            "text": lambda a: a.astype("U30"),
        }[harm](array)  # fmt: skip
        if (
            name == "digest"
            or harm == "NaN"
            and (array.dtype.kind != "f" or name.endswith("rigid_plane"))
        ):
            continue
        if harm == "missing" and name in OPTIONAL or other is None and harm != "missing":
            continue
        if harm in ("cut", "more") and name in OF_NO_NODE:
            continue
        rewritten(path, {k: v for k, v in (file | {name: other}).items() if v is not None})
        with pytest.raises(ValueError, match="checkpoint"):
            scene.problem.load(path)
        harmed += 1
        assert scene.contact.reaction is reaction and np.array_equal(scene.u.x.array, u)
    assert harmed >= 8
    rewritten(path, file)
    scene.problem.load(path)
    assert np.array_equal(scene.contact.reaction, reaction)


def test_values_that_no_step_leaves_are_refused(scene, saved):
    """A status that is none, work below zero, and starts for the solver that fit no node."""
    path, file = saved
    for name, wrong in (("contact0_status", 7), ("contact0_dissipation", -1.0)):
        rewritten(path, file | {name: np.full_like(file[name], wrong)})
        with pytest.raises(ValueError, match="no step leaves"):
            scene.problem.load(path)
    if "starts" in file:
        for starts in (file["starts"][:, :1], file["starts"][..., :-1]):
            rewritten(path, file | {"starts": starts})
            with pytest.raises(ValueError, match="starts and starts_nodes"):
                scene.problem.load(path)


@pytest.mark.parametrize("version", [None, 2, 99, -5])
def test_files_of_other_versions_are_refused(version, scene, saved):
    """In one line, which says what to do."""
    path, file = saved
    del file["version"]
    rewritten(path, file if version is None else file | {"version": np.array(version)})
    with pytest.raises(ValueError, match="another version of dolfinx_contact: read it with that"):
        scene.problem.load(path)


def test_any_broken_byte_is_found(scene, saved):
    """A file with one byte changed is refused, or has what it had: archives know the sums of what is in them."""
    path, _ = saved
    whole, random = path.read_bytes(), np.random.default_rng(0)
    reaction = scene.contact.reaction
    for at in (*range(0, 200, 14), *random.integers(len(whole), size=30)):
        COMM.barrier()
        if COMM.rank == 0:
            path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        COMM.barrier()
        try:
            scene.problem.load(path)
        except ValueError as error:
            assert "checkpoint" in str(error)
        assert np.array_equal(scene.contact.reaction, reaction)


@pytest.mark.parametrize("at", ["savez", "fsync", "replace"])
@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
def test_a_save_that_fails_leaves_the_old_file(at, error, scene, saved, monkeypatch):
    """Wherever writing stops, the last checkpoint is whole, and nothing else is left."""
    path, _ = saved
    whole = path.read_bytes()

    def fails(*_, **__):
        raise error("no space left on device")

    monkeypatch.setattr(np if at == "savez" else os, at, fails)
    with pytest.raises(error, match="no space"):
        scene.problem.save(path)
    monkeypatch.undo()
    COMM.barrier()
    assert path.read_bytes() == whole and [p.name for p in path.parent.iterdir()] == [path.name]
    COMM.barrier()
    scene.problem.save(path)


def test_a_checkpoint_is_on_the_disk_before_it_replaces_the_last(scene, saved, monkeypatch):
    """The order is: write, flush to the disk, replace, flush the folder."""
    path, _ = saved
    calls = []
    for name in ("fsync", "replace"):
        was = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *a, n=name, f=was: (calls.append(n), f(*a))[1])
    scene.problem.save(path)
    assert calls == (["fsync", "replace", "fsync"] if COMM.rank == 0 else [])
