# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Wear over many cycles by ``dc.cycle_jump``: the tables of docs/howto/wear.md.

    python -m benchmarks.wear_cycles truth 1000 [name ...]  (so many cycles one by one: a minute or two each; writes TRUTH)
    python -m benchmarks.wear_cycles million [name ...]     (the same wear in a million cycles, in jumps: seconds each)

Small programmes: the paper's punch and cylinders on planes that go to and fro, under a dead weight, and others.  Units: mm, N, MPa.  For the
report: errors of jumps of several accuracies, beside those that were estimated, and of jumps of fixed length with explicit wear.
"""

from __future__ import annotations

import json
import sys
import warnings
from time import process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from dolfinx import mesh
from mpi4py import MPI

from benchmarks.measurement import ROOT
from mechanics import scenes
from studies.punch.model import Parameters, Punch

CYCLES, ACCURACY = 10**6, 0.02
ACCURACIES, FIXED = (0.05, 0.02, 0.01), (10, 25, 50, 100, 200)
TRUTH = ROOT / "notes" / "records" / "wear-truth-2026-11-28.json"


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


PROGRAMMES = {  # of the coefficient, and that times the cycles; the first three are those for which jumps were developed
    "cylinder in partial slip": (lambda k: cylinder((24, 6), k, 0.002, 1), 1e-2),
    "punch, case C": (lambda k: punch("C", k, 2), 1e-2),
    "block at a given approach": (block, 7.5e-3),
    "punch, case A": (lambda k: punch("A", k, 2), 1e-2),
    "friction that grows": (growing, 1e-2),
    "cylinder in gross slip": (lambda k: cylinder((24, 6), k, 0.05, 1), 2e-2),
}


def programme(name: str, cycles: int):
    """Its problem, and its cycle, of which so many wear as much as any number does."""
    make, wear = PROGRAMMES[name]
    return make(wear / cycles)


def off(contact, truth) -> dict[str, float]:
    """Errors of the contact's worn depth, as ``CycleJump`` has them."""
    depth, area = truth, contact.area
    by, volume = contact.wear_depth - depth, area @ depth
    return dict(volume=abs(area @ by) / volume, depth=np.abs(by).max() / depth.max(), profile=area @ np.abs(by) / volume)  # fmt: skip


def one_by_one(name: str, cycles: int) -> dict:
    """So many cycles: ``depth`` of the nodes, processor ``seconds``, and cycles, volume and largest depth in ``rows``."""
    problem, cycle = programme(name, cycles)
    contact, rows, start = problem.contacts[0], [], process_time()
    for done in range(1, cycles + 1):
        cycle(done - 1)
        if done in (cycles // 10, 3 * cycles // 10, cycles):
            depth = contact.wear_depth
            rows.append([done, float(contact.area @ depth), float(depth.max())])
    return dict(depth=depth, rows=rows, seconds=process_time() - start)


def measured(name: str, cycles: int):
    """Rows of a small programme: errors of jumps of several accuracies beside those that are estimated, and of explicit jumps of fixed length."""
    run = one_by_one(name, cycles)
    for key, of in [("accuracy", of) for of in ACCURACIES] + [
        ("jump", of) for of in FIXED if of <= cycles
    ]:
        problem, cycle = programme(name, cycles)
        start, contact = process_time(), problem.contacts[0]
        try:
            row = jumped(problem, cycle, cycles, of) if key == "accuracy" else fixed(contact, cycle, cycles, of)  # fmt: skip
        except (RuntimeError, dc.NotConverged):  # more cycles than it may simulate
            continue
        row |= {"seconds": process_time() - start, "true": off(contact, run["depth"]), "one_by_one": run["seconds"]}  # fmt: skip
        yield {"programme": name, key: of} | row


def jumped(problem, cycle, cycles: int, accuracy: float) -> dict:
    found = dc.cycle_jump(problem, cycle, cycles, accuracy)
    estimated = {of: getattr(found, f"{of}_error") for of in ("volume", "depth", "profile")}
    return dict(simulated=found.simulated, estimated=estimated)


def fixed(contact, cycle, cycles: int, jump: int) -> dict:
    contact.wear = dc.Wear(contact.wear.coefficient, explicit=True)
    for done in range(0, cycles, jump):
        contact.repeats = min(jump, cycles - done)
        cycle(done)
    return dict(simulated=-(-cycles // jump))


def million(*names: str) -> None:
    """Print a row for each programme, and how far the jumps were off from the truth."""
    record = json.loads(TRUTH.read_text())
    for name in names or PROGRAMMES:
        problem, cycle = programme(name, CYCLES)
        start = process_time()
        found = dc.cycle_jump(problem, cycle, CYCLES, ACCURACY)
        print(f"{name}: {problem.body.size} unknowns, {process_time() - start:.1f} s; {found}")
        cycles, volume, depth = record[name][-1]
        print(f"    beside {cycles} cycles: volume off by {found.volume / volume - 1:+.1e}, largest depth by {found.depth / depth - 1:+.1e}", flush=True)  # fmt: skip


def truth(cycles: str, *names: str) -> None:
    """Simulate so many cycles one by one; the record has cycles, volume and largest depth of each programme."""
    for name in names or PROGRAMMES:
        rows = one_by_one(name, int(cycles))["rows"]
        # as it is now: another process may have written
        record = json.loads(TRUTH.read_text()) if TRUTH.exists() else {}
        TRUTH.write_text(json.dumps(record | {name: rows}) + "\n")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    {"million": million, "truth": truth}[sys.argv[1]](*sys.argv[2:])
