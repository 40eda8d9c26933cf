# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Checkpoints: the complete state from which the next load step starts, in one file.

Rows of arrays are identified by the original index of their node in the mesh.  A checkpoint can
therefore be loaded with another partition and another number of ranks.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from dolfinx_contact import compat
from dolfinx_contact.accepted import Accepted, histories_of, poses_of
from dolfinx_contact.bodies.elastic import ElasticBody, FreeState
from dolfinx_contact.contact.saved import check_saved, load_saved, saved_of
from dolfinx_contact.contact.state import OPPOSITE_WEAR
from dolfinx_contact.support.checks import number
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.support.numbering import original_cells, original_node_numbers

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.problem import ContactProblem

# Version of the file format.  Files of other versions are rejected.
FILE_VERSION = 3

# Last parts of the names of arrays that exist only for some contacts and may be missing in a file.
OPTIONAL_ARRAYS = ("law_of_last_step", "home", "rotation_of_plane")

# Last sentence of error messages about invalid files.
WRITE_ANEW = "Take another one, or write it anew with problem.save."


def save(path: str | PathLike[str], problem: ContactProblem) -> None:
    """Write the last converged state of a problem to a checkpoint file.  Collective.

    Raises:
        ValueError: ``path`` is not a file name.
        OSError: on all ranks, if the file cannot be written.
    """
    body, contacts, accepted = problem.body, problem.contacts, problem.accepted
    comm, nodes = body.comm, _nodes(body, contacts)
    with raised_together(comm):
        _check_path(path)
    body.refresh()
    mine = nodes | {"ranks": np.array([len(nodes["nodes"])])} | _arrays(problem, accepted)
    known, rows, starts = accepted.free_state, body.displacements.rows, accepted.starts
    if known and not body.displacements.mixed:
        mine |= {"digest": known.digest[None], "load": rows(known.load)}
        mine["free" if known.exact else "rough"] = rows(known.displacement)
    if starts:
        of_contacts = [nodes[f"contact{k}_nodes"] for k in range(len(contacts))]
        mine["starts_nodes"] = np.concatenate(of_contacts)
    stiffness, everything = body.stiffness_norm(), comm.gather(mine, root=0)
    with raised_together(comm):
        if comm.rank == 0:
            same = {name for name in mine if name.endswith("_plane")}  # on all ranks
            file = {
                name: mine[name] if name in same else np.concatenate([p[name] for p in everything])
                for name in mine
            } | {"stiffness": np.array(stiffness), "version": np.array(FILE_VERSION)}
            if starts:
                last = starts[-1]
                alike = [step for step in starts if step[0].size == last[0].size]
                file["starts"] = np.array([step[:2] for step in alike])
                file["starts_tied"] = last[2]
            _write(path, file)


def _arrays(problem: ContactProblem, accepted: Accepted | None = None) -> dict[str, np.ndarray]:
    """Return this rank's rows of displacements and history variables by name.  Collective.

    Args:
        problem: The ContactProblem.
        accepted: Last converged state.  If None, displacements are zero, and the arrays serve only
            to check the names, shapes and types in a file.
    """
    body, contacts = problem.body, problem.contacts
    x, before = 2 * [np.zeros(body.size)] if accepted is None else (accepted.x, accepted.x_before)
    mine = {"x": body.displacements.rows(x), "x_before": body.displacements.rows(before)}
    mine["fixed"] = _fixed_rows(body)
    if body.displacements.mixed:
        mine |= {"mixed_x": _cell_rows(body, x), "mixed_x_before": _cell_rows(body, before)}
    with raised_together(body.comm):  # the user's functions
        saved = [saved_of(contact) for contact in contacts]
    for k, (contact, of_contact) in enumerate(zip(contacts, saved)):
        mine |= {f"contact{k}_{name}": array for name, array in of_contact.items()}
        if contact.history.frames.at is not None:
            placed = body.displacements.rows(contact.history.frames.at)
            worn = np.zeros(len(placed))
            worn[contact.opposite] = contact.opposite_wear_depth
            mine |= {f"{k}_placed": placed, f"{k}_worn": worn}
    return mine | (problem.internal.save() if problem.internal else {})


