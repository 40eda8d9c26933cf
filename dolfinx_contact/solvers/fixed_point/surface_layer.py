# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The contact tangent on the layers of nodes next to the plane: what a fixed preconditioner does not know."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from dolfinx_contact import compat
from dolfinx_contact.contact.interface import like, response, responses
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS, LinearSolver
from dolfinx_contact.solvers.newton.contact_tangent import change_of

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.interface import ContactPoints
    from dolfinx_contact.step.load_step import LoadStep

ELEMENT_LAYERS = 2  # with one, more iterations; with three, dearer ones for hardly fewer


class SurfaceLayer:
    """The fixed point linearised at the contact nodes, and its exact solution near the plane.

    The fixed point ``R(K u - f, u) - (K u - f) = 0`` at the contact nodes has the derivative
    ``-J``, ``J = (I - R_r) K - R_u`` with the derivatives ``R_r, R_u`` of the nodal map, and is ``K`` inside
    the body.  Where nodes slip against a rule that is not associated, ``J`` is far from symmetric, and
    no springs resemble it.  Its block on the contact nodes and the nodes next to them is factorised.

    Args:
        body: The elastic body, its stiffness assembled.
        points: ``ContactPoints`` of its contacts.
        prefix: Of the PETSc options of the factorisation, MUMPS by default.

    Attributes:
        dofs: Owned free degrees of freedom of the layers.
    """

    def __init__(self, body: ElasticBody, points: Sequence[ContactPoints], prefix: str):
        self._body, self._prefix = body, prefix
        self.dofs = _near(body, points)
        first, last = body.K.getOwnershipRange()
        rows, layer = (
            PETSc.IS().createGeneral(dofs.astype(PETSc.IntType), body.comm)
            for dofs in (np.arange(first, last), first + self.dofs)
        )
        # K on displacements of the layers: a product with all of K would cost a tenth of a cycle more.
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
        """Factorise the block at new derivatives of the nodal maps.  Collective.

        Args:
            step: The step, whose rows and surfaces count.
            derivatives: For each contact ``R_r`` and ``R_u``, ``shape=(n, gdim, gdim)``, local frame.
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
        change, A = change_of(self._block, near), self._block.copy()
        A.axpy(-1.0, change, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        for part in (*whole, change):
            part.destroy()
        if self._solver is not None:
            self._solver.destroy()
        self._solver = LinearSolver(A, DIRECT_OPTIONS, self._prefix, None)
        A.destroy()  # the solver has its own reference

    def correct(self, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Remove the residual of the layers while the body beyond is held.

        Returns:
            The displacement, zero beyond the layers, and the residual that it leaves.
        """
        near = self._solver.solve(residual[self.dofs])
        correction = np.zeros_like(residual)
        correction[self.dofs] = near
        self._near.array_w[:] = near
        self._columns.mult(self._near, self._forces)
        return correction, residual - self.multiply(correction, self._forces.array_r.copy())

    def multiply(self, x: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """``J x``, zero at fixed degrees of freedom, from the forces ``K x``."""
        change = response(self._points, self._derivatives, forces, x)
        product = forces - change
        if self._pushing is not None:  # surfaces that follow
            pushed = self._body.total(self._pushing.T @ change)
            product -= self._pushed @ np.linalg.solve(self._resisting, pushed)
        product[self._body.fixed] = 0.0
        return product


def _near(body: ElasticBody, points: Sequence[ContactPoints]) -> np.ndarray:
    """Owned free degrees of freedom of the contact nodes and the ``LAYERS - 1`` layers next to them."""
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
