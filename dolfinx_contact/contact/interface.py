# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact points as linear functionals of the displacement: motion is B u, forces on the body are B^T r."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact.support.checks import NEGLIGIBLE_LENGTH

# Part of a direction that is free of boundary conditions, but for rounding, and of a motion that may be rounding.
FREE_PART = 1e-12


class NodalStiffness(NamedTuple):
    """Blocks of the stiffness at the contact nodes, local frame, force per length."""

    normal: np.ndarray  # kappa, (n,)
    tangential: np.ndarray  # (n, gdim - 1, gdim - 1)


class ContactPoints:
    """Points of a body that may touch, each with a frame of its own, this rank's share.

    A point is a node, or moves as several nodes together: point a of frame ``F_a`` by ``w_a = F_a sum_b m_ab u_b``, and its
    reaction ``r_a`` loads each node b by ``m_ab F_a^T r_a``.  Coefficients ``s`` find reactions from such forces,
    ``r_a = F_a sum_b s_ab f_b``.  See docs/extending.md.

    Args:
        dofs: Owned degrees of freedom of each point's own node, ``shape=(n, gdim)``; supports are looked for there.
        frames: Rows (t1, t2, n) of each point, ``shape=(n, gdim, gdim)``, global components, orthonormal.
        owned: Number of owned degrees of freedom, global number of the first, and number of all on all ranks.
        m, s: Sparse, ``shape=(n, n)``, dimensionless, ``s m^T`` the identity but for points without an entry in ``m``, which never
            touch; None where a point is its own node.

    Attributes:
        B: Sparse, ``shape=(n gdim, size)``: local components of the motion of all points, dimensionless.
        S: Of the same shape: local components of the reactions that make forces ``B^T r``.
        local: Whether each point is one node, so that its springs stand where the stiffness has entries.
        alone: Points that never touch, whatever supports do, ``shape=(n,)``.
        held: Tangential directions that a boundary condition fixes, ``shape=(n, gdim - 1)``.  Slip in them is known:
            friction follows from it, and the support carries the rest, see ``law/supported.py``.
        guided: Points that can slide along one tangential direction alone, which is none of the frame's, and the
            tangential components of that unit vector, ``shape=(k,)`` and ``(k, 2)``; None if there are none.
        closed: Points whose motion along the normal is given, ``shape=(n,)``: they never touch.
        supported: Other points with such a direction, indices, ``shape=(k,)``.
        along: Their tangential direction that is left free, unit vectors, zero where none is, ``shape=(k, gdim - 1)``.
    """

    def __init__(
        self,
        dofs: np.ndarray,
        frames: np.ndarray,
        owned: tuple[int, int, int],
        m: sparse.spmatrix | None = None,
        s: sparse.spmatrix | None = None,
    ):
        (size, self.first, self._whole), (self.count, self.dim) = owned, dofs.shape
        self.size, self.dofs, self.frames = size, dofs, frames
        self.local, self.alone = m is None, np.zeros(self.count, dtype=bool)
        self._sums = sparse.csr_matrix(
            (np.ones(dofs.size), dofs.ravel(), np.arange(dofs.size + 1)), (dofs.size, size)
        )
        columns = np.repeat(dofs, self.dim, axis=0).ravel()
        starts = np.arange(0, frames.size + 1, self.dim)
        self.B = self.S = sparse.csr_matrix((frames.ravel(), columns, starts), (dofs.size, size))
        if m is not None:
            frame, S = block_diagonal(frames), self._of_several(s)
            self._sums = self._of_several(m)
            self.B, self.S = (frame @ self._sums).tocsr(), (frame @ S).tocsr()
            self.alone = m.tocsr().getnnz(axis=1) == 0
        self._forces = self.B.T.tocsr()
        self._magnitudes, self._sizes = abs(self.B), abs(self._forces)
        self.hold(
            np.zeros((self.count, self.dim - 1), dtype=bool), np.zeros(self.count, dtype=bool)
        )

    def _of_several(self, coefficients: sparse.spmatrix) -> sparse.csr_matrix:
        """Global components of sums over the points' own nodes, ``shape=(n gdim, size)``."""
        return (sparse.kron(coefficients, sparse.eye(self.dim), "csr") @ self._sums).tocsr()

    def hold(
        self,
        held: np.ndarray,
        closed: np.ndarray,
        guided: tuple | None = None,
        fixed: np.ndarray | None = None,
    ) -> None:
        """Take note of what boundary conditions fix: directions ``held``, points ``closed``, others ``guided``.

        Args:
            fixed: Which degrees of freedom of the points they are, ``shape=(n, gdim)``; None is none.
        """
        closed = closed | self.alone
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
            self._given = np.where(np.abs(carried) < FREE_PART, 0.0, carried)

    def known(self, motion: np.ndarray, terms: Iterable[np.ndarray]) -> np.ndarray | None:
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
        still = np.abs(part).max(axis=1) <= NEGLIGIBLE_LENGTH * size
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
        """Reactions, ``shape=(n, gdim, ...)``, local, that are these forces on the body at the points' nodes: ``S f``, ``S B^T = I``."""
        return (self.S @ forces).reshape(self.count, self.dim, *forces.shape[1:])

    def add_forces(self, reaction: np.ndarray, forces: np.ndarray) -> None:
        """Add the forces on the body that are these reactions to those on owned degrees of freedom."""
        forces += self._forces @ reaction.ravel()

    def add_magnitudes(self, reaction: np.ndarray, forces: np.ndarray) -> None:
        """Add the magnitudes of these reactions' components to forces on owned degrees of freedom."""
        forces += self._sizes @ np.abs(reaction).ravel()

    def matrix(self, blocks: np.ndarray) -> sparse.csr_matrix:
        """``B^T D B`` of blocks ``D`` of points, ``shape=(n, gdim, gdim)``, local frame: owned rows, columns in global numbers."""
        return self._product(blocks, self.B)

    def of_reactions(self, blocks: np.ndarray) -> sparse.csr_matrix:
        """``B^T D S``: forces by the forces that make reactions, which blocks ``D`` turn into others.  As ``matrix``."""
        return self._product(blocks, self.S)

    def _product(self, blocks: np.ndarray, by: sparse.csr_matrix) -> sparse.csr_matrix:
        """``B^T D by``, columns in global numbers."""
        product = self._forces @ block_diagonal(blocks) @ by
        columns = product.indices + self.first
        return sparse.csr_matrix((product.data, columns, product.indptr), (self.size, self._whole))

    def rows(
        self, turns: np.ndarray, free: np.ndarray
    ) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """Rows of ``B`` along other directions of each point: the product of these and of sums of displacements of nodes.

        Args:
            turns: The directions, local components, ``shape=(n, k, gdim)``.
            free: Which owned degrees of freedom count, booleans.

        Returns:
            ``shape=(n k, n gdim)`` and ``(n gdim, dofs)``, these in global numbers.
        """
        sums = self._sums.copy()
        sums.data *= free[sums.indices]
        directions = turns @ self.frames
        kept = block_diagonal(directions) @ sums
        fixed = np.sqrt(kept.multiply(kept).sum(axis=1)) < FREE_PART  # but for rounding
        directions[np.reshape(fixed, directions.shape[:2])] = 0.0
        numbers = sums.data, sums.indices + self.first, sums.indptr
        return block_diagonal(directions), sparse.csr_matrix(numbers, (sums.shape[0], self._whole))

    @property
    def reach(self) -> np.ndarray:
        """Global numbers of all degrees of freedom that rows may have, now or when bodies have slid, ``shape=(k,)``."""
        return (self.dofs + self.first).ravel()

    def free_of(self, fixed: np.ndarray) -> np.ndarray:
        """Length of what boundary conditions leave of each local direction, ``shape=(n, gdim)``: 1, 0 or a part."""
        free = ~np.isin(self.dofs, fixed)
        return np.linalg.norm(self.frames * free[:, None, :], axis=2)

    def tangents_free_of(self, fixed: np.ndarray) -> np.ndarray:
        """Products of the tangential directions without their fixed components, ``shape=(n, gdim - 1, gdim - 1)``."""
        free = self.frames[:, :-1] * ~np.isin(self.dofs, fixed)[:, None, :]
        return free @ free.transpose(0, 2, 1)

    def stiffness(self, K: PETSc.Mat) -> NodalStiffness:
        """Normal and tangential blocks of an assembled PETSc matrix at the points, local frame.  Collective.

        Along directions that boundary conditions hold, where the matrix has their rows, it is that along the normal.
        """
        blocks = nodal_blocks(K, self.dofs)
        local = self.frames @ blocks @ self.frames.transpose(0, 2, 1)
        normal, tangential = local[:, -1, -1].copy(), local[:, :-1, :-1]
        if self.supported.size:
            f = self.along[:, :, None] * self.along[:, None, :]
            held = np.eye(self.dim - 1) - f
            tangential[self.supported] = (
                f @ tangential[self.supported] @ f + normal[self.supported, None, None] * held
            )
        return NodalStiffness(normal, tangential)


