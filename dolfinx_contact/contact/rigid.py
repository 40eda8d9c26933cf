# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Frames, gaps and path lengths of contact nodes on a rigid surface."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.contact.geometry import Frames, NodalGeometry, carried, times, to_global
from dolfinx_contact.contact.state import History, State
from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.surfaces.surface import Surface, rotation_between

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.interface import ContactPoints

# Largest turn in a path length, radians: well below pi, where ``a cot a`` becomes zero.  Longer
# paths are refused at the end of the step.
LONGEST_TURN = 2.0

# Largest penetration at the start without a warning, relative to the size of the body.  Also the
# smallest extent of a body above a plane, relative to its extent below, for a normal that is
# taken as correct.
DEEP_START = 0.1


class RigidGeometry(NodalGeometry):
    """Geometry of contact nodes on a plane, which may rotate, or on a curved rigid surface.

    Args:
        given: Arguments of ``NodalGeometry``.
        points_in: Function that returns the ``ContactPoints`` for frames,
            ``shape=(n, gdim, gdim)``, see ``Contact.points_in``.
    """

    def __init__(self, *given: Any, points_in: Callable[[np.ndarray], ContactPoints]):
        super().__init__(*given)
        self._points_in = points_in

    def standing(self, depends_on_position: bool, before: Frames | None = None) -> Frames:
        """See ``Geometry``."""
        home = self.surface.relative(self.x) if depends_on_position else self.x
        return self._placed(home, self.x, before)

    def following(
        self,
        start: np.ndarray,
        at: np.ndarray | None,
        depends_on_position: bool,
        history: History,
        before: Frames | None,
    ) -> Frames:
        """See ``Geometry``."""
        there = self.x + (start if at is None else at)[self._dofs]
        home = self.surface.relative(there) if depends_on_position else history.frames.home
        frames = self._placed(home, there, before or history.frames)
        if not self.changes(history):
            return frames
        here = home if depends_on_position else self.surface.relative(there)
        with raised_together(self._comm):
            distance = self.surface.distance(here)
            way = self.way(self.surface, here, frames.own, distance, history)
        return frames._replace(way=frozen(way))

    def saved_at(self, at: np.ndarray | None, before: Frames) -> Frames:
        """See ``Geometry``."""
        return self._placed(before.home if at is None else at, self.x, before)

    def _placed(self, home: np.ndarray, there: np.ndarray, before: Frames | None) -> Frames:
        """Return frames and gaps for given positions of the nodes.  Collective.

        Args:
            home: Positions relative to the surface, ``shape=(n, gdim)``.
            there: Positions in space for lever arms, ``shape=(n, gdim)``.
            before: Earlier frames, whose contact points are reused if they are unchanged.
        """
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
        return Frames(home, turned, own, frame, flat, points, arms, None, turned)

    def follows(self, depends_on_position: bool, history: History) -> bool:
        """See ``Geometry``."""
        surface = self.surface
        turned = not np.array_equal(surface.rotation, history.frames.rotation)
        return depends_on_position or surface.spins or turned

    def changes(self, history: History, textured: bool = False) -> bool:
        """See ``Geometry``."""
        surface = self.surface
        turned = not np.array_equal(surface.rotation, history.frames.ended)
        return surface.varies or surface.spins or turned or textured

    def last_in(self, frames: Frames, history: History) -> State:
        """See ``Geometry``."""
        before, last = history.frames, history.last
        if self.surface.curved:
            moved = to_global(before.own, last.displacement)
            last = last._replace(displacement=frozen(times(frames.own, moved)))
        if frames.points is not before.points:
            turned = carried(last.reaction, before.frame, frames.frame)
            last = last._replace(reaction=frozen(turned))
        return last

    def arms(
        self, displacement: np.ndarray, frames: Frames, u: np.ndarray | None = None
    ) -> np.ndarray:
        """See ``Geometry``: lever arms about the point of the surface, in the step."""
        surface = self.surface
        if frames.arms is not None:
            return frames.arms
        moved = to_global(frames.frame, displacement) + self.of_surface(frames)
        return self.x + moved - surface.point - surface.displacement

    def distances(self, x: np.ndarray) -> np.ndarray:
        """See ``NodalGeometry``."""
        return self.surface.distances(x)

    def check_start(self, contact: Contact, body: ElasticBody) -> str:
        """See ``Geometry``: a warning of a wrong normal of a plane, or of large penetration."""
        surface, gdim = self.surface, contact.points.dim
        x = body.displacements.x[:, :gdim]
        with raised_together(body.comm):
            height = surface.distance(surface.relative(x))
        highest, deepest = (body.highest(values) for values in (height, -height))
        inside = body.largest(-contact.present.gap)
        if highest < DEEP_START * deepest:
            return f"the body lies on the other side of {surface} than its normal shows, down to {deepest:.3g}: turn the normal, so that it shows towards the body"
        if inside > DEEP_START * body.extent:
            return f"the body starts {inside:.3g} deep inside {surface}, more than a tenth of its size: check point and normal, or move the plane by surface.displacement step by step"
        return ""

    # -- the way of a step ---------------------------------------------------------------------

    def rotation_since_last_step(self, surface: Surface, history: History) -> np.ndarray:
        """Return the rotation of a surface since the last step, in its axes, radians.

        It is a rotation vector, in 2-D an angle.
        """
        return surface.own_axes(rotation_between(history.frames.ended, surface.rotation))

    def way(
        self,
        surface: Surface,
        y: np.ndarray,
        own: np.ndarray,
        distance: np.ndarray,
        history: History,
    ) -> np.ndarray:
        """Return path minus chord of each node's motion on the surface since the last step.

        The array has ``shape=(n, gdim - 1)``, local frame, length.  Relative to the surface, the
        nearest point moves on an arc whose normal turns from that at the start to that at the end;
        a rotation of the surface adds a turn about the normal.  For a chord ``c`` and a total turn
        ``psi``, the path is ``(a cot a) c + psi x c / 2`` with ``a = |psi| / 2``, in the directions
        at its end.  The factor ``a cot a`` applies across the axis of ``psi``; along the axis, it
        is 1.

        Args:
            surface: Surface in its pose at the end.
            y: Positions at the end, relative to the surface, in its axes, ``shape=(n, gdim)``.
            own, distance: Frames and distances at these positions.
            history: History variables from the last step.
        """
        began = self.started(history)
        n1, n0 = own[..., -1, :], surface.frames(began)[..., -1, :]
        chord = y - began - distance[:, None] * n1 + history.last.gap[:, None] * n0
        way = _round(chord, n0, n1, self.rotation_since_last_step(surface, history))
        return times(own[..., :-1, :], way - (y - began))

    def started(self, history: History) -> np.ndarray:
        """Return positions relative to the surface at the start of the step, ``shape=(n, gdim)``.

        They are given in axes that move with the surface.
        """
        return self.x + to_global(history.frames.own, history.last.displacement)

    def ended_at(self, u: np.ndarray) -> tuple[Surface, np.ndarray]:
        """Return the surface with its rotation at the end of the step, and positions of the nodes.

        Args:
            u: Displacement of owned degrees of freedom.
        """
        surface = self.surface
        if surface.spin is not None:
            surface = copy(surface)
            surface.end_step()
        return surface, self.x + u[self._dofs]

    def turned_past(self, displacement: np.ndarray, frames: Frames) -> np.ndarray:
        """Return displacements relative to the surface, corrected for the step's finite rotation.

        The step itself treats a free rotation to first order.

        Args:
            displacement: Displacements relative to the surface, ``shape=(n, gdim)``, local frame.
            frames: Frames of the step.
        """
        ended = copy(self.surface)
        ended.end_step()
        moved = to_global(frames.frame, displacement) + self.of_surface(frames)
        return times(frames.own, ended.moved_past(self.x, moved))

    def missed(self, contact: ContactStep, state: State, u: np.ndarray, fixed: np.ndarray) -> tuple:
        """See ``Geometry``."""
        from dolfinx_contact.contact.end import missed_on_rigid

        return missed_on_rigid(self, contact, state, u)

    def too_long(
        self, contact: ContactStep, state: State, u: np.ndarray, last: np.ndarray | None
    ) -> tuple[float, str]:
        """See ``Geometry``."""
        from dolfinx_contact.contact.end import too_long_on_rigid

        return too_long_on_rigid(self, contact, state, u)


