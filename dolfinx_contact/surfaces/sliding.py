# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Limit analysis of force-driven surfaces: detect loads beyond any static equilibrium."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State
    from dolfinx_contact.law.friction import Friction
    from dolfinx_contact.step.load_step import LoadStep, StepState
    from dolfinx_contact.surfaces.driven import DrivenSurfaces
    from dolfinx_contact.surfaces.surface import Surface

# Components of a motion below this fraction of the largest one are left out of messages.
NEGLIGIBLE_PART = 1e-6

# Fraction of the friction limit that must remain unused: at the limit, the sliding distance is
# undetermined.
FRICTION_MARGIN = 1e-9


def slides_away(
    surfaces: DrivenSurfaces,
    body: ElasticBody,
    contacts: Sequence[ContactStep],
    nodes: Sequence[State],
    c: np.ndarray,
    given: bool,
) -> str:
    """Describe the first surface that slides away, tips over or spins; otherwise return "".
    Collective.

    Args:
        surfaces: The ``DrivenSurfaces``.
        body: The body, for sums over ranks.
        contacts: ``ContactStep`` of each contact.
        nodes: State of each contact.
        c: Motions of the surfaces, ``shape=(m,)``.
        given: Use the prescribed forces alone, before the step, not the computed normal reactions.
    """
    driving = surfaces.driving(c)
    for surface, part in zip(surfaces.surfaces, surfaces.parts):
        moved = [
            (contact, state.reaction[:, -1], axes[:, :, part])
            for contact, state, axes in zip(contacts, nodes, surfaces.axes)
            if contact.surface is surface
        ]
        one = _DrivenSurface(surface, surfaces, part, driving[part], moved, body)
        message = "" if surface.curved else one.slides(given) or one.tips()
        if not message and not given:
            message = one.spins()
        if message:
            return message
    return ""


def lost_far_away(step: LoadStep, state: StepState, acts: bool) -> bool:
    """Whether the body or a surface is so far away that rounding hides the loads on it.
    Collective.

    Such a state must not be accepted as a solution.

    Args:
        step: The load step.
        state: A state whose rounding errors are about as large as its forces.
        acts: Whether some forces exceed rounding.
    """
    loads, moved, surfaces = [], np.zeros(0), step.surfaces
    if step.statics is not None:
        loads.append(step.statics.loads)
    if surfaces is not None:  # without springs, whose force grows with the distance
        loads.append(surfaces.driving(state.c)[surfaces.springs == 0.0])
        moved = np.abs(state.c)
    if not any(load.any() for load in loads):
        return False
    return not acts or max(step.body.farthest(state.x), moved.max(initial=0.0)) > step.body.extent


def nothing_holds(contacts: Sequence[ContactStep]) -> str:
    """Return a message if every plane is free along its normal under a dead load; otherwise "".

    A body without supports is then in no static equilibrium.
    """
    surfaces = [contact.surface for contact in contacts]
    if any(
        not any(m.name == "n" and m.spring == 0 for m in surface.motions) for surface in surfaces
    ):
        return ""
    return (
        "No condition holds the body along the normal, and force moves every plane that it touches along its own: together "
        "they fly away, or stand anywhere. Hold the body, or a plane: leave 'n' out of its surface.free"
    )


class _DrivenSurface:
    """Limit analysis of one force-driven surface.

    Args:
        surface: The surface.
        surfaces: The ``DrivenSurfaces`` that contain it.
        part: Slice of the surface's motions among all motions.
        driving: Prescribed force along each of these motions.
        contacts: Contacts on the surface, each with its normal reactions and its columns of ``D``.
        body: The body, for sums over ranks.
    """

    def __init__(
        self,
        surface: Surface,
        surfaces: DrivenSurfaces,
        part: Any,
        driving: Any,
        contacts: Sequence[tuple[ContactStep, np.ndarray, np.ndarray]],
        body: ElasticBody,
    ):
        self._surface, self._driving, self._contacts, self._body = surface, driving, contacts, body
        self._springs, self._turns = surfaces.springs[part], surfaces.turns[part]
        self._names, self._pressing = surfaces.names[part], surfaces.pressing[part]

    def slides(self, given: bool) -> str:
        """Return a message if tangential forces on the plane exceed friction, otherwise "".
        Collective.
        """
        along = ~self._turns & np.array([name != "n" for name in self._names])
        motions = np.flatnonzero(along & (self._springs == 0.0))
        if not motions.size or (given and self._normal_load() == np.inf):
            return ""
        limit = _FrictionLimit(
            self._contacts, motions, self._body, self._normal_load() if given else None
        )
        way, pushed, most = limit.weakest(self._driving[motions])
        if pushed > most * (1 - FRICTION_MARGIN if given else 1):
            direction = way @ np.array([m.axis for m in self._surface.motions])[motions]
            direction = (direction.round(6) + 0.0).tolist()
            known = "with the normal forces found: the plane slides away"
            if given:
                known = "at most: the plane slides away, no static state exists"
            return f"surface.force pushes {self._surface} along {direction} by {pushed:.6g}, and friction carries {most:.6g} along it {known}"
        return ""

    def _normal_load(self) -> float:
        """Prescribed force along the plane's normal; infinite if it is not a dead load."""
        known = self._names[-1] == "n" and self._springs[-1] == 0
        return float(self._driving[-1]) if known else np.inf

    def tips(self) -> str:
        """Return a message if the resultant force is outside the contact nodes, otherwise "".
        Collective.
        """
        weight = self._normal_load()
        if not (0.0 < weight < np.inf):
            return ""
        for k in np.flatnonzero(self._turns & (self._springs == 0.0)):
            ends = [np.full((2, 1), -np.inf)]
            for contact, _, axes in self._contacts:
                normal, most = axes[:, -1, k], _friction_work(contact.friction, axes[:, :-1, k])
                ends.append(np.array([-(normal - most), normal + most]))
            low, high = np.concatenate(ends, axis=1).max(axis=1)
            low, high = (self._body.comm.allreduce(float(end), op=MPI.MAX) for end in (low, high))
            asked = self._driving[k] / weight
            room = FRICTION_MARGIN * (low + high)
            if not -low + room <= asked <= high - room:
                return (
                    f"surface.force and surface.moment turn {self._surface} about {self._names[k]!r} by more than its contact "
                    "nodes can hold, the resultant is beyond the outermost: the plane tips over, no static state exists"
                )
        return ""

    def spins(self) -> str:
        """Return a message if forces on motions resisted by friction alone exceed it, otherwise "".
        Collective.

        The friction limit is computed with the present normal reactions.
        """
        free = ~self._pressing & (self._springs == 0.0)
        motions = np.flatnonzero(free & (self._turns | self._surface.curved))
        if not motions.size:
            return ""
        limit = _FrictionLimit(self._contacts, motions, self._body)
        way, pushed, most = limit.weakest(self._driving[motions] - limit.by_normals())
        if pushed > most:
            names = [
                self._names[k]
                for k, part in zip(motions, way)
                if abs(part) > NEGLIGIBLE_PART * np.abs(way).max()
            ]
            turns = self._turns[motions][np.abs(way).argmax()]
            return (
                f"what drives {self._surface} along or about {' and '.join(map(repr, names))} is "
                f"{pushed / most if most else np.inf:.6g} times what friction carries with the normal forces found: the surface "
                f"{'turns' if turns else 'moves'} away"
            )
        return ""