def _fixed_rows(body: ElasticBody) -> np.ndarray:
    """Return 1 for prescribed degrees of freedom and 0 for others, ``shape=(nodes, dim)``."""
    fixed = np.zeros(body.size, dtype=np.uint8)
    fixed[body.fixed] = 1
    return body.displacements.rows(fixed)


def _write(path: str | PathLike[str], file: dict[str, np.ndarray]) -> None:
    """Write a file and replace an older one only when it is complete.

    If the computer stops at any time, either the older or the new file is complete.
    """
    unfinished = f"{path}.unfinished"
    try:
        with open(unfinished, "wb") as stream:
            np.savez(stream, **file)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(unfinished, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(unfinished)
        raise
    with suppress(OSError):  # not every system opens folders
        folder = os.open(os.path.dirname(os.path.abspath(path)), os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def load(path: str | PathLike[str], problem: ContactProblem) -> Accepted:
    """Load a checkpoint file and return its state.  Collective.

    The contacts and the internal variables of the problem are set to this state.

    Raises:
        ValueError: the file is not a checkpoint of this problem.
        OSError: on all ranks, if the file cannot be read.
    """
    body, contacts, internal = problem.body, problem.contacts, problem.internal
    comm = body.comm
    with raised_together(comm):
        _check_path(path)
    body.refresh(np.zeros(body.size) if body.displacements.mixed else None)  # it scales unknowns
    nodes, like = _nodes(body, contacts), _arrays(problem)
    nodes |= internal.cells() if internal else {}
    asked = comm.gather(nodes, root=0)
    stiffness = body.stiffness_norm()
    parts, starts = None, ()
    with raised_together(comm):
        if comm.rank == 0:
            file = _read(path)
            _check_file(path, file, asked)
            _check_arrays(path, file, like)
            orders = {name: np.argsort(file[name]) for name in asked[0]}  # once for all ranks
            parts = [
                _rows_of_rank(file, orders, nodes, k, len(asked)) for k, nodes in enumerate(asked)
            ]
            if "starts" in file:
                names = [f"contact{k}_nodes" for k in range(len(contacts))]
                order = np.concatenate([nodes[name] for nodes in asked for name in names])
                starts = _starts(path, file, order)
    mine, starts = comm.scatter(parts, root=0), comm.bcast(starts, root=0)
    with raised_together(comm):
        _check_supports(path, mine, body)
    with raised_together(comm):
        if comm.rank == 0:
            _check_stiffness(path, file, stiffness)
    own = [
        {n.removeprefix(prefix): a for n, a in mine.items() if n.startswith(prefix)}
        for prefix in (f"contact{k}_" for k in range(len(contacts)))
    ]
    for k, saved in enumerate(own):
        saved |= _opposite_history(mine, body, k, contacts[k])
    with raised_together(comm):
        for contact, saved in zip(contacts, own):
            check_saved(contact, saved)
    for contact, saved in zip(contacts, own):
        load_saved(contact, saved)
    names = ("x", "x_before")
    mixed = body.displacements.mixed
    x, before = (
        _from_cell_rows(body, mine[f"mixed_{n}"]) if mixed else mine[n].ravel() for n in names
    )
    return problem.accepted.replaced(
        x=x,
        x_before=before,
        histories=histories_of(contacts),
        poses=poses_of(contacts),
        free_state=_free_state(mine, comm),
        variables=internal.loaded(mine) if internal else (),
        starts=tuple(starts),
    )


def _opposite_history(
    mine: dict[str, np.ndarray], body: ElasticBody, k: int, contact: Contact
) -> dict:
    """Return the history variables of a deformable surface at nodes other than the contact nodes.

    Args:
        mine: This rank's rows of all arrays, by name.
        body: The body.
        k: Index of the contact.
        contact: The contact.

    Returns:
        Positions ``at`` and wear depth of the opposite side, if they are in the file.
    """
    found = {}
    if f"{k}_placed" in mine:
        found["at"] = body.displacements.vectors(mine[f"{k}_placed"][:, :, None])[:, 0]
    if f"{k}_worn" in mine:
        found[OPPOSITE_WEAR] = mine[f"{k}_worn"][contact.opposite]
    return found


def _free_state(mine: dict[str, np.ndarray], comm: MPI.Comm) -> FreeState | None:
    """Return the contact-free solution, or None if it is missing on any rank.  Collective."""
    exact = "free" in mine
    is_known = {"digest", "load"} <= mine.keys() and (exact or "rough" in mine)
    if not comm.allreduce(is_known, op=MPI.LAND):
        return None
    free = mine["free" if exact else "rough"].ravel()
    return FreeState(mine["digest"], mine["load"].ravel(), free, exact)


def _check_path(path: str | PathLike[str]) -> None:
    if not isinstance(path, (str, os.PathLike)):
        raise ValueError(f"path must be a file name, got {path!r}.")


def _read(path: str | PathLike[str]) -> dict[str, np.ndarray]:
    try:
        with open(path, "rb") as stream, np.load(stream) as opened:
            return dict(opened)
    except OSError:
        raise
    except (
        Exception
    ) as error:  # NumPy raises errors of many types, also of zip files and compression
        raise ValueError(f"{path} is no checkpoint: {error}.") from None


def _check_file(path: str | PathLike[str], file: dict[str, np.ndarray], asked: Any) -> None:
    """Raise a ``ValueError`` unless the file is a checkpoint with as many nodes as the problem.

    Args:
        path: Path of the file, for messages.
        file: Arrays in the file by name.
        asked: Original indices of the nodes of each rank, by name.
    """
    if not {"nodes", "ranks"} <= file.keys():
        raise ValueError(f"{path} is no checkpoint.")
    if file.get("version", 0) != FILE_VERSION:
        raise ValueError(
            f"checkpoint {path} was written by another version of dolfinx_contact: read it with that one."
        )
    for name in asked[0]:
        size = sum(len(nodes[name]) for nodes in asked)
        if name not in file or file[name].shape != (size,):
            found = file[name].size if name in file else "none"
            raise ValueError(f"checkpoint {path} has {found} {name}, this problem {size}.")


def _check_supports(
    path: str | PathLike[str], mine: dict[str, np.ndarray], body: ElasticBody
) -> None:
    """Raise a ``ValueError`` if the file was written with other prescribed degrees of freedom.

    Only degrees of freedom of this rank are compared.
    """
    here = _fixed_rows(body)
    differs = np.flatnonzero((mine["fixed"] != here).any(axis=1))
    if differs.size:
        where = body.displacements.x[differs[0], : body.displacements.dim].tolist()
        raise ValueError(
            f"checkpoint {path} was written with other supports, as at the node at {where}: set problem.bcs to those that the run had, "
            "load, and then change them."
        )


def _check_stiffness(
    path: str | PathLike[str], file: dict[str, np.ndarray], stiffness: float
) -> None:
    """Raise a ``ValueError`` unless the problem has the same stiffness as in the file.

    Args:
        path: Path of the file, for messages.
        file: Arrays in the file by name.
        stiffness: Norm of the stiffness matrix of the problem.
    """
    saved = _number(path, file, "stiffness")
    if not abs(saved - stiffness) <= 1e-9 * stiffness:
        raise ValueError(
            f"checkpoint {path} was written with another stiffness (norm {saved:.12g}, here {stiffness:.12g}): set "
            "the moduli and boundary conditions that the run had, then load."
        )


def _number(path: str | PathLike[str], file: dict[str, np.ndarray], name: str) -> float:
    """Return a number in the file; raise a ``ValueError`` if it is missing or not finite."""
    try:
        return number(f"checkpoint {path}: {name}", file.get(name))
    except ValueError as error:
        raise ValueError(f"{error} {WRITE_ANEW}") from None


def _check_arrays(
    path: str | PathLike[str], file: dict[str, np.ndarray], like: dict[str, np.ndarray]
) -> None:
    """Raise a ``ValueError`` unless all arrays are present, finite and of the right shape.

    Args:
        path: Path of the file, for messages.
        file: Arrays in the file by name.
        like: Arrays by name that the problem would save now on this rank; shapes beyond the number
            of rows, and types, must match.
    """
    missing = [name for name in like if name not in file and not name.endswith(OPTIONAL_ARRAYS)]
    if missing:
        raise ValueError(f"checkpoint {path} lacks {', '.join(missing)}. {WRITE_ANEW}")
    like = like | {name: like["x"] for name in ("load", "free", "rough")}
    for name, array in file.items():
        surface = name.endswith(
            "rigid_plane"
        )  # checked by the contact; without wear it contains NaN
        if name == "digest":
            continue
        if array.dtype.kind not in "iuf":
            raise ValueError(
                f"checkpoint {path}: {name} must be numbers, not {array.dtype}. {WRITE_ANEW}"
            )
        if not surface and not name.startswith("state_") and not np.isfinite(array).all():
            raise ValueError(f"checkpoint {path}: {name} must be finite. {WRITE_ANEW}")
        if name.endswith("_worn") and (array < 0.0).any():
            raise ValueError(f"checkpoint {path}: {name} must not be negative. {WRITE_ANEW}")
        if name not in like or surface:
            continue
        rows = () if name.endswith("_plane") else file[_nodes_of(name)].shape
        shape, kind = rows + like[name].shape[len(rows) :], like[name].dtype
        if array.shape != shape or not np.can_cast(array.dtype, kind, "same_kind"):
            raise ValueError(
                f"checkpoint {path}: {name} needs shape {shape} and type {kind}, found {array.shape}, {array.dtype}: it was "
                f"written for another mesh or other contacts, or changed. {WRITE_ANEW}"
            )


def _nodes_of(name: str) -> str:
    """Return the name of the array of original indices that identify the rows of an array."""
    prefix = name.split("_")[0]
    return f"{prefix}_nodes" if prefix.startswith(("contact", "state", "mixed")) else "nodes"


def _starts(
    path: str | PathLike[str], file: dict[str, np.ndarray], order: np.ndarray
) -> list[tuple]:
    """Return initial guesses of the condensed solver from earlier steps, reordered for this run.

    Args:
        path: Path of the file, for messages.
        file: Arrays in the file by name.
        order: Original indices of the contact nodes in the order of this run, of all ranks.

    Returns:
        For each earlier step: nodal displacements and forces, each followed by the values of the
        bilateral constraints (``tied``), and the number of these constraints.

    Raises:
        ValueError: the arrays in the file do not match.
    """
    saved, nodes = file["starts"], file.get("starts_nodes", np.zeros(0))
    tied = int(_number(path, file, "starts_tied"))
    size = int(np.prod(saved.shape[2:])) - tied
    if (
        nodes.shape != order.shape
        or saved.ndim < 3
        or saved.shape[1] != 2
        or size < 0
        or size % max(len(nodes), 1)
    ):
        raise ValueError(
            f"checkpoint {path}: starts and starts_nodes do not belong to each other. {WRITE_ANEW}"
        )
    at = _positions(nodes, np.argsort(nodes), order)
    flat = saved.reshape(*saved.shape[:2], -1)
    nodal = flat[:, :, :size].reshape(*flat.shape[:2], len(at), -1)[:, :, at]
    ordered = np.concatenate((nodal.reshape(*flat.shape[:2], size), flat[:, :, size:]), axis=2)
    return [(q, force, tied) for q, force in ordered]


def _nodes(body: ElasticBody, contacts: Sequence[Contact]) -> dict[str, np.ndarray]:
    """Return the original indices of this rank's nodes of body and contacts.  Collective.

    For mixed spaces, the original indices of the cells are included.
    """
    original = original_node_numbers(body.displacements.V)
    of_contacts = {f"contact{k}_nodes": original[c.nodes] for k, c in enumerate(contacts)}
    if body.displacements.mixed:
        with raised_together(body.comm):
            of_contacts["mixed_nodes"] = original_cells(body.V.mesh)
    return {"nodes": original} | of_contacts


def _cell_rows(body: ElasticBody, array: np.ndarray) -> np.ndarray:
    """Return all unknowns of a mixed space in their units, one row per owned cell.  Collective."""
    values = fem.Function(body.V)
    values.x.array[: body.size] = body.values(array)
    values.x.scatter_forward()
    return values.x.array[_cell_dofs(body)]


def _from_cell_rows(body: ElasticBody, rows: np.ndarray) -> np.ndarray:
    """Return the vector of owned degrees of freedom, scaled as in the solver, from rows of cells.

    Args:
        body: The body.
        rows: Values of all unknowns in their units, one row for each owned cell, see
            ``_cell_rows``.
    """
    values = np.zeros_like(body.u.x.array)
    values[_cell_dofs(body)] = rows
    return body.taken(values)


def _cell_dofs(body: ElasticBody) -> np.ndarray:
    """Return the local indices of the degrees of freedom of owned cells, one row per cell."""
    topology = body.V.mesh.topology
    return compat.cell_dofs(body.V)[: topology.index_map(topology.dim).size_local]


def _rows_of_rank(
    file: dict[str, np.ndarray],
    orders: dict[str, np.ndarray],
    nodes: dict[str, np.ndarray],
    rank: int,
    ranks: int,
) -> dict[str, np.ndarray]:
    """Return the rows of the arrays in a file that belong to one rank, by name.

    Args:
        file: Arrays in the file by name.
        orders: Permutation that sorts each array of original indices, by name.
        nodes: Original indices of the nodes of the rank, by name.
        rank: Index of the rank.
        ranks: Number of ranks.

    Raises:
        ValueError: the file does not contain a node.
    """
    part = {}
    for key, wanted in nodes.items():
        at, prefix = _positions(file[key], orders[key], wanted), key.removesuffix("nodes")
        of_body = {"x", "x_before", "fixed", "load", "free", "rough"}
        of_body |= {name for name in file if name.endswith(("_placed", "_worn"))}
        names = of_body if prefix == "" else file
        for name in (n for n in names if n in file and n.startswith(prefix) and n != key):
            part[name] = file[name] if name.endswith("_plane") else file[name][at]
    # The digest of the stiffness depends on the partition: it is valid only if the rank has the
    # same nodes.
    if "digest" in file and file["ranks"].shape == file["digest"].shape[:1] == (ranks,):
        last = np.cumsum(file["ranks"])[rank]
        if np.array_equal(file["nodes"][last - file["ranks"][rank] : last], nodes["nodes"]):
            part["digest"] = file["digest"][rank]
    return part


def _positions(nodes: np.ndarray, order: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the positions in ``nodes`` of the indices ``wanted``.

    Args:
        nodes: Indices in any order.
        order: Permutation that sorts ``nodes``.
        wanted: Indices to find.

    Raises:
        ValueError: an index is missing.
    """
    at = np.searchsorted(nodes, wanted, sorter=order)
    found = order[np.minimum(at, len(nodes) - 1)]
    if not np.array_equal(nodes[found], wanted):
        raise ValueError("checkpoint: it was written for another mesh, or with other contacts.")
    return found
