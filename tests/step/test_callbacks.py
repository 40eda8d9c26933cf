# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Functions of the user: what one rank raises all raise, and what makes no sense is refused."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import mesh

import dolfinx_contact as dc
from dolfinx_contact.support import collective

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
LAST = COMM.rank == COMM.size - 1


def made(at, error=OSError):
    """The block with one of the user's functions that raises on the last rank when ``fails`` says so, and a programme for it."""

    def call(*_, **__):
        if fails and LAST:
            raise error("no space left on device")

    def bump(x):
        call()
        return x[2] + 0.01 * x[0] ** 2

    def mu(x, pressure=None):
        call()
        return np.full(x.shape[1], 0.3)

    fails = []
    surface = dc.RigidSurface(bump, axis=(1, 0, 0)) if at == "distance" else None
    scene = scenes.block(cells=(2, 2, 1))
    if at in ("distance", "before_residual", "after_step"):
        V, facets = scene.V, scene.contact.facets
        contact = dc.Contact(V, facets, surface or scene.surface, dc.Friction(0.3))
        F, J = scene.F, ufl.derivative(scene.F, scene.u, ufl.TrialFunction(V))
        internal = None if at == "distance" else dc.InternalVariables(**{at: call})
        scene.problem = dc.ContactProblem(
            F, scene.u, contact, bcs=scene.bcs, J=J, internal=internal
        )
        scene.contact = contact
    if at == "mu":
        scene.contact.friction = dc.Friction(mu)

    def programme(t):
        scene.move_top(0.001 * t, 0, -0.005 * t)
        if at == "programme":
            call()

    if at == "monitor":
        scene.problem.monitor = call
    return scene, fails, programme, call if at == "accepted" else None


@pytest.mark.parametrize("at", ["programme", "accepted", "before_residual", "after_step", "monitor", "mu", "distance"])  # fmt: skip
def test_what_one_rank_raises_all_raise(at):
    """The error of one rank is that of all, the last converged state is in place, and the programme can be taken further."""
    scene, fails, programme, accepted = made(at)
    dc.advance(scene.problem, programme, [1.0], monitor=accepted)
    reaction = scene.contact.reaction
    fails.append(True)
    with pytest.raises(OSError, match="no space"):
        dc.advance(scene.problem, programme, [2.0, 3.0], start=1.0, monitor=accepted)
    if at != "accepted":  # which comes after the step
        assert scene.contact.reaction is reaction
    fails.clear()
    dc.advance(scene.problem, programme, [2.0], start=1.0, monitor=accepted)


@pytest.mark.parametrize("error", [StopIteration, KeyboardInterrupt, GeneratorExit, type("Local", (OSError,), {})])  # fmt: skip
def test_errors_of_any_kind_are_those_of_all_ranks(error):
    """Errors by which Python ends iterations and programs are no others here; of a type that others do not have, they have its base."""
    scene, fails, programme, _ = made("programme", error)
    fails.append(True)
    with pytest.raises(error.__base__ if error.__name__ == "Local" else error, match="no space"):
        dc.advance(scene.problem, programme, [1.0])


def test_what_converge_and_adapt_call_raises_on_all_ranks():
    """An error of one rank ends the refinement on all."""

    def compute(*_):
        if LAST:
            raise OSError("no space left on device")

    with pytest.raises(OSError, match="no space"):
        dc.converge(compute, 0.1, [1, 2])
    with pytest.raises(OSError, match="no space"):
        dc.adapt(compute, mesh.create_unit_square(COMM, 2, 2), 0.1, "normal_force")


LEFT = """
from mpi4py import MPI
from dolfinx_contact.support import collective
collective.WAITING_SECONDS = 0.2
with collective.raised_together(MPI.COMM_WORLD):
    if MPI.COMM_WORLD.rank == 0:
        raise OSError("no space left on device")
    MPI.COMM_WORLD.Barrier()
"""


