"""Archard's wear law: worn depth from the work of friction per area."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.support.attributes import Guarded, frozen
from dolfinx_contact.support.checks import finite


class Wear(Guarded):
    """Archard wear with feedback: worn depth opens the gap.

    The depth of a node grows by ``sum_i k_i w_i / A``, with ``w_i >= 0`` the frictional work along principal direction i in the
    step (``dissipation.py``) and ``A`` the nodal area.  So the worn volume, the sum of depth times area, is ``sum k_i
    w_i``.  With one coefficient and isotropic friction, ``k = K / (mu H)`` is Archard's law, with his coefficient K and the
    hardness H [J.  F.  Archard, J.  Appl.  Phys. 24 (1953) 981].

    Wear is integrated implicitly, by backward Euler: the depth worn in a step is part of its equations, and the work is the slip
    times the force at its end.  So a node is never worn below contact, whatever the coefficient.  The step is solved again until
    depths are off by at most a tenth of ``geometry_tol`` of the acting forces; once is enough for gentle wear.

    Explicit wear opens the gap of the next step, and its work is that of ``contact.dissipation``, with the mean of the forces at
    both ends.  If the depth worn in a step, times the node's stiffness, then exceeds the node's reaction, the step is too large:
    a warning says into how many steps to divide it.

    Args:
        coefficient: k, a number, or a pair for the two friction directions; volume per work, the inverse of a stress, >= 0.
        explicit: Whether the depth worn in a step opens the gap of the next one only.

    Raises:
        ValueError: a coefficient that is negative, not finite or not real, or more than two.

    Example:
        >>> contact.wear = dc.Wear(1e-6)  # mm³ per N mm
    """

    _remedy = "make a new Wear, contact.wear = dc.Wear(...)."

    def __init__(self, coefficient: ArrayLike, *, explicit: bool = False) -> None:
        array = finite("wear coefficient", coefficient)
        if array.shape not in ((), (1,), (2,)) or (array < 0).any():
            raise ValueError(
                "wear coefficient must be a number or a pair of numbers >= 0, volume per work; got "
                f"{coefficient!r}."
            )
        self.coefficient, self.explicit = frozen(array), bool(explicit)
        self._made = True

    def depth(self, work: np.ndarray, area: np.ndarray) -> np.ndarray:
        """Depth worn by ``work``, ``shape=(n, gdim - 1)``, on ``area``, ``shape=(n,)``; length.  None where there is no area."""
        volume = (self.coefficient * work).sum(axis=1)
        return np.divide(volume, area, out=np.zeros_like(volume), where=area > 0.0)

    def __repr__(self) -> str:
        return f"Wear({self.coefficient.tolist()}{', explicit=True' * self.explicit})"
