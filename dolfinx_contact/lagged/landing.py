# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Slip of nodes that close or open within a step.

Only slip while a node touches counts.  Consider a node that closes, with the gap ``g0 > 0`` at the
start.  Without the reactions of all closing nodes, and with the final reactions of the others, its
gap at the end is ``g < 0``.  By linear interpolation, it touches after the fraction
``g0 / (g0 - g)`` of the step, and slip counts from there on.  Similarly, a node that opens has the
gap ``g < 0`` at the start without the reactions of all opening nodes, and the gap ``g1`` at the
end.  It slips up to the fraction ``-g / (g1 - g)`` of the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.contact.geometry import times, to_global
from dolfinx_contact.step.staggered import Change, Lagged

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep, StepState


class SlipBeforeLanding(Lagged):
    """Lagged slip of closing nodes before they touch, which does not count as slip.

    It is updated together with the geometry.  Once estimated, the slip of a node before touching is
    kept for the step, since friction depends on it and further estimates might oscillate.

    Args:
        tol: Negligible change of forces, relative to the reactions.
    """

    def __init__(self, tol: float):
        self._tol = tol
        self._more: list[np.ndarray] | None = None  # additional slip before touching

    def change(self, found: SolverResult, goal: float) -> Change:
        state, step, self._more = found.state, found.state.step, None
        lands = [
            _open_at_start(k, state.x) & (s.reaction[:, -1] > 0.0)
            for k, s in zip(step.contacts, state.nodes)
        ]
        new = [
            at if k.before is None else at & ~k.before.any(axis=1)
            for k, at in zip(step.contacts, lands)
        ]
        slips = [nodes.slip_increment for nodes in state.nodes]
        if _friction_change(state, slips, new, self._tol) <= self._tol:
            return Change(True, state)
        without = _without_reactions(state, lands)
        if without is None:
            return Change(True, state)
        both = zip(step.contacts, new)
        before = [_before_touching(contact, without, state.c, at) for contact, at in both]
        late = _friction_change(state, before, new, self._tol)
        self._more = before if late > self._tol else None
        return Change(late <= self._tol, state, late)

    def renewed(self, step: LoadStep, state: StepState) -> LoadStep:
        contacts = []
        for k, (new, old) in enumerate(zip(step.contacts, state.step.contacts)):
            before = old.before
            if self._more is not None:
                before = self._more[k] if before is None else before + self._more[k]
            if before is not None:
                tangential = np.column_stack((before, np.zeros(len(before))))
                before = times(new.frames.own, to_global(old.frames.own, tangential))[:, :-1]
            contacts.append(new.replaced(before=before))
        return step.with_contacts(contacts)


def _open_at_start(contact: ContactStep, x: np.ndarray) -> np.ndarray:
    """Return whether each node was open at the start of a step, ``shape=(n,)``, booleans.

    The gap must exceed rounding, and the last normal reaction must be zero.
    """
    last = contact.last
    return (last.gap > contact.gap_rounding(x)) & (last.reaction[:, -1] == 0.0)


def _before_touching(
    contact: ContactStep, u: np.ndarray, c: np.ndarray, at: np.ndarray
) -> np.ndarray:
    """Return the slip of nodes before they touch, ``shape=(n, gdim - 1)``, local frame, length.

    Args:
        contact: The contact.
        u: Displacement at the end without reactions of closing nodes, owned degrees of freedom.
            Gaps vary linearly up to this displacement.
        c: Motions of surfaces driven by force, ``shape=(m,)``.
        at: Nodes to consider, ``shape=(n,)``, booleans; the slip of others is zero.
    """
    state = contact.at(u, c)
    slip = state.slip_increment + (0.0 if contact.before is None else contact.before)
    start, gap = np.maximum(contact.last.gap, 0.0), np.minimum(state.gap, 0.0)
    part = np.divide(start, start - gap, np.ones_like(gap), where=gap < 0.0)
    return np.where(at[:, None], part[:, None] * slip, 0.0)


