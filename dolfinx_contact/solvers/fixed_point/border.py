# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Correction of the preconditioner for force-driven surfaces and bodies held by contact alone.

The springs of the preconditioner restrain these motions, although nothing does in the problem.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from petsc4py import PETSc
from scipy.linalg import block_diag

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.step.load_step import LoadStep

# Conjugate gradients for the body's response to a motion: iteration limit and relative residual.
MOST_STEPS = 50
RESIDUAL_PART = 1e-6

# Stiffness against a motion, relative to the largest, below which it may be only that residual.
NOISE_PART = 1e-4


class Border:
    """Schur-complement correction for additional unknown motions ``c``, each with its own equation.

        A u - C c = residual,  -C^T u + s c = 0,

    so that ``u = A^-1 residual + Y (s - C^T Y)^-1 Y^T residual`` with ``Y = A^-1 C``, which is
    kept.

    For driven surfaces with motions ``D c``, springs ``S`` between nodes and surfaces and the
    stiffness ``A = K + B^T S B``, the matrices are ``C = B^T S D`` and ``s = D^T S D + k``.  For
    the regularisation springs (anchors) of stiffness ``a`` in ``A``, ``C = E a`` and ``s = a``
    cancel the spring forces.

    Args:
        step: The load step with its body, contacts and driven surfaces.
        A: The stiffness plus springs, a PETSc matrix.
        stiffened: An object whose method ``apply`` applies a preconditioner of ``A``.
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
        self._responses = _solved(body, A, stiffened, C)
        self._left = s - body.total(C.T @ self._responses)

    def correct(self, residual: np.ndarray) -> np.ndarray:
        """Displacement to add to ``A^-1 residual`` when the motions ``c`` are free."""
        pushed = self._body.total(self._responses.T @ residual)
        if self._loose:  # without friction, some motions meet no resistance
            return self._responses @ np.linalg.lstsq(self._left, pushed, rcond=NOISE_PART)[0]
        return self._responses @ np.linalg.solve(self._left, pushed)


class _Preconditioner:
    """Python context for PETSc's PC object: applies a given preconditioner."""

    def __init__(self, stiffened: Any):
        self._stiffened = stiffened

    def apply(self, _: object, x: PETSc.Vec, y: PETSc.Vec) -> None:
        y.array_w[:] = self._stiffened.apply(x.array_r)


def _solved(body: ElasticBody, A: PETSc.Mat, stiffened: Any, C: np.ndarray) -> np.ndarray:
    """Return ``A^-1 C``, ``shape=(owned dofs, m)``, by preconditioned conjugate gradients."""
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
