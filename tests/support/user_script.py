# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A script as users write them, with types: tests/programs/test_types.py runs it, and ``mypy --strict`` on it."""

from __future__ import annotations

import sys
from pathlib import Path

import dolfinx_contact as dc

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from numpy.typing import NDArray

from dolfinx_contact.compat import functionspace

YOUNG, POISSON = 210e3, 0.3


def stress(u: fem.Function) -> ufl.core.expr.Expr:
    strain = ufl.sym(ufl.grad(u))
    shear = YOUNG / (2 * (1 + POISSON))
    bulk = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    return 2 * shear * strain + bulk * ufl.tr(strain) * ufl.Identity(3)


def make() -> tuple[dc.ContactProblem, fem.Function, dc.Contact]:
    domain = mesh.create_unit_cube(MPI.COMM_WORLD, 2, 2, 2)
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v, held = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    bottom, top = (
        mesh.locate_entities_boundary(domain, 2, lambda x, z=z: np.isclose(x[2], z))
        for z in (0.0, 1.0)
    )
    plane = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1), axis=(1, 0, 0))
    friction = dc.Friction(mu=(0.3, 0.15), p=(0.05, 0.2))
    contact = dc.Contact(V, bottom, plane, friction, wear=dc.Wear(1e-6))
    problem = dc.ContactProblem(
        ufl.inner(stress(u), ufl.grad(v)) * ufl.dx,
        u,
        [contact],
        bcs=[fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, top))],
        solver=dc.CondensedNewton(max_seconds=60.0),
        petsc_options={"ksp_type": "preonly", "pc_type": "lu"},
    )
    return problem, held, contact


def watch(iteration: int, error: float, counts: dc.Counts) -> None:
    if iteration > 1000:
        print(f"{iteration}: {error:.1e}, {counts.slip} of {sum(counts)} slip")


def press(folder: Path) -> NDArray[np.float64]:
    problem, held, contact = make()
    problem.monitor = watch
    history = dc.History(problem, folder / "run.csv", points=[(0.5, 0.5, 0.0)])
    with problem:
        for depth in (0.001, 0.002):
            held.x.array[2::3] = -depth
            contact.surface.displacement = (depth, 0.0, 0.0)
            step = problem.solve()
            row = history.record(step, depth=depth)
            worst: float = max(step.error, step.slip_error, step.forward_error, step.rounding)
            print(row["step"], worst <= problem.tol, step.iterations, step.counts.stick, step)
        problem.save(folder / "state.npz")
        problem.load(folder / "state.npz")
        contact.friction = dc.Friction(0.2, axes=np.tile((0.6, 0.8), (len(contact.nodes), 1)))
        problem.solver, problem.tol = dc.FixedPoint(max_iterations=200), 1e-7
        try:
            problem.solve()
        except dc.NotConverged as failure:
            print(failure.step.error, failure.displacement.max(), len(failure.reactions))
        slipping: NDArray[np.bool_] = contact.status == dc.Status.SLIP
        pressure = contact.function(contact.pressure, "pressure")
        print(slipping.sum(), pressure.name, contact.reaction_function().name)
    print(contact.force(), contact.dissipation.sum(), contact.wear_depth.max(), contact.gap.min())
    print(history.column("contact0_force_z"), problem.counts().open, dc.__version__)
    reaction: NDArray[np.float64] = contact.reaction
    return reaction


def arrays(reaction: NDArray[np.float64]) -> float:
    inside = dc.law.project_cone(reaction, 0.3)
    gaps = dc.law.bipotential_gap(inside, np.zeros(len(inside)), np.zeros((len(inside), 2)), dc.Friction(0.3))  # fmt: skip
    try:
        found = dc.solve_condensed(np.eye(6) + 0.1, [[0.02, 0, -0.1], [0, 0.3, -0.1]], dc.Friction(0.3), tol=1e-10)  # fmt: skip
    except dc.CondensedNotConverged as failure:
        found = failure.best
    print(found.branch, found.error, found.reaction.shape, [attempt.branch for attempt in found.tried])  # fmt: skip
    return float(gaps.max(initial=0.0) + dc.law.load_function(inside, 0.3).max(initial=0.0))


if __name__ == "__main__":
    print(arrays(press(Path(sys.argv[1]))))
