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

from dolfinx_contact.step.staggered import Change, Lagged

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.load_step import LoadStep


class SlipBeforeLanding(Lagged):
    """Slip of nodes that land, which counts from where they touch; renewed together with the geometry."""

    def __init__(self, body: ElasticBody, contacts: Sequence[Contact], tol: float):
        self._body, self._contacts, self._tol = body, contacts, tol

    def change(self, step: LoadStep, found: SolverResult, goal: float) -> Change:
        late = _landing(self._body, self._contacts, step, found.x, self._tol)
        return Change(late <= self._tol, step, late)

    def renewed(self, step: LoadStep, found: SolverResult) -> LoadStep:
        return step


def _landing(
    body: ElasticBody, contacts: Sequence[Contact], step: LoadStep, x: np.ndarray, tol: float
) -> float:
    """Let slip of nodes that land count from where they touch, where that matters; how much it does.  Collective.

    An estimate that is made stays for the step: friction, which answers to it, would move the next one to and fro.

    Args:
        body: The body.
        contacts: All contacts, in the state of ``x``.
        step: The ``LoadStep``.
        x: Displacement of owned degrees of freedom.
        tol: Part of the reactions which does not matter.

    Returns:
        The largest change of friction over the reactions; above ``tol`` the step has to be solved again.
    """
    lands = [_opened(c, x) & (c.reaction[:, -1] > 0.0) for c in contacts]
    new = [at & ~c.counts_from.any(axis=1) for c, at in zip(contacts, lands)]
    slips = [contact.slip_increment for contact in contacts]
    if _felt(body, contacts, step, slips, new, tol) <= tol:
        return 0.0
    without = _without(body, contacts, step, x, lands)
    if without is None:
        return 0.0
    before = [contact.before_touching(without, at) for contact, at in zip(contacts, new)]
    late = _felt(body, contacts, step, before, new, tol)
    if late > tol:
        for contact, slip in zip(contacts, before):
            contact.count_from(contact.counts_from + slip)
    return late


def _opened(contact: Contact, x: np.ndarray) -> np.ndarray:
    """Nodes that were open at the start of a step, ``shape=(n,)``, booleans: what is left of gaps under reactions is none."""
    last = contact.last
    return (last.gap > contact.gap_rounding(x)) & (last.reaction[:, -1] == 0.0)


def _felt(
    body: ElasticBody,
    contacts: Sequence[Contact],
    step: LoadStep,
    slips: Sequence[np.ndarray],
    at: Sequence[np.ndarray],
    tol: float,
) -> float:
    """How much friction changes with slips at most, over the reactions: by what they make, and twice what friction carries."""
    squares = 0.0
    for contact, of, slip, here in zip(contacts, step.stiffness, slips, at):
        slip = np.where(here[:, None], slip, 0.0)
        contact.points.without_held(slip)
        made = np.linalg.norm(np.einsum("nij,nj->ni", of.tangential, slip), axis=1)
        most = 2.0 * contact.friction.mu.max(axis=-1) * contact.reaction[:, -1]
        squares += np.square(np.minimum(made, most)[here]).sum()
    size = float(np.sqrt(body.total([squares])[0]))
    return size / step.carried(tol) if size > 0.0 else 0.0


def _without(
    body: ElasticBody,
    contacts: Sequence[Contact],
    step: LoadStep,
    x: np.ndarray,
    nodes: Sequence[np.ndarray],
) -> np.ndarray | None:
    """The displacement with which some nodes carry nothing, and all others what they carry.  Collective.

    A loose body would fall: it is left where it was placed if it touched nowhere, else nothing is known.
    """
    if step.statics is not None:
        gaps = np.concatenate([contact.last.gap - contact.gap_rounding(x) for contact in contacts])
        return step.statics.start if -body.highest(-gaps) > 0.0 else None
    forces = np.zeros(body.size)
    for contact, at in zip(contacts, nodes):
        contact.points.add_forces(np.where(at[:, None], contact.reaction, 0.0), forces)
    forces[body.fixed] = 0.0
    return x - body.solve(forces)


def opening(body: ElasticBody, contacts: Sequence[Contact], step: LoadStep, tol: float) -> None:
    """Let the slip of nodes that have opened in the step end where they did.  Collective.

    Args:
        body: The body.
        contacts: All contacts, in their state at the end.
        step: The ``LoadStep``.
        tol: Part of the reactions which does not matter.
    """
    opens = [contact.opens for contact in contacts]
    squares = [np.square(c.settled.reaction[at]).sum() for c, at in zip(contacts, opens)]
    size = np.sqrt(body.total([sum(squares)])[0])
    if size == 0.0 or size <= tol * step.carried(tol):
        return
    before = [np.where(at[:, None], c.settled.reaction, 0.0) for c, at in zip(contacts, opens)]
    forces, points = np.zeros(body.size), [c.placement.settled.points for c in contacts]
    for of, reaction in zip(points, before):
        of.add_forces(reaction, forces)
    forces[body.fixed] = 0.0
    # Of a loose body each node alone: without reactions it would fall.
    moved = body.solve(forces) if step.statics is None else None
    for k, (contact, of, at) in enumerate(zip(contacts, points, opens)):
        alone = before[k][:, -1] / step.stiffness[k].normal
        pressed = np.maximum(alone if moved is None else of.motion(moved)[:, -1], 0.0)
        beside = contact.covered == 0.0  # left the other side along the surface: that is no gap
        way = pressed + np.where(beside, 0.0, np.maximum(contact.present.gap, 0.0))
        part = np.where(at, np.divide(pressed, way, np.ones_like(way), where=way > 0.0), 1.0)
        contact.take(slip_increment=part[:, None] * contact.slip_increment)
