# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the preconditioner's springs hold and nothing does: planes that force drives, a body that contact alone holds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from petsc4py import PETSc
from scipy.linalg import block_diag

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.step.load_step import LoadStep

# Steps of conjugate gradients for what a plane's motion does to the body, and what they may leave.
MOST_STEPS = 50
RESIDUAL_PART = 1e-6

# Part of the stiffness against a motion that may be no more than what they leave.
NOISE_PART = 1e-4


class Border:
    """The correction for motions ``c`` that follow the body: each with a force on it and an equation.

        A u - C c = residual,  -C^T u + s c = 0,

    so that ``u = A^-1 residual + Y (s - C^T Y)^-1 Y^T residual`` with ``Y = A^-1 C``, which is kept.  With springs ``S``
    between nodes and planes, motions ``D c`` of these, and ``A = K + B^T S B``, a plane's ``C = B^T S D`` and
    ``s = D^T S D + k``.  Springs ``a`` of anchors in ``A`` are undone by ``C = E a`` and ``s = a``.

    Args:
        step: The step: its body, contacts and surfaces.
        A: The stiffness plus springs, a PETSc matrix.
        stiffened: What applies a preconditioner of A.
        springs: ``S`` of each contact, ``shape=(n, gdim)``, force per length.  Collective.
    """

    def __init__(self, step: LoadStep, A: PETSc.Mat, stiffened: Any, springs: Any):
        body, surfaces = step.body, step.surfaces
        self._body, self._loose = body, body.loose is not None
        columns, s = [], np.zeros((0, 0))
        if surfaces is not None:
            columns.append(surfaces.columns(step.contacts, springs))
            pairs = zip(surfaces.axes, springs)
            stiffness = sum(np.einsum("nim,ni,nik->mk", axes, S, axes) for axes, S in pairs)
            s = np.diag(surfaces.springs) + body.total(stiffness)
        if self._loose:
            forces, stiffness = body.anchors.columns()
            columns.append(forces)
            s = block_diag(s, np.diag(stiffness))
        C = np.concatenate(columns, axis=1)
        self._follow = _solved(body, A, stiffened, C)
        self._left = s - body.total(C.T @ self._follow)

    def correct(self, residual: np.ndarray) -> np.ndarray:
        """What their giving way adds to ``A^-1 residual``."""
        pushed = self._body.total(self._follow.T @ residual)
        if self._loose:  # nothing resists some of them where there is no friction
            return self._follow @ np.linalg.lstsq(self._left, pushed, rcond=NOISE_PART)[0]
        return self._follow @ np.linalg.solve(self._left, pushed)


class _Preconditioner:
    """What applies a preconditioner, as PETSc wants it."""

    def __init__(self, stiffened: Any):
        self._stiffened = stiffened

    def apply(self, _: object, x: PETSc.Vec, y: PETSc.Vec) -> None:
        y.array_w[:] = self._stiffened.apply(x.array_r)


def _solved(body: ElasticBody, A: PETSc.Mat, stiffened: Any, C: np.ndarray) -> np.ndarray:
    """A^-1 C, ``shape=(owned dofs, m)``, by conjugate gradients with a preconditioner."""
    ksp = PETSc.KSP().create(body.comm)
    ksp.setOperators(A)
    ksp.setType("cg")
    ksp.setNormType(PETSc.KSP.NormType.NATURAL)
    ksp.setTolerances(rtol=RESIDUAL_PART, atol=0.0, max_it=MOST_STEPS)
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
