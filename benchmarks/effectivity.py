# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""How good ``dc.estimate`` is: estimated over true error, first against second order on the same mesh.

``PYTHONPATH=demos python -m benchmarks.effectivity FILE`` writes a record; docs/accuracy.md has the table.  True values are closed
forms, in two dimensions with their displacements on the far boundary (``mechanics/half_plane.py``), so that the body's size makes no
error.  The paper's punch is ``studies.punch.effectivity``.
"""

import json
import sys
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS
from mechanics.half_plane import Cylinder, FlatPunch

# isort: split
import demo_ball_on_flat as flat
import numpy as np
import ufl
from demo_hertz import FORCE, P0, A, ball
from dolfinx import fem, mesh
from helpers import along_face, hooke, rounded_body
from mpi4py import MPI

SMOOTH = Cylinder(young=1000.0, nu=0.3, radius=1000.0, a=0.1)
ROUGH = Cylinder(young=1000.0, nu=0.499, radius=1000.0, a=0.1, mu=0.3)
PUNCH = FlatPunch(young=1000.0, nu=0.3, a=0.1, force=0.01)
THERE = np.linspace(0.0, 0.8, 9)[1:]  # tangential forces over mu P, and back
BACK = np.linspace(0.8, -0.8, 17)[1:]
STATES = {"there, 0.4": 4, "there, 0.8": 8, "back, 0.4": 12, "back, -0.4": 20, "back, -0.8": 24}


def plane_strain(scene, law, order: int, facets=None) -> tuple[dc.ContactProblem, fem.Function]:
    """A body on the plane y = 0 without friction, and the displacement of its far boundary."""
    domain, face, far = scene
    V = functionspace(domain, ("Lagrange", order, (2,)))
    u, v, held = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    F = ufl.inner(hooke(ufl.sym(ufl.grad(u)), law.young, law.nu), ufl.sym(ufl.grad(v))) * ufl.dx
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 1, far))]
    face = face if facets is None else face[facets]
    contact = dc.Contact(V, face, dc.RigidPlane((0, 0), (0, 1)), dc.Friction(0.0))
    options = dict(solver=dc.CondensedNewton(), petsc_options=DIRECT_OPTIONS, tol=1e-9)
    return dc.ContactProblem(F, u, [contact], bcs=bcs, **options), held


def off_line(contact, component: int, exact, rings: bool = False) -> tuple[float, float]:
    """Root mean squares of nodal tractions of first order minus ``exact``, and of ``exact``, by a fine rule along the face, or on ``rings``."""
    x, r, area = along_face(contact, contact.reaction, contact.area)
    s = (np.arange(200_000) + 0.5) / 200_000 * (x[-1] - x[0]) + x[0]
    expected = exact(s)
    off = np.interp(s, x, r[:, component] / area) - expected
    weight = np.sqrt(s / s.mean()) if rings else 1.0
    return rms(weight * off), rms(weight * expected)


def rms(values) -> float:
    return float(np.sqrt((values**2).mean()))


def row(true, estimate) -> dict:
    return dict(true=float(true), estimate=float(estimate), effectivity=float(estimate / true))


def compared(found: dc.Estimate, exact: dict) -> dict:
    """Rows of the estimate's quantities against exact values: one number, or several, which the largest stands for."""
    rows = {}
    for key, (values, right) in exact.items():
        right, top = np.ravel(right), np.abs(right).max()
        rows[key] = row(np.abs(np.ravel(values) - right).max() / top, found[key].error / top)
    return rows


def field(found, **true) -> dict:
    """Rows of ``pressure`` and ``shear`` against root mean squares of true errors and exact fields."""
    return {key: row(off / of, found[key].error / of) for key, (off, of) in true.items()}


def references(cells: int) -> dict:
    """Cells and orders: of the problem, and of two references."""
    return {"problem": (cells, 1), "same cells": (cells, 2), "half cells": (2 * cells, 2)}


def hertz(cells: int, edge: float = 1.0) -> dict:
    """A cylinder, plane strain, without friction; the contact ends at ``edge`` times where the mesh has a node."""
    law, solved, rows = replace(SMOOTH, a=edge * SMOOTH.a), {}, {}
    for name, (n, order) in references(cells).items():
        scene = scenes(SMOOTH, n)
        solved[name], held = plane_strain(scene, law, order)
        held.interpolate(law.displacement)
        solved[name].solve()
    problem = solved.pop("problem")
    exact = dict(normal_force=law.force, peak_pressure=law.pressure(np.zeros(1))[0])
    for name, reference in solved.items():
        found = dc.estimate(problem, reference)
        rows[name] = compared(found, {key: (found[key].value, of) for key, of in exact.items()})
        rows[name] |= field(found, pressure=off_line(problem.contacts[0], 1, law.pressure))
    return rows


