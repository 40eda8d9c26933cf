# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Rigid planes: position, normal and principal friction directions."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.checks import finite
from dolfinx_contact.surfaces.surface import Surface, unit


class RigidPlane(Surface):
    """A rigid plane, driven by displacement, rotation or force.

    Along the directions in ``free``, the plane moves until its forces are in equilibrium, see
    docs/force.md:

        sum of the reactions = force + stiffness (drive - displacement).

    Args:
        point: Any point on the plane, ``shape=(gdim,)``, global frame, length units, ``gdim`` 2 or
            3.
        normal: Direction towards the side where the body may be, ``shape=(gdim,)``, of any length.
        axis: First principal friction direction, ``shape=(gdim,)``; made orthogonal to the normal.
            Needed unless friction is isotropic or the body two-dimensional.
        height: None, or the waviness of the plane: a function of positions ``y``,
            ``shape=(gdim, n)``, in axes that move with the plane, which returns heights above it,
            ``shape=(n,)``, length units.  Slopes are neglected.

    Raises:
        ValueError: a vector of the wrong size, not finite, complex or zero; an axis along the
            normal.

    Attributes:
        point, normal, axis: As given, ``normal`` and ``axis`` of unit length; read-only.
        displacement: Displacement of the plane from its initial position, ``shape=(gdim,)``, global
            frame, length units; initially zero, a read-only array.  To move the plane, assign
            another one between steps; slip is relative to the plane.  Along free directions, it is
            a result of the step.
        rotation: Rotation about ``point``, radians: a rotation vector, ``shape=(3,)``, in two
            dimensions an angle; initially zero.  Assign another one between steps; normal and axis
            rotate with the plane, and slip is relative to it.
        free: Motions driven by force, a tuple of names: "t1", "t2" and "n" along the axes of the
            frame, "r1", "r2", "rn" about them; in two dimensions "t", "n" and "r".  Initially
            empty.  If a rotation is among them, these axes rotate with the ``rotation`` that you
            assign, not with the rotation that a step computes.
        force: Force of the plane on the bodies, ``shape=(gdim,)``, global frame; None means no
            force.  Components along directions that are not free have no effect: a guide carries
            them.
        moment: Moment of the plane on the bodies about ``point``, which moves with the plane,
            ``shape=(3,)``, in two dimensions one number, global frame; None means zero.
        stiffness: Stiffness of springs that pull the plane along free directions, by name,
            ``{"t1": 200.0}``: force per length, for rotations moment per radian.  Or one number for
            all free directions, or one for each in the order of ``free``.  Directions without a
            spring, initially all of them, carry a dead load.
        drive: Prescribed displacement of the springs' far end, ``shape=(gdim,)``, global frame,
            length units.

    Example:
        >>> plane = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1), axis=(1, 0, 0))
        >>> plane.displacement = (0, 0, 0.01)  # driven by displacement
        >>> plane.free, plane.force = ("n",), (0, 0, 500)  # or by force: 500 N on the body
    """

    _settable = ("displacement", "rotation", "free", "force", "moment", "stiffness", "drive")
    _remedy = "make a new RigidPlane and a new Contact; surface.displacement and surface.rotation move a plane."

    def __init__(
        self,
        point: ArrayLike,
        normal: ArrayLike,
        axis: ArrayLike | None = None,
        *,
        height: Callable[[np.ndarray], ArrayLike] | None = None,
    ) -> None:
        super().__init__(point)
        size = self.point.size
        if not (height is None or callable(height)):
            raise ValueError(f"height must be a function of positions, got {height!r}.")
        self.height, self.varies = height, height is not None
        self.normal = frozen(unit("normal", normal, size))
        if axis is not None:
            along = unit("axis", axis, size)
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
    def directions(self) -> tuple[str, ...]:
        """Names of the rows of ``frame``, ("t1", "t2", "n") or, in two dimensions, ("t", "n")."""
        return ("t", "n") if self.point.size == 2 else ("t1", "t2", "n")

    @property
    def drive_axes(self) -> np.ndarray:
        """Unit vectors of the directions that can be free, one per row, global frame.

        ``shape=(gdim, gdim)``: the rows of ``frame``.  If a rotation is free, they are the rows of
        the frame at the ``rotation`` assigned last, because guides do not tilt with the plane.
        """
        return self.as_placed(self._frame) if self.spins else self.frame

    def check_pressing(self, motion: Any) -> None:
        """See ``Surface``."""
        force = np.asarray(self.force)
        pressing = float(force @ self.drive_axes[-1])
        if motion.name == "n" and motion.spring == 0 and pressing <= 0:
            raise ValueError(
                f"surface.force {force.tolist()} does not press the plane on the body: its component along the "
                f"normal is {pressing:g}, must be positive, and nothing else holds the plane. It is the force of the "
                "plane on the body; a spring, surface.stiffness, also pulls."
            )

    @property
    def frame(self) -> np.ndarray:
        """Local frame of the plane in its present position, ``shape=(gdim, gdim)``, global frame.

        Orthonormal rows (t1, t2, n), in two dimensions (t, n).  Without an axis, t1 is the
        coordinate direction that is most tangential, made orthogonal to the normal.  In two
        dimensions, t is the normal rotated by -90 degrees.
        """
        return self.turned(self._frame)

    @cached_property
    def _frame(self) -> np.ndarray:
        """Local frame of the plane before any rotation, ``shape=(gdim, gdim)``, read-only."""
        n = self.normal
        if n.size == 2:
            return frozen(np.array([[n[1], -n[0]], n]))
        t1 = self.axis
        if t1 is None:
            t1 = np.eye(3)[np.argmin(np.abs(n))]
            t1 = t1 - (t1 @ n) * n
            t1 /= np.linalg.norm(t1)
        return frozen(np.array([t1, np.cross(n, t1), n]))

    def frames(self, y: np.ndarray) -> np.ndarray:
        """Local frame in the plane's own axes, ``shape=(gdim, gdim)``, equal at all positions."""
        return self._frame

    def distance(self, y: np.ndarray) -> np.ndarray:
        """Distance of positions ``y`` to the plane minus ``height``, ``shape=(n,)``, length units.

        Raises:
            ValueError: ``height`` returns values of another shape, or not finite.
        """
        flat = (y - self.point) @ self.normal
        if self.height is None or not len(y):
            return flat
        height = finite("the values of plane.height", self.height(y.T.copy()))
        if height.shape not in ((), flat.shape):
            raise ValueError(
                f"plane.height must give one value per point, shape {flat.shape}, for y of shape {y.T.shape}, not "
                f"{height.shape}."
            )
        return flat - height

    def described(self) -> np.ndarray:
        """Numbers that identify the plane in checkpoints: point and initial frame, flattened."""
        return np.concatenate((self.point, self._frame.ravel()))

    def __repr__(self) -> str:
        axis = None if self.axis is None else self.axis.tolist()
        height = "" if self.height is None else ", height=..."
        return f"RigidPlane(point={self.point.tolist()}, normal={self.normal.tolist()}, axis={axis}{height})"
