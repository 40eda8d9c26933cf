# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Regularisation springs, with compensated forces, for bodies with soft or no supports."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody


class Anchors:
    """Regularisation springs at selected degrees of freedom, one for each soft rigid motion.

    The solution of ``K u = f`` for a softly supported body passes through very large displacements.
    ``A = K + E a E^T`` is well supported.  ``K u = f`` is equivalent to ``A u = f + E s`` with the
    compensating forces ``s = a E^T u``: one additional unknown and equation for each spring.  If
    contact alone supports the body, these equations are its equilibrium of forces and moments.

    Args:
        body: ElasticBody with its assembled stiffness and at least one ``soft`` motion.
            Collective.

    Attributes:
        dofs: Owned degrees of freedom with a spring, ``shape=(m,)``.
        stiffness: Stiffness ``a`` of each spring of this rank, ``shape=(m,)``, force per length.
        count: Number of springs of all ranks.
        A: The stiffness matrix with the springs, a PETSc matrix.
        solver: ``LinearSolver`` of ``A``.
    """

    def __init__(self, body: ElasticBody):
        self._body, self.dofs = body, _pivot_dofs(body.soft, body.comm)
        self.count = body.soft.shape[1]
        diagonal = body.K.getDiagonal().array_r
        self.stiffness = diagonal[self.dofs].copy()
        A, added = body.K.copy(), body.K.createVecLeft()
        added.array_w[:] = 0.0
        added.array_w[self.dofs] = self.stiffness
        A.setDiagonal(added, addv=True)
        self.A, self.solver = A, body.solver(A)

    @property
    def ksp(self):
        """PETSc KSP of ``A``, for many right-hand sides at a time."""
        return self.solver.ksp

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return ``A^-1 b``; arrays of owned degrees of freedom."""
        return self.solver.solve(b)

    def multiply(self, x: np.ndarray) -> np.ndarray:
        """Return ``A x``; arrays of owned degrees of freedom."""
        forces = self._body.multiply(x)
        forces[self.dofs] += self.stiffness * x[self.dofs]
        return forces

    def columns(self) -> tuple[np.ndarray, np.ndarray]:
        """Return ``E a`` and ``a`` of all ranks' springs, ``shape=(owned dofs, m)`` and ``(m,)``.
        Collective.
        """
        counts = self._body.comm.allgather(self.dofs.size)
        forces, first = np.zeros((self._body.size, self.count)), sum(counts[: self._body.comm.rank])
        forces[self.dofs, first + np.arange(self.dofs.size)] = self.stiffness
        return forces, np.concatenate(self._body.comm.allgather(self.stiffness))

    def destroy(self) -> None:
        """Free the matrix and its solver.  Collective."""
        self.solver.destroy()
        self.A.destroy()


def _pivot_dofs(modes: np.ndarray, comm: MPI.Comm) -> np.ndarray:
    """Owned degrees of freedom at which the modes are linearly independent, one for each mode.

    They are the pivot rows of a Gram-Schmidt elimination, the longest remaining row first.

    Args:
        modes: Owned rows of the modes, ``shape=(owned dofs, m)``.
        comm: MPI communicator.
    """
    left, chosen = modes.copy(), []
    for _ in range(modes.shape[1]):
        length = np.linalg.norm(left, axis=1)
        largest = (float(length.max(initial=0.0)), comm.rank)
        _, owner = comm.allreduce(largest, op=MPI.MAXLOC)
        row = None
        if comm.rank == owner:
            chosen.append(int(length.argmax()))
            row = left[chosen[-1]].copy()
        row = comm.bcast(row, root=owner)
        left -= np.outer(left @ row, row) / (row @ row)
    return np.array(chosen, dtype=int)
