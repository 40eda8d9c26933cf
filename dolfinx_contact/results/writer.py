# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Time series in VTK's XML format for ParaView, PyVista and meshio.

The format is written directly
[https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html].
VTK is not used, since its libraries can conflict with those of DOLFINx in one process.  The writers
of DOLFINx are not used, since they differ between releases.
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from base64 import b64encode
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.results.meshes import BodyMesh, Mesh, SurfaceMesh
from dolfinx_contact.support.checks import a_field, a_problem
from dolfinx_contact.support.collective import by_first_rank, raised_together

if TYPE_CHECKING:
    from dolfinx_contact.problem import ContactProblem

# VTK's names of data types, by NumPy's kind of data type.
VTK_DATA_TYPES = {"f": "Float64", "i": "Int64", "u": "UInt8"}
# VTK's names of file types: a time series, and a mesh.
VTK_COLLECTION = "Collection"
VTK_PIECE = "UnstructuredGrid"


def joined(meshes: list[Mesh]) -> Mesh:
    """Return the meshes of all contact surfaces as one mesh.

    The nodal values ``contact`` are the index of the contact of each node.
    """
    starts = np.cumsum([0, *(len(mesh.x) for mesh in meshes)])
    kinds = sorted({kind for mesh in meshes for kind in mesh.cells})
    cells = {
        kind: np.concatenate(
            [start + mesh.cells[kind] for start, mesh in zip(starts, meshes) if kind in mesh.cells]
        )
        for kind in kinds
    }
    names = meshes[0].at_nodes
    values = {name: np.concatenate([mesh.at_nodes[name] for mesh in meshes]) for name in names}
    values["contact"] = np.repeat(np.arange(len(meshes)), np.diff(starts))
    return Mesh(np.concatenate([mesh.x for mesh in meshes]), cells, values, {})


def write_vtu(path: Path, mesh: Mesh) -> None:
    """Write a mesh and its values to a file in VTK's XML format (``*.vtu``)."""
    file = _file(VTK_PIECE)
    cells = mesh.cells.values()
    counts = [np.full(len(nodes), nodes.shape[1]) for nodes in cells]
    kinds = [np.full(len(nodes), kind, dtype=np.uint8) for kind, nodes in mesh.cells.items()]
    numbers = {"NumberOfPoints": len(mesh.x), "NumberOfCells": sum(map(len, kinds))}
    piece = ET.SubElement(file[0], "Piece", {name: str(n) for name, n in numbers.items()})
    topology = {
        "connectivity": np.concatenate([nodes.ravel() for nodes in cells]),
        "offsets": np.cumsum(np.concatenate(counts)),
        "types": np.concatenate(kinds),
    }
    parts = {
        "Points": {"points": mesh.x},
        "Cells": topology,
        "PointData": mesh.at_nodes,
        "CellData": mesh.at_cells,
    }
    for part, arrays in parts.items():
        element = ET.SubElement(piece, part)
        for name, array in arrays.items():
            element.append(_data(name, array))
    _replace(path, file)


def _file(kind: str) -> ET.Element:
    """Return the root element of a VTK file, with an empty element of type ``kind`` in it."""
    order = {"version": "1.0", "byte_order": "LittleEndian", "header_type": "UInt64"}
    file = ET.Element("VTKFile", {"type": kind, **order})
    ET.SubElement(file, kind)
    return file


def _data(name: str, array: np.ndarray) -> ET.Element:
    """Return the XML element of an array: number of bytes and values, encoded in base64."""
    kind = array.dtype.kind
    data = array.astype({"f": "<f8", "i": "<i8", "u": "u1"}[kind]).tobytes()
    about = {"type": VTK_DATA_TYPES[kind], "Name": name, "format": "binary"}
    if array.ndim > 1:
        about["NumberOfComponents"] = str(array.shape[1])
    element = ET.Element("DataArray", about)
    element.text = b64encode(np.array([len(data)], dtype="<u8").tobytes() + data).decode()
    return element


