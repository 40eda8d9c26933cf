# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A picture of a problem: what is to be seen is gathered here, and ``draw.py`` draws it in a process of its own."""

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

# Points per direction of the grid on which a rigid surface is drawn, by dimension, and how far it goes beyond the contact, over its size.
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
    """Draw the body, its contact nodes by status, and the rigid surfaces in their present positions.  Collective.

    Needs PyVista, ``pip install pyvista``, and no display.  A body in space is seen from below the contact, through the surface;
    two bodies in contact are translucent.

    Args:
        problem: The ContactProblem.
        path: The picture, ``*.png``.
        colour: Field that colours the body: a scalar Function of a Lagrange space or another scalar UFL expression, such as von
            Mises stress.
        title: Title of its colour bar.
        factor: Magnification of displacements, also those of surfaces; rotations are not magnified.

    Raises:
        ValueError: on all ranks, if ``path`` does not end in ``.png``, ``colour`` is not scalar, or ``factor`` is not finite.
        ModuleNotFoundError: on all ranks, without PyVista.
        RuntimeError: on all ranks, if PyVista cannot draw here; the message quotes it.

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
    """Draw in another process: VTK's libraries and those of DOLFINx clash in one."""
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
    """What ``draw.py`` draws, arrays by name."""
    seen = {"x": _standing(body, factor), "view": np.zeros(0)}
    if any(contact.surface.deformable for contact in contacts) and contacts[0].points.dim == 3:
        seen["between"] = np.ones(1)  # the nodes are between two bodies
    for kind, cells in body.cells.items():
        seen[f"cells{kind}"] = cells
    for values in (body.at_nodes, body.at_cells):
        if "colour" in values:
            seen["colour"] = values["colour"]
    touching = [mesh.at_nodes["contact_node"] == 1 for mesh in foot]
    seen["nodes"] = np.concatenate(
        [_standing(mesh, factor)[at] for mesh, at in zip(foot, touching)]
    )
    seen["status"] = np.concatenate(
        [mesh.at_nodes["status"][at] for mesh, at in zip(foot, touching)]
    )
    for k, (contact, mesh) in enumerate(zip(contacts, foot)):
        box, found = _distances(contact, _standing(mesh, factor), factor)
        if np.isfinite(found).all():
            seen |= {f"box{k}": box, f"distance{k}": found}
    if contacts[0].points.dim == 3:
        seen["view"] = (
            foot[0].at_nodes["normal"][foot[0].at_nodes["contact_node"] == 1].mean(axis=0)
        )
    return seen


def _standing(mesh: Mesh, factor: float) -> np.ndarray:
    return mesh.x + factor * mesh.at_nodes["displacement"]


def _distances(contact: Contact, x: np.ndarray, factor: float) -> tuple[np.ndarray, np.ndarray]:
    """A grid about positions, its lowest and highest corner and number of points, ``shape=(3, 3)``; distances from the surface there."""
    dim = contact.points.dim
    inside = np.arange(3) < dim
    low, high = x.min(axis=0), x.max(axis=0)
    margin = GRID_MARGIN * (high - low).max() * inside
    box = np.array([low - margin, high + margin, np.where(inside, GRID_POINTS[dim], 1)])
    axes = [np.linspace(a, b, int(n)) for a, b, n in box.T]
    z, y, x = np.meshgrid(*reversed(axes), indexing="ij")  # x runs fastest, as in VTK's grids
    points = np.column_stack((x.ravel(), y.ravel(), z.ravel()))[:, :dim]
    return box, contact.geometry.distances(points - (factor - 1.0) * contact.surface.displacement)
