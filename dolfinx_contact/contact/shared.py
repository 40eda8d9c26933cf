# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Reactions of each contact at nodes that belong to several contacts, as in corners and grooves.

Equilibrium of the body determines only the sum of the reactions at such a node.  The reaction of
each contact follows from a local contact problem of the node on a spring (``nodal.py``).  At the
solution of the step the spring is unloaded, and each contact satisfies its own law.  For a node of
a single contact, the local problem is the usual return map.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from mpi4py import MPI

from dolfinx_contact.contact.geometry import times
from dolfinx_contact.contact.nodal import SINGULAR_DIRECTION, NodalProblems, Part
from dolfinx_contact.law.friction import Friction

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State

# Two unit normals count as equal if their scalar product exceeds one minus this tolerance.
SAME_NORMAL = 1e-12

# Growth of a node's error measure, over its smallest value so far, above which all other initial
# reactions are tried.
START_GROWTH = 2.0


def shared_nodes(contacts: Sequence[ContactStep], fixed: np.ndarray) -> SharedNodes | None:
    """Nodes of this rank that belong to several contacts, or None without such nodes.  Collective.

    Args:
        contacts: All contacts of a body.
        fixed: Owned degrees of freedom with boundary conditions.
    """
    if len(contacts) < 2:
        return None
    nodes, counts = np.unique(np.concatenate([c.nodes for c in contacts]), return_counts=True)
    nodes = nodes[counts > 1]
    alike, shares = shares_of(contacts, nodes)
    return SharedNodes(contacts, fixed, nodes, alike, shares) if nodes.size else None


def shares_of(contacts: Sequence[ContactStep], nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of contacts with the same normal at a node, and the share of the force of each contact.

    If two contacts meet on one face, equilibrium does not determine how they share the reaction of
    a node on their common edge.  They share it in the ratio of their nodal areas.  Collective.

    Args:
        contacts: The contacts.
        nodes: Local node indices, sorted, ``shape=(m,)``.

    Returns:
        Whether two contacts have the same normal, ``shape=(m, n, n)``, bool, false on the diagonal;
        and the shares, ``shape=(m, n)``, one where no other contact has the same normal.
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
    """Friction of each contact, averaged at nodes where several contacts have the same normal.

    Coefficients there are means, weighted by the shares of ``shares_of``.  They describe the node
    as a whole, for solvers that do not split reactions.  The means are exact for isotropic
    friction, and otherwise along the principal directions.  Collective.

    Args:
        laws: Friction of each contact.
        contacts: The contacts.
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
    """Solution of the local problems of the shared nodes in one state.

    Attributes:
        problems: Local contact problems of all shared nodes.
        required: Trial reactions of all contacts, ``shape=(m, n gdim)``, local frames.
        start: Index of the initial reactions that each node used last, ``shape=(m,)``.
        least: Smallest error measure found with these initial reactions, ``shape=(m,)``, force.
    """

    problems: NodalProblems
    required: np.ndarray
    start: np.ndarray
    least: np.ndarray


class SharedNodes:
    """The ``m`` nodes that belong to several of ``n`` contacts, in one step; immutable.

    Args:
        contacts: ``ContactStep`` of all contacts.  The spring stiffness of a node is the mean of
            its normal stiffnesses.
        fixed: Owned degrees of freedom with boundary conditions.
        nodes: Local node indices, sorted, ``shape=(m,)``.
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
        """Trial reactions of each contact, split at shared nodes, and the ``Split`` itself.

        With friction a local problem may have several solutions.  The one with the smallest error
        measure is used; solutions that start from the last reactions are preferred.  A node keeps
        its initial reactions until the error measure grows beyond ``START_GROWTH`` times its
        smallest value.

        Args:
            contacts: All contacts.
            tol: Tolerance of the step.
            x: Displacement, owned degrees of freedom.
            c: Motions of the surfaces driven by forces.
            forces: Forces on the body at the nodes, owned degrees of freedom.
            alone: Trial reactions of each contact without other contacts, ``shape=(k, gdim)`` each.
            near: Reactions of each contact that serve as further initial values, same shapes.
            known: The split of the previous state, if any.

        Returns:
            Trial reactions of each contact, ``shape=(k, gdim)`` each, local frames; and the split.
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
        """Local contact problems of the shared nodes with indices ``nodes``, which may repeat."""
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
        """Derivatives of the new reactions by nodal forces and motions, with shared nodes coupled.

        Args:
            derivatives: For each contact, derivatives of its return map by the trial reaction
                (``R_r``) and by the motion (``R_u``), ``shape=(k, gdim, gdim)`` each, local frame.
            split: The split of the state, as ``split`` returns it.

        Returns:
            The same pairs, changed at the shared nodes.
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
