# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
r"""Local contact problem of a single node on a spring, with several contact surfaces at once.

The reactions ``r_c`` of the contacts c satisfy

.. math:: r_c = R_c(s_c F_c (p - \sum_{d} F_d^T r_d), w_c)

with the force ``p`` on the node, return maps ``R_c``, frames ``F_c``, and gaps and slips ``w_c``.
The sum is over the contacts d with another normal than c.  Contacts with the same normal share the
remaining force in the ratio of ``s_c``, which is one for all other contacts.  The spring, the same
for all contacts, moves the node by ``(sum F^T r - p) / spring``.  The solver is a semismooth Newton
method with Gauss-Seidel sweeps over the contacts as fallback.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dolfinx_contact.contact.geometry import times
from dolfinx_contact.law.maps import NodalLaw, ReturnMap
from dolfinx_contact.support.checks import UNIT_ROUNDOFF

# Limit of Newton iterations.  Iterations within which the smallest residual must halve, before and
# after it meets the tolerance.  Iterations without progress before Gauss-Seidel sweeps replace a
# Newton step that does not halve the residual, and the number of these sweeps.
NEWTON_STEPS = 30
HALVING_STEPS = 8
AT_END = 2
FREE_STEPS = 3
SWEEPS_INSTEAD = 4

# Fraction of the tolerance at which the iteration stops.
TOLERANCE_PART = 1e-2

# Residual, relative to the size of its terms, that may be rounding.  Largest ratio of residuals
# after and before that counts as progress.
RESIDUAL_ROUNDING = 64 * UNIT_ROUNDOFF
LEAST_REDUCTION = 0.5

# Singular values below this fraction of the largest count as zero.  The minimum-norm Newton step
# does not change reactions along their directions.
SINGULAR_DIRECTION = 1e-11


class Part(NamedTuple):
    """Data of one of ``n`` contacts at the ``k`` of ``m`` nodes that belong to it."""

    slots: np.ndarray  # indices of the nodes, (k,)
    law: NodalLaw  # compiled law of these nodes
    spring: np.ndarray  # spring stiffness, force per length, (k,)
    gap: np.ndarray  # gap, length, (k,)
    slip: np.ndarray  # slip increment, length, local frame, (k, gdim - 1)


class NodalProblems:
    """Local contact problems of ``m`` nodes with ``n`` contacts.

    Reactions of all contacts are stacked, ``shape=(m, n gdim)``, local frames.

    Args:
        parts: Data of each contact.
        frames: Local frames ``F_c``, ``shape=(m, n, gdim, gdim)``; zero where a node does not
            belong to a contact.
        force: Force ``p`` on each node, ``shape=(m, gdim)``, global frame.
        alike: Whether two contacts have the same normal, ``shape=(m, n, n)``, bool, false on the
            diagonal.
        shares: Ratio ``s_c`` in which contacts with the same normal share the force,
            ``shape=(m, n)``.
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
        """Trial reactions ``s_c F_c (p - sum_d F_d^T r_d)``, the arguments of the return maps.

        Args:
            r: Reactions, ``shape=(m, n gdim)``.

        Returns:
            ``shape=(m, n gdim)``, force, local frames.
        """
        return self._all - times(self.coupling, r)

    def _error_bound(self, r: np.ndarray, tol: float) -> np.ndarray:
        """Absolute error bound for the relative tolerance ``tol``, ``shape=(m,)``, force."""
        return max(tol, RESIDUAL_ROUNDING) * (self._terms + np.linalg.norm(r, axis=1))

    def balanced(self, r: np.ndarray, tol: float) -> tuple[np.ndarray, np.ndarray]:
        """Reactions that solve the local problems, and an error measure, ``shape=(m,)``, force.

        If the iteration does not converge, the iterate with the smallest residual is returned.  The
        error measure is the sum of the residual, of the net force on the spring (its displacement
        times its stiffness), and of the error bound for ``tol``.

        Args:
            r: Initial reactions, ``shape=(m, n gdim)``.
            tol: Tolerance, relative to the forces and springs of the node.
        """
        left, slope = self._left(r)
        size = np.linalg.norm(left, axis=1)
        best, smallest = r, size
        halved, since = size, np.zeros(size.size, dtype=int)
        spent = np.zeros(size.size, dtype=bool)  # sweeps from the best iterate gave no improvement
        for _ in range(NEWTON_STEPS):
            patience = np.where(size <= self._error_bound(r, tol), AT_END, HALVING_STEPS)
            goes_on = ~(size <= self._error_bound(r, TOLERANCE_PART * tol)) & (since < patience)
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
                    swept = self._after_sweep(swept)
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
        return best, smallest + np.linalg.norm(moved, axis=1) + self._error_bound(best, tol)

    def _left(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual, return map minus ``r``, and the negative of its derivative by ``r``."""
        made, by_asked, _ = self.linearised(self.asked(r))
        return made - r, np.eye(r.shape[1]) + by_asked @ self.coupling

    def linearised(self, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Results of the return maps, and their derivatives by trial reactions and by motions.

        Args:
            asked: Trial reactions, as ``asked`` returns them, ``shape=(m, n gdim)``.

        Returns:
            ``shape=(m, n gdim)``, and twice ``(m, n gdim, n gdim)``, block diagonal.
        """
        m, n, dim = self._shape
        made, blocks = np.zeros(self._shape), np.zeros((2, m, n, dim, n, dim))
        for k, (slots, law, spring, gap, slip) in enumerate(self._parts):
            mine, map = asked.reshape(self._shape)[slots, k], ReturnMap(spring, spring)
            made[slots, k], _, *derivatives = map.linearised(law, mine, gap, slip)
            for block, derivative in zip(blocks, derivatives):
                block[slots, k, :, k] = derivative
        by_asked, by_motion = blocks.reshape(2, m, n * dim, n * dim)
        return made.reshape(m, -1), by_asked, by_motion

    def _after_sweep(self, r: np.ndarray) -> np.ndarray:
        """Reactions after one Gauss-Seidel sweep over the contacts."""
        r = r.copy()
        for k, (slots, law, spring, gap, slip) in enumerate(self._parts):
            asked = self.asked(r).reshape(self._shape)[slots, k]
            made, _ = ReturnMap(spring, spring)(law, asked, gap, slip)
            r.reshape(self._shape)[slots, k] = made
        return r
