# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What can be read from a contact after a step: certificates, forces, pressures, functions for output."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import ArrayLike

from dolfinx_contact.contact import fields
from dolfinx_contact.contact.laws import ContactLaws
from dolfinx_contact.contact.state import Status
from dolfinx_contact.support.attributes import frozen


class ContactResults(ContactLaws):
    """Results of the present state of a ``Contact``, which has laws, frame and nodes."""

    _area: np.ndarray | None = None
    _axial: bool | None = None
    _weight: Any = None

    @property
    def load_function(self) -> np.ndarray:
        """f = ||M^-1 r_t|| - r_n, ``shape=(n,)``, force units [dSFMH07, Eq. (1)]."""
        return self.law.load_function(self.reaction)

    @property
    def bipotential_gap(self) -> np.ndarray:
        """Certificate b_c + Delta u . r >= 0 of each node, ``shape=(n,)``, force times length.

        Zero exactly where the law holds [dSFMH07, Section 1].  Evaluated at ``max(gap, 0)``;
        penetration is reported by itself.
        """
        return self.law.bipotential_gap(
            self.reaction, np.maximum(self.gap, 0.0), self.slip_increment
        )

    @property
    def slip_residual(self) -> np.ndarray:
        """What of the slip increments the slip rule leaves unexplained, ``shape=(n, gdim - 1)``, length.

        ``Delta u_t + |Delta u_t| d`` on slipping nodes, ``d`` the unit vector along ``P^-2 r_t``, and ``Delta u_t``
        on sticking ones [dSFMH07, Section 1]; zero on open and frictionless nodes.
        """
        slip, mu = self.slip_increment, self.friction.mu[..., :1]
        against = self.friction.against_slip(self.reaction[:, :-1])
        length = np.linalg.norm(slip, axis=1, keepdims=True)
        # Compared with an enum, NumPy looks for attributes that enums do not have, and drops a Ctrl-C that comes then.
        slips = (self.status == int(Status.SLIP))[:, None]
        bound = (self.status != int(Status.OPEN))[:, None] & (mu > 0)
        return np.where(bound, slip + slips * length * against, 0.0)

    def force(self) -> np.ndarray:
        """Total reaction, ``shape=(gdim,)``, global frame, the same on all ranks.  Collective.

        With axial symmetry its axial component alone is a force; the other one is the sum of radial forces, which balance.
        """
        if self.surface.curved:
            return self.comm.allreduce(np.einsum("ni,nij->j", self.reaction, self.frame))
        return self.comm.allreduce(self.reaction.sum(axis=0)) @ self.frame

    def moment(self) -> np.ndarray:
        """Moment of the reactions about the surface's point, ``shape=(3,)``, in 2-D one number, global frame.  Collective.

        With the lever arms of the step: from where the point was put before it to where the nodes were then.  After a
        step it is ``surface.moment`` about the axes that are free.
        """
        forces = np.einsum("ni,nij->nj", self.reaction, self.points.frames)
        arms = self.arms
        if arms.shape[1] == 2:
            moments = (arms[:, :1] * forces[:, 1:] - arms[:, 1:] * forces[:, :1]).sum(axis=0)
        else:
            moments = np.cross(arms, forces).sum(axis=0)
        return self.comm.allreduce(moments)

    @property
    def area(self) -> np.ndarray:
        """Area of the contact surface that belongs to each node, ``shape=(n,)``, undeformed state, see ``facing_areas``.

        The integral of the node's shape function, times ``weight``, over the facets as the surface sees them: facets that are turned away from
        it have none.  Without a weight a length in two dimensions.  Collective at the first call.
        """
        if self._area is None:
            self._area = frozen(fields.facing_areas(self, self._weight))
        return self._area

    @property
    def pressure(self) -> np.ndarray:
        """Normal reaction over nodal area, ``shape=(n,)``, force per area; zero where a node has none.  Collective at first."""
        return fields.per_area(self.reaction[:, -1], self.area)

    @property
    def weighted(self) -> bool:
        """Whether the surface measure has a weight."""
        return self._weight is not None

    @property
    def axial(self) -> bool:
        """Whether ``weight`` is in proportion to the first coordinate, in two dimensions: axial symmetry.  Collective at first."""
        if self._axial is None:
            V = self.displacements.V
            plain = self._weight is None or V.mesh.geometry.dim == 3
            self._axial = not plain and fields.grows_with_radius(V, self._weight)
        return self._axial

    def function(self, values: ArrayLike, name: str = "f", elsewhere: float = 0.0) -> fem.Function:
        """Values at the contact nodes, ``shape=(n,)``, as a scalar Function for output.  Collective."""
        return fields.scalar(self.displacements.V, self.nodes, values, name, elsewhere)

    def everywhere(self, values: ArrayLike) -> np.ndarray:
        """Values at the contact nodes at those of all nodes that this rank knows, ghosts included, zero elsewhere.  Collective."""
        function = fem.Function(self.displacements.V)
        rows = function.x.array.reshape(-1, self.displacements.dim)
        rows[self.nodes, 0] = values
        function.x.scatter_forward()
        return rows[:, 0].copy()

    def reaction_function(self) -> fem.Function:
        """Nodal reactions in global components as a Function on the space of displacements, zero elsewhere."""
        function = fem.Function(self.displacements.V, name="reaction")
        forces = np.zeros(self.points.size)
        self.points.add_forces(self.reaction, forces)
        rows = self.displacements.rows(forces)
        function.x.array[: rows.size] = rows.ravel()
        function.x.scatter_forward()
        return function
