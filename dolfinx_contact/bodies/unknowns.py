# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The unknowns of a mixed space as lengths and their residuals as forces: ``u = D x`` and ``D F``.

``D`` is one for displacements.  For other unknowns, as pressures, it makes ``x`` a length and the residual, as of
volumes, a force, see ``scales``: all that compares, adds and minimises is then about lengths and forces alone, and the
units of those unknowns do not matter.  ``D`` is that of the first stiffness, and stays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact.support.collective import raised_together

if TYPE_CHECKING:
    from dolfinx_contact.contact.displacements import Displacements


def scaled(K: PETSc.Mat, displacements: Displacements, D: np.ndarray | None = None) -> np.ndarray:
    """Make ``D K D`` of an assembled stiffness, in place.  Collective.

    Args:
        K: PETSc matrix.
        displacements: ``Displacements`` of a mixed space.
        D: Of the first stiffness, ``shape=(owned dofs,)``; None takes it from this one.

    Returns:
        ``D``, see ``scales``.
    """
    D, factors = scales(K, displacements) if D is None else D, K.createVecLeft()
    factors.array_w[:] = D
    K.diagonalScale(factors, factors)
    factors.destroy()
    return D


def row_sizes(K: PETSc.Mat, displacements: Displacements) -> np.ndarray:
    """Size of the entries in each row: the diagonal one, of unknowns besides displacements the norm of all."""
    diagonal = K.getDiagonal()
    values = np.abs(diagonal.array_r)
    diagonal.destroy()
    norms = np.sqrt(_rows(K).power(2).sum(axis=1)).A1
    return np.where(displacements.are, values, norms)


def scales(K: PETSc.Mat, displacements: Displacements) -> np.ndarray:
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


def _rows(K: PETSc.Mat) -> sparse.csr_matrix:
    """Owned rows of an assembled matrix."""
    indptr, indices, values = K.getValuesCSR()
    return sparse.csr_matrix((values, indices, indptr), (len(indptr) - 1, K.getSize()[1]))


def _matrix(K: PETSc.Mat, rows: sparse.csr_matrix):
    """A PETSc matrix of owned rows, shared among ranks as ``K``."""
    rows = rows.tocsr()
    csr = (rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data)
    return PETSc.Mat().createAIJ(K.getSizes(), csr=csr, comm=K.comm)


def _product(A: PETSc.Mat, values: np.ndarray) -> np.ndarray:
    """``A x``, owned entries."""
    right, left = A.createVecs()
    right.array_w[:] = values
    A.mult(right, left)
    product = left.array_r.copy()
    for vector in (right, left):
        vector.destroy()
    return product
