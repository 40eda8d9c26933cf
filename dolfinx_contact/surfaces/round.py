# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Rigid spheres, circles and cylinders, with the body outside or inside."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.checks import positive, vector
from dolfinx_contact.surfaces.surface import CurvedSurface, unit

# Distance from the centre, over the radius, below which the normal is undefined.
CENTRE_RADIUS = 1e-9


class _Round(CurvedSurface):
    """A rigid surface at a constant distance from a point or a line."""

    def __init__(self, point: ArrayLike, radius: float, inside: bool) -> None:
        super().__init__(point)
        self.radius = positive("radius", radius, finite=True)
        if not isinstance(inside, (bool, np.bool_)):
            raise ValueError(f"inside must be True or False, got {inside!r}.")
        self.inside = bool(inside)

    def _arms(self, y: np.ndarray) -> np.ndarray:
        """Radius vectors from the centre or the cylinder's axis to ``y``, ``shape=(n, gdim)``."""
        return y - self.point

    def distance(self, y: np.ndarray) -> np.ndarray:
        """Signed distance ``|y - c| - R``, negated if the body is inside, ``shape=(n,)``."""
        outside = np.linalg.norm(self._arms(y), axis=1) - self.radius
        return -outside if self.inside else outside

    def normals(self, y: np.ndarray) -> np.ndarray:
        """Unit normals, ``shape=(n, gdim)``, pointing from the surface to the body's side.

        They point away from the centre, or towards it if the body is inside.

        Raises:
            ValueError: a position is at the centre.
        """
        arms = self._arms(y)
        length = np.linalg.norm(arms, axis=1)
        if (length <= CENTRE_RADIUS * self.radius).any():
            at = y[np.argmin(length)].tolist()
            raise ValueError(
                f"a contact node is at the centre of {self}, {at} relative to it, where there is no normal: let its facets "
                "be those near the surface."
            )
        return arms / (-length if self.inside else length)[:, None]

    def _parameters(self, *more: Any) -> np.ndarray:
        sign = -1.0 if self.inside else 1.0
        return np.concatenate((self.point, [sign * self.radius], *more))


class RigidSphere(_Round):
    """A rigid sphere, in two dimensions a circle, driven by displacement, rotation or force.

    Within a step, each node sees the tangent plane of the sphere at its position at the end of the
    step, see docs/surfaces.md.

    Args:
        centre: ``shape=(gdim,)``, global frame, length units, ``gdim`` 2 or 3.
        radius: Length units.
        axis: First principal friction direction, ``shape=(gdim,)``, projected on the tangent plane
            at each node; needed unless friction is isotropic or the body two-dimensional.
        inside: Whether the body is inside the sphere, which is then a spherical socket.

    Raises:
        ValueError: a vector of the wrong size, zero, complex or not finite; a radius that is not
            positive.

    Attributes:
        point, radius, axis, inside: As given, ``point`` the centre, ``axis`` of unit length;
            read-only.
        displacement: Displacement from the initial position, ``shape=(gdim,)``, global frame,
            length units; assign another one between steps.
        rotation: Rotation about the centre, radians: a rotation vector, ``shape=(3,)``, in two
            dimensions an angle; assign another one between steps.
        free, force, moment, stiffness, drive: As in ``RigidPlane``, with the names "x", "y", "z",
            "rx", "ry", "rz", in two dimensions "x", "y", "r": translations along ``guides`` and
            rotations about them.
        guides: Directions of "x", "y", "z", one per row, ``shape=(gdim, gdim)``, global frame,
            orthonormal; initially the global axes.  They do not rotate with the surface.

    Example:
        >>> ball = dc.RigidSphere(centre=(0.5, 0.5, -2), radius=2, axis=(1, 0, 0))
        >>> on_ball = dc.Contact(V, foot, ball, friction)
        >>> ball.displacement = (0, 0, 0.01)  # before the next step
    """

    def __init__(
        self,
        centre: ArrayLike,
        radius: float,
        axis: ArrayLike | None = None,
        *,
        inside: bool = False,
    ) -> None:
        super().__init__(vector("centre", centre), radius, inside)
        if axis is not None:
            self.axis = frozen(unit("axis", axis, self.point.size))
        self._made = True

    def described(self) -> np.ndarray:
        """Numbers that identify the sphere in checkpoints: centre, radius and axis.

        The radius is negative if the body is inside.  Without an axis, its components are zero.
        """
        return self._parameters(np.zeros(self.point.size) if self.axis is None else self.axis)

    def __repr__(self) -> str:
        axis = None if self.axis is None else self.axis.tolist()
        return f"RigidSphere(centre={self.point.tolist()}, radius={self.radius}, axis={axis}, inside={self.inside})"


class RigidCylinder(_Round):
    """An infinite rigid cylinder in three dimensions, driven by displacement, rotation or force.

    Its axis is the first principal friction direction.  Within a step, each node sees the tangent
    plane of the cylinder at its position at the end of the step, see docs/surfaces.md.  In two
    dimensions, use ``RigidSphere``.

    Args:
        point: Any point on the cylinder's axis, ``shape=(3,)``, global frame, length units.
        axis: Direction of the cylinder's axis, ``shape=(3,)``, of any length.
        radius: Length units.
        inside: Whether the body is inside the cylinder, which is then a bore.

    Raises:
        ValueError: a vector of the wrong size, zero, complex or not finite; a radius that is not
            positive; two dimensions.

    Attributes:
        point, axis, radius, inside: As given, ``axis`` of unit length; read-only.
        displacement: Displacement from the initial position, ``shape=(3,)``, global frame, length
            units; assign another one between steps.
        rotation: Rotation about ``point``, radians, a rotation vector, ``shape=(3,)``; assign
            another one between steps.
        free, force, moment, stiffness, drive, guides: As in ``RigidSphere``.

    Example:
        >>> roll = dc.RigidCylinder(point=(0.5, 0, -2), axis=(0, 1, 0), radius=2)
        >>> rolling = dc.Contact(V, foot, roll, friction)
        >>> roll.rotation = (0, 0.001, 0)  # radians, before the next step
    """

    def __init__(
        self, point: ArrayLike, axis: ArrayLike, radius: float, *, inside: bool = False
    ) -> None:
        super().__init__(point, radius, inside)
        if self.point.size != 3:
            raise ValueError(
                "RigidCylinder needs three dimensions: in two it is a circle, RigidSphere(centre, radius)."
            )
        self.axis = frozen(unit("axis", axis, 3))
        self._made = True

    def _arms(self, y: np.ndarray) -> np.ndarray:
        arms = y - self.point
        return arms - np.outer(arms @ self.axis, self.axis)

    def described(self) -> np.ndarray:
        """Numbers that identify the cylinder in checkpoints: point, radius, axis and one.

        The radius is negative if the body is inside.  The final one distinguishes it from a sphere.
        """
        return self._parameters(self.axis, [1.0])

    def __repr__(self) -> str:
        return (
            f"RigidCylinder(point={self.point.tolist()}, axis={self.axis.tolist()}, radius={self.radius}, "
            f"inside={self.inside})"
        )