@pytest.mark.slow
@pytest.mark.skipif(COMM.size > 1, reason="starts processes of its own")
def test_a_rank_left_in_the_midst_of_the_users_function_does_not_wait_for_ever():
    """Where others wait in the user's own communication for the rank that failed, it tells its error and ends all."""
    mpiexec = Path(sys.executable).parent / "mpiexec"
    if not mpiexec.exists():
        pytest.skip("there is no mpiexec beside Python")
    done = subprocess.run([mpiexec, "-n", "2", sys.executable, "-c", LEFT],
                          capture_output=True, text=True, env=os.environ, timeout=100)  # fmt: skip
    assert done.returncode != 0
    assert "OSError: no space left on device" in done.stderr and "all of them are ended" in done.stderr  # fmt: skip
    assert collective.WAITING_SECONDS >= 10.0


WRONG = [None, 1j, "0.3", np.array([1 + 1j]), [0.1, 0.2], True, np.nan]


@pytest.mark.parametrize("value", WRONG)
def test_what_converge_is_given_is_one_real_number(value):
    """None, complex numbers, texts, several numbers and NaN are refused by what they are."""
    with pytest.raises(ValueError, match=r"what compute returns for \(1, 1\) must be one finite"):
        dc.converge(lambda n, parts: value, 0.1, [1, 2])


@pytest.mark.parametrize("meshes", [[8, 8, 8, 8], [4, 8, 8], [8, 4, 8], ["a", "a"], "mesh"])
def test_the_same_mesh_again_is_no_finer_one(meshes):
    """Meshes given twice, or out of order, are refused: their differences are no errors of the mesh."""
    if meshes == "mesh":
        meshes = [mesh.create_unit_square(COMM, 2, 2) for _ in range(2)]
    with pytest.raises(ValueError, match="each finer than the one before"):
        dc.converge(lambda n, parts: 1.0, 0.1, meshes)
    with pytest.raises(ValueError, match="not lists or arrays"):
        dc.converge(lambda n, parts: 1.0, 0.1, [[1, 1], [2, 2]])
    with pytest.raises(ValueError, match="at least two"):
        dc.converge(lambda n, parts: 1.0, 0.1, (n for n in (1, 2)))


def test_runs_that_do_not_differ_are_told_of():
    """Where the mesh, or the number of parts, changes no digit, no error is seen: a warning says so."""
    with pytest.warns(UserWarning, match=r"2.0 to the last digit for \(1, 1\) and for \(2, 1\)"):
        dc.converge(lambda n, parts: 2.0, 0.1, [1, 2])
    with pytest.warns(UserWarning, match=r"to the last digit for \(1, 1\) and for \(1, 2\)"):
        dc.converge(lambda n, parts: 1 + 1 / n, 0.1, [1, 2], halvings=1)


@pytest.mark.skipif(COMM.size == 1, reason="needs more than one rank")
def test_numbers_of_one_rank_are_refused():
    """What each rank returns of its own part is told of, but by itself a rank may compute what it likes."""
    with pytest.raises(ValueError, match="differs between ranks"):
        dc.converge(lambda n, parts: 1.0 + COMM.rank + 1 / n, 0.1, [1, 2])
    alone = dc.converge(lambda n, parts: 1.0 + COMM.rank + 1 / n, 0.9, [1, 2], comm=scenes.MPI.COMM_SELF)  # fmt: skip
    assert alone.value == 1.5 + COMM.rank


@pytest.mark.parametrize("pair", [None, 3.0, (1, 2), (None, None, None)])
def test_adapt_is_given_two_problems(pair):
    """Anything else than two problems on the mesh is refused."""
    with pytest.raises(ValueError, match="two ContactProblems on the mesh"):
        dc.adapt(lambda of: pair, mesh.create_unit_square(COMM, 2, 2), 0.1, "normal_force")


@pytest.mark.parametrize("value", [None, 0.3 + 0.1j, "0.3", True])
def test_fields_of_friction_are_real_numbers(value):
    """Coefficients that are no real numbers are refused, also where NumPy would drop the imaginary part."""
    scene = scenes.block(cells=(2, 2, 1))
    for field in (lambda x: value, lambda x: np.full(x.shape[1], value)):
        with pytest.raises(ValueError, match="what mu gives must be an array of real numbers"):
            scene.contact.friction = dc.Friction(field)
    with pytest.raises(ValueError, match="what mu gives must be finite"):
        scene.contact.friction = dc.Friction(lambda x: np.full(x.shape[1] + 1, np.nan))
