"""The contact tangent on the layers of nodes next to the plane: what a fixed preconditioner does not know."""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact import _dolfinx
from dolfinx_contact.linear_solver import DIRECT, LinearSolver

LAYERS = 2  # with one, more iterations; with three, dearer ones for hardly fewer


class SurfaceLayer:
    """The fixed point linearised at the contact nodes, and its exact solution near the plane.

    The fixed point ``R(K u - f, u) - (K u - f) = 0`` at the contact nodes has the derivative
    ``-J``, ``J = (I - R_r) K - R_u`` with the derivatives ``R_r, R_u`` of the nodal map, and is ``K`` inside
    the body.  Where nodes slip against a rule that is not associated, ``J`` is far from symmetric, and
    no springs resemble it.  Its block on the contact nodes and the nodes next to them is factorised.

    Args:
        body: The elastic body, its stiffness assembled.
        contacts: Its contacts.
        prefix: Of the PETSc options of the factorisation, MUMPS by default.
    """

    def __init__(self, body, contacts, prefix: str):
        self._body, self._contacts, self._prefix = body, contacts, prefix
        self._dofs = _near(body, contacts)
        first = body.K.getOwnershipRange()[0]
        rows = PETSc.IS().createGeneral((first + self._dofs).astype(PETSc.IntType), body.comm)
        block = body.K.createSubMatrix(rows, rows)
        self._size = block.getSizes()
        self._offset = block.getOwnershipRange()[0]
        indptr, indices, values = block.getValuesCSR()
        self._stiffness = sparse.csr_matrix(
            (values, indices, indptr), shape=(self._dofs.size, self._size[1][1])
        )
        block.destroy()
        self._solver = None

    def destroy(self) -> None:
        """Free the factorisation.  Collective."""
        if self._solver is not None:
            self._solver.destroy()

    def linearise(self, derivatives) -> None:
        """Factorise the block at new derivatives of the nodal maps.  Collective.

        Args:
            derivatives: For each contact ``R_r`` and ``R_u``, ``shape=(n, gdim, gdim)``, local frame, as
                ``Contact.update_with_derivatives`` returns them.
        """
        self._mixing = []  # I - R_r and R_u of each contact, global frame
        for contact, both in zip(self._contacts, derivatives):
            by_reaction, by_motion = (
                np.einsum("ki,nkl,lj->nij", contact.frame, d, contact.frame) for d in both
            )
            self._mixing.append((np.eye(len(contact.frame)) - by_reaction, by_motion))
        mix = sparse.eye(self._dofs.size, format="csr")
        motion = sparse.csr_matrix(self._stiffness.shape)
        for contact, (left, by_motion) in zip(self._contacts, self._mixing):
            at = np.searchsorted(self._dofs, contact._dofs)
            free = np.isin(contact._dofs, self._dofs)
            pairs = free[:, :, None] & free[:, None, :]
            i, j = (
                np.broadcast_to(a, pairs.shape)[pairs] for a in (at[:, :, None], at[:, None, :])
            )
            change = (left - np.eye(left.shape[1]))[pairs]
            mix += sparse.csr_matrix((change, (i, j)), shape=mix.shape)
            motion += sparse.csr_matrix((by_motion[pairs], (i, self._offset + j)), motion.shape)
        block = (mix @ self._stiffness - motion).tocsr()
        csr = (block.indptr.astype(PETSc.IntType), block.indices.astype(PETSc.IntType), block.data)
        A = PETSc.Mat().createAIJ(self._size, csr=csr, comm=self._body.comm)
        self.destroy()
        self._solver = LinearSolver(A, DIRECT, self._prefix, None)
        A.destroy()  # the solver has its own reference

    def solve(self, residual: np.ndarray) -> np.ndarray:
        """Displacement of the layers that removes the residual there while the body beyond is held."""
        correction = np.zeros_like(residual)
        correction[self._dofs] = self._solver.solve(residual[self._dofs])
        return correction

    def multiply(self, x: np.ndarray) -> np.ndarray:
        """``J x``; zero at fixed degrees of freedom."""
        y = self._body.multiply(x)
        for contact, (left, motion) in zip(self._contacts, self._mixing):
            forces, displacement = y[contact._dofs], x[contact._dofs]
            y[contact._dofs] = np.einsum("nij,nj->ni", left, forces)
            y[contact._dofs] -= np.einsum("nij,nj->ni", motion, displacement)
        y[self._body.fixed] = 0.0
        return y


def _near(body, contacts) -> np.ndarray:
    """Owned free degrees of freedom of the contact nodes and the ``LAYERS - 1`` layers next to them."""
    gdim = body.V.dofmap.index_map_bs
    nodes = _dolfinx.cell_nodes(body.V)
    near = fem.Function(body.V)
    for contact in contacts:
        near.x.array[contact._dofs] = 1.0
    for _ in range(LAYERS - 1):
        near.x.scatter_forward()
        marked = near.x.array[::gdim] > 0.0
        reached = nodes[marked[nodes].any(axis=1)]
        near.x.array[(gdim * reached[:, :, None] + np.arange(gdim)).ravel()] = 1.0
        _dolfinx.add_to_owners(near.x)
    free = near.x.array[: body.size] > 0.0
    free[body.fixed] = False
    return np.flatnonzero(free)
