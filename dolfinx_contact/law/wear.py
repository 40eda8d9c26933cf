"""Archard's wear law: worn depth from the frictional work per area."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.law.friction import Field, is_field
from dolfinx_contact.support.attributes import Guarded, frozen
from dolfinx_contact.support.checks import finite, number


class Wear(Guarded):
    """Archard wear with feedback: worn depth opens the gap.

    The depth of a node grows by ``sum_i k_i w_i / A``, with ``w_i >= 0`` the frictional work along principal direction i in the
    step (``dissipation.py``) and ``A`` the nodal area.  So the worn volume, the sum of depth times area, is ``sum k_i
    w_i``.  With one coefficient and isotropic friction, ``k = K / (mu H)`` is Archard's law, with his coefficient K and the
    hardness H [J. F. Archard, J. Appl. Phys. 24 (1953) 981].

    The depth worn in a step is part of its equations, so that a node is never worn below contact, whatever the coefficient.  The
    work is that of ``contact.dissipation``, with the mean of the forces at both ends of the step, as long as it takes less than a fiftieth of
    its force from a node; beyond that the force at the end counts more, and at last alone (backward Euler).  The step is solved
    again until depths are off by at most a tenth of ``geometry_tol`` of the reactions; once is enough for gentle wear.

    Explicit wear opens the gap of the next step, and the work is always that of ``contact.dissipation``.  If the depth worn in a
    step, times the node's stiffness, then exceeds the node's reaction, the step is too large: a warning says into how many steps
    to divide it.

    Args:
        coefficient: k, a number, or a pair for the two friction directions; volume per work, the inverse of a stress, >= 0.  Or a field:
            a callable of ``x``, ``shape=(3, n)``, that returns ``shape=(n,)`` or ``(2, n)``, or a DOLFINx Function in a continuous Lagrange
            space, evaluated at the contact nodes when the contact takes the law.
        explicit: Whether the depth worn in a step opens the gap of the next one only.
        threshold: Frictional work per area that a node takes before it wears, force per length.
        opposite: Coefficient of the other side, a ``DeformableSurface``, in the same forms but no field.  The gap opens by the depths of both,
            each of which stays with its own body; a rigid surface does not wear.

    Raises:
        ValueError: a coefficient or threshold that is negative, not finite or not real, or more than two coefficients.

    Example:
        >>> contact.wear = dc.Wear(1e-6)  # mm³ per N mm
        >>> contact.wear = dc.Wear(lambda x: np.where(x[0] < 0.5, 1e-6, 1e-7))  # a coating on one half
    """

    _remedy = "make a new Wear, contact.wear = dc.Wear(...)."

    def __init__(self, coefficient: ArrayLike | Field, *, explicit: bool = False, threshold: float = 0.0, opposite: ArrayLike = 0.0) -> None:  # fmt: skip
        self.explicit, self.threshold = bool(explicit), number("wear threshold", threshold)
        if self.threshold < 0.0:
            raise ValueError(f"wear threshold must be a number >= 0, got {threshold!r}.")
        self.field = is_field(coefficient)
        self.coefficient = coefficient if self.field else _checked(coefficient)
        self.opposite = _checked(opposite)
        self._made = True

    def depth(
        self, work: np.ndarray, area: np.ndarray, coefficient: np.ndarray | None = None
    ) -> np.ndarray:
        """Depth worn by ``work``, ``shape=(n, gdim - 1)``, on ``area``, ``shape=(n,)``, of both sides; length.  None where there is no area.

        Args:
            work, area: Of the nodes.
            coefficient: Values of a field at the nodes, ``shape=(n, 2)``.
        """
        k = self.coefficient if coefficient is None else coefficient
        volume = _volume(k + self.opposite, work)
        return np.divide(volume, area, out=np.zeros_like(volume), where=area > 0.0)

    def opposite_share(self, work: np.ndarray, coefficient: np.ndarray | None = None) -> np.ndarray:
        """Part of the depth that ``work`` wears which the other side loses, ``shape=(n,)``; arguments as ``depth`` has them."""
        k = self.coefficient if coefficient is None else coefficient
        both, other = _volume(k + self.opposite, work), _volume(self.opposite, work)
        return np.divide(other, both, out=np.zeros_like(both), where=both > 0.0)

    def part(self, work: np.ndarray, before: np.ndarray, area: np.ndarray) -> np.ndarray:
        """Part of the work of a step, beyond ``before``, that is above the threshold; all arrays ``shape=(n,)``."""
        beyond = before + work - self.threshold * area
        return np.clip(np.divide(beyond, work, np.ones_like(work), where=work > 0.0), 0.0, 1.0)

    def __repr__(self) -> str:
        said = "field" if self.field else self.coefficient.tolist()
        options = ", explicit=True" * self.explicit
        options += f", threshold={self.threshold:g}" * (self.threshold > 0.0)
        options += f", opposite={self.opposite.tolist()}" * bool(self.opposite.any())
        return f"Wear({said}{options})"


def _volume(k: np.ndarray, work: np.ndarray) -> np.ndarray:
    k = np.broadcast_to(k, (len(work), 2))
    return (k[:, : work.shape[1]] * work).sum(axis=1)


def _checked(coefficient: ArrayLike) -> np.ndarray:
    array = finite("wear coefficient", coefficient)
    if array.shape not in ((), (1,), (2,)) or (array < 0).any():
        raise ValueError(
            f"wear coefficient must be a number or a pair of numbers >= 0, volume per work; got {coefficient!r}."
        )
    return frozen(array)
