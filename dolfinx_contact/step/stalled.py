# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Messages about a search that ended without a solution.

They name the location of the largest error, the number of nodes that change status, elements with a
large aspect ratio, and slow linear solves.
"""

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

# Mean height over width of elements at the surface above which the message mentions it.
TALL_RATIO = 2.0

# Fraction of nodes that change status above which tall elements are a likely cause.
MANY_CHANGE = 0.05

# Fraction of the squared residual that the nodes counted as violating the law contribute together.
ERROR_PART = 0.9

# Iterations of a linear solve without contact above which the preconditioner is reported as poor;
# uniform meshes need 25 to 40.
MANY_ITERATIONS = 60


def stalled(
    body: ElasticBody,
    contacts: Sequence[ContactStep],
    changes: tuple[int, int],
    wrong: Sequence[np.ndarray],
) -> list[str]:
    """Return messages about the nodes that violate the contact law.  Collective.

    They give the number of these nodes, the location of the largest residual, the number of nodes
    that changed status in the last states, and what may help.

    Args:
        body: The body.
        contacts: Its contacts.
        changes: Number of nodes of this rank that have changed status, and the number of states in
            which they were observed, see ``Search``.
        wrong: Residual of the law at the nodes of each contact, ``shape=(n,)``, force.
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
    """Return a message if elements at the surface are tall on average.  Collective."""
    ratios = np.concatenate([np.zeros(0), *(_aspect_ratios(contact) for contact in contacts)])
    total, count = body.total(np.array([ratios.sum(), ratios.size]))
    if total <= TALL_RATIO * count:
        return []
    return [
        f"elements at the surface are {total / count:.1f} times as high as wide, which makes steps harder where nodes slip: "
        "make them flatter there"
    ]


def slow(body: ElasticBody, forces: np.ndarray) -> str:
    """Return a message if the preconditioner of the body is poor, else "".  Collective.

    Args:
        body: The body; with a direct solver, the message is empty.
        forces: Right-hand side of the test solve without contact, owned degrees of freedom.
    """
    if body.exact:
        return ""
    try:
        body.solve(forces)
    except LinearSolverError:
        pass  # the number of iterations is still available
    count = body.ksp.getIterationNumber()
    if count <= MANY_ITERATIONS:
        return ""
    return (
        f"without contact, the body takes {count} iterations of its linear solver, {MANY_ITERATIONS} at most are usual; elements of very "
        f"different sizes or shapes are hard for multigrid: if its factors fit into memory, petsc_options={DIRECT_OPTIONS}"
    )


def _aspect_ratios(contact: ContactStep) -> np.ndarray:
    """Return height over width of this rank's cells that have a facet with contact nodes only."""
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
