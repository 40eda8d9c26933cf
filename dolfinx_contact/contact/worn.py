# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Depths worn in a step off the contact nodes and off a deformable surface, by Archard's law.

See ``law/wear.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.contact.state import Status

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State


def worn_by(step: ContactStep, work: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the gap opened by the wear of a step, and the worn depths of both sides.  Collective.

    Args:
        step: The contact in the step.
        work: Frictional work of the step along each principal direction, ``shape=(n, gdim - 1)``.

    Returns:
        The opened gap, ``shape=(n,)``; the part of it that the contact's own nodes lose,
        ``shape=(n,)``; and the depth that opposite nodes lose, ``shape=(k,)``, None if the other
            side
        does not wear.  Lengths.
    """
    contact, wear = step.given, step.given.wear
    depth = step.depth
    if depth is None:
        depth = _wearing_fraction(contact, work) * _worn_depth(contact, work)
    if not wear.opposite.any():
        return depth, depth, None
    other = depth * wear.opposite_share(work, contact.laws.wear_field)
    given = contact.whole_area * other, contact.opposite_area, step.frames, contact.history
    return depth, depth - other, contact.geometry.taken(*given)


def wear_rates(
    step: ContactStep, state: State, u: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return depths worn under the force at the start of a step, and per normal force at its end.

    Nodes that stick do not wear.

    Args:
        step: The contact in the step.
        state: State at the end of the step.
        u: Displacement of owned degrees of freedom of this state; None to keep the slips of
            ``state``.

    Returns:
        Length, and length per force, ``shape=(n,)`` each.
    """
    contact = step.given
    if u is not None:
        state = step.with_slip_past_edges(state, u)
    slips = (state.status != int(Status.STICK))[:, None]
    slip = slips * (contact.history.slip_kept + state.slip_increment)
    unit = np.zeros_like(state.reaction)
    unit[:, -1] = 1.0
    works = step.works(slip, unit)[:2]
    start, end = (2.0 * contact.repeats * work for work in works)  # a half each
    force = np.maximum(state.reaction[:, -1:], 0.0)
    begun = _wearing_fraction(contact, 0.5 * (start + force * end))
    return begun * _worn_depth(contact, start), begun * _worn_depth(contact, end)


def _worn_depth(contact: Contact, work: np.ndarray) -> np.ndarray:
    return contact.wear.depth(work, contact.whole_area, contact.laws.wear_field)


def _wearing_fraction(contact: Contact, work: np.ndarray) -> np.ndarray | float:
    """Return the fraction of a step's frictional work above the threshold of wear, ``shape=(n,)``.

    It is the number 1 without a threshold.
    """
    if not contact.wear.threshold:
        return 1.0
    return contact.wear.part(work.sum(axis=1), contact.dissipation, contact.whole_area)
