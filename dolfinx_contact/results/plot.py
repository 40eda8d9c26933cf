# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Picture of a problem in its present state.

The data are gathered here.  ``draw.py`` draws the picture in a separate process.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.results.meshes import BodyMesh, Mesh, SurfaceMesh
from dolfinx_contact.support.checks import a_field, a_problem, finite
from dolfinx_contact.support.collective import raised_together

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.problem import ContactProblem

# Grid on which the distance from a surface is evaluated for drawing: number of points per
# direction, by dimension, and margin around the contact nodes, relative to their extent.
GRID_POINTS = {2: 400, 3: 60}
GRID_MARGIN = 0.15


def plot(
    problem: ContactProblem,
    path: str | PathLike[str],
    *,
    colour: Any = None,
    title: str = "",
    factor: float = 1.0,
) -> None:
    """Draw the body, the status of the contact nodes, and the rigid surfaces.  Collective.

    The picture shows the present state.  PyVista is required (``pip install pyvista``), a display
    is not.  A three-dimensional body is viewed from below the contact, through the transparent
    surface.  Two bodies in contact are drawn translucent.

    Args:
        problem: The ContactProblem.
        path: File of the picture, ``*.png``.
        colour: Field by which the body is coloured: a scalar Function of a Lagrange space or
            another scalar UFL expression, such as the von Mises stress.
        title: Title of the colour bar.
        factor: Magnification of the displacements of bodies and surfaces; rotations of surfaces are
            not magnified.

    Raises:
        ValueError: on all ranks, if ``path`` does not end in ``.png``, ``colour`` is not scalar, or
            ``factor`` is not finite.
        ModuleNotFoundError: on all ranks, if PyVista is not installed.
        RuntimeError: on all ranks, if PyVista cannot draw the picture; the message contains its
            error output.

    Example:
        >>> dc.plot(problem, "block.png", factor=20)  # doctest: +SKIP
    """
    comm, contacts, u = a_problem(problem).body.comm, problem.contacts, problem.u
    with raised_together(comm):
        finite("factor", factor)
        if Path(path).suffix != ".png":
            raise ValueError(f"path must end in .png, got {str(path)!r}.")
        if colour is not None and a_field("colour", colour).ufl_shape != ():
            raise ValueError(f"colour must be a scalar, got one of shape {colour.ufl_shape}.")
        if comm.rank == 0 and find_spec("pyvista") is None:
            raise ModuleNotFoundError("dc.plot needs PyVista: pip install pyvista.")
    body = BodyMesh(contacts[0].displacements)(u, {} if colour is None else {"colour": colour})
    foot = [SurfaceMesh(contact)(u) for contact in contacts]
    with raised_together(comm):
        if comm.rank == 0:
            _draw(Path(path), title, _seen(contacts, body, foot, factor))


def _draw(path: Path, title: str, seen: dict[str, np.ndarray]) -> None:
    """Draw the picture in a separate process, since libraries of VTK and DOLFINx can conflict.

    Args:
        path: File of the picture.
        title: Title of the colour bar.
        seen: Input of ``draw.py``, as returned by ``_seen``.

    Raises:
        RuntimeError: PyVista cannot draw the picture.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "seen.npz"
        np.savez(file, **seen)
        command = [
            sys.executable,
            str(Path(__file__).with_name("draw.py")),
            str(file),
            str(path),
            title,
        ]
        done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        missing = (
            ": without a display VTK needs EGL, apt install libegl1" if "EGL" in done.stderr else ""
        )
        raise RuntimeError(f"PyVista could not draw {path}{missing}: {done.stderr[-2000:]}")


def _seen(
    contacts: Sequence[Contact], body: Mesh, foot: list[Mesh], factor: float
) -> dict[str, np.ndarray]:
    """Return the input of ``draw.py``: positions, cells, colours and surfaces as arrays, by name.

    Args:
        contacts: The contacts of the problem.
        body: Mesh of the body with its nodal and cell values.
        foot: Mesh of the surface of each contact.
        factor: Magnification of the displacements.
    """
    seen = {"x": _displaced(body, factor), "view": np.zeros(0)}
    if any(contact.surface.deformable for contact in contacts) and contacts[0].points.dim == 3:
        seen["between"] = np.ones(1)  # the nodes are between two bodies
    for kind, cells in body.cells.items():
        seen[f"cells{kind}"] = cells
    for values in (body.at_nodes, body.at_cells):
        if "colour" in values:
            seen["colour"] = values["colour"]
    touching = [mesh.at_nodes["contact_node"] == 1 for mesh in foot]
    seen["nodes"] = np.concatenate(
        [_displaced(mesh, factor)[at] for mesh, at in zip(foot, touching)]
    )
    seen["status"] = np.concatenate(
        [mesh.at_nodes["status"][at] for mesh, at in zip(foot, touching)]
    )
    for k, (contact, mesh) in enumerate(zip(contacts, foot)):
        box, found = _distances(contact, _displaced(mesh, factor), factor)
        if np.isfinite(found).all():
            seen |= {f"box{k}": box, f"distance{k}": found}
    if contacts[0].points.dim == 3:
        seen["view"] = (
            foot[0].at_nodes["normal"][foot[0].at_nodes["contact_node"] == 1].mean(axis=0)
        )
    return seen


def _displaced(mesh: Mesh, factor: float) -> np.ndarray:
    return mesh.x + factor * mesh.at_nodes["displacement"]


def _distances(contact: Contact, x: np.ndarray, factor: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a grid around given positions, and the distances of its points from the surface.

    Args:
        contact: The contact with the surface.
        x: Positions that the grid surrounds, ``shape=(n, 3)``, global frame, length.
        factor: Magnification of the displacement of the surface.

    Returns:
        Lowest corner, highest corner and number of points per direction as rows, ``shape=(3, 3)``;
        and distances, ``shape=(points,)``, length, with x varying fastest.
    """
    dim = contact.points.dim
    inside = np.arange(3) < dim
    low, high = x.min(axis=0), x.max(axis=0)
    margin = GRID_MARGIN * (high - low).max() * inside
    box = np.array([low - margin, high + margin, np.where(inside, GRID_POINTS[dim], 1)])
    axes = [np.linspace(a, b, int(n)) for a, b, n in box.T]
    z, y, x = np.meshgrid(*reversed(axes), indexing="ij")  # x runs fastest, as in VTK's grids
    points = np.column_stack((x.ravel(), y.ravel(), z.ravel()))[:, :dim]
    return box, contact.geometry.distances(points - (factor - 1.0) * contact.surface.displacement)
