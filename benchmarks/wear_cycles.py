# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Wear over many cycles by ``dc.cycle_jump``: the tables of docs/howto/wear.md.

    python -m benchmarks.wear_cycles million [name ...]     (some minutes each on one core)
    python -m benchmarks.wear_cycles errors [name ...]      (all by default; results/wear_cycles.json and .svg)

``million``: the paper's punch, cases A and C, and a cylinder in partial slip, each under a dead weight on a plane that goes to and fro.
Units: mm, N, MPa.  Beside them the same programmes in 300 cycles, simulated one by one, with so many times the coefficient.

``errors``: small programmes of 1,000 cycles, which are also simulated one by one; errors of jumps of several accuracies, beside those
that were estimated, and of jumps of fixed length with explicit wear.
"""

from __future__ import annotations

import json
import sys
import warnings
from time import perf_counter, process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from dolfinx import mesh
from matplotlib.figure import Figure
from mpi4py import MPI

from benchmarks.measurement import ROOT
from mechanics import scenes
from studies.punch.model import Parameters, Punch

CYCLES, ACCURACY = 10**6, 0.02
TRUE = 300  # cycles simulated one by one
SMALL, ACCURACIES, FIXED = 1000, (0.05, 0.02, 0.01, 0.005), (10, 25, 50, 100, 200)
RECORD = ROOT / "results" / "wear_cycles.json"


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


def punch(case: str, coefficient: float, divisions: int = 4):
    """Of steel, under 100 kN, slid by 0.05 mm to either side."""
    problem = Punch(Parameters(case=case), divisions=divisions).problem
    return problem, settled(problem, (0, 0, 1e5), 0.05, 1, coefficient)


def cylinder(size, coefficient: float, stroke: float = 0.0015, quarter: int = 2):
    """In plane strain, of so many cells, radius 100 mm, a contact of some 2 mm; by default a stroke that slides its edges alone."""
    cells = mesh.create_rectangle(MPI.COMM_WORLD, [[-1, 0], [1, 1]], size, mesh.CellType.quadrilateral)  # fmt: skip
    bottom, top = (mesh.locate_entities_boundary(cells, 1, lambda x, y=y: np.isclose(x[1], y)) for y in (0, 1))  # fmt: skip
    x = cells.geometry.x
    x[:, 0] = 8 * np.sinh(3 * x[:, 0]) / np.sinh(3)
    x[:, 1] = 8 * np.sinh(3 * x[:, 1]) / np.sinh(3)
    x[:, 1] += x[:, 0] ** 2 / 200 * (1 - x[:, 1] / 8)
    scene = scenes.on_plane(cells, bottom, top, 210e3, 0.3, 0.3, loads=False)
    problem = scenes.problem_of(scene)
    return problem, settled(problem, (0, 2000.0), stroke, quarter, coefficient)


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
    "cylinder in partial slip": (cylinder, (64, 16), 1e-8),
}


def block(coefficient: float):
    """Held by its top at a given approach, E = 1 GPa: it wears until it does not touch any more."""
    scene = scenes.block(cells=(4, 4, 2), mu=0.3, p=None, E=1000.0, tol=1e-8)
    scene.move_top(0, 0, -0.01)
    scene.problem.solve()
    cycle = cycle_of(scene.problem, 0.2, 1)
    cycle(0)
    scene.contact.wear = dc.Wear(coefficient)
    return scene.problem, cycle


def growing(coefficient: float):
    """A pad under a dead weight whose friction grows with the worn depth, to more than twice."""
    scene = scenes.block(cells=(6, 3), mu=0.3, p=None, E=1000.0, tol=1e-8)
    scene.contact.friction = dc.Friction(lambda x, wear_depth: 0.3 * (1 + wear_depth / 2e-3))
    return scene.problem, settled(scene.problem, (0, 1.0), 0.2, 1, coefficient)


ERRORS = {  # the first three are those for which jumps were developed
    "cylinder in partial slip": lambda: cylinder((24, 6), 1e-5, 0.002, 1),
    "punch, case C": lambda: punch("C", 1e-5, 2),
    "block at a given approach": lambda: block(7.5e-6),
    "punch, case A": lambda: punch("A", 1e-5, 2),
    "friction that grows": lambda: growing(1e-5),
    "cylinder in gross slip": lambda: cylinder((24, 6), 2e-5, 0.05, 1),
}


def off(contact, truth) -> dict[str, float]:
    """Errors of the contact's worn depth, as ``CycleJump`` has them."""
    depth, area = truth, contact.area
    by, volume = contact.wear_depth - depth, area @ depth
    return dict(volume=abs(area @ by) / volume, depth=np.abs(by).max() / depth.max(), profile=area @ np.abs(by) / volume)  # fmt: skip


def true_depth(name: str) -> np.ndarray:
    """Depths after all cycles one by one, kept."""
    file = RECORD.parent / "wear_cycles" / f"{name}.npy"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        problem, cycle = ERRORS[name]()
        for done in range(SMALL):
            cycle(done)
        np.save(file, problem.contacts[0].wear_depth)
    return np.load(file)


def errors(names) -> None:
    """Measure, print and draw errors of jumps."""
    rows = []
    for name in names or ERRORS:
        truth = true_depth(name)
        for accuracy in ACCURACIES:
            problem, cycle = ERRORS[name]()
            start = process_time()
            try:
                found = dc.cycle_jump(problem, cycle, SMALL, accuracy)
            except RuntimeError:  # more cycles than it may simulate
                continue
            seconds = process_time() - start
            estimated = {of: getattr(found, f"{of}_error") for of in ("volume", "depth", "profile")}
            rows.append(dict(programme=name, accuracy=accuracy, simulated=found.simulated, seconds=seconds, estimated=estimated, true=off(problem.contacts[0], truth)))  # fmt: skip
            print(rows[-1], flush=True)
        for jump in FIXED:
            problem, cycle = ERRORS[name]()
            contact, start = problem.contacts[0], process_time()
            contact.wear, contact.repeats = dc.Wear(contact.wear.coefficient, explicit=True), jump
            try:
                for done in range(0, SMALL, jump):
                    cycle(done)
            except dc.NotConverged:
                continue
            rows.append(dict(programme=name, jump=jump, simulated=SMALL // jump, seconds=process_time() - start, true=off(contact, truth)))  # fmt: skip
            print(rows[-1], flush=True)
    RECORD.write_text(json.dumps(rows, indent=0))
    draw(rows).savefig(RECORD.with_suffix(".svg"))


def draw(rows) -> Figure:
    """Error of the profile against seconds: jumps of fixed length with explicit wear, and controlled ones."""
    names = list(dict.fromkeys(row["programme"] for row in rows))
    figure = Figure(figsize=(12, 6.5), layout="constrained")
    axes = figure.subplots(2, -(-len(names) // 2), squeeze=False).ravel()
    for ax, name in zip(axes, names):
        for key, style, label in (
            ("jump", "o--", "explicit, fixed"),
            ("accuracy", "s-", "cycle_jump"),
        ):
            some = [row for row in rows if row["programme"] == name and key in row]
            ax.loglog([row["seconds"] for row in some], [row["true"]["profile"] for row in some], style, label=label)  # fmt: skip
        ax.set(title=name, xlabel="processor seconds", ylabel="error of the worn profile")
    axes[0].legend()
    return figure


def million(names) -> None:
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
    {"million": million, "errors": errors}[sys.argv[1]](sys.argv[2:])
