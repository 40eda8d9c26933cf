# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Wear depth within a step, as a lagged quantity.

A node that slips by ``s`` wears by the depth ``d = (1 - theta) c0 N0 + theta c r_n``.  Here, N0 and
r_n are the normal forces at the start and end of the step, ``c0`` and ``c`` are the wear rates
``k m s / A`` there, m is the friction per normal force, k the wear coefficient and A the area.
With ``theta = 1/2``, the worn volume is k times the frictional work (``law/dissipation.py``); this
is used if wear is slow.  If ``c kappa`` is large, with a stiffness ``kappa`` of the node,
``1 - theta = START_SHARE / (c kappa)``.  Then wear due to the force at the start reduces the force
on the node by at most the fraction START_SHARE of N0, and the step is nearly a backward Euler step,
which does not oscillate.  For a cycle that counts many times (``contact.repeats``), ``c`` of one
cycle decides.

For given slip, the second term acts as a spring in series with the surface.  The step is solved for
given depths ``d``, which are then corrected.  At another depth ``d'``, a closed node has the force
``r_n - kappa (d' - d)`` and an open node ``-kappa x_n - kappa (d' - d)``, at least zero.  The
resulting ``d'`` does not unload the node and is not negative, for any ``c``.  Anderson's method
accounts for the coupling of nodes; ``kappa`` is twice the diagonal stiffness of the node, so that
neighbours that move together do not overshoot.
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

# Factor between the diagonal stiffness of a node and ``kappa`` in the correction of depths.
STIFFNESS_FACTOR = 2.0

# Number of differences in Anderson's method.
MIXED_DEPTHS = 20

# The residual of the depths must fall to this fraction within FALL_ROUNDS iterations.  Otherwise,
# Anderson's method is suspended for twice as many iterations, as when nodes change status.
LEAST_FALL = 0.7
FALL_ROUNDS = 10

# Without Anderson's method, depths change by this part of the change that is computed, and by this
# part of it again the next time: the whole change may alternate for ever.
CAUTIOUS_PART = 0.5

# Largest fraction of the force on a node that wear due to the force at the start of the step
# removes.
START_SHARE = 0.01

# Largest ``1 - theta`` in a jump of many cycles if one cycle wears slowly.  It is close to the 1/2
# of single cycles, so that the jump follows nearly the same rule; oscillations still fall to 2/3 in
# a step.
JUMP_SHARE = 0.4

# Tolerance of the depths, relative to ``geometry_tol``.
DEPTH_TOLERANCE = 0.1


class WearOfStep(Lagged):
    """Lagged wear depths of a step at the nodes of its contacts.

    The initial depths follow from the slip of the last step and the normal forces at its end.

    Args:
        step: The step.
        tol: ``geometry_tol``.  The force due to the error of the depths, relative to the reactions,
            must fall below the fraction ``DEPTH_TOLERANCE`` of it.
    """

    limit = 200

    def __init__(self, step: LoadStep, tol: float):
        self._body, self._tol, self._geometry_tol = step.body, DEPTH_TOLERANCE * tol, tol
        contacts = _wearing(step)
        self._share = STIFFNESS_FACTOR * _area_fractions([contact.given for contact in contacts])
        self._anderson = Anderson(self._share.size, MIXED_DEPTHS, step.body.total)
        self._best, self._stale, self._part = np.inf, 0, 1.0
        forces = [contact.last.reaction[:, -1] for contact in contacts]
        kappa, nodes = self._stiffness(contacts), [contact.last for contact in contacts]
        self._depth = self._worn(contacts, kappa, nodes, None, forces)[0]

    def _stiffness(self, contacts: Sequence[ContactStep]) -> np.ndarray:
        """Return ``kappa`` of each node, ``shape=(n,)``, force per length."""
        return self._share * np.concatenate([k.stiffness.normal for k in contacts])

    def restarted(self, step: LoadStep) -> LoadStep:
        self._anderson.restart()
        self._best, self._stale, self._part = np.inf, 0, 1.0
        return self._with_depths(step)

    def change(self, found: SolverResult, goal: float) -> Change:
        """Return whether the depths agree with the wear of the state found.  Collective.

        If they do not agree, new depths are computed for the next solution.
        """
        state = found.state
        scale = state.step.reaction_scale(state, self._geometry_tol)
        settled = self._settled(state, scale)
        return Change(settled, state.of(self._with_depths(state.step)) if settled else state)

    def renewed(self, step: LoadStep, state: StepState) -> LoadStep:
        return self._with_depths(step).replaced(starts=(state.x,), motions=state.c)

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
        if self._stale == FALL_ROUNDS:
            self._part *= CAUTIOUS_PART
        if self._stale < FALL_ROUNDS:
            mixed, _ = self._anderson.step(kappa * depth, change)
            following = np.maximum(mixed, 0.0) / kappa
        else:
            following = depth + self._part * (following - depth)
        if self._stale >= 3 * FALL_ROUNDS:  # after the iterations without Anderson's method
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
        """Return wear depths for the slip of given nodal states.

        Args:
            contacts: The contacts.
            kappa: Stiffness of the nodes, ``shape=(n,)``, force per length.
            nodes: State of each contact.
            x: Displacement, owned degrees of freedom, or None.
            forces: Normal forces at the end of the step at the nodes of each contact.

        Returns:
            Depth; depth due to the forces at the start; depth per force at the end; ``shape=(n,)``
            each.
        """
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
        """Return the step with the present wear depths."""
        contacts, first = list(step.contacts), 0
        for k, contact in enumerate(contacts):
            if contact.given.laws.wears_within:
                size = contact.nodes.size
                contacts[k] = contact.replaced(depth=frozen(self._depth[first : first + size]))
                first += size
        return step.with_contacts(contacts)


def _wearing(step: LoadStep) -> list[ContactStep]:
    """Return the contacts whose wear depth is part of the equations of the step."""
    return [contact for contact in step.contacts if contact.given.laws.wears_within]


def _area_fractions(contacts: Sequence[Contact]) -> np.ndarray:
    """Return the fraction of each node's area that belongs to each contact.  Collective.

    It is below one where contacts share nodes, as at a common edge; ``shape=(n,)`` for all
    contacts.
    """
    nodes, area = (
        np.concatenate([getattr(c, name) for c in contacts]) for name in ("nodes", "area")
    )
    _, at = np.unique(nodes, return_inverse=True)
    whole = np.bincount(at, area)[at] if nodes.size else area
    return np.divide(area, whole, np.ones_like(area), where=whole > 0.0)
