# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Where planes go that force drives: until the reactions at a displacement of the body are in balance with the force."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from dolfinx_contact.support.line_search import halves

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.law.maps import NodalMap
    from dolfinx_contact.surfaces.driven import DrivenSurfaces

# Steps of Newton's method, and lengths of one that are tried.
NEWTON_STEPS = 30
LENGTHS_TRIED = 40

# What may be left of the forces on a plane, over the sum of their magnitudes: rounding.
BALANCE_ROUNDING = 16 * np.finfo(float).eps

# Part of what is left that may come back with the other sign.
REVERSED_PART = 0.1

# Motion over that with which the last node begins to slip, after which all slip in its direction.
TURNING_RATIO = 1e3

# Part of a motion that carries a node along its surface; of less the node says nothing about where all slip.
CARRIED_PART = 0.5

# Part of the nodes' stiffness that is added to tangents: where all nodes slip, or too few touch, these have none.
REGULAR_STIFFNESS = 1e-10


class SurfaceBalance:
    """The equilibrium of planes at a displacement, in their motions alone: a few unknowns, products at contact nodes.

    Args:
        surfaces: The ``DrivenSurfaces``.
        body: The body, for sums over ranks.
        contacts: ``ContactStep`` of each contact.
        x: Displacement of owned degrees of freedom.
        maps: Of the contacts, see ``law/maps.py``.
        required: Of motions, the reactions that the body asks of each contact.
    """

    def __init__(
        self,
        surfaces: DrivenSurfaces,
        body: ElasticBody,
        contacts: Sequence[ContactStep],
        x: np.ndarray,
        maps: Sequence[NodalMap],
        required: Callable,
    ):
        self._surfaces, self._body, self._contacts = surfaces, body, contacts
        self._x, self._maps, self._required = x, maps, required

    def reached(self, c: np.ndarray) -> np.ndarray:
        """Motions in equilibrium, or as near as Newton's method comes, from others.  Collective."""
        surfaces, limits = self._surfaces, None
        if surfaces.plain:
            for motion in np.flatnonzero(surfaces.pressing):
                c = self._pressed(c, motion)
        elif surfaces.pressing.any():
            c = self._pressed_together(c)
        left, size = self._left(c)
        for _ in range(NEWTON_STEPS):
            if (np.abs(left) <= BALANCE_ROUNDING * size).all():
                return c
            if limits is None:
                limits = self._limits(c)
            change = np.linalg.solve(self._tangent(c), -left)
            room = np.where(change > 0, limits[1] - c, c - limits[0])
            within = np.divide(room, np.abs(change), np.ones(surfaces.count), where=change != 0)
            change *= min(max(within.min(), 0.0), 1.0)
            before = np.linalg.norm(left)
            c, left, size = self._step(c, change, left)
            if np.linalg.norm(left) >= before:
                return c
        return c

    def _at(self, c: np.ndarray) -> Iterator[tuple]:
        """Each contact with the reactions that the body asks for, its map and its columns."""
        return zip(self._contacts, self._required(c), self._maps, self._surfaces.axes)

    def _tangent(self, c: np.ndarray) -> np.ndarray:
        found = [contact.linearised(self._x, r, map, c)[1] for contact, r, map, _ in self._at(c)]
        return self._surfaces.tangent(self._contacts, found)

    def _left(self, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is left of the forces on planes, and the size of its terms."""
        nodes = [contact.respond(self._x, r, map, c) for contact, r, map, _ in self._at(c)]
        return self._surfaces.left(nodes, c)

    def _step(self, start: np.ndarray, change: np.ndarray, before: np.ndarray) -> tuple:
        """Go along a change as far as what is left falls and does not turn round: motions, and what is left then.

        Where nodes slip reactions do not grow with the motion, and a whole step would go far beyond the solution.
        """
        size_before = np.linalg.norm(before)
        low, high, length = 0.0, 1.0, 1.0
        for _ in range(LENGTHS_TRIED):
            c = start + length * change
            left, size = self._left(c)
            turned = before @ left < -REVERSED_PART * size_before**2
            if not turned and np.linalg.norm(left) < size_before:
                return c, left, size
            if not turned and length == 1.0:
                break
            low, high = (low, length) if turned else (length, high)
            length = (low + high) / 2
        return start, *self._left(start)

    def _limits(self, c: np.ndarray) -> np.ndarray:
        """Smallest and largest motions along planes, beyond which all nodes slip (nearly) the same way.  Collective.

        Returns:
            ``shape=(2, m)``, infinite along normals and where a spring holds.
        """
        surfaces = self._surfaces
        limits = np.full((2, surfaces.count), -np.inf)
        for contact, reaction, map, axes in self._at(c):
            state = contact.at(self._x, c)
            springs = map.springs(contact.friction, contact.points.dim)[:, :-1]
            pressure = np.maximum(reaction[:, -1] - map.normal * state.gap, 0.0)
            bound = contact.friction.mu.max(axis=-1) * pressure
            carried = np.where(np.abs(axes[:, :-1]) >= CARRIED_PART, axes[:, :-1], 0.0)
            node, row, motion = np.nonzero(carried * (springs * bound[:, None] > 0)[:, :, None])
            rate, way = springs[node, row], carried[node, row, motion]
            middle = (state.slip_increment[node, row] - reaction[node, row] / rate) / way
            # In three dimensions directions go on turning to that of the motion.
            width = (
                (1.0 if contact.points.dim == 2 else TURNING_RATIO)
                * bound[node]
                / (rate * abs(way))
            )
            for side, sign in enumerate((-1, 1)):
                np.maximum.at(limits[side], motion, width + sign * middle)
        self._body.comm.Allreduce(MPI.IN_PLACE, limits, op=MPI.MAX)
        limits[0] *= -1
        limits += c
        endless = ~np.isfinite(limits).all(axis=0) | (surfaces.springs > 0) | surfaces.pressing
        limits[:, endless] = np.array([[-np.inf], [np.inf]])
        return limits

    def _pressed(self, c: np.ndarray, motion: int) -> np.ndarray:
        """Motions with a plane along its normal where predictors ``max(r_n - rho x_n, 0)`` are in balance.

        Their sum grows with the motion, piecewise linear and convex: Newton's method comes down to the only solution.
        """
        surfaces, total = self._surfaces, self._body.total
        parts = [np.zeros((2, 0))]
        for contact, reaction, map, axes in self._at(c):
            pressure = reaction[:, -1] - map.normal * contact.at(self._x, c).gap
            parts.append(np.array([pressure, map.normal])[:, axes[:, -1, motion] > 0])
        at_first, rho = np.concatenate(parts, axis=1)
        spring, target, moved = surfaces.springs[motion], surfaces.driving(c)[motion], 0.0
        for _ in range(NEWTON_STEPS):
            pressure = np.maximum(at_first + rho * moved, 0.0)
            force, slope = total([pressure.sum(), rho[pressure > 0].sum()])
            if slope + spring == 0.0:  # nothing touches: as far as one node alone would need
                alone = ((target - at_first) / rho).min(initial=np.inf)
                moved = self._body.comm.allreduce(float(alone), op=MPI.MIN)
                continue
            left = force + spring * moved - target
            if abs(left) <= BALANCE_ROUNDING * (force + abs(target) + spring * abs(moved)):
                break
            moved -= left / (slope + spring)
        return c + moved * np.eye(surfaces.count)[motion]

    def _pressed_together(self, c: np.ndarray) -> np.ndarray:
        """Motions of planes where predictors ``max(r_n - rho x_n, 0)`` are in balance along all that these resist.

        The forces are the gradient of a convex function, the energy of springs ``rho``: Newton's method, in steps along
        which it falls.
        """
        surfaces, total = self._surfaces, self._body.total
        which = np.flatnonzero(surfaces.pressing)
        parts, columns = [np.zeros((2, 0))], [np.zeros((0, which.size))]
        for contact, reaction, map, axes in self._at(c):
            pressure = reaction[:, -1] - map.normal * contact.at(self._x, c).gap
            parts.append(np.array([pressure, map.normal]))
            columns.append(axes[:, -1, which])
        (at_first, rho), D = np.concatenate(parts, axis=1), np.concatenate(columns)
        springs, target, n = surfaces.springs[which], surfaces.driving(c)[which], which.size

        def energy(moved: np.ndarray):
            pressure = np.maximum(at_first + rho * (D @ moved), 0.0)
            stored = float(total([(pressure**2 / (2 * rho)).sum()])[0])
            return stored + moved @ (springs * moved / 2 - target), pressure

        most = total(np.einsum("ni,n,nj->ij", D, rho, D)) + np.diag(springs)
        moved, least = np.zeros(n), energy(np.zeros(n))
        for _ in range(NEWTON_STEPS):
            pressure, active = least[1], rho * (least[1] > 0)
            sums = np.concatenate(
                (pressure @ D, pressure @ np.abs(D), np.einsum("ni,n,nj->ij", D, active, D).ravel())
            )
            force, size, slope = np.split(total(sums), [n, 2 * n])
            left = force + springs * moved - target
            if (
                np.abs(left) <= BALANCE_ROUNDING * (size + np.abs(target) + springs * np.abs(moved))
            ).all():
                break
            slope = slope.reshape(n, n) + np.diag(springs) + REGULAR_STIFFNESS * most
            change = -np.linalg.solve(slope, left)
            for length in halves(2.0 ** (1 - LENGTHS_TRIED)):
                following = energy(moved + length * change)
                if following[0] < least[0]:
                    break
            else:
                break
            moved, least = moved + length * change, following
        whole = np.zeros(surfaces.count)
        whole[which] = moved
        return c + whole
