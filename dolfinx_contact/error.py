r"""The error of a step: one dimensionless number, defined here and nowhere else.

For a displacement ``u`` and admissible nodal reactions ``r`` (in the friction cone),

.. math:: e = \max(|f - K u + r|,\; |r - \mathrm{proj}(r - \kappa w,\, K_\mu)|) \,/\, L .

- The first term is the residual of equilibrium on the free degrees of freedom, assembled by DOLFINx.
- The second is the residual of the paper's projection equation [dSFMH07, Section 2] over all
  contact nodes, ``w = (Q^2 Delta u_t, x_n + ||M Q^2 Delta u_t||)``.  Its metric ``kappa`` is canonical: the
  normal diagonal entry of the stiffness at the node, never the rho of a solver.
- ``L`` is the load, which is not the reaction (zero when everything opens): the largest of the
  external forces, the reactions of the last step, and ``kappa`` times the penetration of the
  contact-free trial state, three digits of it where PETSc iterates.  Where all three vanish nothing presses, and ``kappa |u|``, the forces
  that hold a single node against that displacement, takes their place.

The projection equation weights slip by ``Q^2`` and is blind where p is small, so a second number is kept
beside it: the slip error, the largest ``|Delta u_t + |Delta u_t| d|`` over slipping nodes, d the unit
vector along ``P^-2 r_t``, and ``|Delta u_t|`` over sticking ones (nothing where mu = 0), over the load
displacement, which is the largest penetration or slip increment of a contact node in the trial
state.  A step has converged when both are at most ``tol``.

All norms are Euclidean over the nodal vectors of all ranks, so the number depends neither on the
frame nor on the units.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Errors(NamedTuple):
    """Both errors of a state, dimensionless."""

    error: float
    slip_error: float

    @property
    def largest(self) -> float:
        """The larger one; NaN if either is."""
        return float(np.maximum(*self))


def projection_residual(contact, stiffness: np.ndarray) -> np.ndarray:
    """``r - proj(r - kappa w, K_mu)``, ``shape=(n, gdim)``, local frame, force units.

    Args:
        contact: Contact with its present reaction, gap and slip increment.
        stiffness: Canonical metric ``kappa``, ``shape=(n,)``, force per length.
    """
    projected, _ = contact.law.bipotential_map(
        contact.reaction, contact.gap, contact.slip_increment, stiffness
    )
    return contact.reaction - projected


def relative(values: np.ndarray, load: float) -> np.ndarray:
    """``values / load``; without any load what is zero is no error, and anything else an infinite one."""
    return values / load if load > 0.0 else np.where(values == 0.0, 0.0, np.inf)
