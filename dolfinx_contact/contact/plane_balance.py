# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Where planes go that force drives: until the reactions at a displacement of the body are in balance with the force."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

# Steps of Newton's method, and lengths of one that are tried.
STEPS, LENGTHS = 30, 40

# What may be left of the forces on a plane, over the sum of their magnitudes: rounding.
BALANCED = 16 * np.finfo(float).eps

# Part of what is left that may come back with the other sign.
TURNED = 0.1

# Motion over that with which the last node begins to slip, after which all slip in its direction.
TURNING = 1e3


class PlaneBalance:
    """The equilibrium of planes at a displacement, in their motions alone: a few unknowns, products at contact nodes.

    Args:
        planes: The ``DrivenPlanes``.
        body: The body, for sums over ranks.
        x: Displacement of owned degrees of freedom.
        maps: Of the contacts, see ``maps.py``.
        asked: Function that yields the contacts, each with the reactions that the body asks for.
    """

    def __init__(self, planes, body, x, maps, asked):
        self._planes, self._body, self._x, self._maps, self._asked = planes, body, x, maps, asked

    def reach(self) -> None:
        """Move the planes into equilibrium, or as near as Newton's method comes.  Collective."""
        planes, limits = self._planes, None
        for motion in planes.normal_motions:
            self._press(motion)
        left, size = self._response()
        for _ in range(STEPS):
            if (np.abs(left) <= BALANCED * size).all():
                return
            if limits is None:
                limits = self._limits()
            both = zip(self._asked(), self._maps)
            derivatives = [contact.respond_with_derivatives(self._x, map) for contact, map in both]
            change = np.linalg.solve(planes.tangent(derivatives), -left)
            room = np.where(change > 0, limits[1] - planes.moved, planes.moved - limits[0])
            within = np.divide(room, np.abs(change), np.ones(planes.count), where=change != 0)
            change *= min(max(within.min(), 0.0), 1.0)
            before = np.linalg.norm(left)
            left, size = self._step(change, left)
            if np.linalg.norm(left) >= before:
                return

    def _response(self) -> tuple[np.ndarray, np.ndarray]:
        """What is left of the forces on planes, and the size of its terms."""
        for contact, map in zip(self._asked(), self._maps):
            contact.respond(self._x, map)
        return self._planes.left()

    def _step(self, change: np.ndarray, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Go along a change as far as what is left falls and does not turn round; what is left then.

        Where nodes slip reactions do not grow with the motion, and a whole step would go far beyond the solution.
        """
        start, size_before = self._planes.moved, np.linalg.norm(before)
        low, high, length = 0.0, 1.0, 1.0
        for _ in range(LENGTHS):
            self._planes.move_to(start + length * change)
            left, size = self._response()
            turned = before @ left < -TURNED * size_before**2
            if not turned and np.linalg.norm(left) < size_before:
                return left, size
            if not turned and length == 1.0:
                break
            low, high = (low, length) if turned else (length, high)
            length = (low + high) / 2
        self._planes.move_to(start)
        return self._response()

    def _limits(self) -> np.ndarray:
        """Smallest and largest motions along planes, beyond which all nodes slip (nearly) the same way.  Collective.

        Returns:
            ``shape=(2, m)``, infinite along normals and where a spring holds.
        """
        planes = self._planes
        limits = np.full((2, planes.count), -np.inf)
        for contact, map, axes in zip(self._asked(), self._maps, planes.axes):
            contact.move(self._x)
            springs = map.springs(contact.friction, contact.points.dim)[:, :-1]
            pressure = np.maximum(contact.reaction[:, -1] - map.normal * contact.gap, 0.0)
            bound = contact.friction.mu.max(axis=-1) * pressure
            node, row, motion = np.nonzero(
                axes[:, :-1] * (springs * bound[:, None] > 0)[:, :, None]
            )
            rate = springs[node, row]
            middle = contact.slip_increment[node, row] - contact.reaction[node, row] / rate
            # In three dimensions directions go on turning to that of the motion.
            width = (1.0 if contact.points.dim == 2 else TURNING) * bound[node] / rate
            for side, sign in enumerate((-1, 1)):
                np.maximum.at(limits[side], motion, width + sign * middle)
        self._body.comm.Allreduce(MPI.IN_PLACE, limits, op=MPI.MAX)
        limits[0] *= -1
        limits += planes.moved
        endless = ~np.isfinite(limits).all(axis=0) | (planes.springs > 0)
        limits[:, endless] = np.array([[-np.inf], [np.inf]])
        return limits

    def _press(self, motion: int) -> None:
        """Move a plane along its normal until predictors ``max(r_n - rho x_n, 0)`` are in balance.

        Their sum grows with the motion, piecewise linear and convex: Newton's method comes down to the only solution.
        """
        planes, total = self._planes, self._body.total
        parts = [np.zeros((2, 0))]
        for contact, map, axes in zip(self._asked(), self._maps, planes.axes):
            contact.move(self._x)
            pressure = contact.reaction[:, -1] - map.normal * contact.gap
            parts.append(np.array([pressure, map.normal])[:, axes[:, -1, motion] > 0])
        at_first, rho = np.concatenate(parts, axis=1)
        spring, target, moved = planes.springs[motion], planes.driving()[motion], 0.0
        for _ in range(STEPS):
            pressure = np.maximum(at_first + rho * moved, 0.0)
            force, slope = total([pressure.sum(), rho[pressure > 0].sum()])
            if slope + spring == 0.0:  # nothing touches: as far as one node alone would need
                alone = ((target - at_first) / rho).min(initial=np.inf)
                moved = self._body.comm.allreduce(float(alone), op=MPI.MIN)
                continue
            left = force + spring * moved - target
            if abs(left) <= BALANCED * (force + abs(target) + spring * abs(moved)):
                break
            moved -= left / (slope + spring)
        if moved != 0.0:
            planes.move_to(planes.moved + moved * np.eye(planes.count)[motion])