def block_diagonal(blocks: np.ndarray) -> sparse.csr_matrix:
    """A sparse matrix of blocks, ``shape=(n, k, gdim)``, on its diagonal."""
    n, k, dim = blocks.shape
    return sparse.bsr_matrix((blocks, np.arange(n), np.arange(n + 1)), (n * k, n * dim)).tocsr()


def nodal_blocks(K: PETSc.Mat, dofs: np.ndarray) -> np.ndarray:
    """Blocks of an assembled PETSc matrix at nodes, ``shape=(n, gdim, gdim)``.

    Args:
        K: The matrix.
        dofs: Owned degrees of freedom of each node, ``shape=(n, gdim)``.
    """
    rows = (dofs + K.getOwnershipRange()[0]).astype(PETSc.IntType)
    blocks = [K.getValues(row, row) for row in rows]
    return np.reshape(blocks, (*dofs.shape, dofs.shape[1]))


def responses(K: PETSc.Mat, points: Sequence[ContactPoints], derivatives: Sequence[tuple]) -> tuple:
    """``B^T R_r S`` and ``B^T R_u B`` of all contacts, sparse: owned rows, columns in global numbers.  Collective.

    Args:
        K: PETSc matrix of the same layout.
        points: ``ContactPoints`` of each contact.
        derivatives: For each contact ``R_r`` and ``R_u``, ``shape=(n, gdim, gdim)``, local frame.
    """
    sums = [sparse.csr_matrix((K.getLocalSize()[0], K.getSize()[1]))] * 2
    for point_set, (R_r, R_u) in zip(points, derivatives):
        sums = [sums[0] + point_set.of_reactions(R_r), sums[1] + point_set.matrix(R_u)]
    return tuple(sums)


