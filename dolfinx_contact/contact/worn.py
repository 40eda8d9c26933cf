# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What a step wears off the nodes of a contact and off a deformable surface, by Archard's law, see ``law/wear.py``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.contact.state import Status

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State


def worn_by(step: ContactStep, work: np.ndarray) -> tuple[np.ndarray, ...]:
    """Depth that gaps open by, ``shape=(n,)``, its part of the contact's own nodes, and that of nodes opposite, ``shape=(k,)``.  Collective.

    Args:
        step: The contact in the step.
        work: Frictional work of the step along each principal direction, ``shape=(n, gdim - 1)``.

    Returns:
        Lengths; None is the last one where the other side does not wear.
    """
    contact, wear = step.given, step.given.wear
    depth = step.depth
    if depth is None:
        depth = _begun(contact, work) * _rate(contact, work)
    if not wear.opposite.any():
        return depth, depth, None
    other = depth * wear.opposite_share(work, contact.laws.wear_field)
    given = contact.whole_area * other, contact.opposite_area, step.frames, contact.history
    return depth, depth - other, contact.geometry.taken(*given)


def wear_rates(
    step: ContactStep, state: State, u: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Depth that the slip of a state wears under the force at the start of the step, and that per normal force at its end.

    Nodes that stick wear nothing.

    Args:
        step: The contact in the step.
        state: The state.
        u: Its displacement, owned degrees of freedom; None is the last one.

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
    begun = _begun(contact, 0.5 * (start + force * end))
    return begun * _rate(contact, start), begun * _rate(contact, end)


def _rate(contact: Contact, work: np.ndarray) -> np.ndarray:
    return contact.wear.depth(work, contact.whole_area, contact.laws.wear_field)


def _begun(contact: Contact, work: np.ndarray) -> np.ndarray | float:
    """Part of the work of a step that is above the threshold of wear, ``shape=(n,)``."""
    if not contact.wear.threshold:
        return 1.0
    return contact.wear.part(work.sum(axis=1), contact.dissipation, contact.whole_area)
