# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact points: operators ``B`` for their motion ``B u`` and ``B^T`` for nodal forces ``B^T r``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact.support.checks import NEGLIGIBLE_LENGTH

# Components of unit directions and of projections below this count as zero, since they may be
# rounding errors.  Dimensionless.
FREE_PART = 1e-12


class NodalStiffness(NamedTuple):
    """Blocks of the stiffness at ``n`` contact nodes, local frame, force per length."""

    normal: np.ndarray  # kappa > 0, (n,)
    tangential: np.ndarray  # (n, gdim - 1, gdim - 1)


class ContactPoints:
    """Points of a body that may touch, each with its own local frame; this rank's points.

    A point is a node, or its motion is a linear combination of the motion of several nodes: point a
    with frame ``F_a`` moves by ``w_a = F_a sum_b m_ab u_b``, and its reaction ``r_a`` causes the
    force ``m_ab F_a^T r_a`` on node b.  Coefficients ``s`` recover reactions from such forces,
    ``r_a = F_a sum_b s_ab f_b``.  See docs/extending.md.

    Args:
        dofs: Owned degrees of freedom of each point's own node, ``shape=(n, gdim)``; boundary
            conditions on these constrain the point.
        frames: Rows (t1, t2, n) of each point, ``shape=(n, gdim, gdim)``, global components,
            orthonormal.
        owned: Number of owned degrees of freedom, global number of the first one, and number of
            degrees of freedom on all ranks.
        m, s: Sparse, ``shape=(n, n)``, dimensionless; None if each point is its own node. ``s m^T``
            is the identity except for points without an entry in ``m``, which never touch.

    Attributes:
        B: Sparse, ``shape=(n gdim, size)``: maps displacements to local components of the motion of
            all points, dimensionless.
        S: Sparse, the same shape: maps forces ``B^T r`` to local components of the reactions ``r``.
        local: Whether each point is one node, so that contact stiffness ``B^T D B`` adds entries
            only where the stiffness matrix has them.
        alone: Points that never touch, whatever the boundary conditions, ``shape=(n,)``, booleans.
        held: Tangential directions fixed by a boundary condition, ``shape=(n, gdim - 1)``,
            booleans. Slip along them is prescribed and determines friction, see
            ``law/supported.py``.
        guided: Indices of points that can slide only along one tangential direction that is oblique
            to the frame, ``shape=(k,)``, and the tangential components of its unit vector,
            ``shape=(k, 2)``; None if there are no such points.
        closed: Points whose normal motion is prescribed, and which never touch, ``shape=(n,)``,
            booleans.
        supported: Indices of the other points with a prescribed tangential direction,
            ``shape=(k,)``.
        along: Tangential direction that remains free at each of the ``supported`` points, unit
            vectors, ``shape=(k, gdim - 1)``; zero if none is free.
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
            frame, S = block_diagonal(frames), self._weighted_sums(s)
            self._sums = self._weighted_sums(m)
            self.B, self.S = (frame @ self._sums).tocsr(), (frame @ S).tocsr()
            self.alone = m.tocsr().getnnz(axis=1) == 0
        self._forces = self.B.T.tocsr()
        self._magnitudes, self._sizes = abs(self.B), abs(self._forces)
        self.hold(
            np.zeros((self.count, self.dim - 1), dtype=bool), np.zeros(self.count, dtype=bool)
        )

    def _weighted_sums(self, coefficients: sparse.spmatrix) -> sparse.csr_matrix:
        """Return the operator for weighted sums of displacements of the points' own nodes.

        It has ``shape=(n gdim, size)``; its rows are global components.
        """
        return (sparse.kron(coefficients, sparse.eye(self.dim), "csr") @ self._sums).tocsr()

    def hold(
        self,
        held: np.ndarray,
        closed: np.ndarray,
        guided: tuple | None = None,
        fixed: np.ndarray | None = None,
    ) -> None:
        """Set the constraints that boundary conditions impose on the points.

        Args:
            held, closed, guided: See the attributes of these names.
            fixed: Fixed degrees of freedom of the points, ``shape=(n, gdim)``, booleans; may be
                None if no point is held or guided.
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
        """Return the tangential motion prescribed by boundary conditions, ``shape=(n, gdim - 1)``.

        Returns None if it is zero within rounding.

        Args:
            motion: Motion of the points, ``shape=(n, gdim)``, local frame, length.
            terms: Motions whose sum or difference is ``motion``, local frame; they bound its
                rounding.
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

    def remove_constrained(self, tangential: np.ndarray) -> None:
        """Remove the constrained parts from tangential vectors, in place.

        Args:
            tangential: Tangential components at the points, ``shape=(n, gdim - 1, ...)``, local
                frame.
        """
        tangential[self.held] = 0.0
        if self.guided is not None:
            points, along = self.guided
            part = np.einsum("ni,ni...->n...", along, tangential[points])
            tangential[points] = np.einsum("ni,n...->ni...", along, part)

    def motion(self, u: np.ndarray) -> np.ndarray:
        """Return the motion of the points, ``shape=(n, gdim, ...)``, local frame.

        Args:
            u: Displacements, ``shape=(owned dofs, ...)``.
        """
        return (self.B @ u).reshape(self.count, self.dim, *u.shape[1:])

    def magnitudes(self, u: np.ndarray) -> np.ndarray:
        """Return the sum of the magnitudes of the terms in ``motion``, ``shape=(n, gdim)``."""
        return (self._magnitudes @ np.abs(u)).reshape(self.count, self.dim)

    def reactions(self, forces: np.ndarray) -> np.ndarray:
        """Return the reactions ``S f`` that cause given nodal forces, ``shape=(n, gdim, ...)``.

        The frame is local.  ``S B^T`` is the identity.

        Args:
            forces: Forces ``f`` on the body, ``shape=(owned dofs, ...)``.
        """
        return (self.S @ forces).reshape(self.count, self.dim, *forces.shape[1:])

    def add_forces(self, reaction: np.ndarray, forces: np.ndarray) -> None:
        """Add the forces ``B^T r`` on the body that are due to reactions to nodal forces, in place.

        The nodal forces are those on owned degrees of freedom.
        """
        forces += self._forces @ reaction.ravel()

    def add_magnitudes(self, reaction: np.ndarray, forces: np.ndarray) -> None:
        """Add the magnitudes ``|B^T| |r|`` of reactions to nodal forces, in place.

        The nodal forces are those on owned degrees of freedom.
        """
        forces += self._sizes @ np.abs(reaction).ravel()

    def matrix(self, blocks: np.ndarray) -> sparse.csr_matrix:
        """Return the contact stiffness ``B^T D B``: owned rows, columns in global numbering.

        Args:
            blocks: Blocks ``D`` of the points, ``shape=(n, gdim, gdim)``, local frame.
        """
        return self._product(blocks, self.B)

    def reaction_stiffness(self, blocks: np.ndarray) -> sparse.csr_matrix:
        """Return ``B^T D S``, which maps nodal forces to new nodal forces by blocks ``D``.

        It has owned rows, and columns in global numbering.

        Args:
            blocks: Derivative ``D`` of new reactions by old ones, ``shape=(n, gdim, gdim)``, local
                frame.
        """
        return self._product(blocks, self.S)

    def _product(self, blocks: np.ndarray, by: sparse.csr_matrix) -> sparse.csr_matrix:
        """Return ``B^T D by``, with columns in global numbering."""
        product = self._forces @ block_diagonal(blocks) @ by
        columns = product.indices + self.first
        return sparse.csr_matrix((product.data, columns, product.indptr), (self.size, self._whole))

    def rows(
        self, turns: np.ndarray, free: np.ndarray
    ) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """Return two factors of the rows of ``B`` along other directions of each point.

        Args:
            turns: Directions, local components, ``shape=(n, k, gdim)``.
            free: Owned degrees of freedom that are free, booleans; the others are omitted.

        Returns:
            The directions in global components, ``shape=(n k, n gdim)``, and the sums of nodal
            displacements, ``shape=(n gdim, dofs)``, with columns in global numbering.
        """
        sums = self._sums.copy()
        sums.data *= free[sums.indices]
        directions = turns @ self.frames
        kept = block_diagonal(directions) @ sums
        fixed = np.sqrt(kept.multiply(kept).sum(axis=1)) < FREE_PART  # zero within rounding
        directions[np.reshape(fixed, directions.shape[:2])] = 0.0
        numbers = sums.data, sums.indices + self.first, sums.indptr
        return block_diagonal(directions), sparse.csr_matrix(numbers, (sums.shape[0], self._whole))

    @property
    def reach(self) -> np.ndarray:
        """Global numbers of degrees of freedom that may enter the points' motion, ``shape=(k,)``.

        Those that enter only after sliding are included.
        """
        return (self.dofs + self.first).ravel()

    def free_of(self, fixed: np.ndarray) -> np.ndarray:
        """Return the length of the unconstrained part of each local direction, ``shape=(n, gdim)``.

        It is 1 for a free direction, 0 for a fixed one, and in between for a partly fixed one.

        Args:
            fixed: Owned degrees of freedom that boundary conditions fix.
        """
        free = ~np.isin(self.dofs, fixed)
        return np.linalg.norm(self.frames * free[:, None, :], axis=2)

    def tangents_free_of(self, fixed: np.ndarray) -> np.ndarray:
        """Return scalar products of the unconstrained parts of the tangents.

        The array has ``shape=(n, gdim - 1, gdim - 1)``.

        Args:
            fixed: Owned degrees of freedom that boundary conditions fix.
        """
        free = self.frames[:, :-1] * ~np.isin(self.dofs, fixed)[:, None, :]
        return free @ free.transpose(0, 2, 1)

    def stiffness(self, K: PETSc.Mat) -> NodalStiffness:
        """Return normal and tangential blocks of an assembled matrix at the points.  Collective.

        The blocks are in the local frame.  Along fixed tangential directions, where the matrix has
        the rows of boundary conditions, the normal stiffness is used.
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
    """Return the sparse block-diagonal matrix of given blocks, ``shape=(n, k, gdim)``."""
    n, k, dim = blocks.shape
    return sparse.bsr_matrix((blocks, np.arange(n), np.arange(n + 1)), (n * k, n * dim)).tocsr()


