# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The correction of an iteration: body with springs at its contact nodes, and the contact tangent next to the plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI
from scipy import sparse

from dolfinx_contact.contact.interface import like, structure
from dolfinx_contact.petsc.linear_solver import stage
from dolfinx_contact.solvers.fixed_point.rigid_balance import RigidBalance, patch_motions
from dolfinx_contact.solvers.fixed_point.surface_layer import SurfaceLayer

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.law.maps import NodalMap
    from dolfinx_contact.step.load_step import LoadStep


class ContactPreconditioner:
    """Corrects a displacement for forces out of balance; every application is one cycle or back-solve.

    Args:
        step: The step: its body, rows and laws of its contacts.
        maps: Of each contact; their springs are added to the stiffness.  Collective.

    Attributes:
        rigid: ``RigidBalance`` of the motions that the springs stiffen too much.
        stiffened: What applies the preconditioner of the stiffness with springs.
        linearised: Whether corrections know a tangent.
        followed: Whether motions of surfaces or anchors follow the body.
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

    def soften(self) -> bool:
        """Look for more soft motions, of a step that does not converge; whether there are any new ones.  Collective."""
        if self._softened:
            return False
        self._softened, known = True, len(self.rigid)
        modes = (self._body.rigid_modes(), patch_motions(self._body, self._points))
        rigid = RigidBalance(self._body, self._A, np.concatenate(modes, axis=1))
        self.rigid = rigid if len(rigid) > known else self.rigid
        return len(rigid) > known

    def destroy(self) -> None:
        """Free factors and levels.  Collective."""
        self.stiffened.destroy()
        self._A.destroy()
        if self._layer is not None:
            self._layer.destroy()

    def _rates(self, contacts: Sequence[ContactStep]) -> list[np.ndarray]:
        """The maps' springs under the laws of each contact."""
        both = zip(contacts, self._maps)
        return [map.springs(contact.friction, contact.points.dim) for contact, map in both]

    def same_springs(self, contacts: Sequence[ContactStep]) -> bool:
        """Whether the laws of contacts have the springs that are set up.  Collective."""
        same = all(map(np.array_equal, self._rates(contacts), self._spring_rates))
        return self._body.comm.allreduce(same, op=MPI.LAND)

    def _springs(self):
        """The maps' springs, a PETSc matrix with entries at contact nodes alone."""
        K, S = self._body.K, None
        for points, springs in zip(self._points, self._spring_rates):
            matrix = points.matrix(springs[:, :, None] * np.eye(points.dim))
            S = matrix if S is None else S + matrix
        if S is None:
            S = sparse.csr_matrix((self._body.size, K.getSize()[1]))
        return like(K, S)

    def linearise(self, step: LoadStep, derivatives: Sequence[tuple]) -> None:
        """From now on corrections know how the contact nodes respond, see ``SurfaceLayer``.  Collective.

        Args:
            step: The step, whose rows count.
            derivatives: As ``LoadStep.derivatives`` returns them.
        """
        if self._layer is None:
            prefix = f"{self._body.prefix}layer_"
            self._layer = SurfaceLayer(self._body, self._points, prefix)
        with stage("contact: surface layer"):
            self._layer.linearise(step, derivatives)
        self.linearised = True

    def forget_tangent(self) -> None:
        """Corrections by springs alone again."""
        self.linearised = False

    def tangent(self, x: np.ndarray) -> np.ndarray:
        """Minus the derivative of the forces out of balance along ``x``, where they were linearised."""
        return self._layer.multiply(x, self._body.multiply(x))

    def correct(self, residual: np.ndarray) -> np.ndarray:
        """Displacement that removes the residual while the springs hold the contact nodes.

        After ``linearise`` the layers next to the plane are corrected first.
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
