# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Slip of nodes that touch during a part of a step alone: from where they land, or to where they open.

In the state in which nodes that land carry nothing, and all others what they carry at the end, such a node has the gap ``g < 0``.  On
the way there from its gap ``g0`` at the start it touches at the part ``g0 / (g0 - g)`` of the step, and slip counts from there on.  A
node that opens has the gap ``g < 0`` at the start without the reactions of those that open, and slips until the part
``-g / (g1 - g)``, ``g1`` its gap at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.contact.geometry import times, turned_back
from dolfinx_contact.step.staggered import Change, Lagged

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep, StepState


class SlipBeforeLanding(Lagged):
    """Slip of nodes that land, which counts from where they touch; renewed together with the geometry.

    An estimate that is made stays for the step: friction, which answers to it, would move the next one to and fro.

    Args:
        tol: Part of the reactions which does not matter.
    """

    def __init__(self, tol: float):
        self._tol = tol
        self._more: list[np.ndarray] | None = None  # slip that has turned out not to count

    def change(self, found: SolverResult, goal: float) -> Change:
        state, step, self._more = found.state, found.state.step, None
        lands = [
            _opened(k, state.x) & (s.reaction[:, -1] > 0.0)
            for k, s in zip(step.contacts, state.nodes)
        ]
        new = [
            at if k.before is None else at & ~k.before.any(axis=1)
            for k, at in zip(step.contacts, lands)
        ]
        slips = [nodes.slip_increment for nodes in state.nodes]
        if _felt(state, slips, new, self._tol) <= self._tol:
            return Change(True, state)
        without = _without(state, lands)
        if without is None:
            return Change(True, state)
        both = zip(step.contacts, new)
        before = [_before_touching(contact, without, state.c, at) for contact, at in both]
        late = _felt(state, before, new, self._tol)
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
                before = times(new.frames.own, turned_back(old.frames.own, tangential))[:, :-1]
            contacts.append(new.but(before=before))
        return step.with_contacts(contacts)


def _opened(contact: ContactStep, x: np.ndarray) -> np.ndarray:
    """Nodes that were open at the start of a step, ``shape=(n,)``, booleans: what is left of gaps under reactions is none."""
    last = contact.last
    return (last.gap > contact.gap_rounding(x)) & (last.reaction[:, -1] == 0.0)


def _before_touching(
    contact: ContactStep, u: np.ndarray, c: np.ndarray, at: np.ndarray
) -> np.ndarray:
    """Slips of some nodes up to where gaps close on the straight way to a displacement, ``shape=(n, gdim - 1)``, local frame."""
    state = contact.at(u, c)
    slip = state.slip_increment + (0.0 if contact.before is None else contact.before)
    start, gap = np.maximum(contact.last.gap, 0.0), np.minimum(state.gap, 0.0)
    part = np.divide(start, start - gap, np.ones_like(gap), where=gap < 0.0)
    return np.where(at[:, None], part[:, None] * slip, 0.0)


def _felt(
    state: StepState, slips: Sequence[np.ndarray], at: Sequence[np.ndarray], tol: float
) -> float:
    """How much friction changes with slips at most, over the reactions: by what they make, and twice what friction carries.  Collective."""
    step, squares = state.step, 0.0
    for contact, nodes, slip, here in zip(step.contacts, state.nodes, slips, at):
        slip = np.where(here[:, None], slip, 0.0)
        contact.points.without_held(slip)
        made = np.linalg.norm(np.einsum("nij,nj->ni", contact.stiffness.tangential, slip), axis=1)
        most = 2.0 * contact.friction.mu.max(axis=-1) * nodes.reaction[:, -1]
        squares += np.square(np.minimum(made, most)[here]).sum()
    size = float(np.sqrt(step.total([squares])[0]))
    return size / step.reaction_scale(state, tol) if size > 0.0 else 0.0


def _without(state: StepState, nodes: Sequence[np.ndarray]) -> np.ndarray | None:
    """The displacement with which some nodes carry nothing, and all others what they carry.  Collective.

    A loose body would fall: it is left where it was placed if it touched nowhere, else nothing is known.
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
    """States whose nodes that have opened in the step have slipped until they did.  Collective.

    Args:
        state: The state at the end.
        nodes: Those of its contacts, with their final gaps.
        tol: Part of the reactions which does not matter.
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
    # Of a loose body each node alone: without reactions it would fall.
    moved, found = step.body.solve(forces) if step.statics is None else None, []
    for k, (contact, point_set, one) in enumerate(zip(step.contacts, points, nodes)):
        alone = before[k][:, -1] / contact.stiffness.normal
        pressed = np.maximum(alone if moved is None else point_set.motion(moved)[:, -1], 0.0)
        beside = (
            contact.given.geometry.covered(contact.frames) == 0.0
        )  # left the other side along the surface: that is no gap
        way = pressed + np.where(beside, 0.0, np.maximum(one.gap, 0.0))
        part = np.divide(pressed, way, np.ones_like(way), where=way > 0.0)
        part = np.where(opens[k], part, 1.0)
        found.append(one._replace(slip_increment=part[:, None] * one.slip_increment))
    return found
