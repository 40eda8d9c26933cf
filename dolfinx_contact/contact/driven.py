# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Planes driven by force: their motions are unknowns, each with the equilibrium of forces on its plane as equation.

Of all planes together there are ``m`` free motions ``c``, lengths along free axes.  A node at ``B u`` moves relative to
its plane by ``B u - D c``, local components, and planes are in equilibrium where ``D^T r = F + k (drive - c)``.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from dolfinx_contact.collective import raised_together
from dolfinx_contact.contact.plane_balance import PlaneBalance

# Part of the nodes' stiffness that is added to the tangent of planes: where all nodes slip it has none of its own.
REGULAR = 1e-10

# Part of what friction carries that has to be left: where all is used, how far the plane slides is not determined.
MARGIN = 1e-9


def driven_planes(body, contacts) -> DrivenPlanes | None:
    """The planes that force drives, None where there are none."""
    return DrivenPlanes(body, contacts) if any(c.plane.free for c in contacts) else None


def freedom(contacts) -> list[tuple]:
    """Free directions and springs of each contact's plane, which what solvers set up depends on."""
    return [(contact.plane.free, contact.plane.springs.tolist()) for contact in contacts]


def check_driven(body, contacts) -> None:
    """Raise a ``ValueError`` on all ranks if nothing would hold a plane that force drives.  Collective."""
    with raised_together(body.comm):
        for contact in contacts:
            contact.plane.check_drive()
    planes = driven_planes(body, contacts)
    for plane, rough in [] if planes is None else planes.rough():
        loose = [name for name, k in zip(plane.free, plane.springs) if name != "n" and k == 0]
        if loose and not rough:
            raise ValueError(
                f"plane.free has {loose[0]!r}, along which nothing holds the plane: there is no friction. Give it "
                "plane.stiffness, or prescribe its displacement."
            )


