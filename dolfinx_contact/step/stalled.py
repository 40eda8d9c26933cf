# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What is known of a search that ended without a solution, in words: where its error is, nodes that change status, tall elements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact import compat
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS, LinearSolverError
from dolfinx_contact.support.checks import place

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact_step import ContactStep

# Height over width of elements at the surface from which on they are called tall, and the part of the nodes that then change status:
# where few do, it is not that.
TALL_RATIO = 2.0
MANY_CHANGE = 0.05

# The error is where its largest parts make up so much of its square.
ERROR_PART = 0.9

# Iterations of an elastic solve from which on its preconditioner is called a bad one; even meshes need 25 to 40.
MANY_ITERATIONS = 60


def stalled(
    body: ElasticBody,
    contacts: Sequence[ContactStep],
    changes: tuple[int, int],
    wrong: Sequence[np.ndarray],
) -> list[str]:
    """At how many nodes the law is not met, where most, how many have changed status in the last states, and what may help.  Collective.

    Args:
        body: The body.
        contacts: Its contacts.
        changes: Nodes of this rank that have changed their status, and in how many states, see ``Search``.
        wrong: Forces by which the nodes of each miss the law, ``shape=(n,)``.
    """
    x, amount = np.concatenate([contact.x for contact in contacts]), np.concatenate(wrong)
    changed, nodes = body.total(np.array([changes[0], amount.size])).astype(int)
    largest = int(amount.argmax()) if amount.size else None
    mine = (amount, 0.0, "") if largest is None else (amount, amount[largest], place(x, largest))
    found = body.comm.allgather(mine)
    squares = np.sort(np.concatenate([one[0] for one in found]) ** 2)[::-1]
    few = 1 + int(np.searchsorted(np.cumsum(squares), ERROR_PART * squares.sum()))
    where = max(found, key=lambda one: one[1])[2]
    message = [
        f"the law is not met at {few} of {nodes} contact nodes, least at {where}",
        f"{changed} have changed their status in the last {changes[1]} states",
    ]
    return message + tall(body, contacts) if changed > MANY_CHANGE * nodes else message


def tall(body: ElasticBody, contacts: Sequence[ContactStep]) -> list[str]:
    """That elements at the surface are tall, in the mean, and what to do; nothing if they are not.  Collective."""
    ratios = np.concatenate([np.zeros(0), *(_ratios(contact) for contact in contacts)])
    total, count = body.total(np.array([ratios.sum(), ratios.size]))
    if total <= TALL_RATIO * count:
        return []
    return [
        f"elements at the surface are {total / count:.1f} times as high as wide, which makes steps harder where nodes slip: "
        "make them flatter there"
    ]


def slow(body: ElasticBody, forces: np.ndarray) -> str:
    """That the body alone is hard for its preconditioner, and what to do; empty if it is not, or if solves are exact.  Collective."""
    if body.exact:
        return ""
    try:
        body.solve(forces)
    except LinearSolverError:
        pass  # it has counted, too
    count = body.ksp.getIterationNumber()
    if count <= MANY_ITERATIONS:
        return ""
    return (
        f"without contact, the body takes {count} iterations of its linear solver, {MANY_ITERATIONS} at most are usual; elements of very "
        f"different sizes or shapes are hard for multigrid: if its factors fit into memory, petsc_options={DIRECT_OPTIONS}"
    )


def _ratios(contact: ContactStep) -> np.ndarray:
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
