# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Where contact nodes stand relative to their rigid surface: frames, gaps and slips.

A node at ``x + u`` has moved by ``F (u - s)`` relative to a surface whose material point at ``x`` has moved by ``s``,
in components of its frame ``F``.  On planes gaps are linear in this motion.  On other surfaces frame and gap are taken
for the surface as it stands in the step and the node as the last step has left it, and in the step the surface is its
tangent plane there, see docs/surfaces.md.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping
from copy import copy
from typing import Any, NamedTuple

import numpy as np
from dolfinx import fem

from dolfinx_contact.contact.friction_field import guided
from dolfinx_contact.contact.interface import ContactPoints
from dolfinx_contact.contact.results import ContactResults
from dolfinx_contact.contact.state import ContactHistory, State, Status
from dolfinx_contact.law.friction import Friction
from dolfinx_contact.law.supported import supported
from dolfinx_contact.step.errors import EPSILON
from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.surfaces.surface import cross


class Placed(NamedTuple):
    """Frames and gaps of the nodes, and what they were taken for."""

    home: np.ndarray  # positions relative to the surface, (n, gdim)
    rotation: np.ndarray  # of the surface
    own: np.ndarray  # frames in the surface's axes: (gdim, gdim) for all, or (n, gdim, gdim)
    frame: np.ndarray  # the same in global components
    flat: np.ndarray  # gap less the displacement along the normal, (n,)
    points: ContactPoints
    arms: np.ndarray | None  # of nodes about the surface's point, (n, gdim), if rotations are free


