# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Multigrid on the levels of a matrix, for that matrix or for it plus springs at a few nodes."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from dolfinx_contact.petsc.symmetric_matrix import GaussSeidel


class Multigrid:
    """PETSc's multigrid for ``A = K + S``, with the interpolations and smoothers of GAMG for ``K``.

    On every level the matrix is that of ``K`` plus ``P^T S P``, whose cost is that of the few nodes with springs:
    nothing of the body is coarsened a second time.

    Args:
        levels: The set-up preconditioner of ``K``, a PETSc PC of type GAMG.
        A: The matrix plus springs.  If it is a ``halved`` one, Gauss-Seidel sweeps smooth the finest level.
        S: The springs alone; None without springs.
        how: How their entries lie to those of ``K``, a PETSc ``Mat.Structure``.  Collective.

    Attributes:
        pc: The PETSc PC.
    """

    def __init__(
        self,
        levels: PETSc.PC,
        A: PETSc.Mat,
        S: PETSc.Mat | None = None,
        how: PETSc.Mat.Structure | None = None,
    ):
        finest, own = levels.getMGLevels() - 1, []
        self.pc = pc = PETSc.PC().create(A.comm)
        pc.setOptionsPrefix(levels.getOptionsPrefix())
        pc.setOperators(A, A)
        pc.setType("mg")
        pc.setMGLevels(finest + 1)
        pc.getMGSmoother(finest).setOperators(A, A)
        for level in range(finest, 0, -1):
            if A.getType() == "python":
                _sweeps(pc.getMGSmoother(level))
            else:
                _as(levels.getMGSmoother(level), pc.getMGSmoother(level))
            P = levels.getMGInterpolation(level)
            pc.setMGInterpolation(level, P)
            A = levels.getMGSmoother(level - 1).getOperators()[1]
            if S is not None:
                S, A = S.PtAP(P), A.copy()
                A.axpy(1.0, S, how)
                own += [S, A]
            pc.getMGSmoother(level - 1).setOperators(A, A)
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


def _sweeps(smoother: PETSc.KSP) -> None:
    """Let a smoother be one symmetric Gauss-Seidel sweep, whatever options say of all levels."""
    smoother.setOptionsPrefix(f"{smoother.getOptionsPrefix()}sweep_")
    smoother.setType("richardson")
    smoother.setTolerances(max_it=1)
    smoother.setNormType(PETSc.KSP.NormType.NONE)
    smoother.getPC().setType("python")
    smoother.getPC().setPythonContext(GaussSeidel())
