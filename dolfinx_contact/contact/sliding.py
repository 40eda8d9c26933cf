# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Surfaces that are pushed by more than reactions can carry: there is no static state."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

# Part of what friction carries that has to be left: where all is used, how far the plane slides is not determined.
MARGIN = 1e-9


def slides_away(planes, body, contacts, given: bool) -> str:
    """Which of the ``DrivenPlanes`` slides away, tips or spins, in words; none is the empty string.  Collective.

    Args:
        given: Ask before anything is known but the forces that are given, not by the present normal reactions.
    """
    driving = planes.driving()
    for plane, part in zip(planes.planes, planes.parts):
        of = [(c, axes[:, :, part]) for c, axes in zip(contacts, planes.axes) if c.plane is plane]
        one = _Driven(plane, planes, part, driving[part], of, body)
        said = "" if plane.curved else one.slides(given) or one.tips()
        if not said and not given:
            said = one.spins()
        if said:
            return said
    return ""


def lost_far_away(body, statics, planes, x: np.ndarray, acts: bool) -> bool:
    """Whether body or planes are so far away that rounding hides the loads on them: no state is one then.  Collective.

    Args:
        body: The body.
        statics: Its ``Statics``, None where something holds it.
        planes: The ``DrivenPlanes``, or None.
        x: Displacement, owned degrees of freedom, whose rounding is as large as the forces that act, roughly.
        acts: Whether some act above rounding.
    """
    loads, moved = [], np.zeros(0)
    if statics is not None:
        loads.append(statics.loads)
    if planes is not None:  # of springs the force would be as large as the way is far
        loads.append(planes.driving()[planes.springs == 0.0])
        moved = np.abs(planes.moved)
    if not any(load.any() for load in loads):
        return False
    return not acts or max(body.farthest(x), moved.max(initial=0.0)) > body.extent


def nothing_holds(contacts) -> str:
    """Whether every plane that touches a body without supports moves along its normal under a dead load, in words."""
    planes = [contact.plane for contact in contacts]
    if any(not any(m.name == "n" and m.spring == 0 for m in plane.motions) for plane in planes):
        return ""
    return (
        "No condition holds the body along the normal, and force moves every plane that it touches along its own: together "
        "they fly away, or stand anywhere. Hold the body, or a plane: leave 'n' out of its plane.free"
    )


class _Driven:
    """One surface, its motions ``part`` of all, and the contacts on it with their columns of ``D``."""

    def __init__(self, plane, planes, part, driving, contacts, body):
        self._plane, self._driving, self._contacts, self._body = plane, driving, contacts, body
        self._springs, self._turns = planes.springs[part], planes.turns[part]
        self._names, self._pressing = planes.names[part], planes.pressing[part]

    def slides(self, given: bool) -> str:
        """Whether a plane is pushed along itself by more than friction carries."""
        along = ~self._turns & np.array([name != "n" for name in self._names])
        if not along.any() or self._springs[along].any():
            return ""
        most = self._most(given)
        pushed = float(np.linalg.norm(self._driving[along]))
        if pushed > most * (1 - MARGIN if given else 1):
            return (
                f"plane.force pushes {self._plane} along it by {pushed:.6g}, and friction carries {most:.6g} at most: "
                "the plane slides away, no static state exists"
            )
        return ""

    def _weight(self) -> float:
        """The force along the normal, if it is given: infinite otherwise."""
        known = self._names[-1] == "n" and self._springs[-1] == 0
        return float(self._driving[-1]) if known else np.inf

    def _most(self, given: bool) -> float:
        """What friction on a plane carries at most; infinite where that is not known yet."""
        laws = [contact.friction.mu for contact, _ in self._contacts]
        if given:
            largest = self._body.largest(np.concatenate([mu.ravel() for mu in laws]))
            weight = self._weight()
            return largest * weight if weight < np.inf else np.inf
        carried = [
            (c.friction.mu.max(axis=-1) * c.reaction[:, -1]).sum() for c, _ in self._contacts
        ]
        return float(self._body.total([sum(carried)])[0])

    def tips(self) -> str:
        """Whether moment and weight ask for a centre of pressure beyond the nodes of a plane."""
        weight = self._weight()
        if not (0.0 < weight < np.inf):
            return ""
        for k in np.flatnonzero(self._turns & (self._springs == 0.0)):
            ends = [np.full((2, 1), -np.inf)]
            for contact, axes in self._contacts:
                normal, across = axes[:, -1, k], np.linalg.norm(axes[:, :-1, k], axis=1)
                most = contact.friction.mu.max(axis=-1) * across
                ends.append(np.array([-(normal - most), normal + most]))
            low, high = np.concatenate(ends, axis=1).max(axis=1)
            low, high = (self._body.comm.allreduce(float(end), op=MPI.MAX) for end in (low, high))
            asked = self._driving[k] / weight
            room = MARGIN * (low + high)
            if not -low + room <= asked <= high - room:
                return (
                    f"plane.force and plane.moment turn {self._plane} about {self._names[k]!r} by more than its contact "
                    "nodes can hold, the resultant is beyond the outermost: the plane tips over, no static state exists"
                )
        return ""

    def spins(self) -> str:
        """Whether a motion that friction alone resists is driven by more than it carries with the present normals."""
        for k in np.flatnonzero(~self._pressing & (self._springs == 0.0)):
            if not (self._turns[k] or self._plane.curved):
                continue
            sums = np.zeros(2)
            for contact, axes in self._contacts:
                normal = contact.reaction[:, -1]
                across = np.linalg.norm(axes[:, :-1, k], axis=1)
                sums += (
                    (axes[:, -1, k] * normal).sum(),
                    (contact.friction.mu.max(axis=-1) * normal * across).sum(),
                )
            by_normals, most = self._body.total(sums)
            pushed = abs(self._driving[k] - by_normals)
            if pushed > most:
                way = "turns" if self._turns[k] else "moves"
                return (
                    f"what drives {self._plane} along or about {self._names[k]!r} is {pushed / most if most else np.inf:.6g} "
                    f"times what friction carries: the surface {way} away, no static state exists"
                )
        return ""
