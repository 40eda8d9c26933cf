# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact points as linear functionals of the displacement: motion is B u, forces on the body are B^T r."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact.step.errors import EPSILON, NodalStiffness

# Part of a direction that is free of boundary conditions, but for rounding, and of a motion that may be rounding.
FREE, STILL = 1e-12, 64 * EPSILON


class ContactPoints:
    """Points of a body that may touch, each with a frame of its own, this rank's share.

    Args:
        dofs: Owned degrees of freedom of each point's node, ``shape=(n, gdim)``.
        frames: Rows (t1, t2, n) of each point, ``shape=(n, gdim, gdim)``, global components, orthonormal.
        size: Number of owned degrees of freedom.

    Attributes:
        B: Sparse, ``shape=(n gdim, size)``: local components of the motion of all points, dimensionless.
        held: Tangential directions that a boundary condition fixes, ``shape=(n, gdim - 1)``.  Slip in them is known:
            friction follows from it, and the support carries the rest, see ``law/supported.py``.
        guided: Points that can slide along one tangential direction alone, which is none of the frame's, and the
            tangential components of that unit vector, ``shape=(k,)`` and ``(k, 2)``; None if there are none.
        closed: Points whose motion along the normal is given, ``shape=(n,)``: they never touch.
        supported: Other points with such a direction, indices, ``shape=(k,)``.
        along: Their tangential direction that is left free, unit vectors, zero where none is, ``shape=(k, gdim - 1)``.
    """

    def __init__(self, dofs: np.ndarray, frames: np.ndarray, size: int):
        self.size, (self.count, self.dim) = size, dofs.shape
        self.dofs, self.frames = dofs, frames
        columns = np.repeat(dofs, self.dim, axis=0).ravel()
        starts = np.arange(0, frames.size + 1, self.dim)
        self.B = sparse.csr_matrix((frames.ravel(), columns, starts), (dofs.size, size))
        self._forces = self.B.T.tocsr()
        self._magnitudes, self._sizes = abs(self.B), abs(self._forces)
        self.hold(
            np.zeros((self.count, self.dim - 1), dtype=bool), np.zeros(self.count, dtype=bool)
        )

    def hold(
        self, held: np.ndarray, closed: np.ndarray, guided: tuple | None = None, fixed=None
    ) -> None:
        """Take note of what boundary conditions fix: directions ``held``, points ``closed``, others ``guided``.

        Args:
            fixed: Which degrees of freedom of the points they are, ``shape=(n, gdim)``; None is none.
        """
        self.held, self.closed, self.guided = held, closed, guided
        some = held.any(axis=1)
        along = np.where(some[:, None] & ~held, 1.0, 0.0)
        if guided is not None:
            some[guided[0]], along[guided[0]] = True, guided[1]
        self.supported = np.flatnonzero(some & ~closed)
        self.along = along[self.supported]
        frames = self.frames[self.supported]
        if self.supported.size:
            carried = (frames[:, :-1] * fixed[self.supported][:, None, :]) @ frames.transpose(
                0, 2, 1
            )
            carried -= self.along[:, :, None] * (self.along[:, None, :] @ carried)
            self._given = np.where(np.abs(carried) < FREE, 0.0, carried)

    def known(self, motion: np.ndarray, terms) -> np.ndarray | None:
        """Tangential part of a motion that boundary conditions prescribe, ``shape=(n, gdim - 1)``; None if it is rounding.

        Args:
            motion: Local components, ``shape=(n, gdim)``, length units.
            terms: Motions that it is the difference of, local components.
        """
        if not self.supported.size:
            return None
        part = (self._given @ motion[self.supported][:, :, None])[:, :, 0]
        if not part.any():
            return None
        size = sum(np.abs(term) for term in terms)[self.supported].sum(axis=1)
        still = np.abs(part).max(axis=1) <= STILL * size
        part[still] = 0.0
        known = np.zeros((self.count, self.dim - 1))
        known[self.supported] = part
        return None if still.all() else known

    def without_held(self, tangential: np.ndarray) -> None:
        """Take from tangential components, ``shape=(n, gdim - 1, ...)``, in place, what boundary conditions hold."""
        tangential[self.held] = 0.0
        if self.guided is not None:
            points, along = self.guided
            part = np.einsum("ni,ni...->n...", along, tangential[points])
            tangential[points] = np.einsum("ni,n...->ni...", along, part)

    def motion(self, u: np.ndarray) -> np.ndarray:
        """Local components of the points' motion, ``shape=(n, gdim, ...)``, for displacements ``(owned dofs, ...)``."""
        return (self.B @ u).reshape(self.count, self.dim, *u.shape[1:])

    def magnitudes(self, u: np.ndarray) -> np.ndarray:
        """Size of the terms that ``motion`` adds up, ``shape=(n, gdim)``."""
        return (self._magnitudes @ np.abs(u)).reshape(self.count, self.dim)

    def reactions(self, forces: np.ndarray) -> np.ndarray:
        """Reactions, ``shape=(n, gdim)``, local, that are these forces on the body at the points' nodes."""
        return self.motion(forces)  # the frames are orthonormal

    def add_forces(self, reaction: np.ndarray, forces: np.ndarray) -> None:
        """Add the forces on the body that are these reactions to those on owned degrees of freedom."""
        forces += self._forces @ reaction.ravel()

    def add_magnitudes(self, reaction: np.ndarray, forces: np.ndarray) -> None:
        """Add the magnitudes of these reactions' components to forces on owned degrees of freedom."""
        forces += self._sizes @ np.abs(reaction).ravel()

    def matrix(self, blocks: np.ndarray):
        """``B^T D B`` of nodal blocks, ``shape=(n, gdim, gdim)``, local frame: sparse, owned rows and columns."""
        n = self.count
        D = sparse.bsr_matrix((blocks, np.arange(n), np.arange(n + 1)), (n * self.dim,) * 2)
        return self._forces @ D.tocsr() @ self.B

    def free_of(self, fixed: np.ndarray) -> np.ndarray:
        """Length of what boundary conditions leave of each local direction, ``shape=(n, gdim)``: 1, 0 or a part."""
        free = ~np.isin(self.dofs, fixed)
        return np.linalg.norm(self.frames * free[:, None, :], axis=2)

    def tangents_free_of(self, fixed: np.ndarray) -> np.ndarray:
        """Products of the tangential directions without their fixed components, ``shape=(n, gdim - 1, gdim - 1)``."""
        free = self.frames[:, :-1] * ~np.isin(self.dofs, fixed)[:, None, :]
        return free @ free.transpose(0, 2, 1)

    def stiffness(self, K) -> NodalStiffness:
        """Normal and tangential blocks of an assembled PETSc matrix at the points, local frame.  Collective.

        Along directions that boundary conditions hold, where the matrix has their rows, it is that along the normal.
        """
        first = K.getOwnershipRange()[0]
        order = np.argsort(self.dofs, axis=None)  # PETSc wants them sorted
        dofs = (self.dofs.ravel()[order] + first).astype(PETSc.IntType)
        rows = PETSc.IS().createGeneral(dofs, comm=K.comm)
        block = K.createSubMatrix(rows, rows)
        start, columns, values = block.getValuesCSR()
        row = np.repeat(np.arange(dofs.size), np.diff(start))
        column = columns - block.getOwnershipRange()[0]
        mine = (column >= 0) & (column < dofs.size)
        row, column, values = order[row[mine]], order[column[mine]], values[mine]
        here = row // self.dim == column // self.dim
        blocks = np.zeros(self.frames.shape)
        blocks[row[here] // self.dim, row[here] % self.dim, column[here] % self.dim] = values[here]
        rows.destroy()
        block.destroy()
        local = self.frames @ blocks @ self.frames.transpose(0, 2, 1)
        normal, tangential = local[:, -1, -1].copy(), local[:, :-1, :-1]
        if self.supported.size:
            f = self.along[:, :, None] * self.along[:, None, :]
            held = np.eye(self.dim - 1) - f
            tangential[self.supported] = (
                f @ tangential[self.supported] @ f + normal[self.supported, None, None] * held
            )
        return NodalStiffness(normal, tangential)


def assembled(points, derivatives, size: int) -> tuple:
    """``B^T R_r B`` and ``B^T R_u B`` of all contacts, sparse, owned rows and columns.

    Args:
        points: ``ContactPoints`` of each contact.
        derivatives: For each contact ``R_r`` and ``R_u``, ``shape=(n, gdim, gdim)``, local frame.
        size: Number of owned degrees of freedom.
    """
    sums = [sparse.csr_matrix((size, size))] * 2
    for of, parts in zip(points, derivatives):
        sums = [one + of.matrix(part) for one, part in zip(sums, parts)]
    return tuple(sums)


def add_to(K, values) -> None:
    """Add a sparse matrix of owned rows and columns to an assembled PETSc matrix.  Collective."""
    first = K.getOwnershipRange()[0]
    for row in np.flatnonzero(np.diff(values.indptr)):
        part = slice(values.indptr[row], values.indptr[row + 1])
        columns = (first + values.indices[part]).astype(PETSc.IntType)
        K.setValues([first + row], columns, values.data[part], addv=PETSc.InsertMode.ADD_VALUES)
    K.assemble()
