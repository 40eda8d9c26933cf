# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Symmetric PETSc matrices stored by their lower half in nodal blocks, and Gauss-Seidel sweeps."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact._kernel import SymmetricBlocks

# Block sizes that the kernel supports.
BLOCK_SIZES = 1, 2, 3

# Difference of a product from the symmetric product, over the sum of the row's magnitudes, up to
# which a matrix counts as symmetric: rounding, even with flat elements.
ROW_ROUNDING = 1e-10


class SymmetricMatrix:
    """Context of a PETSc matrix of type python, stored by its lower half: half the memory traffic.

    Attributes:
        own: The kernel's ``SymmetricBlocks``, which couple this rank's unknowns with each other.
        others: PETSc matrix that couples them with unknowns of other ranks; None on one rank.
        size: Number of rows of a block.
    """

    def __init__(self, own: SymmetricBlocks, others: PETSc.Mat | None, size: int):
        self.own, self.others, self.size = own, others, size

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Compute ``y = A x``."""
        y.array_w[:] = self.own.multiply(x.array_r)
        if self.others is not None:
            self.others.multAdd(x, y, y)

    def getDiagonal(self, _: PETSc.Mat, diagonal: PETSc.Vec) -> None:
        """Write the diagonal of ``A`` to ``diagonal``."""
        diagonal.array_w[:] = self.own.diagonal()


class GaussSeidel:
    """Context of a PETSc preconditioner of type python: one symmetric Gauss-Seidel sweep from zero.

    Each rank sweeps over its own unknowns only.
    """

    def setUp(self, pc: PETSc.PC) -> None:
        """Store the matrix of the preconditioner; its context must be a ``SymmetricMatrix``."""
        self._own = pc.getOperators()[1].getPythonContext().own

    def apply(self, _: PETSc.PC, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Set ``x`` to the result of one sweep for ``A x = b``."""
        x.array_w[:] = self._own.sweep(b.array_r)


def halved(A: PETSc.Mat) -> PETSc.Mat | None:
    """Convert a matrix to a ``SymmetricMatrix``; None if it is not symmetric.  Collective.

    Symmetry is checked by one product with a random vector.
    """
    size = A.getBlockSize() if A.getBlockSize() in BLOCK_SIZES else 1
    rows, own = _rows(A)
    blocks = SymmetricBlocks(own.indptr, own.indices, own.data, size)
    others = None
    if A.comm.size > 1:
        others = with_entries(A, rows.indptr, rows.indices, rows.data, ~_in_owned_columns(A, rows))
    np.abs(rows.data, out=rows.data)
    sizes = rows.sum(axis=1).A1
    del rows, own  # as much memory as the matrix itself
    found = _with_context(A, SymmetricMatrix(blocks, others, size))
    x, y = A.createVecs()
    x.array_w[:] = np.random.default_rng(A.comm.rank).uniform(-1.0, 1.0, sizes.size)
    A.mult(x, y)
    product = y.array_r.copy()
    found.mult(x, y)
    differs = (np.abs(y.array_r - product) > ROW_ROUNDING * sizes).any()
    refused = A.comm.tompi4py().allreduce(differs, op=MPI.LOR)
    for part in (x, y, *((found, others) if refused else ())):
        if part is not None:
            part.destroy()
    return None if refused else found


def plus(A: PETSc.Mat, S: PETSc.Mat) -> PETSc.Mat | None:
    """Return a ``halved`` matrix plus springs, or None if springs couple different nodes.
    Collective.

    Off-diagonal blocks are shared with the given matrix.
    """
    context = A.getPythonContext()
    rows, own = _rows(S)
    own = own.tobsr((context.size, context.size))
    nodes = np.repeat(np.arange(own.indptr.size - 1), np.diff(own.indptr))
    only = rows.nnz == np.count_nonzero(_in_owned_columns(S, rows)) and (own.indices == nodes).all()
    if not A.comm.tompi4py().allreduce(only, op=MPI.LAND):
        return None
    added = np.zeros((own.indptr.size - 1, context.size, context.size))
    added[nodes] = own.data
    return _with_context(A, SymmetricMatrix(context.own.plus(added), context.others, context.size))


def _with_context(A: PETSc.Mat, context: SymmetricMatrix) -> PETSc.Mat:
    """PETSc matrix with the layout of ``A`` and a given context.  Collective."""
    found = PETSc.Mat().createPython(A.getSizes(), context, A.comm)
    found.setUp()
    return found


def _rows(A: PETSc.Mat) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """Owned rows of a matrix, and the submatrix of owned rows and columns, as SciPy matrices."""
    starts, columns, values = A.getValuesCSR()
    rows = sparse.csr_matrix((values, columns, starts), (starts.size - 1, A.getSize()[1]))
    own = rows if A.comm.size == 1 else rows[:, slice(*A.getOwnershipRange())]
    return rows, own


def _in_owned_columns(A: PETSc.Mat, rows: sparse.csr_matrix) -> np.ndarray:
    """Whether each entry is in a column owned by this rank, a bool array."""
    first, last = A.getOwnershipRange()
    return (rows.indices >= first) & (rows.indices < last)


def with_entries(
    A: PETSc.Mat, starts: np.ndarray, columns: np.ndarray, values: np.ndarray, kept: np.ndarray
) -> PETSc.Mat:
    """PETSc matrix with the layout of ``A`` and selected entries of its owned rows.  Collective.

    Args:
        A: PETSc matrix.
        starts, columns, values: Owned rows, compressed sparse row format.
        kept: Entries to select, bool.
    """
    starts = np.append(0, np.cumsum(kept))[starts].astype(PETSc.IntType)
    csr = starts, columns[kept].astype(PETSc.IntType), values[kept]
    return PETSc.Mat().createAIJ(A.getSizes(), csr=csr, comm=A.comm)
