# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What part of a step is taken: the largest half, quarter, ... that helps."""

from __future__ import annotations

from collections.abc import Iterator

# Part of a step's length by which what is left has to fall [L. Armijo, Pacific J. Math. 16 (1966) 1].
ARMIJO_FACTOR = 1e-4


def halves(shortest: float) -> Iterator[float]:
    """1, 1/2, 1/4, ..., no less than ``shortest``."""
    length = 1.0
    while length >= shortest:
        yield length
        length /= 2


def enough(length: float) -> float:
    """Part of what is left that may be left after a step of this length."""
    return 1 - ARMIJO_FACTOR * length
