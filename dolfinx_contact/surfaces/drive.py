# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Rigid surfaces driven by force: free motions, and the prescribed forces, moments and springs."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from copy import copy
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.support.attributes import frozen, whole
from dolfinx_contact.support.checks import finite, vector

if TYPE_CHECKING:
    from dolfinx_contact.surfaces.surface import Surface

# Tolerance of the guides' unit length and right angles, relative: half of the digits.
GUIDE_DEFECT = 1e-8


class Motion(NamedTuple):
    """One free rigid motion of a surface: a translation or a rotation."""

    name: str
    axis: np.ndarray  # unit vector, global frame; [1.0] for a rotation in two dimensions
    turns: bool  # whether it is a rotation
    spring: float  # force per length, moment per radian


class Drive:
    """Prescribed forces, moments and springs that drive a rigid surface along its free motions.

        sum of the reactions = force + stiffness (drive - displacement),
        sum of their moments about the point = moment - stiffness rotation.

    Args:
        surface: The ``Surface``.  Its ``drive_axes``, named by ``directions``, are the axes of the
            free motions.
    """

    def __init__(self, surface: Surface) -> None:
        self._surface, self._size = surface, surface.point.size
        self._rotation_size = 3 if self._size == 3 else 1
        self._drive = frozen(np.zeros(self._size))
        self._guides = frozen(np.eye(self._size))
        self._free: tuple[str, ...] = ()
        self._held: tuple[str, ...] = ()
        self._past_held = 0.0
        self._ever_free = False  # also true once the warning about this has been issued
        self._force: np.ndarray | None = None
        self._moment: np.ndarray | None = None
        self._stiffness = frozen(np.zeros(1))
        self._last_problem = self._last_use = (
            0  # problem that drove it last, and the counter at that time
        )

    def of(self, surface: Surface) -> Drive:
        """Return a copy of this ``Drive`` for another surface."""
        other = copy(self)
        vars(other)["_surface"] = surface
        return other

    def take(self, problem: int, now: int) -> None:
        """Register the problem that solves a step with this surface.

        Only the problem that drove the surface last, or a newer one, may use it.

        Args:
            problem: Number of the problem; problems created later have larger numbers.
            now: A number larger than the number of any existing problem.

        Raises:
            ValueError: another problem has driven the surface since this problem was created.
        """
        if problem != self._last_problem and problem < self._last_use:
            raise ValueError(
                f"{self._surface} is driven by force in another ContactProblem, whose motion this one would take for its own: "
                "make a surface and a Contact for each problem."
            )
        if self._free or self._last_problem:
            self._last_problem, self._last_use = problem, now

    @property
    def turnings(self) -> tuple[str, ...]:
        """Names of the rotations about ``drive_axes`` that can be in ``free``, such as "rx"."""
        return ("r",) if self._size == 2 else tuple(f"r{name[-1]}" for name in self._directions)

    @property
    def _directions(self) -> tuple[str, ...]:
        return self._surface.directions

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the motions driven by force, from ``directions`` and ``turnings``.

        Initially empty.  They keep the order in which they were assigned, see docs/force.md.
        """
        return self._free

    @free.setter
    def free(self, names: Sequence[str]) -> None:
        known = self._directions + self.turnings
        if not isinstance(names, (tuple, list)) or any(name not in known for name in names):
            raise ValueError(
                f"surface.free must be a tuple of names among {known}, such as ({self._directions[-1]!r},), got {names!r}."
            )
        self._free = tuple(dict.fromkeys(names))
        self._ever_free = self._ever_free or bool(self._free)

    @property
    def force(self) -> np.ndarray | None:
        """Force of the surface on the bodies, ``shape=(gdim,)``, global frame; None means no force.

        It acts at the surface's ``point``.
        """
        return whole("surface.force", self._force)

    @force.setter
    def force(self, value: ArrayLike | None) -> None:
        size = self._size
        self._force = None if value is None else frozen(vector("surface.force", value, size))

    @property
    def moment(self) -> np.ndarray | None:
        """Moment of the surface on the bodies about ``point``, global frame; None means no moment.

        ``shape=(3,)``, or in two dimensions one number.
        """
        return whole("surface.moment", self._moment)

    @moment.setter
    def moment(self, value: ArrayLike | None) -> None:
        if value is not None:
            size = self._rotation_size
            value = frozen(vector("surface.moment", np.atleast_1d(value), size))
        self._moment = value

    @property
    def stiffness(self) -> np.ndarray | dict[str, float]:
        """Stiffness of the springs along free motions, force per length or moment per radian.

        A dictionary by the names of motions, one number for all free motions, or one number for
        each in the order of ``free``.  Zero by default: the force is then a dead load.
        """
        return dict(self._stiffness) if isinstance(self._stiffness, dict) else self._stiffness

    @stiffness.setter
    def stiffness(self, value: Mapping[str, float] | ArrayLike) -> None:
        names, known = None, self._directions + self.turnings
        if isinstance(value, Mapping):
            names = tuple(value)
            if any(name not in known for name in names):
                raise ValueError(
                    f"surface.stiffness must name springs by free motions, among {known}, got {value!r}."
                )
        array = finite("surface.stiffness", value if names is None else list(value.values()))
        array = np.atleast_1d(array)
        if array.ndim != 1 or array.size > len(known) or not (array >= 0).all():
            raise ValueError(
                f"surface.stiffness must be numbers, zero or more, by name, such as {{{self._directions[0]!r}: 200.0}}, or "
                f"one for all free motions, got {value!r}."
            )
        self._stiffness = frozen(array) if names is None else dict(zip(names, array.tolist()))

    @property
    def drive(self) -> np.ndarray:
        """Prescribed displacement of the springs' far end, ``shape=(gdim,)``, global frame."""
        return whole("surface.drive", self._drive)

    @drive.setter
    def drive(self, value: ArrayLike) -> None:
        self._drive = frozen(vector("surface.drive", value, self._size))

    @property
    def guides(self) -> np.ndarray:
        """Unit vectors of the directions "x", "y", "z" in ``free``, one per row, global frame.

        Orthonormal, ``shape=(gdim, gdim)``; the coordinate axes by default.  They do not rotate
        with the surface.
        """
        return whole("surface.guides", self._guides)

    @guides.setter
    def guides(self, value: ArrayLike) -> None:
        self._guides = check_guides(value, self._size)

    @property
    def springs(self) -> np.ndarray:
        """Spring stiffness of each motion in ``free``, ``shape=(m,)``.

        Force per length, for rotations moment per radian.
        """
        if isinstance(self._stiffness, dict):
            return np.array([self._stiffness.get(name, 0.0) for name in self._free])
        return np.broadcast_to(self._stiffness, len(self._free))

    @property
    def spins(self) -> bool:
        """Whether a rotation of the surface is free."""
        return any(name in self.turnings for name in self._free)

    def hold(self, names: tuple[str, ...] = (), past: float = 0.0) -> None:
        """Set the free motions that constrained contact nodes prevent, or the direction of sliding.

        Args:
            names: Free motions that constrained contact nodes prevent by friction, see ``held.py``.
            past: Sign of the motion if the surface slides relative to these nodes; zero if it does
                not.
        """
        self._held, self._past_held = names, past

    @property
    def motions(self) -> list[Motion]:
        """Free motions that are unknowns of the step, rotations first.

        Motions that constrained contact nodes prevent by friction are left out, see ``hold``.
        """
        if not self._free:
            return []
        axes = self._surface.drive_axes
        about = np.ones((1, 1)) if self._size == 2 else axes
        springs = dict(zip(self._free, self.springs.tolist()))
        springs = {name: k for name, k in springs.items() if name not in self._held}
        turns = [
            Motion(name, axis, True, springs[name])
            for name, axis in zip(self.turnings, about)
            if name in springs
        ]
        return turns + [
            Motion(name, axis, False, springs[name])
            for name, axis in zip(self._directions, axes)
            if name in springs
        ]

    @property
    def setup_key(self) -> tuple:
        """Free motions and their springs, as a tuple to compare; empty if there are none.

        A solver must be set up again when this tuple changes.
        """
        motions = [(motion.name, motion.spring) for motion in self.motions]
        return (motions, self._guides.tolist(), self._past_held) if motions else ()

    @property
    def radial(self) -> bool:
        """Whether a free translation has a component along the first coordinate axis."""
        along = [motion.axis[0] for motion in self.motions if not motion.turns]
        return any(abs(part) > GUIDE_DEFECT for part in along)

    def prescribed_forces(self, motions: list[Motion], magnitudes: bool = False) -> np.ndarray:
        """Return the prescribed force or moment along each motion, springs included.

        Args:
            motions: The motions, ``m`` of them.
            magnitudes: Return sums of the magnitudes of the terms instead, to estimate rounding.

        Returns:
            ``shape=(m,)``, in the present position, force or moment units.
        """
        size = np.abs if magnitudes else np.asarray
        less = np.add if magnitudes else np.subtract
        displacement, rotation, spin = self._surface.stands
        force = np.zeros(self._size) if self._force is None else self._force
        moment = np.zeros(self._rotation_size) if self._moment is None else self._moment
        stretched = less(size(self._drive), size(displacement))
        turned = size(rotation) + (0.0 if spin is None else size(spin))
        back = less(np.zeros_like(turned), turned)
        terms = [(moment, back) if m.turns else (force, stretched) for m in motions]
        return np.array(
            [
                size(m.axis) @ size(f) + m.spring * (size(m.axis) @ way)
                for m, (f, way) in zip(motions, terms)
            ]
        )

    def driven(self) -> str:
        """Return a text that identifies free motions, force, moment, stiffness and drive.

        The moment is included only if a rotation is free.
        """
        given = (self._free, self._force, self._stiffness, self._drive)
        if self.spins:
            given += (self._moment,)
        return repr(tuple(v.tolist() if isinstance(v, np.ndarray) else v for v in given))

    def check(self) -> None:
        """Raise a ``ValueError`` if the prescribed forces do not determine the free motions.

        This is so if a free motion has neither force nor spring, or if the force pulls a plane off
        the body.  Warn if force or moment are given, but no motion has ever been free.
        """
        self._check_springs()
        if not self._ever_free and not (self._force is None and self._moment is None):
            self._ever_free = True
            warnings.warn(
                f"surface.force is {self._force} and surface.moment {self._moment}, but surface.free is (): no force moves the "
                "plane, it stands where surface.displacement puts it. Name the directions that force drives, such as "
                f"surface.free = ({self._directions[-1]!r},), if that is not meant.",
                stacklevel=2,
            )
        moving = [motion for motion in self.motions if not motion.turns]
        if not moving or (self._force is None and all(motion.spring > 0 for motion in moving)):
            return
        if self._force is None:
            raise ValueError(
                f"surface.free is {self._free}, but neither surface.force nor surface.stiffness drives all of them: set "
                "surface.force."
            )
        self._surface.check_pressing(moving[-1])

    def _check_springs(self) -> None:
        """Raise a ``ValueError`` if stiffnesses without names are ambiguous."""
        count, stiffness = len(self._free), self._stiffness
        if isinstance(stiffness, dict):
            return
        if stiffness.size not in (1, count):
            raise ValueError(
                f"surface.stiffness has {stiffness.size} numbers, surface.free {count} names: name the springs, such as "
                f"surface.stiffness = {{{self._directions[0]!r}: 200.0}}."
            )
        if self.spins and stiffness.size == 1 < count and stiffness.any():
            raise ValueError(
                f"surface.stiffness is one number for {self._free}: force per length and moment per radian are two; give "
                "one for each, by name."
            )


def check_guides(value: ArrayLike, size: int) -> np.ndarray:
    """Return the user's directions as a read-only orthonormal matrix, one per row.

    Args:
        value: Directions, ``shape=(size, size)``.
        size: Dimension.

    Raises:
        ValueError: the rows are not orthonormal to within ``GUIDE_DEFECT``.
    """
    rows = finite("surface.guides", value)
    square = rows.shape == (size, size)
    if not square or np.abs(rows @ rows.T - np.eye(size)).max() > GUIDE_DEFECT:
        raise ValueError(
            f"surface.guides must be {size} directions of unit length at right angles, one a row, got {value!r}."
        )
    left, _, right = np.linalg.svd(rows)
    return frozen(left @ right)
