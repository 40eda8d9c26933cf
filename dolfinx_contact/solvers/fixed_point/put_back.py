# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""New start after a failed attempt: nodes that violate the contact law most lose their slip."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.step.errors import contact_defects

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import StepState


def wrong(state: StepState) -> list[np.ndarray]:
    """Violation of the contact law at the nodes of each contact, ``shape=(n,)``, force units.
    Collective.

    Norm of the residual of the projection plus norm of the defect of the slip rule.  The reactions
    are computed from the residual form F.
    """
    state, found = state.step.measure(state.x, before=state), []
    for contact, nodes in zip(state.step.contacts, state.nodes):
        defect, _, slip = contact_defects(contact, nodes)
        found.append(np.linalg.norm(defect, axis=1) + np.linalg.norm(slip, axis=1))
    return found


def put_back(state: StepState, part: float) -> StepState:
    """Return a state in which the nodes that violate the contact law most have no slip.
    Collective.

    Args:
        state: The state to start from.
        part: Nodes whose violation exceeds this part of the largest one are moved back by their
            slip increment.
    """
    step, amounts, x = state.step, wrong(state), state.x.copy()
    largest = step.body.largest(np.concatenate([np.zeros(0), *amounts]))
    for contact, nodes, amount in zip(step.contacts, state.nodes, amounts):
        motion = np.zeros_like(nodes.reaction)
        motion[:, :-1] = -nodes.slip_increment * (amount > part * largest)[:, None]
        contact.points.add_forces(motion, x)
    x[step.body.fixed] = state.x[step.body.fixed]
    return step.evaluate(x, step.error_maps, c=state.c)
