"""Rigid planes: position, normal and the directions in which friction is measured."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.attributes import Guarded, frozen


def _vector(name: str, value, size: int | None = None) -> np.ndarray:
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


def _unit(name: str, value, size: int) -> np.ndarray:
    vector = _vector(name, value, size)
    largest = np.abs(vector).max()
    if largest == 0.0:
        raise ValueError(f"{name} must not be zero: only its direction counts, got {value!r}.")
    vector /= largest  # first to order one, so that no square under- or overflows
    return vector / np.linalg.norm(vector)


class RigidPlane(Guarded):
    """A rigid plane on which bodies press and slide.

    Args:
        point: Any point of the plane, ``shape=(gdim,)``, global frame, length units, ``gdim`` 2 or 3.
        normal: Direction towards the side where the body may be, ``shape=(gdim,)``; need not be of
            unit length.
        axis: First principal friction direction, ``shape=(gdim,)``; made orthogonal to the normal.
            Needed unless friction is isotropic or the body two-dimensional.

    Raises:
        ValueError: a vector of the wrong size, not finite, complex or zero; an axis along the normal.

    Attributes:
        point, normal, axis: As given, the latter two of unit length; read-only.
        displacement: Displacement of the plane from its first position, ``shape=(gdim,)``, global
            frame, length units; zero at first, a read-only array.  Assign another one between steps: the plane
            moves, and slip is relative to it.
    """

    _settable = ("displacement",)
    _remedy = "make a new RigidPlane and a new Contact; plane.displacement = ... moves a plane."

    def __init__(self, point: ArrayLike, normal: ArrayLike, axis: ArrayLike | None = None) -> None:
        self.point = frozen(_vector("point", point))
        size = self.point.size
        self.normal = frozen(_unit("normal", normal, size))
        self.axis: np.ndarray | None = None
        self._displacement = frozen(np.zeros(size))
        if axis is not None:
            along = _unit("axis", axis, size)
            across = along - (along @ self.normal) * self.normal
            if np.linalg.norm(across) < 1e-8:  # half of the digits: the direction would be noise
                raise ValueError(
                    f"axis {axis!r} is parallel to the normal {normal!r}: give the first principal "
                    "friction direction, which lies in the plane."
                )
            across /= np.linalg.norm(across)
            across -= (across @ self.normal) * self.normal  # once more, for a nearly parallel axis
            self.axis = frozen(across / np.linalg.norm(across))
        self._made = True

    @property
    def displacement(self) -> np.ndarray:
        return self._displacement

    @displacement.setter
    def displacement(self, value: ArrayLike) -> None:
        self._displacement = frozen(_vector("plane.displacement", value, self.point.size))

    @property
    def frame(self) -> np.ndarray:
        """Rows (t1, t2, n) in three dimensions, (t, n) in two; global components, orthonormal.

        Without an axis, t1 is the coordinate direction that is most tangential, made orthogonal.
        In two dimensions t is the normal turned by -90 degrees.
        """
        n = self.normal
        if n.size == 2:
            return np.array([[n[1], -n[0]], n])
        t1 = self.axis
        if t1 is None:
            t1 = np.eye(3)[np.argmin(np.abs(n))]
            t1 = t1 - (t1 @ n) * n
            t1 /= np.linalg.norm(t1)
        return np.array([t1, np.cross(n, t1), n])

    def __repr__(self) -> str:
        axis = None if self.axis is None else self.axis.tolist()
        return (
            f"RigidPlane(point={self.point.tolist()}, normal={self.normal.tolist()}, axis={axis})"
        )
