# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A body whose residual form is nonlinear in u: large strains, plasticity, follower loads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact import compat
from dolfinx_contact.bodies import rigid_motion
from dolfinx_contact.bodies.elastic import ElasticBody
from dolfinx_contact.bodies.input import check_diagonal, check_finite, check_same_values
from dolfinx_contact.petsc.linear_solver import preconditioner
from dolfinx_contact.support.collective import raised_together

if TYPE_CHECKING:
    import ufl
    from dolfinx import fem

    from dolfinx_contact.contact.displacements import Displacements


class NonlinearBody(ElasticBody):
    """A body with a nonlinear residual ``F(u) = 0`` and Dirichlet conditions.

    ``K`` is the derivative of F at the last linearisation point.  All methods that involve ``K``
    refer to the linearised body, ``F(x) + K (u - x)``, with the point ``x`` of the last
    ``linearise``.  ``residual`` is the residual of F itself.

    Args:
        F, u, bcs, derivative, options, prefix, displacements, form_options: As in ``ElasticBody``.
        before: The user's function ``before_residual``, or None, see ``InternalVariables``.
    """

    nonlinear = True

    def __init__(
        self,
        F: ufl.Form,
        u: fem.Function,
        bcs: Sequence[Any],
        derivative: ufl.Form,
        options: dict[str, Any] | None = None,
        prefix: str | None = None,
        before: Callable | None = None,
        displacements: Displacements | None = None,
        form_options: dict[str, Any] | None = None,
    ):
        super().__init__(F, u, bcs, derivative, options, prefix, displacements, form_options)
        self._before = before
        self._given = [*self._parameters, *self._load_parameters]
        self._rounding = None

    # -- at a displacement ---------------------------------------------------------------------

    def put(self, values: np.ndarray) -> None:
        """Set ``u`` from the unknowns, and call the user's ``before_residual``.  Collective."""
        self.show(values)
        if self._before is not None:
            with raised_together(self.comm):
                self._before(self.u)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Return F at the unknowns ``x``; not finite if an element is turned inside out."""
        with np.errstate(all="ignore"):
            return self.internal_force(x)

    def linearise(self, x: np.ndarray) -> None:
        """Assemble ``K``, the derivative of F, at the unknowns ``x``, unless it is there already.
        Collective.
        """
        if self._place is not None and self.same(x, self._place):
            return
        kept, self._place = self.u.x.array.copy(), None
        try:
            self.put(x)
            self._assemble()
        finally:
            self.u.x.array[:] = kept
        self._hold()
        self._place = x.copy()
        # Rounding is estimated with the tangent at the last converged displacement: the tangent at
        # a bad iterate may be so large that any force seems to be rounding.
        if self._rounding is not None:
            self._row_size = self._rounding

    # -- a step --------------------------------------------------------------------------------

    def support(self, bcs: Sequence[Any]) -> None:
        """See ``ElasticBody``."""
        super().support(bcs)
        self._place = self.soft = None  # linearisation point and soft modes: not known

    def refresh(self, x: np.ndarray | None = None) -> int:
        """Check that ranks agree on parameters, and linearise at the last converged displacement.
        Collective.

        Args:
            x: Last converged displacement, owned degrees of freedom; None leaves ``K`` unchanged.

        Returns:
            Number of assemblies of ``K`` so far.

        Raises:
            ValueError: a rigid motion of the body is unsupported, or the stiffness is not positive.
        """
        check_same_values((*self._given, *compat.bc_constants(self.bcs)), self.comm)
        if x is not None:
            self._place = self._rounding = None  # constants and coefficients may have changed
            self.linearise(x)
            self._rounding = self._row_size
            with raised_together(self.comm):
                check_diagonal(self.diagonal(), self.displacements)
            if self.soft is None:
                soft, loose = rigid_motion.soft_motions(self)
                if loose is not None:
                    raise ValueError(
                        f"{loose.refusal()} Contact alone does not hold a body whose F is not linear in u: fix it by "
                        "Dirichlet conditions, or add a soft spring to F."
                    )
                self.soft = soft
        return self.assemblies

    def load(self) -> tuple[np.ndarray, np.ndarray]:
        """Return boundary values of this step, and the external forces ``-F(0)``.

        Returns:
            Boundary values at fixed degrees of freedom, zero elsewhere; external forces, zero at
            fixed degrees of freedom.
        """
        values = self.boundary_values()
        external = -self.internal_force(np.zeros(self.size))
        external[self.fixed] = 0.0
        check_finite({"boundary values": values, "loads, F at u = 0,": external}, self.comm)
        return values, external

    # -- the linearised body -------------------------------------------------------------------

    def linear_load(self, values: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Return the right-hand side ``b`` of the linearised body, see ``ElasticBody.load``.

        Args:
            values: Boundary values, zero at free degrees of freedom.
            residual: F at the linearisation point.
        """
        x = self._place
        motion = np.where(self._is_fixed(), values - x, 0.0)
        free = np.where(self._is_fixed(), 0.0, x)
        b = self.multiply(free) - residual - self.carried(motion)
        self._external = np.zeros(self.size)
        self._external[self.fixed] = self.support_forces(x) - residual[self.fixed]
        b[self.fixed] = values[self.fixed]
        return b

    def _is_fixed(self) -> np.ndarray:
        fixed = np.zeros(self.size, dtype=bool)
        fixed[self.fixed] = True
        return fixed

    def free_state(self, b: np.ndarray, rough: bool = False) -> np.ndarray:
        """Return the contact-free displacement of the linearised body under ``b``."""
        x = self.solve(b, rough)
        x[self.fixed] = b[self.fixed]
        return x

    def stiffness_norm(self) -> float:
        """Return zero: the stiffness depends on the state, so it does not identify the body."""
        return 0.0

    def forget(self) -> None:
        """See ``ElasticBody``."""
        super().forget()
        self._place = None

    @property
    def factorised(self) -> bool:
        """Whether linear systems of this body are solved by factorisation."""
        return preconditioner(self.K, self.options, self.prefix) in ("lu", "cholesky")
