# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Geometry of contact nodes relative to their surface: frames, gaps and slips.

A node at ``x + u`` has moved by ``F (u - s)`` relative to a surface whose material point at ``x``
has moved by ``s``, in components of the node's frame ``F``.  On planes, gaps are linear in this
motion. On other surfaces, frame and gap are evaluated for the pose of the surface in the step and
for one position of the node; within the step, the surface is replaced by its tangent plane there.
That position is first the one at the end of the last step.  As long as the error matters, the step
is repeated with the position at its own end, see ``lagged/end_geometry.py``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dolfinx_contact.contact.state import State
from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.surfaces.surface import Surface, composed, cross

if TYPE_CHECKING:
    from mpi4py import MPI

    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.interface import ContactPoints
    from dolfinx_contact.contact.state import History

# Smallest gap of nodes that cannot touch, relative to the largest coordinate of the mesh: small,
# but well above rounding, so that these nodes stay open.
CLEAR_GAP = 1e-9


class Frames(NamedTuple):
    """Frames and gaps of the ``n`` nodes, and the positions for which they were evaluated."""

    home: np.ndarray  # positions relative to the surface, (n, gdim)
    rotation: np.ndarray  # of the surface, radians
    own: np.ndarray  # frames in axes of the surface: (gdim, gdim) for all, or (n, gdim, gdim)
    frame: np.ndarray  # frames in global components, same shape
    flat: np.ndarray  # gap minus the displacement along the normal, (n,)
    points: ContactPoints
    # Lever arms about the point of the surface, (n, gdim); None unless a rotation is free:
    arms: np.ndarray | None
    # Path along the surface since the last step minus its chord, (n, gdim - 1); None for zero:
    way: np.ndarray | None
    ended: np.ndarray  # rotation of the surface at the end of the step
    # Of a deformable surface:
    at: np.ndarray | None = None  # displacement of the frames, owned degrees of freedom
    start: np.ndarray | None = None  # displacement at the start of the step
    left: np.ndarray | None = None  # nodes kept open for the rest of the step, (n,), booleans
    renewed: int = -1  # evaluations of mortar coefficients in the step, minus one
    leaving: bool = False  # whether a node of any rank leaves the other side in the step


class Geometry(ABC):
    """Base class of contact geometries: ``RigidGeometry`` and ``MortarGeometry`` for a second body.

    Methods receive frames, and the ``History`` with the frames of the last converged step.
    """

    @abstractmethod
    def standing(self, depends_on_position: bool, before: Frames | None = None) -> Frames:
        """Return frames and gaps for the undeformed body.  Collective.

        Args:
            wanders: Whether the geometry depends on the position of nodes on the surface.
            before: Earlier frames, whose contact points are reused if they are unchanged.
        """

    @abstractmethod
    def following(
        self,
        start: np.ndarray,
        at: np.ndarray | None,
        depends_on_position: bool,
        history: History,
        before: Frames | None,
    ) -> Frames:
        """Return frames and gaps for a step with the surface in its present pose.  Collective.

        The constraints of boundary conditions are not yet set in the new frames.

        Args:
            start: Displacement of owned degrees of freedom at the start of the step.
            at: Displacement for which frames are evaluated; None for ``start``.
            wanders: Whether the geometry depends on the position of nodes on the surface.
            history: History variables from the last step.
            before: Frames with which this step was solved before; None if it was not.
        """

    @abstractmethod
    def saved_at(self, at: np.ndarray | None, before: Frames) -> Frames:
        """Return frames and gaps for a state from a checkpoint.  Collective.

        Args:
            at: Saved positions relative to the surface, or saved displacement; None if neither was
                saved.
            before: Frames before the checkpoint is loaded.
        """

    @abstractmethod
    def changes(self, history: History, textured: bool) -> bool:
        """Return whether the contact geometry may change within a step; the same on all ranks.

        The geometry consists of gaps, normals, lever arms and friction axes bound to the surface.
        """

    @abstractmethod
    def follows(self, depends_on_position: bool, history: History) -> bool:
        """Return whether the next step needs new gaps or frames at its start.

        The value is the same on all ranks.
        """

    @abstractmethod
    def last_in(self, frames: Frames, history: History) -> State:
        """Return the last state in the frames of another step.  Collective between bodies."""

    @abstractmethod
    def arms(self, displacement: np.ndarray, frames: Frames, u: np.ndarray | None) -> np.ndarray:
        """Return lever arms of the nodes for ``Contact.moment``, ``shape=(n, gdim)``, global frame.

        Args:
            displacement: Displacement relative to the surface, local frame.
            frames: Frames of the step.
            u: Displacement of owned degrees of freedom; None if it is not known.
        """

    @abstractmethod
    def check_start(self, contact: Contact, body: ElasticBody) -> str:
        """Return a warning about the undeformed state, or an empty string.  Collective.

        Raises:
            ValueError: on all ranks, if the undeformed state makes no sense.
        """

    # -- the end of a step ---------------------------------------------------------------------

    @abstractmethod
    def missed(self, contact: ContactStep, state: State, u: np.ndarray, fixed: np.ndarray) -> tuple:
        """Return errors of the geometry at the end of a step, as nodal forces.  Collective.

        They are the errors of gaps, of normals with friction axes, and of path lengths along the
        surface.
        """

    @abstractmethod
    def too_long(
        self, contact: ContactStep, state: State, u: np.ndarray, last: np.ndarray | None
    ) -> tuple[float, str]:
        """Return the fraction of a step up to which its path can be followed, and the reason.
        Collective between bodies.

        The fraction exceeds 1 if the whole step can be followed.

        Args:
            contact: The contact in the step.
            state: State at the end of the step.
            u: Displacement of owned degrees of freedom at the end.
            last: Displacement at the start for nonlinear bodies; None for linear ones, which do not
                rotate far.
        """


