# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
r"""The errors of a step, dimensionless numbers; see docs/errors.md.

The kernel computes the defects of a node, ``law.bipotential_map`` and ``law.slip_defect`` (``law/bipotential.h``, ``law/slip_rule.h``); the
condensed solver's checks use the same predictor and slip rule.

For a displacement ``u`` with nodal reactions ``r`` in the friction cone, all errors are residual forces relative to the
acting forces of the same state,

.. math:: S = \max(|r|, |f|, |R|),

Euclidean norms over nodes of reactions, external forces and support forces.

- ``error``: the largest of three. Equilibrium, ``|r - F(u)| / S`` on free degrees of freedom, F assembled by
  DOLFINx, with equations of pressures converted to forces (``bodies/unknowns.py``), equilibrium of planes driven by force along their free
  directions, and the error of boundary values times the stiffness. The law, ``|r - proj(r - kappa w, K_mu)| / S``, the residual of the
  paper's projection equation [dSFMH07, Section 2], ``w = (Q^2 Delta u_t, x_n + ||M Q^2 Delta u_t||)``. Penetration,
  ``|kappa max(-x_n, 0)| / S``. The metric ``kappa`` is the normal diagonal entry of the stiffness at the node, never the rho of a solver.
- ``slip_error``: ``|K_t (Delta u_t + |Delta u_t| d)| / S`` over slipping nodes, ``d`` the unit vector along
  ``P^-2 r_t``, and ``|K_t Delta u_t|`` over sticking ones; none where mu = 0. ``K_t`` is the tangential block of the
  stiffness at the node. The projection equation weights slip by ``Q^2`` and is insensitive to it where p is small.
- ``rounding``: the rounding error of both in double precision, estimated from the size of the terms that cancel in
  ``f - K u + r``, in the gaps and in the slips. No smaller error can be reached.

If ``S`` itself is at the rounding level, no force acts. The state is then accepted if the residuals are below rounding, and
all numbers are relative to the terms that cancel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dolfinx_contact.contact.state import State, Status
from dolfinx_contact.support.checks import ROUNDING_FACTOR, UNIT_ROUNDOFF

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.law.friction import Friction

# If rounding exceeds this part of the acting forces, it may hide that loads are not balanced.
BLIND_ROUNDING = 1e-3


class Errors(NamedTuple):
    """Errors of a state, dimensionless; ``change`` is that of the reactions since the state before, over S, the ``scale``."""

    error: float
    slip_error: float
    rounding: float
    change: float = np.inf
    acts: bool = True  # forces above rounding do
    scale: float = 0.0  # S, in the unit of force of the sums
    share: float = 1.0  # |r| / S, of the reactions in the forces that act
    balance: float = np.inf  # of equilibrium alone

    @property
    def largest(self) -> float:
        """The larger one of both errors; NaN if either is."""
        return float(np.maximum(self.error, self.slip_error))

    def of_contact(self, forward: float) -> float:
        """The largest of all errors over the reactions in place of all forces that act; 0 without reactions."""
        return max(self.largest, forward) / self.share if self.share > 0.0 else 0.0

    @property
    def blind(self) -> bool:
        """Whether rounding may hide that loads are not balanced."""
        return not self.acts or self.rounding > BLIND_ROUNDING

    def within(self, tol: float) -> bool:
        """Whether both are at most ``tol``, or as small as double precision allows."""
        rounding = ROUNDING_FACTOR * self.rounding
        return self.largest <= (max(tol, rounding) if self.acts else rounding)


def contact_defects(contact: ContactStep, state: State) -> tuple[np.ndarray, ...]:
    """Residual of the projection equation, penetration and defect of the slip rule, as forces.

    Args:
        contact: The contact.
        state: Its reaction, gap and slip increment.

    Returns:
        ``shape=(n, gdim)``, ``(n,)`` and ``(n, gdim - 1)``, local frame, force units.
    """
    law, stiffness = contact.law, contact.stiffness
    felt = _felt(state, contact.friction)
    projected, _ = law.bipotential_map(state.reaction, state.gap, felt, stiffness.normal)
    penetration = stiffness.normal * np.maximum(-state.gap, 0.0)
    defect = law.slip_defect(state.reaction, state.slip_increment, state.status)
    slip = np.einsum("nij,nj->ni", stiffness.tangential, defect)
    return state.reaction - projected, penetration, slip


def _felt(state: State, friction: Friction) -> np.ndarray:
    """Slips as the law's residual has them, ``shape=(n, gdim - 1)``: of nodes that stick over mu, where it exceeds 1.

    The residual has ``kappa mu |Delta u_t|``.  Where the law asks for no slip, what there is counts by the force that it makes,
    not mu times.
    """
    slip, mu = state.slip_increment, friction.mu.max(axis=-1, initial=0.0)
    if not (mu > 1.0).any():
        return slip
    sticks = state.status == int(Status.STICK)
    return slip / np.where(sticks, np.maximum(mu, 1.0), 1.0)[:, None]


def contact_rounding(contact: ContactStep, state: State, u: np.ndarray) -> np.ndarray:
    """What rounding leaves in gaps and slips, as forces on the nodes, ``shape=(n, gdim)``, local frame.

    Args:
        contact: The contact.
        state: Its state at ``u``.
        u: Displacement of owned degrees of freedom, length units.
    """
    normal, tangential = contact.motion_rounding(u, state)
    stiffness = contact.stiffness
    stiff = np.abs(stiffness.tangential).sum(axis=2)
    mu = contact.friction.mu[..., : tangential.shape[1]]
    if (mu > 1.0).any():  # the law's residual has mu times the slip
        slips = state.status == int(Status.SLIP)
        normal = normal + slips * (mu * tangential).sum(axis=1)
    return np.column_stack((stiff * tangential, stiffness.normal * normal))


def as_errors(balance: np.ndarray, contacts: np.ndarray | None = None) -> Errors:
    """Errors from squares of norms, in any unit of force.

    Args:
        balance: Of equilibrium, reactions, external forces, supports, rounding of the body, and change of the reactions.
        contacts: Of law, penetration, slip rule and rounding at the contacts; None where equilibrium alone is asked for.
    """
    equilibrium, r, f, R, body, change = np.sqrt(balance)
    law, penetration, slip, contact = np.zeros(4) if contacts is None else np.sqrt(contacts)
    rounding, acting = max(body, contact), max(r, f, R)
    acts = bool(acting > ROUNDING_FACTOR * rounding)
    if not acts:
        acting = rounding / UNIT_ROUNDOFF
    left = np.array([max(equilibrium, law, penetration), slip, rounding, change])
    if acting > 0.0:
        left /= acting
    elif not np.isnan(left).any():
        left = np.where(left > 0.0, np.inf, 0.0)
    error, slip_error, rounding, change = map(float, left)
    if np.isnan([equilibrium, law, penetration]).any():
        error = np.nan
    share = float(r / acting) if acts else 0.0
    balance = equilibrium / acting if acting > 0.0 else error
    return Errors(error, slip_error, rounding, change, acts, float(acting), share, float(balance))