class DrivenPlanes:
    """The planes of some contacts that force drives, and their free motions from where they stand at first.

    Args:
        body: The body, for sums over ranks.
        contacts: Its contacts; several may have the same plane.

    Attributes:
        count: Number ``m`` of free motions.
        axes: ``D`` of each contact, ``shape=(n, gdim, m)``, zero for directions in which supports hold a node.
        springs: Stiffness of each motion's spring, ``shape=(m,)``, force per length.
        moved: The motions, ``shape=(m,)``, length units, the same on all ranks.
    """

    def __init__(self, body, contacts):
        self._body, self._contacts = body, contacts
        self._planes = list({id(c.plane): c.plane for c in contacts if c.plane.free}.values())
        self._home = [plane.displacement for plane in self._planes]
        ends = np.cumsum([0] + [len(plane.free) for plane in self._planes])
        self._parts = [slice(a, b) for a, b in zip(ends, ends[1:])]
        self.count, self.moved = int(ends[-1]), np.zeros(ends[-1])
        self.springs = np.concatenate([plane.springs for plane in self._planes])
        self.axes = [self._axes(contact) for contact in contacts]

    def _axes(self, contact) -> np.ndarray:
        points, plane = contact.points, contact.plane
        axes = np.zeros((points.count, points.dim, self.count))
        for one, part in zip(self._planes, self._parts):
            if one is plane:
                rows = [plane.directions.index(name) for name in plane.free]
                axes[:, rows, range(part.start, part.stop)] = 1.0
        axes[:, :-1][points.held] = 0.0
        axes[points.closed] = 0.0
        return axes

    # -- motions -------------------------------------------------------------------------------

    def move_to(self, moved: np.ndarray) -> None:
        """Move the planes by these lengths along their free axes from where they stood at first."""
        self.moved = moved
        for plane, home, part in zip(self._planes, self._home, self._parts):
            plane.displacement = home + moved[part] @ plane.free_axes

    def touch(self, x: np.ndarray) -> None:
        """Move planes that no node touches at a displacement to where one node alone would carry the force.  Collective.

        From further away nothing tells how the forces on the plane change with its motion.
        """
        driving = self.driving()
        for motion in self.normal_motions:
            ways = [np.full((2, 1), np.inf)]  # to the first node; to where it carries the force
            for contact, axes in zip(self._contacts, self.axes):
                contact.move(x)
                gap = np.array([contact.gap, contact.gap + driving[motion] / contact.rho])
                ways.append(gap[:, axes[:, -1, motion] > 0])
            first, far = np.concatenate(ways, axis=1).min(axis=1)
            first, far = (self._body.comm.allreduce(float(way), op=MPI.MIN) for way in (first, far))
            if driving[motion] > 0.0 <= first < np.inf:
                self.move_to(self.moved + far * np.eye(self.count)[motion])

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
        return all(p.free[-1] != "n" or p.springs[-1] > 0 for p in self._planes)

    # -- forces --------------------------------------------------------------------------------

    def driving(self) -> np.ndarray:
        """Sum of the reactions that the present motions ask for, ``F + k (drive - c)``, ``shape=(m,)``."""
        return np.concatenate(
            [
                plane.free_axes @ _force(plane)
                + plane.springs * (plane.free_axes @ (plane.drive - plane.displacement))
                for plane in self._planes
            ]
        )

    def left(self) -> tuple[np.ndarray, np.ndarray]:
        """Forces out of balance, reactions minus what drives, and the size of their terms, ``shape=(m,)``.  Collective."""
        sums = np.zeros((2, self.count))
        for contact, axes in zip(self._contacts, self.axes):
            sums[0] += np.tensordot(contact.reaction, axes, 2)
            sums[1] += np.tensordot(np.abs(contact.reaction), axes, 2)
        total, size = self._body.total(sums)
        terms = [
            np.abs(plane.free_axes) @ np.abs(_force(plane))
            + plane.springs * (np.abs(plane.free_axes) @ (np.abs(plane.drive) + np.abs(plane.displacement)))
            for plane in self._planes
        ]  # fmt: skip
        return total - self.driving(), size + np.concatenate(terms)

    def tangent(self, derivatives) -> np.ndarray:
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

    def columns(self, blocks=None) -> np.ndarray:
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

    def balance(self, x: np.ndarray, maps, asked) -> None:
        """Move the planes until the reactions that maps make are in balance, as far as they can.  Collective.

        Args:
            x: Displacement of owned degrees of freedom.
            maps: Of the contacts, see ``maps.py``.
            asked: Function that yields the contacts, each with the reactions that the body asks for.
        """
        PlaneBalance(self, self._body, x, maps, asked).reach()

    @property
    def normal_motions(self) -> list[int]:
        """The motions along normals."""
        both = zip(self._planes, self._parts)
        return [part.stop - 1 for plane, part in both if plane.free[-1] == "n"]

    def rough(self) -> list[tuple]:
        """The planes, and whether there is friction on each.  Collective."""
        known = []
        for plane in self._planes:
            laws = [c.friction.mu.ravel() for c in self._contacts if c.plane is plane]
            known.append((plane, self._body.largest(np.concatenate(laws)) > 0.0))
        return known

    # -- sliding -------------------------------------------------------------------------------

    def beyond(self, given: bool = False) -> str:
        """Which plane is pushed by more than friction can carry, in words; none is the empty string.  Collective.

        Args:
            given: Ask before anything is known but the forces that are given, not by the present normal reactions.
        """
        driving = self.driving()
        for plane, part in zip(self._planes, self._parts):
            along = np.array([name != "n" for name in plane.free])
            if not along.any() or plane.springs[along].any():
                continue
            most = self._most(plane, given)
            pushed = float(np.linalg.norm(driving[part][along]))
            if pushed > most * (1 - MARGIN if given else 1):
                return (
                    f"plane.force pushes {plane} along it by {pushed:.6g}, and friction carries {most:.6g} at most: the "
                    "plane slides away, no static state exists"
                )
        return ""

    def _most(self, plane, given: bool) -> float:
        """What friction on a plane carries at most; infinite where that is not known yet."""
        contacts = [contact for contact in self._contacts if contact.plane is plane]
        if given:
            largest = self._body.largest(np.concatenate([c.friction.mu.ravel() for c in contacts]))
            known = plane.free[-1] == "n" and plane.springs[-1] == 0
            return largest * float(_force(plane) @ plane.frame[-1]) if known else np.inf
        carried = [(c.friction.mu.max(axis=-1) * c.reaction[:, -1]).sum() for c in contacts]
        return float(self._body.total([sum(carried)])[0])


def _force(plane) -> np.ndarray:
    return np.zeros(plane.point.size) if plane.force is None else plane.force
