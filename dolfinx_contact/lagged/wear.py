# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Depth that a step wears, as part of its equations.

A node that slips by ``s`` wears by ``d = (1 - theta) c0 N0 + theta c r_n``, with the normal forces N0 at the start of the step and r_n at its end, and
``c = k m s / A``, friction m per normal force, wear coefficient k, area A.  With ``theta = 1/2`` the volume is k times the frictional
work (``law/dissipation.py``); that is taken where wear is gentle.  Where ``c kappa``, with a stiffness ``kappa`` of the node, is
large, ``1 - theta = START / (c kappa)``: what is worn under the force at the start takes at most the part START of it from the node, and
the step is one of backward Euler, which does not alternate.  How gentle a cycle is that counts many times (``contact.repeats``) one alone decides.

For given slip the second term is a spring in series with the surface.  The step is solved for given depths ``d``, and others follow
from what is found: a node at another depth ``d'`` has the force ``r_n - kappa (d' - d)``, an open one
``-kappa x_n - kappa (d' - d)``, none below zero.  The ``d'`` that this gives neither unloads the node nor is negative, whatever
``c`` is.  Nodes move each other, which Anderson's method learns; ``kappa`` is twice the node's own stiffness, so that neighbours
that give way together do not overshoot.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.step.staggered import Change, Lagged
from dolfinx_contact.support.anderson import Anderson

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep

# Stiffness with which depths follow, over the node's own.
STIFF = 2.0

# Differences that Anderson's method keeps.
MIXED_DEPTHS = 20

# What is off has to fall to this part in so many rounds: else differences mislead, as where nodes open, close and stick, and twice
# as many rounds do without.
FALL, PATIENCE = 0.7, 10

# Part of its force that what a step wears under the force at its start takes from a node, at most.
START = 0.01

# In a jump of many cycles ``1 - theta`` is at most this, where one cycle is gentle: with far less, or with less the longer the jump,
# a jump would go by another rule than the cycles that it stands for.  What alternates falls to 2/3 in a step.
JUMP = 0.4

# Part of ``geometry_tol`` that depths may be off.
PART = 0.1


class WearOfStep(Lagged):
    """Depths that a step wears at the nodes of its contacts; begins with the slip of the last step under its pressure.

    Args:
        body: The body.
        step: The step.
        tol: By how much forces may differ for depths that are off, over the reactions: a part of the geometry's.
    """

    limit = 200

    def __init__(self, body: ElasticBody, step: LoadStep, tol: float):
        self._body, self._tol, self._geometry_tol = body, PART * tol, tol
        self._contacts = [contact for contact in step.contacts if contact.wears_within]
        self._share = STIFF * _shares(self._contacts)
        self._anderson = Anderson(self._share.size, MIXED_DEPTHS, body.total)
        self._best, self._stale = np.inf, 0
        self._take_stiffness(step)
        forces = [contact.last.reaction[:, -1] for contact in self._contacts]
        self._take(self._worn("last", forces)[0])

    def _take_stiffness(self, step: LoadStep) -> None:
        """With which nodes resist to depths: between bodies it follows the rows."""
        both = zip(step.contacts, step.stiffness)
        normal = [stiffness.normal for contact, stiffness in both if contact.wears_within]
        self._kappa = self._share * np.concatenate(normal)

    def restart(self) -> None:
        self._anderson.restart()
        self._best, self._stale = np.inf, 0
        self._take(self._depth)

    def change(self, step: LoadStep, found: SolverResult, goal: float) -> Change:
        """Whether the depths are those that the state found wears; if not, takes others to solve the step with.  Collective."""
        self._take_stiffness(step)
        return Change(self._settled(step.carried(self._geometry_tol)), step)

    def renewed(self, step: LoadStep, found: SolverResult) -> LoadStep:
        return step.with_laws_of(found.x)

    def not_settled(self, change: Change) -> str:
        return f"the depth that the step wears still changes after {self.limit} solutions"

    def said(self, solutions: int) -> str:
        return f"{solutions} times with the depth that the step wears" if solutions > 1 else ""

    def _settled(self, scale: float) -> bool:
        kappa, depth = self._kappa, self._depth
        forces = [contact.reaction[:, -1] for contact in self._contacts]
        gap = np.concatenate([contact.present.gap for contact in self._contacts])
        exact, start, c = self._worn("present", forces)
        pushed = np.concatenate(forces) + kappa * (depth - np.maximum(gap, 0.0))
        implicit = np.maximum((start + c * pushed) / (1.0 + c * kappa), start)
        for following in (exact, implicit):
            change = kappa * (following - depth)
            off = self._body.norm(change)
            if off <= self._tol * scale:
                self._take(following)
                return True
        self._stale += 1
        if off <= FALL * self._best:
            self._best, self._stale = off, 0
        if self._stale < PATIENCE:
            mixed, _ = self._anderson.step(kappa * depth, change)
            following = np.maximum(mixed, 0.0) / kappa
        elif self._stale >= 3 * PATIENCE:  # some rounds without differences are over
            self._anderson.restart()
            self._best, self._stale = off, 0
        self._take(following)
        return False

    def _worn(self, name: str, forces: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
        """Depth that the slip of a state wears under forces at the end, the part of it due to the start, and that per force at the end."""
        rates = [contact.wear_rates(getattr(contact, name)) for contact in self._contacts]
        start, c = map(np.concatenate, zip(*rates))
        repeats = np.concatenate([np.full(of.nodes.size, of.repeats) for of in self._contacts])
        z, part = c * self._kappa, START * repeats
        share = np.divide(part, z, np.ones_like(z), where=z > part)
        share = np.minimum(share, np.where(repeats > 1.0, JUMP, 0.5))
        start, c = share * start, (1.0 - share) * c
        return start + c * np.concatenate(forces), start, c

    def _take(self, depth: np.ndarray) -> None:
        self._depth, first = depth, 0
        for contact in self._contacts:
            contact.let_wear(depth[first : first + contact.nodes.size])
            first += contact.nodes.size


def _shares(contacts: Sequence[Contact]) -> np.ndarray:
    """Part of its node that each node of each contact has, by area, ``shape=(n,)``: contacts of one face share their common edge.  Collective."""
    nodes, area = (np.concatenate([getattr(c, name) for c in contacts]) for name in ("nodes", "area"))  # fmt: skip
    _, at = np.unique(nodes, return_inverse=True)
    whole = np.bincount(at, area)[at] if nodes.size else area
    return np.divide(area, whole, np.ones_like(area), where=whole > 0.0)
