# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Nodal maps whose fixed points are the law: predictor and corrector with their augmentation parameters.

Each takes a law, reactions, gaps and slip increments, ``shape=(n, gdim)``, ``(n,)`` and ``(n, gdim - 1)``, local frame,
and returns new reactions and statuses; ``linearised`` adds their (Clarke) derivatives.  ``springs`` are the stiffnesses
that a preconditioner needs at the nodes, ``shape=(n, gdim)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dolfinx_contact.law.friction import Friction
    from dolfinx_contact.solvers.protocols import LawLike


@dataclass(frozen=True)
class BipotentialMap:
    """The paper's predictor and Euclidean projection on the friction cone [dSFMH07, Section 2].

    Args:
        rho: Augmentation parameter, ``shape=(n,)``, force per length.
    """

    rho: np.ndarray

    @property
    def normal(self) -> np.ndarray:
        """Along the normal, as of the other map."""
        return self.rho

    def __call__(self, law: LawLike, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return law.bipotential_map(reaction, gap, slip, self.rho)

    def linearised(self, law: LawLike, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return law.bipotential_jacobian(reaction, gap, slip, self.rho)

    def springs(self, friction: Friction, dim: int) -> np.ndarray:
        """``rho diag(Q^2, 1)``."""
        springs = np.ones((len(self.rho), dim))
        springs[:, :-1] = friction.Q[..., : dim - 1] ** 2
        return springs * self.rho[:, None]


@dataclass(frozen=True)
class ReturnMap:
    """A predictor without the translated normal term and a projection in the metric of the slip rule.

    Args:
        normal: Augmentation parameter along the normal, ``shape=(n,)``, force per length.
        tangential: The same along slip.
    """

    normal: np.ndarray
    tangential: np.ndarray

    def __call__(self, law: LawLike, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return law.return_map(reaction, gap, slip, self.normal, self.tangential)

    def linearised(self, law: LawLike, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return law.return_jacobian(reaction, gap, slip, self.normal, self.tangential)

    def springs(self, friction: Friction, dim: int) -> np.ndarray:
        """The parameters themselves; none along the plane without friction."""
        springs = np.empty((len(self.normal), dim))
        springs[:, -1] = self.normal
        springs[:, :-1] = (friction.Q[..., : dim - 1] > 0) * self.tangential[:, None]
        return springs
