# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Load steps of a nonlinear body, and of its linearisation at a displacement."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.step.load_step import LoadStep, StepState

if TYPE_CHECKING:
    from dolfinx_contact.step.errors import Errors


class NonlinearStep(LoadStep):
    """``LoadStep`` of a nonlinear body, with out-of-balance forces ``-F(x)``.

    ``b`` contains the boundary values at fixed degrees of freedom and is zero elsewhere.  The
    metric of the errors is the tangent stiffness at the last converged displacement.
    """

    exact_forces = True

    def start(self) -> StepState:
        """Return the state at the initial guess with the smallest residual.

        The residual includes the force with which the linearised body resists the missing motion of
        supports, since a guess need not satisfy the boundary values.
        """
        sizes, different = [], []
        for guess in self.starts:
            if any(self.body.same(guess, other.x) for other in different):
                continue
            state = self.evaluate(guess, self.error_maps)
            left = self.with_reactions(state.forces, state.nodes)
            sizes.append(self.size(left - self.body.carried(self.missing(guess))))
            different.append(state)
        return different[int(np.argmin(np.nan_to_num(sizes, nan=np.inf)))]

    def forces(self, x: np.ndarray) -> np.ndarray:
        """Return ``-F(x)``; entries at fixed degrees of freedom are minus the support forces."""
        return self.residual_forces(x)

    def errors_of(self, state: StepState, contacts: np.ndarray | None) -> Errors:
        """Return the errors of a state; infinite if boundary values are violated.  Collective."""
        errors = super().errors_of(state, contacts)
        return errors if self.held(state.x) else errors._replace(error=np.inf)


class LinearisedStep(LoadStep):
    """``LoadStep`` of a linearised body; errors are also measured with its stiffness ``K``."""

    def residual_forces(self, x: np.ndarray) -> np.ndarray:
        """See ``LoadStep``."""
        forces = self.forces(x)
        forces[self.body.fixed] = -self.body.support_forces(x)
        return forces
