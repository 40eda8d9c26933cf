"""``PYTHONPATH=demos:tests python -m benchmarks.tetrahedra FILE`` writes a record a line; ``... FILE --tables`` prints its tables.

notes/2026-11-23-tetrahedra.md says what follows from them.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path
from time import process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace
from dolfinx_contact.law.dissipation import work_of_friction
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS
from dolfinx_contact.problem_input import body_of

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import elastic
from mpi4py import MPI
from patches import MU, NU, PRESSURE, E, P, even_block
from scipy import linalg, sparse

from benchmarks.tables import table
from benchmarks.tetrahedra.ball import Ball, ball
from benchmarks.tetrahedra.bodies import Body, Touching
from benchmarks.tetrahedra.points import VARIANTS, Points, contact_points, even
from mechanics.material import elasticity
from studies.punch.accuracy import mesh_options
from studies.punch.mesh import CONTACT
from studies.punch.model import Parameters, Punch, programme

BALL = (
    "force",
    "radius",
    "peak",
    "p",
    "rough_p",
    "common_p",
    "depth",
    "drag",
    "stick",
    "q",
)  # see ``ball.py``
UP = np.eye(3)  # frame of a body above its surface


def patch(variant: str, slips: bool, tilted: bool, curved: bool) -> dict:
    """An even stress on a plane; ``curved``: also the edges of the contact facets, in the plane."""
    block = even_block("tetrahedron", slips, tilted, curved)
    if curved:
        x, turn = block.mesh.geometry.x, block.surface.frame
        along = x @ turn[:2].T
        x += 0.06 * np.outer(np.sin(np.pi * along).prod(axis=1), [1, -0.7]) @ turn[:2]
    V = functionspace(block.mesh, ("Lagrange", 2, (3,)))
    u, v, held = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    held.x.array[:] = block.moved(V.tabulate_dof_coordinates().T).T.ravel()
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, block.top))
    F = elasticity(u, v, E, NU, block.dx) - block.work(v)
    body = Body(
        body_of(F, u, [bc], options=DIRECT_OPTIONS), block.contact(V).facets, block.surface.frame
    )
    points = contact_points(variant, body.X, body.T)
    found = Touching(points, body.S).solve(body.free(), dc.Friction(MU, P))
    forces = even(body.X, body.T)[:, None] * block.traction
    pressure = PRESSURE * points.area
    return dict(
        scene="patch", slips=slips, tilted=tilted, curved=curved, points=len(points.area), failed=found.failed,
        displacement=np.abs(found.motion - block.moved(body.X.T).T @ block.surface.frame.T).max() * E / PRESSURE,
        forces=np.abs(found.forces - forces).max() / np.abs(forces).max(),
        pressure=np.abs(found.reaction[:, 2] - pressure).max() / pressure.max(),
    )  # fmt: skip


def uneven_block(cells: int) -> Body:
    """The unit cube, its lower face's inner nodes moved along it by up to an eighth of a cell, its top held."""
    domain = mesh.create_unit_cube(MPI.COMM_WORLD, cells, cells, cells, mesh.CellType.tetrahedron)
    bottom, top = (
        mesh.locate_entities_boundary(domain, 2, lambda x, z=z: np.isclose(x[2], z)) for z in (0, 1)
    )
    x = domain.geometry.x
    inner = np.isclose(x[:, 2], 0) & (np.abs(x[:, :2] - 0.5).max(axis=1) < 0.499)
    x[inner, :2] += np.random.default_rng(1).uniform(-1, 1, (inner.sum(), 2)) / (8 * cells)
    V, u, F = elastic(domain, 1.0, NU, 2)
    bc = fem.dirichletbc(
        fem.Constant(domain, np.zeros(3)), fem.locate_dofs_topological(V, 2, top), V
    )
    return Body(body_of(F, u, [bc], options=DIRECT_OPTIONS), bottom, UP)


def stability(points: Points, body: Body, cells: int) -> dict:
    """Inf-sup constants for gaps: the smallest and the largest of (p, u)^2 / energy(u) over h |p|^2 / E, which is the smallest but for
    those that are zero; |p| is the norm in L2 of the functions whose coefficients are pressures, for points that of their rule."""
    carried = sparse.diags(points.area) @ points.C
    mass = points.mass.toarray()
    if points.area.min() < 1e-9 * points.area.max():  # nodes without weight: forces over one area
        carried, mass = points.C * points.area.max(), np.eye(len(points.area)) * points.area.max()
    values = linalg.eigvalsh(carried @ (carried @ body.S[2::3, 2::3]).T, mass / cells)
    zero = values < 1e-10 * values[-1]
    smallest, largest = np.sqrt([values[~zero][0], values[-1]])
    return dict(
        scene="inf-sup", cells=cells, unknowns=body.unknowns, points=len(values), zero=int(zero.sum()),
        smallest=smallest, largest=largest,
    )  # fmt: skip


