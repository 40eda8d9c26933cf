# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What a load step of two deformable bodies costs, beside that of one body on a rigid plane with as many contact nodes and unknowns.

    python -m benchmarks.two_bodies [--sizes 5000 43000 60000] [--steps 6] [--output results/two_bodies.csv]

A block of bricks is pressed on another one, whose mesh does not match, and slides along it by a quarter of a facet a step, with
orthotropic friction.  Processor seconds of one thread, medians of the steps; the three problems take turns within one run.  The first
step, which sets up the solver, stands alone.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import ufl
from mpi4py import MPI

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh

from benchmarks.measurement import commit, now, timed
from dolfinx_contact.compat import functionspace
from dolfinx_contact.contact.mortar_points import MortarGeometry
from mechanics.material import elasticity
from mechanics.two_blocks import pair

# Facets along an edge of the contact, and layers of each body, by unknowns.
SIZES = {5000: (9, 5), 43000: (21, 10), 60000: (24, 11), 300000: (41, 21)}
WIDER = 1.25  # of the lower block
E, NU = 210e3, 0.3
DOWN, ASIDE = 0.01, (0.25, 0.1)  # of the top: length, and parts of a facet a step
SLIDING = ("rigid plane", "small", "large")


def block_on(sliding: str, size: int) -> SimpleNamespace:
    """A block on a rigid plane, or on another block with small or large sliding."""
    n, layers = SIZES[size]
    m = round(WIDER * n) + 1
    nodes = ((n + 1) ** 2 + (m + 1) ** 2) * (layers + 1)
    if sliding == "rigid plane":
        cells = (n, n, round(nodes / (n + 1) ** 2) - 1)
        box = [np.zeros(3), np.array([1.0, 1.0, 2.0])]
        domain = mesh.create_box(MPI.COMM_WORLD, box, cells, mesh.CellType.hexahedron)
        top, foot = (mesh.locate_entities_boundary(domain, 2, lambda x, z=z: np.isclose(x[2], z)) for z in (2.0, 0.0))  # fmt: skip
    else:
        domain, top, bottom, foot, below, _ = pair("hexahedron", ((n, n, layers), (m, m, layers)), (1.0, WIDER))  # fmt: skip
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, way = fem.Function(V), fem.Constant(domain, np.zeros(3))
    bcs = [fem.dirichletbc(way, fem.locate_dofs_topological(V, 2, top), V)]
    if sliding == "rigid plane":
        surface = dc.RigidPlane(point=np.zeros(3), normal=(0, 0, 1), axis=(1, 0, 0))
    else:
        bcs.append(fem.dirichletbc(np.zeros(3), fem.locate_dofs_topological(V, 2, bottom), V))
        surface = dc.DeformableSurface(V, below, axis=(1, 0, 0), sliding=sliding)
    contact = dc.Contact(V, foot, surface, dc.Friction((0.3, 0.15), (0.05, 0.2)))
    problem = dc.ContactProblem(elasticity(u, ufl.TestFunction(V), E, NU), u, [contact], bcs=bcs)
    return SimpleNamespace(problem=problem, contact=contact, way=way, facet=1.0 / n, rows=[])


class Projections:
    """Processor seconds and number of projections, since the last ``take``."""

    def __init__(self):
        self._seconds, self._count, self._placed, self._last = (
            0.0,
            0,
            MortarGeometry.projected,
            None,
        )
        MortarGeometry.projected = lambda *given: self._timed(*given)

    def _timed(self, *given):
        seconds, found = timed(self._placed, *given)
        self._seconds += seconds
        self._count += found is not self._last  # else it was known
        self._last = found
        return found

    def take(self) -> tuple[float, int]:
        taken = self._seconds, self._count
        self._seconds, self._count = 0.0, 0
        return taken


def measured(size: int, steps: int) -> list[dict]:
    """A row for each kind of sliding: the first step, and medians of ``steps`` others."""
    projections, made = Projections(), {}
    for sliding in SLIDING:
        seconds, made[sliding] = timed(block_on, sliding, size)
        made[sliding].made = seconds
    for step in range(steps + 1):
        for scene in made.values():
            aside = step * scene.facet * np.array(ASIDE)
            scene.way.value[:] = (*aside, -DOWN)
            projections.take()
            seconds, done = timed(scene.problem.solve)
            scene.rows.append((seconds, done.iterations, *projections.take()))
            scene.solver = str(done.solver)
    found = []
    for sliding, scene in made.items():
        first, *others = scene.rows
        seconds, iterations, projecting, projected = np.median(others, axis=0)
        found.append(dict(
            unknowns=scene.problem.body.size, nodes=scene.contact.nodes.size, sliding=sliding, solver=scene.solver,
            set_up=round(scene.made, 3), first_step=round(first[0], 3), step=round(seconds, 4), least=round(min(others)[0], 4), iterations=iterations,
            projections=projected, projecting=round(projecting, 4), share=round(projecting / seconds, 3),
        ))  # fmt: skip
        plain = found[0]["step"]
        found[-1]["to_rigid"] = round(seconds / plain, 2)
        scene.problem.close()
    return found


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[5000, 43000, 60000], choices=SIZES)
    parser.add_argument("--steps", type=int, default=6)
    parser.add_argument("--output", type=Path, default=Path("results/two_bodies.csv"))
    options = parser.parse_args(argv)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    for size in options.sizes:
        rows += [row | dict(measured=f"{now()[:10]}, {commit()}") for row in measured(size, options.steps)]  # fmt: skip
        with options.output.open("w", newline="") as file:
            table = csv.DictWriter(file, rows[0])
            table.writeheader()
            table.writerows(rows)
        for row in rows[-3:]:
            print(row, flush=True)


if __name__ == "__main__":
    main()
