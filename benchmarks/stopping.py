# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Whether ``dc.converge`` stops where a number is as accurate as asked for: nine scenes, true over asked error.

``PYTHONPATH=demos python -m benchmarks.stopping FILE`` appends a line of JSON for each; docs/accuracy.md has the table.
True values: closed form of the ball; of the cylinder and the block second order on a mesh finer than most (and 16 times the increments), of the
flat punch two of them extrapolated with the first order; of the paper's punch ``LIMITS``, from studies.punch.limits.
"""

import json
import sys
from functools import cache
from pathlib import Path
from time import process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from benchmarks.effectivity import ball_on_flat
from dolfinx_contact.compat import functionspace
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS
from studies.punch import Parameters
from studies.punch import accuracy as punches
from studies.punch.limits import LIMITS

# isort: split
import demo_ball_on_flat as flat
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import hooke, rounded_body
from mpi4py import MPI

ASKED = (0.05, 0.02, 0.01, 0.005)
FINEST = 40  # cells


def solved(
    V, F, u, face, held, far, mu: float, normal=(0, 1)
) -> tuple[dc.ContactProblem, dc.Contact]:
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 1, far), V)]
    contact = dc.Contact(V, face, dc.RigidPlane((0, 0), normal), dc.Friction(mu))
    return dc.ContactProblem(
        F, u, [contact], bcs=bcs, solver=dc.CondensedNewton(), petsc_options=DIRECT_OPTIONS
    ), contact


def body(scene, order: int):
    domain, *_ = scene
    V = functionspace(domain, ("Lagrange", order, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    return V, u, ufl.inner(hooke(ufl.sym(ufl.grad(u)), 1000.0, 0.3), ufl.sym(ufl.grad(v))) * ufl.dx


def cylinder(cells: int, parts: int, mu: float = 0.0, order: int = 1) -> tuple:
    """Hertz's cylinder; with friction the plane goes sideways and half way back: partial slip."""
    scene = rounded_body(1000.0, 0.1, 1.6, cells, order=2)
    V, u, F = body(scene, order)
    stroke = 0.1**2 / 2000.0
    held = fem.Constant(scene[0], np.array([0.0, -3.0 * stroke]))
    problem, contact = solved(V, F, u, scene[1], held, scene[2], mu)
    problem.solve()
    if mu > 0:
        ways = np.array([0.0, 0.4, 0.8, 0.6, 0.4])  # two increments there, two back
        for way in np.interp(np.arange(1, 4 * parts + 1) / parts, np.arange(5), ways):
            contact.surface.displacement = np.array([way * stroke, 0.0])
            problem.solve()
    return float(contact.force()[1]), float(contact.dissipation.sum())


def flat_punch(cells: int, parts: int, order: int = 1) -> float:
    """A flat rigid punch of half width 0.1 on a block: second moment of its pressure over its force and half width squared."""
    domain, face, far = rounded_body(1e9, 0.1, 1.6, cells)
    under = np.abs(mesh.compute_midpoints(domain, 1, face)[:, 0]) < 0.1
    V, u, F = body((domain,), order)
    held = fem.Constant(domain, np.array([0.0, -1e-4]))
    problem, contact = solved(V, F, u, face[under], held, far, 0.0)
    problem.solve()
    normal = contact.reaction[:, 1]
    return float((normal * contact.x[:, 0] ** 2).sum() / normal.sum() / 0.1**2)


def block(
    cells: int, parts: int, mu: float, tilt: float = 0.0, order: int = 1
) -> tuple[float, float]:
    """A square that is pressed on a plane and dragged, or on a tilted one without friction: normal force, work of friction."""
    domain = mesh.create_unit_square(MPI.COMM_WORLD, cells, cells, mesh.CellType.quadrilateral)
    foot, top = (mesh.locate_entities_boundary(domain, 1, lambda x, y=y: np.isclose(x[1], y)) for y in (0, 1))  # fmt: skip
    V, u, F = body((domain,), order)
    held = fem.Constant(domain, np.zeros(2))
    normal = (np.sin(tilt), np.cos(tilt))
    problem, contact = solved(V, F, u, foot, held, top, mu, normal)
    for part in np.arange(1, 4 * parts + 1) / (4 * parts):
        held.value = (0.01 * part if mu > 0 else 0.0, -0.005)
        problem.solve()
    return float(contact.force() @ normal), float(contact.dissipation.sum())


def ball(cells: int, parts: int) -> float:
    problem = ball_on_flat(flat.scene(cells), 1)
    return abs(float(problem.contacts[0].force()[2]))


def paper(case: str):
    """The work of friction of the paper's punch: the meshes of ``demo_punch --accuracy``, one punch each."""
    parameters = Parameters(case=case, tol=1e-8)
    build = cache(lambda n: punches.build(parameters, n))
    return lambda n, parts: punches.run(build(n), parameters, parts).dissipation


def scenes() -> dict:
    """Function, meshes, halvings and true value."""
    cells = (4, 8, 16, 32, 64, 128)  # first order
    slipped = cylinder(FINEST, 16, 0.3, 2)[1]
    return {
        "cylinder of Hertz, 2-D: force": (
            lambda n, k: cylinder(n, k)[0],
            cells,
            0,
            cylinder(FINEST, 1, order=2)[0],
        ),
        "partial slip, 2-D: work": (lambda n, k: cylinder(n, k, 0.3)[1], cells, 5, slipped),
        "flat punch, 2-D: moment": (
            flat_punch,
            (*cells, 256),
            0,
            2 * flat_punch(128, 1, 2) - flat_punch(64, 1, 2),
        ),
        "block dragged, 2-D: work": (
            lambda n, k: block(n, k, 0.3)[1],
            cells,
            6,
            block(96, 32, 0.3, order=2)[1],
        ),
        "block on a tilted plane, 2-D: force": (
            lambda n, k: block(n, k, 0.0, 0.01)[0],
            cells,
            0,
            block(128, 1, 0.0, 0.01, 2)[0],
        ),
        "ball on flat, 3-D: force": (ball, (4, 8, 16), 0, flat.FORCE / 4),
        "paper's punch, A: work": (paper("A"), (2, 4, 6, 8), 5, LIMITS["A"]["dissipation"][0]),
        "paper's punch, B: work": (paper("B"), (2, 4, 6, 8), 5, LIMITS["B"]["dissipation"][0]),
        "paper's punch, C: work": (paper("C"), (2, 4, 6, 8), 5, LIMITS["C"]["dissipation"][0]),
    }


def main(path: Path) -> None:
    for name, (compute, meshes, halvings, true) in scenes().items():
        computed = cache(compute)
        for asked in ASKED:
            begin = process_time()
            found = dc.converge(computed, asked, meshes, halvings=halvings)
            finest, parts = list(found.tried)[-1]
            record = dict(scene=name, asked=asked, reached=found.reached, estimated=found.error, true=abs(found.value / true - 1),
                          value=found.value, limit=true, mesh=finest, parts=parts, runs=len(found.tried),
                          seconds=process_time() - begin)  # fmt: skip
            with path.open("a") as file:
                file.write(json.dumps(record) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
