# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The unknowns of a body as vectors of lengths and forces, those of a mixed space besides displacements, too."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact import compat
from dolfinx_contact.support.collective import raised_together


class Unknowns:
    """Unknowns ``u = D x`` and residuals ``D F``, of a body that has ``u``, ``bcs``, ``size``, ``displacements``, and sums over ranks.

    ``D`` is one for displacements.  For other unknowns, as pressures, it makes ``x`` a length and the residual, as of
    volumes, a force, see ``scales``: all that compares, adds and minimises is then about lengths and forces alone, and
    the units of those unknowns do not matter.  ``D`` is that of the first stiffness, and stays.
    """

    scale: np.ndarray | None = None  # D, (owned dofs,); None where it is one, or not yet known

    def show(self, x: np.ndarray) -> None:
        """Let ``u`` have these values, the first of which are the owned ones.  Collective."""
        self.u.x.array[: self.size] = self.values(x[: self.size])
        self.u.x.scatter_forward()

    def values(self, x: np.ndarray) -> np.ndarray:
        """``u`` of owned degrees of freedom."""
        return x if self.scale is None else self.scale * x

    def taken(self, values: np.ndarray) -> np.ndarray:
        """``x`` of values of ``u``, the first of which are the owned ones."""
        values = values[: self.size].copy()
        return values if self.scale is None else values / self.scale

    def boundary_values(self) -> np.ndarray:
        """``x`` of the Dirichlet conditions' values, zero at free degrees of freedom."""
        values = np.zeros_like(self.u.x.array)
        compat.set_bc_values(values, self.bcs)
        return self.taken(values)

    def farthest(self, x: np.ndarray) -> float:
        """Largest component of a displacement, of either sign, over all ranks."""
        return self.largest(np.abs(self.displacements.rows(x)))

    def as_forces(self, residual: np.ndarray) -> np.ndarray:
        """Residuals of which the first are the owned ones, as forces."""
        residual = residual[: self.size].copy()
        return residual if self.scale is None else self.scale * residual

    def balance(self, K) -> None:
        """Make ``D K D`` of an assembled matrix, in place, where there are other unknowns.  Collective."""
        if not self.displacements.mixed:
            return
        if self.scale is None:
            self.scale = scales(K, self.displacements)
        factors = K.createVecLeft()
        factors.array_w[:] = self.scale
        K.diagonalScale(factors, factors)
        factors.destroy()

    def sizes(self, K) -> np.ndarray:
        """Size of the entries in each row: the diagonal one, of unknowns besides displacements the norm of all."""
        diagonal = K.getDiagonal()
        values = np.abs(diagonal.array_r)
        diagonal.destroy()
        if self.displacements.mixed:
            norms = np.sqrt(_rows(K).power(2).sum(axis=1)).A1
            values = np.where(self.displacements.are, values, norms)
        return values


def scales(K, displacements) -> np.ndarray:
    """``D`` of a stiffness: what makes a residual of other unknowns a force, ``shape=(owned dofs,)``.

    A residual ``c`` in the equation of an unknown ``q`` that acts on displacements is removed by its change ``c / s``,
    ``s = |K_qq| + sum |K_qj K_jq| / K_jj``, while each displacement ``j`` gives way by itself.  That makes forces
    ``K_jq c / s``, whose norm is ``D c``.  Unknowns that act on those unknowns come next, in the same way.

    Raises:
        ValueError: on all ranks, if unknowns act on no displacement.
    """
    rows = _rows(K)
    transposed = K.transpose(PETSc.Mat())
    columns = _rows(transposed)
    transposed.destroy()
    pairs, squares = _matrix(K, abs(rows.multiply(columns))), _matrix(K, columns.power(2))
    diagonal = K.getDiagonal().array_r
    known, stiffness, D = displacements.are.copy(), np.abs(diagonal), np.ones(len(diagonal))
    comm = K.comm.tompi4py()
    with np.errstate(all="ignore"):
        while comm.allreduce(int((~known).sum())) > 0:
            acts = _product(squares, np.where(known, D * D, 0.0))
            new = ~known & (acts > 0.0)
            if comm.allreduce(int(new.sum())) == 0:
                break
            given = np.abs(diagonal) + _product(pairs, np.where(known, 1 / stiffness, 0.0))
            stiffness[new] = given[new]
            D[new] = np.sqrt(acts[new]) / given[new]
            known |= new
    for matrix in (pairs, squares):
        matrix.destroy()
    with raised_together(comm):
        if not (known.all() and np.isfinite(D).all()):
            raise ValueError(
                f"{(~known | ~np.isfinite(D)).sum()} unknown(s) of the mixed space on this rank have no equation in F, or do "
                "not act on displacements: every field has to act on them, or on one that does. Check F, and that its "
                "parameters are finite."
            )
    return D


def _rows(K) -> sparse.csr_matrix:
    """Owned rows of an assembled matrix."""
    indptr, indices, values = K.getValuesCSR()
    return sparse.csr_matrix((values, indices, indptr), (len(indptr) - 1, K.getSize()[1]))


def _matrix(K, rows):
    """A PETSc matrix of owned rows, shared among ranks as ``K``."""
    rows = rows.tocsr()
    csr = (rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data)
    return PETSc.Mat().createAIJ(K.getSizes(), csr=csr, comm=K.comm)


def _product(A, values: np.ndarray) -> np.ndarray:
    """``A x``, owned entries."""
    right, left = A.createVecs()
    right.array_w[:] = values
    A.mult(right, left)
    product = left.array_r.copy()
    for vector in (right, left):
        vector.destroy()
    return product