class ContactKinematics(ContactResults):
    """Motion of the nodes of a ``Contact``, which has ``V``, ``displacements``, ``nodes``, ``x`` and ``surface``."""

    _placed: Any = None  # ``Placed``
    _free_friction: Any = None  # with what it was made of
    _dragged: Any = None
    _usual: tuple = (
        None,
    ) * 3  # friction, points and last state with which all nodes have the kernel's law
    _known: Any = (
        None  # slip that supports prescribe in the present state, None where there is none
    )
    _settled: Any = None  # the same and the last state, at the end of the last step

    @property
    def frame(self) -> np.ndarray:
        """Rows (t1, t2, n), in 2-D (t, n), of the last step: ``shape=(gdim, gdim)``; on curved surfaces ``(n, gdim, gdim)``."""
        return self._placed.frame

    @property
    def points(self) -> ContactPoints:
        """The ``ContactPoints``: motion as a sparse operator, directions that supports hold."""
        return self._placed.points

    @property
    def home(self) -> np.ndarray:
        """Positions relative to the surface for which frames and gaps were taken, in its axes, ``shape=(n, gdim)``."""
        return self._placed.home

    @property
    def own_frame(self) -> np.ndarray:
        """As ``frame``, in the axes of the surface."""
        return self._placed.own

    @property
    def _wanders(self) -> bool:
        """Whether it matters where on the surface nodes are."""
        return self.surface.varies or self.textured

    @property
    def _at(self) -> np.ndarray:
        return self.x[:, : self.V.mesh.geometry.dim]

    @property
    def arms(self) -> np.ndarray:
        """Lever arms of the nodes about the surface's point, ``shape=(n, gdim)``, global frame, at the start of a step."""
        arms = self._placed.arms
        return self._at - self.surface.point - self.surface.displacement if arms is None else arms

    # -- frames --------------------------------------------------------------------------------

    def place(self, home: np.ndarray | None = None, there: np.ndarray | None = None) -> None:
        """Take frames and gaps at positions relative to the surface; None is where the undeformed body stands.

        ``there`` are positions in space, with None those of the undeformed body, for lever arms.  Collective.
        """
        surface, x = self.surface, self._at
        if home is None:
            home = surface.relative(x) if self._wanders else x
        with raised_together(self.comm):  # the user's functions
            own = surface.frames(home)
            frame, flat = surface.turned(own), surface.distance(home)
        if home is not x:
            flat = flat - _times(own, home - x)[:, -1]
        before = self._placed
        arms = None
        if surface.spins:
            arms = frozen((x if there is None else there) - surface.point - surface.displacement)
        stands = not surface.curved and arms is None
        if before and stands and np.array_equal(before.rotation, surface.rotation):
            points = before.points
        else:
            points = self._points_of(frame)
        home, own, frame, flat = map(frozen, (home, own, frame, flat))
        self._placed = Placed(home, surface.rotation, own, frame, flat, points, arms)

    def _points_of(self, frame: np.ndarray) -> ContactPoints:
        n, gdim = self._at.shape
        frames = np.broadcast_to(frame, (n, gdim, gdim)).copy()
        return ContactPoints(self.displacements.dofs(self.nodes), frames, self.displacements.size)

    @property
    def follows(self) -> bool:
        """Whether gaps or frames at the start of the next step are not those of the last one; the same on all ranks."""
        surface = self.surface
        return (
            self._wanders
            or surface.spins
            or not np.array_equal(surface.rotation, self._placed.rotation)
        )

    def follow(self, u: np.ndarray) -> None:
        """Take frames and gaps for the next step, where the surface is at present.

        Directions held by supports are not known for the new frames.

        Args:
            u: Displacement of owned degrees of freedom with which nodes stand there, that of the last step.
        """
        (placed, last), surface = self._settled, self.surface
        there = self._at + u[self.points.dofs]
        self.place(surface.relative(there) if self._wanders else placed.home, there)
        now = self._placed
        if surface.curved:
            moved = _turned_back(placed.own, last.displacement)
            last = last._replace(displacement=frozen(_times(now.own, moved)))
        if now.points is not placed.points:
            carried = _carried(last.reaction, placed.frame, now.frame)
            last = last._replace(reaction=frozen(carried))
        self._last = last
        ContactHistory.restore(self)  # the state alone

    # -- motion --------------------------------------------------------------------------------

    def reset(self) -> None:
        """Forget the history: undeformed, unworn body, no reactions, the plane where it is now."""
        self._settled_by = self._settled = None
        if self.follows:
            self.place()
        n, gdim = self.points.count, self.points.dim
        moved = np.broadcast_to(self._moved(), (n, gdim))
        self.begin(
            State(
                -moved,
                np.zeros((n, gdim)),
                self._placed.flat - moved[:, -1],
                np.zeros((n, gdim - 1)),
                np.full(n, int(Status.OPEN), dtype=np.uint8),
            )
        )
        self._settle_here()

    def _moved(self) -> np.ndarray:
        """Motion of the surface at the nodes, local frame: ``shape=(gdim,)`` if it is the same for all."""
        motion = self._carried()
        return self.frame @ motion if motion.ndim == 1 else _times(self.frame, motion)

    def _carried(self) -> np.ndarray:
        """Motion of the surface at the nodes, global frame: ``shape=(gdim,)`` if it is the same for all."""
        motion, spin = self.surface.motion(self._at), self.surface.spin
        return motion if spin is None else motion + cross(spin, self._placed.arms)

    def carried_by(self, axis: np.ndarray, turns: bool) -> np.ndarray:
        """What moving the surface by one along, or turning it about an axis, moves at the nodes, local frame."""
        shape = (self.points.count, self.points.dim)
        if turns:
            return _times(self.frame, cross(axis, self._placed.arms))
        along = self.frame @ axis  # the axes of a plane are those of its frame
        return np.broadcast_to(along if self.surface.curved else np.rint(along), shape)

    def move(self, u: fem.Function | np.ndarray) -> None:
        """Gaps and slip increments for a displacement, from the last converged step on.

        Args:
            u: Function on ``V``, or the array of its owned degrees of freedom; length units.
        """
        values = u.x.array if hasattr(u, "x") else u
        motion, moved = self.points.motion(values[: self.points.size]), self._moved()
        displacement = motion - moved
        gap = self._placed.flat + self.wear_depth + displacement[:, -1]
        since = displacement - self.last.displacement
        self._known = self.points.known(since, (motion, moved, self.last.displacement))
        slip = since[:, :-1]
        self.points.without_held(slip)
        if self._known is not None:
            slip += self._known
        closed = self.points.closed
        gap[closed] = np.maximum(gap[closed], self._apart)
        self.take(displacement=displacement, gap=gap, slip_increment=slip)

    @property
    def known_slip(self) -> np.ndarray:
        """Part of ``slip_increment`` that supports prescribe, ``shape=(n, gdim - 1)``, local frame, length units."""
        return np.zeros_like(self.slip_increment) if self._known is None else self._known

    @property
    def dragged(self) -> np.ndarray | None:
        """Slip of held nodes past which force drives the surface, ``shape=(n, gdim - 1)``, a direction; None is nowhere."""
        return self._dragged

    def drag(self, slip: np.ndarray | None) -> None:
        """From now on held nodes with such a slip have the friction against it, whatever the present one is."""
        self._dragged = slip

    @property
    def free_friction(self) -> Friction:
        """Friction along the directions that supports leave free: at guided nodes, whose slip is along ``f``, ``f.d(f)``."""
        along = self.points.along
        if not along.any() or self.friction.frictionless:
            return self.friction
        known = self._free_friction
        if known is None or known[0] is not self.friction or known[1] is not along:
            found = guided(self.friction, self.points.count, self.points.supported, along)
            self._free_friction = known = self.friction, along, found
        return known[2]

    def law_of(self, law, nodes=slice(None)) -> Any:
        """What takes the place of the kernel's law of some nodes where supports move, guide, or have moved them.

        Args:
            law: Of the kernel, of these nodes.
            nodes: Their indices, ``shape=(k,)``; all of them by default.
        """
        points = self.points
        if not points.supported.size or self.friction.frictionless:
            return law
        state = self.friction, points, self.last
        still = self._known is None and self.dragged is None
        if still and all(map(operator.is_, self._usual, state)):
            return law
        rows = np.arange(points.count)[nodes]
        at = np.searchsorted(points.supported, rows)
        at[at == points.supported.size] = 0
        mine = points.supported[at] == rows
        known, last = self.known_slip[rows], self.last.reaction[rows, :-1]
        if self.dragged is not None:
            known = np.where(self.dragged[rows] != 0.0, self.dragged[rows], known)
        friction = self.friction if isinstance(nodes, slice) else self.friction.at(rows)
        found = supported(law, friction, np.flatnonzero(mine), points.along[at[mine]], known, last)
        if found is law and still and isinstance(nodes, slice):
            self._usual = state
        return found

    def gap_rounding(self, u: np.ndarray) -> float:
        """Bound of the rounding in a gap, that of solving for ``u`` included, length units."""
        lengths = (self.x, self.surface.point, self.surface.displacement, self.points.motion(u))
        return 16 * np.finfo(float).eps * max(np.abs(length).max(initial=0.0) for length in lengths)

    def motion_rounding(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Estimate of the rounding in each gap, ``shape=(n,)``, and slip, ``shape=(n, gdim - 1)``, length units.

        That of the coordinates counts in the gap: a body drawn to rest on the plane may stand a last digit below it.

        Args:
            u: Displacement of owned degrees of freedom, for which gaps and slips were computed.
        """
        motion = np.abs(self._carried())
        felt = (
            np.abs(self.frame) @ motion if motion.ndim == 1 else _times(np.abs(self.frame), motion)
        )
        terms = self.points.magnitudes(u) + felt
        coordinates = max(np.abs(a).max(initial=0.0) for a in (self.x, self.surface.point))
        gap = terms[:, -1] + coordinates + self.wear_depth
        slip = terms[:, :-1] + np.abs(self.last.displacement[:, :-1])
        if self._known is None:
            slip[self.points.held] = 0.0
        return EPSILON * gap, EPSILON * slip

    # -- history -------------------------------------------------------------------------------

    def _settle_here(self) -> None:
        self._settled = self._placed, self._last

    @property
    def law_before(self) -> Friction | None:
        """The law by which the last step was settled, its axes carried in space to the frames of this one; None before the first."""
        law = self._settled_by
        if law is None or law.axes is None or self._settled[0].points is self.points:
            return law
        n, gdim = self._at.shape
        axes = np.column_stack((law.axes, np.zeros((n, gdim - 2))))
        axes = _carried(axes, self._settled[0].frame, self.frame)[:, :2]
        return Friction(law.mu, np.where(law.mu > 0, law.p, 1.0), axes=axes)

    def settle(
        self, work: np.ndarray, path: np.ndarray, depth: np.ndarray, kept: np.ndarray
    ) -> None:
        """See ``ContactHistory``; with what a rotation found in the step is beyond the first order."""
        super().settle(work, path, depth, kept)
        if self.surface.spin is not None:
            ended = copy(self.surface)
            ended.end_step()
            moved = _turned_back(self.frame, self.displacement) + self._carried()
            turned = ended.moved_past(self._at, moved)
            self._last = self._last._replace(displacement=frozen(_times(self._placed.own, turned)))
        self._settle_here()

    def restore(self) -> None:
        """Return to the last converged state and its frames."""
        if self._settled is not None:
            self._placed, self._last = self._settled
        super().restore()

    def save(self) -> dict[str, np.ndarray]:
        """See ``ContactLaws``; with what the frames were taken for."""
        saved, placed = super().save(), self._placed
        if self.surface.varies:
            saved["home"] = placed.home
        if placed.rotation.any():
            saved["rotation_of_plane"] = placed.rotation
        if self.surface.spins:
            saved["found_rotation_of_plane"] = self.surface.rotation
        return saved

    def check_saved(self, saved: Mapping[str, np.ndarray]) -> None:
        """See ``ContactLaws``."""
        super().check_saved(saved)
        if self.surface.varies and "home" not in saved:
            raise ValueError(f"checkpoint: it was written with another plane: here {self.surface}.")

    def load(self, saved: Mapping[str, np.ndarray]) -> None:
        """See ``ContactLaws``."""
        surface, self._settled = self.surface, None
        surface.rotation = saved.get("rotation_of_plane", np.zeros_like(surface.rotation))
        if self.follows:
            self.place(np.array(saved["home"]) if surface.varies else self._placed.home)
        super().load(saved)
        self._settle_here()
        surface.rotation = saved.get("found_rotation_of_plane", surface.rotation)

    def history(self) -> tuple:
        """See ``ContactHistory``; with the frames."""
        return self._placed, super().history()

    def go_back(self, history: tuple) -> None:
        """Take back what ``history`` returned."""
        self._settled, (self._placed, rest) = None, history
        super().go_back(rest)
        self._settle_here()


def _times(frame: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Components of ``vectors``, ``shape=(n, gdim)``, in one frame or a frame each."""
    return (frame @ vectors[:, :, None])[:, :, 0]


def _turned_back(frame: np.ndarray, components: np.ndarray) -> np.ndarray:
    """Vectors of these components, ``shape=(n, gdim)``, in one frame or a frame each."""
    return (components[:, None, :] @ frame)[:, 0]


def _carried(reaction: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Reactions in other frames: friction keeps its length and, as far as it can, its direction in space."""
    carried, tangential = reaction.copy(), reaction.copy()
    tangential[:, -1] = 0.0
    along = _times(after, _turned_back(before, tangential))[:, :-1]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    kept = np.linalg.norm(tangential, axis=1, keepdims=True)
    carried[:, :-1] = np.divide(kept, length, np.zeros_like(length), where=length > 0) * along
    return carried
