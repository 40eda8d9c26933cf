# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
r"""Frictional work of a load step at each node: never negative, exact for rigid sliding.

A node that slips along the unit vector ``e`` under the normal force N dissipates ``N m(e)`` per
length of slip, with

.. math:: m(e) = \frac{e \cdot P^2 e}{|M^{-1} P^2 e|} = \sum_i \mu_i e_i s_i, \qquad
          s = \frac{M^{-1} P^2 e}{|M^{-1} P^2 e|},

because its friction force is ``-N M s``.  The work of a step is the slip times the mean of ``N m``
at both ends of the step:

    D = |du| (N0 m0 + N1 m(e1)) / 2,    e1 = du / |du|,    m0 = c m(e0) + (1 - c) m(e1).

Here e0 is the direction of slip at the end of the last step, which follows from the friction
force at that time, and ``c = max(e0.e1, 0)``.  If the node did not slip and its force was not on
the cone, c = 0.  Derivation, orders and limits: docs/dissipation.md.  Needs NumPy alone.
"""

from __future__ import annotations

import numpy as np

from dolfinx_contact.law.friction import Friction, split

# Relative distance from the friction cone within which the force of a sticking node still gives the
# direction of its previous slip.  After a pause, the force is on the cone up to rounding.
PAUSED_FORCE = 1e-3


def frictional_work(
    friction: Friction,
    before: np.ndarray,
    slipped: np.ndarray,
    reaction: np.ndarray,
    slip_increment: np.ndarray,
    law_before: Friction | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Frictional work of a step, and its part due to a change of the slip direction.

    Args:
        friction: The friction law of the step.
        before: Reactions at the end of the last step, ``shape=(n, gdim)``, local frame, force.
        slipped: Nodes that slipped in the last step, ``shape=(n,)``, bool.
        reaction: Reactions at the end of this step, ``shape=(n, gdim)``; only normal components are
            used.
        slip_increment: Slip during this step, ``shape=(n, gdim - 1)``, local frame, length.
        law_before: Friction of the last step, if friction was replaced or its axes have turned
            since then.  It determines the direction of slip at the end of the last step.  If only
            the axes have turned, the work at the start of the step is computed with the old axes.

    Returns:
        The work by principal direction, all entries >= 0, ``shape=(n, gdim - 1)``, force times
        length; a node dissipates the sum of its row.  And its excess over the work of slip along
        ``e1`` alone, same shape and unit.  Negative normal forces, which occur only before
        convergence, count as zero.
    """
    tangents = np.shape(slip_increment)[1]
    mu, Q = friction.mu[..., :tangents], friction.Q[..., :tangents]
    slip_length, e1 = split(friction.along_axes(slip_increment))
    per_slip = _work_per_slip(mu, Q, e1)

    if law_before in (None, friction):
        s0, e0 = _directions_of_force(mu, Q, friction.along_axes(before[:, :-1]))
        start, straight = mu * e0 * s0, per_slip
    else:
        back = -law_before.against_slip(before[:, :-1])
        # If only the axes have turned, use the old axes.
        then = law_before if _same_coefficients(friction, law_before) else friction
        e0, both = friction.along_axes(back), (then.along_axes(a) for a in (back, slip_increment))
        start, straight = (_work_per_slip(mu, Q, split(along)[1]) for along in both)
    c = np.maximum((e0 * e1).sum(axis=1, keepdims=True), 0.0) * np.reshape(slipped, (-1, 1))
    per_slip_before = c * start + np.maximum(1.0 - c, 0.0) * straight
    N0, N1 = (np.maximum(r[:, -1:], 0.0) for r in (before, reaction))
    work = 0.5 * slip_length * (N0 * per_slip_before + N1 * per_slip)
    return work, 0.5 * slip_length * N0 * (per_slip_before - straight)


def _work_per_slip(mu: np.ndarray, Q: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Frictional work per normal force and slip length, by principal direction.

    Args:
        mu, Q: Coefficients, ``shape=(gdim - 1,)`` or ``(n, gdim - 1)``, dimensionless.
        e: Unit vectors along the principal directions, ``shape=(n, gdim - 1)``.

    Returns:
        ``shape=(n, gdim - 1)``, dimensionless.
    """
    _, s = split(Q**2 * mu * e)  # M^-1 P^2 e
    return mu * e * s


def _same_coefficients(one: Friction, other: Friction) -> bool:
    """Whether two laws have the same coefficients; axes may differ."""
    pairs = ((one.mu, other.mu), (one.Q, other.Q))
    return all(bool(np.all(a == b)) for a, b in pairs)


def _directions_of_force(
    mu: np.ndarray, Q: np.ndarray, force: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors ``s`` along ``-M^-1 r_t`` and ``e`` (slip) along ``-P^-2 r_t``.

    Args:
        mu, Q: Coefficients, ``shape=(gdim - 1,)`` or ``(n, gdim - 1)``, dimensionless.
        force: Tangential forces ``r_t`` along the principal directions, ``shape=(n, gdim - 1)``.
    """
    slippery = mu == 0
    M, P = (np.where(slippery, 1.0, a) for a in (mu, Q * mu))
    M, P = (a / a.min(axis=-1, keepdims=True) for a in (M, P))  # directions only: no overflow
    _, s = split(np.where(slippery, 0.0, -force) / M)
    _, e = split(s * M / P**2)
    return s, e


def slipped_last(friction: Friction, reaction: np.ndarray, slipped: np.ndarray) -> np.ndarray:
    """Nodes whose friction force gives the direction of their last slip, ``shape=(n,)``, bool.

    These are nodes that slip, and nodes that stick with a force on the friction cone.

    Args:
        friction: The friction law.
        reaction: Reactions, ``shape=(n, gdim)``, local frame.
        slipped: Nodes that slip, ``shape=(n,)``, bool.
    """
    force, normal = friction.along_axes(reaction[:, :-1]), reaction[:, -1]
    mu = friction.mu[..., : force.shape[1]]
    part = np.divide(force, mu, out=np.zeros_like(force), where=mu > 0.0)
    on_cone = np.linalg.norm(part, axis=1) >= (1.0 - PAUSED_FORCE) * normal
    return slipped | (on_cone & (normal > 0.0))
