# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
r"""Dimensionless errors of a state of a load step, see docs/errors.md.

The kernel computes the residuals of the law at a node by ``law.bipotential_map`` and
``law.slip_defect`` (``law/bipotential.h``, ``law/slip_rule.h``).  The checks of the condensed
solver use the same predictor and slip rule.

For a displacement ``u`` with nodal reactions ``r`` in the friction cone, all errors are residual
forces relative to the acting forces of the same state,

.. math:: S = \max(|r|, |f|, |R|),

where the norms are Euclidean norms of the nodal reactions, external forces and support forces.

- ``error``: the largest of three errors.

  - Equilibrium, ``|r - F(u)| / S`` on free degrees of freedom, with F assembled by DOLFINx and the
    equations of pressures converted to forces (``bodies/unknowns.py``).  It includes the
    equilibrium of surfaces driven by force along their free directions, and the error of boundary
    values times the stiffness.
  - The law, ``|r - proj(r - kappa w, K_mu)| / S``, the residual of the projection equation
    [dSFMH07, Section 2], with ``w = (Q^2 Delta u_t, x_n + ||M Q^2 Delta u_t||)``.
  - Penetration, ``|kappa max(-x_n, 0)| / S``.

  The metric ``kappa`` is the normal diagonal entry of the stiffness at the node, never the
  parameter rho of a solver.
- ``slip_error``: ``|K_t (Delta u_t + |Delta u_t| d)| / S`` over slipping nodes, where ``d`` is the
  unit vector along ``P^-2 r_t``, and ``|K_t Delta u_t| / S`` over sticking nodes; zero where
  mu = 0.  ``K_t`` is the tangential block of the stiffness at the node.  This error is needed
  because the projection equation weights slip by ``Q^2`` and is insensitive to slip where p is
  small.
- ``rounding``: the rounding error of both in double precision, estimated from the size of the terms
  that cancel in ``f - K u + r``, in the gaps and in the slips.  No smaller error can be reached.

If ``S`` itself is at the rounding level, no force acts.  The state is then accepted if the
residuals are below rounding, and all errors are relative to the terms that cancel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dolfinx_contact.contact.state import State, Status
from dolfinx_contact.support.checks import ROUNDING_FACTOR, UNIT_ROUNDOFF

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.law.friction import Friction

# Rounding relative to the acting forces above which it may hide that loads are not balanced.
BLIND_ROUNDING = 1e-3


class Errors(NamedTuple):
    """Dimensionless errors of a state.

    Attributes:
        error: Largest error of equilibrium, law and penetration.
        slip_error: Error of the slip rule.
        rounding: Estimated rounding error of ``error`` and ``slip_error``.
        change: Norm of the change of the reactions since the previous state, relative to S.
        acts: Whether the acting forces exceed rounding.
        scale: S, the norm of the acting forces, in the unit of force of the step.
        share: Norm of the reactions relative to S.
        balance: Error of equilibrium alone.
    """

    error: float
    slip_error: float
    rounding: float
    change: float = np.inf
    acts: bool = True
    scale: float = 0.0
    share: float = 1.0  # |r| / S
    balance: float = np.inf

    @property
    def largest(self) -> float:
        """The larger of ``error`` and ``slip_error``; NaN if one of them is NaN."""
        return float(np.maximum(self.error, self.slip_error))

    def of_contact(self, forward: float) -> float:
        """Return the largest error relative to the reactions; 0 without reactions.

        Args:
            forward: Forward error of the reactions, relative to S.
        """
        return max(self.largest, forward) / self.share if self.share > 0.0 else 0.0

    @property
    def blind(self) -> bool:
        """Whether rounding is so large that it may hide an imbalance of the loads."""
        return not self.acts or self.rounding > BLIND_ROUNDING

    def within(self, tol: float) -> bool:
        """Return whether both errors are at most ``tol``, or as small as rounding permits."""
        rounding = ROUNDING_FACTOR * self.rounding
        return self.largest <= (max(tol, rounding) if self.acts else rounding)


def contact_defects(contact: ContactStep, state: State) -> tuple[np.ndarray, ...]:
    """Return the residuals of the contact law at each node, as forces.

    Args:
        contact: The contact.
        state: Reaction, gap and slip increment of its nodes.

    Returns:
        Residual of the projection equation, ``shape=(n, gdim)``; penetration, ``(n,)``; residual of
        the slip rule, ``(n, gdim - 1)``; local frame, force units.
    """
    law, stiffness = contact.law, contact.stiffness
    felt = _weighted_slip(state, contact.friction)
    projected, _ = law.bipotential_map(state.reaction, state.gap, felt, stiffness.normal)
    penetration = stiffness.normal * np.maximum(-state.gap, 0.0)
    defect = law.slip_defect(state.reaction, state.slip_increment, state.status)
    slip = np.einsum("nij,nj->ni", stiffness.tangential, defect)
    return state.reaction - projected, penetration, slip


def _weighted_slip(state: State, friction: Friction) -> np.ndarray:
    """Return slip increments for the residual of the law, ``shape=(n, gdim - 1)``, length.

    At sticking nodes with mu > 1, the slip is divided by mu.  The residual contains
    ``kappa mu |Delta u_t|``; the division makes the spurious slip of a sticking node count as
    ``kappa |Delta u_t|`` instead.
    """
    slip, mu = state.slip_increment, friction.mu.max(axis=-1, initial=0.0)
    if not (mu > 1.0).any():
        return slip
    sticks = state.status == int(Status.STICK)
    return slip / np.where(sticks, np.maximum(mu, 1.0), 1.0)[:, None]


def contact_rounding(contact: ContactStep, state: State, u: np.ndarray) -> np.ndarray:
    """Return rounding errors of gaps and slips as forces, ``shape=(n, gdim)``, local frame.

    Args:
        contact: The contact.
        state: State of the contact at ``u``.
        u: Displacement of owned degrees of freedom, length units.
    """
    normal, tangential = contact.motion_rounding(u, state)
    stiffness = contact.stiffness
    stiff = np.abs(stiffness.tangential).sum(axis=2)
    mu = contact.friction.mu[..., : tangential.shape[1]]
    if (mu > 1.0).any():  # the residual of the law contains mu times the slip
        slips = state.status == int(Status.SLIP)
        normal = normal + slips * (mu * tangential).sum(axis=1)
    return np.column_stack((stiff * tangential, stiffness.normal * normal))


def as_errors(balance: np.ndarray, contacts: np.ndarray | None = None) -> Errors:
    """Return the errors of a state from squared norms, in any unit of force.

    Args:
        balance: Squared norms of the residual of equilibrium, reactions, external forces, support
            forces, rounding error of the body, and change of the reactions; ``shape=(6,)``.
        contacts: Squared norms of the residuals of law, penetration and slip rule, and of the
            rounding error at the contacts, ``shape=(4,)``; None for errors of equilibrium alone.
    """
    equilibrium, r, f, R, body, change = np.sqrt(balance)
    law, penetration, slip, contact = np.zeros(4) if contacts is None else np.sqrt(contacts)
    rounding, acting = max(body, contact), max(r, f, R)
    acts = bool(acting > ROUNDING_FACTOR * rounding)
    if not acts:
        acting = rounding / UNIT_ROUNDOFF
    residuals = np.array([max(equilibrium, law, penetration), slip, rounding, change])
    if acting > 0.0:
        residuals /= acting
    elif not np.isnan(residuals).any():
        residuals = np.where(residuals > 0.0, np.inf, 0.0)
    error, slip_error, rounding, change = map(float, residuals)
    if np.isnan([equilibrium, law, penetration]).any():
        error = np.nan
    share = float(r / acting) if acts else 0.0
    balance = equilibrium / acting if acting > 0.0 else error
    return Errors(error, slip_error, rounding, change, acts, float(acting), share, float(balance))