def _friction_change(
    state: StepState, slips: Sequence[np.ndarray], at: Sequence[np.ndarray], tol: float
) -> float:
    """Return a bound of the relative change of friction due to slips.  Collective.

    The change is relative to the reactions.  The change at a node is at most the force due to the
    slip, and at most twice the friction limit.

    Args:
        state: The state.
        slips: Slip of the nodes of each contact, ``shape=(n, gdim - 1)``, length.
        at: Nodes to consider, ``shape=(n,)``, booleans, for each contact.
        tol: Negligible change of forces, relative to the reactions.
    """
    step, squares = state.step, 0.0
    for contact, nodes, slip, here in zip(step.contacts, state.nodes, slips, at):
        slip = np.where(here[:, None], slip, 0.0)
        contact.points.remove_constrained(slip)
        made = np.linalg.norm(np.einsum("nij,nj->ni", contact.stiffness.tangential, slip), axis=1)
        most = 2.0 * contact.friction.mu.max(axis=-1) * nodes.reaction[:, -1]
        squares += np.square(np.minimum(made, most)[here]).sum()
    size = float(np.sqrt(step.total([squares])[0]))
    return size / step.reaction_scale(state, tol) if size > 0.0 else 0.0


def _without_reactions(state: StepState, nodes: Sequence[np.ndarray]) -> np.ndarray | None:
    """Return the displacement of a state without the reactions of some nodes.  Collective.

    Other reactions are kept.  A body held by contact alone would not be in equilibrium: the result
    is its initial position if it was open at all nodes at the start of the step, else None.

    Args:
        state: The state.
        nodes: Nodes without reactions, ``shape=(n,)``, booleans, for each contact.
    """
    step, x = state.step, state.x
    if step.statics is not None:
        gaps = [contact.last.gap - contact.gap_rounding(x) for contact in step.contacts]
        touched = -step.body.highest(-np.concatenate(gaps)) <= 0.0
        return None if touched else step.statics.start
    forces = np.zeros(step.body.size)
    for contact, one, at in zip(step.contacts, state.nodes, nodes):
        contact.points.add_forces(np.where(at[:, None], one.reaction, 0.0), forces)
    forces[step.body.fixed] = 0.0
    return x - step.body.solve(forces)


def slip_up_to_opening(state: StepState, nodes: Sequence[State], tol: float) -> Sequence[State]:
    """Return nodal states in which the slip of opened nodes ends when they open.  Collective.

    Args:
        state: The state at the end of the step.
        nodes: State of each contact, with final gaps.
        tol: Negligible force of the opened nodes, relative to the reactions.
    """
    step = state.step
    opens = [contact.opened(one) for contact, one in zip(step.contacts, nodes)]
    settled = [contact.given.history.last.reaction for contact in step.contacts]
    squares = sum(np.square(reaction[at]).sum() for reaction, at in zip(settled, opens))
    size = np.sqrt(step.total([squares])[0])
    if size == 0.0 or size <= tol * step.reaction_scale(state, tol):
        return nodes
    before = [np.where(at[:, None], reaction, 0.0) for reaction, at in zip(settled, opens)]
    points = [contact.given.history.frames.points for contact in step.contacts]
    forces = np.zeros(step.body.size)
    for point_set, reaction in zip(points, before):
        point_set.add_forces(reaction, forces)
    forces[step.body.fixed] = 0.0
    # For a body held by contact alone, which has no equilibrium without reactions, each node by
    # itself.
    moved, found = step.body.solve(forces) if step.statics is None else None, []
    for k, (contact, point_set, one) in enumerate(zip(step.contacts, points, nodes)):
        alone = before[k][:, -1] / contact.stiffness.normal
        pressed = np.maximum(alone if moved is None else point_set.motion(moved)[:, -1], 0.0)
        beside = (
            contact.given.geometry.covered(contact.frames) == 0.0
        )  # past an edge of the opposite surface: its gap is meaningless
        way = pressed + np.where(beside, 0.0, np.maximum(one.gap, 0.0))
        part = np.divide(pressed, way, np.ones_like(way), where=way > 0.0)
        part = np.where(opens[k], part, 1.0)
        found.append(one._replace(slip_increment=part[:, None] * one.slip_increment))
    return found
