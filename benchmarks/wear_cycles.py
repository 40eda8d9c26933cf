# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A million cycles of fretting wear by ``dc.cycle_jump``; the table of docs/howto/wear.md.

    python -m benchmarks.wear_cycles [name ...]      (all by default; some minutes on one core)

The paper's punch, cases A and C, and a cylinder in partial slip, each under a dead weight on a plane that goes to and fro.  Units: mm,
N, MPa.  Beside them the same programmes in 300 cycles, simulated one by one, with so many times the coefficient.
"""

from __future__ import annotations

import sys
import warnings
from time import perf_counter

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from dolfinx import mesh
from mpi4py import MPI

from mechanics import scenes
from studies.punch.model import Parameters, Punch

CYCLES, ACCURACY = 10**6, 0.02
TRUE = 300  # cycles simulated one by one


def cycle_of(problem, stroke: float, quarter: int):
    """Middle, right, left, middle, in ``quarter`` steps each; displacement of the plane along its axis."""
    plane = problem.contacts[0].surface
    ways = stroke * np.interp(np.arange(1, 4 * quarter + 1) / quarter, [0, 1, 3, 4], [0, 1, -1, 0])

    def cycle(done):
        for way in ways:
            moved = np.array(plane.displacement)
            moved[0] = way
            plane.displacement = moved
            problem.solve()

    return cycle


def punch(case: str, coefficient: float):
    """Of steel, under 100 kN, slid by 0.05 mm to either side."""
    problem = Punch(Parameters(case=case), divisions=4).problem
    return problem, settled(problem, (0, 0, 1e5), 0.05, 1, coefficient)


def cylinder(_, coefficient: float):
    """In plane strain, 64 by 16 cells, radius 100 mm, a contact of some 2 mm; a stroke that slides its edges alone."""
    cells = mesh.create_rectangle(MPI.COMM_WORLD, [[-1, 0], [1, 1]], [64, 16], mesh.CellType.quadrilateral)  # fmt: skip
    bottom, top = (mesh.locate_entities_boundary(cells, 1, lambda x, y=y: np.isclose(x[1], y)) for y in (0, 1))  # fmt: skip
    x = cells.geometry.x
    x[:, 0] = 8 * np.sinh(3 * x[:, 0]) / np.sinh(3)
    x[:, 1] = 8 * np.sinh(3 * x[:, 1]) / np.sinh(3)
    x[:, 1] += x[:, 0] ** 2 / 200 * (1 - x[:, 1] / 8)
    scene = scenes.on_plane(cells, bottom, top, 210e3, 0.3, 0.3, loads=False)
    problem = scenes.problem_of(scene)
    return problem, settled(problem, (0, 2000.0), 0.0015, 2, coefficient)


def settled(problem, weight, stroke: float, quarter: int, coefficient: float):
    """Press by a weight, go through two cycles without wear, then let it wear; the cycle."""
    contact = problem.contacts[0]
    contact.surface.free, contact.surface.force = ("n",), weight
    problem.solve()
    cycle = cycle_of(problem, stroke, quarter)
    for done in range(2):
        cycle(done)
    contact.wear = dc.Wear(coefficient)
    return cycle


PROGRAMMES = {
    "punch, case A": (punch, "A", 1e-8),
    "punch, case C": (punch, "C", 1e-8),
    "cylinder in partial slip": (cylinder, None, 1e-8),
}


def main(names) -> None:
    """Print a row for each programme."""
    for name in names or PROGRAMMES:
        make, case, coefficient = PROGRAMMES[name]
        problem, cycle = make(case, coefficient)
        start = perf_counter()
        found = dc.cycle_jump(problem, cycle, CYCLES, ACCURACY)
        seconds = perf_counter() - start
        status = problem.counts()
        print(f"{name}: {problem.body.size} unknowns, {CYCLES} cycles: {found.simulated} simulated, {found.rejected} jumps "
              f"rejected, {seconds:.0f} s; depth {found.depth:.3g} mm, volume {found.volume:.3g} mm^3, estimated errors {found.volume_error:.1e} "
              f"(volume) {found.profile_error:.1e} (profile); {status}", flush=True)  # fmt: skip
        factor = CYCLES / TRUE
        truth, cycle = make(case, factor * coefficient)
        start = perf_counter()
        for done in range(TRUE):
            cycle(done)
        contact, seconds = truth.contacts[0], perf_counter() - start
        sides = problem.contacts[0].wear_depth, contact.wear_depth
        off, volume = contact.area @ (sides[0] - sides[1]), contact.area @ sides[1]
        print(f"    {TRUE} cycles one by one with {factor:.3g} times the coefficient, {seconds:.0f} s: volume {volume:.3g}, off by {off / volume:+.1e}, "
              f"depth {sides[1].max():.3g}, off by {(sides[0].max() / sides[1].max() - 1):+.1e}", flush=True)  # fmt: skip


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(sys.argv[1:])
