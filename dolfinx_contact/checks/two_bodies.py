# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Checks of contact between two deformable bodies.

They concern the choice of the slave side, slip that is too large for small sliding, and friction
lost at supports.
"""

from __future__ import annotations

import logging

from dolfinx_contact.checks.check import Check, CheckedStep
from dolfinx_contact.contact.contact import Contact

# Largest ratio of facet sizes, or of stiffnesses, at which two sides count as similar.
ALIKE_RATIO = 2.0

# Largest fraction of the friction limit of all nodes that may be lost at supports.
LOST_FRICTION = 0.005


class _ContactCheck(Check):
    """Base class of checks of a single contact."""

    def __init__(self, contact: Contact):
        self._contact = contact


class Strayed(_ContactCheck):
    """Warning if a node has slid too far along a deformable surface for small sliding."""

    def run(self, step: CheckedStep) -> str | None:
        contact = self._contact
        slid, most = max(contact.comm.allgather(contact.geometry.strayed(contact.present)))
        if slid <= most:
            return None
        return (
            f"a node has slid by {slid:.3g} along a deformable surface, further than half of the shortest edge of a facet, {most:.3g}: "
            "who presses on whom is that of the undeformed state, and forces go to where the other body was. Take sliding='large'."
        )


class BetterSlave(_ContactCheck):
    """Log message, once nodes are in contact, if the master side would be the better slave."""

    level = logging.INFO

    def run(self, step: CheckedStep) -> str | None:
        contact = self._contact
        found = contact.geometry.sides(contact.present, contact.points)
        if found is None:
            return None
        size, stiff = found
        coarse, hard = size > ALIKE_RATIO, stiff > ALIKE_RATIO
        if not ((coarse and stiff > 1 / ALIKE_RATIO) or (hard and size > 1 / ALIKE_RATIO)):
            return ""
        return (
            f"{contact!r}: its facets are {size:.2g} times as large as those opposite, and its body is {stiff:.2g} times as stiff. "
            "The finer or softer side is better as the one that carries the unknowns: swap both, and compare."
        )


class HeldAlong(_ContactCheck):
    """Warning about nodes that lose friction because supports constrain them tangentially.

    The check needs at least one node in contact.
    """

    def run(self, step: CheckedStep) -> str | None:
        body, contact = step.body, self._contact
        force = contact.friction.mu.max(axis=-1) * contact.reaction[:, -1]
        without = contact.geometry.clamped(body.fixed, contact.history.frames)
        carried, lost, count = body.total([force.sum(), force[without].sum(), without.sum()])
        if lost > LOST_FRICTION * carried:
            return (
                f"{count:.0f} contact nodes with {100 * lost / carried:.2g} % of what friction can carry are held along the other body by boundary conditions. "
                "They have no friction, as if on a plane of symmetry: hold the body elsewhere, or let the other side carry the unknowns."
            )
        return "" if carried > 0.0 else None
