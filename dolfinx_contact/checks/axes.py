# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Check of axes of friction that belong to a body which turns on a rigid surface."""

from __future__ import annotations

import numpy as np

from dolfinx_contact.checks.check import Check, CheckedStep
from dolfinx_contact.contact.contact import Contact
from dolfinx_contact.contact.fields import turn_of_nodes

# Radians by which a body may turn under axes that stay in space, though they are the body's.
LARGEST_ROTATION = 0.05


class AxesStay(Check):
    """Of a body that has turned on a rigid surface, which carries no axes of a body."""

    def __init__(self, contact: Contact):
        self._contact = contact

    def run(self, step: CheckedStep) -> str | None:
        contact, dim = self._contact, self._contact.points.dim
        x = contact.x[:, :dim]
        moved = step.u[contact.displacements.dofs(contact.nodes)]
        turned = turn_of_nodes(x, x + moved, contact.comm)
        angle = float(np.arccos(np.clip((np.trace(turned) - dim + 2) / 2, -1.0, 1.0)))
        if angle <= LARGEST_ROTATION:
            return None
        return (
            f"the body has turned by {angle:.2g} rad at {contact!r}, and axes of friction that a callable or Function gives for it stay as they are "
            "in space on a rigid surface: let the surface turn instead of the body, or, if the axes are the surface's, say of='surface'."
        )
