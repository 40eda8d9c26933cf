# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Bi-potential gap on NumPy arrays: an error measure for any approximate solution.

[dSFMH07]: see :mod:`dolfinx_contact.law.friction`. Needs NumPy alone, no DOLFINx.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.law.friction import Friction, as_friction
from dolfinx_contact.law.friction_cone import as_nodes


def bipotential_gap(
    r: ArrayLike, gap: ArrayLike, slip_increment: ArrayLike, friction: Friction | float
) -> np.ndarray:
    """Bi-potential gap ``b_c(-du, r) + du . r`` [dSFMH07, Section 1], zero if the law holds.

    For a reaction in the friction cone and no penetration, it is
    ``r_n (x_n + |M Q^2 du_t|) + r_t . Q^2 du_t >= 0``, computed as a sum of non-negative terms.
    Elsewhere it is infinite. To certify an approximate solution, first project reactions onto the
    cone and clip gaps at zero, and report these changes separately.

    Args:
        r: Reactions in the local frame, ``shape=(n, 3)``, or ``(n, 2)`` in two dimensions.
        gap: Normal gap ``x_n`` at the end of the step, ``shape=(n,)``, length.
        slip_increment: ``du_t`` over the step, ``shape=(n, 2)`` or ``(n, 1)``, length, local frame.
        friction: A ``Friction``, or a number, the isotropic coefficient.

    Returns:
        ``shape=(n,)``, force times length; ``inf`` where ``r`` is outside the cone by more than
        rounding (16 machine epsilons of ``r_n``) or ``gap`` is negative.

    Raises:
        ValueError: An argument has the wrong shape or type.

    Example:
        >>> slip = [[-0.01, 0]]  # mm; the reaction is on the cone and against it: the law holds
        >>> dc.law.bipotential_gap([[0.3, 0, 1]], [0], slip, dc.Friction(mu=0.3)).round(12)
        array([0.])
    """
    friction = as_friction(friction)
    if not isinstance(friction, Friction):
        raise ValueError(f"friction must be a Friction or a number, not {friction!r}")
    r = np.asarray(r)
    dim = r.shape[1] if r.ndim == 2 and r.shape[1] == 2 else 3
    r = as_nodes("r", r, dim)
    gap = as_nodes("gap", gap, None, len(r))
    slip = as_nodes("slip_increment", slip_increment, dim - 1, len(r))
    law = friction.law(dim)
    outside = law.load_function(r) > 16 * np.finfo(float).eps * np.abs(r[:, -1])
    value = law.bipotential_gap(r, gap, slip)
    slippery = (friction.mu == 0).all(axis=-1)
    if slippery.any():  # the cone is a half line, and terms divided by mu are meaningless
        off = (r[:, :-1] != 0).any(axis=1) | (r[:, -1] < 0)
        outside, value = np.where(slippery, (off, r[:, -1] * gap), (outside, value))
    return np.where((outside != 0) | (gap < 0), np.inf, value)
