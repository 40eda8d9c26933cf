# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Motions of a body that soft springs or slenderness hardly resist, balanced apart from the rest."""

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

# A motion is balanced apart if the springs of the preconditioner stiffen it more than this many times. The punch
# (20 times; with flat elements at the plane up to 160) gains nothing by it, a block on springs of a hundredth of its
# stiffness (up to 2300 times) more than halves its iterations.
STIFFENING_FACTOR = 200.0

# Motions whose part of their own, squared, is below this are combinations of others.
DEPENDENT_PART = 1e-10

# Newton's method ends when the forces along the motions are this small beside those on all nodes.
SMALL_RESIDUAL = 1e-3
NEWTON_STEPS = 20

# The shortest part of a step of it that is tried.
SHORTEST_STEP = 2.0**-11

# Part of the largest slope that is none; lengths that are tried along such a motion, and part of the forces that may be left.
FREE_SLOPE = 1e-9
LENGTHS_TRIED = 60
RESIDUAL_LEFT = 0.9


class RigidBalance:
    """Moves a body until the forces along its soft motions are in balance.

    The springs of the preconditioner hold motions that the body hardly resists, so an iteration
    hardly moves them: rigid ones on soft supports, the bending of slender bodies.  Their balance ``Z^T (f - K u + R(K u - f, u)) = 0``, ``R`` the nodal map, has a few
    unknowns ``c`` of ``u + Z c`` and needs products at the contact nodes only: Newton's method, every step
    halved until the forces along ``Z`` fall.

    Args:
        body: The elastic body, its stiffness assembled.
        A: The stiffness plus springs of the preconditioner, a PETSc matrix.
        modes: Motions that may be soft, ``shape=(owned dofs, k)``.  Collective.

    Attributes:
        modes: The soft motions ``Z``, ``shape=(owned dofs, m)``.
        forces: ``K Z``, of the same shape.
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
        # Motions orthonormal in the energy of A, by the share that K has in it: 1 where no spring acts.
        root = _inverse_root(all_energy)
        share, vectors = np.linalg.eigh(root.T @ (energy + energy.T) @ root / 2)
        soft = root @ vectors[:, share < 1 / STIFFENING_FACTOR]
        self.modes, self.forces = modes @ soft, forces @ soft
        self._energy = soft.T @ energy @ soft
        if len(self):  # of unknowns besides displacements nothing counts
            diagonal, are = A.getDiagonal().array_r, body.displacements.are
            self._scale = np.where(are, 1 / np.sqrt(np.where(are, diagonal, 1.0)), 0.0)

    def __len__(self) -> int:
        """Number of soft motions."""
        return len(self._energy)

    def balanced(
        self, x: np.ndarray, step: LoadStep, maps: Sequence[NodalMap], before: StepState
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """``x``, moved along the soft motions, or as it was if there is no way down; the step's ``forces`` there, and motions of surfaces.

        Args:
            x: Displacement of owned degrees of freedom.
            step: The ``LoadStep``.
            maps: Of the contacts.
            before: A state nearby.
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
        """Of a loose body with a motion that changes no forces, as where all nodes slip: to where one of them turns.

        Along that motion, the way that loads drive it, the length is doubled until less is left, and halved where that
        turns round.

        Returns:
            As a step of ``balanced``: a displacement and its forces, what is left there; None, None where there is no such place.
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
        """A step, of a body that contact alone holds no further than its size: it must not be lost."""
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
        """Forces along the motions, minus their derivative, the norm of the forces on all nodes, and the state.

        All in roots of energy: each force over the root of its node's stiffness in A.
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
        if surfaces is not None:  # which follow
            pushed = self._body.total(pushed)
            resisting = surfaces.tangent(step.contacts, derivatives)
            slope -= pushing @ np.linalg.solve(resisting, pushed)
        left = state.residual
        scaled = self._scale * left
        sums = np.concatenate((self.modes.T @ left, slope.ravel(), [scaled @ scaled]))
        sums = self._body.total(sums)  # one reduction
        slope = self._energy + sums[n:-1].reshape(n, n)
        return sums[:n], slope, np.sqrt(sums[-1]), state


def patch_motions(body: ElasticBody, points: Sequence[ContactPoints]) -> np.ndarray:
    """What the body gives way to forces and moments on each of its contacts, ``shape=(owned dofs, m)``.

    The bending of a slender body is among them.  One solve with the stiffness for each.  Collective.
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
    """R with R^T energy R the identity, without the directions that are combinations of others."""
    scale = 1 / np.sqrt(np.diag(energy))
    values, vectors = np.linalg.eigh(scale[:, None] * energy * scale)
    kept = values > DEPENDENT_PART * values[-1]
    return scale[:, None] * vectors[:, kept] / np.sqrt(values[kept])
