# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A body that soft springs or contact alone hold, held well by springs of its own whose forces are taken back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody


class Anchors:
    """Springs at as many degrees of freedom as there are soft rigid motions, so that none is left.

    Solving with ``K`` passes through displacements of the size of force over spring. ``A = K + E a E^T`` holds the
    body; ``K u = f`` is ``A u = f + E s`` with the forces ``s = a E^T u`` that undo the springs, one unknown and
    one equation more a spring.  Where contact alone holds the body these equations are its equilibrium of forces and moments.

    Args:
        body: ElasticBody with its assembled stiffness and ``soft`` motions, at least one.  Collective.

    Attributes:
        dofs: Those with a spring that this rank owns, ``shape=(m,)``.
        stiffness: ``a`` of each, ``shape=(m,)``, force per length.
        count: Number of springs of all ranks.
        A: The stiffness with the springs, a PETSc matrix.
        solver: Its ``LinearSolver``.
    """

    def __init__(self, body: ElasticBody):
        self._body, self.dofs = body, _pivots(body.soft, body.comm)
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
        """The linear solver of A, for many right-hand sides at a time."""
        return self.solver.ksp

    def solve(self, b: np.ndarray) -> np.ndarray:
        """A^-1 b; arrays of owned degrees of freedom."""
        return self.solver.solve(b)

    def multiply(self, x: np.ndarray) -> np.ndarray:
        """A x; arrays of owned degrees of freedom."""
        forces = self._body.multiply(x)
        forces[self.dofs] += self.stiffness * x[self.dofs]
        return forces

    def columns(self) -> tuple[np.ndarray, np.ndarray]:
        """``E a`` and ``a`` of the springs of all ranks, ``shape=(owned dofs, m)`` and ``(m,)``.  Collective."""
        counts = self._body.comm.allgather(self.dofs.size)
        forces, first = np.zeros((self._body.size, self.count)), sum(counts[: self._body.comm.rank])
        forces[self.dofs, first + np.arange(self.dofs.size)] = self.stiffness
        return forces, np.concatenate(self._body.comm.allgather(self.stiffness))

    def destroy(self) -> None:
        """Free matrix and factors.  Collective."""
        self.solver.destroy()
        self.A.destroy()


def _pivots(modes: np.ndarray, comm: MPI.Comm) -> np.ndarray:
    """Owned degrees of freedom whose values tell the modes apart: rows chosen by their length, one after another."""
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