class NodalGeometry(Geometry):
    """Base class for frames, gaps and motions of ``n`` nodes relative to a surface; immutable.

    Args:
        surface: The surface.
        x: Reference positions of the nodes, ``shape=(n, gdim)``.
        dofs: Degrees of freedom of the nodes, ``shape=(n, gdim)``.
        extent: Largest coordinate of the mesh on all ranks.
        comm: MPI communicator.

    Attributes:
        renews_rows: Whether mortar coefficients are evaluated anew for the end of a step.
        shares_nodes: Whether nodes may belong to other contacts as well.
    """

    renews_rows = False
    shares_nodes = True

    def __init__(
        self, surface: Surface, x: np.ndarray, dofs: np.ndarray, extent: float, comm: MPI.Comm
    ):
        self.surface, self.x, self._comm = surface, x, comm
        self._dofs, self._extent, self._apart = dofs, extent, CLEAR_GAP * extent

    def covered(self, frames: Frames) -> np.ndarray:
        """Return the fraction of each node's area that faces the surface, ``shape=(n,)``."""
        return np.ones(len(self.x))

    @property
    def opposite(self) -> np.ndarray:
        """Local indices of this rank's nodes on the opposite deformable surface."""
        return np.zeros(0, dtype=int)

    def met(self, fixed: np.ndarray, frames: Frames) -> Frames:
        """Return frames that take boundary conditions into account.  Collective.

        Only normals that are averaged over facets depend on boundary conditions; here, frames are
        returned unchanged.

        Args:
            fixed: Owned degrees of freedom that boundary conditions fix.
            frames: Present frames.
        """
        return frames

    def on_all_ranks(self, worn: np.ndarray) -> np.ndarray:
        """Return the worn depths of all nodes of a deformable surface on every rank.  Collective.

        Args:
            worn: Worn depths of this rank's nodes.
        """
        return worn

    def opening(
        self, points: ContactPoints, history: History, depth: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the gap that wear of both sides opens at each node, ``shape=(n,)``, length.

        Args:
            points: Contact points, which map the wear of a deformable surface to the nodes.
            history: History variables with the depths worn before the step.
            depth: Depth worn in the step, ``shape=(n,)``; None for zero.
        """
        own, other = history.sums["wear_depth"], self.opened(points, history.worn)
        worn = own if depth is None else own + depth
        return worn if other is None else worn + other

    def opened(self, points: ContactPoints, worn: np.ndarray | None) -> np.ndarray | None:
        """Return the gap opened by the wear of a deformable surface, ``shape=(n,)``, length.

        None is returned for zero.

        Args:
            points: Contact points, which map the worn depths to the nodes.
            worn: Worn depths of all nodes of the deformable surface; None if it does not wear.
        """
        return None

    def taken(
        self, volume: np.ndarray, area: np.ndarray, frames: Frames, history: History
    ) -> np.ndarray:
        """Return the depths worn off the nodes of a deformable surface, length.

        Args:
            volume: Volume worn off the surface opposite each contact node, ``shape=(n,)``.
            area: Areas of this rank's nodes of the deformable surface.
            frames: Frames of the step.
            history: History variables from the last step.
        """
        raise NotImplementedError

    def distances(self, x: np.ndarray) -> np.ndarray:
        """Return distances of points in space from the surface in its present pose, ``shape=(n,)``.

        They are infinite where they cannot be evaluated.
        """
        return np.full(len(x), np.inf)

    def directions(self, given: np.ndarray, owner: str, points: ContactPoints) -> np.ndarray:
        """Return material directions in their present orientation.

        Args:
            given: Directions in the undeformed state, ``shape=(gdim, n)``, or ``(2, n)`` in local
                frames.
            owner: Body to which the directions are bound.
            points: Contact points of the present state.
        """
        return given

    def ended(self, frames: Frames, rotation: np.ndarray | None = None) -> Frames:
        """Return the frames of a completed step, with the rotation of the surface at its end.

        Args:
            frames: Frames of the step.
            rotation: Rotation of the surface; None for its present one.
        """
        surface = self.surface
        if rotation is None:
            turned = surface.rotation
            rotation = turned if surface.spin is None else composed(surface.spin, turned)
        return frames._replace(ended=rotation, way=None)

    def turned(self, frames: Frames, history: History, worn: np.ndarray) -> State:
        """Return the last state in frames rotated by the constraints of boundary conditions.

        Every node faces the same part of the surface as before.

        Args:
            frames: New frames.
            history: History variables with the last state and its frames.
            worn: Gap opened by wear, ``shape=(n,)``, length.
        """
        before, last = history.frames, history.last
        moved = times(frames.own, to_global(before.own, last.displacement))
        reaction = carried(last.reaction, before.frame, frames.frame)
        gap = frames.flat + worn + moved[:, -1]
        return last._replace(displacement=frozen(moved), reaction=frozen(reaction), gap=frozen(gap))

    def slip_past_edge(
        self, u: np.ndarray, frames: Frames, history: History
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the nodes that left the opposite surface in the step, and their slip.  Collective.

        Returns:
            Booleans, ``shape=(n,)``, and slips, ``shape=(n, gdim - 1)``; None if no node can leave.
        """
        return None

    def of_surface(self, frames: Frames) -> np.ndarray:
        """Return the motion of the surface at the nodes, global frame, ``shape=(n, gdim)``.

        The shape is ``(gdim,)`` if the motion is the same for all nodes.
        """
        motion, spin = self.surface.motion(self.x), self.surface.spin
        return motion if spin is None else motion + cross(spin, frames.arms)

    def surface_moved(self, frames: Frames) -> np.ndarray:
        """Return the motion of the surface at the nodes, local frame, ``shape=(n, gdim)``.

        The shape is ``(gdim,)`` if the motion is the same for all nodes.
        """
        motion, frame = self.of_surface(frames), frames.frame
        return frame @ motion if motion.ndim == 1 else times(frame, motion)

    def at_rest(self, frames: Frames) -> State:
        """Return the state of the undeformed body without reactions."""
        n, gdim = self.x.shape
        moved = np.broadcast_to(self.surface_moved(frames), (n, gdim))
        gap, none = frames.flat - moved[:, -1], np.zeros((n, gdim - 1))
        return State(-moved, np.zeros((n, gdim)), gap, none, np.zeros(n, dtype=np.uint8))

    def gap_rounding_of(self, largest: float) -> float:
        """Return an upper bound of the rounding error in a gap, length.

        Args:
            largest: Largest length on this rank that enters the gap.
        """
        return 16 * np.finfo(float).eps * max(self._extent, largest)

    @property
    def clear(self) -> float:
        """Smallest gap assigned to nodes that cannot touch, length."""
        return self._apart

    def save(self, frames: Frames) -> dict[str, np.ndarray]:
        """Return positions and rotations for which frames were evaluated, as arrays by name."""
        surface, saved = self.surface, {}
        if surface.varies:
            saved["home"] = frames.home
        if frames.rotation.any():
            saved["rotation_of_plane"] = frames.rotation
        if surface.spins:
            saved["found_rotation_of_plane"] = surface.rotation
        return saved


def times(frame: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return components of ``vectors``, ``shape=(n, gdim)``, in one frame or one frame per node."""
    return (frame @ vectors[:, :, None])[:, :, 0]


def to_global(frame: np.ndarray, components: np.ndarray) -> np.ndarray:
    """Return vectors from components in one frame or one frame per node, ``shape=(n, gdim)``."""
    return (components[:, None, :] @ frame)[:, 0]


def carried(reaction: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return reactions in new frames, ``shape=(n, gdim)``.

    The normal component and the magnitude of the friction force are kept.  The friction force keeps
    its direction in space, projected on the new tangent plane.
    """
    found, tangential = reaction.copy(), reaction.copy()
    tangential[:, -1] = 0.0
    along = times(after, to_global(before, tangential))[:, :-1]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    kept = np.linalg.norm(tangential, axis=1, keepdims=True)
    found[:, :-1] = np.divide(kept, length, np.zeros_like(length), where=length > 0) * along
    return found