def response(
    points: Sequence[ContactPoints], derivatives: Sequence[tuple], forces: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """``B^T (R_r S f + R_u B x)`` of all contacts, on owned degrees of freedom."""
    change = np.zeros_like(forces)
    for point_set, (R_r, R_u) in zip(points, derivatives):
        reaction = np.einsum("nij,nj->ni", R_r, point_set.reactions(forces))
        reaction += np.einsum("nij,nj->ni", R_u, point_set.motion(x))
        point_set.add_forces(reaction, change)
    return change


def like(K: PETSc.Mat, values: sparse.csr_matrix) -> PETSc.Mat:
    """A PETSc matrix of the layout of ``K`` with these owned rows, columns in global numbers.  Collective."""
    csr = (values.indptr.astype(PETSc.IntType), values.indices.astype(PETSc.IntType), values.data)
    return PETSc.Mat().createAIJ(K.getSizes(), csr=csr, comm=K.comm)


def structure(points: Sequence[ContactPoints]) -> PETSc.Mat.Structure:
    """How the entries of what contacts add to a stiffness lie to its own."""
    kinds = PETSc.Mat.Structure
    local = all(point_set.local for point_set in points)
    return kinds.SUBSET_NONZERO_PATTERN if local else kinds.DIFFERENT_NONZERO_PATTERN


def add_to(K: PETSc.Mat, values: sparse.csr_matrix) -> None:
    """Add a sparse matrix of owned rows, columns in global numbers, to an assembled PETSc matrix.  Collective."""
    first = K.getOwnershipRange()[0]
    for row in np.flatnonzero(np.diff(values.indptr)):
        part = slice(values.indptr[row], values.indptr[row + 1])
        columns = values.indices[part].astype(PETSc.IntType)
        K.setValues([first + row], columns, values.data[part], addv=PETSc.InsertMode.ADD_VALUES)
    K.assemble()
