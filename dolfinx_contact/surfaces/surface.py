# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What rigid surfaces have in common: a rigid motion, distances and frames of points near them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.support.attributes import Guarded, frozen, whole
from dolfinx_contact.support.checks import finite, place, vector

if TYPE_CHECKING:
    from dolfinx_contact.solvers.protocols import BodyLike, ContactLike
    from dolfinx_contact.surfaces.drive import Drive, Motion

# Part of a length across another vector below which both are parallel.
PARALLEL = 1e-12

# Part of a direction that has to be tangential.
ALONG = 1e-8

# Digits by which components of a normal differ: on the diagonals of a mesh rounding is not to choose a tangent, nor what solvers leave.
TIES = 6


def unit(name: str, value: ArrayLike, size: int) -> np.ndarray:
    """A vector that is not zero, of length one."""
    along = vector(name, value, size)
    largest = np.abs(along).max()
    if largest == 0.0:
        raise ValueError(f"{name} must not be zero: only its direction counts, got {value!r}.")
    along /= largest  # first to order one, so that no square under- or overflows
    return along / np.linalg.norm(along)


class _OfDrive:
    """An attribute of the surface's ``Drive``, which is made when it is first asked for."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, surface: Any, owner: type | None = None) -> Any:
        return self if surface is None else getattr(surface.driven_by_force(), self._name)

    def __set__(self, surface: Any, value: Any) -> None:
        setattr(surface.driven_by_force(), self._name, value)


class Surface(Guarded):
    """A rigid surface: its motion, and distances and frames of positions ``y`` relative to it.

    Such positions are in axes that move with the surface: global components as long as it stands where it was made.  A surface of
    your own has ``distance`` and ``frames``, or, on ``CurvedSurface``, ``normals``, see docs/extending.md.

    Args:
        point: About which the surface rotates, ``shape=(gdim,)``, global frame, length units.

    Attributes:
        varies: Whether gaps are not linear in the position, so that contacts take them anew at every step.
        curved: Whether frames differ from place to place.
        deformable: Whether it is that of a deformable body.
        axis: First principal friction direction, or None.
    """

    _settable: tuple[str, ...] = (
        "displacement", "rotation", "free", "force", "moment", "stiffness", "drive", "guides",
    )  # fmt: skip
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
        """The ``Drive``; None as long as nobody has asked for free motions or forces."""
        return self._driver

    def driven_by_force(self) -> Drive:
        """The ``Drive``, made if there is none."""
        if self._driver is None:
            from dolfinx_contact.surfaces.drive import Drive

            self._driver = Drive(self)
        return self._driver

    @property
    def free(self) -> tuple[str, ...]:
        """Motions that forces drive, see docs/force.md: names of ``directions`` and of rotations about them; none at first."""
        return () if self._driver is None else self._driver.free

    @free.setter
    def free(self, names: Sequence[str]) -> None:
        self.driven_by_force().free = names

    @property
    def motions(self) -> list[Motion]:
        """The free motions that no contact nodes hold, rotations first."""
        return [] if self._driver is None else self._driver.motions

    @property
    def spins(self) -> bool:
        """Whether a rotation is free."""
        return self._driver is not None and self._driver.spins

    @property
    def directions(self) -> tuple[str, ...]:
        """Names of the directions along which it may be free, the rows of ``drive_axes``."""
        return ("x", "y") if self.point.size == 2 else ("x", "y", "z")

    @property
    def drive_axes(self) -> np.ndarray:
        """Unit vectors of ``directions``, ``shape=(gdim, gdim)``, global frame."""
        return self.guides

    def check_pressing(self, motion: Any) -> None:
        """Raise a ``ValueError`` if the force pulls it off bodies, which that of a plane may say beforehand."""

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
        """Rotation from the first position about ``point``, radians: its vector, ``shape=(3,)``; one angle in 2-D."""
        return whole("surface.rotation", self._rotation)

    @rotation.setter
    def rotation(self, value: ArrayLike) -> None:
        self.turn_to(value)
        self._placed = self._rotation

    @property
    def placed(self) -> np.ndarray:
        """The rotation that was last assigned, in which guides stand: what steps find does not turn them."""
        return self._placed

    def place(self, rotation: ArrayLike, placed: np.ndarray) -> None:
        """Take a rotation, and that in which guides stand, as they were before."""
        self.turn_to(rotation)
        self._placed = placed

    def turn_to(self, value: ArrayLike) -> None:
        """Take a rotation that a step has found, radians: guides stay."""
        size = self._rotation.size
        array = np.atleast_1d(finite("surface.rotation", value))
        if array.shape != (size,):
            wanted = "a vector of 3 numbers" if size == 3 else "one angle"
            raise ValueError(f"surface.rotation must be {wanted}, in radians, got {value!r}.")
        self._rotation, self._spin = frozen(array.astype(np.float64)), None
        self._turn = _turn_of(self._rotation)

    @property
    def spin(self) -> np.ndarray | None:
        """Rotation that the step at hand has found, radians, a small one; None if there is none, and between steps."""
        return self._spin

    def spin_by(self, angle: np.ndarray | None) -> None:
        """Turn within a step, for which frames stay those of its start."""
        self._spin = angle

    @property
    def stands(self) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """``displacement``, ``rotation`` and ``spin``."""
        return self._displacement, self._rotation, self._spin

    def end_step(self) -> None:
        """Add what a step has turned to ``rotation``."""
        if self._spin is not None:
            self.turn_to(composed(self._spin, self._rotation))

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

    def distances(self, x: np.ndarray) -> np.ndarray:
        """Of positions, ``shape=(..., gdim)``, where the surface stands; infinite where it has none."""
        try:
            return self.distance(self.relative(x.reshape(-1, x.shape[-1]))).reshape(x.shape[:-1])
        except ValueError:  # a function that is made for the nodes alone
            return np.full(x.shape[:-1], np.inf)

    def moved_past(self, x: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """``relative(x + moved) - x`` with all digits of small motions."""
        past = moved - self._displacement
        return past if self._turn is None else past + (x - self.point + past) @ self._turn

    def turned(self, frames: np.ndarray) -> np.ndarray:
        """Frames in the surface's axes, in global components."""
        return frames if self._turn is None else frames + frames @ self._turn.T

    def as_placed(self, frames: np.ndarray) -> np.ndarray:
        """The same as guides stand."""
        turn = _turn_of(self._placed)
        return frames if turn is None else frames + frames @ turn.T

    def own_axes(self, vector: np.ndarray) -> np.ndarray:
        """Components of a vector in its axes; a rotation of two dimensions stays."""
        return vector if self._turn is None or vector.size == 1 else vector + vector @ self._turn

    def distance(self, y: np.ndarray) -> np.ndarray:
        """Distance to the surface, ``shape=(n,)``, length units, positive on the side where the body may be; ``y``, ``shape=(n, gdim)``.

        What counts is its value on the surface, zero, and its slope there, one along the normal.
        """
        raise NotImplementedError

    def frames(self, y: np.ndarray) -> np.ndarray:
        """Rows (t1, t2, n), in two dimensions (t, n), orthonormal: ``shape=(n, gdim, gdim)``, or one for all."""
        raise NotImplementedError

    def check_at(self, y: np.ndarray) -> None:
        """Raise a ``ValueError`` if what the user says of the surface contradicts itself at positions of nodes."""

    def described(self) -> np.ndarray:
        """Numbers that say which surface it is, for checkpoints: point and axis, and whatever else a class has."""
        return np.append(self.point, np.zeros(self.point.size) if self.axis is None else self.axis)

    def __repr__(self) -> str:
        """Which surface it is, in words: the same on all ranks."""
        return f"{type(self).__name__}({', '.join(map(str, self.described().tolist()))})"


