# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A long run through everything that goes wrong in one ends where an undisturbed run does.

``SOAK_STEPS=100000 tools/mpitest .venv 2 -s tests/results/test_disturbed_run.py`` takes an hour; 300 steps meet every disturbance.
"""

import math
import os
from time import perf_counter

import numpy as np
import pytest
import scenes

import dolfinx_contact as dc

COMM = scenes.COMM
STEPS = int(os.environ.get("SOAK_STEPS", 300))
CYCLE, SAVED, NEW_MESH, SHOWN = 20, 32, 128, 1000  # steps
HISTORY = ("reaction", "displacement", "slip_path", "dissipation", "wear_depth")


class Run:
    """A block that is pressed, pushed by a force and rubbed by a plane that goes to and fro."""

    def __init__(self):
        self.begin_anew()

    def begin_anew(self):
        """Another body."""
        self.scene = scenes.block(cells=(2, 2, 1), wear=dc.Wear(5e-9))

    def take_another_problem(self):
        """On the same body."""
        scene, old = self.scene, self.scene.contact
        plane = dc.RigidPlane((0, 0, 0), (0, 0, 1), (1, 0, 0))
        scene.surface = plane
        scene.contact = dc.Contact(scene.V, scene.facets, plane, old.friction, wear=old.wear)
        scene.problem = dc.ContactProblem(
            scene.F, scene.u, scene.contact, bcs=scene.bcs, tol=scene.problem.tol
        )

    def give(self, k):
        """Loads and friction of step k."""
        scene, angle = self.scene, 2 * math.pi * k / CYCLE
        scene.move_top(0, 0, -0.01 - 0.002 * math.cos(0.37 * angle))
        scene.force.value[:] = (0.0, 500.0 * math.sin(0.61 * angle), 0.0)
        scene.surface.displacement = (0.004 * math.sin(angle), 0.001 * math.sin(2 * angle), 0.0)
        if k % 10 == 0:
            self.exchange(k)

    def exchange(self, k):
        # Slip rules not far from the cone's shape: with p = (0.0375, 0.15) beside mu = (0.3, 0.15) step 20,283 has two
        # solutions, both to the last digit and from the same history, and rounding decides which is found.
        x = self.scene.contact.x
        mu = np.column_stack((0.3 + 0.1 * x[:, 0], 0.2 + 0.1 * x[:, 1]))
        laws = (((0.3, 0.15), (0.25, 0.15)), (0.25, None), (mu, None), (0.0, None))
        self.scene.contact.friction = dc.Friction(*laws[k // 10 % len(laws)])

    def disturb(self, random):
        """A step that fails; whether it did."""
        problem, force = self.scene.problem, self.scene.force.value.copy()
        tol, kind = problem.tol, random.integers(4)
        if kind == 0:
            self.scene.force.value[1] = math.nan
        elif kind == 1:
            problem.solver, problem.tol = dc.FixedPoint(max_iterations=1), 1e-12
        else:
            problem.monitor = self.stop if kind == 2 else self.interrupt
        try:
            problem.solve()
        except (ValueError, dc.NotConverged, ZeroDivisionError, KeyboardInterrupt):
            return True
        finally:
            self.scene.force.value[:] = force
            problem.solver, problem.tol, problem.monitor = None, tol, None
        return False

    @staticmethod
    def stop(*_):
        if COMM.rank == COMM.size - 1:
            raise ZeroDivisionError

    @staticmethod
    def interrupt(iteration, *_):
        if iteration == 2:
            raise KeyboardInterrupt


def disturbed(run, k, random, path):
    """Solve step k in spite of failures, a crash or a restart."""
    if k % SAVED == 0:
        run.scene.problem.save(path)
        if k % NEW_MESH == 0:
            run.scene.problem.close()
            run.begin_anew()
        elif random.random() < 0.5:
            run.take_another_problem()
        run.exchange((k - 1) // 10 * 10)  # as it was saved
        run.scene.problem.load(path)
    run.give(k)
    if random.random() < 0.2 and not run.disturb(random):
        return
    run.scene.problem.solve()


def compare(run, calm):
    """The largest difference of the two histories, over the largest entry."""
    worst = 0.0
    for name in HISTORY:
        one, other = (scenes.by_position(each.scene, name) for each in (run, calm))
        worst = max(worst, np.abs(one - other).max() / max(np.abs(other).max(), 1e-300))
    return worst


@pytest.mark.slow
def test_a_disturbed_run_ends_as_an_undisturbed_one(tmp_path):
    """Loads and friction exchanged, steps that fail and are repeated, checkpoints taken up by other problems and other
    meshes: reactions, slip paths, work of friction and wear are those of a run without all that."""
    path = COMM.bcast(tmp_path, root=0) / "state.npz"
    run, calm, random, start = Run(), Run(), np.random.default_rng(0), perf_counter()
    for k in range(1, STEPS + 1):
        calm.give(k)
        calm.scene.problem.solve()
        disturbed(run, k, random, path)
        if k % SHOWN == 0 or k == STEPS:
            worst = compare(run, calm)
            if COMM.rank == 0:
                print(
                    f"{k} steps, {perf_counter() - start:.0f} s, difference {worst:.1e}", flush=True
                )
            assert worst < 1e-6
