# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Force-driven surfaces: their rigid motions as unknowns, and one equilibrium equation for each.

All surfaces together have ``m`` free motions ``c``: translations along free axes, and rotations
about them, multiplied by a length of the contact.  A node at ``B u`` moves relative to its surface
by ``B u - D c``, local components.  The surfaces are in equilibrium if
``D^T r = F + k (drive - c)``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from dolfinx_contact.support.attributes import surfaces_of
from dolfinx_contact.surfaces.balance import REGULAR_STIFFNESS, SurfaceBalance
from dolfinx_contact.surfaces.sliding import slides_away

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State
    from dolfinx_contact.law.maps import NodalMap

# Smallest fraction of a motion along normals for which normal reactions resist it.
RESISTING_PART = 1e-8

# Largest stiffness of a spring over the stiffness of the contact nodes; beyond it, rounding of the
# spring's force hides the contact forces.
STIFFEST_SPRING = 1e10

# Maximum number of corrections by which a curved surface approaches the body.
MOST_APPROACHES = 20

# Distance from the body, over the body's extent, at which a surface counts as being in contact.
NEAR_PART = 1e-12


def approach(body: ElasticBody, in_step: Callable[[], list[ContactStep]], u: np.ndarray) -> None:
    """Move force-driven curved surfaces without contact up to the body, before a step.  Collective.

    Args:
        body: The body.
        in_step: Function that returns the ``ContactStep`` of each contact with these surfaces, for
            a step that starts from the surfaces' present positions.
        u: Displacement of the last step, owned degrees of freedom.
    """
    for _ in range(MOST_APPROACHES):
        steps = in_step()
        surfaces = DrivenSurfaces(body, steps)
        none = np.zeros(surfaces.count)
        moved = surfaces.touched(surfaces.with_columns(steps), u, none, NEAR_PART * body.extent)
        if not moved.any():
            return
        surfaces.place(moved)


