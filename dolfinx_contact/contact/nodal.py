# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
r"""The contact problem of a node by itself, on a spring, with several surfaces at once.

.. math:: r_c = R_c(s_c F_c (p - \sum_{d} F_d^T r_d), w_c)

with the force ``p`` on the node, return maps ``R_c``, frames ``F_c``, gaps and slips ``w_c``, and the sum over contacts of other normals.
Contacts of the same normal share what is left with the parts ``s_c``, which are one for all others.  The spring, the same for all
contacts, moves the node by ``(sum F^T r - p) / spring``.  Semismooth Newton, and Gauss-Seidel sweeps over the contacts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dolfinx_contact.law.maps import NodalLaw, ReturnMap
from dolfinx_contact.support.checks import UNIT_ROUNDOFF

# Newton's steps at most, those in which a residual has to halve, the same once it is within the tolerance; those that need not
# help, and sweeps over the contacts in place of later ones that do not.
NEWTON_STEPS = 30
HALVING_STEPS = 8
AT_END = 2
FREE_STEPS = 3
SWEEPS_INSTEAD = 4

# Of the tolerance, what is as good as nothing.
TOLERANCE_PART = 1e-2

# A residual that is rounding, over the size of its terms, and what a step has to leave at most.
RESIDUAL_ROUNDING = 64 * UNIT_ROUNDOFF
LEAST_REDUCTION = 0.5

# Directions of reactions that change nothing, over the largest: the shortest step leaves them as they are.
SINGULAR_DIRECTION = 1e-11


class Part(NamedTuple):
    """One of ``n`` contacts at ``k`` of ``m`` nodes."""

    slots: np.ndarray  # which nodes, (k,)
    law: NodalLaw  # the kernel's, of these nodes
    spring: np.ndarray  # (k,)
    gap: np.ndarray  # (k,)
    slip: np.ndarray  # (k, gdim - 1)


class NodalProblems:
    """The problems of ``m`` nodes.  Reactions of all contacts are stacked, ``shape=(m, n gdim)``, local frames.

    Args:
        parts: Of each contact.
        frames: ``shape=(m, n, gdim, gdim)``, zero where a contact has not the node.
        force: ``p``, ``shape=(m, gdim)``, global frame.
        alike: Which contacts have the same normal, ``shape=(m, n, n)``.
        shares: ``s``, ``shape=(m, n)``.
    """

    def __init__(
        self,
        parts: list[Part],
        frames: np.ndarray,
        force: np.ndarray,
        alike: np.ndarray,
        shares: np.ndarray,
    ):
        self._parts, self._shape = parts, frames.shape[:3]
        m, n, dim = self._shape
        self.stacked = frames.reshape(m, n * dim, dim)
        others = ~(alike | np.eye(n, dtype=bool)).repeat(dim, axis=1).repeat(dim, axis=2)
        self.asks = shares.repeat(dim, axis=1)[:, :, None] * self.stacked
        self.coupling = self.asks @ self.stacked.transpose(0, 2, 1) * others
        self._force, self._all = force, times(self.asks, force)
        self._terms = np.linalg.norm(force, axis=1)
        for part in parts:
            lengths = np.abs(part.gap) + np.abs(part.slip).sum(axis=1)
            self._terms[part.slots] += part.spring * lengths

    def asked(self, r: np.ndarray) -> np.ndarray:
        """What reactions of the others leave to each contact."""
        return self._all - times(self.coupling, r)

    def _small(self, r: np.ndarray, tol: float) -> np.ndarray:
        """What is a part ``tol`` of the terms, or their rounding."""
        return max(tol, RESIDUAL_ROUNDING) * (self._terms + np.linalg.norm(r, axis=1))

    def balanced(self, r: np.ndarray, tol: float) -> tuple[np.ndarray, np.ndarray]:
        """Reactions that solve the problems, from a start, where the search fails the best of its states; what they leave, ``shape=(m,)``.

        That is what is left of the problem and what it moves the node, as forces, at least the accuracy.

        Args:
            r: The start.
            tol: Accuracy, over the forces and springs of the node.
        """
        left, slope = self._left(r)
        size = np.linalg.norm(left, axis=1)
        best, smallest = r, size
        halved, since = size, np.zeros(size.size, dtype=int)
        spent = np.zeros(size.size, dtype=bool)  # sweeps from the best have not helped
        for _ in range(NEWTON_STEPS):
            patience = np.where(size <= self._small(r, tol), AT_END, HALVING_STEPS)
            goes_on = ~(size <= self._small(r, TOLERANCE_PART * tol)) & (since < patience)
            if not goes_on.any():
                break
            trial = r.copy()
            trial[goes_on] += times(
                np.linalg.pinv(slope[goes_on], SINGULAR_DIRECTION), left[goes_on]
            )
            trial_left, trial_slope = self._left(trial)
            trial_size = np.linalg.norm(trial_left, axis=1)
            stays = goes_on & ~(trial_size <= LEAST_REDUCTION * size) & (since >= FREE_STEPS)
            if stays.any():
                swept = np.where(spent[:, None], r, best)
                spent = spent | stays
                for _ in range(SWEEPS_INSTEAD):
                    swept = self._swept(swept)
                trial[stays] = swept[stays]
                trial_left, trial_slope = self._left(trial)
                trial_size = np.linalg.norm(trial_left, axis=1)
            r, left = (
                np.where(goes_on[:, None], trial, r),
                np.where(goes_on[:, None], trial_left, left),
            )
            slope = np.where(goes_on[:, None, None], trial_slope, slope)
            size = np.where(goes_on, trial_size, size)
            better = size < smallest
            best, smallest = np.where(better[:, None], r, best), np.where(better, size, smallest)
            spent &= ~better
            helps = smallest <= LEAST_REDUCTION * halved
            halved, since = np.where(helps, smallest, halved), np.where(helps, 0, since + 1)
        moved = times(self.stacked.transpose(0, 2, 1), best) - self._force
        return best, smallest + np.linalg.norm(moved, axis=1) + self._small(best, tol)

    def _left(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the maps make of ``r`` minus ``r``, and minus its derivative."""
        made, by_asked, _ = self.linearised(self.asked(r))
        return made - r, np.eye(r.shape[1]) + by_asked @ self.coupling

    def linearised(self, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Reactions that the maps make, and derivatives by what is asked and by the motion, block diagonal."""
        m, n, dim = self._shape
        made, blocks = np.zeros(self._shape), np.zeros((2, m, n, dim, n, dim))
        for k, (slots, law, spring, gap, slip) in enumerate(self._parts):
            mine, map = asked.reshape(self._shape)[slots, k], ReturnMap(spring, spring)
            made[slots, k], _, *derivatives = map.linearised(law, mine, gap, slip)
            for block, derivative in zip(blocks, derivatives):
                block[slots, k, :, k] = derivative
        by_asked, by_motion = blocks.reshape(2, m, n * dim, n * dim)
        return made.reshape(m, -1), by_asked, by_motion

    def _swept(self, r: np.ndarray) -> np.ndarray:
        """One sweep: each contact's reactions, the others' given."""
        r = r.copy()
        for k, (slots, law, spring, gap, slip) in enumerate(self._parts):
            asked = self.asked(r).reshape(self._shape)[slots, k]
            made, _ = ReturnMap(spring, spring)(law, asked, gap, slip)
            r.reshape(self._shape)[slots, k] = made
        return r


def times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Products of a matrix and a vector each."""
    return (matrices @ vectors[:, :, None])[:, :, 0]
