# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The tangent matrix of body and contact together, factorised."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from petsc4py import PETSc

from dolfinx_contact.contact.interface import like, response, responses, structure
from dolfinx_contact.petsc.linear_solver import (
    DIRECT_OPTIONS,
    LinearSolver,
    LinearSolverError,
    stage,
)
from dolfinx_contact.solvers.base import BoundSolver

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.interface import ContactPoints
    from dolfinx_contact.step.load_step import LoadStep, StepState


class ContactTangent:
    """Tangent ``J = (I - R_r) K - R_u`` of body and contact, minus the derivative of the residual.

    ``K`` is the stiffness of the body; ``R_r`` and ``R_u`` are the derivatives of the new reactions
    with respect to the required reactions and to the displacement.  ``J`` differs from ``K`` only
    in the rows of contact nodes.  Its sparsity pattern is contained in the pattern of ``K`` unless
    a contact point depends on several nodes.  The symbolic factorisation is kept.

    Args:
        body: The body; the values of its ``K`` may change, the pattern may not.
        points: ``ContactPoints`` of each contact.
    """

    def __init__(self, body: ElasticBody, points: Sequence[ContactPoints]):
        self._body, self._points = body, points
        self._A = self._solver = None
        self._free = np.ones(body.size)
        self._free[body.fixed] = 0.0

    def destroy(self) -> None:
        """Free matrix and factors.  Collective."""
        if self._A is not None:
            self._A.destroy()
        self._forget_factors()
        self._A = None

    def _forget_factors(self) -> None:
        if self._solver is not None:
            self._solver.destroy()
        self._solver = None

    def _factors(self) -> LinearSolver:
        if self._solver is None:
            prefix = f"{self._body.prefix}tangent_"
            self._solver = LinearSolver(self._A, DIRECT_OPTIONS, prefix, None)
        return self._solver

    @property
    def matrix(self) -> PETSc.Mat:
        """The tangent ``J``, a PETSc matrix; None before the first call of ``linearise``."""
        return self._A

    @property
    def ksp(self) -> PETSc.KSP:
        """The PETSc linear solver for ``matrix``."""
        return self._factors().ksp

    def linearise(self, derivatives: Sequence[tuple]) -> None:
        """Assemble ``J`` from the present ``K`` and the derivatives of the nodal maps.  Collective.

        Args:
            derivatives: For each contact ``R_r`` and ``R_u``, ``shape=(n, gdim, gdim)``, local
                frame.
        """
        K, self._derivatives = self._body.K, derivatives
        with stage("contact: tangent"):
            if self._A is None:
                self._A = self._pattern()
                self._A.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
            self._A.zeroEntries()
            self._A.axpy(1.0, K, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
            free = self._A.createVecLeft()
            free.array_w[:] = self._free
            change = contact_contribution(K, responses(K, self._points, derivatives), free)
            self._A.axpy(-1.0, change, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
            change.destroy()
            free.destroy()

    def _pattern(self) -> PETSc.Mat:
        """Return a matrix whose sparsity pattern holds all entries of ``J``.  Collective."""
        A, how = self._body.K.copy(), structure(self._points)
        if how != PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN:
            # Random values: products of ones may cancel, for instance for a normal along a
            # diagonal.
            any_values = np.random.default_rng(0).uniform(
                1.0, 2.0, self._points[0].frames.shape[1:]
            )
            some = [
                (np.tile(any_values, (point_set.count, 1, 1)),) * 2 for point_set in self._points
            ]
            change = contact_contribution(self._body.K, responses(self._body.K, self._points, some))
            change.scale(0.0)
            A.axpy(1.0, change, how)
            change.destroy()
        return A

    def multiply(self, x: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Product ``J x`` from ``forces = K x``; zero at constrained degrees of freedom."""
        product = forces - response(self._points, self._derivatives, self._free * forces, x)
        product[self._body.fixed] = 0.0
        return product

    def solve(self, residual: np.ndarray) -> np.ndarray:
        """Solve ``J x = residual``; arrays of owned degrees of freedom.

        Raises:
            LinearSolverError: ``J`` is singular.
        """
        for last in (self._solver is None, True):
            try:
                return self._factors().solve(residual)
            except (LinearSolverError, PETSc.Error):
                self._forget_factors()  # an old ordering may not fit
                if last:
                    raise
        raise AssertionError


def contact_contribution(K: PETSc.Mat, both: Sequence, free: np.ndarray | None = None) -> PETSc.Mat:
    """Contribution ``R_r K + R_u`` of the contacts to a stiffness ``K``, a PETSc matrix.
    Collective.

    Args:
        K: PETSc matrix: the stiffness, or a diagonal block of it.
        both: The matrices ``R_r`` and ``R_u`` in the numbering of ``K``, as ``responses`` returns
            them or as PETSc matrices.
        free: PETSc vector, one at free degrees of freedom, zero at constrained ones; None if all
            are free.
    """
    P, Q = (given if isinstance(given, PETSc.Mat) else like(K, given) for given in both)
    if free is not None:
        P.diagonalScale(free, free)
        Q.diagonalScale(free, free)
    change = P.matMult(K)
    change.axpy(1.0, Q, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    P.destroy()
    Q.destroy()
    return change


def next_change(state: StepState) -> float:
    """Change of the nodal forces in the next Newton step, relative to the acting forces.
    Collective.

    Infinite if surfaces are driven by force, or if the tangent is singular.

    Args:
        state: State of a load step near its solution.
    """
    step, body = state.step, state.step.body
    if step.surfaces is not None:
        return np.inf
    tangent = ContactTangent(body, [contact.points for contact in step.contacts])
    try:
        near = step.evaluate(state.x, step.error_maps, before=state)
        tangent.linearise(step.derivatives(near, step.error_maps))
        dx = tangent.solve(near.residual)
    except (LinearSolverError, PETSc.Error):
        return np.inf
    finally:
        tangent.destroy()
    acting = max(step.size(near.forces), body.norm(step.external))
    return step.size(body.multiply(dx)) / acting if acting > 0.0 else np.inf


class OnTangent(BoundSolver):
    """Base class of solvers that factorise the ``ContactTangent`` of one problem.

    Args:
        options: The solver's options.
        step: The first load step.

    Raises:
        ValueError: a surface is driven by force.
    """

    def __init__(self, options: Any, step: LoadStep):
        if step.surfaces is not None:
            raise ValueError(
                f"{type(options).__name__}() does not know planes driven by force: use solver=None, dc.CondensedNewton() or "
                "dc.FixedPoint()."
            )
        self._options, self._body = options, step.body
        self._bind(step)

    def _bind(self, step: LoadStep) -> None:
        self._stamps = step.stamps
        self._tangent = ContactTangent(step.body, [contact.points for contact in step.contacts])

    def update(self, step: LoadStep) -> None:
        """Discard the tangent if the frames of the contact nodes or the stiffness changed.
        Collective.

        The friction law enters only through ``linearise``, so its changes need no action.  For a
        non-linear body, a new stiffness needs no new pattern.
        """
        new, old = step.stamps, self._stamps
        stiffness = new.stiffness != old.stiffness and not self._body.nonlinear
        if stiffness or new.rows != old.rows:
            self.close()
            self._bind(step)
        self._stamps = new

    def close(self) -> None:
        """Free the tangent.  Collective."""
        self._tangent.destroy()