def _friction_work(friction: Friction, slip: np.ndarray) -> np.ndarray:
    """Frictional work ``|M v|`` per unit normal reaction and unit motion, ``shape=(n,)``.

    Args:
        friction: Friction law of the nodes.
        slip: Slip ``v`` of the nodes by unit motion, ``shape=(n, gdim - 1)``, local frame.
    """
    return np.linalg.norm(friction.mu[..., : slip.shape[1]] * friction.along_axes(slip), axis=1)


class _FrictionLimit:
    """Upper bound of the friction that resists motions of one surface.

    The frictional work of node i against a virtual motion ``c`` is at most ``r_n |M D_t c|``, the
    support function of its friction ellipse.  Forces ``F`` can be in equilibrium only if
    ``F . c <= sum r_n |M D_t c|`` for every ``c``.

    Args:
        contacts: Contacts on the surface, each with its normal reactions and its columns of ``D``.
        motions: Indices of the columns to consider, ``shape=(k,)``.
        body: The body, for sums over ranks.
        weight: Sum of the normal reactions if their distribution is unknown; None means that the
            reactions in ``contacts`` are used.
    """

    def __init__(
        self,
        contacts: Sequence[tuple[ContactStep, np.ndarray, np.ndarray]],
        motions: np.ndarray,
        body: ElasticBody,
        weight: float | None = None,
    ):
        self._body, self._normal_load = body, weight
        self._parts = [(c.friction, pressed, D[:, :, motions]) for c, pressed, D in contacts]
        laws = [friction for friction, _, _ in self._parts]
        alike = all(law.frictionless or law.isotropic for law in laws)
        self._plain = (
            alike
            and motions.size <= 2
            and not any(c.surface.curved or c.surface.spins for c, _, _ in contacts)
        )

    def by_normals(self) -> np.ndarray:
        """Return the force of the normal reactions along each motion, ``shape=(k,)``.
        Collective.
        """
        return self._body.total(sum(normal @ axes[:, -1] for _, normal, axes in self._parts))

    def carried(self, way: np.ndarray) -> float:
        """Return the maximum frictional work against a unit of the motion ``way``.  Collective.

        Args:
            way: Coefficients of the motions, ``shape=(k,)``.
        """
        most = [np.zeros(1)]
        for friction, normal, axes in self._parts:
            slip = axes[:, :-1] @ way
            radius = _friction_work(friction, slip)
            most.append(
                radius if self._normal_load is not None else np.maximum(normal, 0.0) * radius
            )
        if self._normal_load is not None:
            return self._normal_load * self._body.largest(np.concatenate(most))
        return float(self._body.total([np.concatenate(most).sum()])[0])

    def weakest(self, force: np.ndarray) -> tuple[np.ndarray, float, float]:
        """Return the motion with the least ratio of friction limit to driving force.  Collective.

        Args:
            force: Driving force of each motion, ``shape=(k,)``.

        Returns:
            The motion, a unit vector, ``shape=(k,)``; the driving force along it; the friction
            limit.
        """
        size = float(np.linalg.norm(force))
        if size == 0.0:
            return np.eye(force.size)[0], 0.0, np.inf
        along = force / size
        across = np.linalg.svd(along[None])[2][
            1:
        ]  # all motions with along . c = 1 are along + s across
        best = np.zeros(len(across))
        if len(across) and not self._plain:
            from scipy.optimize import minimize

            best = minimize(
                lambda s: self.carried(along + s @ across),
                best,
                method="Powell",
                options={"xtol": 1e-6, "ftol": 1e-9},
            ).x
        way = along + np.atleast_1d(best) @ across
        way /= np.linalg.norm(way)
        return way, float(force @ way), self.carried(way)
