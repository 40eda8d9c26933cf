# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Depth that a step wears, by the pressure at its end: part of the step's equations.

A node that slips by ``s`` wears by ``d = c r_n``, ``c = k m s / A``, with m friction per normal force, k the wear coefficient and A the
area: for given slip a spring of compliance c in series with the surface.  The step is solved for given depths ``d``, and others
follow from what is found.  With a stiffness ``kappa`` a node at another depth ``d'`` has the force ``r_n - kappa (d' - d)``, an
open one ``-kappa x_n - kappa (d' - d)``; so

    d' = c max(r_n - kappa max(x_n, 0) + kappa d, 0) / (1 + c kappa),

which is neither negative nor more than unloads the node, whatever ``c`` is.  Nodes move each other, which Anderson's method learns;
``kappa`` is twice the node's own stiffness, so that neighbours that give way together do not overshoot.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.solvers.fixed_point.anderson import Anderson

if TYPE_CHECKING:
    from dolfinx_contact.solvers.protocols import BodyLike, ContactLike
    from dolfinx_contact.step.errors import NodalStiffness

# Stiffness with which depths follow, over the node's own.
STIFF = 2.0

# Differences that Anderson's method keeps, and how often depths are mixed at most.
KEPT, MOST = 20, 200

# What is off has to fall to this part in so many rounds: else differences mislead, as where nodes open and close.
FALL, PATIENCE = 0.7, 10

# Part of ``geometry_tol`` that depths may be off.
PART = 0.1


class Wearing:
    """Depths that a step wears at the nodes of its contacts; begins with the slip of the last step under its pressure.

    Args:
        body: The body.
        contacts: Those that wear within the step.
        stiffness: ``NodalStiffness`` of each.
        tol: By how much forces may differ for depths that are off, over the reactions.
    """

    def __init__(
        self,
        body: BodyLike,
        contacts: Sequence[ContactLike],
        stiffness: Sequence[NodalStiffness],
        tol: float,
    ):
        self._body, self._contacts, self._tol = body, contacts, PART * tol
        self._kappa = STIFF * np.concatenate([of.normal for of in stiffness])
        self._anderson = Anderson(self._kappa.size, KEPT, body.total)
        self._best, self._stale = np.inf, 0
        guess = [c.wear_compliance(c.last) * c.last.reaction[:, -1] for c in contacts]
        self._take(np.concatenate(guess))

    def settled(self, scale: float) -> bool:
        """Whether the depths are those that the present state wears; if not, takes others to solve the step with.  Collective.

        Args:
            scale: Reactions, see ``LoadStep.carried``.
        """
        state = [(c.wear_compliance(c.present), c.reaction[:, -1], c.gap) for c in self._contacts]
        c, force, gap = map(np.concatenate, zip(*state))
        kappa, depth = self._kappa, self._depth
        pushed = np.maximum(force + kappa * (depth - np.maximum(gap, 0.0)), 0.0)
        for following in (c * force, c * pushed / (1.0 + c * kappa)):  # the first one is exact
            change = kappa * (following - depth)
            off = self._body.norm(change)
            if off <= self._tol * scale:
                self._take(following)
                return True
        self._stale += 1
        if off <= FALL * self._best or self._stale > PATIENCE:
            if self._stale > PATIENCE:
                self._anderson.restart()
            self._best, self._stale = off, 0
        mixed, _ = self._anderson.step(kappa * depth, change)
        self._take(np.maximum(mixed, 0.0) / kappa)
        return False

    def _take(self, depth: np.ndarray) -> None:
        self._depth, first = depth, 0
        for contact in self._contacts:
            contact.let_wear(depth[first : first + contact.nodes.size])
            first += contact.nodes.size
