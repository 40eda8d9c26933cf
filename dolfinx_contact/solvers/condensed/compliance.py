# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Compliance of a body at its contact nodes: rows of the inverse of its stiffness."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact.petsc.linear_solver import check_solved, mumps_factors
from dolfinx_contact.support.checks import free_memory

if TYPE_CHECKING:
    from mpi4py import MPI

    from dolfinx_contact.petsc.linear_solver import LinearSolver

# Singular value, relative to the largest, below which a motion of the anchors moves no contact
# node.
UNFELT_PART = 1e-10

# Number of right-hand sides per solve: more give no speed-up, and cost memory.
_BLOCK_SIZE = 256

# Number of columns of A^-1 computed at a time: complete nodes in two and three dimensions.
_COLUMN_COUNT = 60

# MUMPS parameter ICNTL(27), the number of right-hand sides that MUMPS solves at once (by default
# 32), and its value.
_MUMPS_BLOCK = 27, 128


class Rows:
    """Linear functionals of the displacement: one row per local direction of a contact node.

    The rows are ordered by rank.  Every rank stores all rows, as the product of two sparse
    matrices.

    Args:
        comm: MPI communicator.
        directions: First factor of this rank's rows, sparse, ``shape=(k, l)``.
        sums: Second factor, sparse, ``shape=(l, dofs)``, columns in global numbers of degrees of
            freedom. Collective.
        first: Global number of this rank's first degree of freedom.
        owned: Number of degrees of freedom that this rank owns.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        directions: sparse.csr_matrix,
        sums: sparse.csr_matrix,
        first: int,
        owned: int,
    ):
        if directions.shape[0] < directions.shape[1]:  # fewer products
            directions, sums = (
                sparse.eye(len(directions.indptr) - 1, format="csr"),
                directions @ sums,
            )
        self.comm, self.directions, self.sums = comm, directions, sums
        if comm.size > 1:
            directions, sums = zip(*comm.allgather((directions, sums)))
            self.directions, self.sums = along_diagonal(directions), one_below_other(sums)
        self.size = self.directions.shape[0]
        self._mine = self.sums[:, first : first + owned] if comm.size > 1 else self.sums

    @property
    def all(self) -> sparse.csr_matrix:
        """All rows of all ranks, sparse, ``shape=(size, dofs)``, columns in global numbers."""
        return (self.directions @ self.sums).tocsr()

    def part(self, u: np.ndarray) -> np.ndarray:
        """Contribution of this rank's displacements, ``shape=(dofs, ...)``, to all row values."""
        return self.directions @ (self._mine @ u)

    def of(self, u: np.ndarray) -> np.ndarray:
        """Values of all rows for a displacement of owned degrees of freedom, on all ranks.
        Collective."""
        return self.comm.allreduce(self.part(u))

    def add_forces(self, force: np.ndarray, forces: np.ndarray) -> None:
        """Add the nodal forces of a force on each row to ``forces`` on owned degrees of freedom."""
        forces += self._mine.T @ (self.directions.T @ force)

    def gather(self, local: np.ndarray) -> np.ndarray:
        """Concatenate the values that each rank has for its own rows, on all ranks.  Collective."""
        return np.concatenate(self.comm.allgather(np.ascontiguousarray(local)))


def compliance(solver: Any, rows: list[Rows]) -> np.ndarray:
    """Compliance matrix ``W = B A^-1 B^T``, where ``B`` are the rows.  Collective.

    Entry ``(i, j)`` is the displacement along row ``i`` under a unit force along row ``j``.

    Args:
        solver: Object with the PETSc solver of ``A`` as its ``ksp``.
        rows: Groups of rows, in the order of the result.

    Returns:
        Symmetric matrix on rank 0; an empty array on the other ranks.
    """
    comm, size = rows[0].comm, sum(part.size for part in rows)
    loads = sparse.vstack([part.all for part in rows]).tocsr()
    W = np.zeros((size, size) if comm.rank == 0 else (0, 0))
    solve_block = block_solver(solver.ksp)
    for start in range(0, size, _BLOCK_SIZE):
        block = slice(start, min(start + _BLOCK_SIZE, size))
        answer = solve_block(loads[block])  # (owned dofs, right-hand sides)
        found = comm.reduce(np.concatenate([part.part(answer) for part in rows]), root=0)
        if comm.rank == 0:
            # Rounding makes the computed matrix slightly unsymmetric: take the mean with its
            # transpose.
            found[block] = (found[block] + found[block].T) / 2
            found[:start] = (found[:start] + W[block, :start].T) / 2
            W[:, block], W[block, :start] = found, found[:start].T
    return W


