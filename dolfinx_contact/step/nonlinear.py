# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Load steps of a nonlinear body, and of the one that is linearised at a displacement."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.step.load_step import LoadStep, StepState

if TYPE_CHECKING:
    from dolfinx_contact.step.errors import Errors


class NonlinearStep(LoadStep):
    """As ``LoadStep``; forces out of balance are those of the form itself, ``-F(x)``.

    ``b`` has the boundary values at fixed degrees of freedom and is zero elsewhere.  The metric of the errors is the
    tangent at the last converged displacement.
    """

    exact_forces = True

    def start(self) -> StepState:
        """The start from which the least is missing, as forces of the linearised body; with boundary values of its own."""
        sizes, different = [], []
        for guess in self.starts:
            if any(self.body.same(guess, other.x) for other in different):
                continue
            state = self.evaluate(guess, self.measuring_maps)
            left = self.with_reactions(state.forces, state.nodes)
            sizes.append(self.size(left - self.body.carried(self.missing(guess))))
            different.append(state)
        return different[int(np.argmin(np.nan_to_num(sizes, nan=np.inf)))]

    def forces(self, x: np.ndarray) -> np.ndarray:
        """``-F(x)``; at fixed degrees of freedom what supports carry."""
        return self.by_form(x)

    def errors_of(self, state: StepState, contacts: np.ndarray | None) -> Errors:
        """See ``LoadStep``; infinite where supports are not where they should be."""
        errors = super().errors_of(state, contacts)
        return errors if self.held(state.x) else errors._replace(error=np.inf)


class LinearisedStep(LoadStep):
    """As ``LoadStep`` of a linear body; errors are measured with its ``K``, too."""

    def by_form(self, x: np.ndarray) -> np.ndarray:
        """See ``LoadStep``."""
        forces = self.forces(x)
        forces[self.body.fixed] = -self.body.support_forces(x)
        return forces
