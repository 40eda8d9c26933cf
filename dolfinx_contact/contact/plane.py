"""Rigid planes: position, normal and the directions in which friction is measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact.attributes import frozen
from dolfinx_contact.checks import finite
from dolfinx_contact.contact.surface import RigidSurface, unit, vector


class RigidPlane(RigidSurface):
    """A rigid plane on which bodies press and slide, driven by displacement or by force.

    Along the directions in ``free`` the plane moves until its forces are in equilibrium, see docs/force.md:

        sum of the reactions = force + stiffness (drive - displacement).

    Args:
        point: Any point of the plane, ``shape=(gdim,)``, global frame, length units, ``gdim`` 2 or 3.
        normal: Direction towards the side where the body may be, ``shape=(gdim,)``; need not be of
            unit length.
        axis: First principal friction direction, ``shape=(gdim,)``; made orthogonal to the normal.
            Needed unless friction is isotropic or the body two-dimensional.
        height: None, or a function of positions ``y``, ``shape=(gdim, n)``, in axes that move with the plane: the
            waviness of its face, ``shape=(n,)``, length units, whose slopes are neglected.

    Raises:
        ValueError: a vector of the wrong size, not finite, complex or zero; an axis along the normal.

    Attributes:
        point, normal, axis: As given, the latter two of unit length; read-only.
        displacement: Displacement of the plane from its first position, ``shape=(gdim,)``, global
            frame, length units; zero at first, a read-only array.  Assign another one between steps: the plane
            moves, and slip is relative to it.  Along free directions a step finds it.
        rotation: About ``point``, radians, a rotation vector, ``shape=(3,)``, in two dimensions an angle; zero at first.
            Assigned between steps: normal and axis turn with the plane, and slip is relative to it.
        free: Directions of the frame along which a force drives the plane, a tuple of "t1", "t2" and "n", in two
            dimensions of "t" and "n"; none at first.
        force: Force of the plane on the bodies, ``shape=(gdim,)``, global frame; None is no force.  Its components along
            directions that are not free do not count: a guide carries the rest.
        stiffness: Of a spring that pulls the plane along the free directions, force per length: a number, or one for
            each of them; zero, a dead load, at first.
        drive: Displacement of the spring's far end, ``shape=(gdim,)``, global frame, length units.
    """

    _remedy = "make a new RigidPlane and a new Contact; plane.displacement and plane.rotation move a plane."

    def __init__(
        self,
        point: ArrayLike,
        normal: ArrayLike,
        axis: ArrayLike | None = None,
        height: Callable[[np.ndarray], ArrayLike] | None = None,
    ) -> None:
        super().__init__(point)
        size = self.point.size
        if not (height is None or callable(height)):
            raise ValueError(f"height must be a function of positions, got {height!r}.")
        self.height, self.varies = height, height is not None
        self.normal = frozen(unit("normal", normal, size))
        self._drive = frozen(np.zeros(size))
        self._free: tuple[str, ...] = ()
        self._force: np.ndarray | None = None
        self._stiffness = frozen(np.zeros(1))
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
        """Names of the rows of ``frame``."""
        return ("t", "n") if self.point.size == 2 else ("t1", "t2", "n")

    @property
    def free(self) -> tuple[str, ...]:
        return self._free

    @free.setter
    def free(self, names: Sequence[str]) -> None:
        known = self.directions
        if not isinstance(names, (tuple, list)) or any(name not in known for name in names):
            raise ValueError(
                f"plane.free must be a tuple of names among {known}, such as ('n',), got {names!r}."
            )
        self._free = tuple(name for name in known if name in names)

    @property
    def force(self) -> np.ndarray | None:
        return self._force

    @force.setter
    def force(self, value: ArrayLike | None) -> None:
        size = self.point.size
        self._force = None if value is None else frozen(vector("plane.force", value, size))

    @property
    def stiffness(self) -> np.ndarray:
        return self._stiffness

    @stiffness.setter
    def stiffness(self, value: ArrayLike) -> None:
        array = np.atleast_1d(finite("plane.stiffness", value))
        if array.ndim != 1 or array.size > self.point.size or not (array >= 0).all():
            raise ValueError(
                "plane.stiffness must be a number, or one for each free direction, zero or more, got "
                f"{value!r}."
            )
        self._stiffness = frozen(array)

    @property
    def drive(self) -> np.ndarray:
        return self._drive

    @drive.setter
    def drive(self, value: ArrayLike) -> None:
        self._drive = frozen(vector("plane.drive", value, self.point.size))

    @property
    def free_axes(self) -> np.ndarray:
        """Unit vectors of the free directions, ``shape=(m, gdim)``, global frame."""
        return self.frame[[self.directions.index(name) for name in self._free]]

    @property
    def springs(self) -> np.ndarray:
        """Stiffness of the spring along each free direction, ``shape=(m,)``, force per length."""
        return np.broadcast_to(self._stiffness, len(self._free))

    def driven(self) -> str:
        """What drives the plane, in words."""
        given = (self._free, self._force, self._stiffness, self._drive)
        return repr(tuple(v.tolist() if isinstance(v, np.ndarray) else v for v in given))

    def check_drive(self) -> None:
        """Raise a ``ValueError`` if no force drives what is free, or the plane would leave the body."""
        if self._stiffness.size not in (1, len(self._free)):
            raise ValueError(
                f"plane.stiffness has {self._stiffness.size} numbers, plane.free {len(self._free)} names."
            )
        if not self._free or (self._force is None and self.springs.all()):
            return
        if self._force is None:
            raise ValueError(
                f"plane.free is {self._free}, but neither plane.force nor plane.stiffness drives all of them: set "
                "plane.force."
            )
        pressing = float(self._force @ self.frame[-1])
        if self._free[-1] == "n" and self.springs[-1] == 0 and pressing <= 0:
            raise ValueError(
                f"plane.force {self._force.tolist()} does not press the plane on the body: its component along the "
                f"normal is {pressing:g}, must be positive, and nothing else holds the plane. It is the force of the "
                "plane on the body; a spring, plane.stiffness, also pulls."
            )

    @property
    def frame(self) -> np.ndarray:
        """Rows (t1, t2, n) in three dimensions, (t, n) in two; global components, orthonormal.

        Without an axis, t1 is the coordinate direction that is most tangential, made orthogonal.
        In two dimensions t is the normal turned by -90 degrees.  They turn with the plane.
        """
        return self.turned(self._frame())

    def _frame(self) -> np.ndarray:
        """The frame as long as the plane is not turned."""
        n = self.normal
        if n.size == 2:
            return np.array([[n[1], -n[0]], n])
        t1 = self.axis
        if t1 is None:
            t1 = np.eye(3)[np.argmin(np.abs(n))]
            t1 = t1 - (t1 @ n) * n
            t1 /= np.linalg.norm(t1)
        return np.array([t1, np.cross(n, t1), n])

    def frames(self, y: np.ndarray) -> np.ndarray:
        """The same frame at all positions, ``shape=(gdim, gdim)``."""
        return self._frame()

    def distance(self, y: np.ndarray) -> np.ndarray:
        """Distance to the plane, ``shape=(n,)``, less the height of its face."""
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
        """Point and frame."""
        return np.concatenate((self.point, self._frame().ravel()))

    def __repr__(self) -> str:
        axis = None if self.axis is None else self.axis.tolist()
        height = "" if self.height is None else ", height=..."
        return f"RigidPlane(point={self.point.tolist()}, normal={self.normal.tolist()}, axis={axis}{height})"
