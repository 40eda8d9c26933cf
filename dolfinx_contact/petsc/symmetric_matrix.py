# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Symmetric PETSc matrices by their lower half, in blocks of a node's unknowns, and Gauss-Seidel sweeps with them."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact._kernel import SymmetricBlocks

# Sizes of blocks that the kernel knows.
BLOCK_SIZES = 1, 2, 3

# Part of the sum of a row's magnitudes by which the row across the diagonal may differ: rounding, also where elements are flat.
ROW_ROUNDING = 1e-10


class SymmetricMatrix:
    """Context of a PETSc matrix of type python: products with half of the memory traffic.

    Attributes:
        own: The kernel's ``SymmetricBlocks`` of this rank's unknowns.
        others: A PETSc matrix, what couples them with those of other ranks; None on one rank.
        size: Rows of a block.
    """

    def __init__(self, own: SymmetricBlocks, others: PETSc.Mat | None, size: int):
        self.own, self.others, self.size = own, others, size

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = A x."""
        y.array_w[:] = self.own.multiply(x.array_r)
        if self.others is not None:
            self.others.multAdd(x, y, y)

    def getDiagonal(self, _: PETSc.Mat, diagonal: PETSc.Vec) -> None:
        """The diagonal of A."""
        diagonal.array_w[:] = self.own.diagonal()


class GaussSeidel:
    """Context of a PETSc preconditioner of type python: one symmetric sweep of each rank over its own unknowns, from zero."""

    def setUp(self, pc: PETSc.PC) -> None:
        """Take the matrix, one with a ``SymmetricMatrix``."""
        self._own = pc.getOperators()[1].getPythonContext().own

    def apply(self, _: PETSc.PC, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """x of a sweep for A x = b."""
        x.array_w[:] = self._own.sweep(b.array_r)


def halved(A: PETSc.Mat) -> PETSc.Mat | None:
    """A matrix as one with a ``SymmetricMatrix``; None if it is not symmetric: one product tells.  Collective."""
    size = A.getBlockSize() if A.getBlockSize() in BLOCK_SIZES else 1
    rows, own = _rows(A)
    blocks = SymmetricBlocks(own.indptr, own.indices, own.data, size)
    others = None
    if A.comm.size > 1:
        others = with_entries(A, rows.indptr, rows.indices, rows.data, ~_are_own(A, rows))
    np.abs(rows.data, out=rows.data)
    sizes = rows.sum(axis=1).A1
    del rows, own  # as much memory as the matrix itself
    found = _with(A, SymmetricMatrix(blocks, others, size))
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
    """A ``halved`` matrix plus springs, if they couple unknowns of the same node alone: its blocks are then shared.  Collective."""
    context = A.getPythonContext()
    rows, own = _rows(S)
    own = own.tobsr((context.size, context.size))
    nodes = np.repeat(np.arange(own.indptr.size - 1), np.diff(own.indptr))
    only = rows.nnz == np.count_nonzero(_are_own(S, rows)) and (own.indices == nodes).all()
    if not A.comm.tompi4py().allreduce(only, op=MPI.LAND):
        return None
    added = np.zeros((own.indptr.size - 1, context.size, context.size))
    added[nodes] = own.data
    return _with(A, SymmetricMatrix(context.own.plus(added), context.others, context.size))


def _with(A: PETSc.Mat, context: SymmetricMatrix) -> PETSc.Mat:
    """A matrix of the layout of A.  Collective."""
    found = PETSc.Mat().createPython(A.getSizes(), context, A.comm)
    found.setUp()
    return found


def _rows(A: PETSc.Mat) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """Rows of this rank, a copy, and among them what couples its own unknowns."""
    starts, columns, values = A.getValuesCSR()
    rows = sparse.csr_matrix((values, columns, starts), (starts.size - 1, A.getSize()[1]))
    own = rows if A.comm.size == 1 else rows[:, slice(*A.getOwnershipRange())]
    return rows, own


def _are_own(A: PETSc.Mat, rows: sparse.csr_matrix) -> np.ndarray:
    """Which entries are in columns of this rank."""
    first, last = A.getOwnershipRange()
    return (rows.indices >= first) & (rows.indices < last)


def with_entries(
    A: PETSc.Mat, starts: np.ndarray, columns: np.ndarray, values: np.ndarray, kept: np.ndarray
) -> PETSc.Mat:
    """A matrix of the layout of A with some of the entries in rows of this rank, ``kept`` true.  Collective."""
    starts = np.append(0, np.cumsum(kept))[starts].astype(PETSc.IntType)
    csr = starts, columns[kept].astype(PETSc.IntType), values[kept]
    return PETSc.Mat().createAIJ(A.getSizes(), csr=csr, comm=A.comm)
