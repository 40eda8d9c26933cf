# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Rigid surfaces given by a function of position: a signed distance, or any function that is zero on the surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from ufl.core.expr import Expr

from dolfinx_contact.attributes import frozen
from dolfinx_contact.checks import finite
from dolfinx_contact.contact.curved import CurvedSurface
from dolfinx_contact.contact.drive import vector
from dolfinx_contact.contact.surface import unit
from dolfinx_contact.contact.ufl_distance import by_ufl, is_ufl

# Step of central differences over the size of the nodes' positions: rounding and truncation alike.
STEP = float(np.cbrt(np.finfo(float).eps))

# A gradient is none if it is that much smaller than the largest one.
FLAT = 1e-12


class RigidSurface(CurvedSurface):
    """A rigid surface given by its signed distance, driven by displacement, rotation or force.

    Any smooth function does that is zero on the surface and positive where the body may be: gaps are its value over the
    length of its gradient, which on the surface, and for a distance everywhere, is exact.  Within a step a node feels the
    tangent plane where the node was at the start of the step, see docs/surfaces.md.

    Args:
        distance: Function of positions ``y``, ``shape=(gdim, n)``, in axes that move with the surface, global components
            as long as it stands where it was made; gives ``shape=(n,)``.  Or a scalar expression of UFL in
            ``SpatialCoordinate``, numbers and ``Constant`` of any mesh; its gradient is then UFL's.
        point: About which it rotates, at which force acts, ``shape=(gdim,)``, global frame, length units.
        gradient: Function of the same positions that gives the derivatives of ``distance``, ``shape=(gdim, n)``; None takes
            central differences, exact to ten digits.
        axis: First principal friction direction, ``shape=(gdim,)``, projected on the tangent plane at each node; needed
            unless friction is isotropic or the body two-dimensional.

    Raises:
        ValueError: vectors that make no sense, or what is no function.

    Attributes:
        point, axis: As given, ``axis`` of unit length; read-only.
        displacement, rotation, free, force, moment, stiffness, drive, guides: As of ``RigidSphere``.

    Example:
        >>> bump = dc.RigidSurface(lambda x: x[2] + 0.1 * (x[0] ** 2 + 2 * x[1] ** 2), point=(0, 0, 0), axis=(1, 0, 0))
        >>> on_bump = dc.Contact(V, foot, bump, friction)
    """

    def __init__(
        self,
        distance: Callable[[np.ndarray], ArrayLike] | Expr,
        point: ArrayLike = (0.0, 0.0, 0.0),
        gradient: Callable[[np.ndarray], ArrayLike] | None = None,
        axis: ArrayLike | None = None,
    ) -> None:
        super().__init__(vector("point", point))
        if is_ufl(distance):
            if gradient is not None:
                raise ValueError(
                    "gradient must be None where distance is in UFL, which derives it."
                )
            distance, gradient = by_ufl(distance, self.point.size)
        for name, function in (("distance", distance), ("gradient", gradient)):
            if not (callable(function) or function is gradient is None):
                raise ValueError(f"{name} must be a function of positions, got {function!r}.")
        self._values, self._gradient = distance, gradient
        if axis is not None:
            self.axis = frozen(unit("axis", axis, self.point.size))
        self._made = True

    def _of(self, name: str, function, y: np.ndarray, shape) -> np.ndarray:
        values = finite(f"the values of {name}", function(y.T.copy()))
        if values.shape != shape:
            raise ValueError(
                f"{name} of RigidSurface must give shape {shape} for positions of shape {y.T.shape}, not {values.shape}."
            )
        return values

    def _slopes(self, y: np.ndarray) -> np.ndarray:
        """Gradient at positions, ``shape=(n, gdim)``."""
        if self._gradient is not None:
            return self._of("gradient", self._gradient, y, y.T.shape).T
        step = STEP * (np.abs(y - self.point).max(initial=0.0) or 1.0)
        slopes = np.empty_like(y)
        for k, shift in enumerate(step * np.eye(y.shape[1])):
            ends = [
                self._of("distance", self._values, z, y.shape[:1]) for z in (y + shift, y - shift)
            ]
            slopes[:, k] = (ends[0] - ends[1]) / ((y + shift) - (y - shift))[:, k]
        return slopes

    def distance(self, y: np.ndarray) -> np.ndarray:
        """Value over the length of the gradient, ``shape=(n,)``."""
        if not len(y):
            return np.zeros(0)
        return self._of("distance", self._values, y, y.shape[:1]) / self._lengths(
            y, self._slopes(y)
        )

    def normals(self, y: np.ndarray) -> np.ndarray:
        """Along the gradient, ``shape=(n, gdim)``.

        Raises:
            ValueError: a position where there is no gradient.
        """
        if not len(y):
            return np.zeros_like(y)
        slopes = self._slopes(y)
        return slopes / self._lengths(y, slopes)[:, None]

    def _lengths(self, y: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        lengths = np.linalg.norm(slopes, axis=1)
        if not (lengths > FLAT * lengths.max()).all():
            at = y[np.argmin(lengths)].tolist()
            raise ValueError(
                f"distance of RigidSurface has no gradient at {at}, relative to it: there is no normal."
            )
        return lengths

    def described(self) -> np.ndarray:
        """Point and axis; what the function is nobody knows."""
        return np.concatenate(
            (self.point, np.zeros(self.point.size) if self.axis is None else self.axis)
        )

    def __repr__(self) -> str:
        axis = None if self.axis is None else self.axis.tolist()
        return f"RigidSurface(distance=..., point={self.point.tolist()}, axis={axis})"
