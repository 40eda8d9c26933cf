# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Scaling ``D`` of a mixed space's unknowns, ``u = D x``, to lengths, and residuals to forces.

``D`` is one for displacements.  For other unknowns, such as pressures, it turns ``x`` into a length
and the residual, such as a volume, into a force, see ``scales``.  Norms and tolerances then involve
lengths and forces only, independent of the units of these unknowns.  ``D`` is computed from the
first stiffness and kept.
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
    """Scale an assembled stiffness in place to ``D K D``, and return ``D``.  Collective.

    Args:
        K: PETSc matrix.
        displacements: ``Displacements`` of a mixed space.
        D: Scaling from the first stiffness, ``shape=(owned dofs,)``; None computes it from this
            matrix.

    Returns:
        ``D``, see ``scales``.
    """
    D, factors = scales(K, displacements) if D is None else D, K.createVecLeft()
    factors.array_w[:] = D
    K.diagonalScale(factors, factors)
    factors.destroy()
    return D


def row_sizes(K: PETSc.Mat, displacements: Displacements) -> np.ndarray:
    """Magnitude of each row of ``K``: diagonal entry for displacements, norm for other unknowns."""
    diagonal = K.getDiagonal()
    values = np.abs(diagonal.array_r)
    diagonal.destroy()
    norms = np.sqrt(_rows(K).power(2).sum(axis=1)).A1
    return np.where(displacements.are, values, norms)


def scales(K: PETSc.Mat, displacements: Displacements) -> np.ndarray:
    """Return the scaling ``D`` of the unknowns of a mixed space, ``shape=(owned dofs,)``.
    Collective.

    ``D`` turns the residual of an unknown other than a displacement into a force.  A residual ``c``
    in the equation of an unknown ``q`` that acts on displacements is removed by the change
    ``c / s`` of ``q``, with ``s = |K_qq| + sum |K_qj K_jq| / K_jj``, if each displacement ``j``
    responds independently.  The change causes forces ``K_jq c / s``, whose norm is ``D c``.
    Unknowns that act only on such unknowns follow, in the same way.

    Raises:
        ValueError: on all ranks, if some unknowns act on no displacement, directly or indirectly.
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
    """Owned rows of an assembled matrix, as a SciPy matrix."""
    indptr, indices, values = K.getValuesCSR()
    return sparse.csr_matrix((values, indices, indptr), (len(indptr) - 1, K.getSize()[1]))


def _matrix(K: PETSc.Mat, rows: sparse.csr_matrix):
    """PETSc matrix with given owned rows and the layout of ``K``.  Collective."""
    rows = rows.tocsr()
    csr = (rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data)
    return PETSc.Mat().createAIJ(K.getSizes(), csr=csr, comm=K.comm)


def _product(A: PETSc.Mat, values: np.ndarray) -> np.ndarray:
    """Return ``A x``, owned entries.  Collective."""
    right, left = A.createVecs()
    right.array_w[:] = values
    A.mult(right, left)
    product = left.array_r.copy()
    for vector in (right, left):
        vector.destroy()
    return product
