# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Load steps of a nonlinear body, and of the one that is linearised at a displacement."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dolfinx_contact.law.maps import NodalMap, ReturnMap
from dolfinx_contact.step.errors import Errors
from dolfinx_contact.step.load_step import LoadStep


class NonlinearStep(LoadStep):
    """As ``LoadStep``; forces out of balance are those of the form itself, ``-F(x)``.

    ``b`` has the boundary values at fixed degrees of freedom and is zero elsewhere.  The metric of the errors is the
    tangent at the last converged displacement.
    """

    def start(self) -> np.ndarray:
        """The start from which the least is missing, as forces of the linearised body; with boundary values of its own."""
        maps = [ReturnMap(of.normal, of.normal) for of in self.stiffness]
        sizes, different = [], []
        for guess in self._starts:
            if any(self.body.same(guess, other) for other in different):
                continue
            left = self.out_of_balance(guess, maps) - self.body.carried(self.missing(guess))
            sizes.append(self.size(left))
            different.append(guess)
        return different[int(np.argmin(np.nan_to_num(sizes, nan=np.inf)))]

    def forces(self, x: np.ndarray) -> np.ndarray:
        """``-F(x)``; at fixed degrees of freedom what supports carry."""
        return self.by_form(x)

    def residual(
        self, x: np.ndarray, maps: Sequence[NodalMap], forces: np.ndarray | None = None
    ) -> tuple[np.ndarray, Errors]:
        """``out_of_balance`` and the errors of the state."""
        forces = self.forces(x) if forces is None else forces
        left = self.out_of_balance(x, maps, forces)
        self._judge(x, forces)
        self._tell()
        return left, self.errors

    def _as_errors(
        self, x: np.ndarray, balance: np.ndarray, contacts: np.ndarray | None = None
    ) -> Errors:
        errors = super()._as_errors(x, balance, contacts)
        return errors if self.held(x) else errors._replace(error=np.inf)


class LinearisedStep(LoadStep):
    """As ``LoadStep`` of a linear body; errors are measured with its ``K``, too."""

    def by_form(self, x: np.ndarray) -> np.ndarray:
        forces = self.forces(x)
        forces[self.body.fixed] = -self.body.support_forces(x)
        return forces
