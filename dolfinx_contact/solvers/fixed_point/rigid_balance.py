# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Equilibrium along soft motions: rigid modes on soft supports, bending of slender bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.support.line_search import halves

if TYPE_CHECKING:
    from petsc4py import PETSc

    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.interface import ContactPoints
    from dolfinx_contact.law.maps import NodalMap
    from dolfinx_contact.step.load_step import LoadStep, StepState

# A motion counts as soft if the springs of the preconditioner raise its stiffness by more than this
# factor.  The reference paper's punch (factor 20; with flat elements at the contact up to 160)
# gains nothing from a separate balance; a block on springs of a hundredth of its stiffness (up to
# 2300) needs less than half the iterations.
STIFFENING_FACTOR = 200.0

# Eigenvalue of the scaled energy matrix, relative to the largest, below which motions are linearly
# dependent.
DEPENDENT_PART = 1e-10

# Newton's method ends when the generalised forces are below this part of the norm of all nodal
# forces, or after NEWTON_STEPS steps.
SMALL_RESIDUAL = 1e-3
NEWTON_STEPS = 20

# Smallest step length of its line search, relative to the full Newton step.
SHORTEST_STEP = 2.0**-11

# Stiffness, relative to the largest, that counts as zero; number of lengths tried along a motion
# without stiffness; part of the generalised forces below which such a length is accepted.
FREE_SLOPE = 1e-9
LENGTHS_TRIED = 60
RESIDUAL_LEFT = 0.9


