# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Planes that force drives give way to what springs at the contact nodes would hold."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

# Steps of conjugate gradients for what a plane's motion does to the body, and what they may leave.
STEPS, LEFT = 50, 1e-6


class PlaneBorder:
    """The preconditioner's correction for planes that follow.

    With springs ``S`` between nodes and planes, motions ``D c`` of these, and ``A = K + B^T S B``, equilibrium is

        A u - C c = residual,  -C^T u + s c = 0,   C = B^T S D,  s = D^T S D + k,

    so that ``u = A^-1 residual + Y (s - C^T Y)^-1 Y^T residual`` with ``Y = A^-1 C``, which is kept.

    Args:
        body: The body.
        planes: Its ``DrivenPlanes``.
        A: The stiffness plus springs, a PETSc matrix.
        stiffened: What applies a preconditioner of A.
        springs: ``S`` of each contact, ``shape=(n, gdim)``, force per length.  Collective.
    """

    def __init__(self, body, planes, A, stiffened, springs):
        self._body, C = body, planes.columns(springs)
        self._follow = _solved(body, A, stiffened, C)
        pairs = zip(planes.axes, springs)
        stiffness = sum(np.einsum("nim,ni,nik->mk", axes, S, axes) for axes, S in pairs)
        stiffness, coupling = body.total([stiffness, C.T @ self._follow])
        self._left = np.diag(planes.springs) + stiffness - coupling

    def correct(self, residual: np.ndarray) -> np.ndarray:
        """What the planes' giving way adds to ``A^-1 residual``."""
        pushed = self._body.total(self._follow.T @ residual)
        return self._follow @ np.linalg.solve(self._left, pushed)


class _Preconditioner:
    """What applies a preconditioner, as PETSc wants it."""

    def __init__(self, stiffened):
        self._stiffened = stiffened

    def apply(self, _, x, y) -> None:
        y.array_w[:] = self._stiffened.apply(x.array_r)


def _solved(body, A, stiffened, C: np.ndarray) -> np.ndarray:
    """A^-1 C, ``shape=(owned dofs, m)``, by conjugate gradients with a preconditioner."""
    ksp = PETSc.KSP().create(body.comm)
    ksp.setOperators(A)
    ksp.setType("cg")
    ksp.setNormType(PETSc.KSP.NormType.NATURAL)
    ksp.setTolerances(rtol=LEFT, atol=0.0, max_it=STEPS)
    ksp.getPC().setType("python")
    ksp.getPC().setPythonContext(_Preconditioner(stiffened))
    (x, b), found = A.createVecs(), np.empty_like(C)
    for k, column in enumerate(C.T):
        b.array_w[:] = column
        ksp.solve(b, x)
        found[:, k] = x.array_r
    for part in (x, b, ksp):
        part.destroy()
    return found
