# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Newton's method for hard steps: the law with its corner rounded off, and past folds dragged."""

from __future__ import annotations

from contextlib import closing

import numpy as np

from dolfinx_contact.newton_krylov import NewtonKrylov

# Rounding over the load displacement, once a step without it is SHORT: at first this part of the error, below
# FINEST none at all.
START, FINEST = 0.1, 1e-11

# It shrinks to a tenth where Newton's step is whole and leaves a quarter of the residual, less elsewhere.
QUICKEST, GOOD, FAIR = 0.1, 0.25, 0.6

# With rounding, a step shorter than SHORT means a fold: the rounded problem has no solution nearby. Springs of DRAG
# times the nodal stiffness then hold the slips back; a patch of nodes moves on against them, step by
# step, until it has slipped to where it rests, as it would in time.
SHORT, DRAG, STIFFEST = 0.25, 0.02, 1e3

# Newton's steps with the same springs, and the part of the residual that they may leave.
STEPS, LEFT = 8, 0.3

# Iterations after which the search is given up.
MOST = 600


class SmoothingNewton:
    """Newton's method, from the first short step on with a rounded law, whose rounding shrinks as the residual does.

    Between sticking and slipping the residual has kinks, at which a line search ends.  Rounded off
    (``smoothed_map.h``) it has none, and its solution is followed as the rounding shrinks.  Where slip is far
    from the normal of the cone that path may fold back, see docs/method.md.

    Args:
        search: The best iterate so far, and whether to go on.
    """

    def __init__(self, search):
        self._search, self._system = search, search.system
        self._rounding, self._drag, self._shrink = 0.0, 0.0, QUICKEST
        self._at_kinks = False

    def solve(self, x: np.ndarray) -> None:
        """Search from ``x`` on, until solved or ``MOST`` iterations are done; the search keeps the best."""
        search, before = self._search, self._search.iterations
        with closing(NewtonKrylov(self._system)) as self._newton:
            while search.iterations - before < MOST and self._drag < STIFFEST:
                self._system.round_off(0.0)
                x, _ = search.residual(x)
                if not search.goes_on:
                    break
                x = self._dragged(x) if self._drag > 0.0 else self._followed(x)
                if self._rounding < FINEST:
                    self._rounding = 0.0

    def _step(self, x: np.ndarray, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """After one step of Newton's method: iterate, its residual, and the length of the step."""
        self._system.linearise(x)
        dx, length, iterations = self._newton.step(x, residual)
        self._search.iterations += max(iterations, 1)
        x = x + length * dx
        return x, self._system.out_of_balance(x), length

    def _followed(self, x: np.ndarray) -> np.ndarray:
        """A step without springs; decides what the next one is like."""
        system = self._system
        system.round_off(self._rounding)
        residual = system.out_of_balance(x)
        following, left, length = self._step(x, residual)
        before, after = system.size(residual), system.size(left)
        if length < SHORT and not self._at_kinks:
            self._at_kinks, self._shrink = True, QUICKEST
            self._rounding = START * self._search.error
            return following
        if length < SHORT:
            self._drag = DRAG
        elif length == 1.0 and after <= GOOD * before:
            self._rounding *= self._shrink
            self._shrink = max(self._shrink**2, QUICKEST)
        elif after <= FAIR * before:
            self._rounding *= self._shrink**0.5
        else:
            self._shrink **= 0.5
        if length < 1.0:
            self._shrink = max(self._shrink, QUICKEST) ** 0.5
        return following if length > 0.1 else x

    def _dragged(self, x: np.ndarray) -> np.ndarray:
        """Steps while springs pull back to ``x``; decides their stiffness and the next rounding."""
        system, home, shortest = self._system, x, 1.0
        system.round_off(self._rounding, self._drag, home)
        residual = system.out_of_balance(home)  # without springs the same: they pull back to here
        before = system.size(residual)
        for _ in range(STEPS):
            x, residual, length = self._step(x, residual)
            left, shortest = system.size(residual), min(shortest, length)
            if left <= LEFT * before or length == 0.0:
                break
        system.round_off(self._rounding)
        after = system.size(system.out_of_balance(x))
        if left > LEFT * before:
            self._drag *= 4.0
            return x if left < before else home
        if shortest == 1.0 and after < 0.5 * before:
            self._drag *= 0.3
        if after < LEFT * before:
            self._rounding *= 0.3
            if self._drag < 0.01 * DRAG:
                self._drag, self._shrink = 0.0, 0.3
        return x
