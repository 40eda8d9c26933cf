# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Preconditioner of the fixed point: stiffness plus springs, and the tangent near the contact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI
from scipy import sparse

from dolfinx_contact.contact.interface import like, structure
from dolfinx_contact.petsc.linear_solver import stage
from dolfinx_contact.solvers.fixed_point.rigid_balance import RigidBalance, contact_responses
from dolfinx_contact.solvers.fixed_point.surface_layer import SurfaceLayer

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.law.maps import NodalMap
    from dolfinx_contact.step.load_step import LoadStep


class ContactPreconditioner:
    """Preconditioner of the fixed point: approximate displacement that removes a residual.

    An application costs one multigrid cycle or back-solve.

    Args:
        step: The load step with its body and contacts.
        maps: Nodal map of each contact; its springs are added to the stiffness.  Collective.

    Attributes:
        rigid: ``RigidBalance`` of the motions that the springs restrain too much.
        stiffened: Object whose method ``apply`` applies the inverse of the stiffness with springs,
            or a multigrid cycle.
        linearised: Whether corrections use the contact tangent near the contact.
        followed: Whether motions of driven surfaces or of anchors are corrected, see ``Border``.
    """

    def __init__(self, step: LoadStep, maps: Sequence[NodalMap]):
        body, self._maps = step.body, maps
        self._body, self._points = body, [contact.points for contact in step.contacts]
        self._spring_rates = self._rates(step.contacts)
        self._layer, self.linearised = None, False
        with stage("contact: set-up of springs"):
            S, how = self._springs(), structure(self._points)
            A, self.stiffened = body.stiffened(S, how)
            self.rigid = RigidBalance(body, A, body.rigid_modes())
            self._softened = False
        self._A = A
        self.followed = body.loose is not None or step.surfaces is not None
        self._border = None
        if self.followed:
            from dolfinx_contact.solvers.fixed_point.border import Border

            self._border = Border(step, A, self.stiffened, self._spring_rates)
        S.destroy()

    def add_soft_motions(self) -> bool:
        """Look for further soft motions; return whether any was added to ``rigid``.  Collective.

        The candidates are the displacements under forces on the contacts.  This is done once, in a
        load step that does not converge.
        """
        if self._softened:
            return False
        self._softened, known = True, len(self.rigid)
        modes = (self._body.rigid_modes(), contact_responses(self._body, self._points))
        rigid = RigidBalance(self._body, self._A, np.concatenate(modes, axis=1))
        self.rigid = rigid if len(rigid) > known else self.rigid
        return len(rigid) > known

    def destroy(self) -> None:
        """Free factorisations and multigrid levels.  Collective."""
        self.stiffened.destroy()
        self._A.destroy()
        if self._layer is not None:
            self._layer.destroy()

    def _rates(self, contacts: Sequence[ContactStep]) -> list[np.ndarray]:
        """Spring stiffness of each contact's nodes, ``shape=(n, gdim)``, force per length."""
        both = zip(contacts, self._maps)
        return [map.springs(contact.friction, contact.points.dim) for contact, map in both]

    def same_springs(self, contacts: Sequence[ContactStep]) -> bool:
        """Whether the friction laws of the contacts lead to the springs already set up.
        Collective."""
        same = all(map(np.array_equal, self._rates(contacts), self._spring_rates))
        return self._body.comm.allreduce(same, op=MPI.LAND)

    def _springs(self):
        """Spring stiffness, a PETSc matrix with entries at contact nodes only."""
        K, S = self._body.K, None
        for points, springs in zip(self._points, self._spring_rates):
            matrix = points.matrix(springs[:, :, None] * np.eye(points.dim))
            S = matrix if S is None else S + matrix
        if S is None:
            S = sparse.csr_matrix((self._body.size, K.getSize()[1]))
        return like(K, S)

    def linearise(self, step: LoadStep, derivatives: Sequence[tuple]) -> None:
        """Set up the contact tangent for the following corrections, see ``SurfaceLayer``.
        Collective.

        Args:
            step: The load step with the present contact points.
            derivatives: Derivatives of the nodal maps, as ``LoadStep.derivatives`` returns them.
        """
        if self._layer is None:
            prefix = f"{self._body.prefix}layer_"
            self._layer = SurfaceLayer(self._body, self._points, prefix)
        with stage("contact: surface layer"):
            self._layer.linearise(step, derivatives)
        self.linearised = True

    def use_springs_only(self) -> None:
        """Stop using the contact tangent: corrections use the springs only."""
        self.linearised = False

    def tangent(self, x: np.ndarray) -> np.ndarray:
        """Product of the contact tangent, minus the derivative of the residual, with ``x``."""
        return self._layer.multiply(x, self._body.multiply(x))

    def correct(self, residual: np.ndarray) -> np.ndarray:
        """Displacement increment that removes a residual, with springs at the contact nodes.

        After ``linearise``, the near-contact subdomain is corrected first.
        """
        residual, near = residual.copy(), 0.0
        residual[self._body.fixed] = 0.0
        if self.linearised:
            near, residual = self._layer.correct(residual)
        correction = near + self.stiffened.apply(residual)
        if self._border:
            correction += self._border.correct(residual)
        correction[self._body.fixed] = 0.0
        return correction
