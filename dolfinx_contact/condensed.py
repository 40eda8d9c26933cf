# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The body condensed to its contact nodes: W, the compliance of the nodes to each other's reactions."""

from __future__ import annotations

import os
from collections import deque

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from dolfinx_contact import _kernel
from dolfinx_contact._errors import raised_together
from dolfinx_contact.condensed_newton import CondensedNotConverged, principal_axes
from dolfinx_contact.friction import Friction

_BLOCK = 256  # right-hand sides at a time: more gain nothing, and cost memory


class CondensedBody:
    """``w = q + W r`` of all contacts of a body, gathered from all ranks, along the principal axes.

    ``W`` are the rows of ``K^-1`` at the contact nodes, by a factorisation of ``K`` and blocks of
    sparse right-hand sides; it is held by rank 0 alone.  A degree of freedom fixed by a boundary
    condition neither moves nor has a reaction of friction.  Without friction at any contact there are
    normal components alone.

    Args:
        body: The elastic body, its stiffness assembled.
        contacts: Its contacts.

    Raises:
        MemoryError: on all ranks, if ``W`` and what Newton's method needs beside it would not fit.
    """

    def __init__(self, body, contacts):
        self.comm, self._body, self._contacts = body.comm, body, list(contacts)
        self.dim = components(self._contacts)
        gdim = self._contacts[0].frame.shape[0]
        # One row per local direction of a node: its global components, none at fixed dofs.
        dofs, frames = [np.zeros((0, gdim), int)], [np.zeros((0, self.dim, gdim))]
        turns = [np.zeros((0, self.dim, gdim))]
        for contact in self._contacts:
            free = ~np.isin(contact._dofs, body.fixed)
            dofs.append(contact._dofs)
            turns.append(principal_axes(contact.friction, len(free), gdim)[:, -self.dim :])
            frames.append(turns[-1] @ contact.frame * free[:, None, :])
        self._dofs, self._frames, self._turns = map(np.concatenate, (dofs, frames, turns))
        self._counts = self.comm.allgather(len(self._dofs))
        self.nodes = sum(self._counts)
        _check_memory(self.comm, memory(self.nodes, self.dim, body.K.getSize()[0]))
        W = self.compliance()
        self.operator = None
        if self.comm.rank == 0:
            # A direction that is fixed: W has no entry there, and its reaction is to stay zero.
            inert = ~W.any(axis=0) & ~W.any(axis=1)
            W[inert, inert] = np.diag(W).mean() / max(1 - inert.mean(), 1 / W.shape[0])
            self.operator = _kernel.CondensedOperator(W, self.dim)
            del W  # copied
            self.operator.prepare()  # pays after some ten iterations
        self.friction = self._gathered_friction()
        self.past: list | deque = []  # (q, r) of earlier steps, kept by the problem

    def gather(self, local: np.ndarray) -> np.ndarray:
        """Rows of all nodes, in the order of ranks and contacts, on all ranks."""
        return np.concatenate(self.comm.allgather(np.ascontiguousarray(local)))

    def free_displacement(self, displacement: np.ndarray) -> np.ndarray:
        """``q``, ``shape=(nodes, dim)``: slip and gap of all nodes at a displacement of owned dofs."""
        rows = [np.zeros((0, self._turns.shape[2]))]
        for contact in self._contacts:
            contact.move(displacement)
            rows.append(np.column_stack((contact.slip_increment, contact.gap)))
        return self.gather(np.einsum("nij,nj->ni", self._turns, np.concatenate(rows)))

    def forces(self, reaction: np.ndarray) -> np.ndarray:
        """Nodal forces of the reactions of all nodes, owned degrees of freedom, global frame."""
        first = sum(self._counts[: self.comm.rank])
        local = reaction[first : first + len(self._dofs)]
        forces = np.zeros(self._body.size)
        forces[self._dofs] = np.einsum("ni,nij->nj", local, self._frames)
        return forces

    def displacement(self, trial: np.ndarray, reaction: np.ndarray) -> np.ndarray:
        """Displacement of owned dofs at the reactions of all nodes, from the one without."""
        correction = self._body.solve(self.forces(reaction))
        correction[self._body.fixed] = 0.0
        return trial + correction

    def solve(self, solver, q: np.ndarray, tol: float, starts):
        """``solver.solve_condensed`` on rank 0; its result, the best one if it failed, on all ranks."""
        found, result = None, None
        if self.comm.rank == 0:
            try:
                result = solver.solve_condensed(self.operator, self.friction, q, tol, starts)
            except CondensedNotConverged as failure:
                result = failure.best
            except Exception as caught:  # the other ranks must not be left waiting
                found = caught
        with raised_together(self.comm):
            if found is not None:
                raise found
        return self.comm.bcast(result, root=0)

    # -- starts ----------------------------------------------------------------------------------

    def starts(self, q: np.ndarray) -> list[np.ndarray]:
        """Reactions to start from: last step's, extrapolated, those of the most similar step, and last
        step's with the change that led to the most similar one."""
        if not self.past:
            return []
        last = self.past[-1]
        starts = [last[1]]
        if len(self.past) > 1:
            before = self.past[-2]
            starts.append(2 * last[1] - before[1])
        scale = np.abs(q).max()
        distances = [np.abs(past[0] - q).max() for past in self.past]
        similar = int(np.argmin(distances))
        if distances[similar] < 0.1 * scale:
            starts.append(self.past[similar][1])
            if similar > 0:
                starts.append(last[1] + self.past[similar][1] - self.past[similar - 1][1])
        return starts

    def remember(self, q: np.ndarray, reaction: np.ndarray) -> None:
        """Keep a step among the last ones, from which the next start."""
        self.past.append((q, reaction))

    def _gathered_friction(self) -> Friction:
        """The law of all nodes; contacts with the same coefficients stay one uniform law."""
        laws = [contact.friction for contact in self._contacts]
        first = laws[0]
        if first.mu.ndim == 1 and all(
            np.array_equal(f.mu, first.mu) and np.array_equal(f.p, first.p) for f in laws
        ):
            return Friction(first.mu, np.where(first.mu > 0, first.p, 1.0))
        sizes = [len(contact.nodes) for contact in self._contacts]
        mu, p = (
            self.gather(
                np.concatenate(
                    [np.broadcast_to(getattr(f, name), (n, 2)) for f, n in zip(laws, sizes)]
                )
            )
            for name in ("mu", "p")
        )
        return Friction(mu, np.where(mu > 0, p, 1.0))

    def compliance(self) -> np.ndarray:
        """W on rank 0, ``shape=(dim nodes, dim nodes)``, symmetric; an empty array on the others."""
        body, comm, dim = self._body, self.comm, self.dim
        first = body.K.getOwnershipRange()[0]
        columns = np.repeat(self._dofs, dim, axis=0) + first
        values = self._frames.reshape(-1, self._dofs.shape[1])
        columns, values = (self.gather(part) for part in (columns, values))
        size = dim * self.nodes
        W = np.zeros((size, size) if comm.rank == 0 else (0, 0))
        solve_block = block_solver(body.ksp)
        for start in range(0, size, _BLOCK):
            block = slice(start, min(start + _BLOCK, size))
            answer = solve_block(columns[block], values[block])  # (owned dofs, right-hand sides)
            local = np.einsum("nij,njk->nik", self._frames, answer[self._dofs])
            rows = comm.gather(local.reshape(-1, answer.shape[1]), root=0)
            if comm.rank == 0:
                # W is symmetric, but not to the last bit as it is computed: the mean of both halves.
                found = np.concatenate(rows)
                found[block] = (found[block] + found[block].T) / 2
                found[:start] = (found[:start] + W[block, :start].T) / 2
                W[:, block], W[block, :start] = found, found[:start].T
        return W


