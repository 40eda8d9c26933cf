# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact in a user's own solution loop: one predictor and corrector at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.contact.contact_step import nodal_stiffness, step_of
from dolfinx_contact.contact.interface import add_to
from dolfinx_contact.law.maps import BipotentialMap, ReturnMap

if TYPE_CHECKING:
    from dolfinx import fem
    from petsc4py import PETSc

    from dolfinx_contact.contact.contact import Contact


class OwnLoop:
    """A contact whose displacement is found by the user's own loop, without ``ContactProblem``.

    Args:
        contact: The contact, whose ``reaction``, ``gap``, ``slip_increment`` and ``status`` are
            replaced in each iteration.
        K: Assembled PETSc stiffness matrix on ``V``.  Collective.
        map: "bipotential" for the predictor and Euclidean projection of [dSFMH07, Section 2].
            "return" for a predictor without the additional normal term, and a projection in the
            metric of the slip rule.  Both maps have the same fixed points.

    Raises:
        ValueError: if ``map`` has another value; on all ranks, if a node has no positive stiffness
            along the normal.

    Attributes:
        rho: Augmentation parameter, the normal diagonal entry of each node in ``K``,
            ``shape=(n,)``, force per length.

    Example:
        >>> loop = dc.OwnLoop(contact, problem.body.K)
        >>> loop.update(problem.u)  # reactions, from gaps and slip at a displacement
    """

    def __init__(self, contact: Contact, K: PETSc.Mat, map: str = "bipotential") -> None:
        if map not in ("bipotential", "return"):
            raise ValueError(f'map must be "bipotential" or "return", got {map!r}.')
        self.contact, self.rho = contact, nodal_stiffness(contact, K).normal
        self._map = (
            BipotentialMap(self.rho) if map == "bipotential" else ReturnMap(self.rho, self.rho)
        )

    @property
    def springs(self) -> np.ndarray:
        """Spring stiffnesses for ``update``, ``shape=(n, gdim)``, local frame, force per length.

        They are ``rho diag(Q^2, 1)`` for the "bipotential" map and ``rho`` in all directions for
        the "return" map.  Without friction, the tangential stiffnesses are zero.
        """
        return self._map.springs(self.contact.friction, self.contact.points.dim)

    def add_springs(self, K: PETSc.Mat) -> None:
        """Add ``springs`` to a PETSc matrix on ``V``, in place.  Collective."""
        points = self.contact.points
        add_to(K, points.matrix(self.springs[:, :, None] * np.eye(points.dim)))

    def update(self, u: fem.Function | np.ndarray) -> None:
        """Apply one predictor and corrector at all contact nodes.

        Gaps and slip increments follow from ``u``.  ``contact.reaction`` is replaced by the
        projection of its predictor on the friction cone, and ``contact.status`` by the branch of
        the projection.

        Args:
            u: Function on ``V``, or the array of its owned degrees of freedom; length units.
        """
        contact = self.contact
        values = (u.x.array if hasattr(u, "x") else u)[: contact.points.size]
        contact.present = step_of(contact).respond(values, contact.reaction, self._map)

    def advance(self) -> None:
        """Accept the present state as the last converged one.  Collective.

        The next slip increments are measured from this state.
        """
        self.contact.accept(step_of(self.contact).ended(self.contact.present))
