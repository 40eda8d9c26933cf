# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
r"""Orthotropic friction of two textured sides, with the mean of their frictional work.

An associated law dissipates ``h(e) = |M e| = sqrt(e . A e)`` per normal force and slip length along
a unit vector ``e``, with ``A = M^2`` in common axes.  The mean ``(h_1 + h_2) / 2`` of two sides is
the support function of the Minkowski mean of their ellipses, which is an ellipse only if their axes
and ``mu_y / mu_x`` are the same.  Its square is ``(e . A_1 e + e . A_2 e + 2 h_1 h_2) / 4``.  The
quadratic form

.. math:: A = (A_1 + A_2 + 2 A_1 \# A_2) / 4,

in which the geometric mean ``#`` of matrices replaces the product, never exceeds this square [Kubo,
Ando, Math. Ann. 246, 1980: ``x . (A # B) x`` is at most ``sqrt(x . A x  x . B x)``].  For common
axes both are equal, and ``M = (M_1 + M_2) / 2``.

The slip rule follows from the mean of ``ln Q``, projected onto the axes of ``A``.  So two sides
with the same ``Q`` and axes keep that ``Q``, and two associated sides give an associated law.
"""

from __future__ import annotations

import numpy as np

# A tensor whose deviator is below this fraction of half its trace counts as isotropic.
ISOTROPIC_PART = 1e-12


def mean(first: tuple, second: tuple) -> tuple[np.ndarray, ...]:
    """Coefficients ``mu`` and ``p`` of a pair, and its first principal directions (unit vectors).

    Args:
        first, second: ``mu``, ``Q`` and the angle of the first principal direction (radians) of
            each side, ``shape=(n, 2)``, ``(n, 2)`` and ``(n,)``, or shapes that broadcast to these;
            zero ``mu`` is frictionless.

    Returns:
        Three arrays, ``shape=(n, 2)`` each.
    """
    A, B = (_tensor(mu**2, angle) for mu, _, angle in (first, second))
    a, b = (np.prod(mu, axis=-1) for mu, *_ in (first, second))  # roots of the determinants
    sums = [
        np.divide(part, root, np.zeros_like(part), where=root > 0)
        for part, root in zip((*A, *B), (a, a, a, b, b, b))
    ]
    mid = [one + other for one, other in zip(sums[:3], sums[3:])]
    determinant = mid[0] ** 2 - mid[1] ** 2 - mid[2] ** 2
    factor = np.sqrt(np.divide(a * b, determinant, np.zeros_like(a * b), where=determinant > 0))
    iso, x, y = ((one + other + 2 * factor * mixed) / 4 for one, other, mixed in zip(A, B, mid))
    soft = [_tensor(np.log(np.where(Q > 0, Q, 1.0)), angle) for _, Q, angle in (first, second)]
    sides = np.maximum((a > 0) * 1.0 + (b > 0), 1.0)
    qx, qy = ((one + other) / sides for one, other in zip(soft[0][1:], soft[1][1:]))
    plain = np.hypot(x, y) <= ISOTROPIC_PART * iso
    turn = np.where(plain, np.arctan2(qy, qx), np.arctan2(y, x)) / 2
    turn += np.pi / 2 * np.round((first[2] - turn) / (np.pi / 2))  # nearest to the first side's
    cos, sin = np.cos(2 * turn), np.sin(2 * turn)
    along, rule = x * cos + y * sin, qx * cos + qy * sin
    mu = np.sqrt(np.maximum(np.stack((iso + along, iso - along), axis=-1), 0.0))
    p = mu * np.exp(np.stack((rule, -rule), axis=-1))
    return mu, np.where(mu > 0, p, 1.0), np.stack((np.cos(turn), np.sin(turn)), axis=-1)


def _tensor(values: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, ...]:
    """Half the trace and the two deviator components, in double angles, of symmetric 2 x 2 tensors.

    Args:
        values: Principal values, ``shape=(n, 2)``.
        angle: Angle of the first principal direction, radians, ``shape=(n,)``.
    """
    iso, rest = (values[..., 0] + values[..., 1]) / 2, (values[..., 0] - values[..., 1]) / 2
    return iso + 0.0 * angle, rest * np.cos(2 * angle), rest * np.sin(2 * angle)
