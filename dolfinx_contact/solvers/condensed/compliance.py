# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The compliance of a body at its contact nodes: rows of the inverse of its stiffness."""

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

UNFELT_PART = 1e-10  # of a motion is what no node feels, over the largest one
_BLOCK_SIZE = 256  # right-hand sides at a time: more gain nothing, and cost memory
_COLUMN_COUNT = 60  # of A^-1 at a time, of whole nodes in two and three dimensions
_MUMPS_BLOCK = 27, 128  # of which MUMPS takes so many at once, by default 32


class Rows:
    """Linear functionals of the displacement, in the order of ranks; all of them are known to every rank.

    Args:
        comm: MPI communicator.
        directions: This rank's are the product of these, sparse, ``shape=(k, l)``, and of ``sums``.
        sums: Sparse, ``shape=(l, dofs)``, columns in global numbers of degrees of freedom.  Collective.
        first: Global number of this rank's first degree of freedom.
        owned: Number of its degrees of freedom.
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
        """All of them, columns in global numbers of degrees of freedom."""
        return (self.directions @ self.sums).tocsr()

    def part(self, u: np.ndarray) -> np.ndarray:
        """What this rank's displacements, ``shape=(dofs, ...)``, add to the values of all rows."""
        return self.directions @ (self._mine @ u)

    def of(self, u: np.ndarray) -> np.ndarray:
        """Values of all rows for displacements of owned dofs, on all ranks.  Collective."""
        return self.comm.allreduce(self.part(u))

    def add_forces(self, force: np.ndarray, forces: np.ndarray) -> None:
        """Add what a force on each row is on owned degrees of freedom."""
        forces += self._mine.T @ (self.directions.T @ force)

    def gather(self, local: np.ndarray) -> np.ndarray:
        """Values that ranks have for their own rows, on all ranks.  Collective."""
        return np.concatenate(self.comm.allgather(np.ascontiguousarray(local)))


def compliance(solver: Any, rows: list[Rows]) -> np.ndarray:
    """Motion of all rows by a unit force on each, ``A^-1`` between them.

    Args:
        solver: What has the PETSc solver of ``A`` as its ``ksp``.
        rows: In the order of the result.

    Returns:
        Symmetric, on rank 0; an empty array on the others.  Collective.
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
            # Symmetric, but not to the last bit as it is computed: the mean of both halves.
            found[block] = (found[block] + found[block].T) / 2
            found[:start] = (found[:start] + W[block, :start].T) / 2
            W[:, block], W[block, :start] = found, found[:start].T
    return W


def one_below_other(parts: Sequence[sparse.csr_matrix]) -> sparse.csr_matrix:
    """Sparse matrices one below the other; none is copied if the others have no rows."""
    some = [part for part in parts if part.shape[0]] or parts[:1]
    return some[0] if len(some) == 1 else sparse.vstack(some).tocsr()


def along_diagonal(parts: Sequence[sparse.csr_matrix]) -> sparse.csr_matrix:
    """Sparse matrices along a diagonal; none is copied if the others have no rows."""
    some = [part for part in parts if part.shape[0]] or parts[:1]
    return some[0] if len(some) == 1 else sparse.block_diag(some, "csr")


class Responses:
    """``A^-1`` between the degrees of freedom that rows may ever have, solved for a block of columns at a time when rows need it.

    Rows of curved and turning surfaces change with their frames, those of deformable ones as bodies slide; ``A`` stays.  Blocks do not depend on who asked first, so that W does not.

    Args:
        dofs: Global numbers, sorted, the same on all ranks, ``shape=(m,)``.
    """

    def __init__(self, dofs: np.ndarray):
        self.dofs, self._solved = dofs, set()
        self._blocks: dict[int, np.ndarray] = {}  # on rank 0, (m, columns)

    def needed(self, rows: list[Rows]) -> list[int]:
        """Blocks that these rows need."""
        dofs = np.concatenate([part.sums.indices for part in rows])
        return np.unique(np.searchsorted(self.dofs, dofs) // _COLUMN_COUNT).tolist()

    def bytes_needed(self, rows: list[Rows]) -> int:
        """Bytes of the blocks with those of these rows."""
        return 8 * self.dofs.size * _COLUMN_COUNT * len(self._solved.union(self.needed(rows)))

    def compliance(self, solver: Any, rows: list[Rows]) -> np.ndarray:
        """As the function of this name: sums of displacements first, which have few entries, then their directions."""
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
        )  # sums by unit forces at what they need
        for k, first in zip(needed, range(0, len(moved), _COLUMN_COUNT)):
            block = self._blocks[k]
            moved[first : first + block.shape[1]] = (R @ block).T
        at = np.searchsorted(needed, at // _COLUMN_COUNT) * _COLUMN_COUNT + at % _COLUMN_COUNT
        W = sparse.csr_matrix((sums.data, at, sums.indptr), (size, len(moved))) @ moved
        W = directions @ (directions @ W).T
        return (W + W.T) / 2

    def _solve(self, solver: LinearSolver, comm: MPI.Comm, blocks: list[int]) -> None:
        """Add blocks of columns.  Collective."""
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
    """Make rows of anchors of ``W``, behind ``size`` rows of nodes, those of the forces that undo these springs.

    Where all springs are at motions without energy their block has to vanish.  What is left for it is put along motions
    of the anchors that no node feels, which keeps those where they are.
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
    """Bytes that W and its inverse take, with what is needed beside them: an upper bound, docs/solvers.md.

    W is copied once; with its inverse it then needs a third of that, and a Jacobian with its factors the rest.  Beside W, solving for a block was measured
    to take six times what its solutions take.
    """
    return 8 * (3 * (nodes * dim) ** 2 + 6 * _BLOCK_SIZE * unknowns)


def available_first(comm: MPI.Comm) -> float:
    """What rank 0 has free, which holds W, on all ranks.  Collective."""
    return comm.bcast(free_memory() if comm.rank == 0 else None)


def fits(comm: MPI.Comm, nodes: int, dim: int, unknowns: int) -> bool:
    """Whether W would fit into half of the memory that rank 0 has free."""
    return 2 * bytes_needed(nodes, dim, unknowns) <= available_first(comm)


def check_memory(comm: MPI.Comm, needed: int) -> None:
    available = available_first(comm)
    if needed > available:
        raise MemoryError(
            f"the condensed operator needs about {needed / 1e9:.1f} GB, {available / 1e9:.1f} GB are "
            "free: use solver=dc.FixedPoint(), which needs none of it."
        )


def block_solver(ksp: PETSc.KSP):
    """A function that solves for blocks of sparse right-hand sides with the solver of ``ksp``.

    With MUMPS the block goes to it as it is, which leaves out the zeros of the right-hand sides in
    the forward substitution; any other solver takes one column after another.

    Returns:
        ``solve(rows)``: a right-hand side a row, sparse, columns in global numbers, the same on all ranks.  Gives
        ``shape=(owned dofs, k)``.
    """
    A = ksp.getOperators()[0]
    comm, (owned, size) = A.comm, A.getSizes()[0]
    ksp.setUp()
    factors = mumps_factors(ksp) if ksp.getType() == "preonly" else None

    def by_block(rows: Any):
        count = rows.shape[0]
        # MUMPS wants all of a sparse right-hand side on the first rank, row by row its transpose.
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
        if factors.getMumpsIcntl(_MUMPS_BLOCK[0]) < 0:  # the user has not chosen how many at once
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
