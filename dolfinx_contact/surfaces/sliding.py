# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Surfaces that are pushed by more than reactions can carry: there is no static state."""

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

# Part of a motion that is not named.
NEGLIGIBLE_PART = 1e-6

# Part of what friction carries that has to be left: where all is used, how far the plane slides is not determined.
FRICTION_MARGIN = 1e-9


def slides_away(
    surfaces: DrivenSurfaces,
    body: ElasticBody,
    contacts: Sequence[ContactStep],
    nodes: Sequence[State],
    c: np.ndarray,
    given: bool,
) -> str:
    """Which of the ``DrivenSurfaces`` slides away, tips or spins, in words; none is the empty string.  Collective.

    Args:
        nodes: States of the contacts.
        c: Motions of surfaces.
        given: Ask before anything is known but the forces that are given, not by the normal reactions.
    """
    driving = surfaces.driving(c)
    for surface, part in zip(surfaces.surfaces, surfaces.parts):
        moved = [
            (contact, state.reaction[:, -1], axes[:, :, part])
            for contact, state, axes in zip(contacts, nodes, surfaces.axes)
            if contact.surface is surface
        ]
        one = _Driven(surface, surfaces, part, driving[part], moved, body)
        message = "" if surface.curved else one.slides(given) or one.tips()
        if not message and not given:
            message = one.spins()
        if message:
            return message
    return ""


def lost_far_away(step: LoadStep, state: StepState, acts: bool) -> bool:
    """Whether body or planes are so far away that rounding hides the loads on them: no state is one then.  Collective.

    Args:
        step: The step.
        state: Whose rounding is as large as the forces that act, roughly.
        acts: Whether some act above rounding.
    """
    loads, moved, surfaces = [], np.zeros(0), step.surfaces
    if step.statics is not None:
        loads.append(step.statics.loads)
    if surfaces is not None:  # of springs the force would be as large as the way is far
        loads.append(surfaces.driving(state.c)[surfaces.springs == 0.0])
        moved = np.abs(state.c)
    if not any(load.any() for load in loads):
        return False
    return not acts or max(step.body.farthest(state.x), moved.max(initial=0.0)) > step.body.extent


def nothing_holds(contacts: Sequence[ContactStep]) -> str:
    """Whether every plane that touches a body without supports moves along its normal under a dead load, in words."""
    surfaces = [contact.surface for contact in contacts]
    if any(
        not any(m.name == "n" and m.spring == 0 for m in surface.motions) for surface in surfaces
    ):
        return ""
    return (
        "No condition holds the body along the normal, and force moves every plane that it touches along its own: together "
        "they fly away, or stand anywhere. Hold the body, or a plane: leave 'n' out of its surface.free"
    )


class _Driven:
    """One surface, its motions ``part`` of all, and the contacts on it with their normal reactions and columns of ``D``."""

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
        """Whether a plane is pushed along itself by more than friction carries."""
        along = ~self._turns & np.array([name != "n" for name in self._names])
        motions = np.flatnonzero(along & (self._springs == 0.0))
        if not motions.size or (given and self._weight() == np.inf):
            return ""
        limit = _Limit(self._contacts, motions, self._body, self._weight() if given else None)
        way, pushed, most = limit.weakest(self._driving[motions])
        if pushed > most * (1 - FRICTION_MARGIN if given else 1):
            direction = way @ np.array([m.axis for m in self._surface.motions])[motions]
            direction = (direction.round(6) + 0.0).tolist()
            known = "with the normal forces found: the plane slides away"
            if given:
                known = "at most: the plane slides away, no static state exists"
            return f"surface.force pushes {self._surface} along {direction} by {pushed:.6g}, and friction carries {most:.6g} along it {known}"
        return ""

    def _weight(self) -> float:
        """The force along the normal, if it is given: infinite otherwise."""
        known = self._names[-1] == "n" and self._springs[-1] == 0
        return float(self._driving[-1]) if known else np.inf

    def tips(self) -> str:
        """Whether moment and weight ask for a centre of pressure beyond the nodes of a plane."""
        weight = self._weight()
        if not (0.0 < weight < np.inf):
            return ""
        for k in np.flatnonzero(self._turns & (self._springs == 0.0)):
            ends = [np.full((2, 1), -np.inf)]
            for contact, _, axes in self._contacts:
                normal, most = axes[:, -1, k], _radius(contact.friction, axes[:, :-1, k])
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
        """Whether motions that friction alone resists are driven by more than it carries with the present normals."""
        free = ~self._pressing & (self._springs == 0.0)
        motions = np.flatnonzero(free & (self._turns | self._surface.curved))
        if not motions.size:
            return ""
        limit = _Limit(self._contacts, motions, self._body)
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


def _radius(friction: Friction, slip: np.ndarray) -> np.ndarray:
    """``|M v|`` of nodes that move along their surfaces by ``v``, local components, ``shape=(n,)``."""
    return np.linalg.norm(friction.mu[..., : slip.shape[1]] * friction.along_axes(slip), axis=1)


class _Limit:
    """What friction carries against motions of a surface, at most, whatever the nodes' friction within the cone.

    Against a virtual motion ``c`` node i works ``r_n |M D_t c|`` at most, the support function of its ellipse: forces ``F`` that are in balance
    have ``F . c <= sum r_n |M D_t c|`` for every ``c``.

    Args:
        contacts: With their normal reactions and columns of ``D``.
        motions: Columns that are asked for, ``shape=(k,)``.
        body: For sums over ranks.
        weight: Sum of normal reactions, of which no node is known; None takes those given.
    """

    def __init__(
        self,
        contacts: Sequence[tuple[ContactStep, np.ndarray, np.ndarray]],
        motions: np.ndarray,
        body: ElasticBody,
        weight: float | None = None,
    ):
        self._body, self._weight = body, weight
        self._parts = [(c.friction, pressed, D[:, :, motions]) for c, pressed, D in contacts]
        laws = [friction for friction, _, _ in self._parts]
        alike = all(law.frictionless or law.isotropic for law in laws)
        self._plain = (
            alike
            and motions.size <= 2
            and not any(c.surface.curved or c.surface.spins for c, _, _ in contacts)
        )

    def by_normals(self) -> np.ndarray:
        """What the normal reactions carry of each motion, ``shape=(k,)``.  Collective."""
        return self._body.total(sum(normal @ axes[:, -1] for _, normal, axes in self._parts))

    def carried(self, way: np.ndarray) -> float:
        """The most frictional work against a motion, per length.  Collective."""
        most = [np.zeros(1)]
        for friction, normal, axes in self._parts:
            slip = axes[:, :-1] @ way
            radius = _radius(friction, slip)
            most.append(radius if self._weight is not None else np.maximum(normal, 0.0) * radius)
        if self._weight is not None:
            return self._weight * self._body.largest(np.concatenate(most))
        return float(self._body.total([np.concatenate(most).sum()])[0])

    def weakest(self, force: np.ndarray) -> tuple[np.ndarray, float, float]:
        """The motion against which the least is carried of what drives it, a unit vector, and both sizes.  Collective."""
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
