# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Rigid surfaces given by a level-set function, such as a signed distance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from ufl.core.expr import Expr

from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.checks import finite, vector
from dolfinx_contact.surfaces.surface import CurvedSurface, unit
from dolfinx_contact.surfaces.ufl_distance import by_ufl, is_ufl

# Step of central differences, relative to the largest distance of a position from ``point``: it
# balances rounding and truncation errors.
DIFFERENCE_STEP = float(np.cbrt(np.finfo(float).eps))

# Tolerance of the user's gradient compared with differences, relative to its length: large enough
# for values in single precision.
GRADIENT_DEFECT = 0.05

# A gradient is treated as zero if it is shorter than this fraction of the longest one.
FLAT_GRADIENT = 1e-12


class RigidSurface(CurvedSurface):
    """A rigid surface given by its signed distance, driven by displacement, rotation or force.

    Any smooth function will do that is zero on the surface and positive where the body may be.
    Gaps are ``distance`` divided by the length of its gradient: exact on the surface, and
    everywhere if it is a true distance.  Within a step, each node sees the tangent plane at its
    position at the end of the step, see docs/surfaces.md.

    Args:
        distance: Function of positions ``y``, ``shape=(gdim, n)``, in axes that move with the
            surface (initially the global axes); returns ``shape=(n,)``.  Or a scalar UFL expression
            in ``SpatialCoordinate``, numbers and ``Constant`` of any mesh, which UFL then
            differentiates.
        point: Centre of rotation, and the point at which ``force`` acts, ``shape=(gdim,)``, global
            frame, length units.
        gradient: Function of the same positions that returns the derivatives of ``distance``,
            ``shape=(gdim, n)``; None means central differences, accurate to ten digits.  A Contact
            compares it with differences at its nodes.
        axis: First principal friction direction, ``shape=(gdim,)``, projected on the tangent plane
            at each node; needed unless friction is isotropic or the body two-dimensional.

    Raises:
        ValueError: a vector of the wrong size, zero, complex or not finite; a distance or gradient
            that is not a function; a gradient in addition to a distance in UFL.

    Attributes:
        point, axis: As given, ``axis`` of unit length; read-only.
        displacement, rotation, free, force, moment, stiffness, drive, guides: As in
            ``RigidSphere``.

    Example:
        >>> bump = dc.RigidSurface(
        ...     lambda x: x[2] + 0.1 * (x[0] ** 2 + 2 * x[1] ** 2), point=(0, 0, 0), axis=(1, 0, 0)
        ... )
        >>> on_bump = dc.Contact(V, foot, bump, friction)
    """

    def __init__(
        self,
        distance: Callable[[np.ndarray], ArrayLike] | Expr,
        *,
        point: ArrayLike = (0.0, 0.0, 0.0),
        gradient: Callable[[np.ndarray], ArrayLike] | None = None,
        axis: ArrayLike | None = None,
    ) -> None:
        super().__init__(vector("point", point))
        self._derived = gradient is None  # nothing to check
        if is_ufl(distance):
            if gradient is not None:
                raise ValueError(
                    "gradient must be None where distance is in UFL, which derives it."
                )
            distance, gradient = by_ufl(distance, self.point.size)
            self._derived = True
        for name, function in (("distance", distance), ("gradient", gradient)):
            if not (callable(function) or function is gradient is None):
                raise ValueError(f"{name} must be a function of positions, got {function!r}.")
        self._values, self._gradient = distance, gradient
        if axis is not None:
            self.axis = frozen(unit("axis", axis, self.point.size))
        self._made = True

    def _evaluate(
        self, name: str, function: Callable, y: np.ndarray, shape: tuple[int, ...]
    ) -> np.ndarray:
        values = finite(f"the values of {name}", function(y.T.copy()))
        if values.shape != shape:
            raise ValueError(
                f"{name} of RigidSurface must give shape {shape} for positions of shape {y.T.shape}, not {values.shape}."
            )
        return values

    def _gradients(self, y: np.ndarray) -> np.ndarray:
        """Gradient of the user's function ``distance`` at positions ``y``, ``shape=(n, gdim)``."""
        if self._gradient is not None:
            return self._evaluate("gradient", self._gradient, y, y.T.shape).T
        after, before = self._stepped_values(y, 1), self._stepped_values(y, -1)
        return (after[0] - before[0]) / (after[1] - before[1])

    def _stepped_values(self, y: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
        """Values of ``distance`` at a small step from ``y`` along each axis, for differences.

        Returns:
            The values, and the stepped coordinate, ``shape=(n, gdim)`` each, one column for each
            axis.
        """
        step = DIFFERENCE_STEP * (np.abs(y - self.point).max(initial=0.0) or 1.0)
        moved = [y + side * shift for shift in step * np.eye(y.shape[1])]
        values = [self._evaluate("distance", self._values, z, y.shape[:1]) for z in moved]
        return np.column_stack(values), np.column_stack([z[:, k] for k, z in enumerate(moved)])

    def check_at(self, y: np.ndarray) -> None:
        """Compare the user's gradient with one-sided differences of ``distance`` at points ``y``.

        At a kink, any value between the differences of both sides is accepted.

        Raises:
            ValueError: the gradient has another sign, direction or length.
        """
        if self._derived or not len(y):
            return
        given, here = self._gradients(y), self._evaluate("distance", self._values, y, y.shape[:1])
        try:
            sides = [self._stepped_values(y, side) for side in (1, -1)]
        except ValueError:  # the function cannot be evaluated beside these positions
            return
        found = np.array([(values - here[:, None]) / (at - y) for values, at in sides])
        off = np.linalg.norm(given - np.clip(given, found.min(axis=0), found.max(axis=0)), axis=1)
        lengths = np.linalg.norm([given, *found], axis=2).max(axis=0)
        wrong = off > GRADIENT_DEFECT * lengths
        if wrong.any():
            k = int(np.argmax(wrong * off))
            raise ValueError(
                f"gradient of RigidSurface is {given[k].tolist()} at {y[k].tolist()}, relative to it, where differences of "
                f"distance are {found.mean(axis=0)[k].tolist()}: give the derivatives of distance, with their signs and "
                "length, or leave gradient out."
            )

    def distance(self, y: np.ndarray) -> np.ndarray:
        """``distance`` divided by the length of its gradient, ``shape=(n,)``, length units.

        Raises:
            ValueError: the gradient vanishes at a position, or a function returns another shape or
                values that are not finite.
        """
        if not len(y):
            return np.zeros(0)
        return self._evaluate("distance", self._values, y, y.shape[:1]) / self._gradient_lengths(
            y, self._gradients(y)
        )

    def normals(self, y: np.ndarray) -> np.ndarray:
        """Unit vectors along the gradient of ``distance``, ``shape=(n, gdim)``.

        Raises:
            ValueError: the gradient vanishes at a position.
        """
        if not len(y):
            return np.zeros_like(y)
        slopes = self._gradients(y)
        return slopes / self._gradient_lengths(y, slopes)[:, None]

    def _gradient_lengths(self, y: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        lengths = np.linalg.norm(slopes, axis=1)
        if not (lengths > FLAT_GRADIENT * lengths.max()).all():
            at = y[np.argmin(lengths)].tolist()
            raise ValueError(
                f"distance of RigidSurface has no gradient at {at}, relative to it: there is no normal."
            )
        return lengths

    def __repr__(self) -> str:
        axis = None if self.axis is None else self.axis.tolist()
        return f"RigidSurface(distance=..., point={self.point.tolist()}, axis={axis})"