@cache
def scenes(law: Cylinder, cells: int, crossed: bool = False):
    """One mesh for problem and reference."""
    return rounded_body(law.radius, law.a, 16 * law.a, cells, crossed=crossed, order=2)


def second_moment(problem) -> float:
    """Of the pressure about the middle."""
    contact = problem.contacts[0]
    return contact.comm.allreduce(float(contact.reaction[:, -1] @ contact.x[:, 0] ** 2))


def flat_punch(cells: int) -> dict:
    """A flat punch without friction; the square of its pressure has no integral."""
    solved, rows = {}, {}
    for name, (n, order) in references(cells).items():
        scene = rounded_body(1e9, PUNCH.a, 16 * PUNCH.a, n)
        under = np.abs(mesh.compute_midpoints(scene[0], 1, scene[1])[:, 0]) < PUNCH.a
        solved[name], held = plane_strain(scene, PUNCH, order, under)
        held.interpolate(PUNCH.displacement)
        solved[name].solve()
    problem = solved.pop("problem")
    exact = dict(normal_force=PUNCH.force, second_moment=PUNCH.second_moment)
    for name, reference in solved.items():
        found = dc.estimate(problem, reference, {"second_moment": second_moment})
        rows[name] = compared(found, {key: (found[key].value, of) for key, of in exact.items()})
        rows[name] |= dict(pressure=dict(estimate=found["pressure"].relative))
    return rows


def partial_slip(cells: int, edge: float = 1.0, names=("same cells", "half cells")) -> dict:
    """Cattaneo's and Mindlin's cylinder: sheared, and sheared back; at ``STATES``, and along the programme."""
    law, pairs = replace(ROUGH, a=edge * ROUGH.a), {}
    for name, (n, order) in references(cells).items():
        if name in ("problem", *names):
            pairs[name] = problem, held = plane_strain(scenes(ROUGH, n, True), law, order)
            held.interpolate(law.displacement)
            problem.solve()  # pressed without friction: no shear, as in the closed form
            problem.contacts[0].friction = dc.Friction(law.mu)
    path = [law.sheared(t) for t in THERE] + [law.sheared(t, THERE[-1]) for t in BACK]
    forces = law.mu * law.force * np.append(THERE, BACK)
    series, rows = {problem: [] for problem, _ in pairs.values()}, {}
    for step, parts in enumerate(path, start=1):
        for problem, held in pairs.values():
            held.interpolate(partial(law.displacement, parts=parts))
            problem.solve()
            series[problem].append(sums(problem.contacts[0]))
        for name in (name for name, at in STATES.items() if at == step):
            problem, *others = series
            for which, reference in zip(names, others):
                found = dc.estimate(
                    problem, reference, {"tangential_resultant": lambda p: series[p][-1][0]}
                )
                rows[f"{name}, {which}"] = state(law, problem, found, path[:step], forces[step - 1])
    exact = dict(resultant=forces, sum=[sum_of_shear(law, parts) for parts in path])
    exact |= dict(work=[law.work(path[:step]) for step in range(1, len(path) + 1)])
    along = {key: lambda p, k=k: [of[k] for of in series[p]] for k, key in enumerate(exact)}
    for which, reference in zip(names, others):
        found = dc.estimate(problem, reference, along)
        rows[f"all steps, {which}"] = compared(
            found, {key: (along[key](problem), of) for key, of in exact.items()}
        )
    return rows


def sums(contact) -> tuple[float, float, float]:
    """Tangential resultant, sum of the sizes of tangential reactions, work of friction."""
    mine = (
        contact.reaction[:, 0].sum(),
        np.abs(contact.reaction[:, 0]).sum(),
        contact.dissipation.sum(),
    )
    return tuple(contact.comm.allreduce(float(of)) for of in mine)


def sum_of_shear(law: Cylinder, parts) -> float:
    x = np.linspace(-law.a, law.a, 200_001)
    return float(np.abs(law.shear(x, parts)).sum() * (x[1] - x[0]))


