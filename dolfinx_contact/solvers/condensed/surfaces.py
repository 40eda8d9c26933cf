# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Surfaces driven by force in the condensed problem: rows and columns for their motions."""

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
    """Motions of force-driven surfaces as unknowns of the condensed problem.

    With motions ``c``, the problem is ``w = q + W r - D c``.  The equilibrium of a surface, ``-D^T
    r - k c + F = 0``, is a bilateral constraint: a tied row behind the rows of the nodes.  If the
    spring ``k`` of a motion is stiffer than the stiffest node, ``c`` is eliminated instead: ``w = q
    + (W + D k^-1 D^T) r``, with ``c`` measured from the unstretched position of the spring.

    Args:
        body: The body.
        contacts: The contacts of the body.
        turns: Rotations from the nodes' frames to the principal axes of friction, ``shape=(n, dim,
            gdim)``.
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
        """Return the compliance ``W`` extended by the motions of the driven surfaces.

        Args:
            W: Compliance, length per force.  Its rows of nodes are changed in place.
            nodal: Number of its rows that belong to nodes.
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
        """Motions of the surfaces at the start of a load step, ``shape=(m,)``.

        A surface starts from its last position or, if its motion is eliminated, from the
        unstretched position of its spring.  A surface that no node touches is moved to the body.

        Args:
            step: The load step.
            free: Contact-free displacement of owned degrees of freedom.
        """
        c = step.surfaces.at_rest(step.first_motions, self._stiffest)
        self._at_first = step.surfaces.touched(step.contacts, free, c)
        return self._at_first

    def moved(self, force: np.ndarray) -> np.ndarray:
        """Motions of the surfaces for given unknowns of all rows, ``shape=(m,)``.

        Args:
            force: Reactions of the nodes, then the unknowns of the tied rows.
        """
        moved, stiff = np.zeros(len(self._springs)), self._stiff
        moved[~stiff] = force[len(force) - self.tied :]
        reactions = force[: len(self._axes)]
        moved[stiff] = -(reactions @ self._pulled[:, stiff]) / self._springs[stiff]
        return self._at_first + moved

    def distances(self, others: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Distance of earlier load steps from the present one, maximum norm, length units.

        Forces that drive surfaces are scaled to lengths by the largest displacement over the
        largest force.

        Args:
            others: ``q`` of earlier load steps, one per row.
            q: Displacements without reactions of the present step, then the driving forces.
        """
        apart, lengths, forces = np.abs(others - q), q[: -self.tied], q[-self.tied :]
        largest = np.abs(forces).max() or 1.0
        apart[:, -self.tied :] *= np.abs(lengths).max() / largest
        return apart.max(axis=1)

    def driving(self, step: LoadStep, c: np.ndarray) -> np.ndarray:
        """Driving forces of the tied rows, when the surfaces have the motions ``c``."""
        return step.surfaces.driving(c)[~self._stiff]


def _turned(turns: np.ndarray, axes: np.ndarray) -> np.ndarray:
    rows = np.einsum("nij,njm->nim", turns, np.concatenate(axes))
    return rows.reshape(-1, rows.shape[2])


def _past_held(contact: ContactStep, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Matrices of relative nodal motion and of pulling forces for surface motions.

    Both have ``shape=(n, gdim, m)``.  They differ only at nodes that supports hold tangentially
    while a driven surface slides past them. There, slip is prescribed: the first matrix is ``D``
    without the tangential rows, and the second adds the friction in proportion to the normal
    reaction.
    """
    if contact.dragged is None:
        return axes, axes
    moved, rows = axes.copy(), contact.dragged.any(axis=1)
    moved[rows, :-1] = 0.0
    pulled, drag = moved.copy(), contact.friction.drag(contact.dragged)
    pulled[:, -1] -= np.einsum("nt,ntm->nm", drag, axes[:, :-1])
    return moved, pulled
