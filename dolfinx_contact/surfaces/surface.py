# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The base class of surfaces: rigid motion, distances and local frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.support.attributes import Guarded, frozen, whole
from dolfinx_contact.support.checks import finite, place, vector

if TYPE_CHECKING:
    from dolfinx_contact.surfaces.drive import Drive, Motion

# Two vectors are parallel if the part of one across the other is below this.
PARALLEL_PART = 1e-12

# An axis whose tangential part is below this is along the normal.
TANGENTIAL_PART = 1e-8

# Components of a normal are compared to this many decimals: where two are equal, neither rounding nor solver errors may choose the tangent.
TIE_DECIMALS = 6


def unit(name: str, value: ArrayLike, size: int) -> np.ndarray:
    """A user's vector, scaled to unit length, ``shape=(size,)``; a ``ValueError`` if it is zero."""
    along = vector(name, value, size)
    largest = np.abs(along).max()
    if largest == 0.0:
        raise ValueError(f"{name} must not be zero: only its direction counts, got {value!r}.")
    along /= largest  # first to order one, so that no square under- or overflows
    return along / np.linalg.norm(along)


class _OfDrive:
    """An attribute of the surface's ``Drive``, which is created on first access."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, surface: Any, owner: type | None = None) -> Any:
        return self if surface is None else getattr(surface.driven_by_force(), self._name)

    def __set__(self, surface: Any, value: Any) -> None:
        setattr(surface.driven_by_force(), self._name, value)


class Surface(Guarded):
    """Base class of surfaces: a rigid motion, distances and local frames.

    Positions ``y`` are given in axes that move with the surface; before it moves, they are global coordinates.  For a surface of
    your own, derive from this class and define ``distance`` and ``frames``, or derive from ``CurvedSurface`` and define
    ``distance`` and ``normals``; see docs/extending.md.

    Args:
        point: Centre of rotation, ``shape=(gdim,)``, global frame, length units.

    Attributes:
        varies: Whether gaps are a nonlinear function of the position; contacts then compute them again at every step.
        curved: Whether frames depend on the position.
        deformable: Whether it is the surface of a deformable body.
        axis: First principal friction direction, ``shape=(gdim,)``, a unit vector, or None.
    """

    _settable: tuple[str, ...] = (
        "displacement",
        "rotation",
        "free",
        "force",
        "moment",
        "stiffness",
        "drive",
        "guides",
    )
    _remedy = "make a new surface and a new Contact; displacement and rotation move it."
    varies = curved = deformable = False
    axis: np.ndarray | None = None

    force, moment, stiffness, drive, guides = (_OfDrive() for _ in range(5))

    def __init__(self, point: ArrayLike) -> None:
        self.point = frozen(vector("point", point))
        size = self.point.size
        self._displacement = frozen(np.zeros(size))
        self._rotation = self._placed = frozen(np.zeros(3 if size == 3 else 1))
        self._turn: np.ndarray | None = None
        self._spin: np.ndarray | None = None
        self._driver: Drive | None = None

    def __copy__(self) -> Surface:
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        if self._driver is not None:
            other._driver = self._driver.of(other)
        return other

    # -- driven by force -----------------------------------------------------------------------

    @property
    def driver(self) -> Drive | None:
        """The ``Drive``; None until a free motion or a force is set or read."""
        return self._driver

    def driven_by_force(self) -> Drive:
        """The ``Drive``, created if there is none."""
        if self._driver is None:
            from dolfinx_contact.surfaces.drive import Drive

            self._driver = Drive(self)
        return self._driver

    @property
    def free(self) -> tuple[str, ...]:
        """Motions driven by force, see docs/force.md: names of ``directions`` and of rotations about them; empty at first."""
        return () if self._driver is None else self._driver.free

    @free.setter
    def free(self, names: Sequence[str]) -> None:
        self.driven_by_force().free = names

    @property
    def motions(self) -> list[Motion]:
        """The free motions that are not held by contact nodes, rotations first."""
        return [] if self._driver is None else self._driver.motions

    @property
    def spins(self) -> bool:
        """Whether a rotation is free."""
        return self._driver is not None and self._driver.spins

    @property
    def directions(self) -> tuple[str, ...]:
        """Names of the directions along which the surface can be free, in the order of the rows of ``drive_axes``."""
        return ("x", "y") if self.point.size == 2 else ("x", "y", "z")

    @property
    def drive_axes(self) -> np.ndarray:
        """Unit vectors of ``directions``, ``shape=(gdim, gdim)``, global frame."""
        return self.guides

    def check_pressing(self, motion: Any) -> None:
        """Raise a ``ValueError`` if the force pulls the surface off the bodies; a plane can tell before the step."""

    # -- motion --------------------------------------------------------------------------------

    @property
    def displacement(self) -> np.ndarray:
        """Displacement from the first position, ``shape=(gdim,)``, global frame, length units."""
        return whole("surface.displacement", self._displacement)

    @displacement.setter
    def displacement(self, value: ArrayLike) -> None:
        self._displacement = frozen(vector("surface.displacement", value, self.point.size))

    @property
    def rotation(self) -> np.ndarray:
        """Rotation from the first position about ``point``, radians: a rotation vector, ``shape=(3,)``, or in 2-D an angle, ``shape=(1,)``."""
        return whole("surface.rotation", self._rotation)

    @rotation.setter
    def rotation(self, value: ArrayLike) -> None:
        self.turn_to(value)
        self._placed = self._rotation

    @property
    def placed(self) -> np.ndarray:
        """The rotation assigned last, which also orients the guides: rotations found by steps do not turn them."""
        return self._placed

    def place(self, rotation: ArrayLike, placed: np.ndarray) -> None:
        """Restore a rotation and the orientation of the guides."""
        self.turn_to(rotation)
        self._placed = placed

    def turn_to(self, value: ArrayLike) -> None:
        """Take a rotation found by a step, radians; guides do not turn."""
        size = self._rotation.size
        array = np.atleast_1d(finite("surface.rotation", value))
        if array.shape != (size,):
            wanted = "a vector of 3 numbers" if size == 3 else "one angle"
            raise ValueError(f"surface.rotation must be {wanted}, in radians, got {value!r}.")
        self._rotation, self._spin = frozen(array.astype(np.float64)), None
        self._turn = _turn_of(self._rotation)

    @property
    def spin(self) -> np.ndarray | None:
        """Small rotation found so far in the current step, radians; None without one and between steps."""
        return self._spin

    def spin_by(self, angle: np.ndarray | None) -> None:
        """Set the rotation within the current step; frames stay those of its start."""
        self._spin = angle

    @property
    def stands(self) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """``displacement``, ``rotation`` and ``spin``."""
        return self._displacement, self._rotation, self._spin

    def end_step(self) -> None:
        """Add the rotation of the step, ``spin``, to ``rotation``."""
        if self._spin is not None:
            self.turn_to(composed(self._spin, self._rotation))

    def motion(self, x: np.ndarray) -> np.ndarray:
        """Displacement of the surface's material points at ``x``, ``shape=(n, gdim)``; ``(gdim,)`` if it has not rotated.  Global frame."""
        if self._turn is None:
            return self._displacement
        return self._displacement + (x - self.point) @ self._turn.T

    def relative(self, x: np.ndarray) -> np.ndarray:
        """Coordinates of the points ``x``, ``shape=(n, gdim)``, in axes that move with the surface."""
        if self._turn is None:
            return x - self._displacement
        arm = x - self.point - self._displacement
        return self.point + arm + arm @ self._turn

    def distances(self, x: np.ndarray) -> np.ndarray:
        """Distances of points ``x``, ``shape=(..., gdim)``, global frame, from the surface; infinite where it cannot be evaluated."""
        try:
            return self.distance(self.relative(x.reshape(-1, x.shape[-1]))).reshape(x.shape[:-1])
        except ValueError:  # a function that accepts only the nodes
            return np.full(x.shape[:-1], np.inf)

    def moved_past(self, x: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """``relative(x + moved) - x``, without cancellation for small motions."""
        past = moved - self._displacement
        return past if self._turn is None else past + (x - self.point + past) @ self._turn

    def turned(self, frames: np.ndarray) -> np.ndarray:
        """Frames given in the surface's axes, in global components."""
        return frames if self._turn is None else frames + frames @ self._turn.T

    def as_placed(self, frames: np.ndarray) -> np.ndarray:
        """Frames given in the guides' axes, in global components."""
        turn = _turn_of(self._placed)
        return frames if turn is None else frames + frames @ turn.T

    def own_axes(self, vector: np.ndarray) -> np.ndarray:
        """Components of a global vector in the surface's axes; a rotation in two dimensions, one number, is unchanged."""
        return vector if self._turn is None or vector.size == 1 else vector + vector @ self._turn

    def distance(self, y: np.ndarray) -> np.ndarray:
        """Signed distance to the surface, positive on the side where the body may be.

        Only its zero and its slope there matter: on the surface, the derivative along the normal must be one.

        Args:
            y: Positions, ``shape=(n, gdim)``, in axes that move with the surface.

        Returns:
            ``shape=(n,)``, length units.
        """
        raise NotImplementedError

    def frames(self, y: np.ndarray) -> np.ndarray:
        """Orthonormal rows (t1, t2, n), in two dimensions (t, n), at positions ``y``: ``shape=(n, gdim, gdim)``, or ``(gdim, gdim)`` for all."""
        raise NotImplementedError

    def check_at(self, y: np.ndarray) -> None:
        """Raise a ``ValueError`` if the user's input contradicts itself at the nodes' positions ``y``."""

    def described(self) -> np.ndarray:
        """Numbers that identify the surface in checkpoints: point, axis, and the parameters of the class."""
        return np.append(self.point, np.zeros(self.point.size) if self.axis is None else self.axis)

    def __repr__(self) -> str:
        """The surface in words, the same on all ranks."""
        return f"{type(self).__name__}({', '.join(map(str, self.described().tolist()))})"


def frames_along(
    normals: np.ndarray, axis: np.ndarray | None, at: np.ndarray, surface: Surface
) -> np.ndarray:
    """Local frames with these unit normals: rows (t1, t2, n), in two dimensions (t, n), ``shape=(n, gdim, gdim)``.

    t1 is the axis, projected on the tangent plane.  Without an axis, t1 is the projection of the coordinate direction that is most tangential.

    Args:
        normals: ``shape=(n, gdim)``, in the same axes as ``axis``.
        axis: ``shape=(gdim,)``, or None.
        at: Positions, ``shape=(n, gdim)``, for the error message.
        surface: For the error message.

    Raises:
        ValueError: the axis is along a normal.
    """
    if normals.shape[1] == 2:
        return np.stack((np.column_stack((normals[:, 1], -normals[:, 0])), normals), axis=1)
    most = np.abs(normals).round(TIE_DECIMALS).argmin(axis=1)
    t1 = np.eye(3)[most] if axis is None else np.broadcast_to(axis, normals.shape)
    for _ in range(2):  # once more, for a nearly parallel axis
        t1 = t1 - (t1 * normals).sum(axis=1, keepdims=True) * normals
        length = np.linalg.norm(t1, axis=1, keepdims=True)
        if (length < TANGENTIAL_PART).any():
            raise ValueError(
                f"axis {axis} of {surface} is along the normal at the contact node at {place(at, int(length.argmin()))}, relative to it: give "
                "another first principal friction direction."
            )
        t1 = t1 / length
    return np.stack((t1, np.cross(normals, t1), normals), axis=1)


class CurvedSurface(Surface):
    """A surface whose normal depends on the position."""

    curved = varies = True

    def normals(self, y: np.ndarray) -> np.ndarray:
        """Unit normals at positions ``y``, towards the side where the body may be, ``shape=(n, gdim)``."""
        raise NotImplementedError

    def frames(self, y: np.ndarray) -> np.ndarray:
        """Local frame at each position, ``shape=(n, gdim, gdim)``; ``axis`` is projected on the tangent plane.

        Raises:
            ValueError: the axis is along the normal at a position.
        """
        return frames_along(self.normals(y), self.axis, y, self)


def _turn_of(angle: np.ndarray) -> np.ndarray | None:
    """``rotation_less_one``, or None for no rotation."""
    return rotation_less_one(angle) if angle.any() else None


def rotation_less_one(angle: np.ndarray) -> np.ndarray:
    """Rotation matrix minus the identity, ``shape=(gdim, gdim)``, without cancellation for small angles.

    Rodrigues' formula, ``sin(a) N + 2 sin(a/2)^2 N^2``, with the cross-product matrix ``N`` of the axis.
    """
    a = np.linalg.norm(angle)
    if angle.size == 1:
        N = np.array([[0.0, -1.0], [1.0, 0.0]]) * np.sign(angle[0])
    else:
        x, y, z = angle / a
        N = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.sin(a) * N + 2 * np.sin(a / 2) ** 2 * N @ N


def composed(after: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Rotation vector, or in two dimensions angle, of the rotation ``before`` followed by ``after``."""
    if after.size == 1:
        return after + before
    if not before.any():
        return after
    from scipy.spatial.transform import Rotation

    first, second = (Rotation.from_rotvec(angle.copy()) for angle in (before, after))
    return (second * first).as_rotvec()


def rotation_between(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Rotation vector, or in two dimensions angle, from one rotation to another; may exceed a turn if both have one axis."""
    if after.size == 1:
        return after - before
    size = np.linalg.norm(before) * np.linalg.norm(after)
    if np.linalg.norm(np.cross(before, after)) <= PARALLEL_PART * size:
        return after - before
    return composed(after, -before)


def cross(angle: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """``angle x arms``, ``shape=(n, gdim)``: velocities of points with these lever arms; in 2-D, ``angle`` is one number."""
    if angle.size == 1:
        return angle * np.column_stack((-arms[:, 1], arms[:, 0]))
    return np.cross(angle, arms)
