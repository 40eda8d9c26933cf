# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Where contact nodes stand relative to their rigid surface: frames, gaps and slips.

A node at ``x + u`` has moved by ``F (u - s)`` relative to a surface whose material point at ``x`` has moved by ``s``,
in components of its frame ``F``.  On planes gaps are linear in this motion.  On other surfaces frame and gap are taken
for the surface as it stands in the step and a position of the node, and in the step the surface is its tangent plane
there.  That position is where the last step has left the node, and then, while it matters, where this one takes it, see
``lagged/end_geometry.py``.
"""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dolfinx_contact.contact.state import State
from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.surfaces.surface import Surface, composed, cross, rotation_between

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpi4py import MPI

    from dolfinx_contact.contact.interface import ContactPoints
    from dolfinx_contact.contact.state import History

# Gap at least of nodes that cannot touch, over the largest coordinate: any that rounding leaves open.
CLEAR = 1e-9

# Radians up to which a way turns: longer ones are refused.
LONGEST = 2.0


class Placed(NamedTuple):
    """Frames and gaps of the nodes, and what they were taken for."""

    home: np.ndarray  # positions relative to the surface, (n, gdim)
    rotation: np.ndarray  # of the surface
    own: np.ndarray  # frames in the surface's axes: (gdim, gdim) for all, or (n, gdim, gdim)
    frame: np.ndarray  # the same in global components
    flat: np.ndarray  # gap less the displacement along the normal, (n,)
    points: ContactPoints
    arms: np.ndarray | None  # of nodes about the surface's point, (n, gdim), if rotations are free
    way: (
        np.ndarray | None
    )  # by what the way along the surface is more than its chord, (n, gdim - 1)
    ended: np.ndarray  # rotation of the surface at the end of the step
    # Of a deformable surface:
    at: np.ndarray | None = None  # its displacement, owned degrees of freedom
    start: np.ndarray | None = None  # that at the start of the step
    left: np.ndarray | None = None  # nodes that do not come back in the step, (n,), booleans
    renewed: int = -1  # how often rows were renewed in the step
    leaving: bool = False  # whether nodes of any rank leave the other side in the step


class Placement:
    """What makes frames, gaps and motions of ``n`` nodes relative to a surface; nothing in it changes.

    Args:
        surface: The surface.
        x: Reference positions of the nodes, ``shape=(n, gdim)``.
        dofs: Their degrees of freedom, ``shape=(n, gdim)``.
        points_in: Makes the ``ContactPoints`` of frames, ``shape=(n, gdim, gdim)``, see ``Contact.points_in``.
        extent: Largest coordinate of the mesh, on any rank.
        comm: MPI communicator.

    Methods get frames, and the ``History`` with those of the last step that converged.
    """

    def __init__(
        self,
        surface: Surface,
        x: np.ndarray,
        dofs: np.ndarray,
        points_in: Callable[[np.ndarray], ContactPoints],
        extent: float,
        comm: MPI.Comm,
    ):
        self.surface, self.x, self._comm = surface, x, comm
        self._dofs, self._points_in, self._extent, self._apart = (
            dofs,
            points_in,
            extent,
            CLEAR * extent,
        )

    # -- frames --------------------------------------------------------------------------------

    def standing(self, wanders: bool, before: Placed | None = None) -> Placed:
        """Frames and gaps where the undeformed body stands.  Collective.

        Args:
            wanders: Whether it matters where on the surface nodes are.
            before: Frames of before, whose rows stay where they are the same.
        """
        home = self.surface.relative(self.x) if wanders else self.x
        return self._placed(home, self.x, before)

    def following(
        self,
        start: np.ndarray,
        at: np.ndarray | None,
        wanders: bool,
        history: History,
        before: Placed | None,
    ) -> Placed:
        """Frames and gaps for a step, where the surface is at present.  Collective.

        Directions held by supports are not known for the new frames.

        Args:
            start: Displacement of owned degrees of freedom at the start of the step.
            at: The one with which nodes stand there; None is that at the start.
            wanders: As in ``standing``.
            history: Of the steps before.
            before: Frames with which the same step was solved before; None is none.
        """
        there = self.x + (start if at is None else at)[self._dofs]
        home = self.surface.relative(there) if wanders else history.frames.home
        frames = self._placed(home, there, before or history.frames)
        if not self.changes(history):
            return frames
        here = home if wanders else self.surface.relative(there)
        with raised_together(self._comm):
            distance = self.surface.distance(here)
            way = self.way(self.surface, here, frames.own, distance, history)
        return frames._replace(way=frozen(way))

    def saved_at(self, home: np.ndarray | None, before: Placed) -> Placed:
        """Frames and gaps at positions relative to the surface that were saved; None is where they were taken before.  Collective."""
        return self._placed(before.home if home is None else home, self.x, before)

    def _placed(self, home: np.ndarray, there: np.ndarray, before: Placed | None) -> Placed:
        """Frames and gaps at positions relative to the surface, ``there`` in space, for lever arms.  Collective."""
        surface, x = self.surface, self.x
        with raised_together(self._comm):  # the user's functions
            own = surface.frames(home)
            frame, flat = surface.turned(own), surface.distance(home)
        if home is not x:
            flat = flat - times(own, home - x)[:, -1]
        arms = None
        if surface.spins:
            arms = frozen(there - surface.point - surface.displacement)
        stands = not surface.curved and arms is None
        if before and stands and np.array_equal(before.rotation, surface.rotation):
            points = before.points
        else:
            frames = np.broadcast_to(frame, (*x.shape, x.shape[1])).copy()
            points = self._points_in(frames)
        home, own, frame, flat = map(frozen, (home, own, frame, flat))
        turned = surface.rotation
        return Placed(home, turned, own, frame, flat, points, arms, None, turned)

    def covered(self, frames: Placed) -> np.ndarray:
        """Part of each node's area that has a surface opposite."""
        return np.ones(len(self.x))

    def depth(self, frames: Placed) -> float:
        """By how many of its smallest facets nodes of this rank are on the wrong side of an undeformed deformable surface."""
        return 0.0

    @property
    def opposite(self) -> np.ndarray:
        """This rank's nodes on the other side, local indices."""
        return np.zeros(0, dtype=int)

    def strayed(self, state: State) -> tuple[float, float]:
        """How far a node has slid beyond what its frame was taken for, and how far it may: lengths.  None on rigid surfaces."""
        return 0.0, np.inf

    def twist(self, u: np.ndarray, start: np.ndarray) -> float:
        """Radians by which a deformable surface has turned against the body in a step from one displacement to another.  Collective."""
        return 0.0

    def clamped(self, fixed: np.ndarray, frames: Placed) -> np.ndarray:
        """Nodes without friction because supports hold them along the surface, and not as on a plane of symmetry, ``shape=(n,)``; ``fixed`` degrees of freedom."""
        return np.zeros(len(self.x), dtype=bool)

    def met(self, fixed: np.ndarray, frames: Placed) -> Placed:
        """Frames that know what supports hold; they are the surface's, whatever that is.  Collective."""
        return frames

    def everywhere(self, worn: np.ndarray) -> np.ndarray:
        """Depths of all nodes of a deformable surface, from those of this rank's.  Collective."""
        return worn

    def opening(
        self, points: ContactPoints, history: History, depth: np.ndarray | None = None
    ) -> np.ndarray:
        """Depth by which wear of both sides, and what a step wears, open gaps at nodes with some rows, ``shape=(n,)``, length."""
        own, other = history.sums["wear_depth"], self.opened(points, history.worn)
        worn = own if depth is None else own + depth
        return worn if other is None else worn + other

    def opened(self, points: ContactPoints, worn: np.ndarray | None) -> np.ndarray | None:
        """By what wear of a deformable surface has opened gaps, ``shape=(n,)``, length; None is nothing."""
        return None

    def taken(
        self, volume: np.ndarray, area: np.ndarray, frames: Placed, history: History
    ) -> np.ndarray:
        """Depths of the nodes of a deformable surface that have lost the volumes, ``shape=(n,)``, worn off opposite contact nodes."""
        raise NotImplementedError

    def ended(self, frames: Placed, rotation: np.ndarray | None = None) -> Placed:
        """Frames of a step that ends, and its way, where the surface has turned to at present, or to another rotation."""
        surface = self.surface
        if rotation is None:
            turned = surface.rotation
            rotation = turned if surface.spin is None else composed(surface.spin, turned)
        return frames._replace(ended=rotation, way=None)

    def follows(self, wanders: bool, history: History) -> bool:
        """Whether gaps or frames at the start of the next step are not those of the last one; the same on all ranks."""
        surface = self.surface
        turned = not np.array_equal(surface.rotation, history.frames.rotation)
        return wanders or surface.spins or turned

    # -- the way of a step ---------------------------------------------------------------------

    def changes(self, history: History) -> bool:
        """Whether distances, normals or arms may change within a step; the same on all ranks."""
        surface = self.surface
        turned = not np.array_equal(surface.rotation, history.frames.ended)
        return surface.varies or surface.spins or turned

    def turned_to(self, surface: Surface, history: History) -> np.ndarray:
        """Rotation vector, in 2-D angle, by which a surface has turned since the last step, in its axes."""
        return surface.own_axes(rotation_between(history.frames.ended, surface.rotation))

    def way(
        self,
        surface: Surface,
        y: np.ndarray,
        own: np.ndarray,
        distance: np.ndarray,
        history: History,
    ) -> np.ndarray:
        """By what the way along the surface since the last step is more than its chord, ``shape=(n, gdim - 1)``, local frame.

        Relative to the surface the nearest point goes round from one normal to the other, and about the normal as the
        surface turns.  A chord ``c`` of a turn ``psi`` belongs to the way ``(a cot a) c + psi x c / 2``, ``a = |psi| / 2``, in
        directions of its end, with ``a cot a`` across the axis and 1 along it.

        Args:
            surface: As it stands at the end.
            y: Positions at the end, relative to the surface, in its axes, ``shape=(n, gdim)``.
            own, distance: Frames and distances there.
            history: Of the steps before.
        """
        began = self.started(history)
        n1, n0 = own[..., -1, :], surface.frames(began)[..., -1, :]
        chord = y - began - distance[:, None] * n1 + history.last.gap[:, None] * n0
        way = _round(chord, n0, n1, self.turned_to(surface, history))
        return times(own[..., :-1, :], way - (y - began))

    def started(self, history: History) -> np.ndarray:
        """Positions relative to the surface at the end of the last step, in its axes, ``shape=(n, gdim)``."""
        return self.x + turned_back(history.frames.own, history.last.displacement)

    def ended_at(self, u: np.ndarray) -> tuple[Surface, np.ndarray]:
        """The surface with what it turns in the step, and positions in space for a displacement of owned degrees of freedom."""
        surface = self.surface
        if surface.spin is not None:
            surface = copy(surface)
            surface.end_step()
        return surface, self.x + u[self._dofs]

    def arms(self, displacement: np.ndarray, frames: Placed) -> np.ndarray:
        """Lever arms of the nodes about the surface's point, ``shape=(n, gdim)``, global frame, as the step has them.

        Args:
            displacement: Relative to the surface, local frame.
            frames: Those of the step.
        """
        surface = self.surface
        if frames.arms is not None:
            return frames.arms
        moved = turned_back(frames.frame, displacement) + self.of_surface(frames)
        return self.x + moved - surface.point - surface.displacement

    def last_in(self, frames: Placed, history: History) -> State:
        """The last state in the frames of another step.  Collective on deformable surfaces."""
        before, last = history.frames, history.last
        if self.surface.curved:
            moved = turned_back(before.own, last.displacement)
            last = last._replace(displacement=frozen(times(frames.own, moved)))
        if frames.points is not before.points:
            turned = carried(last.reaction, before.frame, frames.frame)
            last = last._replace(reaction=frozen(turned))
        return last

    def turned(self, frames: Placed, history: History, worn: np.ndarray) -> State:
        """The last state in frames that supports have turned, of the same nodes opposite to the same ones; ``worn`` depths, ``shape=(n,)``."""
        before, last = history.frames, history.last
        moved = times(frames.own, turned_back(before.own, last.displacement))
        reaction = carried(last.reaction, before.frame, frames.frame)
        gap = frames.flat + worn + moved[:, -1]
        return last._replace(displacement=frozen(moved), reaction=frozen(reaction), gap=frozen(gap))

    # -- motion --------------------------------------------------------------------------------

    def of_surface(self, frames: Placed) -> np.ndarray:
        """Motion of the surface at the nodes, global frame: ``shape=(gdim,)`` if it is the same for all."""
        motion, spin = self.surface.motion(self.x), self.surface.spin
        return motion if spin is None else motion + cross(spin, frames.arms)

    def surface_moved(self, frames: Placed) -> np.ndarray:
        """The same in the local frame."""
        motion, frame = self.of_surface(frames), frames.frame
        return frame @ motion if motion.ndim == 1 else times(frame, motion)

    def at_rest(self, frames: Placed) -> State:
        """The state of the undeformed body without reactions."""
        n, gdim = self.x.shape
        moved = np.broadcast_to(self.surface_moved(frames), (n, gdim))
        gap, none = frames.flat - moved[:, -1], np.zeros((n, gdim - 1))
        return State(-moved, np.zeros((n, gdim)), gap, none, np.zeros(n, dtype=np.uint8))

    def slip_past_edge(
        self, u: np.ndarray, frames: Placed, history: History
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Nodes that have left what was opposite in the step, ``shape=(n,)``, and their slip, ``shape=(n, gdim - 1)``; None where nothing can be left.  Collective."""
        return None

    def turned_past(self, displacement: np.ndarray, frames: Placed) -> np.ndarray:
        """Displacements relative to the surface with what a rotation found in the step is beyond the first order."""
        ended = copy(self.surface)
        ended.end_step()
        moved = turned_back(frames.frame, displacement) + self.of_surface(frames)
        return times(frames.own, ended.moved_past(self.x, moved))

    def gap_rounding_of(self, largest: float) -> float:
        """Bound of the rounding in a gap beside lengths of that size; a rank may have the origin alone."""
        return 16 * np.finfo(float).eps * max(self._extent, largest)

    @property
    def clear(self) -> float:
        """Gap of nodes that cannot touch, at least."""
        return self._apart

    # -- checkpoints ---------------------------------------------------------------------------

    def save(self, frames: Placed) -> dict[str, np.ndarray]:
        """What the frames were taken for, as arrays by name."""
        surface, saved = self.surface, {}
        if surface.varies:
            saved["home"] = frames.home
        if frames.rotation.any():
            saved["rotation_of_plane"] = frames.rotation
        if surface.spins:
            saved["found_rotation_of_plane"] = surface.rotation
        return saved


def times(frame: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Components of ``vectors``, ``shape=(n, gdim)``, in one frame or a frame each."""
    return (frame @ vectors[:, :, None])[:, :, 0]


def turned_back(frame: np.ndarray, components: np.ndarray) -> np.ndarray:
    """Vectors of these components, ``shape=(n, gdim)``, in one frame or a frame each."""
    return (components[:, None, :] @ frame)[:, 0]


def _round(chord: np.ndarray, n0: np.ndarray, n1: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """Ways of these chords, see ``Placement.way``; ``turned`` is the surface's rotation in its own axes."""
    n0, n1 = np.broadcast_to(n0, chord.shape), np.broadcast_to(n1, chord.shape)
    if chord.shape[1] == 2:
        across = n0[:, 0] * n1[:, 1] - n0[:, 1] * n1[:, 0]
        psi = np.arctan2(across, (n0 * n1).sum(axis=1))
        psi = np.clip(psi, -LONGEST, LONGEST)[:, None]
        turning = psi * np.column_stack((-chord[:, 1], chord[:, 0]))
        return _cot(np.abs(psi) / 2) * chord + turning / 2
    across = np.cross(n0, n1)
    sine = np.linalg.norm(across, axis=1)
    angle = np.arctan2(sine, (n0 * n1).sum(axis=1))
    psi = across * np.divide(angle, sine, np.zeros_like(sine), where=sine > 0)[:, None]
    psi -= (n1 @ turned)[:, None] * n1
    size = np.linalg.norm(psi, axis=1, keepdims=True)
    axis = np.divide(psi, size, np.zeros_like(psi), where=size > 0)
    size = np.minimum(size, LONGEST)
    along = (axis * chord).sum(axis=1, keepdims=True) * axis
    return _cot(size / 2) * (chord - along) + along + size * np.cross(axis, chord) / 2


def _cot(a: np.ndarray) -> np.ndarray:
    """``a cot a``, 1 at zero."""
    return np.divide(a, np.tan(a), np.ones_like(a), where=a > 0)


def carried(reaction: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Reactions in other frames: friction keeps its length and, as far as it can, its direction in space."""
    found, tangential = reaction.copy(), reaction.copy()
    tangential[:, -1] = 0.0
    along = times(after, turned_back(before, tangential))[:, :-1]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    kept = np.linalg.norm(tangential, axis=1, keepdims=True)
    found[:, :-1] = np.divide(kept, length, np.zeros_like(length), where=length > 0) * along
    return found
