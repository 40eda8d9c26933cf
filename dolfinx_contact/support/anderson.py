# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Anderson acceleration (type II) of a fixed-point iteration x <- x + g(x).

It needs one global reduction per iteration.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


class Anderson:
    """Anderson acceleration: combines the last corrections so that their norm is minimal.

    Equations as in H. F. Walker and P. Ni, SIAM J. Numer. Anal. 49 (2011), Section 2: with the
    differences dX, dG of iterates and corrections, x <- x + g - (dX + dG) gamma, where gamma is the
    least-squares solution of dG gamma = g.

    Args:
        size: Number of unknowns of this rank.
        depth: Number of differences kept; memory is two vectors for each.
        total: Function that sums an array over all ranks.
    """

    def __init__(self, size: int, depth: int, total: Callable):
        self._moves = np.empty((depth, size))  # dX + dG
        self._dg = np.empty((depth, size))
        self._gram = np.zeros((depth, depth))
        self._total = total
        self.restart()

    def restart(self) -> None:
        """Discard all differences: the next step is a plain fixed-point step."""
        self._count = 0
        self._last = None

    def step(self, x: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the next iterate, given ``x`` and correction ``g``, and the norm of ``g``."""
        depth = self._dg.shape[0]
        row = None
        if self._last is not None:
            row = self._count % depth
            np.subtract(g, self._last[1], out=self._dg[row])
            np.subtract(x, self._last[0], out=self._moves[row])
            self._moves[row] += self._dg[row]
            self._count += 1
        self._last = (x, g)
        m = min(self._count, depth)
        dg = self._dg[:m]
        newest = np.zeros(m) if row is None else dg @ dg[row]
        sums = self._total(np.concatenate((newest, dg @ g, [g @ g])))
        norm = float(np.sqrt(sums[-1]))
        if row is None:
            return x + g, norm
        self._gram[row, :m] = self._gram[:m, row] = sums[:m]
        gamma = _solve(self._gram[:m, :m], sums[m:-1])
        return x + g - gamma @ self._moves[:m], norm


def _solve(gram: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    """Solve a least-squares problem by its normal equations, with columns scaled to unit length.

    Directions in which the Gram matrix is singular to rounding are left out.
    """
    length = np.sqrt(np.diag(gram))
    if not np.isfinite(gram).all() or (length == 0.0).all():
        return np.zeros_like(rhs)
    scale = np.divide(1.0, length, out=np.zeros_like(length), where=length > 0.0)
    scaled = gram * scale[:, None] * scale
    return scale * np.linalg.lstsq(scaled, rhs * scale, rcond=4e-15)[0]