class RigidBalance:
    """Equilibrium of a body along its soft motions, solved by Newton's method.

    The springs of the preconditioner restrain motions with little elastic stiffness: rigid-body
    modes on soft supports, bending of slender bodies.  A fixed-point iteration therefore hardly
    changes them. Their equilibrium ``Z^T (f - K u + R(K u - f, u)) = 0``, with the nodal map ``R``,
    is solved for a few coefficients ``c`` of ``u + Z c``; this needs products at the contact nodes
    only.  Every Newton step is halved until the generalised forces along ``Z`` decrease.

    Args:
        body: The elastic body with its assembled stiffness.
        A: The stiffness plus springs of the preconditioner, a PETSc matrix.
        modes: Candidate motions, ``shape=(owned dofs, k)``.  Collective.

    Attributes:
        modes: The soft motions ``Z``, ``shape=(owned dofs, m)``.
        forces: ``K Z``, ``shape=(owned dofs, m)``.
    """

    def __init__(self, body: ElasticBody, A: PETSc.Mat, modes: np.ndarray):
        self._body = body
        forces = np.array([body.multiply(z) for z in modes.T]).T
        right, left = A.createVecs()
        stiffened = np.empty_like(modes)
        for z, column in zip(modes.T, stiffened.T):
            right.array_w[:] = z
            A.mult(right, left)
            column[:] = left.array_r
        energy, all_energy = body.total([modes.T @ forces, modes.T @ stiffened])
        # Motions orthonormal in the energy of A; their eigenvalue is the part of K in it, 1 without
        # springs.
        root = _inverse_root(all_energy)
        share, vectors = np.linalg.eigh(root.T @ (energy + energy.T) @ root / 2)
        soft = root @ vectors[:, share < 1 / STIFFENING_FACTOR]
        self.modes, self.forces = modes @ soft, forces @ soft
        self._energy = soft.T @ energy @ soft
        if len(self):  # unknowns other than displacements are left out
            diagonal, are = A.getDiagonal().array_r, body.displacements.are
            self._scale = np.where(are, 1 / np.sqrt(np.where(are, diagonal, 1.0)), 0.0)

    def __len__(self) -> int:
        """Number of soft motions."""
        return len(self._energy)

    def balanced(
        self, x: np.ndarray, step: LoadStep, maps: Sequence[NodalMap], before: StepState
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Move a displacement along the soft motions into equilibrium.

        Args:
            x: Displacement of owned degrees of freedom.
            step: The load step.
            maps: Nodal map of each contact.
            before: A nearby state.

        Returns:
            The new displacement, the forces ``step.forces`` there, and the motions of driven
            surfaces.  If Newton's method finds no decrease, the displacement is unchanged.
        """
        start = (x, step.forces(x), before.c)
        if len(self) == 0:
            return start
        x, forces, _ = start
        left, slope, size, before = self.left(x, forces, step, maps, before)
        for _ in range(NEWTON_STEPS):
            if np.linalg.norm(left) <= SMALL_RESIDUAL * size:
                break
            direction = self._limited(np.linalg.lstsq(slope, left, rcond=1e-13)[0])
            for length in halves(SHORTEST_STEP):
                way = length * direction
                trial = x + self.modes @ way, forces - self.forces @ way
                result = self.left(*trial, step, maps, before)
                if np.linalg.norm(result[0]) < np.linalg.norm(left):
                    break
            else:
                trial, result = self._across((x, forces), left, slope, step, maps, before)
                if trial is None:
                    return start
            (x, forces), (left, slope, size, before) = trial, result
        return x, forces, before.c

    def _across(
        self,
        start: tuple[np.ndarray, np.ndarray],
        left: np.ndarray,
        slope: np.ndarray,
        step: LoadStep,
        maps: Sequence[NodalMap],
        near: StepState,
    ) -> tuple:
        """Search along a motion without stiffness, as when all contact nodes slip.

        The search follows the motion in the direction of the loads.  The length is doubled until
        the generalised forces decrease enough, or bisected once they change sign.

        Returns:
            The displacement with its forces, and the result of ``left`` there; ``(None, None)`` if
            no length is found, or if the body is not held by contact alone.
        """
        if self._body.loose is None:
            return None, None
        _, values, vectors = np.linalg.svd(slope)
        free = vectors[values <= FREE_SLOPE * values[0]]
        way, before = free.T @ (free @ left), np.linalg.norm(left)
        low, high, length = 0.0, np.inf, 1.0
        for _ in range(LENGTHS_TRIED):
            c = length * way
            if not c.any() or (self._limited(c) != c).any():
                break
            trial = start[0] + self.modes @ c, start[1] - self.forces @ c
            result = self.left(*trial, step, maps, near)
            if np.linalg.norm(result[0]) < RESIDUAL_LEFT * before:
                return trial, result
            low, high = (length, high) if result[0] @ way > 0.0 else (low, length)
            length = 2 * length if high == np.inf else (low + high) / 2
        return None, None

    def _limited(self, c: np.ndarray) -> np.ndarray:
        """Return the step ``c``, scaled down to displacements of at most the body's size.

        Only the step of a body held by contact alone is limited: it could lose its contact for
            good.
        """
        if self._body.loose is None:
            return c
        return c * min(
            1.0, self._body.extent / (self._body.largest(np.abs(self.modes @ c)) or np.inf)
        )

    def left(
        self,
        x: np.ndarray,
        forces: np.ndarray,
        step: LoadStep,
        maps: Sequence[NodalMap],
        before: StepState,
    ) -> tuple[np.ndarray, np.ndarray, float, StepState]:
        """Evaluate the residual along the soft motions at a displacement.

        Forces are scaled by one over the square root of the nodal stiffness in ``A``, so that norms
        are square roots of energies.

        Returns:
            Generalised forces ``Z^T residual``, ``shape=(m,)``; minus their derivative, ``shape=(m,
            m)``; norm of the residual at all nodes; and the state.
        """
        n, surfaces = len(self), step.surfaces
        slope, pushed, pushing = np.zeros((n, n)), 0.0, 0.0
        state, derivatives = step.linearise(x, maps, forces=forces, c=before.c, before=before)
        for k, (contact, both) in enumerate(zip(step.contacts, derivatives)):
            Z, KZ = contact.points.motion(self.modes), contact.points.reactions(self.forces)
            change = both[0] @ KZ + both[1] @ Z
            slope -= np.tensordot(Z, change, ((0, 1), (0, 1)))
            if surfaces is not None:
                axes = surfaces.axes[k]
                pushed = pushed + np.tensordot(axes, change, ((0, 1), (0, 1)))
                pushing = pushing + np.tensordot(Z, both[1] @ axes, ((0, 1), (0, 1)))
        if surfaces is not None:  # their motions are eliminated
            pushed = self._body.total(pushed)
            resisting = surfaces.tangent(step.contacts, derivatives)
            slope -= pushing @ np.linalg.solve(resisting, pushed)
        left = state.residual
        scaled = self._scale * left
        sums = np.concatenate((self.modes.T @ left, slope.ravel(), [scaled @ scaled]))
        sums = self._body.total(sums)  # one reduction
        slope = self._energy + sums[n:-1].reshape(n, n)
        return sums[:n], slope, np.sqrt(sums[-1]), state


def contact_responses(body: ElasticBody, points: Sequence[ContactPoints]) -> np.ndarray:
    """Displacements of the body under forces and moments on each contact.

    The result has ``shape=(owned dofs, m)``.  The displacements include the bending of a slender
    body.  Each one costs a solve with the stiffness. Collective.
    """
    rigid, motions = body.rigid_modes(), [np.zeros((body.size, 0))]
    for one in points:
        for z in rigid.T:
            forces = np.zeros(body.size)
            one.add_forces(one.motion(z), forces)
            forces[body.fixed] = 0.0
            if body.norm(forces) > 0.0:
                motions.append(body.solve(forces, rough=True)[:, None])
    return np.concatenate(motions, axis=1)


def _inverse_root(energy: np.ndarray) -> np.ndarray:
    """Return ``R`` with ``R^T energy R = I``, without linearly dependent directions."""
    scale = 1 / np.sqrt(np.diag(energy))
    values, vectors = np.linalg.eigh(scale[:, None] * energy * scale)
    kept = values > DEPENDENT_PART * values[-1]
    return scale[:, None] * vectors[:, kept] / np.sqrt(values[kept])