def tetrahedral_punch(n: int) -> tuple[Punch, Body]:
    """A quarter of the paper's punch, case A, graded, its rim curved."""
    start, options = Parameters(), mesh_options(n)
    lowest = start.height / options["layers"] ** 2
    parameters = replace(start, case="A", tol=1e-8, lowest=lowest)
    punch = Punch(
        parameters, solver=dc.CondensedNewton(), petsc_options=DIRECT_OPTIONS, quarter=True, tetrahedra=True, **options
    )  # fmt: skip
    return punch, Body(punch.problem.body, punch.facet_tags.find(CONTACT), UP)


def cycle(variant: str, punch: Punch, body: Body) -> dict:
    """Work of friction of one cycle of the punch, N mm."""
    begin = process_time()
    points, law = contact_points(variant, body.X, body.T), punch.contact.friction
    touching = Touching(points, body.S)
    punch.move_top(1.0)
    free, moved = body.free(), np.zeros_like(body.X)
    reaction, slipped = np.zeros((len(points.area), 3)), np.zeros(len(points.area), bool)
    work, failed = 0.0, 0
    for way in programme(punch.parameters):
        now = touching.solve(way * free - moved, law, [reaction.ravel()])
        work += work_of_friction(law, reaction, slipped, now.reaction, now.at_points[:, :2])[
            0
        ].sum()
        reaction, slipped = now.reaction, now.status == int(dc.Status.SLIP)
        moved[:, :2] += now.motion[:, :2]
        failed += now.failed
    weights = even(body.X, body.T)  # of vertices: zero but for the curved rim
    return dict(
        scene="punch", unknowns=body.unknowns, points=len(points.area), work=punch.parts * work, failed=failed,
        seconds=process_time() - begin, vertices=np.abs(weights[body.T[:, :3]]).max() / weights.max(),
    )  # fmt: skip


def records():
    """All records, each with its variant."""
    blocks = {cells: uneven_block(cells) for cells in (4, 8, 12)}
    balls = {f"flat body, {n} cells": Ball(n) for n in (6, 12)}
    balls |= {f"round body, 12 cells, order {order}": Ball(12, True, order) for order in (1, 2)}
    punches = {n: tetrahedral_punch(n) for n in (2, 4, 6)}
    for variant in VARIANTS:
        named = dict(variant=variant)
        for k in range(8):
            yield named | patch(variant, *(bool(k & bit) for bit in (1, 2, 4)))
        for cells, body in blocks.items():
            yield named | stability(contact_points(variant, body.X, body.T), body, cells)
        for name, of in balls.items():
            yield named | dict(case=name) | ball(variant, of)
        for n, of in punches.items():
            if n < 6 or "points" not in variant:  # which take minutes
                yield named | dict(divisions=n) | cycle(variant, *of)


def tables(found: list[dict]) -> str:
    """A line for each variant, and one for each ball; errors in per cent."""
    lines, balls = [], []
    for variant in VARIANTS:
        mine = [r for r in found if r["variant"] == variant]
        scene = {
            name: [r for r in mine if r["scene"] == name] for name in ("patch", "inf-sup", "punch")
        }
        miss = [max(r["forces"] for r in scene["patch"] if r["curved"] == c) for c in (False, True)]
        inf_sup = ", ".join(f"{r['smallest']:.2f}" for r in scene["inf-sup"])
        zero = ", ".join(str(r["zero"]) for r in scene["inf-sup"])
        work = ", ".join(
            f"{r['work']:.1f}" + " (not solved)" * bool(r["failed"]) for r in scene["punch"]
        )
        seconds = ", ".join(f"{r['seconds']:.2g}" for r in scene["punch"])
        lines.append([variant, *(f"{e:.0e}" for e in miss), inf_sup, zero, work, seconds])
        for r in mine:
            if r["scene"] == "ball":
                errors = [f"{100 * r[key]:.2g}" for key in BALL]
                balls.append([r["case"], variant, r["points"], *errors, f"{r['seconds']:.2g}"])
    first = table(
        ["variant", "patch", "patch, curved", "inf-sup", "zero", "punch", "seconds"], lines
    )
    return (
        first
        + "\n\n"
        + table(
            ["ball", "variant", "points", *BALL, "seconds"], sorted(balls, key=lambda row: row[0])
        )
    )


def main(path: Path) -> None:
    with path.open("w") as file:
        for record in records():
            kept = {k: float(f"{v:.4g}") if isinstance(v, float) else v for k, v in record.items()}
            file.write(json.dumps(kept) + "\n")
            file.flush()


if __name__ == "__main__":
    path = Path(sys.argv[1])
    if "--tables" not in sys.argv:
        main(path)
    print(tables([json.loads(line) for line in path.read_text().splitlines()]))
