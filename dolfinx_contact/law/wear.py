# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Archard's wear law: worn depth from frictional work per area."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.law.friction import Field, is_field
from dolfinx_contact.support.attributes import Guarded, frozen
from dolfinx_contact.support.checks import finite, number, valued


class Wear(Guarded):
    """Archard wear with a worn depth that opens the gap; immutable.

    The coefficient ``k`` is worn volume per frictional work.  A specific wear rate, volume per
    normal force and sliding distance, is ``mu`` times as large, in the same unit mm³/(N mm):
    ``k = rate / mu``.

    In a step, the depth of a node grows by ``sum_i k_i w_i / A``, with the frictional work
    ``w_i >= 0`` along principal direction i (``dissipation.py``) and the nodal area ``A``.  So the
    worn volume, the sum of depth times area, grows by ``sum_i k_i w_i``.  For one coefficient and
    isotropic friction, this is Archard's law with ``k = K / (mu H)``, his coefficient K and the
    hardness H [J. F. Archard, J. Appl. Phys. 24 (1953) 981].

    By default wear is implicit: the depth worn in a step is an unknown of the step, so wear never
    opens the contact at a node, for any coefficient.  If wear in the step reduces a node's force by
    less than a fiftieth, the work is ``contact.dissipation``, with the mean of the forces at both
    ends of the step.  Otherwise, the force at the end has a larger weight, up to one (backward
    Euler).  The step is solved repeatedly until the error of the depths changes reactions by at
    most a tenth of ``geometry_tol``; for mild wear, one repetition suffices.

    Explicit wear opens the gap of the next step, and the work is always ``contact.dissipation``.
    If the depth worn in a step, times the node's stiffness, exceeds the node's reaction, the step
    is too large: a warning recommends the number of smaller steps.

    Args:
        coefficient: Wear coefficient k >= 0, a number, or a pair for the two principal directions;
            volume per work, the inverse of a stress.  Or a field: a callable of ``x``,
            ``shape=(3, n)``, that returns ``shape=(n,)`` or ``(2, n)``, or a DOLFINx Function in a
            continuous Lagrange space.  A field is evaluated at the contact nodes when
            ``contact.wear`` is assigned.
        explicit: Whether the depth worn in a step opens only the gap of the next step.
        threshold: Frictional work per area that a node dissipates before it begins to wear, force
            per length.
        opposite: Wear coefficient of the master side, a ``DeformableSurface``; a number or a pair,
            not a field.  The gap opens by the depths of both sides, and each depth stays with its
            own body.  A rigid surface does not wear.

    Raises:
        ValueError: A coefficient or the threshold is negative, not finite or not real, or there are
            more than two coefficients.

    Example:
        >>> contact.wear = dc.Wear(1e-6)  # mm³ per N mm
        >>> contact.wear = dc.Wear(lambda x: np.where(x[0] < 0.5, 1e-6, 1e-7))  # a coating on one half
    """

    _remedy = "make a new Wear, contact.wear = dc.Wear(...)."

    def __init__(
        self,
        coefficient: ArrayLike | Field,
        *,
        explicit: bool = False,
        threshold: float = 0.0,
        opposite: ArrayLike = 0.0,
    ) -> None:
        self.explicit, self.threshold = bool(explicit), number("wear threshold", threshold)
        if self.threshold < 0.0:
            raise ValueError(f"wear threshold must be a number >= 0, got {threshold!r}.")
        self.field = is_field(valued("wear coefficient", coefficient))
        self.coefficient = coefficient if self.field else _checked(coefficient)
        self.opposite = _checked(opposite)
        self._made = True

    def depth(
        self, work: np.ndarray, area: np.ndarray, coefficient: np.ndarray | None = None
    ) -> np.ndarray:
        """Worn depth of both sides together, ``sum_i k_i w_i / A`` with the sum of both sides' k.

        Args:
            work: Frictional work along the principal directions, ``shape=(n, gdim - 1)``, force
                times length.
            area: Nodal areas, ``shape=(n,)``.
            coefficient: Values of a field at the nodes, ``shape=(n, 2)``; by default the
                coefficient of this object.

        Returns:
            ``shape=(n,)``, length; zero where the area is zero.
        """
        k = self.coefficient if coefficient is None else coefficient
        volume = _volume(k + self.opposite, work)
        return np.divide(volume, area, out=np.zeros_like(volume), where=area > 0.0)

    def opposite_share(self, work: np.ndarray, coefficient: np.ndarray | None = None) -> np.ndarray:
        """Fraction of the worn depth that the master side loses, ``shape=(n,)``, between 0 and 1.

        Args:
            work, coefficient: As in ``depth``.
        """
        k = self.coefficient if coefficient is None else coefficient
        both, other = _volume(k + self.opposite, work), _volume(self.opposite, work)
        return np.divide(other, both, out=np.zeros_like(both), where=both > 0.0)

    def part(self, work: np.ndarray, before: np.ndarray, area: np.ndarray) -> np.ndarray:
        """Fraction of a step's work above the wear threshold, ``shape=(n,)``, from 0 to 1.

        Args:
            work: Frictional work of the step, ``shape=(n,)``, force times length.
            before: Total frictional work of all earlier steps, ``shape=(n,)``.
            area: Nodal areas, ``shape=(n,)``.
        """
        beyond = before + work - self.threshold * area
        return np.clip(np.divide(beyond, work, np.ones_like(work), where=work > 0.0), 0.0, 1.0)

    def __repr__(self) -> str:
        coefficient = "field" if self.field else self.coefficient.tolist()
        options = ", explicit=True" * self.explicit
        options += f", threshold={self.threshold:g}" * (self.threshold > 0.0)
        options += f", opposite={self.opposite.tolist()}" * bool(self.opposite.any())
        return f"Wear({coefficient}{options})"


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
