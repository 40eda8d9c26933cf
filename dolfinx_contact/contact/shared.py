# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Nodes that belong to several contacts, as in corners, edges and grooves: the reaction of each contact.

The body tells of such a node the sum of its reactions alone.  The law tells the rest: reactions of each contact are those
of the contact problem of the node by itself (``nodal.py``).  In a solution of the step its spring is not stretched, and
what is left of it is the law of every contact.  With one contact alone it is what the return map does at any node.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from mpi4py import MPI

from dolfinx_contact.contact.nodal import SINGULAR_DIRECTION, NodalProblems, Part, times
from dolfinx_contact.law.friction import Friction

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State

# By which the product of two unit normals may miss one for them to be the same.
SAME_NORMAL = 1e-12

# By how much what a start leaves may have grown before all others are tried.
START_GROWTH = 2.0


def shared_nodes(contacts: Sequence[ContactStep], fixed: np.ndarray) -> SharedNodes | None:
    """The nodes of this rank that belong to several contacts, None if there are none.  Collective.

    Args:
        contacts: All contacts of a body.
        fixed: Owned degrees of freedom that boundary conditions fix.
    """
    if len(contacts) < 2:
        return None
    nodes, counts = np.unique(np.concatenate([c.nodes for c in contacts]), return_counts=True)
    nodes = nodes[counts > 1]
    alike, shares = shares_of(contacts, nodes)
    return SharedNodes(contacts, fixed, nodes, alike, shares) if nodes.size else None