def one_below_other(parts: Sequence[sparse.csr_matrix]) -> sparse.csr_matrix:
    """Stack sparse matrices vertically; without a copy if only one of them has rows."""
    some = [part for part in parts if part.shape[0]] or parts[:1]
    return some[0] if len(some) == 1 else sparse.vstack(some).tocsr()


def along_diagonal(parts: Sequence[sparse.csr_matrix]) -> sparse.csr_matrix:
    """Return the block-diagonal sparse matrix; without a copy if only one block has rows."""
    some = [part for part in parts if part.shape[0]] or parts[:1]
    return some[0] if len(some) == 1 else sparse.block_diag(some, "csr")


class Responses:
    """Cached columns of ``A^-1`` for contacts whose rows change between solutions.

    The rows change with the frames of curved and rotating surfaces, and when deformable bodies
    slide; ``A`` does not.  Blocks of columns are computed when rows first need them.  The division
    into blocks is fixed, so that ``W`` does not depend on the order of requests.

    Args:
        dofs: Global numbers of all degrees of freedom that rows may involve, sorted, the same on
            all ranks, ``shape=(m,)``.
    """

    def __init__(self, dofs: np.ndarray):
        self.dofs, self._solved = dofs, set()
        self._blocks: dict[int, np.ndarray] = {}  # on rank 0, (m, columns)

    def needed(self, rows: list[Rows]) -> list[int]:
        """Indices of the blocks of columns that the rows need."""
        dofs = np.concatenate([part.sums.indices for part in rows])
        return np.unique(np.searchsorted(self.dofs, dofs) // _COLUMN_COUNT).tolist()

    def bytes_needed(self, rows: list[Rows]) -> int:
        """Memory of the computed blocks together with the blocks that the rows need, bytes."""
        return 8 * self.dofs.size * _COLUMN_COUNT * len(self._solved.union(self.needed(rows)))

    def compliance(self, solver: Any, rows: list[Rows]) -> np.ndarray:
        """Compliance matrix of the rows from the cached columns, computing missing ones.
        Collective.

        Args:
            solver: Object with the PETSc solver of ``A`` as its ``ksp``.
            rows: Groups of rows, in the order of the result.

        Returns:
            Symmetric matrix on rank 0; an empty array on the other ranks.
        """
        comm, needed = rows[0].comm, self.needed(rows)
        self._solve(solver, comm, [k for k in needed if k not in self._solved])
        if comm.rank > 0:
            return np.zeros((0, 0))
        sums = one_below_other([part.sums for part in rows])
        directions = along_diagonal([part.directions for part in rows])
        size, at = sums.shape[0], np.searchsorted(self.dofs, sums.indices)
        R = sparse.csr_matrix((sums.data, at, sums.indptr), (size, self.dofs.size))
        moved = np.zeros(
            (len(needed) * _COLUMN_COUNT, size)
        )  # values of the sums under unit forces
        for k, first in zip(needed, range(0, len(moved), _COLUMN_COUNT)):
            block = self._blocks[k]
            moved[first : first + block.shape[1]] = (R @ block).T
        at = np.searchsorted(needed, at // _COLUMN_COUNT) * _COLUMN_COUNT + at % _COLUMN_COUNT
        W = sparse.csr_matrix((sums.data, at, sums.indptr), (size, len(moved))) @ moved
        W = directions @ (directions @ W).T
        return (W + W.T) / 2

    def _solve(self, solver: LinearSolver, comm: MPI.Comm, blocks: list[int]) -> None:
        """Compute blocks of columns of ``A^-1``; rank 0 stores them.  Collective."""
        A = solver.ksp.getOperators()[0]
        first, last = A.getOwnershipRange()
        mine = (self.dofs >= first) & (self.dofs < last)
        solve = block_solver(solver.ksp) if blocks else None
        for k in blocks:
            columns = self.dofs[k * _COLUMN_COUNT : (k + 1) * _COLUMN_COUNT]
            count = columns.size
            units = (np.ones(count), columns, np.arange(count + 1))
            answer = solve(sparse.csr_matrix(units, (count, A.getSize()[0])))
            part = np.zeros((self.dofs.size, count))
            part[mine] = answer[self.dofs[mine] - first]
            found = comm.reduce(part, root=0)
            if comm.rank == 0:
                self._blocks[k] = found
            self._solved.add(k)


def tie(W: np.ndarray, size: int, a: np.ndarray, loose: bool) -> None:
    """Modify the anchor rows of ``W`` in place, so that their unknowns cancel the anchor springs.

    If all springs restrain motions without elastic energy, the diagonal block of the anchors must
    vanish.  Only the part along anchor motions that move no contact node is set, which fixes these
    motions.

    Args:
        W: Compliance: ``size`` rows of nodes, then the rows of the anchors (regularisation
            springs).
        size: Number of rows of nodes.
        a: Stiffness of the anchor springs, force per length.
        loose: Whether all springs restrain motions without elastic energy.
    """
    last = slice(size, len(W))
    W[last, last] -= np.diag(1 / a)
    if loose:
        root = np.sqrt(a)
        _, values, vectors = np.linalg.svd(np.linalg.qr(W[:size, last] * root, mode="r"))
        values = np.append(values, np.zeros(len(a) - len(values)))
        unfelt = vectors[values <= UNFELT_PART * values[0]].T / root[:, None]
        W[last, last] = -unfelt @ unfelt.T


def bytes_needed(nodes: int, dim: int, unknowns: int) -> int:
    """Upper bound of the memory for ``W``, its inverse and work arrays, bytes.

    ``W`` with its copy or inverse and a Jacobian with its factors take up to three times the memory
    of ``W``. See docs/solvers.md.  Solving for a block of columns was measured to take six times
    the memory of its solutions.

    Args:
        nodes: Number of contact nodes.
        dim: Number of components per contact node.
        unknowns: Number of degrees of freedom of the body.
    """
    return 8 * (3 * (nodes * dim) ** 2 + 6 * _BLOCK_SIZE * unknowns)


def available_first(comm: MPI.Comm) -> float:
    """Free memory of rank 0, which stores ``W``, bytes; the same value on all ranks.
    Collective."""
    return comm.bcast(free_memory() if comm.rank == 0 else None)


def fits(comm: MPI.Comm, nodes: int, dim: int, unknowns: int) -> bool:
    """Whether ``W`` would fit into half of the free memory of rank 0.  Collective."""
    return 2 * bytes_needed(nodes, dim, unknowns) <= available_first(comm)


def check_memory(comm: MPI.Comm, needed: int) -> None:
    available = available_first(comm)
    if needed > available:
        raise MemoryError(
            f"the condensed operator needs about {needed / 1e9:.1f} GB, {available / 1e9:.1f} GB are "
            "free: use solver=dc.FixedPoint(), which needs none of it."
        )


def block_solver(ksp: PETSc.KSP):
    """Return a function that solves for blocks of sparse right-hand sides with ``ksp``.

    MUMPS solves for the whole block and skips the zeros of the right-hand sides in the forward
    substitution; any other solver solves for one column after another.

    Returns:
        A function ``solve(rows)``.  Each sparse row is a right-hand side, columns in global
        numbers, the same on all ranks.  The result has ``shape=(owned dofs, k)``.
    """
    A = ksp.getOperators()[0]
    comm, (owned, size) = A.comm, A.getSizes()[0]
    ksp.setUp()
    factors = mumps_factors(ksp) if ksp.getType() == "preonly" else None

    def by_block(rows: Any):
        count = rows.shape[0]
        # MUMPS requires a sparse right-hand side on the first rank, as the transpose of a row-wise
        # matrix.
        mine = comm.rank == 0
        transposed = PETSc.Mat().createAIJ(
            ((count if mine else 0, count), (size if mine else 0, size)),
            csr=(
                rows.indptr[: count + 1 if mine else 1].astype(np.int32),
                rows.indices[: rows.nnz if mine else 0].astype(np.int32),
                rows.data[: rows.nnz if mine else 0],
            ),
            comm=comm,
        )
        rhs = PETSc.Mat().createTranspose(transposed)
        result = np.empty((owned, count), order="F")
        answer = PETSc.Mat().createDense(((owned, size), (None, count)), array=result, comm=comm)
        answer.assemble()
        if factors.getMumpsIcntl(_MUMPS_BLOCK[0]) < 0:  # the user has not chosen this number
            factors.setMumpsIcntl(*_MUMPS_BLOCK)
        factors.matSolve(rhs, answer)
        for matrix in (rhs, transposed, answer):
            matrix.destroy()
        return result

    def by_column(rows: Any):
        right, left = A.createVecs()
        first, last = A.getOwnershipRange()
        result = np.empty((owned, rows.shape[0]))
        for k in range(rows.shape[0]):
            part = slice(rows.indptr[k], rows.indptr[k + 1])
            column, value = rows.indices[part], rows.data[part]
            here = (column >= first) & (column < last)
            left.array_w[:] = 0.0
            left.array_w[column[here] - first] = value[here]
            ksp.solve(left, right)
            check_solved(ksp)
            result[:, k] = right.array_r
        return result

    return by_column if factors is None else by_block
