# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Planes that force drives in the condensed problem: rows and columns for their motions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.surfaces.driven import DrivenSurfaces

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.step.load_step import LoadStep


class CondensedSurfaces:
    """Motions ``c`` of planes beside the reactions of the nodes, ``w = q + W r - D c``.

    Equilibrium of a plane, ``-D^T r - k c + F = 0``, is a tied row.  Of springs ``k`` that are stiffer than a node ``c``
    is eliminated: ``w = q + (W + D k^-1 D^T) r``, from where the spring is not stretched.

    Args:
        body: The body.
        contacts: Its contacts.
        turns: Rotations of the nodes' frames to the principal axes, ``shape=(n, dim, gdim)``.
        stiffness: Normal stiffness of all nodes, force per length.  Collective.

    Attributes:
        tied: Number of tied rows.
    """

    def __init__(
        self,
        body: ElasticBody,
        contacts: Sequence[ContactStep],
        turns: np.ndarray,
        stiffness: np.ndarray,
    ):
        surfaces = DrivenSurfaces(body, contacts)
        self._stiff = surfaces.springs > stiffness.max()
        self._stiffest, self._springs = float(stiffness.max()), surfaces.springs
        both = [_past_held(contact, axes) for contact, axes in zip(contacts, surfaces.axes)]
        self._axes, self._pulled = (
            np.concatenate(body.comm.allgather(_turned(turns, part))) for part in zip(*both)
        )
        self.tied = int((~self._stiff).sum())

    def border(self, W: np.ndarray, nodal: int) -> np.ndarray:
        """``W`` with the planes.

        Args:
            W: Compliance, length per force.
            nodal: How many of its rows are of nodes.
        """
        stiff, loose, size = self._stiff, ~self._stiff, len(W)
        W[:nodal, :nodal] += self._axes[:, stiff] / self._springs[stiff] @ self._pulled[:, stiff].T
        bordered = np.zeros((size + self.tied,) * 2)
        bordered[:size, :size] = W
        bordered[:nodal, size:] = -self._axes[:, loose]
        bordered[size:, :nodal] = -self._pulled[:, loose].T
        bordered[size:, size:] = -np.diag(self._springs[loose])
        return bordered

    def begun(self, step: LoadStep, free: np.ndarray) -> np.ndarray:
        """Where planes begin: where they were; where springs are not stretched if these are eliminated; all near the body.

        Args:
            step: The step.
            free: Displacement of owned degrees of freedom without reactions.
        """
        c = step.surfaces.at_rest(step.no_motions, self._stiffest)
        self._at_first = step.surfaces.touched(step.contacts, free, c)
        return self._at_first

    def moved(self, force: np.ndarray) -> np.ndarray:
        """Where forces of all rows, the tied rows' last, have the planes."""
        moved, stiff = np.zeros(len(self._springs)), self._stiff
        moved[~stiff] = force[len(force) - self.tied :]
        reactions = force[: len(self._axes)]
        moved[stiff] = -(reactions @ self._pulled[:, stiff]) / self._springs[stiff]
        return self._at_first + moved

    def distances(self, others: np.ndarray, q: np.ndarray) -> np.ndarray:
        """How far steps are from that of ``q``, length units; forces that drive planes count by their part of the largest."""
        apart, lengths, forces = np.abs(others - q), q[: -self.tied], q[-self.tied :]
        largest = np.abs(forces).max() or 1.0
        apart[:, -self.tied :] *= np.abs(lengths).max() / largest
        return apart.max(axis=1)

    def driving(self, step: LoadStep, c: np.ndarray) -> np.ndarray:
        """Forces that drive the planes of the tied rows, in motions of all."""
        return step.surfaces.driving(c)[~self._stiff]


def _turned(turns: np.ndarray, axes: np.ndarray) -> np.ndarray:
    rows = np.einsum("nij,njm->nim", turns, np.concatenate(axes))
    return rows.reshape(-1, rows.shape[2])


def _past_held(contact: ContactStep, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``D``, and what of it the reactions without those along held directions pull by: friction there goes with the normal one."""
    if contact.dragged is None:
        return axes, axes
    moved, rows = axes.copy(), contact.dragged.any(axis=1)
    moved[rows, :-1] = 0.0
    pulled, drag = moved.copy(), contact.friction.drag(contact.dragged)
    pulled[:, -1] -= np.einsum("nt,ntm->nm", drag, axes[:, :-1])
    return moved, pulled
