# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact results along a line or curve on the contact surface."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.results.meshes import Mesh, SurfaceMesh
from dolfinx_contact.support.checks import a_problem, finite, place
from dolfinx_contact.support.collective import by_first_rank, raised_together

if TYPE_CHECKING:
    from dolfinx_contact.problem import ContactProblem

# Subdivision of a facet into lines or triangles between its nodes (local indices), by VTK's cell
# type.
VTK_PIECES = {
    3: [(0, 1)],
    21: [(0, 2), (2, 1)],
    5: [(0, 1, 2)],
    22: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
    9: [(0, 1, 2), (0, 2, 3)],
    28: [(0, 4, 8), (0, 8, 7), (4, 1, 5), (4, 5, 8), (8, 5, 2), (8, 2, 6), (7, 8, 6), (7, 6, 3)],
}

# Quantities that can be interpolated between nodes.  Nodal forces and nodal dissipation cannot:
# they are integrals.
PROFILE_NAMES = ("pressure", "shear_traction", "gap", "slip", "wear_depth", "displacement")


def profile(
    problem: ContactProblem,
    points: ArrayLike,
    path: str | PathLike[str] | None = None,
    *,
    contact: int = 0,
) -> dict[str, np.ndarray]:
    """Return contact results, interpolated at points of the contact surface.  Collective.

    Args:
        problem: The ContactProblem.
        points: Positions on the undeformed contact surface, in the order along the curve,
            ``shape=(k, gdim)``, global frame, length units.  Results are those at the nearest
            points of the surface.
        path: CSV file to which the table is also written; with None, no file is written.
        contact: Index of the contact.

    Returns:
        Columns of the table by name, ``shape=(k,)``, the same on all ranks: ``s``, the arc length
        along the points; ``x``, ``y``, ``z``; ``pressure``; ``shear_traction_x``, ...; ``gap``;
        ``slip_x``, ...; ``wear_depth``; ``displacement_x``, ...; ``status``, that is, the status of
        the nearest node.  Vectors are in global components.

    Raises:
        ValueError: on all ranks, if ``points`` have another shape, or the distance of a point from
            the surface exceeds the size of a facet.
        OSError: on all ranks, if the file cannot be written.

    Example:
        >>> line = np.linspace([0, 0.5, 0], [1, 0.5, 0], 50)
        >>> dc.profile(problem, line)["pressure"].shape
        (50,)
    """
    comm = a_problem(problem).body.comm
    with raised_together(comm):
        if contact not in range(len(problem.contacts)):
            raise ValueError(f"contact {contact!r}: the problem has {len(problem.contacts)}.")
        at, gdim = finite("points", points), problem.contacts[contact].points.dim
        if at.ndim != 2 or at.shape[1] != gdim or not len(at):
            raise ValueError(f"points must have shape (k, {gdim}), got {at.shape}.")
    mesh = SurfaceMesh(problem.contacts[contact])(problem.u)
    at = np.pad(at, ((0, 0), (0, 3 - gdim)))
    return by_first_rank(comm, lambda _: _written(_table(mesh, at), path))


def _table(mesh: Mesh, at: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of the table by name.

    Args:
        mesh: Mesh of the contact surface with its nodal values.
        at: Positions along the curve, ``shape=(k, 3)``, global frame, length.

    Raises:
        ValueError: a position is too far from the surface.
    """
    pieces = [
        mesh.cells[kind][:, VTK_PIECES[kind]].reshape(-1, len(VTK_PIECES[kind][0]))
        for kind in mesh.cells
    ]
    pieces = np.concatenate(pieces)
    found = [_nearest(mesh.x[pieces], point) for point in at]
    nodes = pieces[[piece for piece, _ in found]]
    weights = np.array([weights for _, weights in found])
    steps = np.linalg.norm(np.diff(at, axis=0), axis=1)
    table = {"s": np.concatenate(([0.0], np.cumsum(steps)))} | dict(zip("xyz", at.T))
    for name in PROFILE_NAMES:
        values = np.einsum("kj,kj...->k...", weights, mesh.at_nodes[name][nodes])
        table |= (
            {name: values}
            if values.ndim == 1
            else {f"{name}_{axis}": column for axis, column in zip("xyz", values.T)}
        )
    nearest = np.take_along_axis(nodes, weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    return table | {"status": mesh.at_nodes["status"][nearest]}


def _nearest(corners: np.ndarray, point: np.ndarray) -> tuple[int, np.ndarray]:
    """Return the line or triangle nearest to a point, and interpolation weights of its corners.

    Args:
        corners: Positions of the corners of lines or triangles, ``shape=(m, 2 or 3, 3)``.
        point: Position, ``shape=(3,)``.

    Returns:
        Index of the line or triangle, and the weights of its corners, which are not negative and
        sum up to one.

    Raises:
        ValueError: the distance of the point exceeds the size of the line or triangle.
    """
    sides = corners[:, 1:] - corners[:, :1]
    square = sides @ sides.transpose(0, 2, 1)
    along = np.einsum("mij,mj->mi", sides, point - corners[:, 0])
    inner = np.linalg.solve(square, along[..., None])[..., 0]
    weights = np.maximum(np.column_stack((1.0 - inner.sum(axis=1), inner)), 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    away = np.linalg.norm(np.einsum("mj,mjk->mk", weights, corners) - point, axis=1)
    k = int(away.argmin())
    if away[k] > np.linalg.norm(sides[k], axis=1).max():
        raise ValueError(
            f"points: {place(point[None], 0)} is {away[k]:.3g} away from the contact surface, farther than a facet is large. Give points "
            f"on the undeformed surface; the nearest is {place((weights[k] @ corners[k])[None], 0)}."
        )
    return k, weights[k]


def _written(table: dict[str, np.ndarray], path: Any) -> dict[str, np.ndarray]:
    if path is not None:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        rows, header = np.column_stack(list(table.values())), ",".join(table)
        np.savetxt(path, rows, fmt="%.12g", delimiter=",", header=header, comments="")
    return table
