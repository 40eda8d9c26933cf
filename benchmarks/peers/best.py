# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Peers at their best on the punch, case A: graded meshes of a quarter, bricks of first and second order.

What they are worth is taken from their displacements: the work of friction is that of the forces on their contact nodes, by
their own quadrature, along the slip of each step.
"""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem

from benchmarks.peers import by_calculix, by_getfem
from benchmarks.peers.compare import absent, by_system, told
from dolfinx_contact.compat import assemble_into
from dolfinx_contact.law.dissipation import frictional_work
from mechanics.material import elasticity
from studies.punch.limits import build, graded

CALCULIX, GETFEM = "CalculiX", "GetFEM"
# Of the bricks that each has: order, what CalculiX calls them, and Gauss points along each axis.
BRICKS = {
    f"{GETFEM}, Q1": (1, None, 2),
    f"{GETFEM}, Q2": (2, None, 3),
    f"{CALCULIX}, C3D8": (1, "C3D8", 2),
    f"{CALCULIX}, C3D20R": (2, "C3D20R", 2),
}
STIFF = 200.0  # penalty over Young's modulus, 1/mm; 50 takes a third of the time and costs 0.3 % of the force
SURFACE = "surface to surface"  # node to surface and mortar do not get through the first step on graded meshes


def best(peer: str, divisions: int, times: int, cap: int) -> dict:
    """One cycle of case A by a peer, with ``times`` the paper's increments: what its displacements are worth, and its processor seconds, set-up included."""
    if gone := absent(peer):
        return gone
    order, element, points = BRICKS[peer]
    punch, _ = build(graded(divisions, order=order))
    start = punch.parameters
    punch.restart(loading=times * start.loading, unloading=times * start.unloading)
    given = told(punch)
    if element is None:
        # Augmentation of E times the width of what belongs to a node: with one for all Q2 does not do a step on n = 4.
        width = np.sqrt(punch.contact.area)
        given |= dict(cap=cap, cell=1.0, alpha=width)
        found = by_system(by_getfem.__file__, given)
    else:
        found = by_calculix.solve(given | dict(element=element, stiff=STIFF), SURFACE, cap)
    row = dict(peer=peer, case="A", divisions=divisions, unknowns=unknowns(given, element), increments=len(given["programme"]),
        seconds=float(np.sum(found["seconds"])), done=len(found["u"]), said=str(found["said"]))  # fmt: skip
    if row["done"] < row["increments"]:
        return row
    return row | worth(punch, given, found["u"], element, points)


def unknowns(given: dict, element: str | None) -> int:
    """Displacements, without Lagrange multipliers and without the middles that C3D20R does not have."""
    return 3 * (len(given["x"]) - (len(middles(given["cells"])) if element == "C3D20R" else 0))


def middles(cells) -> dict[int, list]:
    """Nodes within faces and cells of 27 nodes: what the shape functions of 20 nodes say there, as (node, weight)."""
    found = {}
    grid = np.arange(27).reshape(3, 3, 3)  # z, y, x
    faces = [np.take(grid, end, axis) for axis in range(3) for end in (0, 2)]
    for cell in cells:
        for face in faces:
            corners, edges = face[::2, ::2].ravel(), face.ravel()[1::2]
            found[int(cell[face[1, 1]])] = [(int(cell[k]), -1 / 4) for k in corners] + [
                (int(cell[k]), 1 / 2) for k in edges
            ]
        corners = grid[::2, ::2, ::2].ravel()
        edges = [k for k in by_calculix.C3D20 if k not in corners]
        found[int(cell[13])] = [(int(cell[k]), -1 / 4) for k in corners] + [
            (int(cell[k]), 1 / 4) for k in edges
        ]
    return found


def worth(punch, given: dict, u, element: str | None, points: int) -> dict:
    """Forces when loaded, pressure at the centre and work of friction of displacements, ``shape=(steps, nodes, 3)``.

    On bricks of 20 nodes a uniform traction pulls at the corners the other way, so sums of magnitudes and the pressure of a node
    mean nothing there and are None; the work is then that of the mean of the forces at both ends of a step, which is less exact.
    """
    contact, of, friction = given["contact"], punch.contact, punch.contact.friction
    short = middles(given["cells"]) if element == "C3D20R" else {}
    forces_of = internal_forces(punch, short, points)
    work, loaded, slipped = 0.0, None, np.zeros(len(contact), bool)
    before = force = np.zeros((len(contact), 3))
    place = np.zeros((len(contact), 2))
    for number, nodes in enumerate(np.array(u), start=1):
        for node, weights in short.items():
            nodes[node] = sum(weight * nodes[k] for k, weight in weights)
        whole = forces_of(nodes)
        for node, k in given["held"]:
            whole[node, k] = 0.0  # of supports, not of the plane
        before, force = force, whole[contact]
        slip, place = nodes[contact, :2] - place, nodes[contact, :2].copy()
        if short:
            work -= float(((force + before)[:, :2] / 2 * slip).sum())
        else:
            work += float(frictional_work(friction, before, slipped, force, slip)[0].sum())
            slipped = np.linalg.norm(force[:, :2], axis=1) > 0.999 * given["mu"] * force[:, 2]
        if number == punch.parameters.loading:
            loaded = force
    centre = int(np.linalg.norm(of.x[:, :2], axis=1).argmin())
    return dict(
        normal=punch.parts * float(loaded[:, 2].sum()), dissipation=punch.parts * work,
        tangential=None if short else punch.parts * float(np.linalg.norm(loaded[:, :2], axis=1).sum()),
        centre=None if short else float(loaded[centre, 2] / of.area[centre]),
    )  # fmt: skip


def internal_forces(punch, short: dict, points: int):
    """A function of displacements: their nodal forces, by so many Gauss points along each axis."""
    v, own = ufl.TestFunction(punch.V), punch.parameters
    dx = ufl.dx(domain=punch.mesh, metadata={"quadrature_degree": 2 * points - 1})
    form = fem.form(elasticity(punch.u, v, own.young, own.poisson, dx))
    assembled = fem.Function(punch.V)

    def of(nodes):
        punch.u.x.array[:] = nodes.ravel()
        assemble_into(assembled.x, form)
        force = assembled.x.array.reshape(-1, 3).copy()
        for node, weights in short.items():
            for k, weight in weights:
                force[k] += weight * force[node]
            force[node] = 0.0
        return force

    return of
