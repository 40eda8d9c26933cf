# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Predictor-corrector maps of the friction law at the nodes, and the interfaces of the laws.

The fixed points of a map are the solutions of its law.  A map gets a law, reactions, gaps and
slip increments, ``shape=(n, gdim)``, ``(n,)`` and ``(n, gdim - 1)``, local frame, and returns
new reactions and statuses.  Its method ``linearised`` also returns their (Clarke) derivatives,
and ``springs`` returns nodal stiffnesses for a preconditioner, ``shape=(n, gdim)``, force per
length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from dolfinx_contact.law.friction import Friction


class NodalLaw(Protocol):
    """Interface of a law at ``n`` nodes, as the maps call it.

    All methods return new reactions, ``shape=(n, gdim)``, and statuses, ``shape=(n,)``.  The
    Jacobians also return the derivatives of the reactions by ``r`` and by (slip, gap),
    ``shape=(n, gdim, gdim)`` each.
    """

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
    """Interface of the law that ``Friction.law(dim)`` returns; see docs/extending.md.

    In addition to the maps, it has error measures and the load function, ``shape=(n,)`` each.
    """

    def slip_defect(self, r: np.ndarray, slip: np.ndarray, status: np.ndarray, /) -> np.ndarray: ...
    def bipotential_gap(
        self, r: np.ndarray, gap: np.ndarray, slip: np.ndarray, /
    ) -> np.ndarray: ...
    def load_function(self, r: np.ndarray, /) -> np.ndarray: ...


class NodalMap(Protocol):
    """Interface of a nodal map.

    A call returns new reactions and statuses, and ``linearised`` also their derivatives.
    """

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
    """Bi-potential map: predictor and Euclidean projection onto the cone [dSFMH07, Section 2].

    Args:
        rho: Augmentation parameter, ``shape=(n,)``, force per length.
    """

    rho: np.ndarray

    @property
    def normal(self) -> np.ndarray:
        """Augmentation parameter along the normal, ``shape=(n,)``, force per length."""
        return self.rho

    def __call__(self, law: NodalLaw, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return law.bipotential_map(reaction, gap, slip, self.rho)

    def linearised(self, law: NodalLaw, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return law.bipotential_jacobian(reaction, gap, slip, self.rho)

    def springs(self, friction: Friction, dim: int) -> np.ndarray:
        """Diagonal of ``rho diag(Q^2, 1)`` per node, ``shape=(n, dim)``, force per length."""
        springs = np.ones((len(self.rho), dim))
        springs[:, :-1] = friction.Q[..., : dim - 1] ** 2
        return springs * self.rho[:, None]


@dataclass(frozen=True)
class ReturnMap:
    """Return map: elastic predictor and projection onto the friction cone along the slip rule.

    The predictor has no bi-potential shift along the normal.  The projection uses the metric in
    which the slip rule is normal to the cone.

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
        """Augmentation parameters as nodal stiffnesses, ``shape=(n, dim)``, force per length.

        Tangential entries are zero at frictionless nodes.
        """
        springs = np.empty((len(self.normal), dim))
        springs[:, -1] = self.normal
        springs[:, :-1] = (friction.Q[..., : dim - 1] > 0) * self.tangential[:, None]
        return springs
