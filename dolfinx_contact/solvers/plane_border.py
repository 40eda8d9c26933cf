# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Planes that force drives give way to what springs at the contact nodes would hold."""

from __future__ import annotations

import numpy as np

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
        self._follow = np.array([_solved(body, A, stiffened, column) for column in C.T]).T
        pairs = zip(planes.axes, springs)
        stiffness = sum(np.einsum("nim,ni,nik->mk", axes, S, axes) for axes, S in pairs)
        stiffness, coupling = body.total([stiffness, C.T @ self._follow])
        self._left = np.diag(planes.springs) + stiffness - coupling

    def correct(self, residual: np.ndarray) -> np.ndarray:
        """What the planes' giving way adds to ``A^-1 residual``."""
        pushed = self._body.total(self._follow.T @ residual)
        return self._follow @ np.linalg.solve(self._left, pushed)


def _solved(body, A, stiffened, b: np.ndarray) -> np.ndarray:
    """A^-1 b by conjugate gradients with a preconditioner."""
    right, left = A.createVecs()
    x, r = np.zeros_like(b), b.copy()
    z = stiffened.apply(r)
    p, size = z.copy(), body.total([r @ z])[0]
    goal = LEFT**2 * size
    for _ in range(STEPS):
        if size <= goal:
            break
        right.array_w[:] = p
        A.mult(right, left)
        Ap = left.array_r.copy()
        length = size / body.total([p @ Ap])[0]
        x, r = x + length * p, r - length * Ap
        z, before = stiffened.apply(r), size
        size = body.total([r @ z])[0]
        p = z + size / before * p
    for vector in (right, left):
        vector.destroy()
    return x
