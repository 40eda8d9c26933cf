# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A state that is no solution, and where to go on from it: nodes that miss the law most are put back where they were."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.step.errors import contact_defects

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import StepState


def wrong(state: StepState) -> list[np.ndarray]:
    """Forces by which the nodes of each contact miss the law in a state, by F itself, ``shape=(n,)``.  Collective."""
    state, found = state.step.measure(state.x, before=state), []
    for contact, nodes in zip(state.step.contacts, state.nodes):
        defect, _, slip = contact_defects(contact, nodes)
        found.append(np.linalg.norm(defect, axis=1) + np.linalg.norm(slip, axis=1))
    return found


def put_back(state: StepState, part: float) -> StepState:
    """A state whose nodes that miss the law by more than a part of the most do not slip.  Collective."""
    step, amounts, x = state.step, wrong(state), state.x.copy()
    largest = step.body.largest(np.concatenate([np.zeros(0), *amounts]))
    for contact, nodes, amount in zip(step.contacts, state.nodes, amounts):
        motion = np.zeros_like(nodes.reaction)
        motion[:, :-1] = -nodes.slip_increment * (amount > part * largest)[:, None]
        contact.points.add_forces(motion, x)
    x[step.body.fixed] = state.x[step.body.fixed]
    return step.evaluate(x, step.measuring_maps, c=state.c)
