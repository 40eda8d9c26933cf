# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Multigrid for a matrix with springs added at a few nodes, on the levels of the matrix alone."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from dolfinx_contact.petsc.symmetric_matrix import GaussSeidel


class Multigrid:
    """PETSc's multigrid for ``A = K + S``, with the interpolations and smoothers of GAMG for ``K``.

    On every level, the matrix of ``K`` is reused and ``P^T S P`` is added, which is cheap because
    few nodes have springs.  The body is not coarsened a second time.

    Args:
        levels: Preconditioner of ``K``, set up, a PETSc PC of type GAMG.
        A: The matrix plus springs.  If ``halved`` returned it, Gauss-Seidel smooths the finest
            level.
        S: Matrix of the springs; None without springs.
        how: PETSc ``Mat.Structure``: relation of the nonzero pattern of ``S`` to the pattern of
            ``K``.  Collective.

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
                _set_gauss_seidel(pc.getMGSmoother(level))
            else:
                _copy_smoother(levels.getMGSmoother(level), pc.getMGSmoother(level))
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
        """Free the levels.  Collective.

        Python's garbage collector does not free them (PETSc 3.18).
        """
        self.pc.destroy()

    def apply(self, b: np.ndarray) -> np.ndarray:
        """Return one multigrid cycle from zero for ``A x = b``; owned degrees of freedom."""
        self._left.array_w[:] = b
        self.pc.apply(self._left, self._right)
        return self._right.array_r.copy()


def _copy_smoother(known: PETSc.KSP, smoother: PETSc.KSP) -> None:
    """Copy type, number of iterations and preconditioner of a smoother, and set its options."""
    smoother.setType(known.getType())
    smoother.setTolerances(max_it=known.getTolerances()[3])
    smoother.getPC().setType(known.getPC().getType())
    smoother.setFromOptions()


def _set_gauss_seidel(smoother: PETSc.KSP) -> None:
    """Make a smoother one symmetric Gauss-Seidel sweep, regardless of options for levels."""
    smoother.setOptionsPrefix(f"{smoother.getOptionsPrefix()}sweep_")
    smoother.setType("richardson")
    smoother.setTolerances(max_it=1)
    smoother.setNormType(PETSc.KSP.NormType.NONE)
    smoother.getPC().setType("python")
    smoother.getPC().setPythonContext(GaussSeidel())
