# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Why a search ends without a solution, in words: nodes that change their status again and again, tall elements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact import compat
from dolfinx_contact.petsc.linear_solver import DIRECT, LinearSolverError
from dolfinx_contact.support.checks import place

if TYPE_CHECKING:
    from dolfinx_contact.solvers.protocols import BodyLike, ContactLike

# Height over width of elements at the surface from which on they are called tall.
TALL = 2.0

# Iterations of an elastic solve from which on its preconditioner is called a bad one; even meshes need 25 to 40.
MANY = 60


def changing(
    body: BodyLike, contacts: Sequence[ContactLike], statuses: Iterable[Sequence[np.ndarray]]
) -> str:
    """How many nodes have changed their status in the last states of a search, and which one most often.  Collective.

    Args:
        body: The body.
        contacts: Its contacts.
        statuses: Of each contact in each of these states, ``shape=(n,)``.
    """
    every = np.array([np.concatenate(one) for one in statuses])
    times = (every[1:] != every[:-1]).sum(axis=0)
    x = np.concatenate([contact.x for contact in contacts])
    count, nodes = body.total(np.array([np.count_nonzero(times), times.size])).astype(int)
    if not count:
        return f"no node has changed its status in the last {len(every)} states, errors fall slowly"
    most = int(times.argmax()) if times.size else None
    mine = (0, "") if most is None else (int(times[most]), place(x, most))
    often, where = max(body.comm.allgather(mine), key=lambda one: one[0])
    return (
        f"the search goes from state to state: {count} of {nodes} contact nodes have changed their status in the last "
        f"{len(every)}, most often ({often} times) the one at {where}"
    )


def tall(body: BodyLike, contacts: Sequence[ContactLike]) -> str:
    """That elements at the surface are tall, in the mean, and what to do; empty if they are not.  Collective."""
    ratios = np.concatenate([np.zeros(0), *(_ratios(contact) for contact in contacts)])
    total, count = body.total(np.array([ratios.sum(), ratios.size]))
    if total <= TALL * count:
        return ""
    return (
        f"elements at the surface are {total / count:.1f} times as high as wide, which makes steps harder where nodes slip: "
        "make them flatter there"
    )


def slow(body: BodyLike, forces: np.ndarray) -> str:
    """That the body alone is hard for its preconditioner, and what to do; empty if it is not, or if solves are exact.  Collective."""
    if body.exact:
        return ""
    try:
        body.solve(forces)
    except LinearSolverError:
        pass  # it has counted, too
    count = body.ksp.getIterationNumber()
    if count <= MANY:
        return ""
    return (
        f"without contact, the body takes {count} iterations of its linear solver, {MANY} at most are usual; elements of very "
        f"different sizes or shapes are hard for multigrid: if its factors fit into memory, petsc_options={DIRECT}"
    )


def _ratios(contact: ContactLike) -> np.ndarray:
    """Height over width of this rank's cells that have a facet of contact nodes."""
    V, dim = contact.displacements.V, contact.points.dim
    nodes, x = compat.cell_nodes(V), V.tabulate_dof_coordinates()[:, :dim]
    row = np.full(len(x), -1)
    row[contact.nodes] = np.arange(contact.nodes.size)
    ratios = []
    for cell in nodes[(row[nodes] >= 0).sum(axis=1) >= dim]:
        touching = cell[row[cell] >= 0]
        heights = x[cell] @ contact.points.frames[row[touching[0]], -1]
        apart = np.linalg.norm(x[touching][:, None] - x[touching], axis=2)
        ratios.append(np.ptp(heights) / apart[apart > 0.0].min())
    return np.array(ratios)