def shares_of(contacts: Sequence[ContactStep], nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which contacts have the same normal at nodes, and the part of what presses there that each of those carries.  Collective.

    Two contacts on one face leave open how the reaction of a node of their common edge is shared; it is by area.

    Args:
        contacts: The contacts.
        nodes: Sorted, ``shape=(m,)``.

    Returns:
        ``shape=(m, n, n)``, booleans, false on the diagonal; and ``(m, n)``, one where no other has the same normal.
    """
    n, dim = len(contacts), contacts[0].points.dim
    normals, area = np.zeros((nodes.size, n, dim)), np.zeros((nodes.size, n))
    found = [np.intersect1d(contact.nodes, nodes, return_indices=True)[1:] for contact in contacts]
    for k, (contact, (rows, slots)) in enumerate(zip(contacts, found)):
        normals[slots, k] = contact.points.frames[rows, -1]
    alike = normals @ normals.transpose(0, 2, 1) > 1.0 - SAME_NORMAL
    if contacts[0].comm.allreduce(bool((alike.sum(axis=2) > 1).any()), op=MPI.LOR):
        for k, (contact, (rows, slots)) in enumerate(zip(contacts, found)):
            area[slots, k] = contact.area[rows]
    together = (alike * area[:, None, :]).sum(axis=2)
    equal = 1.0 / np.maximum(alike.sum(axis=2), 1)
    shares = np.divide(area, together, out=equal, where=together > 0.0)
    return alike & ~np.eye(n, dtype=bool), shares


def mean_laws(laws: list[Friction], contacts: Sequence[ContactStep]) -> list[Friction]:
    """Friction of each contact with, at nodes of several contacts with the same normal, the mean of theirs by shares.  Collective.

    That of the node as a whole, for solvers that do not know of shares: exact where it is isotropic, along principal directions else.
    """
    if len(contacts) < 2:
        return laws
    nodes, counts = np.unique(np.concatenate([c.nodes for c in contacts]), return_counts=True)
    alike, shares = shares_of(contacts, nodes[counts > 1])
    if not contacts[0].comm.allreduce(bool(alike.any()), op=MPI.LOR):
        return laws
    nodes, n = nodes[counts > 1], len(contacts)
    mu, p = np.zeros((2, nodes.size, n, 2))
    found = [np.intersect1d(contact.nodes, nodes, return_indices=True)[1:] for contact in contacts]
    for k, (law, contact, (rows, slots)) in enumerate(zip(laws, contacts, found)):
        for coefficients, given in ((mu, law.mu), (p, law.p)):
            coefficients[slots, k] = np.broadcast_to(given, (contact.nodes.size, 2))[rows]
    among = alike | np.eye(n, dtype=bool)
    mu, p = ((among * shares[:, None, :]) @ coefficients for coefficients in (mu, p))
    mixed = []
    for k, (law, contact, (rows, slots)) in enumerate(zip(laws, contacts, found)):
        own = [
            np.broadcast_to(coefficients, (contact.nodes.size, 2)).copy()
            for coefficients in (law.mu, law.p)
        ]
        these = alike[slots, k].any(axis=1)
        for coefficients, mean in zip(own, (mu, p)):
            coefficients[rows[these]] = mean[slots[these], k]
        mixed.append(Friction(own[0], np.where(own[0] > 0, own[1], 1.0), axes=law.axes))
    return mixed


def any_shared(contacts: Sequence[ContactStep]) -> bool:
    """Whether any node of any rank belongs to several contacts.  Collective."""
    if len(contacts) < 2:
        return False
    nodes = np.concatenate([contact.nodes for contact in contacts])
    return contacts[0].comm.allreduce(np.unique(nodes).size < nodes.size, op=MPI.LOR)


class Split(NamedTuple):
    """How reactions of shared nodes were split in a state.

    Attributes:
        problems: Those of all nodes.
        required: What each contact is asked for, ``shape=(m, n gdim)``.
        start: Of each node the start that served last, ``shape=(m,)``.
        least: The least that this start has left, ``shape=(m,)``.
    """

    problems: NodalProblems
    required: np.ndarray
    start: np.ndarray
    least: np.ndarray


class SharedNodes:
    """``m`` nodes of ``n`` contacts in one step; nothing in it changes.

    Args:
        contacts: ``ContactStep`` of all contacts; the spring of a node is the mean of its normal stiffnesses.
        fixed: Owned degrees of freedom that boundary conditions fix.
        nodes: The nodes, sorted, ``shape=(m,)``.
        alike, shares: As ``shares_of`` returns them.
    """

    def __init__(
        self,
        contacts: Sequence[ContactStep],
        fixed: np.ndarray,
        nodes: np.ndarray,
        alike: np.ndarray,
        shares: np.ndarray,
    ):
        dim = contacts[0].points.dim
        self._dofs = contacts[0].given.displacements.dofs(nodes)
        m, n = nodes.size, len(contacts)
        self._shape = m, n, dim
        self._frames, springs = np.zeros((m, n, dim, dim)), np.zeros((m, n))
        self._rows, self._slots = [], []
        for k, contact in enumerate(contacts):
            _, rows, slots = np.intersect1d(contact.nodes, nodes, return_indices=True)
            free = ~np.isin(contact.points.dofs[rows], fixed) & ~contact.points.closed[rows, None]
            self._frames[slots, k] = contact.points.frames[rows] * free[:, None, :]
            springs[slots, k] = contact.stiffness.normal[rows]
            self._rows.append(rows)
            self._slots.append(slots)
        self._alike, self._shares = alike, shares
        self._spring = springs.sum(axis=1) / (springs > 0).sum(axis=1)

    def split(
        self,
        contacts: Sequence[ContactStep],
        tol: float,
        x: np.ndarray,
        c: np.ndarray,
        forces: np.ndarray,
        alone: Sequence[np.ndarray],
        near: Sequence[np.ndarray],
        known: Split | None,
    ) -> tuple[tuple[np.ndarray, ...], Split]:
        """What the body requires of each contact, with the reactions of shared nodes as they are split; and how they are.

        With friction a node may have several solutions: that one is taken which moves it least, of equal ones that from
        the last reactions.  Where none is found so, those near may lead to one: those of a solver that knows them.
        A node keeps its start while what is left of its problem, and moves it, falls.

        Args:
            contacts: All contacts.
            tol: Largest error of the step.
            x: Displacement of owned degrees of freedom.
            c: Motions of surfaces.
            forces: Forces on the body at the nodes, owned degrees of freedom.
            alone: Required of each contact as if it were alone.
            near: Reactions of each contact from which to try, too.
            known: The split of the state before.
        """
        (m, n, dim), every = self._shape, np.arange(self._shape[0])
        force, states = forces[self._dofs], []
        starts = np.zeros((n + 2, m, n, dim))
        for k, (contact, rows, slots) in enumerate(zip(contacts, self._rows, self._slots)):
            states.append(contact.at(x, c))
            starts[:2, slots, k] = contact.last.reaction[rows], near[k][rows]
            starts[2 + k, :, k] = times(self._frames[:, k], force)
        starts = starts.reshape(n + 2, m, n * dim)
        start, least = np.zeros(m, dtype=int), np.full(m, -np.inf)
        if known is not None:
            start, least = known.start.copy(), known.least.copy()
        problems = self._problems(contacts, states, force, every)
        r, left = problems.balanced(starts[start, every], tol)
        lost = np.flatnonzero(~(left <= START_GROWTH * least))
        if lost.size:
            tried = self._problems(contacts, states, force, np.tile(lost, n + 2))
            found, unsolved = tried.balanced(starts[:, lost].reshape(-1, n * dim), tol)
            unsolved = np.nan_to_num(unsolved.reshape(n + 2, -1), nan=np.inf)
            weighted = unsolved * np.array([0.5, 2.0, *np.ones(n)])[:, None]
            start[lost] = best = weighted.argmin(axis=0)
            chosen = best, np.arange(lost.size)
            r[lost], left[lost] = found.reshape(n + 2, -1, n * dim)[chosen], unsolved[chosen]
            least[lost] = np.inf
        split = Split(problems, problems.asked(r), start, np.minimum(least, left))
        required, parts = [reaction.copy() for reaction in alone], split.required.reshape(m, n, dim)
        for k, (rows, slots) in enumerate(zip(self._rows, self._slots)):
            required[k][rows] = parts[slots, k]
        return tuple(required), split

    def _problems(
        self,
        contacts: Sequence[ContactStep],
        states: Sequence[State],
        force: np.ndarray,
        nodes: np.ndarray,
    ) -> NodalProblems:
        """The problems of some of the nodes, which may be named several times."""
        parts = []
        for contact, rows, slots, state in zip(contacts, self._rows, self._slots, states):
            mine = np.flatnonzero(np.isin(nodes, slots))
            at = np.searchsorted(slots, nodes[mine])
            law = contact.friction.at(rows[at]).law(self._shape[2])
            law = contact.law_of(law, state.known, rows[at])
            gap, slip = state.gap[rows], state.slip_increment[rows]
            parts.append(Part(mine, law, self._spring[nodes[mine]], gap[at], slip[at]))
        given = self._frames, force, self._alike, self._shares
        return NodalProblems(parts, *(part[nodes] for part in given))

    def coupled(self, derivatives: Sequence[tuple], split: Split) -> list[tuple]:
        """Derivatives of new reactions by the forces on the nodes and by the motion, from those by what each is asked for.

        Args:
            derivatives: For each contact ``R_r`` and ``R_u``, ``shape=(n, gdim, gdim)``, local frame.
            split: Of the state.
        """
        _, by_asked, by_motion = split.problems.linearised(split.required)
        C, F, asks = split.problems.coupling, split.problems.stacked, split.problems.asks
        inverse = C @ np.linalg.pinv(np.eye(C.shape[1]) + by_asked @ C, SINGULAR_DIRECTION)
        shape = *self._shape, self._shape[-1]
        both = ((by_asked, asks), (by_motion, F))
        asked, moved = ((-inverse @ part @ by).reshape(shape) for part, by in both)
        found = []
        for k, (by_reaction, by_slip) in enumerate(derivatives):
            rows, slots = self._rows[k], self._slots[k]
            by_reaction, by_slip = by_reaction.copy(), by_slip.copy()
            back = self._frames[slots, k].transpose(0, 2, 1)
            by_slip[rows] += by_reaction[rows] @ moved[slots, k] @ back
            own = self._shares[slots, k, None, None] * np.eye(back.shape[1])
            by_reaction[rows] = by_reaction[rows] @ (own + asked[slots, k] @ back)
            found.append((by_reaction, by_slip))
        return found
