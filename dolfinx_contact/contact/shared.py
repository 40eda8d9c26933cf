# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
r"""Nodes that belong to several contacts, as in corners, edges and grooves: the reaction of each.

The body tells of such a node the sum ``p`` of its reactions alone.  The law tells the rest: reactions are those with
which the node by itself, on a spring, is in contact with all of its surfaces,

.. math:: r_c = R_c(F_c (p - \sum_{d \ne c} F_d^T r_d), w_c)

with the return maps ``R_c``, frames ``F_c``, gaps and slips ``w_c``.  The spring, the same for all contacts of the node, moves it
by ``(sum F^T r - p) / kappa``: by nothing in a solution of the step, where this is the law of every contact.  A single
contact has ``r = R(F p, w)``.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from dolfinx_contact.error import EPSILON
from dolfinx_contact.law.maps import ReturnMap

# Newton's steps at most, and sweeps over the contacts after one that does not help.
MOST, SWEEPS = 60, 4

# A residual that is rounding, over the size of its terms, and what a step has to leave at most.
ROUNDED, HELPS = 8 * EPSILON, 0.5

# Directions of reactions that change nothing, over the largest: the shortest step leaves them as they are.
SINGULAR = 1e-11


def shared_nodes(contacts, stiffness, fixed: np.ndarray) -> SharedNodes | None:
    """The nodes of this rank that belong to several contacts, None if there are none.

    Args:
        contacts: All contacts of a body.
        stiffness: ``NodalStiffness`` of each.
        fixed: Owned degrees of freedom that boundary conditions fix.
    """
    if len(contacts) < 2:
        return None
    nodes, counts = np.unique(np.concatenate([c.nodes for c in contacts]), return_counts=True)
    nodes = nodes[counts > 1]
    return SharedNodes(contacts, stiffness, fixed, nodes) if nodes.size else None


def any_shared(contacts) -> bool:
    """Whether any node of any rank belongs to several contacts.  Collective."""
    if len(contacts) < 2:
        return False
    nodes = np.concatenate([contact.nodes for contact in contacts])
    return contacts[0].comm.allreduce(np.unique(nodes).size < nodes.size, op=MPI.LOR)


class SharedNodes:
    """The contact problems of ``m`` nodes, each by itself; arrays run over nodes and contacts, ``shape=(m, contacts, ...)``.

    Args:
        contacts: All contacts of a body.
        stiffness: ``NodalStiffness`` of each.
        fixed: Owned degrees of freedom that boundary conditions fix.
        nodes: The nodes, sorted, ``shape=(m,)``.
    """

    def __init__(self, contacts, stiffness, fixed: np.ndarray, nodes: np.ndarray):
        self._contacts, dim = contacts, contacts[0].points.dim
        self._dofs = dim * nodes[:, None] + np.arange(dim)
        m, n = nodes.size, len(contacts)
        self._frames, springs = np.zeros((m, n, dim, dim)), np.zeros((m, n))
        self._rows, self._slots, self._laws = [], [], []
        for k, (contact, of) in enumerate(zip(contacts, stiffness)):
            _, rows, slots = np.intersect1d(contact.nodes, nodes, return_indices=True)
            free = ~np.isin(contact.points.dofs[rows], fixed) & ~contact.points.closed[rows, None]
            self._frames[slots, k] = contact.points.frames[rows] * free[:, None, :]
            springs[slots, k] = of.normal[rows]
            self._rows.append(rows)
            self._slots.append(slots)
            self._laws.append(contact.friction.at(rows).law(dim))
        self._spring = springs.sum(axis=1) / (springs > 0).sum(axis=1)
        self._stacked = self._frames.reshape(m, n * dim, dim)
        others = 1.0 - np.kron(np.eye(n), np.ones((dim, dim)))
        self._coupling = self._stacked @ self._stacked.transpose(0, 2, 1) * others
        self._shape = m, n, dim

    # -- reactions -----------------------------------------------------------------------------

    def split(self, x: np.ndarray, forces: np.ndarray) -> None:
        """Find what each contact is asked for, for ``give``.  Moves the contacts.

        Args:
            x: Displacement of owned degrees of freedom.
            forces: Forces on the body at the nodes, owned degrees of freedom.
        """
        r = np.zeros(self._shape)
        self._motion = []
        for k, contact in enumerate(self._contacts):
            rows, slots = self._rows[k], self._slots[k]
            contact.move(x)
            self._motion.append((contact.gap[rows], contact.slip_increment[rows]))
            r[slots, k] = contact.last.reaction[rows]
        self._asked_in_all = self._times(self._stacked, forces[self._dofs])
        r = self._balanced(r.reshape(len(r), -1))
        self._asked = self._asked_by(r)

    def give(self, k: int) -> None:
        """Give a contact the reactions that its maps start from, ``F_c (p - sum of the others')``."""
        contact = self._contacts[k]
        reaction = contact.reaction.copy()
        reaction[self._rows[k]] = self._asked.reshape(self._shape)[self._slots[k], k]
        contact.take(reaction=reaction)

    def _asked_by(self, r: np.ndarray) -> np.ndarray:
        return self._asked_in_all - self._times(self._coupling, r)

    def _map(self, k: int) -> ReturnMap:
        spring = self._spring[self._slots[k]]
        return ReturnMap(spring, spring)

    def _balanced(self, r: np.ndarray) -> np.ndarray:
        """Newton's method from reactions, with sweeps of one contact after another where it does not help."""
        left, slope = self._left(r)
        size = np.linalg.norm(left, axis=1)
        for _ in range(MOST):
            scale = np.linalg.norm(self._asked_in_all, axis=1) + np.linalg.norm(r, axis=1)
            if (size <= ROUNDED * scale).all():
                break
            trial = r + self._times(np.linalg.pinv(slope, SINGULAR), left)
            trial_left, trial_slope = self._left(trial)
            trial_size = np.linalg.norm(trial_left, axis=1)
            stays = ~(trial_size <= HELPS * size)
            if stays.any() and (size > ROUNDED * scale)[stays].any():
                swept = r
                for _ in range(SWEEPS):
                    swept = self._swept(swept)
                trial[stays] = swept[stays]
                trial_left, trial_slope = self._left(trial)
                trial_size = np.linalg.norm(trial_left, axis=1)
            done = size <= ROUNDED * scale
            for one, other in (
                (trial, r),
                (trial_left, left),
                (trial_slope, slope),
                (trial_size, size),
            ):
                one[done] = other[done]
            r, left, slope, size = trial, trial_left, trial_slope, trial_size
        return r

    def _left(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """``R(a) - r`` and minus its derivative ``I + R_a C``, ``a`` what the reactions ``r`` make of the others' share."""
        made, by_asked, _ = self._linearised(self._asked_by(r))
        slope = np.eye(r.shape[1]) + by_asked @ self._coupling
        return made - r, slope

    def _linearised(self, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Reactions that the maps make, and derivatives by what is asked and by the motion, block diagonal."""
        m, n, dim = self._shape
        made, blocks = np.zeros(self._shape), np.zeros((2, m, n, dim, n, dim))
        for k, (slots, law, motion) in enumerate(zip(self._slots, self._laws, self._motion)):
            mine = asked.reshape(self._shape)[slots, k]
            made[slots, k], _, *derivatives = self._map(k).linearised(law, mine, *motion)
            for block, derivative in zip(blocks, derivatives):
                block[slots, k, :, k] = derivative
        by_asked, by_motion = blocks.reshape(2, m, n * dim, n * dim)
        return made.reshape(m, -1), by_asked, by_motion

    def _swept(self, r: np.ndarray) -> np.ndarray:
        """One sweep: each contact's reactions, the others' given."""
        r = r.copy()
        for k, (slots, law, motion) in enumerate(zip(self._slots, self._laws, self._motion)):
            asked = self._asked_by(r).reshape(self._shape)[slots, k]
            r.reshape(self._shape)[slots, k], _ = self._map(k)(law, asked, *motion)
        return r

    @staticmethod
    def _times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        return (matrices @ vectors[:, :, None])[:, :, 0]

    # -- derivatives ---------------------------------------------------------------------------

    def coupled(self, derivatives: list) -> list:
        """Derivatives of new reactions by the forces on the nodes and by the motion, from those by what each is asked for.

        Args:
            derivatives: For each contact ``R_r`` and ``R_u``, ``shape=(n, gdim, gdim)``, local frame; changed in place.
        """
        _, by_asked, by_motion = self._linearised(self._asked)
        C, F = self._coupling, self._stacked
        inverse = C @ np.linalg.pinv(np.eye(C.shape[1]) + by_asked @ C, SINGULAR)
        shape = *self._shape, self._shape[-1]
        asked, moved = ((-inverse @ part @ F).reshape(shape) for part in (by_asked, by_motion))
        for k, (by_reaction, by_slip) in enumerate(derivatives):
            rows, slots = self._rows[k], self._slots[k]
            back = self._frames[slots, k].transpose(0, 2, 1)
            by_slip[rows] += by_reaction[rows] @ moved[slots, k] @ back
            by_reaction[rows] += by_reaction[rows] @ asked[slots, k] @ back
        return derivatives
