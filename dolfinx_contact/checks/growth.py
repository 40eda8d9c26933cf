# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Spurious growth of a rotating body in linear elasticity.

In linear elasticity, points of a rotating body move along the tangents of circles.  So a
rotation by ``theta`` enlarges the body by ``theta^2 / 2`` of its size without stress.  This
matters if contact and supports prevent a growth that is comparable with the deformation that
they cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from dolfinx_contact.bodies.rigid_motion import rigid_modes
from dolfinx_contact.contact.contact_step import step_of
from dolfinx_contact.surfaces.surface import cross, rotation_less_one

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.surfaces.driven import DrivenSurfaces

# Approximate number of nodes per rank that determine the rotation of the body.
SAMPLED_NODES = 2000

# Fraction of a length that may be rounding.  Smallest fraction of the growth that counts as
# prevented; below it, the strain of the body alone explains the remainder.
LENGTH_ROUNDING = 1e-13
HINDERED_PART = 1e-2


class Turn:
    """Mean rotations of the connected parts of a body, and growth due to them.  Collective.

    Args:
        body: The body.
    """

    def __init__(self, body: ElasticBody):
        self._body, displacements = body, body.displacements
        self._part, self._count = body.parts
        nodes = np.arange(displacements.count)[:: displacements.count // SAMPLED_NODES + 1]
        x, here = displacements.x[nodes, : displacements.dim], self._part[nodes]
        sums = np.zeros((self._count, displacements.dim + 1))
        np.add.at(sums, here, np.column_stack((x, np.ones(len(x)))))
        sums = body.total(sums)
        self._middle = sums[:, :-1] / np.maximum(sums[:, -1:], 1.0)
        turning = _turning(x - self._middle[here])
        m = turning.shape[2]
        squares = np.zeros((self._count, m, m))
        np.add.at(squares, here, turning.transpose(0, 2, 1) @ turning)
        fit = (
            turning
            @ np.linalg.pinv(body.total(squares), rcond=LENGTH_ROUNDING, hermitian=True)[here]
        )
        rows = np.broadcast_to((m * here[:, None] + np.arange(m))[:, None], fit.shape)
        columns = np.broadcast_to(displacements.dofs(nodes)[:, :, None], fit.shape)
        places = rows.ravel(), columns.ravel()
        self._fit = sparse.csr_matrix((fit.ravel(), places), (m * self._count, displacements.size))

    def angles(self, u: np.ndarray) -> np.ndarray:
        """Rotation vector of each part, ``shape=(parts, 3)``, in 2-D ``(parts, 1)``, radians.
        Collective.

        It is a least-squares fit over the nodes of the part.

        Args:
            u: Displacement, owned degrees of freedom.
        """
        return self._body.total(self._fit @ u).reshape(self._count, -1)

    def share(self, contacts: Sequence[Contact], u: np.ndarray, angles: np.ndarray) -> float:
        """Ratio of the growth prevented by contact and supports to their deformation of the body.

        Both are root mean squares of motions: along the normals of nodes in contact (or in contact
        if the body had not grown), and along constrained degrees of freedom.  Motions that
        rigid-body modes and free motions of the surfaces can produce are subtracted.  The ratio is
        zero if the body can grow freely.  Collective.

        Args:
            contacts: All contacts, in the state of ``u``.
            u: Displacement, owned degrees of freedom.
            angles: Rotation vectors, as the method ``angles`` returns them.
        """
        body, displacements = self._body, self._body.displacements
        motions = self._motions(u, angles)
        driven, rows, touching = self._driven(contacts), [], False
        count = 0 if driven is None else driven.count
        for k, contact in enumerate(contacts):
            moved, gap = _moved(contact, u, motions)
            felt = (contact.reaction[:, -1] > 0.0) | (gap < moved[:, -1, 0])
            free = driven.axes[k] if count else np.zeros((*moved.shape[:2], 0))
            rows.append(np.concatenate((moved, free), axis=2)[felt, -1])
            touching = touching or felt.any()
        if not body.total(np.array([float(touching)]))[0]:
            return 0.0
        fixed = body.fixed[displacements.are[body.fixed]]
        rows.append(np.column_stack((motions[fixed], np.zeros((len(fixed), count)))))
        grown, deformed = _left(body, np.concatenate(rows))
        if grown == 0.0:
            return 0.0
        return float(np.sqrt(grown / deformed)) if deformed > 0.0 else np.inf

    def _driven(self, contacts: Sequence[Contact]) -> DrivenSurfaces | None:
        """Surfaces driven by forces, or None without such surfaces.  Collective."""
        if not any(contact.surface.motions for contact in contacts):
            return None
        from dolfinx_contact.surfaces.driven import DrivenSurfaces

        return DrivenSurfaces(self._body, [step_of(contact) for contact in contacts])

    def _motions(self, u: np.ndarray, angles: np.ndarray) -> np.ndarray:
        """Growth, displacement without rotation, and rigid-body modes of all parts, as columns.

        Args:
            u: Displacement, owned degrees of freedom.
            angles: Rotation vectors of the parts.

        Returns:
            ``shape=(owned dofs, 2 + m)`` for m modes.
        """
        displacements = self._body.displacements
        x, moved = (
            displacements.x[: displacements.count, : displacements.dim],
            displacements.rows(u),
        )
        arms = x - self._middle[self._part]
        grown, turned = np.zeros_like(arms), np.zeros_like(arms)
        for k, angle in enumerate(angles):
            here = self._part == k
            if angle.any():
                grown[here] = -0.5 * cross(angle, cross(angle, arms[here]))
                turned[here] = arms[here] @ rotation_less_one(angle).T
        ends = x + moved
        modes = [rigid_modes(ends, self._part == k, self._body.comm) for k in range(self._count)]
        columns = np.stack((grown, moved - turned), axis=2)
        return np.column_stack([displacements.vectors(columns), *map(displacements.vectors, modes)])


def _moved(contact: Contact, u: np.ndarray, motions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Motions, ``shape=(n, gdim, m)``, and gaps, ``shape=(n,)``, of contact nodes.

    Motions are components in the local frames at displacement ``u``.

    Args:
        contact: The contact.
        u: Displacement, owned degrees of freedom.
        motions: Displacement fields, ``shape=(owned dofs, m)``.
    """
    if not contact.surface.curved or contact.surface.deformable:
        return contact.points.motion(motions), contact.present.gap
    surface, there = contact.geometry.ended_at(u)
    y = surface.relative(there)
    frames = surface.turned(surface.frames(y))
    return frames @ motions[contact.points.dofs], surface.distance(y) + contact.opening


def _left(body: ElasticBody, rows: np.ndarray) -> np.ndarray:
    """Sums of squares of the first two columns after projection, ``shape=(2,)``.  Collective.

    The components in the span of all other columns are removed by least squares.

    Args:
        body: The body.
        rows: This rank's rows of the columns.
    """
    left, rest = rows[:, :2].copy(), rows[:, 2:]
    size = np.sqrt(body.total((rest**2).sum(axis=0)))
    rest = rest / np.where(size > 0.0, size, 1.0)
    inverse = np.linalg.pinv(body.total(rest.T @ rest), rcond=LENGTH_ROUNDING, hermitian=True)
    for _ in range(2):  # the second pass removes rounding errors of the first
        left -= rest @ (inverse @ body.total(rest.T @ left))
    squares, all_ = body.total(np.array([(left**2).sum(axis=0), (rows[:, :2] ** 2).sum(axis=0)]))
    return np.where(squares > np.square([HINDERED_PART, LENGTH_ROUNDING]) * all_, squares, 0.0)


def _turning(arms: np.ndarray) -> np.ndarray:
    """Displacements of lever arms in unit rotations about each axis, ``shape=(n, gdim, 3)``.

    In 2-D, the shape is ``(n, 2, 1)``.
    """
    axes = np.eye(1 if arms.shape[1] == 2 else 3)
    return np.stack([cross(axis, arms) for axis in axes], axis=2)
