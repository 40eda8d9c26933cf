# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Newton's method for the equilibrium of force-driven surfaces at a given body displacement."""

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

# Maximum numbers of Newton steps, and of lengths tried in the line search along one step.
NEWTON_STEPS = 30
LENGTHS_TRIED = 40

# Residual of converged motions over the sum of magnitudes of its terms: rounding.
BALANCE_ROUNDING = 16 * np.finfo(float).eps

# Fraction of the residual that a Newton step may reverse; beyond it, the step is shortened.
REVERSED_PART = 0.1

# Upper bound of a motion in 3-D, over the motion at which the last node starts to slip: directions
# of slip are then parallel to three digits.
TURNING_RATIO = 1e3

# Tangential component of a node's motion above which the node contributes to the bounds of motions.
CARRIED_PART = 0.5

# Fraction of the nodes' stiffness added to tangents as regularisation: they are singular where all
# nodes slip, or too few are in contact.
REGULAR_STIFFNESS = 1e-10


class SurfaceBalance:
    """Equilibrium equations of force-driven surfaces at a fixed displacement of the body.

    The unknowns are the free rigid motions of the surfaces: a few numbers.  One residual evaluation
    costs products at the contact nodes only.

    Args:
        surfaces: The ``DrivenSurfaces``.
        body: The body, for sums over ranks.
        contacts: ``ContactStep`` of each contact.
        x: Displacement, owned degrees of freedom.
        maps: Nodal contact law of each contact, see ``law/maps.py``.
        required: Function of the motions that returns, for each contact, the nodal reactions
            required by equilibrium of the body.
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
        """Return motions ``c``, ``shape=(m,)``, in equilibrium, by Newton's method from a guess.
        Collective.

        Without convergence, the last iterate is returned.
        """
        surfaces, limits = self._surfaces, None
        if surfaces.plain:
            for motion in np.flatnonzero(surfaces.pressing):
                c = self._balanced_along_normal(c, motion)
        elif surfaces.pressing.any():
            c = self._balanced_along_normals(c)
        left, size = self._residual(c)
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
            c, left, size = self._line_search(c, change, left)
            if np.linalg.norm(left) >= before:
                return c
        return c

    def _contact_terms(self, c: np.ndarray) -> Iterator[tuple]:
        """Yield each contact, its reactions required by the body, its law and columns of ``D``."""
        return zip(self._contacts, self._required(c), self._maps, self._surfaces.axes)

    def _tangent(self, c: np.ndarray) -> np.ndarray:
        found = [
            contact.linearised(self._x, r, map, c)[1]
            for contact, r, map, _ in self._contact_terms(c)
        ]
        return self._surfaces.tangent(self._contacts, found)

    def _residual(self, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return residual forces of the surfaces, and the sums of magnitudes of their terms."""
        nodes = [
            contact.respond(self._x, r, map, c) for contact, r, map, _ in self._contact_terms(c)
        ]
        return self._surfaces.left(nodes, c)

    def _line_search(self, start: np.ndarray, change: np.ndarray, before: np.ndarray) -> tuple:
        """Line search along a Newton step: bisect until the residual decreases without reversing.

        Reactions of slipping nodes do not grow with the motion, so that a full Newton step would go
        far beyond the solution.

        Returns:
            The motions, their residual, and the size of its terms; at ``start`` if no length is
            accepted.
        """
        size_before = np.linalg.norm(before)
        low, high, length = 0.0, 1.0, 1.0
        for _ in range(LENGTHS_TRIED):
            c = start + length * change
            left, size = self._residual(c)
            turned = before @ left < -REVERSED_PART * size_before**2
            if not turned and np.linalg.norm(left) < size_before:
                return c, left, size
            if not turned and length == 1.0:
                break
            low, high = (low, length) if turned else (length, high)
            length = (low + high) / 2
        return start, *self._residual(start)

    def _limits(self, c: np.ndarray) -> np.ndarray:
        """Return bounds on tangential motions, beyond which all nodes slip in one direction.
        Collective.

        In three dimensions, directions of slip at the bound are nearly parallel.

        Returns:
            Lower and upper bounds, ``shape=(2, m)``; infinite for motions along normals or with a
            spring.
        """
        surfaces = self._surfaces
        limits = np.full((2, surfaces.count), -np.inf)
        for contact, reaction, map, axes in self._contact_terms(c):
            state = contact.at(self._x, c)
            springs = map.springs(contact.friction, contact.points.dim)[:, :-1]
            pressure = np.maximum(reaction[:, -1] - map.normal * state.gap, 0.0)
            bound = contact.friction.mu.max(axis=-1) * pressure
            carried = np.where(np.abs(axes[:, :-1]) >= CARRIED_PART, axes[:, :-1], 0.0)
            node, row, motion = np.nonzero(carried * (springs * bound[:, None] > 0)[:, :, None])
            rate, way = springs[node, row], carried[node, row, motion]
            middle = (state.slip_increment[node, row] - reaction[node, row] / rate) / way
            # In three dimensions, slip directions approach the motion's direction only gradually.
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

    def _balanced_along_normal(self, c: np.ndarray, motion: int) -> np.ndarray:
        """Return motions with one plane moved along its normal into equilibrium.

        The reactions are the predictors ``max(r_n - rho x_n, 0)``.  Their sum is a convex,
        piecewise linear function of the motion, so that Newton's method converges to the unique
        solution.
        """
        surfaces, total = self._surfaces, self._body.total
        parts = [np.zeros((2, 0))]
        for contact, reaction, map, axes in self._contact_terms(c):
            pressure = reaction[:, -1] - map.normal * contact.at(self._x, c).gap
            parts.append(np.array([pressure, map.normal])[:, axes[:, -1, motion] > 0])
        at_first, rho = np.concatenate(parts, axis=1)
        spring, target, moved = surfaces.springs[motion], surfaces.driving(c)[motion], 0.0
        for _ in range(NEWTON_STEPS):
            pressure = np.maximum(at_first + rho * moved, 0.0)
            force, slope = total([pressure.sum(), rho[pressure > 0].sum()])
            if slope + spring == 0.0:  # no contact: move until one node alone would carry the force
                alone = ((target - at_first) / rho).min(initial=np.inf)
                moved = self._body.comm.allreduce(float(alone), op=MPI.MIN)
                continue
            left = force + spring * moved - target
            if abs(left) <= BALANCE_ROUNDING * (force + abs(target) + spring * abs(moved)):
                break
            moved -= left / (slope + spring)
        return c + moved * np.eye(surfaces.count)[motion]

    def _balanced_along_normals(self, c: np.ndarray) -> np.ndarray:
        """Return motions in equilibrium along all directions that normal reactions resist.

        The reactions are the predictors ``max(r_n - rho x_n, 0)``: the gradient of a convex energy,
        of springs ``rho`` in compression.  Newton's method minimises this energy, with a line
        search.
        """
        surfaces, total = self._surfaces, self._body.total
        which = np.flatnonzero(surfaces.pressing)
        parts, columns = [np.zeros((2, 0))], [np.zeros((0, which.size))]
        for contact, reaction, map, axes in self._contact_terms(c):
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
