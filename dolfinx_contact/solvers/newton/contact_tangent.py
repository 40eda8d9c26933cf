# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The tangent of the whole body with the contact in its rows, factorised."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact.contact.interface import assembled
from dolfinx_contact.law.maps import ReturnMap
from dolfinx_contact.petsc.linear_solver import DIRECT, LinearSolver, LinearSolverError, stage


class ContactTangent:
    """``J = (I - R_r) K - R_u``: minus the derivative of the forces out of balance, see ``SurfaceLayer``.

    It differs from ``K`` in the rows of contact nodes alone, and has no entry that ``K`` has not.  The
    symbolic factorisation is kept.

    Args:
        body: The body; its ``K`` may change its values, not its pattern.
        contacts: Its contacts.
    """

    def __init__(self, body, contacts):
        self._body, self._points = body, [contact.points for contact in contacts]
        self._A = self._solver = None
        free = np.ones(body.size)
        free[body.fixed] = 0.0
        self._free = sparse.diags(free)
        dofs = [np.zeros(0, dtype=int), *(points.dofs.ravel() for points in self._points)]
        rows = np.unique(np.concatenate(dofs))  # of nodes in several contacts once
        self._rows = rows[free[rows] > 0]

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
            self._solver = LinearSolver(self._A, DIRECT, prefix, None)
        return self._solver

    @property
    def matrix(self) -> PETSc.Mat:
        """``J``, once it was linearised; ``linearise`` changes its values."""
        return self._A

    @property
    def ksp(self) -> PETSc.KSP:
        """The linear solver of ``matrix``."""
        return self._factors().ksp

    def linearise(self, derivatives) -> None:
        """Set up at the present ``K`` and at derivatives of the nodal maps.  Collective.

        Args:
            derivatives: For each contact ``R_r`` and ``R_u``, ``shape=(n, gdim, gdim)``, local frame.
        """
        K, size = self._body.K, self._body.size
        self._by_forces, self._by_motion = assembled(self._points, derivatives, size)
        with stage("contact: tangent"):
            if self._A is None:
                self._A = K.copy()
                self._A.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
            else:
                K.copy(self._A, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
            self._replace_rows()

    def _replace_rows(self) -> None:
        """Write the rows of contact nodes.  Collective."""
        K, (first, _) = self._body.K, self._body.K.getOwnershipRange()
        indptr, indices, values = K.getValuesCSR()
        stiffness = sparse.csr_matrix((values, indices, indptr), (self._body.size, K.getSize()[1]))
        rows = self._rows
        mix, motion = (
            (part @ self._free).tocsr()[rows].tocoo() for part in (self._by_forces, self._by_motion)
        )
        shifted = (motion.data, (motion.row, first + motion.col))
        rates = sparse.csr_matrix(shifted, (rows.size, stiffness.shape[1]))
        written = (stiffness[rows] - mix.tocsr() @ stiffness - rates).tocsr()
        numbers = (first + rows).astype(PETSc.IntType)
        self._A.zeroRows(numbers, diag=0.0)  # entries that cancel are not written below
        csr = (written.indptr.astype(PETSc.IntType), written.indices.astype(PETSc.IntType))
        insert = PETSc.InsertMode.INSERT_VALUES
        self._A.setValuesIJV(*csr, written.data, addv=insert, rowmap=numbers)
        self._A.assemble()

    def multiply(self, x: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """``J x``, zero at fixed degrees of freedom, from the forces ``K x``."""
        product = forces - self._by_forces @ (self._free @ forces) - self._by_motion @ x
        product[self._body.fixed] = 0.0
        return product

    def solve(self, residual: np.ndarray) -> np.ndarray:
        """``J^-1`` of forces on owned degrees of freedom.

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


def next_change(step, x: np.ndarray) -> float:
    """How much Newton's next step would still change the sums of reactions at nodes, over the forces that act.  Collective.

    Args:
        step: A ``LoadStep`` without planes that force drives, else infinite.
        x: Displacement of owned degrees of freedom.
    """
    if step.surfaces is not None:
        return np.inf
    body, tangent = step.body, ContactTangent(step.body, step.contacts)
    maps = [ReturnMap(of.normal, of.normal) for of in step.stiffness]
    try:
        forces = step.forces(x)
        tangent.linearise(step.derivatives(x, maps, forces))
        dx = tangent.solve(step.free(step.out_of_balance(x, maps, forces)))
    except (LinearSolverError, PETSc.Error):
        return np.inf
    finally:
        tangent.destroy()
    acting = max(step.size(forces), body.norm(step.external))
    return step.size(body.multiply(dx)) / acting if acting > 0.0 else np.inf


class OnTangent:
    """A solver on the tangent of one body, bound; keeps its ordering."""

    def __init__(self, options, body, contacts):
        if any(contact.surface.motions for contact in contacts):
            raise ValueError(
                f"{type(options).__name__}() does not know planes driven by force: use solver=None, dc.CondensedNewton() or "
                "dc.FixedPoint()."
            )
        self._options, self._body = options, body
        self._tangent = ContactTangent(body, contacts)

    def destroy(self) -> None:
        """Free the tangent.  Collective."""
        self._tangent.destroy()

    def renew_law(self) -> bool:
        """See ``BoundSolver``: nothing that is kept knows the law."""
        return True
