# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Surfaces driven by force: their motions are unknowns, each with the equilibrium of its surface as equation.

Of all surfaces together there are ``m`` free motions ``c``, lengths along free axes, and angles about them times a length
of the contact.  A node at ``B u`` moves relative to its surface by ``B u - D c``, local components, and surfaces are in
equilibrium where ``D^T r = F + k (drive - c)``.
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

# Part of a motion that has to be along normals for these to resist it.
RESISTING_PART = 1e-8

# Stiffness of a spring over that of the contact nodes, beyond which rounding of its force hides theirs.
STIFFEST_SPRING = 1e10

# Times that a curved surface far from the body comes nearer.
MOST_APPROACHES = 20  # part of the body's extent that is near enough
NEAR_PART = 1e-12


def approach(body: ElasticBody, in_step: Callable[[], list[ContactStep]], u: np.ndarray) -> None:
    """Move curved surfaces that force drives and no node touches to the body, before a step.  Collective.

    Args:
        body: The body.
        in_step: Returns their contacts as a step has them that begins where the surfaces stand.
        u: Last displacement, owned degrees of freedom.
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
    """The surfaces of some contacts that force drives, and their free motions from where they stand at first.

    Args:
        body: The body, for sums over ranks.
        contacts: ``ContactStep`` of its contacts; several may have the same surface.  Collective.

    Attributes:
        count: Number ``m`` of free motions.
        axes: ``D`` of each contact, ``shape=(n, gdim, m)``, zero for directions in which supports hold a node, but for nodes
            that the surface is known to drag along these.
        springs: Stiffness of each motion's spring, ``shape=(m,)``, force per length.
        plain: Whether all surfaces are planes that do not turn.
        pressing: Which motions the normal reactions resist most, ``shape=(m,)``.
    """

    def __init__(self, body: ElasticBody, contacts: Sequence[ContactStep]):
        self._body = body
        self.surfaces = surfaces_of(c for c in contacts if c.surface.motions)
        self._home = [surface.displacement for surface in self.surfaces]
        self._motions = [surface.motions for surface in self.surfaces]
        ends = np.cumsum([0] + [len(motions) for motions in self._motions])
        self.parts = [slice(a, b) for a, b in zip(ends, ends[1:])]
        self.count = int(ends[-1])
        self.plain = not any(surface.curved or surface.spins for surface in self.surfaces)
        self._columns = [self._moved_nodes(contact) for contact in contacts]
        self.axes = [_felt(contact, D) for contact, D in zip(contacts, self._columns)]
        self._lengths = np.ones(self.count) if self.plain else self._scaled()
        motions = [motion for motions in self._motions for motion in motions]
        self.springs = np.array([motion.spring for motion in motions]) / self._lengths**2
        self.names = [motion.name for motion in motions]
        self.turns = np.array([motion.turns for motion in motions])
        self._pull, self._terms = (self._pulled_at_home(sizes) for sizes in (False, True))
        self.pressing = np.array([name == "n" for name in self.names])
        self._rough = self.rough(contacts)
        if not self.plain:
            self.pressing = self._resisted(contacts)

    def with_columns(self, contacts: Sequence[ContactStep]) -> tuple[ContactStep, ...]:
        """The contacts, which know what motions of surfaces move at their nodes."""
        return tuple(c.but(columns=D) for c, D in zip(contacts, self._columns))

    def _moved_nodes(self, contact: ContactStep) -> np.ndarray:
        """What each motion moves at the nodes, ``shape=(n, gdim, m)``."""
        columns = np.zeros((contact.points.count, contact.points.dim, self.count))
        for one, part, motions in zip(self.surfaces, self.parts, self._motions):
            if one is contact.surface:
                for k, motion in enumerate(motions, start=part.start):
                    columns[:, :, k] = contact.moved_by(motion.axis, motion.turns)
        return columns

    def _pulled_at_home(self, sizes: bool) -> np.ndarray:
        """What drives each motion where surfaces stand at first, or the sum of the magnitudes of its terms."""
        both = zip(self.surfaces, self._motions)
        pulled = [surface.driver.pulled_by(motions, sizes) for surface, motions in both]
        return np.concatenate([np.zeros(0), *pulled]) / self._lengths

    def _scaled(self) -> np.ndarray:
        """Give rotations the dimension of displacements: the largest lever arm of each, or one.  Collective."""
        lengths = np.ones(self.count)
        for k, motion in enumerate(motion for motions in self._motions for motion in motions):
            if motion.turns:
                arms = [np.linalg.norm(axes[:, :, k], axis=1) for axes in self.axes]
                lengths[k] = self._body.largest(np.concatenate(arms)) or 1.0
        for D in (*self.axes, *self._columns):
            D /= lengths
        return lengths

    def _resisted(self, contacts: Sequence[ContactStep]) -> np.ndarray:
        """Motions more along normals than across; without friction all that are along normals at all.  Collective."""
        sums = np.zeros((2, self.count))
        for contact, axes in zip(contacts, self.axes):
            squares = np.einsum("n,nij->ij", self._loaded(contact), axes**2)
            sums += squares[-1], squares[:-1].sum(axis=0)
        along, across = self._body.total(sums)
        smooth = np.zeros(self.count, dtype=bool)
        for (_, rough), part in zip(self._rough, self.parts):
            smooth[part] = not rough
        self._loose = (
            smooth & (along <= RESISTING_PART**2 * (along + across)) & (self.springs == 0.0)
        )
        return (along > across) | (smooth & ~self._loose)

    def _loaded(self, contact: ContactStep) -> np.ndarray:
        """Normal reactions of the last step; where there are none, one at the nodes that were nearest.  Collective."""
        pressing = contact.last.reaction[:, -1]
        if self._body.largest(pressing) > 0.0:
            return pressing
        nearest = -self._body.highest(-contact.last.gap)
        return (contact.last.gap <= nearest + NEAR_PART * self._body.extent).astype(float)

    def check(self, contacts: Sequence[ContactStep]) -> None:
        """Raise a ``ValueError`` on all ranks if nothing would hold a surface that force drives.  Collective."""
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
        pulled = None if self.plain else self._pulled()
        if pulled is not None:
            raise ValueError(
                f"surface.force does not press {pulled} on the body: it pulls the surface off, and nothing else holds it. It "
                "is the force of the surface on the body; a spring, surface.stiffness, also pulls."
            )

    def _check_springs(self, contacts: Sequence[ContactStep]) -> None:
        """Raise a ``ValueError`` on all ranks for springs whose force double precision does not resolve.  Collective."""
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

    def _pulled(self):
        """A curved surface that its force pulls off the body, None if there is none.  Collective."""
        driving = self._pull
        for surface, part in zip(self.surfaces, self.parts):
            for k in range(part.start, part.stop) if surface.curved else ():
                if self.pressing[k] and not self.turns[k] and self.springs[k] == 0.0 != driving[k]:
                    ways = [np.sign(driving[k]) * axes[:, -1, k] for axes in self.axes]
                    if self._body.highest(np.concatenate(ways)) <= 0.0:
                        return surface
        return None

    # -- motions -------------------------------------------------------------------------------

    def place(self, c: np.ndarray) -> None:
        """Move the planes themselves by these lengths along their free axes from where they stood at first."""
        given = zip(self.surfaces, self._home, self.parts, self._motions)
        for surface, home, part, motions in given:
            ways = c[part] / self._lengths[part]
            turned = [way * motion.axis for way, motion in zip(ways, motions) if motion.turns]
            along = [motion.axis for motion in motions if not motion.turns]
            if turned:
                surface.spin_by(np.sum(turned, axis=0))
            if along:
                surface.displacement = home + ways[len(turned) :] @ np.array(along)

    def touched(
        self,
        contacts: Sequence[ContactStep],
        x: np.ndarray,
        c: np.ndarray,
        near: float | None = None,
    ) -> np.ndarray:
        """Motions with which planes that no node touches at a displacement are where one node alone would carry the force.  Collective.

        From further away nothing tells how the forces on the plane change with its motion.

        Args:
            contacts: With columns.
            x: Displacement of owned degrees of freedom.
            c: Motions at first.
            near: If given, planes further away than that are moved to the first node, others stay.
        """
        for motion in np.flatnonzero(self.pressing & ~self.turns):
            driving = self.driving(c)[motion]
            sign = -1.0 if driving < 0.0 else 1.0
            ways = [np.full((2, 1), np.inf)]  # to the first node; to where it carries the force
            for contact, axes in zip(contacts, self.axes):
                gap, rate = contact.at(x, c).gap, sign * axes[:, -1, motion]
                # By less than rounding none touches: on one node alone a plane that may tilt has no equilibrium.
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
        """The motions at which springs hold the planes without reactions.

        Args:
            c: Of planes without springs.
            softest: Planes whose springs are no stiffer than that, force per length, stay where they are.
        """
        springs, stretch = self.springs, np.zeros(self.count)
        return c + np.divide(self.driving(c), springs, stretch, where=springs > softest)

    @property
    def can_rest(self) -> bool:
        """Whether no plane needs reactions along its normal."""
        return bool((self.springs[self.pressing] > 0).all())

    # -- forces --------------------------------------------------------------------------------

    def driving(self, c: np.ndarray) -> np.ndarray:
        """Sum of the reactions that motions ask for, ``F + k (drive - c)``, ``shape=(m,)``."""
        return self._pull - self.springs * c

    def left(self, nodes: Sequence[State], c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces out of balance, reactions minus what drives, and the size of their terms, ``shape=(m,)``.  Collective."""
        sums = np.zeros((2, self.count))
        for state, axes in zip(nodes, self.axes):
            sums[0] += np.tensordot(state.reaction, axes, 2)
            sums[1] += np.tensordot(np.abs(state.reaction), np.abs(axes), 2)
        total, size = self._body.total(sums)
        return total - self.driving(c), size + self._terms + self.springs * np.abs(c)

    def tangent(self, contacts: Sequence[ContactStep], derivatives: Sequence[tuple]) -> np.ndarray:
        """Derivative of the forces out of balance by the motions, ``k - D^T R_w D``, ``shape=(m, m)``.  Collective.

        Args:
            contacts: The contacts.
            derivatives: As ``LoadStep.derivatives`` returns them.
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
        """Forces on owned degrees of freedom, ``B^T S D``, ``shape=(owned dofs, m)``.

        Args:
            contacts: The contacts.
            blocks: ``S`` of each contact, ``shape=(n, gdim)``; None is one everywhere.
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
        """Motions at which the reactions that maps make are in balance, as far as they can be.  Collective.

        Args:
            contacts: With columns.
            x: Displacement of owned degrees of freedom.
            c: Motions at first.
            maps: Of the contacts, see ``law/maps.py``.
            required: Of motions, the reactions that the body asks of each contact.
        """
        return SurfaceBalance(self, self._body, contacts, x, maps, required).reached(c)

    def rough(self, contacts: Sequence[ContactStep]) -> list[tuple]:
        """The planes, and whether there is friction on each.  Collective."""
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
        """Which plane is pushed by more than can be carried, in words; none is the empty string.  Collective.

        Args:
            contacts: The contacts.
            nodes: Their states.
            c: Motions.
            given: Ask before anything is known but the forces that are given, not by the normal reactions.
        """
        return slides_away(self, self._body, contacts, nodes, c, given)


def _felt(contact: ContactStep, columns: np.ndarray) -> np.ndarray:
    """``D`` without what supports hold, but for nodes that the surface drags."""
    points, axes = contact.points, columns.copy()
    points.without_held(axes[:, :-1])
    if contact.dragged is not None:
        rows = contact.dragged.any(axis=1)
        axes[rows, :-1] = columns[rows, :-1]
    axes[points.closed] = 0.0
    return axes