def nodal_blocks(K: PETSc.Mat, dofs: np.ndarray) -> np.ndarray:
    """Return the diagonal blocks of an assembled PETSc matrix at nodes, ``shape=(n, gdim, gdim)``.

    Args:
        K: The matrix.
        dofs: Owned degrees of freedom of each node, ``shape=(n, gdim)``.
    """
    rows = (dofs + K.getOwnershipRange()[0]).astype(PETSc.IntType)
    blocks = [K.getValues(row, row) for row in rows]
    return np.reshape(blocks, (*dofs.shape, dofs.shape[1]))


def responses(K: PETSc.Mat, points: Sequence[ContactPoints], derivatives: Sequence[tuple]) -> tuple:
    """Return the sums of ``B^T R_r S`` and of ``B^T R_u B`` over all contacts.  Collective.

    Both are sparse, with owned rows and columns in global numbering.

    Args:
        K: PETSc matrix of the same layout.
        points: ``ContactPoints`` of each contact.
        derivatives: For each contact the derivatives ``R_r`` of new reactions by old ones, and
            ``R_u`` by the motion, ``shape=(n, gdim, gdim)`` each, local frame.
    """
    sums = [sparse.csr_matrix((K.getLocalSize()[0], K.getSize()[1]))] * 2
    for point_set, (R_r, R_u) in zip(points, derivatives):
        sums = [sums[0] + point_set.reaction_stiffness(R_r), sums[1] + point_set.matrix(R_u)]
    return tuple(sums)


