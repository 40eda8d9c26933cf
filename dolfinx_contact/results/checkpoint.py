# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""All that the next step starts from, in one file.

Rows belong to nodes by their index in the mesh as it was read or made: partitioners share a mesh anew in
every run, so neither the ranks' shares nor their number need be those that wrote.
"""

from __future__ import annotations

import os
from collections import deque

import numpy as np
from mpi4py import MPI

from dolfinx_contact import compat
from dolfinx_contact.bodies.elastic import FreeState
from dolfinx_contact.collective import raised_together
from dolfinx_contact.solvers.condensed import KEPT


def save(problem, path) -> None:
    """Write the history of a ``ContactProblem``.  Collective."""
    comm, nodes = problem.body.comm, _nodes(problem)
    mine = nodes | {"ranks": np.array([len(nodes["nodes"])])}
    for name, array in zip(("u", "before"), problem._states):
        mine[name] = _rows(problem, array)
    if problem.body.known:
        known = problem.body.known
        mine |= {"digest": known.digest[None], "load": _rows(problem, known.load)}
        mine["free" if known.exact else "rough"] = _rows(problem, known.displacement)
    for k, contact in enumerate(problem.contacts):
        mine |= {f"contact{k}_{name}": array for name, array in contact.save().items()}
    kept = problem._memory.get("past")
    if kept:
        mine["past_nodes"] = np.concatenate([a for name, a in nodes.items() if name != "nodes"])
    everything = comm.gather(mine, root=0)
    with raised_together(comm):
        if comm.rank == 0:
            same = {name for name in mine if name.endswith("_plane")}  # on all ranks
            file = {
                name: mine[name] if name in same else np.concatenate([p[name] for p in everything])
                for name in mine
            }
            if kept:
                last = kept[-1]
                alike = [past for past in kept if past[0].size == last[0].size]
                file["past"] = np.array([past[:2] for past in alike])
                file["past_tied"] = last[2]
            unfinished = f"{path}.unfinished"
            with open(unfinished, "wb") as stream:
                np.savez(stream, **file)
            os.replace(unfinished, path)


def load(problem, path) -> None:
    """Take the history of a ``ContactProblem`` from a file.  Collective.

    Raises:
        ValueError: the file is no checkpoint of this problem.
    """
    comm, count = problem.body.comm, len(problem.contacts)
    asked = comm.gather(_nodes(problem), root=0)
    parts, past = None, ()
    with raised_together(comm):
        if comm.rank == 0:
            with np.load(path) as opened:
                file = dict(opened)
            if not {"u", "before", "nodes", "ranks"} <= file.keys():
                raise ValueError(f"{path} is no checkpoint.")
            for prefix in ["", *(f"contact{k}_" for k in range(count))]:
                name, size = f"{prefix}nodes", sum(len(nodes[f"{prefix}nodes"]) for nodes in asked)
                if name not in file or len(file[name]) != size:
                    found = len(file[name]) if name in file else "none"
                    raise ValueError(f"checkpoint {path} has {found} {name}, this problem {size}.")
            orders = {name: np.argsort(file[name]) for name in asked[0]}  # once for all ranks
            parts = [_part(file, orders, nodes, k, len(asked)) for k, nodes in enumerate(asked)]
            if "past" in file:
                names = [f"contact{k}_nodes" for k in range(count)]
                order = np.concatenate([nodes[name] for nodes in asked for name in names])
                at = _positions(file["past_nodes"], np.argsort(file["past_nodes"]), order)
                past = _past(file["past"], int(file.get("past_tied", 0)), at)
    mine, past = comm.scatter(parts, root=0), comm.bcast(past, root=0)
    with raised_together(comm):
        for k, contact in enumerate(problem.contacts):
            prefix = f"contact{k}_"
            contact.load({n[len(prefix) :]: a for n, a in mine.items() if n.startswith(prefix)})
    problem._states = [mine["u"].ravel(), mine["before"].ravel()]
    kept = problem._memory.setdefault("past", deque(maxlen=KEPT))
    kept.clear()
    kept.extend(past)
    problem.body.known = None
    if comm.allreduce("digest" in mine, op=MPI.LAND):
        exact = "free" in mine
        free = mine["free" if exact else "rough"].ravel()
        problem.body.known = FreeState(mine["digest"], mine["load"].ravel(), free, exact)


def _past(saved: np.ndarray, tied: int, at: np.ndarray) -> list[tuple]:
    """Earlier condensed steps in another order of nodes; what belongs to anchors stays behind them."""
    flat = saved.reshape(*saved.shape[:2], -1)
    size = flat.shape[2] - tied
    nodal = flat[:, :, :size].reshape(*flat.shape[:2], len(at), -1)[:, :, at]
    ordered = np.concatenate((nodal.reshape(*flat.shape[:2], size), flat[:, :, size:]), axis=2)
    return [(q, force, tied) for q, force in ordered]


def _nodes(problem) -> dict[str, np.ndarray]:
    """Original indices of this rank's nodes, of the body and of each contact."""
    original = compat.original_nodes(problem.u.function_space)
    contacts = {f"contact{k}_nodes": original[c.nodes] for k, c in enumerate(problem.contacts)}
    return {"nodes": original} | contacts


def _rows(problem, array: np.ndarray) -> np.ndarray:
    """Values of owned degrees of freedom, a row a node."""
    return array.reshape(-1, problem.u.function_space.dofmap.index_map_bs)


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
