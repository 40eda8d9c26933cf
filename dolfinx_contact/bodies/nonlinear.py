# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A body whose residual form is not linear in the displacement: large strains, plasticity, follower loads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact import compat
from dolfinx_contact.bodies import rigid_motion
from dolfinx_contact.bodies.elastic import ElasticBody
from dolfinx_contact.bodies.input import agree_on_values, check_diagonal, check_finite
from dolfinx_contact.petsc.linear_solver import preconditioner
from dolfinx_contact.support.collective import raised_together

if TYPE_CHECKING:
    import ufl
    from dolfinx import fem

    from dolfinx_contact.contact.displacements import Displacements


class NonlinearBody(ElasticBody):
    """F(u) = 0 on the free degrees of freedom; ``K`` is the derivative of F where it was linearised last.

    ``residual`` is that of F.  All that has to do with ``K`` is about the linearised body,
    ``F(x) + K (u - x)``, at the place ``x`` of the last ``linearise``.
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
        """Let ``u`` and what the user makes of it be those of a displacement, owned degrees of freedom.  Collective."""
        self.show(values)
        if self._before is not None:
            with raised_together(self.comm):
                self._before(self.u)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """See ``ElasticBody``; not finite where an element is turned inside out."""
        with np.errstate(all="ignore"):
            return self.internal_force(x)

    def linearise(self, x: np.ndarray) -> None:
        """Let ``K`` be the derivative of F at a displacement, and the linearised body the one there.  Collective."""
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
        # Rounding is that of the last converged displacement: beside the tangent of a senseless trial any force is small.
        if self._rounding is not None:
            self._row_size = self._rounding

    # -- a step --------------------------------------------------------------------------------

    def support(self, bcs: Sequence[Any]) -> None:
        """See ``ElasticBody``."""
        super().support(bcs)
        self._place = self.soft = None  # where K stands, and motions that are soft: not known

    def refresh(self, x: np.ndarray | None = None) -> int:
        """Agree on what is given, and linearise at the last converged displacement.

        Args:
            x: Last converged displacement, owned degrees of freedom; None leaves ``K`` as it is.

        Returns:
            How often ``K`` was assembled so far.
        """
        agree_on_values((*self._given, *compat.bc_constants(self.bcs)), self.comm)
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
        """Boundary values of this step, and the external forces ``-F(0)``.

        Returns:
            An array that is zero but for the boundary values at fixed degrees of freedom, and the forces.
        """
        values = self.boundary_values()
        external = -self.internal_force(np.zeros(self.size))
        external[self.fixed] = 0.0
        check_finite({"boundary values": values, "loads, F at u = 0,": external}, self.comm)
        return values, external

    # -- the linearised body -------------------------------------------------------------------

    def linear_load(self, values: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """``b`` of the linearised body, see ``ElasticBody.load``.

        Args:
            values: Zero but for the boundary values.
            residual: F where ``K`` stands.
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
        """Displacement of the linearised body under ``b`` alone."""
        x = self.solve(b, rough)
        x[self.fixed] = b[self.fixed]
        return x

    def stiffness_norm(self) -> float:
        """Zero: the stiffness is that of a state, and tells no body from another."""
        return 0.0

    def forget(self) -> None:
        """See ``ElasticBody``."""
        super().forget()
        self._place = None

    @property
    def factorised(self) -> bool:
        """Whether linear systems of this size are factorised."""
        return preconditioner(self.K, self.options, self.prefix) in ("lu", "cholesky")
