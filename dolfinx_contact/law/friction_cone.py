# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Load function of, and Euclidean projection onto, the elliptic friction cone; on NumPy arrays.

[dSFMH07]: see :mod:`dolfinx_contact.law.friction`. Needs NumPy alone, no DOLFINx.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.law.friction import Friction

# Points with larger components are divided by ``HUGE_UNIT`` before projection, so that no sum
# overflows.
HUGE_COMPONENT = 1e300
HUGE_UNIT = 2.0**20


def as_nodes(
    name: str, value: ArrayLike, components: int | None, nodes: int | None = None
) -> np.ndarray:
    """``value`` as a float64 array with one row per node, copied only if needed.

    Args:
        name: Name of the argument in error messages.
        value: The values.
        components: Required number of columns; None for a one-dimensional array.
        nodes: Required number of rows; None for any.

    Raises:
        ValueError: The array has another shape, has masked entries, or is not real with at most 64
            bits.
    """
    if np.ma.is_masked(value):
        raise ValueError(f"{name} has masked entries: give numbers for them, {name}.filled(...)")
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.dtype.itemsize > 8:
        raise ValueError(
            f"{name} must be real numbers of at most 64 bits, not {array.dtype}: "
            "conversion to float64 would lose digits or the imaginary part"
        )
    wanted = "n" if nodes is None else str(nodes)
    rows = array.ndim > 0 and nodes in (None, array.shape[0])
    if not rows or array.shape[1:] != (() if components is None else (components,)):
        tail = "," if components is None else f", {components}"
        raise ValueError(f"{name} must have shape ({wanted}{tail}), not {array.shape}")
    array = array.astype(np.float64, copy=False)
    if any(stride % 8 for stride in array.strides) or not array.flags.aligned:
        array = array.copy()
    return array


def project_cone(tau: ArrayLike, mu: ArrayLike) -> np.ndarray:
    """Euclidean projection onto the friction cone ``|M^-1 r_t| <= r_n``.

    It is the corrector of [dSFMH07, Section 2].

    Args:
        tau: Points in the local frame ``(t1, t2, n)``, ``shape=(n, 3)``, any unit.
        mu: Coefficients of friction: a number, ``shape=(2,)`` or ``(n, 2)``. For zero, the cone is
            the half line ``r_t = 0, r_n >= 0``.

    Returns:
        The projected points, ``shape=(n, 3)``, in the unit of ``tau``. A row of ``tau`` with an
        infinite or NaN entry gives a row of NaN (for a frictionless cone only if it is ``tau_n``);
        a projection beyond the range of double precision gives infinity. Other rows are not
        affected.

    Raises:
        ValueError: ``tau`` has a wrong shape or type; ``mu`` is negative, NaN, or zero in exactly
            one direction.

    Example:
        >>> dc.law.project_cone([[0.1, 0, 1], [0.1, 0, -1]], (0.30, 0.15))
        array([[0.1, 0. , 1. ],
               [0. , 0. , 0. ]])
    """
    tau, law = as_nodes("tau", tau, 3), Friction(mu).law(3)
    largest, smallest = (f.reduce(tau, axis=None, initial=0.0) for f in (np.fmax, np.fmin))
    if max(largest, -smallest) <= HUGE_COMPONENT:
        return law.project(tau)[0]
    huge = np.isfinite(tau).all(axis=1) & (np.abs(tau) > HUGE_COMPONENT).any(axis=1)
    scale = np.where(huge, HUGE_UNIT, 1.0)[:, None]
    with np.errstate(over="ignore"):
        return law.project(tau / scale)[0] * scale


def load_function(r: ArrayLike, mu: ArrayLike) -> np.ndarray:
    """Load function ``f = |M^-1 r_t| - r_n`` of [dSFMH07, Eq. (1)].

    It is negative inside the friction cone and zero on its boundary.

    Args:
        r: Reactions in the local frame ``(t1, t2, n)``, ``shape=(n, 3)``, any unit.
        mu: As in :func:`project_cone`. If it is zero everywhere, ``f = -r_n``.

    Returns:
        ``shape=(n,)``, in the unit of ``r``.

    Raises:
        ValueError: As in :func:`project_cone`.

    Example:
        >>> dc.law.load_function([[0.1, 0, 1]], (0.30, 0.15)).round(3)  # negative: sticks
        array([-0.667])
    """
    return Friction(mu).law(3).load_function(as_nodes("r", r, 3))
