# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Line search by halving: step lengths, and the condition of sufficient decrease."""

from __future__ import annotations

from collections.abc import Iterator

# Relative decrease of the residual norm required per unit step length
# [L. Armijo, Pacific J. Math. 16 (1966) 1].
ARMIJO_FACTOR = 1e-4


def halves(shortest: float) -> Iterator[float]:
    """Yield the step lengths 1, 1/2, 1/4, ..., not below ``shortest``."""
    length = 1.0
    while length >= shortest:
        yield length
        length /= 2


def enough(length: float) -> float:
    """Return the largest accepted ratio of residual norms for a step length (Armijo condition)."""
    return 1 - ARMIJO_FACTOR * length
