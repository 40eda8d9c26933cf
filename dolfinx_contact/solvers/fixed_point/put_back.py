# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A state that is no solution, and where to go on from it: nodes that miss the law most are put back where they were."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.step.errors import contact_defects

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import LoadStep


def wrong(step: LoadStep, x: np.ndarray) -> list[np.ndarray]:
    """Forces by which the nodes of each contact miss the law at a displacement, ``shape=(n,)``.  Collective."""
    step.measure(x)
    found = []
    for contact, stiffness in zip(step.contacts, step.stiffness):
        defect, _, slip = contact_defects(contact, stiffness)
        found.append(np.linalg.norm(defect, axis=1) + np.linalg.norm(slip, axis=1))
    return found


def put_back(step: LoadStep, x: np.ndarray, part: float) -> np.ndarray:
    """A displacement whose nodes that miss the law by more than a part of the most do not slip.  Collective."""
    amounts, found, fixed = wrong(step, x), x.copy(), step.body.fixed
    largest = step.body.largest(np.concatenate([np.zeros(0), *amounts]))
    for contact, amount in zip(step.contacts, amounts):
        motion = np.zeros_like(contact.reaction)
        motion[:, :-1] = -contact.slip_increment * (amount > part * largest)[:, None]
        contact.points.add_forces(motion, found)
    found[fixed] = x[fixed]
    return found
