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
    at: np.ndarray | None = None  # displacement of a deformable surface, owned degrees of freedom


class Placement:
    """Frames, gaps and motions of ``n`` nodes relative to a surface.

    Args:
        surface: The surface.
        x: Reference positions of the nodes, ``shape=(n, gdim)``.
        dofs: Their degrees of freedom, ``shape=(n, gdim)``.
        points_in: Makes the ``ContactPoints`` of frames, ``shape=(n, gdim, gdim)``, see ``Contact.points_in``.
        extent: Largest coordinate of the mesh, on any rank.
        comm: MPI communicator.

    Attributes:
        now: ``Placed``, of the present step.
        settled: That of the last step that converged.
    """

    now: Placed
    settled: Placed

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
        self._place(surface.relative(x) if surface.varies else x, x, None)
        self.settle()

    # -- frames --------------------------------------------------------------------------------

    def stand(self, wanders: bool) -> None:
        """Take frames and gaps where the undeformed body stands.  Collective.

        Args:
            wanders: Whether it matters where on the surface nodes are.
        """
        self._place(self.surface.relative(self.x) if wanders else self.x, self.x, self.now)

    def follow(self, u: np.ndarray, start: np.ndarray, wanders: bool, last: State) -> None:
        """Take frames and gaps for the next step, where the surface is at present.  Collective.

        Directions held by supports are not known for the new frames.

        Args:
            u: Displacement of owned degrees of freedom with which nodes stand there.
            start: That at the start of the step.
            wanders: As in ``stand``.
            last: The last converged state, in the frames of its step.
        """
        there = self.x + u[self._dofs]
        home = self.surface.relative(there) if wanders else self.settled.home
        self._place(home, there, self.now)
        if self.changes:
            here = home if wanders else self.surface.relative(there)
            with raised_together(self._comm):
                distance = self.surface.distance(here)
                way = self.way(self.surface, here, self.now.own, distance, last)
            self.now = self.now._replace(way=frozen(way))

    def back_to(self, home: np.ndarray | None) -> None:
        """Take frames and gaps at positions relative to the surface that were saved; None is where they were taken last."""
        self._place(self.now.home if home is None else home, self.x, self.now)

    def _place(self, home: np.ndarray, there: np.ndarray, before: Placed | None) -> None:
        """Take frames and gaps at positions relative to the surface, ``there`` in space, for lever arms.  Collective."""
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
        self.now = Placed(home, turned, own, frame, flat, points, arms, None, turned)

    @property
    def covered(self) -> np.ndarray:
        """Part of each node's area that has a surface opposite."""
        return np.ones(len(self.x))

    @property
    def depth(self) -> float:
        """By how many of its smallest facets nodes of this rank are on the wrong side of an undeformed deformable surface."""
        return 0.0

    @property
    def opposite(self) -> np.ndarray:
        """This rank's nodes on the other side, local indices."""
        return np.zeros(0, dtype=int)

    def strayed(self, state: State) -> tuple[float, float]:
        """How far a node has slid beyond what its frame was taken for, and how far it may: lengths.  None on rigid surfaces."""
        return 0.0, np.inf

    def twist(self, u: np.ndarray) -> float:
        """Radians by which a deformable surface has turned against the body in a step that ends at a displacement.  Collective."""
        return 0.0

    def clamped(self, fixed: np.ndarray) -> np.ndarray:
        """Nodes without friction because supports hold them along the surface, and not as on a plane of symmetry, ``shape=(n,)``; ``fixed`` degrees of freedom."""
        return np.zeros(len(self.x), dtype=bool)

    def meet(self, fixed: np.ndarray) -> bool:
        """Frames are the surface's, whatever supports hold: whether they are others now."""
        return False

    def settle(self, worn: np.ndarray | None = None) -> None:
        """These are the frames of the last step that converged; ``worn`` depths of the nodes of a deformable surface, ``shape=(k,)``."""
        self.settled = self.now

    def opened(self, points: ContactPoints) -> np.ndarray | None:
        """By what wear of a deformable surface has opened gaps, ``shape=(n,)``, length; None is nothing."""
        return None

    def taken(self, volume: np.ndarray, area: np.ndarray) -> np.ndarray:
        """Depths of the nodes of a deformable surface that have lost the volumes, ``shape=(n,)``, worn off opposite contact nodes."""
        raise NotImplementedError

    def end(self, rotation: np.ndarray | None = None) -> None:
        """The step ends, and its way, where the surface has turned to at present, or to another rotation."""
        surface = self.surface
        if rotation is None:
            turned = surface.rotation
            rotation = turned if surface.spin is None else composed(surface.spin, turned)
        self.now = self.now._replace(ended=rotation, way=None)

    def restore(self, placed: Placed | None = None) -> None:
        """Return to the frames of the last step that converged, or to others that were kept."""
        self.now = self.settled if placed is None else placed

    def follows(self, wanders: bool) -> bool:
        """Whether gaps or frames at the start of the next step are not those of the last one; the same on all ranks."""
        surface = self.surface
        turned = not np.array_equal(surface.rotation, self.now.rotation)
        return wanders or surface.spins or turned

    # -- the way of a step ---------------------------------------------------------------------

    @property
    def changes(self) -> bool:
        """Whether distances, normals or arms may change within a step; the same on all ranks."""
        surface = self.surface
        turned = not np.array_equal(surface.rotation, self.settled.ended)
        return surface.varies or surface.spins or turned

    def turned_to(self, surface: Surface) -> np.ndarray:
        """Rotation vector, in 2-D angle, by which a surface has turned since the last step, in its axes."""
        return surface.own_axes(rotation_between(self.settled.ended, surface.rotation))

    def way(
        self, surface: Surface, y: np.ndarray, own: np.ndarray, distance: np.ndarray, last: State
    ) -> np.ndarray:
        """By what the way along the surface since the last step is more than its chord, ``shape=(n, gdim - 1)``, local frame.

        Relative to the surface the nearest point goes round from one normal to the other, and about the normal as the
        surface turns.  A chord ``c`` of a turn ``psi`` belongs to the way ``(a cot a) c + psi x c / 2``, ``a = |psi| / 2``, in
        directions of its end, with ``a cot a`` across the axis and 1 along it.

        Args:
            surface: As it stands at the end.
            y: Positions at the end, relative to the surface, in its axes, ``shape=(n, gdim)``.
            own, distance: Frames and distances there.
            last: The last converged state, in the frames of its step.
        """
        began = self.started(last)
        n1, n0 = own[..., -1, :], surface.frames(began)[..., -1, :]
        chord = y - began - distance[:, None] * n1 + last.gap[:, None] * n0
        way = _round(chord, n0, n1, self.turned_to(surface))
        return times(own[..., :-1, :], way - (y - began))

    def started(self, last: State) -> np.ndarray:
        """Positions relative to the surface at the end of the last step, in its axes, ``shape=(n, gdim)``."""
        return self.x + turned_back(self.settled.own, last.displacement)

    def ended_at(self, u: np.ndarray) -> tuple[Surface, np.ndarray]:
        """The surface with what it turns in the step, and positions in space for a displacement of owned degrees of freedom."""
        surface = self.surface
        if surface.spin is not None:
            surface = copy(surface)
            surface.end_step()
        return surface, self.x + u[self._dofs]

    def arms(self, displacement: np.ndarray) -> np.ndarray:
        """Lever arms of the nodes about the surface's point, ``shape=(n, gdim)``, global frame, as the step has them.

        Args:
            displacement: Relative to the surface, local frame.
        """
        surface, now = self.surface, self.now
        if now.arms is not None:
            return now.arms
        moved = turned_back(now.frame, displacement) + self.of_surface()
        return self.x + moved - surface.point - surface.displacement

    def carried(self, last: State) -> State:
        """The last state in the frames of the next step."""
        before, now = self.settled, self.now
        if self.surface.curved:
            moved = turned_back(before.own, last.displacement)
            last = last._replace(displacement=frozen(times(now.own, moved)))
        if now.points is not before.points:
            last = last._replace(reaction=frozen(carried(last.reaction, before.frame, now.frame)))
        return last

    def turned(self, last: State, worn: np.ndarray) -> State:
        """The last state in frames that supports have turned, of the same nodes opposite to the same ones; ``worn`` depths, ``shape=(n,)``."""
        before, now = self.settled, self.now
        moved = times(now.own, turned_back(before.own, last.displacement))
        reaction, gap = carried(last.reaction, before.frame, now.frame), now.flat + worn + moved[:, -1]  # fmt: skip
        return last._replace(displacement=frozen(moved), reaction=frozen(reaction), gap=frozen(gap))

    # -- motion --------------------------------------------------------------------------------

    def of_surface(self) -> np.ndarray:
        """Motion of the surface at the nodes, global frame: ``shape=(gdim,)`` if it is the same for all."""
        motion, spin = self.surface.motion(self.x), self.surface.spin
        return motion if spin is None else motion + cross(spin, self.now.arms)

    def surface_moved(self) -> np.ndarray:
        """The same in the local frame."""
        motion, frame = self.of_surface(), self.now.frame
        return frame @ motion if motion.ndim == 1 else times(frame, motion)

    def at_rest(self) -> State:
        """The state of the undeformed body without reactions."""
        n, gdim = self.x.shape
        moved = np.broadcast_to(self.surface_moved(), (n, gdim))
        gap, none = self.now.flat - moved[:, -1], np.zeros((n, gdim - 1))
        return State(-moved, np.zeros((n, gdim)), gap, none, np.zeros(n, dtype=np.uint8))

    def slip_past_edge(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Nodes that have left what was opposite in the step, ``shape=(n,)``, and their slip, ``shape=(n, gdim - 1)``; None where nothing can be left.  Collective."""
        return None

    def turned_past(self, displacement: np.ndarray) -> np.ndarray:
        """Displacements relative to the surface with what a rotation found in the step is beyond the first order."""
        ended = copy(self.surface)
        ended.end_step()
        moved = turned_back(self.now.frame, displacement) + self.of_surface()
        return times(self.now.own, ended.moved_past(self.x, moved))

    def gap_rounding_of(self, largest: float) -> float:
        """Bound of the rounding in a gap beside lengths of that size; a rank may have the origin alone."""
        return 16 * np.finfo(float).eps * max(self._extent, largest)

    @property
    def clear(self) -> float:
        """Gap of nodes that cannot touch, at least."""
        return self._apart

    # -- checkpoints ---------------------------------------------------------------------------

    def save(self) -> dict[str, np.ndarray]:
        """What the frames were taken for, as arrays by name."""
        surface, saved = self.surface, {}
        if surface.varies:
            saved["home"] = self.now.home
        if self.now.rotation.any():
            saved["rotation_of_plane"] = self.now.rotation
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