def state(law: Cylinder, problem, found: dc.Estimate, path, force: float) -> dict:
    """Rows of one state of partial slip, against the closed form."""
    exact = dict(
        normal_force=law.force,
        peak_pressure=law.pressure(np.zeros(1))[0],
        tangential_resultant=force,
        tangential_force=sum_of_shear(law, path[-1]),
        dissipation=law.work(path),
    )
    rows = compared(found, {key: (found[key].value, of) for key, of in exact.items()})
    contact = problem.contacts[0]
    shear = off_line(contact, 0, lambda x: law.shear(x, path[-1]))
    return rows | field(found, pressure=off_line(contact, 1, law.pressure), shear=shear)


def off_disc(contact, exact) -> tuple[float, float]:
    """As ``off_line`` for the pressure of a surface in space; ``exact`` is a UFL expression of its coordinates."""
    domain = contact.V.mesh
    facets = np.sort(contact.facets)
    tags = mesh.meshtags(domain, 2, facets, np.ones(facets.size, dtype=np.int32))
    ds = ufl.Measure("ds", domain, subdomain_data=tags, metadata={"quadrature_degree": 12})(1)
    pressure = contact.function(contact.pressure)
    parts = [(pressure - exact) ** 2 * ds, exact**2 * ds, fem.Constant(domain, 1.0) * ds]
    off, whole, area = (domain.comm.allreduce(fem.assemble_scalar(fem.form(of))) for of in parts)
    return float(np.sqrt(off / area)), float(np.sqrt(whole / area))


def ball_on_flat(scene, order: int) -> dc.ContactProblem:
    """The sphere of demo_ball_on_flat on a quarter of the block, pressed."""
    problem, contact = flat.ball_on_flat(*scene, order=order)
    contact.surface.displacement = (0, 0, -flat.DELTA)
    problem.solve()
    return problem


def ball_in_space(cells: int, halved: bool = False) -> dict:
    """The rigid sphere of demo_ball_on_flat, in three dimensions."""
    scene, rows = flat.scene(cells), {}
    problem = ball_on_flat(scene, 1)
    exact = dict(normal_force=flat.FORCE / 4, peak_pressure=flat.P0)
    others = {"same cells": scene} | ({"half cells": flat.scene(2 * cells)} if halved else {})
    for name, of in others.items():
        found = dc.estimate(problem, ball_on_flat(of, 2))
        rows[name] = compared(found, {key: (found[key].value, of) for key, of in exact.items()})
        if name == "same cells":
            x = ufl.SpatialCoordinate(scene[0])
            inside = 1 - (x[0] ** 2 + x[1] ** 2) / flat.A**2
            pressure = flat.P0 * ufl.sqrt(ufl.conditional(ufl.gt(inside, 0), inside, 0))
            rows[name] |= field(found, pressure=off_disc(problem.contacts[0], pressure))
    return rows


def ball_in_axial_symmetry(cells: int) -> dict:
    """A ring's pressure counts by its area."""
    solved, rows = {}, {}
    for name, (n, order) in references(cells).items():
        if name != "same cells":  # which has the mesh of the problem
            scene = rounded_body(1000.0, A, 16 * A, n, half=True, order=2)
        solved[name] = ball(*scene, order)
        solved[name].solve()
    problem = solved.pop("problem")

    def of_ring(r):
        return P0 * np.sqrt(np.maximum(1 - (r / A) ** 2, 0))

    for name, reference in solved.items():
        found = dc.estimate(problem, reference)
        rows[name] = compared(found, dict(normal_force=(found["normal_force"].value, FORCE)))
        rows[name] |= field(found, pressure=off_line(problem.contacts[0], 1, of_ring, rings=True))
    return rows


EDGES = (1.0, 0.95, 0.9, 0.85)  # of the contact, over the place of a node
SCENES = {  # and arguments
    "cylinder of Hertz, 2-D": (hertz, [(n, edge) for n in (8, 16) for edge in EDGES]),
    "ball of Hertz, axial symmetry": (ball_in_axial_symmetry, [(n,) for n in (8, 12, 16, 24)]),
    "ball on a flat, 3-D": (ball_in_space, [(6, True), (7, True), (8,), (10,), (12,)]),
    "flat punch, 2-D": (flat_punch, [(n,) for n in (8, 16, 32)]),
    "partial slip, 2-D": (partial_slip, [(n, edge) for n in (8, 16) for edge in EDGES]),
}


def main(path: Path, chosen=()) -> None:
    for name in chosen or SCENES:
        compute, meshes = SCENES[name]
        for mesh_and_edge in meshes:
            record = json.dumps(
                dict(scene=name, cells=mesh_and_edge, states=compute(*mesh_and_edge))
            )
            if MPI.COMM_WORLD.rank == 0:
                with path.open("a") as file:
                    file.write(record + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
