# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Two elastic cylinders by us, GetFEM and CalculiX: error of pressure and shear against seconds.

Bodies, mesh and closed forms are those of ``demos/demo_two_cylinders.py``: pressed in a step, sheared in four more.  All are judged
by the forces on the nodes of the face that their displacements are worth.
"""

from __future__ import annotations

import demo_two_cylinders as demo
import numpy as np

from benchmarks.measurement import Measurement, timed
from benchmarks.peers import by_calculix, pair_by_getfem
from benchmarks.peers.compare import absent, by_system
from benchmarks.report import drawing
from benchmarks.tables import chosen

TITLE = "Two elastic cylinders beside GetFEM and CalculiX"
CAPTION = (
    "Two elastic cylinders, pressed in a step and sheared in four: error of the largest pressure [Hertz] and of the shear "
    "tractions in L2 [Cattaneo, Mindlin] against the processor seconds of all steps, set-up included, on meshes of "
    "quadrilaterals of first order."
)
OURS, GETFEM, CALCULIX = (
    "dolfinx_contact",
    "GetFEM, integral contact",
    "CalculiX, surface to surface",
)
STIFF = 100.0  # CalculiX' penalty over r = E / a, of both bodies' mean, with which GetFEM augments
CAP = 600  # processor seconds of CalculiX
STROKE = demo.A**2 / (2 * demo.R)
PROGRAMME = [(way * STROKE, -3.4 * STROKE) for way in np.linspace(0, 1.1, 5)]


def plan(size: str) -> list[Measurement]:
    return [
        Measurement(f"cylinders/{peer} {cells}", "benchmarks.peers.two_cylinders:measured", dict(peer=peer, cells=cells))
        for cells in dict(full=(10, 20, 40), quick=(10, 20), smallest=(10,))[size]
        for peer in (OURS, GETFEM, CALCULIX)
    ]  # fmt: skip


def measured(peer: str, cells: int) -> dict:
    """Errors of the pressure after the first step, of shear after the last, and the seconds of a peer."""
    if peer != OURS and (gone := absent(peer)):
        return gone
    demo.problem_of(4)[0].close()  # its forms are compiled
    seconds, (problem, held) = timed(demo.problem_of, cells)
    row = dict(peer=peer, cells=cells, unknowns=problem.body.size)
    if peer == OURS:
        steps = [timed(pressed, problem, held, way) for way in PROGRAMME]
        found = dict(u=[u for _, u in steps], seconds=[seconds, *(s for s, _ in steps)], said="")
    else:
        given = told(problem)
        found = by_system(pair_by_getfem.__file__, given) if peer == GETFEM else with_calculix(given)  # fmt: skip
    row |= dict(seconds=float(np.sum(found["seconds"])), done=len(found["u"]), said=str(found["said"]))  # fmt: skip
    return row | (judged(problem, found["u"]) if len(found["u"]) == len(PROGRAMME) else {})


def pressed(problem, held, way) -> np.ndarray:
    held.value[:] = way
    problem.solve()
    return problem.u.x.array.reshape(-1, 2).copy()


def judged(problem, steps) -> dict:
    """Errors of what displacements are worth, ``shape=(steps, nodes, 2)``."""
    contact, rows = problem.contacts[0], []
    for u in (steps[0], steps[-1]):
        forces = problem.body.internal_force(np.ravel(u))[contact.points.dofs]
        x, forces, area = demo.along_face(contact, forces, contact.area)
        rows.append((x, area, *forces.sum(axis=0), *(forces / area[:, None]).T))
    (_, _, _, P, _, p), (x, area, Q, P_end, q, _) = rows
    closed = demo.closed_shear(x, P_end, Q)
    return dict(
        peak=abs(p.max() / (2 * P / (np.pi * demo.half_width(P))) - 1), ratio=abs(Q) / (demo.MU * P_end),
        shear=float(np.sqrt((q - closed) ** 2 @ area / (closed**2 @ area))), force=float(P),
    )  # fmt: skip


def told(problem) -> dict:
    """All that a peer is told; nodes of a cell by y, then x of the reference cell."""
    V, contact = problem.u.function_space, problem.contacts[0]
    x, count = V.tabulate_dof_coordinates()[:, :2], V.mesh.topology.index_map(2).size_local
    cells = np.array([V.dofmap.cell_dofs(k) for k in range(count)])
    above = x[cells, 1].mean(axis=1) > 0
    far = np.flatnonzero(np.isclose(np.abs(x).max(axis=1), demo.L))
    young = [2 * G * (1 + nu) for G, nu in zip(demo.SHEAR, demo.NU)]
    return dict(
        x=x, cells=cells, above=above, near=np.union1d(contact.nodes, contact.geometry.opposite),
        far=far, mu=demo.MU, programme=np.array(PROGRAMME),
        young=young, poisson=demo.NU, r=np.mean(young) / demo.A,
    )  # fmt: skip


def with_calculix(given: dict) -> dict:
    """An input file with a step of CalculiX for each step, run."""
    x, cells, above = given["x"], given["cells"][:, by_calculix.C3D8[:4]], given["above"]
    turned = np.linalg.det(x[cells[:, [1, 3]]] - x[cells[:, :1]]) < 0
    cells[turned] = cells[turned, ::-1]
    penalty = STIFF * given["r"]
    edges = np.isin(np.stack((cells, np.roll(cells, -1, axis=1))), given["near"]).all(axis=0)
    lines = ["*NODE, NSET=NBODY", *by_calculix.numbered(1, np.insert(x, 2, 0.0, axis=1), ".12e")]
    for name, which, young, nu in zip(("UP", "LOW"), (above, ~above), given["young"], given["poisson"]):  # fmt: skip
        of = np.flatnonzero(which)
        held = np.intersect1d(given["far"], cells[of])
        lines += [
            f"*ELEMENT, TYPE=CPE4, ELSET=E{name}", *(f"{k + 1}, {', '.join(map(str, cells[k] + 1))}" for k in of),
            f"*MATERIAL, NAME=M{name}", "*ELASTIC", f"{young:.10e}, {nu:.10e}", f"*SOLID SECTION, ELSET=E{name}, MATERIAL=M{name}", "1.",
            f"*SURFACE, NAME=S{name}, TYPE=ELEMENT", *(f"{k + 1}, S{side + 1}" for k in of for side in np.flatnonzero(edges[k])),
            f"*NSET, NSET=N{name}", *(f"{node + 1}," for node in held),
        ]  # fmt: skip
    lines += [
        "*SURFACE INTERACTION, NAME=RUB", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{penalty:.6e}, {1e-9 * penalty * demo.A:.6e}",
        "*FRICTION", f"{given['mu']:.10e}, {penalty:.6e}", "*CONTACT PAIR, INTERACTION=RUB, TYPE=SURFACE TO SURFACE", "SUP, SLOW",
        "*BOUNDARY", "NLOW, 1, 2",
    ]  # fmt: skip
    for way in given["programme"]:
        lines += ["*STEP, INC=1000", "*STATIC", "1., 1.", "*BOUNDARY", *(f"NUP, {k}, {k}, {a:.12e}" for k, a in enumerate(way, start=1)),
            "*NODE PRINT, NSET=NBODY, FREQUENCY=1000", "U", "*END STEP"]  # fmt: skip
    found = by_calculix.run(lines, len(x), len(given["programme"]), CAP)
    return found | dict(u=found["u"][..., :2])


def evaluate(results: dict) -> dict:
    rows = list(results.values())
    return dict(rows=[row for row in rows if "absent" not in row], absent=[row["absent"] for row in rows if "absent" in row])  # fmt: skip


def figure(data):
    """Errors against seconds, a line for each code."""
    figure, axes = drawing.panels(2)
    for peer, style in ((OURS, "o-"), (GETFEM, "s--"), (CALCULIX, "^:")):
        rows = [row for row in data["rows"] if row["peer"] == peer]
        for ax, key in zip(axes, ("peak", "shear")):
            ax.plot(drawing.column(rows, "seconds"), drawing.column(rows, key), style, label=peer)
    for ax, label in zip(axes, ("error of the largest pressure", "error of shear in L2")):
        drawing.logarithmic(ax)
        ax.set(xlabel="processor seconds", ylabel=label)
    drawing.legend(figure, axes[0])
    return figure


def tables(data):
    titles = dict(peer="code", unknowns="unknowns", seconds="seconds of five steps", peak="largest pressure off by", shear="shear off by, L2", done="steps done", said="said")  # fmt: skip
    yield [{"not compared": text} for text in sorted(set(data["absent"]))]
    yield chosen(data["rows"], titles)
