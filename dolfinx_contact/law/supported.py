# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
r"""Friction law at nodes with prescribed tangential motion, in all directions or all but one.

In a prescribed direction, the reaction does not affect the motion, as the support balances it.  So
it is not an unknown, but a function of the normal reaction R and of the slip.  With the friction
per normal reaction against a slip s,

.. math:: d(s) = \frac{P^2 s}{|M^{-1} P^2 s|},

- a node with prescribed slip ``k`` slips by ``s = k + w f`` and has ``r_t = -R d(s)``.  The only
  unknown is the slip ``w`` along ``f``; it follows from ``r_f = tau_f + rho w``, with the predictor
  ``tau``;
- a node with zero prescribed slip, ``k = 0``, slips along ``f`` only: ``|r_f| <= R f.d(f)``, and
  the other component has the ratio of ``d(f)``.  While it sticks, it keeps the friction of the last
  step, reduced to the cone if necessary.

In both cases, this is the law of [dSFMH07, Section 1] for all components together.  Needs NumPy
alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.law.friction import Friction

if TYPE_CHECKING:
    from dolfinx_contact.law.maps import NodalLaw

# Relative bound of rounding errors in directions and in the friction kept from the last step.
RELATIVE_ROUNDING = 32 * np.finfo(float).eps

# Iteration limit for the slip along the free direction; Newton steps and bisections count.
MOST_STEPS = 100

IS_OPEN = 0
IS_STICKING = 1
IS_SLIPPING = 2


def across(friction: Friction, along: np.ndarray) -> np.ndarray:
    """Friction for slip along ``f``, relative to its component along ``f``: ``d(f) / f.d(f)``.

    Args:
        friction: Coefficients of the n nodes.
        along: Direction ``f`` of each node, ``shape=(n, T)``, unit vectors or zero, local frame.

    Returns:
        ``shape=(n, T)``, local frame, dimensionless; zero where ``f`` is zero.
    """
    ratio = friction.drag(along)
    forward = _dot(ratio, along)[:, None]
    ratio = np.divide(ratio, forward, out=along.copy(), where=forward > 0)
    straight = np.abs(ratio - along).max(axis=1, keepdims=True) <= RELATIVE_ROUNDING
    return np.where(straight, along, ratio)


def supported(
    law: NodalLaw,
    friction: Friction,
    nodes: np.ndarray,
    along: np.ndarray,
    known: np.ndarray,
    last: np.ndarray,
) -> NodalLaw:
    """Friction law with tangential supports: ``law``, or a ``SupportedLaw`` if needed.

    A support affects friction if it prescribes slip, leaves a free direction that is not a
    principal one, or if friction from a prescribed slip remains from the last step.

    Args:
        law: Compiled law of ``n`` nodes.
        friction: Coefficients of the compiled law.
        nodes: Indices of nodes with a constrained tangential direction, ``shape=(k,)``.
        along: Free tangential direction ``f`` of these nodes, unit vectors, zero where none is
            free, ``shape=(k, T)``, local frame.
        known: Prescribed slip, ``shape=(n, T)``, local frame, length; zero within rounding.
        last: Tangential reactions of the last step, ``shape=(n, T)``, local frame.
    """
    coefficients = friction.at(nodes)
    rough = np.broadcast_to(coefficients.mu[..., 0] > 0.0, nodes.shape)
    ratio, moved, last = across(coefficients, along), known[nodes], last[nodes]
    kept = last - _dot(last, along)[:, None] * ratio
    kept[np.abs(kept) <= RELATIVE_ROUNDING * np.abs(last).max(axis=1, keepdims=True)] = 0.0
    mine = ((moved != 0.0) | (kept != 0.0) | (ratio != along)).any(axis=1) & rough
    if not mine.any():
        return law
    parts = (part[mine] for part in (nodes, along, ratio, moved, kept))
    return SupportedLaw(law, coefficients.at(np.flatnonzero(mine)), known, *parts)


@dataclass(frozen=True)
class SupportedLaw:
    """Compiled law with separate maps at ``k`` nodes with tangential supports; see ``supported``.

    Args:
        law: Compiled law of ``n`` nodes.
        friction: Coefficients of the ``k`` nodes.
        known: Prescribed slip, ``shape=(n, T)``, local frame; the slip passed to the maps includes
            it.
        nodes: Indices of the ``k`` nodes.
        along: Free direction ``f`` of each of them, zero if there is none, ``shape=(k, T)``.
        ratio: Friction ``d(f) / f.d(f)`` for slip along ``f``, ``shape=(k, T)``.
        moved: Prescribed slip of these nodes, ``shape=(k, T)``.
        kept: Friction of the last step without its part along ``ratio``, ``shape=(k, T)``.
    """

    law: NodalLaw
    friction: Friction
    known: np.ndarray
    nodes: np.ndarray
    along: np.ndarray
    ratio: np.ndarray
    moved: np.ndarray
    kept: np.ndarray

    @cached_property
    def kinds(self) -> tuple:
        """Classification of the ``k`` nodes, and quantities that depend on it.

        Returns:
            Mask of nodes with prescribed slip, mask of nodes with a free direction, indices of
            nodes in both; ``d(known)``, ``f.d(f)``, and the coefficients of the nodes in both.
        """
        moved, guided = self.moved.any(axis=1), self.along.any(axis=1)
        both = np.flatnonzero(moved & guided)
        most = _dot(self.friction.drag(self.along), self.along)
        return moved, guided, both, self.friction.drag(self.moved), most, self.friction.at(both)

    def return_map(
        self,
        reaction: np.ndarray,
        gap: np.ndarray,
        slip: np.ndarray,
        normal: np.ndarray,
        tangential: np.ndarray,
    ):
        return self._replaced(self.law.return_map, reaction, gap, slip, normal, tangential)

    def return_jacobian(
        self,
        reaction: np.ndarray,
        gap: np.ndarray,
        slip: np.ndarray,
        normal: np.ndarray,
        tangential: np.ndarray,
    ):
        return self._replaced(self.law.return_jacobian, reaction, gap, slip, normal, tangential)

    def bipotential_map(
        self, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray, rho: np.ndarray
    ):
        return self._replaced(self.law.bipotential_map, reaction, gap, slip, rho)

    def bipotential_jacobian(
        self, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray, rho: np.ndarray
    ):
        return self._replaced(self.law.bipotential_jacobian, reaction, gap, slip, rho)

    def _replaced(
        self,
        kernels: Callable,
        reaction: np.ndarray,
        gap: np.ndarray,
        slip: np.ndarray,
        *rho: np.ndarray,
    ) -> tuple:
        """Results of the compiled map, replaced at the ``k`` nodes.

        Args:
            kernels: Method of the compiled law.
            reaction, gap, slip: Arguments of the map, as in ``NodalLaw``.
            rho: One augmentation parameter for all directions, or a normal and a tangential one.
        """
        made, status, *derivatives = kernels(reaction, gap, slip - self.known, *rho)
        normal, tangential = rho[0], rho[-1]
        nodes, f = self.nodes, self.along
        R = np.maximum(reaction[nodes, -1] - normal[nodes] * gap[nodes], 0.0)
        tau = _dot(reaction[nodes, :-1] - tangential[nodes, None] * slip[nodes], f)
        answer = _SupportedFriction(self, tangential[nodes], R, tau)
        made, status = made.copy(), status.copy()
        made[nodes] = np.column_stack((answer.friction, R))
        status[nodes] = np.where(R > 0.0, np.where(answer.slips, IS_SLIPPING, IS_STICKING), IS_OPEN)
        if not derivatives:
            return made, status
        return made, status, *answer.derivatives(derivatives, nodes, R > 0.0, normal[nodes])


class _SupportedFriction:
    """Friction at ``k`` nodes with tangential supports, and its derivatives.

    The derivatives are with respect to the normal reaction R and to the predictor along ``f``.

    Args:
        supported: The law with its supports.
        rho: Tangential augmentation parameters, ``shape=(k,)``, force per length.
        R: Normal reactions, ``shape=(k,)``.
        tau: Predictor along ``f``, ``shape=(k,)``.
    """

    def __init__(self, supported: SupportedLaw, rho: np.ndarray, R: np.ndarray, tau: np.ndarray):
        self._law, self._f, self._rho = supported.friction, supported.along, rho
        moved, guided, both, d, most, friction = supported.kinds
        turn = np.zeros_like(d)
        if both.size:
            d = d.copy()
            rows = (self._f[both], rho[both], R[both], tau[both], supported.moved[both])
            d[both], turn[both] = _slipped(friction, *rows)
        by_predictor = (
            R[:, None] * turn / (rho + R * np.maximum(_dot(turn, supported.along), 0.0))[:, None]
        )
        by_R = by_predictor * _dot(d, supported.along)[:, None] - d
        slips = np.abs(tau) > most * R
        along = np.clip(tau, -most * R, most * R)
        stuck = along[:, None] * supported.ratio
        stuck += (
            self._largest_factor(stuck, np.where(slips[:, None], 0.0, supported.kept), R)
            * supported.kept
        )
        made = moved[:, None]
        self.friction = np.where(made, -R[:, None] * d, stuck)
        self.by_predictor = np.where(
            made, by_predictor, (guided & ~slips)[:, None] * supported.ratio
        )
        self.by_R = np.where(made, by_R, (slips * np.sign(tau) * most)[:, None] * supported.ratio)
        self.slips = moved | (guided & slips)

    def _largest_factor(self, friction: np.ndarray, kept: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Largest a in [0, 1] with ``friction + a kept`` in the friction cone, ``shape=(k, 1)``."""
        a, b = (self._law.over_radii(part) for part in (friction, kept))
        A, B, C = _dot(b, b), _dot(a, b), np.minimum(_dot(a, a) - R**2, 0.0)
        root = np.sqrt(B**2 - A * C) - B
        part = np.divide(root, A, out=np.zeros_like(A), where=A > 0)
        return np.clip(part, 0.0, 1.0)[:, None]

    def derivatives(
        self,
        found: Sequence[np.ndarray],
        nodes: np.ndarray,
        touches: np.ndarray,
        normal: np.ndarray,
    ) -> list:
        """Derivatives with respect to the previous reaction and to the motion, for all nodes.

        Args:
            found: Both derivatives of the compiled map, ``shape=(n, T + 1, T + 1)`` each.
            nodes: Indices of the ``k`` nodes at which they are replaced.
            touches: Whether these nodes are in contact, ``shape=(k,)``, bool.
            normal: Normal augmentation parameters of these nodes, ``shape=(k,)``.
        """
        f, T = self._f, self._f.shape[1]
        by_reaction = np.zeros((len(nodes), T + 1, T + 1))
        by_reaction[:, :T, :T] = self.by_predictor[:, :, None] * f[:, None, :]
        by_reaction[:, :T, T] = self.by_R
        by_reaction[:, T, T] = 1.0
        by_reaction[~touches] = 0.0
        rates = np.column_stack((np.repeat(self._rho[:, None], T, axis=1), normal))
        replaced = []
        for whole, part in zip(found, (by_reaction, -by_reaction * rates[:, None, :])):
            whole = whole.copy()
            whole[nodes] = part
            replaced.append(whole)
        return replaced