def components(contacts) -> int:
    """Components of a reaction: the normal one alone if no contact has friction.  Collective."""
    smooth = all(contact.friction.frictionless for contact in contacts)
    if contacts[0].V.mesh.comm.allreduce(smooth, op=MPI.LAND):
        return 1
    return contacts[0].frame.shape[0]


def memory(nodes: int, dim: int, unknowns: int) -> int:
    """Bytes that W and its inverse take, with what is needed beside them: an upper bound, docs/solvers.md.

    W is copied once; with its inverse it then needs half of that, and a Jacobian with its factors, or
    those of the fixed point among the fallbacks, the rest.  Beside W, solving for a block was measured
    to take six times what its solutions take.
    """
    return 8 * (3 * (nodes * dim) ** 2 + 6 * _BLOCK * unknowns)


def _available() -> float:
    """Bytes of memory that this machine has free; infinite where it does not say."""
    try:
        return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return np.inf


def fits(comm, nodes: int, dim: int, unknowns: int) -> bool:
    """Whether W would fit into half of the memory that rank 0 has free."""
    enough = 2 * memory(nodes, dim, unknowns) <= _available() if comm.rank == 0 else None
    return comm.bcast(enough, root=0)


def _check_memory(comm, needed: int) -> None:
    available = comm.bcast(_available() if comm.rank == 0 else None, root=0)
    if needed > available:
        raise MemoryError(
            f"the condensed operator needs about {needed / 1e9:.1f} GB, {available / 1e9:.1f} GB are "
            "free: use solver=dc.FixedPoint(), which needs none of it."
        )