def frames_along(
    normals: np.ndarray, axis: np.ndarray | None, at: np.ndarray, surface: Surface
) -> np.ndarray:
    """Rows (t1, t2, n), in two dimensions (t, n), of unit normals, ``shape=(n, gdim, gdim)``; t1 is an axis, made orthogonal.

    Without an axis it is the coordinate direction that is most tangential.

    Args:
        normals: ``shape=(n, gdim)``, in the frame of the axis.
        axis: ``shape=(gdim,)``, or None.
        at: Positions, ``shape=(n, gdim)``, and the surface, for the message.

    Raises:
        ValueError: an axis along a normal.
    """
    if normals.shape[1] == 2:
        return np.stack((np.column_stack((normals[:, 1], -normals[:, 0])), normals), axis=1)
    most = np.abs(normals).round(TIES).argmin(axis=1)
    t1 = np.eye(3)[most] if axis is None else np.broadcast_to(axis, normals.shape)
    for _ in range(2):  # once more, for a nearly parallel axis
        t1 = t1 - (t1 * normals).sum(axis=1, keepdims=True) * normals
        length = np.linalg.norm(t1, axis=1, keepdims=True)
        if (length < ALONG).any():
            raise ValueError(
                f"axis {axis} of {surface} is along the normal at the contact node at {place(at, int(length.argmin()))}, relative to it: give "
                "another first principal friction direction."
            )
        t1 = t1 / length
    return np.stack((t1, np.cross(normals, t1), normals), axis=1)


class CurvedSurface(Surface):
    """A surface with a normal at every position."""

    curved = varies = True

    def normals(self, y: np.ndarray) -> np.ndarray:
        """Unit normals towards the side where the body may be, ``shape=(n, gdim)``."""
        raise NotImplementedError

    def frames(self, y: np.ndarray) -> np.ndarray:
        """Tangents and normal at each position, ``shape=(n, gdim, gdim)``; ``axis`` is projected on the tangent plane.

        Raises:
            ValueError: an axis along the normal of a position.
        """
        return frames_along(self.normals(y), self.axis, y, self)


def _turn_of(angle: np.ndarray) -> np.ndarray | None:
    """``rotation_less_one``; None where nothing turns."""
    return rotation_less_one(angle) if angle.any() else None


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


def composed(after: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Rotation vector, in two dimensions angle, of one rotation after another."""
    if after.size == 1:
        return after + before
    if not before.any():
        return after
    from scipy.spatial.transform import Rotation

    first, second = (Rotation.from_rotvec(angle.copy()) for angle in (before, after))
    return (second * first).as_rotvec()


def rotation_between(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Rotation vector, in two dimensions angle, from one rotation to another; of any size about one axis."""
    if after.size == 1:
        return after - before
    size = np.linalg.norm(before) * np.linalg.norm(after)
    if np.linalg.norm(np.cross(before, after)) <= PARALLEL * size:
        return after - before
    return composed(after, -before)


def cross(angle: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """Velocities of points with these arms, ``shape=(n, gdim)``, in a rotation about a vector, in 2-D by one number."""
    if angle.size == 1:
        return angle * np.column_stack((-arms[:, 1], arms[:, 0]))
    return np.cross(angle, arms)


def driven_surfaces(body: BodyLike, contacts: Sequence[ContactLike]):
    """The ``DrivenSurfaces`` of some contacts, None where force drives none.  Collective."""
    if not any(contact.surface.motions for contact in contacts):
        return None
    from dolfinx_contact.surfaces.driven import DrivenSurfaces

    return DrivenSurfaces(body, contacts)
