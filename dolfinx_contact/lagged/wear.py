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

from dolfinx_contact.contact.worn import wear_rates
from dolfinx_contact.step.staggered import Change, Lagged
from dolfinx_contact.support.anderson import Anderson
from dolfinx_contact.support.attributes import frozen

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep, StepState

# Stiffness with which depths follow, over the node's own.
STIFFNESS_FACTOR = 2.0

# Differences that Anderson's method keeps.
MIXED_DEPTHS = 20

# What is off has to fall to this part in so many rounds: else differences mislead, as where nodes open, close and stick, and twice
# as many rounds do without.
LEAST_FALL = 0.7
FALL_ROUNDS = 10

# In these rounds depths go this part of the way: the whole one may lead to and fro for ever.
CAUTIOUS_PART = 0.5

# Part of its force that what a step wears under the force at its start takes from a node, at most.
START_SHARE = 0.01

# In a jump of many cycles ``1 - theta`` is at most this, where one cycle is gentle: with far less, or with less the longer the jump,
# a jump would go by another rule than the cycles that it stands for.  What alternates falls to 2/3 in a step.
JUMP_SHARE = 0.4

# Part of ``geometry_tol`` that depths may be off.
DEPTH_TOLERANCE = 0.1


class WearOfStep(Lagged):
    """Depths that a step wears at the nodes of its contacts; begins with the slip of the last step under its pressure.

    Args:
        step: The step.
        tol: By how much forces may differ for depths that are off, over the reactions: a part of the geometry's.
    """

    limit = 200

    def __init__(self, step: LoadStep, tol: float):
        self._body, self._tol, self._geometry_tol = step.body, DEPTH_TOLERANCE * tol, tol
        contacts = _wearing(step)
        self._share = STIFFNESS_FACTOR * _shares([contact.given for contact in contacts])
        self._anderson = Anderson(self._share.size, MIXED_DEPTHS, step.body.total)
        self._best, self._stale = np.inf, 0
        forces = [contact.last.reaction[:, -1] for contact in contacts]
        kappa, nodes = self._stiffness(contacts), [contact.last for contact in contacts]
        self._depth = self._worn(contacts, kappa, nodes, None, forces)[0]

    def _stiffness(self, contacts: Sequence[ContactStep]) -> np.ndarray:
        """With which nodes resist to depths: between bodies it follows the rows."""
        return self._share * np.concatenate([k.stiffness.normal for k in contacts])

    def restarted(self, step: LoadStep) -> LoadStep:
        self._anderson.restart()
        self._best, self._stale = np.inf, 0
        return self._with_depths(step)

    def change(self, found: SolverResult, goal: float) -> Change:
        """Whether the depths are those that the state found wears; if not, finds others to solve the step with.  Collective."""
        state = found.state
        scale = state.step.reaction_scale(state, self._geometry_tol)
        settled = self._settled(state, scale)
        return Change(settled, state.of(self._with_depths(state.step)) if settled else state)

    def renewed(self, step: LoadStep, state: StepState) -> LoadStep:
        return self._with_depths(step).but(starts=(state.x,), motions=state.c)

    def not_settled(self, change: Change) -> str:
        return f"the depth that the step wears still changes after {self.limit} solutions"

    def message(self, solutions: int) -> str:
        return f"{solutions} times with the depth that the step wears" if solutions > 1 else ""

    def _settled(self, state: StepState, scale: float) -> bool:
        some = [
            k for k, contact in enumerate(state.step.contacts) if contact.given.laws.wears_within
        ]
        contacts = [state.step.contacts[k] for k in some]
        nodes = [state.nodes[k] for k in some]
        kappa, depth = self._stiffness(contacts), self._depth
        forces = [one.reaction[:, -1] for one in nodes]
        gap = np.concatenate([one.gap for one in nodes])
        exact, start, c = self._worn(contacts, kappa, nodes, state.x, forces)
        pushed = np.concatenate(forces) + kappa * (depth - np.maximum(gap, 0.0))
        implicit = np.maximum((start + c * pushed) / (1.0 + c * kappa), start)
        for following in (exact, implicit):
            change = kappa * (following - depth)
            off = self._body.norm(change)
            if off <= self._tol * scale:
                self._depth = following
                return True
        self._stale += 1
        if off <= LEAST_FALL * self._best:
            self._best, self._stale = off, 0
        if self._stale < FALL_ROUNDS:
            mixed, _ = self._anderson.step(kappa * depth, change)
            following = np.maximum(mixed, 0.0) / kappa
        else:
            following = depth + CAUTIOUS_PART * (following - depth)
        if self._stale >= 3 * FALL_ROUNDS:  # some rounds without differences are over
            self._anderson.restart()
            self._best, self._stale = off, 0
        self._depth = following
        return False

    def _worn(
        self,
        contacts: Sequence[ContactStep],
        kappa: np.ndarray,
        nodes: Sequence[State],
        x: np.ndarray | None,
        forces: Sequence[np.ndarray],
    ) -> tuple[np.ndarray, ...]:
        """Depth that the slip of a state wears under forces at the end, the part of it due to the start, and that per force at the end."""
        both = zip(contacts, nodes)
        rates = [wear_rates(contact, state, x) for contact, state in both]
        start, c = map(np.concatenate, zip(*rates))
        repeats = np.concatenate([np.full(k.nodes.size, k.given.repeats) for k in contacts])
        z, part = c * kappa, START_SHARE * repeats
        share = np.divide(part, z, np.ones_like(z), where=z > part)
        share = np.minimum(share, np.where(repeats > 1.0, JUMP_SHARE, 0.5))
        start, c = share * start, (1.0 - share) * c
        return start + c * np.concatenate(forces), start, c

    def _with_depths(self, step: LoadStep) -> LoadStep:
        """The step that wears by the depths."""
        contacts, first = list(step.contacts), 0
        for k, contact in enumerate(contacts):
            if contact.given.laws.wears_within:
                size = contact.nodes.size
                contacts[k] = contact.but(depth=frozen(self._depth[first : first + size]))
                first += size
        return step.with_contacts(contacts)


def _wearing(step: LoadStep) -> list[ContactStep]:
    """Contacts that wear within the step."""
    return [contact for contact in step.contacts if contact.given.laws.wears_within]


def _shares(contacts: Sequence[Contact]) -> np.ndarray:
    """Part of its node that each node of each contact has, by area, ``shape=(n,)``: contacts of one face share their common edge.  Collective."""
    nodes, area = (
        np.concatenate([getattr(c, name) for c in contacts]) for name in ("nodes", "area")
    )
    _, at = np.unique(nodes, return_inverse=True)
    whole = np.bincount(at, area)[at] if nodes.size else area
    return np.divide(area, whole, np.ones_like(area), where=whole > 0.0)
