# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The contact tangent on the near-contact subdomain, a correction to the fixed preconditioner."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from dolfinx_contact import compat
from dolfinx_contact.contact.interface import like, response, responses
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS, LinearSolver
from dolfinx_contact.solvers.newton.contact_tangent import contact_contribution

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.interface import ContactPoints
    from dolfinx_contact.step.load_step import LoadStep

# Number of node layers of the near-contact subdomain, contact nodes included.  One layer needs more
# iterations; three make iterations more expensive and hardly save any.
ELEMENT_LAYERS = 2


class SurfaceLayer:
    """Linearised contact on the near-contact subdomain: contact nodes and their neighbours.

    The fixed-point equation ``R(K u - f, u) - (K u - f) = 0`` at the contact nodes has the
    derivative ``-J`` with ``J = (I - R_r) K - R_u``, where ``R_r`` and ``R_u`` are the derivatives
    of the nodal map ``R``.  Inside the body, ``J`` is ``K``.  If nodes slip with a non-associated
    slip rule, ``J`` is far from symmetric, and no springs approximate it.  Its block on the
    subdomain is factorised.

    Args:
        body: The elastic body with its assembled stiffness.
        points: ``ContactPoints`` of each contact.
        prefix: Prefix of the PETSc options of the factorisation, which is MUMPS by default.

    Attributes:
        dofs: Owned free degrees of freedom of the subdomain.
    """

    def __init__(self, body: ElasticBody, points: Sequence[ContactPoints], prefix: str):
        self._body, self._prefix = body, prefix
        self.dofs = _subdomain_dofs(body, points)
        first, last = body.K.getOwnershipRange()
        rows, layer = (
            PETSc.IS().createGeneral(dofs.astype(PETSc.IntType), body.comm)
            for dofs in (np.arange(first, last), first + self.dofs)
        )
        # Columns of K in the subdomain: a product with all of K would cost a tenth of a multigrid
        # cycle more.
        self._columns = body.K.createSubMatrix(rows, layer)
        self._near, self._forces = self._columns.createVecs()
        self._layer, self._block = layer, body.K.createSubMatrix(layer, layer)
        self._solver = None
        self._pushing: np.ndarray | None = None

    def destroy(self) -> None:
        """Free the factorisation and the columns of K.  Collective."""
        self._columns.destroy()
        self._block.destroy()
        if self._solver is not None:
            self._solver.destroy()

    def linearise(self, step: LoadStep, derivatives: Sequence[tuple]) -> None:
        """Assemble and factorise the tangent on the subdomain.  Collective.

        Args:
            step: The load step, which provides the contact points and the driven surfaces.
            derivatives: For each contact ``R_r`` and ``R_u``, ``shape=(n, gdim, gdim)``, local
                frame.
        """
        self._derivatives = derivatives
        self._points = [contact.points for contact in step.contacts]
        if step.surfaces is not None:
            none, self._pushing = np.zeros(self._body.size), step.surfaces.columns(step.contacts)
            pushed = [response(self._points, derivatives, none, way) for way in self._pushing.T]
            self._pushed = np.array(pushed).T
            self._resisting = step.surfaces.tangent(step.contacts, derivatives)
        whole = [
            like(self._body.K, part) for part in responses(self._body.K, self._points, derivatives)
        ]
        near = [part.createSubMatrix(self._layer, self._layer) for part in whole]
        change, A = contact_contribution(self._block, near), self._block.copy()
        A.axpy(-1.0, change, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        for part in (*whole, change):
            part.destroy()
        if self._solver is not None:
            self._solver.destroy()
        self._solver = LinearSolver(A, DIRECT_OPTIONS, self._prefix, None)
        A.destroy()  # the solver has its own reference

    def correct(self, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Solve the linearised equations on the subdomain, with the rest of the body held fixed.

        Returns:
            The correction of the displacement, zero outside the subdomain, and the remaining
            residual.
        """
        near = self._solver.solve(residual[self.dofs])
        correction = np.zeros_like(residual)
        correction[self.dofs] = near
        self._near.array_w[:] = near
        self._columns.mult(self._near, self._forces)
        return correction, residual - self.multiply(correction, self._forces.array_r.copy())

    def multiply(self, x: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Product ``J x`` from ``forces = K x``; zero at constrained degrees of freedom.

        If surfaces are driven by force, their motions are eliminated from ``J``.
        """
        change = response(self._points, self._derivatives, forces, x)
        product = forces - change
        if self._pushing is not None:  # surfaces driven by force
            pushed = self._body.total(self._pushing.T @ change)
            product -= self._pushed @ np.linalg.solve(self._resisting, pushed)
        product[self._body.fixed] = 0.0
        return product


def _subdomain_dofs(body: ElasticBody, points: Sequence[ContactPoints]) -> np.ndarray:
    """Owned free dofs of contact nodes and of ``ELEMENT_LAYERS - 1`` neighbour layers."""
    displacements = body.displacements
    gdim, nodes, near = (
        displacements.dim,
        compat.cell_nodes(displacements.V),
        fem.Function(displacements.V),
    )
    for one in points:
        touched = np.zeros(body.size)
        one.add_magnitudes(np.ones((one.count, one.dim)), touched)
        rows = displacements.rows(touched).any(axis=1)
        near.x.array[gdim * np.flatnonzero(rows)[:, None] + np.arange(gdim)] = 1.0
    for _ in range(ELEMENT_LAYERS - 1):
        near.x.scatter_forward()
        marked = near.x.array[::gdim] > 0.0
        reached = nodes[marked[nodes].any(axis=1)]
        near.x.array[(gdim * reached[:, :, None] + np.arange(gdim)).ravel()] = 1.0
        compat.add_to_owners(near.x)
    free = (
        displacements.vectors(
            near.x.array[: gdim * displacements.count].reshape(displacements.count, gdim, 1)
        )[:, 0]
        > 0.0
    )
    free[body.fixed] = False
    return np.flatnonzero(free)