def block_solver(ksp):
    """A function that solves for blocks of sparse right-hand sides with the solver of ``ksp``.

    With MUMPS the block goes to it as it is, which leaves out the zeros of the right-hand sides in
    the forward substitution; any other solver takes one column after another.

    Returns:
        ``solve(columns, values)``: right-hand side k has ``values[k]`` at the global dofs
        ``columns[k]``; both are the same on all ranks.  Gives ``shape=(owned dofs, k)``.
    """
    A = ksp.getOperators()[0]
    comm, (owned, size) = A.comm, A.getSizes()[0]
    ksp.setUp()
    mumps = ksp.getType() == "preonly" and ksp.getPC().getType() == "lu"
    mumps = mumps and ksp.getPC().getFactorSolverType() == "mumps"

    def by_block(columns, values):
        count = len(columns)
        # MUMPS wants all of a sparse right-hand side on the first rank, row by row its transpose.
        mine = comm.rank == 0
        transposed = PETSc.Mat().createAIJ(
            ((count if mine else 0, count), (size if mine else 0, size)),
            csr=(
                np.arange(count + 1 if mine else 1, dtype=np.int32) * columns.shape[1],
                columns[: count if mine else 0].ravel().astype(np.int32),
                values[: count if mine else 0].ravel(),
            ),
            comm=comm,
        )
        rhs = PETSc.Mat().createTranspose(transposed)
        answer = PETSc.Mat().createDense(((owned, size), (None, count)), comm=comm)
        answer.setUp()
        answer.assemble()
        ksp.getPC().getFactorMatrix().matSolve(rhs, answer)
        result = answer.getDenseArray().copy()
        for matrix in (rhs, transposed, answer):
            matrix.destroy()
        return result

    def by_column(columns, values):
        right, left = A.createVecs()
        first, last = A.getOwnershipRange()
        result = np.empty((owned, len(columns)))
        for k, (column, value) in enumerate(zip(columns, values)):
            here = (column >= first) & (column < last)
            left.array_w[:] = 0.0
            left.array_w[column[here] - first] = value[here]
            ksp.solve(left, right)
            if ksp.getConvergedReason() < 0:
                raise RuntimeError(
                    "PETSc's linear solver failed while W was computed (KSPConvergedReason "
                    f"{ksp.getConvergedReason()}): use solver=dc.FixedPoint()."
                )
            result[:, k] = right.array_r
        return result

    return by_block if mumps else by_column
