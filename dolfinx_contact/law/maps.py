# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Nodal maps, predictor and corrector with their augmentation parameters, and the laws that they call.

The fixed points of a map are the solutions of its law.  A map takes a law, reactions, gaps and slip increments,
``shape=(n, gdim)``, ``(n,)`` and ``(n, gdim - 1)``, local frame, and returns new reactions and statuses; ``linearised`` also
returns their (Clarke) derivatives.  ``springs`` are stiffnesses at the nodes for a preconditioner, ``shape=(n, gdim)``, force per
length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from dolfinx_contact.law.friction import Friction


class NodalLaw(Protocol):
    """The law at ``n`` nodes as maps call it: new reactions and statuses, and with a Jacobian their derivatives by ``r`` and (slip, gap)."""

    def return_map(
        self,
        r: np.ndarray,
        gap: np.ndarray,
        slip: np.ndarray,
        rho_n: np.ndarray,
        rho_t: np.ndarray,
        /,
    ) -> tuple: ...
    def return_jacobian(
        self,
        r: np.ndarray,
        gap: np.ndarray,
        slip: np.ndarray,
        rho_n: np.ndarray,
        rho_t: np.ndarray,
        /,
    ) -> tuple: ...
    def bipotential_map(
        self, r: np.ndarray, gap: np.ndarray, slip: np.ndarray, rho: np.ndarray, /
    ) -> tuple: ...
    def bipotential_jacobian(
        self, r: np.ndarray, gap: np.ndarray, slip: np.ndarray, rho: np.ndarray, /
    ) -> tuple: ...


class ContactLaw(NodalLaw, Protocol):
    """The law of a contact, ``Friction.law(dim)``: also what errors and records need; see docs/extending.md."""

    def slip_defect(self, r: np.ndarray, slip: np.ndarray, status: np.ndarray, /) -> np.ndarray: ...
    def bipotential_gap(
        self, r: np.ndarray, gap: np.ndarray, slip: np.ndarray, /
    ) -> np.ndarray: ...
    def load_function(self, r: np.ndarray, /) -> np.ndarray: ...


class NodalMap(Protocol):
    """A nodal map: a call returns new reactions and statuses, ``linearised`` also their derivatives."""

    @property
    def normal(self) -> np.ndarray:
        """Augmentation parameter along the normal, ``shape=(n,)``, force per length."""

    def __call__(
        self, law: NodalLaw, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray
    ) -> tuple: ...
    def linearised(
        self, law: NodalLaw, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray
    ) -> tuple: ...
    def springs(self, friction: Friction, dim: int) -> np.ndarray: ...


@dataclass(frozen=True)
class BipotentialMap:
    """The paper's predictor and Euclidean projection on the friction cone [dSFMH07, Section 2].

    Args:
        rho: Augmentation parameter, ``shape=(n,)``, force per length.
    """

    rho: np.ndarray

    @property
    def normal(self) -> np.ndarray:
        """Augmentation parameter along the normal, ``shape=(n,)``, force per length; as in the return map."""
        return self.rho

    def __call__(self, law: NodalLaw, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return law.bipotential_map(reaction, gap, slip, self.rho)

    def linearised(self, law: NodalLaw, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return law.bipotential_jacobian(reaction, gap, slip, self.rho)

    def springs(self, friction: Friction, dim: int) -> np.ndarray:
        """``rho diag(Q^2, 1)``."""
        springs = np.ones((len(self.rho), dim))
        springs[:, :-1] = friction.Q[..., : dim - 1] ** 2
        return springs * self.rho[:, None]


@dataclass(frozen=True)
class ReturnMap:
    """The predictor without the shift along the normal, and a projection in the metric in which the slip rule is normal to the cone.

    Args:
        normal: Augmentation parameter along the normal, ``shape=(n,)``, force per length.
        tangential: Augmentation parameter along the surface, ``shape=(n,)``, force per length.
    """

    normal: np.ndarray
    tangential: np.ndarray

    def __call__(self, law: NodalLaw, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return law.return_map(reaction, gap, slip, self.normal, self.tangential)

    def linearised(self, law: NodalLaw, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return law.return_jacobian(reaction, gap, slip, self.normal, self.tangential)

    def springs(self, friction: Friction, dim: int) -> np.ndarray:
        """The parameters themselves; zero along the surface at frictionless nodes."""
        springs = np.empty((len(self.normal), dim))
        springs[:, -1] = self.normal
        springs[:, :-1] = (friction.Q[..., : dim - 1] > 0) * self.tangential[:, None]
        return springs
