# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""All that the next step starts from, in one file.

Rows belong to nodes by their index in the mesh as it was read or made: partitioners share a mesh anew in
every run, so neither the ranks' shares nor their number need be those that wrote.
"""

from __future__ import annotations

import os
import zipfile

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from dolfinx_contact import compat
from dolfinx_contact.bodies.elastic import FreeState
from dolfinx_contact.collective import raised_together
from dolfinx_contact.numbering import original_cells, original_nodes


def save(path, body, contacts, states, past, variables) -> None:
    """Write the history of a problem.  Collective.

    Args:
        path: File name.
        body: The body.
        contacts: Its contacts.
        states: The last displacement and the one before, owned degrees of freedom.
        past: Earlier steps of the condensed solver.
        variables: ``InternalVariables``.
    """
    comm, nodes = body.comm, _nodes(body, contacts)
    with raised_together(comm):
        _check_path(path)
    body.refresh()
    mine, rows = nodes | {"ranks": np.array([len(nodes["nodes"])])}, body.displacements.rows
    for name, array in zip(("u", "before"), states):
        mine[name] = rows(array)
    if body.displacements.mixed:
        mine |= {f"mixed_{name}": _by_cells(body, a) for name, a in zip(("u", "before"), states)}
    elif body.known:
        known = body.known
        mine |= {"digest": known.digest[None], "load": rows(known.load)}
        mine["free" if known.exact else "rough"] = rows(known.displacement)
    with raised_together(comm):  # the user's functions
        saved = [contact.save() for contact in contacts]
    for k, of_contact in enumerate(saved):
        mine |= {f"contact{k}_{name}": array for name, array in of_contact.items()}
    if past:
        of_contacts = [nodes[f"contact{k}_nodes"] for k in range(len(contacts))]
        mine["past_nodes"] = np.concatenate(of_contacts)
    mine |= variables.save()
    stiffness, everything = body.stiffness_norm(), comm.gather(mine, root=0)
    with raised_together(comm):
        if comm.rank == 0:
            same = {name for name in mine if name.endswith("_plane")}  # on all ranks
            file = {
                name: mine[name] if name in same else np.concatenate([p[name] for p in everything])
                for name in mine
            } | {"stiffness": np.array(stiffness)}
            if past:
                last = past[-1]
                alike = [step for step in past if step[0].size == last[0].size]
                file["past"] = np.array([step[:2] for step in alike])
                file["past_tied"] = last[2]
            unfinished = f"{path}.unfinished"
            with open(unfinished, "wb") as stream:
                np.savez(stream, **file)
            os.replace(unfinished, path)


def load(path, body, contacts, variables) -> tuple[list[np.ndarray], list]:
    """Give contacts, body and internal variables the history in a file.  Collective.

    Returns:
        The last displacement and the one before, and the earlier steps of the condensed solver.

    Raises:
        ValueError: the file is no checkpoint of this problem.
    """
    comm = body.comm
    with raised_together(comm):
        _check_path(path)
    body.refresh(np.zeros(body.size) if body.displacements.mixed else None)  # it scales unknowns
    asked = comm.gather(_nodes(body, contacts) | variables.cells(), root=0)
    stiffness = body.stiffness_norm()
    parts, past = None, ()
    with raised_together(comm):
        if comm.rank == 0:
            file = _opened(path)
            _check_file(path, file, asked, stiffness)
            orders = {name: np.argsort(file[name]) for name in asked[0]}  # once for all ranks
            parts = [_part(file, orders, nodes, k, len(asked)) for k, nodes in enumerate(asked)]
            if "past" in file:
                names = [f"contact{k}_nodes" for k in range(len(contacts))]
                order = np.concatenate([nodes[name] for nodes in asked for name in names])
                at = _positions(file["past_nodes"], np.argsort(file["past_nodes"]), order)
                past = _past(file["past"], int(file.get("past_tied", 0)), at)
    mine, past = comm.scatter(parts, root=0), comm.bcast(past, root=0)
    own = [
        {n.removeprefix(prefix): a for n, a in mine.items() if n.startswith(prefix)}
        for prefix in (f"contact{k}_" for k in range(len(contacts)))
    ]
    with raised_together(comm):
        for contact, saved in zip(contacts, own):
            contact.check_saved(saved)
    for contact, saved in zip(contacts, own):
        contact.load(saved)
    variables.load(mine)
    body.known = None
    if comm.allreduce("digest" in mine, op=MPI.LAND):
        exact = "free" in mine
        free = mine["free" if exact else "rough"].ravel()
        body.known = FreeState(mine["digest"], mine["load"].ravel(), free, exact)
    if body.displacements.mixed:
        return [_of_cells(body, mine[f"mixed_{name}"]) for name in ("u", "before")], past
    return [mine["u"].ravel(), mine["before"].ravel()], past


def _check_path(path) -> None:
    if not isinstance(path, (str, os.PathLike)):
        raise ValueError(f"path must be a file name, got {path!r}.")


def _opened(path) -> dict[str, np.ndarray]:
    try:
        with open(path, "rb") as stream, np.load(stream) as opened:
            return dict(opened)
    except (ValueError, EOFError, TypeError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path} is no checkpoint: {error}.") from None


def _check_file(path, file, asked, stiffness: float) -> None:
    """Raise a ``ValueError`` unless the file has as many nodes and the same stiffness as the problem that asks."""
    if not {"u", "before", "nodes", "ranks"} <= file.keys():
        raise ValueError(f"{path} is no checkpoint.")
    for name in asked[0]:
        size = sum(len(nodes[name]) for nodes in asked)
        if name not in file or len(file[name]) != size:
            found = len(file[name]) if name in file else "none"
            raise ValueError(f"checkpoint {path} has {found} {name}, this problem {size}.")
    saved = float(file.get("stiffness", stiffness))  # older checkpoints do not have it
    if not abs(saved - stiffness) <= 1e-9 * stiffness:
        raise ValueError(
            f"checkpoint {path} was written with another stiffness (norm {saved:.12g}, here {stiffness:.12g}): set "
            "the moduli and boundary conditions that the run had, then load."
        )


def _past(saved: np.ndarray, tied: int, at: np.ndarray) -> list[tuple]:
    """Earlier condensed steps in another order of nodes; what belongs to anchors stays behind them."""
    flat = saved.reshape(*saved.shape[:2], -1)
    size = flat.shape[2] - tied
    nodal = flat[:, :, :size].reshape(*flat.shape[:2], len(at), -1)[:, :, at]
    ordered = np.concatenate((nodal.reshape(*flat.shape[:2], size), flat[:, :, size:]), axis=2)
    return [(q, force, tied) for q, force in ordered]


def _nodes(body, contacts) -> dict[str, np.ndarray]:
    """Original indices of this rank's nodes, of the body and of each contact.  Collective."""
    original = original_nodes(body.displacements.V)
    of_contacts = {f"contact{k}_nodes": original[c.nodes] for k, c in enumerate(contacts)}
    if body.displacements.mixed:
        with raised_together(body.comm):
            of_contacts["mixed_nodes"] = original_cells(body.V.mesh)
    return {"nodes": original} | of_contacts