class DrivenSurfaces:
    """The force-driven surfaces of some contacts, and their free motions.

    Motions are measured from the surfaces' positions when this object is created.

    Args:
        body: The body, for sums over ranks.
        contacts: ``ContactStep`` of each contact; several contacts may share a surface.
            Collective.

    Attributes:
        count: Number ``m`` of free motions.
        axes: ``D`` of each contact, ``shape=(n, gdim, m)``.  Zero for directions in which Dirichlet
            conditions constrain a node, except at nodes along which the surface is known to slide.
        springs: Spring stiffness of each motion, ``shape=(m,)``, force per length.
        plain: Whether all surfaces are planes without a free rotation.
        pressing: Whether mainly normal reactions resist each motion, ``shape=(m,)``, bool.
    """

    def __init__(self, body: ElasticBody, contacts: Sequence[ContactStep]):
        self._body = body
        self.surfaces = surfaces_of(c for c in contacts if c.surface.motions)
        self._initial_displacements = [surface.displacement for surface in self.surfaces]
        self._motions = [surface.motions for surface in self.surfaces]
        ends = np.cumsum([0] + [len(motions) for motions in self._motions])
        self.parts = [slice(a, b) for a, b in zip(ends, ends[1:])]
        self.count = int(ends[-1])
        self.plain = not any(surface.curved or surface.spins for surface in self.surfaces)
        self._columns = [self._nodal_columns(contact) for contact in contacts]
        self.axes = [
            _unconstrained_columns(contact, D) for contact, D in zip(contacts, self._columns)
        ]
        self._lengths = np.ones(self.count) if self.plain else self._scale_rotations()
        motions = [motion for motions in self._motions for motion in motions]
        self.springs = np.array([motion.spring for motion in motions]) / self._lengths**2
        self.names = [motion.name for motion in motions]
        self.turns = np.array([motion.turns for motion in motions])
        self._prescribed, self._terms = (self._initial_forces(sizes) for sizes in (False, True))
        self.pressing = np.array([name == "n" for name in self.names])
        self._rough = self.rough(contacts)
        if not self.plain:
            self.pressing = self._resisted_motions(contacts)

    def with_columns(self, contacts: Sequence[ContactStep]) -> tuple[ContactStep, ...]:
        """Return copies of the contacts that store the nodal displacements by surface motions."""
        return tuple(c.replaced(columns=D) for c, D in zip(contacts, self._columns))

    def _nodal_columns(self, contact: ContactStep) -> np.ndarray:
        """Surface displacement at each node by a unit of each motion, ``shape=(n, gdim, m)``."""
        columns = np.zeros((contact.points.count, contact.points.dim, self.count))
        for one, part, motions in zip(self.surfaces, self.parts, self._motions):
            if one is contact.surface:
                for k, motion in enumerate(motions, start=part.start):
                    columns[:, :, k] = contact.unit_motion(motion.axis, motion.turns)
        return columns

    def _initial_forces(self, sizes: bool) -> np.ndarray:
        """Prescribed force along each motion at the surfaces' initial positions, ``shape=(m,)``.

        Args:
            sizes: Return the sums of the magnitudes of the terms instead.
        """
        both = zip(self.surfaces, self._motions)
        pulled = [surface.driver.prescribed_forces(motions, sizes) for surface, motions in both]
        return np.concatenate([np.zeros(0), *pulled]) / self._lengths

    def _scale_rotations(self) -> np.ndarray:
        """Scale rotations to lengths by their largest lever arm, in place, and return factors.
        Collective.

        Returns:
            Length of each motion, ``shape=(m,)``: the largest lever arm of a rotation; one for
            translations, or if all lever arms are zero.
        """
        lengths = np.ones(self.count)
        for k, motion in enumerate(motion for motions in self._motions for motion in motions):
            if motion.turns:
                arms = [np.linalg.norm(axes[:, :, k], axis=1) for axes in self.axes]
                lengths[k] = self._body.largest(np.concatenate(arms)) or 1.0
        for D in (*self.axes, *self._columns):
            D /= lengths
        return lengths

    def _resisted_motions(self, contacts: Sequence[ContactStep]) -> np.ndarray:
        """Determine the motions that normal reactions resist, ``shape=(m,)``, bool.  Collective.

        These are motions with a larger part along normals than along tangents.  On frictionless
        surfaces, any part along normals is enough.  ``_loose`` becomes true for motions that
        nothing resists.
        """
        sums = np.zeros((2, self.count))
        for contact, axes in zip(contacts, self.axes):
            squares = np.einsum("n,nij->ij", self._node_weights(contact), axes**2)
            sums += squares[-1], squares[:-1].sum(axis=0)
        along, across = self._body.total(sums)
        smooth = np.zeros(self.count, dtype=bool)
        for (_, rough), part in zip(self._rough, self.parts):
            smooth[part] = not rough
        self._loose = (
            smooth & (along <= RESISTING_PART**2 * (along + across)) & (self.springs == 0.0)
        )
        return (along > across) | (smooth & ~self._loose)

    def _node_weights(self, contact: ContactStep) -> np.ndarray:
        """Normal reactions of the last step, ``shape=(n,)``, as weights of the nodes.  Collective.

        Without normal reactions, the weight is one at the nodes nearest to the surface, zero
        elsewhere.
        """
        pressing = contact.last.reaction[:, -1]
        if self._body.largest(pressing) > 0.0:
            return pressing
        nearest = -self._body.highest(-contact.last.gap)
        return (contact.last.gap <= nearest + NEAR_PART * self._body.extent).astype(float)

    def check(self, contacts: Sequence[ContactStep]) -> None:
        """Raise a ``ValueError`` on all ranks if nothing resists a free motion of a surface.
        Collective.

        Also if the force pulls a surface off the body, or a spring is too stiff for double
        precision.
        """
        if self.plain:
            self._loose = ~self.pressing & (self.springs == 0.0)
            for (_, rough), part in zip(self._rough, self.parts):
                self._loose[part] &= not rough
        if self._loose.any():
            name = self.names[int(np.argmax(self._loose))]
            raise ValueError(
                f"surface.free has {name!r}, along or about which nothing holds the plane: there is no friction. Give it "
                "surface.stiffness, or prescribe its motion."
            )
        if self.springs.any():
            self._check_springs(contacts)
        pulled = None if self.plain else self._pulled_off()
        if pulled is not None:
            raise ValueError(
                f"surface.force does not press {pulled} on the body: it pulls the surface off, and nothing else holds it. It "
                "is the force of the surface on the body; a spring, surface.stiffness, also pulls."
            )

    def _check_springs(self, contacts: Sequence[ContactStep]) -> None:
        """Raise a ``ValueError`` on all ranks for springs too stiff for double precision.
        Collective.
        """
        sums = np.zeros(self.count)
        for contact, axes in zip(contacts, self.axes):
            sums += np.einsum("n,nim->m", contact.stiffness.normal, axes**2)
        nodes = self._body.total(sums)
        too_stiff = (self.springs > STIFFEST_SPRING * nodes) & (nodes > 0.0)
        if too_stiff.any():
            k = int(np.argmax(too_stiff))
            scale = self._lengths[k] ** 2
            raise ValueError(
                f"surface.stiffness has {self.springs[k] * scale:.3g} for {self.names[k]!r}, {self.springs[k] / nodes[k]:.1g} times as stiff "
                f"as the contact nodes together: rounding of its force would hide theirs. That is a support: leave {self.names[k]!r} out "
                f"of surface.free and prescribe the motion, or take a spring of at most {1e-3 * STIFFEST_SPRING * nodes[k] * scale:.0e}."
            )

    def _pulled_off(self):
        """Return a curved surface that its force pulls off the body, or None.  Collective."""
        driving = self._prescribed
        for surface, part in zip(self.surfaces, self.parts):
            for k in range(part.start, part.stop) if surface.curved else ():
                if self.pressing[k] and not self.turns[k] and self.springs[k] == 0.0 != driving[k]:
                    ways = [np.sign(driving[k]) * axes[:, -1, k] for axes in self.axes]
                    if self._body.highest(np.concatenate(ways)) <= 0.0:
                        return surface
        return None

    # -- motions -------------------------------------------------------------------------------

    def place(self, c: np.ndarray) -> None:
        """Move the surfaces to the positions given by the motions ``c``, ``shape=(m,)``."""
        given = zip(self.surfaces, self._initial_displacements, self.parts, self._motions)
        for surface, home, part, motions in given:
            ways = c[part] / self._lengths[part]
            turned = [way * motion.axis for way, motion in zip(ways, motions) if motion.turns]
            along = [motion.axis for motion in motions if not motion.turns]
            if turned:
                surface.set_spin(np.sum(turned, axis=0))
            if along:
                surface.displacement = home + ways[len(turned) :] @ np.array(along)

    def touched(
        self,
        contacts: Sequence[ContactStep],
        x: np.ndarray,
        c: np.ndarray,
        near: float | None = None,
    ) -> np.ndarray:
        """Return motions in which each surface without contact has moved up to the body.
        Collective.

        A surface moves on until its first node alone would carry the prescribed force by its
        contact stiffness: without contact, reactions do not depend on the motion.

        Args:
            contacts: With columns, see ``with_columns``.
            x: Displacement, owned degrees of freedom.
            c: Motions before, ``shape=(m,)``.
            near: If given, only surfaces farther away than this length move, up to first contact.
        """
        for motion in np.flatnonzero(self.pressing & ~self.turns):
            driving = self.driving(c)[motion]
            sign = -1.0 if driving < 0.0 else 1.0
            ways = [np.full((2, 1), np.inf)]  # to first contact; until one node carries the force
            for contact, axes in zip(contacts, self.axes):
                gap, rate = contact.at(x, c).gap, sign * axes[:, -1, motion]
                # Gaps below rounding count as closed: a plane that may tilt has no equilibrium on
                # one node alone.
                gap = np.where(np.abs(gap) <= contact.gap_rounding(x), 0.0, gap)
                push = 0.0 if near is not None else sign * driving / contact.stiffness.normal
                ways.append(np.array([gap, gap + push])[:, rate > 0] / rate[rate > 0])
            first, far = np.concatenate(ways, axis=1).min(axis=1)
            first, far = (self._body.comm.allreduce(float(way), op=MPI.MIN) for way in (first, far))
            away = 0.0 <= first if near is None else near < first
            if driving != 0.0 and away and first < np.inf:
                c = c + sign * far * np.eye(self.count)[motion]
        return c

    def at_rest(self, c: np.ndarray, softest: float = 0.0) -> np.ndarray:
        """Return the motions at which springs balance the prescribed forces without reactions.

        Args:
            c: Motions of surfaces without springs, which are kept.
            softest: Motions with a spring no stiffer than this are kept, too, force per length.
        """
        springs, stretch = self.springs, np.zeros(self.count)
        return c + np.divide(self.driving(c), springs, stretch, where=springs > softest)

    @property
    def can_rest(self) -> bool:
        """Whether all motions resisted by normal reactions have springs: these may act alone."""
        return bool((self.springs[self.pressing] > 0).all())

    # -- forces --------------------------------------------------------------------------------

    def driving(self, c: np.ndarray) -> np.ndarray:
        """Return the force required along each motion, ``F + k (drive - c)``, ``shape=(m,)``."""
        return self._prescribed - self.springs * c

    def left(self, nodes: Sequence[State], c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return residual forces of the surfaces, ``D^T r`` minus the prescribed forces.
        Collective.

        Returns:
            The residual, and the sum of the magnitudes of its terms, ``shape=(m,)`` each.
        """
        sums = np.zeros((2, self.count))
        for state, axes in zip(nodes, self.axes):
            sums[0] += np.tensordot(state.reaction, axes, 2)
            sums[1] += np.tensordot(np.abs(state.reaction), np.abs(axes), 2)
        total, size = self._body.total(sums)
        return total - self.driving(c), size + self._terms + self.springs * np.abs(c)

    def tangent(self, contacts: Sequence[ContactStep], derivatives: Sequence[tuple]) -> np.ndarray:
        """Return the derivative of the residual by the motions, ``k - D^T R_w D``.  Collective.

        A small multiple of the nodes' stiffness is added as regularisation.

        Args:
            contacts: ``ContactStep`` of each contact.
            derivatives: Derivatives of the reactions, as ``LoadStep.derivatives`` returns them.

        Returns:
            ``shape=(m, m)``, force per length.
        """
        sums = np.zeros((2, self.count, self.count))
        for contact, axes, (_, by_motion) in zip(contacts, self.axes, derivatives):
            kappa = contact.stiffness.normal[:, None, None]
            sums[0] -= np.tensordot(axes, by_motion @ axes, ((0, 1), (0, 1)))
            sums[1] += np.tensordot(axes, kappa * axes, ((0, 1), (0, 1)))
        stiffness, most = self._body.total(sums)
        return np.diag(self.springs) + stiffness + REGULAR_STIFFNESS * most

    def columns(
        self, contacts: Sequence[ContactStep], blocks: Sequence[np.ndarray] | None = None
    ) -> np.ndarray:
        """Return nodal forces on owned degrees of freedom, ``B^T S D``, ``shape=(owned dofs, m)``.

        Args:
            contacts: ``ContactStep`` of each contact.
            blocks: Diagonal of ``S`` of each contact, ``shape=(n, gdim)``; None means the identity.
        """
        columns = np.zeros((self.count, self._body.size))
        for k, (contact, axes) in enumerate(zip(contacts, self.axes)):
            weighted = axes if blocks is None else blocks[k][:, :, None] * axes
            for column, along in zip(columns, np.moveaxis(weighted, 2, 0)):
                contact.points.add_forces(along, column)
        columns[:, self._body.fixed] = 0.0
        return columns.T

    def balanced(
        self,
        contacts: Sequence[ContactStep],
        x: np.ndarray,
        c: np.ndarray,
        maps: Sequence[NodalMap],
        required: Callable,
    ) -> np.ndarray:
        """Return motions in equilibrium with the reactions of the nodal laws.  Collective.

        Args:
            contacts: With columns, see ``with_columns``.
            x: Displacement, owned degrees of freedom.
            c: Initial guess of the motions, ``shape=(m,)``.
            maps: Nodal contact law of each contact, see ``law/maps.py``.
            required: Function of the motions that returns, for each contact, the nodal reactions
                required by equilibrium of the body.

        Returns:
            ``shape=(m,)``; Newton's last iterate if it does not converge.
        """
        return SurfaceBalance(self, self._body, contacts, x, maps, required).reached(c)

    def rough(self, contacts: Sequence[ContactStep]) -> list[tuple]:
        """Return pairs of each surface and whether any of its contacts has friction.
        Collective.
        """
        known = []
        for surface in self.surfaces:
            laws = [c.friction.mu.ravel() for c in contacts if c.surface is surface]
            known.append((surface, self._body.largest(np.concatenate(laws)) > 0.0))
        return known

    def beyond(
        self,
        contacts: Sequence[ContactStep],
        nodes: Sequence[State],
        c: np.ndarray,
        given: bool = False,
    ) -> str:
        """Describe a surface whose forces exceed what reactions can carry; otherwise return "".
        Collective.

        Args:
            contacts: ``ContactStep`` of each contact.
            nodes: State of each contact.
            c: Motions, ``shape=(m,)``.
            given: Use the prescribed forces alone, before the step, not the computed normal
                reactions.
        """
        return slides_away(self, self._body, contacts, nodes, c, given)


def _unconstrained_columns(contact: ContactStep, columns: np.ndarray) -> np.ndarray:
    """Return ``D``, zero in constrained directions except at nodes along which the surface slides.

    Rows of nodes whose normal displacement is prescribed are zero.
    """
    points, axes = contact.points, columns.copy()
    points.remove_constrained(axes[:, :-1])
    if contact.dragged is not None:
        rows = contact.dragged.any(axis=1)
        axes[rows, :-1] = columns[rows, :-1]
    axes[points.closed] = 0.0
    return axes
