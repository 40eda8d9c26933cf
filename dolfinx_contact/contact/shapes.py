# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Monomial bases of the shape functions of facets."""

from __future__ import annotations

import numpy as np


def monomials(at: np.ndarray, corners: int, degree: int) -> np.ndarray:
    """Monomials that span the shape functions of an interval, triangle or quadrilateral.

    Args:
        at: Points, ``shape=(..., dim)``.
        corners: Number of corners of the facet.
        degree: Polynomial degree.

    Returns:
        Values at the points, ``shape=(..., k)``.
    """
    powers = np.arange(degree + 1)
    if at.shape[-1] == 1:
        return at**powers
    terms = [(i, j) for i in powers for j in powers if corners == 4 or i + j <= degree]
    return np.stack([at[..., 0] ** i * at[..., 1] ** j for i, j in terms], axis=-1)