def response(
    points: Sequence[ContactPoints], derivatives: Sequence[tuple], forces: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """Return the sum of ``B^T (R_r S f + R_u B x)`` over all contacts, on owned degrees of freedom.

    Args:
        points: ``ContactPoints`` of each contact.
        derivatives: As for ``responses``.
        forces: Forces ``f`` on owned degrees of freedom.
        x: Displacements of owned degrees of freedom.
    """
    change = np.zeros_like(forces)
    for point_set, (R_r, R_u) in zip(points, derivatives):
        reaction = np.einsum("nij,nj->ni", R_r, point_set.reactions(forces))
        reaction += np.einsum("nij,nj->ni", R_u, point_set.motion(x))
        point_set.add_forces(reaction, change)
    return change


def like(K: PETSc.Mat, values: sparse.csr_matrix) -> PETSc.Mat:
    """Return a PETSc matrix with the layout of ``K`` and given values.  Collective.

    Args:
        K: PETSc matrix.
        values: Owned rows, columns in global numbering.
    """
    csr = (values.indptr.astype(PETSc.IntType), values.indices.astype(PETSc.IntType), values.data)
    return PETSc.Mat().createAIJ(K.getSizes(), csr=csr, comm=K.comm)


def structure(points: Sequence[ContactPoints]) -> PETSc.Mat.Structure:
    """Return the relation of the sparsity pattern of contact terms to that of the stiffness matrix."""
    kinds = PETSc.Mat.Structure
    local = all(point_set.local for point_set in points)
    return kinds.SUBSET_NONZERO_PATTERN if local else kinds.DIFFERENT_NONZERO_PATTERN


def add_to(K: PETSc.Mat, values: sparse.csr_matrix) -> None:
    """Add a sparse matrix to an assembled PETSc matrix, in place.  Collective.

    Args:
        K: PETSc matrix.
        values: Owned rows to add, columns in global numbering.
    """
    first = K.getOwnershipRange()[0]
    for row in np.flatnonzero(np.diff(values.indptr)):
        part = slice(values.indptr[row], values.indptr[row + 1])
        columns = values.indices[part].astype(PETSc.IntType)
        K.setValues([first + row], columns, values.data[part], addv=PETSc.InsertMode.ADD_VALUES)
    K.assemble()