def _round(chord: np.ndarray, n0: np.ndarray, n1: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """Return the paths of given chords, see ``RigidGeometry.way``, ``shape=(n, gdim)``, length.

    Args:
        chord: Chords, ``shape=(n, gdim)``, length.
        n0, n1: Normals at start and end, ``shape=(n, gdim)`` or ``(gdim,)``.
        turned: Rotation of the surface, in its own axes, radians.
    """
    n0, n1 = np.broadcast_to(n0, chord.shape), np.broadcast_to(n1, chord.shape)
    if chord.shape[1] == 2:
        across = n0[:, 0] * n1[:, 1] - n0[:, 1] * n1[:, 0]
        psi = np.arctan2(across, (n0 * n1).sum(axis=1))
        psi = np.clip(psi, -LONGEST_TURN, LONGEST_TURN)[:, None]
        turning = psi * np.column_stack((-chord[:, 1], chord[:, 0]))
        return _a_cot_a(np.abs(psi) / 2) * chord + turning / 2
    across = np.cross(n0, n1)
    sine = np.linalg.norm(across, axis=1)
    angle = np.arctan2(sine, (n0 * n1).sum(axis=1))
    psi = across * np.divide(angle, sine, np.zeros_like(sine), where=sine > 0)[:, None]
    psi -= (n1 @ turned)[:, None] * n1
    size = np.linalg.norm(psi, axis=1, keepdims=True)
    axis = np.divide(psi, size, np.zeros_like(psi), where=size > 0)
    size = np.minimum(size, LONGEST_TURN)
    along = (axis * chord).sum(axis=1, keepdims=True) * axis
    return _a_cot_a(size / 2) * (chord - along) + along + size * np.cross(axis, chord) / 2


def _a_cot_a(a: np.ndarray) -> np.ndarray:
    """Return ``a cot a``, which is 1 at zero."""
    return np.divide(a, np.tan(a), np.ones_like(a), where=a > 0)
