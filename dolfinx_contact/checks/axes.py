# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Check for friction axes of a body that turns on a rigid surface."""

from __future__ import annotations

import numpy as np

from dolfinx_contact.checks.check import Check, CheckedStep
from dolfinx_contact.contact.contact import Contact
from dolfinx_contact.contact.fields import turn_of_nodes

# Largest rotation of a body, radians, with friction axes that belong to it but stay fixed in space.
LARGEST_ROTATION = 0.05


class AxesStay(Check):
    """Warning if a body has turned on a rigid surface while its friction axes stay fixed in space.

    Args:
        contact: A contact on a rigid surface whose friction axes are a field of the body.
    """

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
