# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Base class of rigid surfaces: rigid motion, distances and local frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.support.attributes import Guarded, frozen, whole
from dolfinx_contact.support.checks import finite, place, vector

if TYPE_CHECKING:
    from dolfinx_contact.surfaces.drive import Drive, Motion

# Two vectors count as parallel if the sine of their angle is at most this: rounding.
PARALLEL_PART = 1e-12

# An axis counts as normal to the surface if its tangential component is below this: half of the
# digits.
TANGENTIAL_PART = 1e-8

# Decimals to which components of a normal are compared: if two are equal, neither rounding nor
# solver errors may decide which tangent is chosen.
TIE_DECIMALS = 6


def unit(name: str, value: ArrayLike, size: int) -> np.ndarray:
    """Return a user's vector scaled to unit length, ``shape=(size,)``.

    Raises:
        ValueError: the vector is zero, not finite, or of another size.
    """
    along = vector(name, value, size)
    largest = np.abs(along).max()
    if largest == 0.0:
        raise ValueError(f"{name} must not be zero: only its direction counts, got {value!r}.")
    along /= largest  # first to order one, so that no square under- or overflows
    return along / np.linalg.norm(along)


class _DriveAttribute:
    """Descriptor of an attribute stored in the surface's ``Drive``, created on first access."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, surface: Any, owner: type | None = None) -> Any:
        return self if surface is None else getattr(surface.driven_by_force(), self._name)

    def __set__(self, surface: Any, value: Any) -> None:
        setattr(surface.driven_by_force(), self._name, value)


class Surface(Guarded):
    """Base class of surfaces: a rigid motion, distances and local frames.

    Positions ``y`` are given in axes that move with the surface; before it moves, they are global
    coordinates.  For a surface of your own, derive from this class and define ``distance`` and
    ``frames``, or derive from ``CurvedSurface`` and define ``distance`` and ``normals``; see
    docs/extending.md.

    Args:
        point: Centre of rotation, ``shape=(gdim,)``, global frame, length units.

    Attributes:
        varies: Whether gaps are a nonlinear function of the position; contacts then compute them
            again at every step.
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

    force, moment, stiffness, drive, guides = (_DriveAttribute() for _ in range(5))

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
        """The ``Drive`` with free motions and prescribed forces; None until one is set or read."""
        return self._driver

    def driven_by_force(self) -> Drive:
        """Return the ``Drive`` with free motions and prescribed forces; create it if missing."""
        if self._driver is None:
            from dolfinx_contact.surfaces.drive import Drive

            self._driver = Drive(self)
        return self._driver

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the motions driven by force: ``directions`` and rotations about them.

        Initially empty, see docs/force.md.
        """
        return () if self._driver is None else self._driver.free

    @free.setter
    def free(self, names: Sequence[str]) -> None:
        self.driven_by_force().free = names

    @property
    def motions(self) -> list[Motion]:
        """Free motions that are unknowns of the step, rotations first.

        Motions that constrained contact nodes prevent by friction are left out.
        """
        return [] if self._driver is None else self._driver.motions

    @property
    def spins(self) -> bool:
        """Whether a rotation of the surface is free."""
        return self._driver is not None and self._driver.spins

    @property
    def directions(self) -> tuple[str, ...]:
        """Names of the translations that can be free, in the order of ``drive_axes``."""
        return ("x", "y") if self.point.size == 2 else ("x", "y", "z")

    @property
    def drive_axes(self) -> np.ndarray:
        """Unit vectors of the directions that can be free, one per row, global frame."""
        return self.guides

    def check_pressing(self, motion: Any) -> None:
        """Raise a ``ValueError`` if a prescribed force pulls the surface off the bodies.

        The base class checks nothing; a plane overrides this method.
        """

    # -- motion --------------------------------------------------------------------------------

    @property
    def displacement(self) -> np.ndarray:
        """Displacement from the initial position, ``shape=(gdim,)``, global frame, length units."""
        return whole("surface.displacement", self._displacement)

    @displacement.setter
    def displacement(self, value: ArrayLike) -> None:
        self._displacement = frozen(vector("surface.displacement", value, self.point.size))

    @property
    def rotation(self) -> np.ndarray:
        """Rotation from the initial position about ``point``, radians.

        A rotation vector, ``shape=(3,)``, or in two dimensions an angle, ``shape=(1,)``.
        """
        return whole("surface.rotation", self._rotation)

    @rotation.setter
    def rotation(self, value: ArrayLike) -> None:
        self.set_rotation(value)
        self._placed = self._rotation

    @property
    def placed(self) -> np.ndarray:
        """Rotation assigned last by the user, radians; it also orients a plane's guides.

        Rotations computed by a step do not change it.
        """
        return self._placed

    def place(self, rotation: ArrayLike, placed: np.ndarray) -> None:
        """Restore the rotation and the rotation assigned last, for example from a checkpoint.

        Args:
            rotation: Rotation of the surface, as ``rotation``.
            placed: Rotation assigned last by the user, as ``placed``.
        """
        self.set_rotation(rotation)
        self._placed = placed

    def set_rotation(self, value: ArrayLike) -> None:
        """Set the rotation computed by a step, radians; the orientation of guides is unchanged."""
        size = self._rotation.size
        array = np.atleast_1d(finite("surface.rotation", value))
        if array.shape != (size,):
            wanted = "a vector of 3 numbers" if size == 3 else "one angle"
            raise ValueError(f"surface.rotation must be {wanted}, in radians, got {value!r}.")
        self._rotation, self._spin = frozen(array.astype(np.float64)), None
        self._turn = _nonzero_rotation(self._rotation)

    @property
    def spin(self) -> np.ndarray | None:
        """Small rotation computed so far in the current step, radians; None if there is none.

        ``shape=(3,)``, or in two dimensions ``(1,)``.  It is not yet part of ``rotation``.
        """
        return self._spin

    def set_spin(self, angle: np.ndarray | None) -> None:
        """Set the small rotation of the current step, radians, or None; frames are unchanged."""
        self._spin = angle

    @property
    def stands(self) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Present position of the surface: ``displacement``, ``rotation`` and ``spin``."""
        return self._displacement, self._rotation, self._spin

    def end_step(self) -> None:
        """Add the small rotation of the step, ``spin``, to ``rotation``."""
        if self._spin is not None:
            self.set_rotation(composed(self._spin, self._rotation))

    def motion(self, x: np.ndarray) -> np.ndarray:
        """Displacement of the surface's material points at ``x``, global frame, length units.

        Args:
            x: Initial positions, ``shape=(n, gdim)``.

        Returns:
            ``shape=(n, gdim)``, or ``(gdim,)`` for all points if the surface has not rotated.
        """
        if self._turn is None:
            return self._displacement
        return self._displacement + (x - self.point) @ self._turn.T

    def relative(self, x: np.ndarray) -> np.ndarray:
        """Coordinates of points ``x`` in axes that move with the surface, ``shape=(n, gdim)``."""
        if self._turn is None:
            return x - self._displacement
        arm = x - self.point - self._displacement
        return self.point + arm + arm @ self._turn

    def distances(self, x: np.ndarray) -> np.ndarray:
        """Distance of each point ``x`` from the surface, ``shape=x.shape[:-1]``, length units.

        Infinite at all points if the distance cannot be evaluated there.

        Args:
            x: Positions, ``shape=(..., gdim)``, global frame.
        """
        try:
            return self.distance(self.relative(x.reshape(-1, x.shape[-1]))).reshape(x.shape[:-1])
        except ValueError:  # a function that accepts only the nodes
            return np.full(x.shape[:-1], np.inf)

    def moved_past(self, x: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Return ``relative(x + moved) - x``, ``shape=(n, gdim)``, without cancellation.

        This is the displacement of points at ``x`` relative to the surface, in axes that move with
        it.
        """
        past = moved - self._displacement
        return past if self._turn is None else past + (x - self.point + past) @ self._turn

    def turned(self, frames: np.ndarray) -> np.ndarray:
        """Convert frames from axes that move with the surface to global components."""
        return frames if self._turn is None else frames + frames @ self._turn.T

    def as_placed(self, frames: np.ndarray) -> np.ndarray:
        """Convert frames from initial axes to global components by the rotation ``placed``."""
        turn = _nonzero_rotation(self._placed)
        return frames if turn is None else frames + frames @ turn.T

    def own_axes(self, vector: np.ndarray) -> np.ndarray:
        """Convert a global vector to axes that move with the surface.

        A rotation in two dimensions, one number, is returned unchanged.
        """
        return vector if self._turn is None or vector.size == 1 else vector + vector @ self._turn

    def distance(self, y: np.ndarray) -> np.ndarray:
        """Signed distance to the surface, positive on the side where the body may be.

        Only its zero and its slope there matter: on the surface, the derivative along the normal
        must be one.

        Args:
            y: Positions, ``shape=(n, gdim)``, in axes that move with the surface.

        Returns:
            ``shape=(n,)``, length units.
        """
        raise NotImplementedError

    def frames(self, y: np.ndarray) -> np.ndarray:
        """Local frame at each position ``y``: rows (t1, t2, n), in two dimensions (t, n).

        Args:
            y: Positions, ``shape=(n, gdim)``, in axes that move with the surface.

        Returns:
            Orthonormal rows, ``shape=(n, gdim, gdim)``, or ``(gdim, gdim)`` if all are equal, in
            the same axes.
        """
        raise NotImplementedError

    def check_at(self, y: np.ndarray) -> None:
        """Raise a ``ValueError`` if the user's input is inconsistent at nodal positions ``y``."""

    def described(self) -> np.ndarray:
        """Numbers that identify the surface in checkpoints: point, axis, class parameters."""
        return np.append(self.point, np.zeros(self.point.size) if self.axis is None else self.axis)

    def __repr__(self) -> str:
        """Return class name and parameters of the surface, the same text on all ranks."""
        return f"{type(self).__name__}({', '.join(map(str, self.described().tolist()))})"


def frames_along(
    normals: np.ndarray, axis: np.ndarray | None, at: np.ndarray, surface: Surface
) -> np.ndarray:
    """Local frames with given unit normals: rows (t1, t2, n), in two dimensions (t, n).

    t1 is ``axis``, projected on the tangent plane.  Without an axis, t1 is the projection of the
    coordinate direction that is most tangential.

    Args:
        normals: ``shape=(n, gdim)``, in the same axes as ``axis``.
        axis: ``shape=(gdim,)``, or None.
        at: Positions, ``shape=(n, gdim)``, for the error message.
        surface: The surface, for the error message.

    Returns:
        ``shape=(n, gdim, gdim)``.

    Raises:
        ValueError: the axis is along a normal.
    """
    if normals.shape[1] == 2:
        return np.stack((np.column_stack((normals[:, 1], -normals[:, 0])), normals), axis=1)
    most = np.abs(normals).round(TIE_DECIMALS).argmin(axis=1)
    t1 = np.eye(3)[most] if axis is None else np.broadcast_to(axis, normals.shape)
    for _ in range(2):  # twice, to remove rounding errors of a nearly parallel axis
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
    """Base class of surfaces whose normal depends on the position."""

    curved = varies = True

    def normals(self, y: np.ndarray) -> np.ndarray:
        """Unit normals at positions ``y``, towards the body's side, ``shape=(n, gdim)``."""
        raise NotImplementedError

    def frames(self, y: np.ndarray) -> np.ndarray:
        """Local frame at each position ``y``, ``shape=(n, gdim, gdim)``.

        ``axis`` is projected on the tangent plane.

        Raises:
            ValueError: the axis is along the normal at a position.
        """
        return frames_along(self.normals(y), self.axis, y, self)


def _nonzero_rotation(angle: np.ndarray) -> np.ndarray | None:
    """Rotation matrix minus the identity, see ``rotation_less_one``; None for a zero rotation."""
    return rotation_less_one(angle) if angle.any() else None


def rotation_less_one(angle: np.ndarray) -> np.ndarray:
    """Rotation matrix minus the identity, ``shape=(gdim, gdim)``, without cancellation.

    Rodrigues' formula, ``sin(a) N + 2 sin(a/2)^2 N^2``, with the cross-product matrix ``N`` of the
    axis.

    Args:
        angle: Nonzero rotation vector, ``shape=(3,)``, or in two dimensions angle, ``shape=(1,)``,
            radians.
    """
    a = np.linalg.norm(angle)
    if angle.size == 1:
        N = np.array([[0.0, -1.0], [1.0, 0.0]]) * np.sign(angle[0])
    else:
        x, y, z = angle / a
        N = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.sin(a) * N + 2 * np.sin(a / 2) ** 2 * N @ N


def composed(after: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Rotation vector (in 2-D angle) of the rotation ``before`` followed by ``after``, radians."""
    if after.size == 1:
        return after + before
    if not before.any():
        return after
    from scipy.spatial.transform import Rotation

    first, second = (Rotation.from_rotvec(angle.copy()) for angle in (before, after))
    return (second * first).as_rotvec()


def rotation_between(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Rotation vector (in 2-D angle) that leads from one rotation to another, radians.

    Its angle may exceed a full turn if both rotations have the same axis.
    """
    if after.size == 1:
        return after - before
    size = np.linalg.norm(before) * np.linalg.norm(after)
    if np.linalg.norm(np.cross(before, after)) <= PARALLEL_PART * size:
        return after - before
    return composed(after, -before)


def cross(angle: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """Cross product of a rotation and lever arms, ``angle x arms``, ``shape=(n, gdim)``.

    These are the displacements of points by a small rotation.  In two dimensions, ``angle`` is one
    number.
    """
    if angle.size == 1:
        return angle * np.column_stack((-arms[:, 1], arms[:, 0]))
    return np.cross(angle, arms)
