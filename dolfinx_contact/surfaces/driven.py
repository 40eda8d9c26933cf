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
from dolfinx_contact.surfaces.balance import REGULAR, SurfaceBalance
from dolfinx_contact.surfaces.sliding import slides_away

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.law.maps import NodalMap

# Part of a motion that has to be along normals for these to resist it.
RESISTING = 1e-8

# Stiffness of a spring over that of the contact nodes, beyond which rounding of its force hides theirs.
STIFFEST = 1e10

# Times that a curved surface far from the body comes nearer.
APPROACHES, NEAR = 20, 1e-12  # part of the body's extent that is near enough


def approach(body: ElasticBody, contacts: Sequence[Contact], u: np.ndarray) -> None:
    """Move curved surfaces that force drives and no node touches to the body.  Collective.

    Args:
        u: Last displacement, owned degrees of freedom.
    """
    curved = [contact for contact in contacts if contact.surface.free and contact.surface.curved]
    for _ in range(APPROACHES if curved else 0):
        for contact in curved:
            contact.follow(u)
        if not DrivenSurfaces(body, curved).touch(u, NEAR * body.extent):
            return


class DrivenSurfaces:
    """The surfaces of some contacts that force drives, and their free motions from where they stand at first.

    Args:
        body: The body, for sums over ranks.
        contacts: Its contacts; several may have the same surface.  Collective.

    Attributes:
        count: Number ``m`` of free motions.
        axes: ``D`` of each contact, ``shape=(n, gdim, m)``, zero for directions in which supports hold a node, but for nodes
            that the surface is known to drag along these.
        springs: Stiffness of each motion's spring, ``shape=(m,)``, force per length.
        moved: The motions, ``shape=(m,)``, length units, the same on all ranks.
        plain: Whether all surfaces are planes that do not turn.
        pressing: Which motions the normal reactions resist most, ``shape=(m,)``.
    """

    def __init__(self, body: ElasticBody, contacts: Sequence[Contact]):
        self._body, self._contacts = body, contacts
        self.surfaces = surfaces_of(c for c in contacts if c.surface.motions)
        self._home = [surface.displacement for surface in self.surfaces]
        self._motions = [surface.motions for surface in self.surfaces]
        ends = np.cumsum([0] + [len(motions) for motions in self._motions])
        self.parts = [slice(a, b) for a, b in zip(ends, ends[1:])]
        self.count, self.moved = int(ends[-1]), np.zeros(ends[-1])
        self.plain = not any(surface.curved or surface.spins for surface in self.surfaces)
        self.axes = [self._axes(contact) for contact in contacts]
        self._lengths = np.ones(self.count) if self.plain else self._scaled()
        motions = [motion for motions in self._motions for motion in motions]
        self.springs = np.array([motion.spring for motion in motions]) / self._lengths**2
        self.names = [motion.name for motion in motions]
        self.turns = np.array([motion.turns for motion in motions])
        self.pressing = np.array([name == "n" for name in self.names])
        if not self.plain:
            self.pressing = self._resisted()

    def _axes(self, contact: Contact) -> np.ndarray:
        points, surface = contact.points, contact.surface
        axes = np.zeros((points.count, points.dim, self.count))
        for one, part, motions in zip(self.surfaces, self.parts, self._motions):
            if one is surface:
                for k, motion in enumerate(motions, start=part.start):
                    axes[:, :, k] = contact.carried_by(motion.axis, motion.turns)
        whole = axes[:, :-1].copy()
        points.without_held(axes[:, :-1])
        if contact.dragged is not None:
            rows = contact.dragged.any(axis=1)
            axes[rows, :-1] = whole[rows]
        axes[points.closed] = 0.0
        return axes

    def _scaled(self) -> np.ndarray:
        """Give rotations the dimension of displacements: the largest lever arm of each, or one.  Collective."""
        lengths = np.ones(self.count)
        for k, motion in enumerate(motion for motions in self._motions for motion in motions):
            if motion.turns:
                arms = [np.linalg.norm(axes[:, :, k], axis=1) for axes in self.axes]
                lengths[k] = self._body.largest(np.concatenate(arms)) or 1.0
        for axes in self.axes:
            axes /= lengths
        return lengths

    def _resisted(self) -> np.ndarray:
        """Motions more along normals than across; without friction all that are along normals at all.  Collective."""
        sums = np.zeros((2, self.count))
        for contact, axes in zip(self._contacts, self.axes):
            squares = np.einsum("n,nij->ij", self._loaded(contact), axes**2)
            sums += squares[-1], squares[:-1].sum(axis=0)
        along, across = self._body.total(sums)
        smooth = np.zeros(self.count, dtype=bool)
        for (_, rough), part in zip(self.rough(), self.parts):
            smooth[part] = not rough
        self._loose = smooth & (along <= RESISTING**2 * (along + across)) & (self.springs == 0.0)
        return (along > across) | (smooth & ~self._loose)

    def _loaded(self, contact: Contact) -> np.ndarray:
        """Normal reactions of the last step; where there are none, one at the nodes that were nearest.  Collective."""
        pressing = contact.last.reaction[:, -1]
        if self._body.largest(pressing) > 0.0:
            return pressing
        nearest = -self._body.highest(-contact.last.gap)
        return (contact.last.gap <= nearest + NEAR * self._body.extent).astype(float)

    def check(self) -> None:
        """Raise a ``ValueError`` on all ranks if nothing would hold a surface that force drives.  Collective."""
        if self.plain:
            self._loose = ~self.pressing & (self.springs == 0.0)
            for (_, rough), part in zip(self.rough() if self._loose.any() else (), self.parts):
                self._loose[part] &= not rough
        if self._loose.any():
            name = self.names[int(np.argmax(self._loose))]
            raise ValueError(
                f"surface.free has {name!r}, along or about which nothing holds the plane: there is no friction. Give it "
                "surface.stiffness, or prescribe its motion."
            )
        if self.springs.any():
            self._check_springs()
        pulled = None if self.plain else self._pulled()
        if pulled is not None:
            raise ValueError(
                f"surface.force does not press {pulled} on the body: it pulls the surface off, and nothing else holds it. It "
                "is the force of the surface on the body; a spring, surface.stiffness, also pulls."
            )

    def _check_springs(self) -> None:
        """Raise a ``ValueError`` on all ranks for springs whose force double precision does not resolve.  Collective."""
        sums = np.zeros(self.count)
        for contact, axes in zip(self._contacts, self.axes):
            sums += np.einsum("n,nim->m", contact.rho, axes**2)
        nodes = self._body.total(sums)
        too_stiff = (self.springs > STIFFEST * nodes) & (nodes > 0.0)
        if too_stiff.any():
            k = int(np.argmax(too_stiff))
            scale = self._lengths[k] ** 2
            raise ValueError(
                f"surface.stiffness has {self.springs[k] * scale:.3g} for {self.names[k]!r}, {self.springs[k] / nodes[k]:.1g} times as stiff "
                f"as the contact nodes together: rounding of its force would hide theirs. That is a support: leave {self.names[k]!r} out "
                f"of surface.free and prescribe the motion, or take a spring of at most {1e-3 * STIFFEST * nodes[k] * scale:.0e}."
            )

    def _pulled(self):
        """A curved surface that its force pulls off the body, None if there is none.  Collective."""
        driving = self.driving()
        for surface, part in zip(self.surfaces, self.parts):
            for k in range(part.start, part.stop) if surface.curved else ():
                if self.pressing[k] and not self.turns[k] and self.springs[k] == 0.0 != driving[k]:
                    ways = [np.sign(driving[k]) * axes[:, -1, k] for axes in self.axes]
                    if self._body.highest(np.concatenate(ways)) <= 0.0:
                        return surface
        return None

    # -- motions -------------------------------------------------------------------------------

    def move_to(self, moved: np.ndarray) -> None:
        """Move the planes by these lengths along their free axes from where they stood at first."""
        self.moved = moved
        for surface, home, part, motions in zip(
            self.surfaces, self._home, self.parts, self._motions
        ):
            ways = moved[part] / self._lengths[part]
            turned = [way * motion.axis for way, motion in zip(ways, motions) if motion.turns]
            along = [motion.axis for motion in motions if not motion.turns]
            if turned:
                surface.spin_by(np.sum(turned, axis=0))
            if along:
                surface.displacement = home + ways[len(turned) :] @ np.array(along)

    def moved_with(self, others: DrivenSurfaces) -> None:
        """Take over where others, made for the same planes where these had moved them, have them now."""
        self.move_to(np.where(self.turns, 0.0, self.moved) + others.moved)

    def touch(self, x: np.ndarray, near: float | None = None) -> bool:
        """Move planes that no node touches at a displacement to where one node alone would carry the force.  Collective.

        From further away nothing tells how the forces on the plane change with its motion.

        Args:
            x: Displacement of owned degrees of freedom.
            near: If given, planes further away than that are moved to the first node, others stay.

        Returns:
            Whether any was moved.
        """
        driving, touched = self.driving(), False
        for motion in np.flatnonzero(self.pressing & ~self.turns):
            sign = -1.0 if driving[motion] < 0.0 else 1.0
            ways = [np.full((2, 1), np.inf)]  # to the first node; to where it carries the force
            for contact, axes in zip(self._contacts, self.axes):
                contact.move(x)
                # By less than rounding none touches: on one node alone a plane that may tilt has no equilibrium.
                touching = np.abs(contact.present.gap) <= contact.gap_rounding(x)
                gap, rate = np.where(touching, 0.0, contact.present.gap), sign * axes[:, -1, motion]
                push = 0.0 if near is not None else sign * driving[motion] / contact.rho
                ways.append(np.array([gap, gap + push])[:, rate > 0] / rate[rate > 0])
            first, far = np.concatenate(ways, axis=1).min(axis=1)
            first, far = (self._body.comm.allreduce(float(way), op=MPI.MIN) for way in (first, far))
            away = 0.0 <= first if near is None else near < first
            if driving[motion] != 0.0 and away and first < np.inf:
                self.move_to(self.moved + sign * far * np.eye(self.count)[motion])
                touched = True
        return touched

    def at_rest(self, softest: float = 0.0) -> np.ndarray:
        """The motions at which springs hold the planes without reactions.

        Args:
            softest: Planes whose springs are no stiffer than that, force per length, stay where they are.
        """
        springs, stretch = self.springs, np.zeros(self.count)
        return self.moved + np.divide(self.driving(), springs, stretch, where=springs > softest)

    @property
    def can_rest(self) -> bool:
        """Whether no plane needs reactions along its normal."""
        return bool((self.springs[self.pressing] > 0).all())

    # -- forces --------------------------------------------------------------------------------

    def driving(self) -> np.ndarray:
        """Sum of the reactions that the present motions ask for, ``F + k (drive - c)``, ``shape=(m,)``."""
        both = zip(self.surfaces, self._motions)
        return (
            np.concatenate([surface.driver.pulled_by(motions) for surface, motions in both])
            / self._lengths
        )

    def left(self) -> tuple[np.ndarray, np.ndarray]:
        """Forces out of balance, reactions minus what drives, and the size of their terms, ``shape=(m,)``.  Collective."""
        sums = np.zeros((2, self.count))
        for contact, axes in zip(self._contacts, self.axes):
            sums[0] += np.tensordot(contact.reaction, axes, 2)
            sums[1] += np.tensordot(np.abs(contact.reaction), np.abs(axes), 2)
        total, size = self._body.total(sums)
        both = zip(self.surfaces, self._motions)
        terms = np.concatenate(
            [surface.driver.pulled_by(motions, True) for surface, motions in both]
        )
        return total - self.driving(), size + terms / self._lengths

    def tangent(self, derivatives: Sequence[tuple]) -> np.ndarray:
        """Derivative of the forces out of balance by the motions, ``k - D^T R_w D``, ``shape=(m, m)``.  Collective.

        Args:
            derivatives: As ``LoadStep.derivatives`` returns them.
        """
        sums = np.zeros((2, self.count, self.count))
        for contact, axes, (_, by_motion) in zip(self._contacts, self.axes, derivatives):
            sums[0] -= np.tensordot(axes, by_motion @ axes, ((0, 1), (0, 1)))
            sums[1] += np.tensordot(axes, contact.rho[:, None, None] * axes, ((0, 1), (0, 1)))
        stiffness, most = self._body.total(sums)
        return np.diag(self.springs) + stiffness + REGULAR * most

    def columns(self, blocks: np.ndarray | None = None) -> np.ndarray:
        """Forces on owned degrees of freedom, ``B^T S D``, ``shape=(owned dofs, m)``.

        Args:
            blocks: ``S`` of each contact, ``shape=(n, gdim)``; None is one everywhere.
        """
        columns = np.zeros((self.count, self._body.size))
        for k, (contact, axes) in enumerate(zip(self._contacts, self.axes)):
            weighted = axes if blocks is None else blocks[k][:, :, None] * axes
            for column, along in zip(columns, np.moveaxis(weighted, 2, 0)):
                contact.points.add_forces(along, column)
        columns[:, self._body.fixed] = 0.0
        return columns.T

    def balance(self, x: np.ndarray, maps: Sequence[NodalMap], asked: Callable) -> None:
        """Move the planes until the reactions that maps make are in balance, as far as they can.  Collective.

        Args:
            x: Displacement of owned degrees of freedom.
            maps: Of the contacts, see ``law/maps.py``.
            asked: Function that yields the contacts, each with the reactions that the body asks for.
        """
        SurfaceBalance(self, self._body, x, maps, asked).reach()

    def rough(self) -> list[tuple]:
        """The planes, and whether there is friction on each.  Collective."""
        known = []
        for surface in self.surfaces:
            laws = [c.friction.mu.ravel() for c in self._contacts if c.surface is surface]
            known.append((surface, self._body.largest(np.concatenate(laws)) > 0.0))
        return known

    def beyond(self, given: bool = False) -> str:
        """Which plane is pushed by more than can be carried, in words; none is the empty string.  Collective.

        Args:
            given: Ask before anything is known but the forces that are given, not by the present normal reactions.
        """
        return slides_away(self, self._body, self._contacts, given)
