# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Multigrid for a matrix plus springs at a few nodes, on the levels of the matrix alone."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

# Smoothers that take a matrix in blocks.
BLOCKED = "sor", "jacobi", "pbjacobi"


def may_be_blocked(K: PETSc.Mat, how: PETSc.Mat.Structure, levels: PETSc.PC) -> bool:
    """Whether a matrix plus springs may be kept in blocks of a node's unknowns: a quarter less memory, and a faster cycle.

    Args:
        K: The matrix.
        how: How the entries of the springs lie to its own.
        levels: The preconditioner of K, of type GAMG.
    """
    known = levels.getMGSmoother(levels.getMGLevels() - 1).getPC().getType() in BLOCKED
    return K.getBlockSize() > 1 and how == PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN and known


def in_blocks(K: PETSc.Mat) -> PETSc.Mat:
    """The matrix in blocks of a node's unknowns.  Collective.

    PETSc's own conversion takes time as the square of the rows: 28 s for 264,435 of them, where this takes 1.4 (PETSc 3.18).
    """
    size = K.getBlockSize()
    rows, columns, values = K.getValuesCSR()
    blocks = sparse.csr_matrix((values, columns, rows), (rows.size - 1, K.getSize()[1])).tobsr((size, size))  # fmt: skip
    csr = blocks.indptr.astype(PETSc.IntType), blocks.indices.astype(PETSc.IntType), blocks.data
    return PETSc.Mat().createBAIJ(K.getSizes(), size, csr=csr, comm=K.comm)


class StiffenedMultigrid:
    """PETSc's multigrid for ``A = K + S``, with the interpolations and smoothers of GAMG for ``K``.

    On every level the matrix is that of ``K`` plus ``P^T S P``, whose cost is that of the few nodes with springs:
    nothing of the body is coarsened a second time.

    Args:
        levels: The set-up preconditioner of ``K``, a PETSc PC of type GAMG.
        A: The matrix plus springs.
        S: The springs alone.
        how: How their entries lie to those of ``K``, a PETSc ``Mat.Structure``.  Collective.

    Attributes:
        pc: The PETSc PC.
    """

    def __init__(self, levels: PETSc.PC, A: PETSc.Mat, S: PETSc.Mat, how: PETSc.Mat.Structure):
        finest, own = levels.getMGLevels() - 1, []
        self.pc = pc = PETSc.PC().create(A.comm)
        pc.setOptionsPrefix(levels.getOptionsPrefix())
        pc.setOperators(A, A)
        pc.setType("mg")
        pc.setMGLevels(finest + 1)
        pc.getMGSmoother(finest).setOperators(A, A)
        for level in range(finest, 0, -1):
            _as(levels.getMGSmoother(level), pc.getMGSmoother(level))
            P = levels.getMGInterpolation(level)
            pc.setMGInterpolation(level, P)
            S = S.PtAP(P)
            A = levels.getMGSmoother(level - 1).getOperators()[1].copy()
            A.axpy(1.0, S, how)
            pc.getMGSmoother(level - 1).setOperators(A, A)
            own += [S, A]
        pc.setUp()
        for matrix in own:  # PETSc has its own references
            matrix.destroy()
        self._right, self._left = pc.getOperators()[1].createVecs()

    def destroy(self) -> None:
        """Free the levels: Python's collector does not reach them (PETSc 3.18).  Collective."""
        self.pc.destroy()

    def apply(self, b: np.ndarray) -> np.ndarray:
        """One cycle for ``A x = b``; arrays of owned degrees of freedom."""
        self._left.array_w[:] = b
        self.pc.apply(self._left, self._right)
        return self._right.array_r.copy()


def _as(known: PETSc.KSP, smoother: PETSc.KSP) -> None:
    """Give a smoother the type, steps and preconditioner of another one, and what options say of it."""
    smoother.setType(known.getType())
    smoother.setTolerances(max_it=known.getTolerances()[3])
    smoother.getPC().setType(known.getPC().getType())
    smoother.setFromOptions()
