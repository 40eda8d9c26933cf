# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Checks of two deformable bodies: which side carries the unknowns, how far they slide, what supports take of their friction."""

from __future__ import annotations

import logging

from dolfinx_contact.checks.check import Check, CheckedStep
from dolfinx_contact.contact.contact import Contact

# Ratio of sizes of facets, or of stiffnesses, up to which two sides are alike.
ALIKE_RATIO = 2.0

# Part of what friction can carry that supports may take.
LOST_FRICTION = 0.005


class _OfContact(Check):
    """Of one contact."""

    def __init__(self, contact: Contact):
        self._contact = contact


class Strayed(_OfContact):
    """Of a node that has slid too far along a deformable surface, in small sliding."""

    def run(self, step: CheckedStep) -> str | None:
        contact = self._contact
        slid, most = max(contact.comm.allgather(contact.geometry.strayed(contact.present)))
        if slid <= most:
            return None
        return (
            f"a node has slid by {slid:.3g} along a deformable surface, further than half of the shortest edge of a facet, {most:.3g}: "
            "who presses on whom is that of the undeformed state, and forces go to where the other body was. Take sliding='large'."
        )


class BetterSlave(_OfContact):
    """As soon as nodes press, that the other side would be the better slave."""

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


class HeldAlong(_OfContact):
    """Of nodes that have no friction because supports hold them along a deformable surface, once any node presses."""

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
