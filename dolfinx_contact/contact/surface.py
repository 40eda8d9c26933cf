# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What rigid surfaces have in common: a rigid motion, distances and frames of points near them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.attributes import Guarded, frozen
from dolfinx_contact.checks import finite


def vector(name: str, value, size: int | None = None) -> np.ndarray:
    """A vector of finite real numbers, as floats."""
    try:
        array = np.asarray(value)
        real = np.issubdtype(array.dtype, np.number) and not np.iscomplexobj(array)
    except ValueError:  # ragged nesting
        real = False
    if not real or array.ndim != 1 or array.size not in ((2, 3) if size is None else (size,)):
        wanted = "2 or 3" if size is None else str(size)
        raise ValueError(f"{name} must be a vector of {wanted} real numbers, got {value!r}.")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, got {value!r}.")
    return array.astype(np.float64)


def unit(name: str, value, size: int) -> np.ndarray:
    """A vector that is not zero, of length one."""
    along = vector(name, value, size)
    largest = np.abs(along).max()
    if largest == 0.0:
        raise ValueError(f"{name} must not be zero: only its direction counts, got {value!r}.")
    along /= largest  # first to order one, so that no square under- or overflows
    return along / np.linalg.norm(along)


class RigidSurface(Guarded):
    """A rigid surface: its motion, and distances and frames of positions ``y`` relative to it.

    Such positions are in axes that move with the surface: global components as long as it stands where it was made.

    Args:
        point: About which the surface rotates, ``shape=(gdim,)``, global frame, length units.

    Attributes:
        varies: Whether gaps are not linear in the position, so that contacts take them anew at every step.
        curved: Whether frames differ from place to place.
        axis: First principal friction direction, or None.
    """

    _settable = ("displacement", "rotation", "free", "force", "stiffness", "drive")
    _remedy = "make a new surface and a new Contact; displacement and rotation move it."
    varies = curved = False
    axis: np.ndarray | None = None

    def __init__(self, point: ArrayLike) -> None:
        self.point = frozen(vector("point", point))
        size = self.point.size
        self._displacement = frozen(np.zeros(size))
        self._rotation = frozen(np.zeros(3 if size == 3 else 1))
        self._turn: np.ndarray | None = None

    @property
    def displacement(self) -> np.ndarray:
        """Displacement from the first position, ``shape=(gdim,)``, global frame, length units."""
        return self._displacement

    @displacement.setter
    def displacement(self, value: ArrayLike) -> None:
        self._displacement = frozen(vector("plane.displacement", value, self.point.size))

    @property
    def rotation(self) -> np.ndarray:
        """Rotation from the first position about ``point``, radians: its vector, ``shape=(3,)``; one angle in 2-D."""
        return self._rotation

    @rotation.setter
    def rotation(self, value: ArrayLike) -> None:
        size = self._rotation.size
        array = np.atleast_1d(finite("plane.rotation", value))
        if array.shape != (size,):
            wanted = "a vector of 3 numbers" if size == 3 else "one angle"
            raise ValueError(f"plane.rotation must be {wanted}, in radians, got {value!r}.")
        self._rotation = frozen(array.astype(np.float64))
        self._turn = rotation_less_one(self._rotation) if self._rotation.any() else None

    def _refuse(self) -> None:
        raise ValueError(
            f"{type(self).__name__} is driven by displacement and rotation alone: force drives planes, no curved surfaces."
        )

    @property
    def free(self) -> tuple[str, ...]:
        """Directions along which a force drives the surface: that of a plane, no others."""
        return ()

    @free.setter
    def free(self, names: Sequence[str]) -> None:
        self._refuse()

    @property
    def force(self) -> np.ndarray | None:
        """Force of the surface on the bodies, see ``RigidPlane``."""
        return None

    @force.setter
    def force(self, value: ArrayLike | None) -> None:
        self._refuse()

    @property
    def stiffness(self) -> np.ndarray:
        """Of a spring that pulls the surface, see ``RigidPlane``."""
        return np.zeros(0)

    @stiffness.setter
    def stiffness(self, value: ArrayLike) -> None:
        self._refuse()

    @property
    def drive(self) -> np.ndarray:
        """Displacement of the spring's far end, see ``RigidPlane``."""
        return np.zeros(self.point.size)

    @drive.setter
    def drive(self, value: ArrayLike) -> None:
        self._refuse()

    @property
    def springs(self) -> np.ndarray:
        """Stiffness of the spring along each free direction, ``shape=(m,)``, force per length."""
        return np.zeros(0)

    def driven(self) -> str:
        """What drives the surface, in words."""
        return "by displacement"

    def check_drive(self) -> None:
        """Raise a ``ValueError`` if what drives the surface makes no sense."""

    def motion(self, x: np.ndarray) -> np.ndarray:
        """Displacement of its material points that were at ``x``: ``shape=(gdim,)`` if it does not rotate."""
        if self._turn is None:
            return self._displacement
        return self._displacement + (x - self.point) @ self._turn.T

    def relative(self, x: np.ndarray) -> np.ndarray:
        """Positions relative to the surface of points at ``x``, ``shape=(n, gdim)``, global frame."""
        if self._turn is None:
            return x - self._displacement
        arm = x - self.point - self._displacement
        return self.point + arm + arm @ self._turn

    def turned(self, frames: np.ndarray) -> np.ndarray:
        """Frames in the surface's axes, in global components."""
        return frames if self._turn is None else frames + frames @ self._turn.T

    def distance(self, y: np.ndarray) -> np.ndarray:
        """Distance to the surface, ``shape=(n,)``, positive on the side where the body may be."""
        raise NotImplementedError

    def frames(self, y: np.ndarray) -> np.ndarray:
        """Rows (t1, t2, n), in two dimensions (t, n), orthonormal: ``shape=(n, gdim, gdim)``, or one for all."""
        raise NotImplementedError

    def described(self) -> np.ndarray:
        """Numbers that say which surface it is, for checkpoints."""
        raise NotImplementedError


def rotation_less_one(angle: np.ndarray) -> np.ndarray:
    """Matrix of a rotation minus the identity, with all digits of small ones.

    ``sin(a) N + 2 sin(a/2)^2 N^2`` with the cross product matrix ``N`` of the axis [O. Rodrigues 1840].
    """
    a = np.linalg.norm(angle)
    if angle.size == 1:
        N = np.array([[0.0, -1.0], [1.0, 0.0]]) * np.sign(angle[0])
    else:
        x, y, z = angle / a
        N = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.sin(a) * N + 2 * np.sin(a / 2) ** 2 * N @ N