def _replace(path: Path, file: ET.Element) -> None:
    """Write an XML file and replace an older one only when it is complete.

    If the process is killed while writing, the older file remains.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(path.name + ".part")
    ET.ElementTree(file).write(fresh, xml_declaration=True, encoding="utf-8")
    os.replace(fresh, path)


class Writer:
    """Writer of a time series of the body and its contact surfaces, on any number of ranks.

    For the path ``block.pvd``, the file ``block.pvd`` is the time series of the body, with
    ``displacement`` and the further fields.  The file ``block_contact.pvd`` is the time series of
    all contact surfaces, with the index ``contact`` of the contact.  It contains ``pressure``,
    ``shear_traction``, ``slip`` in the last step, ``status`` (0 open, 1 stick, 2 slip), ``gap``,
    ``wear_depth``, ``dissipation``, ``displacement`` and ``reaction``.  Vectors are in global
    components.  The sum of the nodal forces ``reaction`` is ``contact.force()``.  The meshes are in
    the folder ``block_data``, one file per step and series.  Rank 0 gathers and writes all data.

    Args:
        problem: The ContactProblem.
        path: File of the time series, ``*.pvd``.
        fields: Further scalar, vector or tensor fields of the body, by name.  Functions of Lagrange
            spaces are written at nodes, other UFL expressions, such as a stress, at the midpoint of
            each cell.
        resume: Number of steps of an existing time series to keep, for instance the number of steps
            before a checkpoint.

    Attributes:
        times: Times of the written steps.

    Raises:
        ValueError: on all ranks, if the path does not end in ``.pvd``, the name of a field is
            ``displacement``, or the file has fewer steps than ``resume``.

    Example:
        >>> writer = dc.Writer(problem, "block.pvd")
        >>> writer.write(time=1.0)
        >>> writer.times
        [1.0]
    """

    def __init__(
        self,
        problem: ContactProblem,
        path: str | PathLike[str],
        *,
        fields: Mapping[str, Any] | None = None,
        resume: int = 0,
    ) -> None:
        self._problem, self._comm = problem, a_problem(problem).body.comm
        self._fields = dict(fields or {})
        with raised_together(self._comm):
            self._path = Path(path)
            if self._path.suffix != ".pvd":
                raise ValueError(f"path must end in .pvd, got {str(path)!r}.")
            if "displacement" in self._fields:
                raise ValueError("fields: displacement is written anyway, take another name.")
            for name, field in self._fields.items():
                a_field(f"fields[{name!r}]", field)
            if not isinstance(resume, (int, np.integer)) or resume < 0:
                raise ValueError(f"resume must be a number of steps, 0 or more, got {resume!r}.")
        self.times: list[float] = []
        if resume:
            self.times = by_first_rank(self._comm, lambda _: self._times_of_file(resume))
        self._body = BodyMesh(problem.contacts[0].displacements)
        self._surfaces = [SurfaceMesh(contact) for contact in problem.contacts]

    def write(self, time: float) -> None:
        """Write the present state of the problem.  Collective.

        Args:
            time: Time of the state in the time series, finite.

        Raises:
            ValueError: on all ranks, if ``time`` is not finite.
            OSError: on all ranks, if a file cannot be written.
        """
        with raised_together(self._comm):
            if not np.isfinite(time):
                raise ValueError(f"time must be finite, got {time!r}.")
        u = self._problem.u
        body = self._body(u, self._fields)
        surfaces = [surface(u) for surface in self._surfaces]
        times = [*self.times, float(time)]
        by_first_rank(self._comm, lambda _: self._write(times, body, surfaces))
        self.times = times

    def _parts(self) -> dict[str, Path]:
        """Return the paths of both time series, by the prefix of the names of their mesh files."""
        stem = self._path.stem
        return {"body": self._path, "contact": self._path.with_name(f"{stem}_contact.pvd")}

    def _name(self, part: str, k: int) -> str:
        """Return the path of the mesh file of step ``k``, relative to the ``.pvd`` file."""
        return f"{self._path.stem}_data/{part}{k:06d}.vtu"

    def _write(self, times: list[float], body: Mesh, surfaces: list[Mesh]) -> None:
        meshes = {"body": body} | ({"contact": joined(surfaces)} if surfaces else {})
        for part, mesh in meshes.items():
            path = self._parts()[part]
            write_vtu(path.parent / self._name(part, len(times) - 1), mesh)
            file = _file(VTK_COLLECTION)
            for k, time in enumerate(times):
                entry = {"timestep": repr(time), "part": "0", "file": self._name(part, k)}
                ET.SubElement(file[0], "DataSet", entry)
            _replace(path, file)

    def _times_of_file(self, count: int) -> list[float]:
        """Return the times of the first ``count`` steps of an existing time series.

        Raises:
            ValueError: the file is missing or invalid, or has fewer steps.
        """
        try:
            sets = ET.parse(self._path).getroot().findall(f"{VTK_COLLECTION}/DataSet")
            times = [float(entry.attrib["timestep"]) for entry in sets]
        except (OSError, ET.ParseError, KeyError, ValueError) as error:
            raise ValueError(
                f"cannot resume: {self._path} is no series of this writer: {error}."
            ) from None
        if len(times) < count:
            raise ValueError(
                f"cannot resume after {count} steps: {self._path} has {len(times)} of them."
            )
        return times[:count]