def _by_cells(body, array: np.ndarray) -> np.ndarray:
    """All unknowns of a mixed space in their units, a row an owned cell.  Collective."""
    values = fem.Function(body.V)
    values.x.array[: body.size] = body.values(array)
    values.x.scatter_forward()
    return values.x.array[_cells(body)]


def _of_cells(body, rows: np.ndarray) -> np.ndarray:
    """Values of owned degrees of freedom from what ``_by_cells`` returned."""
    values = np.zeros_like(body.u.x.array)
    values[_cells(body)] = rows
    return body.taken(values)


def _cells(body) -> np.ndarray:
    """Degrees of freedom of each owned cell."""
    topology = body.V.mesh.topology
    return compat.cell_dofs(body.V)[: topology.index_map(topology.dim).size_local]


def _part(file, orders, nodes, rank: int, ranks: int) -> dict[str, np.ndarray]:
    """The rows of one rank, which asks for ``nodes``."""
    part = {}
    for key, wanted in nodes.items():
        at, prefix = _positions(file[key], orders[key], wanted), key.removesuffix("nodes")
        names = ["u", "before", "load", "free", "rough"] if prefix == "" else file
        for name in (n for n in names if n in file and n.startswith(prefix) and n != key):
            part[name] = file[name] if name.endswith("_plane") else file[name][at]
    # Of the coefficients for which the free state holds a rank knows its own share alone.
    if "digest" in file and len(file["ranks"]) == ranks:
        last = np.cumsum(file["ranks"])[rank]
        if np.array_equal(file["nodes"][last - file["ranks"][rank] : last], nodes["nodes"]):
            part["digest"] = file["digest"][rank]
    return part


def _positions(nodes: np.ndarray, order: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Where in ``nodes``, which ``order`` sorts, those wanted are."""
    at = np.searchsorted(nodes, wanted, sorter=order)
    found = order[np.minimum(at, len(nodes) - 1)]
    if not np.array_equal(nodes[found], wanted):
        raise ValueError("checkpoint: it was written for another mesh, or with other contacts.")
    return found