def _slipped(
    friction: Friction,
    f: np.ndarray,
    rho: np.ndarray,
    R: np.ndarray,
    tau: np.ndarray,
    known: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Friction ``d(known + w f)`` and its derivative with respect to w, at the slip w along ``f``.

    The slip w is the root of ``rho w + R f.d + tau = 0``.  The left side increases with w, so
    Newton's method, safeguarded by bisection, finds it.

    Args:
        friction: Coefficients of the k nodes.
        f: Free directions, ``shape=(k, T)``.
        rho, R, tau: As in ``_SupportedFriction``.
        known: Prescribed slip, ``shape=(k, T)``.
    """
    most = R * np.linalg.norm(friction.mu[..., : known.shape[1]], axis=-1)
    low, high = (-tau - most) / rho, (-tau + most) / rho
    w = -tau / rho
    for _ in range(MOST_STEPS):
        d, turn = friction.drag_with_slope(known + w[:, None] * f, f)
        left = rho * w + R * _dot(d, f) + tau
        low, high = np.where(left < 0.0, w, low), np.where(left > 0.0, w, high)
        following = w - left / (rho + R * np.maximum(_dot(turn, f), 0.0))
        outside = ~((low < following) & (following < high))
        following = np.where(outside, (low + high) / 2, following)
        following = np.where(left == 0.0, w, following)
        done = np.abs(following - w) <= np.finfo(float).eps * np.abs(w)
        w = following
        if done.all():
            break
    return friction.drag_with_slope(known + w[:, None] * f, f)


def _dot(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.einsum("ni,ni->n", one, other)
