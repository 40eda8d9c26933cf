# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Where contact nodes stand relative to their surface: frames, gaps and slips.

A node at ``x + u`` has moved by ``F (u - s)`` relative to a surface whose material point at ``x`` has moved by ``s``,
in components of its frame ``F``.  On planes gaps are linear in this motion.  On other surfaces frame and gap are taken
for the surface as it stands in the step and a position of the node, and in the step the surface is its tangent plane
there.  That position is where the last step has left the node, and then, while it matters, where this one takes it, see
``lagged/end_geometry.py``.
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

# Gap at least of nodes that cannot touch, over the largest coordinate: any that rounding leaves open.
CLEAR_GAP = 1e-9


class Frames(NamedTuple):
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


class Geometry(ABC):
    """In what geometries differ: that of rigid surfaces, ``RigidGeometry``, and of a second body, ``MortarGeometry``.

    Methods get frames, and the ``History`` with those of the last step that converged.
    """

    @abstractmethod
    def standing(self, wanders: bool, before: Frames | None = None) -> Frames:
        """Frames and gaps where the undeformed body stands.  Collective.

        Args:
            wanders: Whether it matters where on the surface nodes are.
            before: Frames of before, whose rows stay where they are the same.
        """

    @abstractmethod
    def following(
        self,
        start: np.ndarray,
        at: np.ndarray | None,
        wanders: bool,
        history: History,
        before: Frames | None,
    ) -> Frames:
        """Frames and gaps for a step, where the surface is at present.  Collective.

        Directions held by supports are not known for the new frames.

        Args:
            start: Displacement of owned degrees of freedom at the start of the step.
            at: The one with which nodes stand there; None is that at the start.
            wanders: As in ``standing``.
            history: Of the steps before.
            before: Frames with which the same step was solved before; None is none.
        """

    @abstractmethod
    def saved_at(self, at: np.ndarray | None, before: Frames) -> Frames:
        """Frames and gaps at what was saved: positions relative to the surface, or a displacement; None is as before.  Collective."""

    @abstractmethod
    def changes(self, history: History, textured: bool) -> bool:
        """Whether distances, normals, arms or a texture may change within a step; the same on all ranks."""

    @abstractmethod
    def follows(self, wanders: bool, history: History) -> bool:
        """Whether gaps or frames at the start of the next step are not those of the last one; the same on all ranks."""

    @abstractmethod
    def last_in(self, frames: Frames, history: History) -> State:
        """The last state in the frames of another step.  Collective between bodies."""

    @abstractmethod
    def arms(self, displacement: np.ndarray, frames: Frames, u: np.ndarray | None) -> np.ndarray:
        """Lever arms of the nodes for ``Contact.moment``, ``shape=(n, gdim)``, global frame.

        Args:
            displacement: Relative to the surface, local frame.
            frames: Those of the step.
            u: The displacement, owned degrees of freedom, if it is known.
        """

    @abstractmethod
    def check_start(self, contact: Contact, body: ElasticBody) -> str:
        """What is to be warned of in the undeformed state, in words.  Collective.

        Raises:
            ValueError: on all ranks, if the surface makes no sense.
        """

    # -- the end of a step ---------------------------------------------------------------------

    @abstractmethod
    def missed(self, contact: ContactStep, state: State, u: np.ndarray, fixed: np.ndarray) -> tuple:
        """Of gaps, normals with axes, and ways at the end of a step beside those used, as forces on each node.  Collective."""

    @abstractmethod
    def too_long(
        self, contact: ContactStep, state: State, u: np.ndarray, last: np.ndarray | None
    ) -> tuple[float, str]:
        """After which part of a step its way cannot be followed, above one if it can, and why in words.  Collective between bodies.

        Args:
            contact: The contact in the step.
            state: The state at the end.
            u: Its displacement, owned degrees of freedom.
            last: That at the start, of nonlinear bodies alone: others do not turn far.
        """


class NodalGeometry(Geometry):
    """What makes frames, gaps and motions of ``n`` nodes relative to a surface; nothing in it changes.

    Args:
        surface: The surface.
        x: Reference positions of the nodes, ``shape=(n, gdim)``.
        dofs: Their degrees of freedom, ``shape=(n, gdim)``.
        extent: Largest coordinate of the mesh, on any rank.
        comm: MPI communicator.

    Attributes:
        renews_rows: Whether rows of the motion are others where a step ends.
        shares_nodes: Whether nodes may belong to other contacts, too.
    """

    renews_rows = False
    shares_nodes = True

    def __init__(
        self, surface: Surface, x: np.ndarray, dofs: np.ndarray, extent: float, comm: MPI.Comm
    ):
        self.surface, self.x, self._comm = surface, x, comm
        self._dofs, self._extent, self._apart = dofs, extent, CLEAR_GAP * extent

    def covered(self, frames: Frames) -> np.ndarray:
        """Part of each node's area that has a surface opposite."""
        return np.ones(len(self.x))

    @property
    def opposite(self) -> np.ndarray:
        """This rank's nodes on the other side, local indices."""
        return np.zeros(0, dtype=int)

    def met(self, fixed: np.ndarray, frames: Frames) -> Frames:
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
        self, volume: np.ndarray, area: np.ndarray, frames: Frames, history: History
    ) -> np.ndarray:
        """Depths of the nodes of a deformable surface that have lost the volumes, ``shape=(n,)``, worn off opposite contact nodes."""
        raise NotImplementedError

    def distances(self, x: np.ndarray) -> np.ndarray:
        """Of points in space from the surface where it stands, ``shape=(n,)``; infinite where they are not known."""
        return np.full(len(x), np.inf)

    def directions(self, given: np.ndarray, owner: str, points: ContactPoints) -> np.ndarray:
        """Directions, ``shape=(gdim, n)`` or in frames ``(2, n)``, where they are now."""
        return given

    def ended(self, frames: Frames, rotation: np.ndarray | None = None) -> Frames:
        """Frames of a step that ends, and its way, where the surface has turned to at present, or to another rotation."""
        surface = self.surface
        if rotation is None:
            turned = surface.rotation
            rotation = turned if surface.spin is None else composed(surface.spin, turned)
        return frames._replace(ended=rotation, way=None)

    def turned(self, frames: Frames, history: History, worn: np.ndarray) -> State:
        """The last state in frames that supports have turned, of the same nodes opposite to the same ones; ``worn`` depths, ``shape=(n,)``."""
        before, last = history.frames, history.last
        moved = times(frames.own, turned_back(before.own, last.displacement))
        reaction = carried(last.reaction, before.frame, frames.frame)
        gap = frames.flat + worn + moved[:, -1]
        return last._replace(displacement=frozen(moved), reaction=frozen(reaction), gap=frozen(gap))

    def slip_past_edge(
        self, u: np.ndarray, frames: Frames, history: History
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Nodes that have left what was opposite in the step, ``shape=(n,)``, and their slip, ``shape=(n, gdim - 1)``; None where nothing can be left.  Collective."""
        return None

    def of_surface(self, frames: Frames) -> np.ndarray:
        """Motion of the surface at the nodes, global frame: ``shape=(gdim,)`` if it is the same for all."""
        motion, spin = self.surface.motion(self.x), self.surface.spin
        return motion if spin is None else motion + cross(spin, frames.arms)

    def surface_moved(self, frames: Frames) -> np.ndarray:
        """The same in the local frame."""
        motion, frame = self.of_surface(frames), frames.frame
        return frame @ motion if motion.ndim == 1 else times(frame, motion)

    def at_rest(self, frames: Frames) -> State:
        """The state of the undeformed body without reactions."""
        n, gdim = self.x.shape
        moved = np.broadcast_to(self.surface_moved(frames), (n, gdim))
        gap, none = frames.flat - moved[:, -1], np.zeros((n, gdim - 1))
        return State(-moved, np.zeros((n, gdim)), gap, none, np.zeros(n, dtype=np.uint8))

    def gap_rounding_of(self, largest: float) -> float:
        """Bound of the rounding in a gap beside lengths of that size; a rank may have the origin alone."""
        return 16 * np.finfo(float).eps * max(self._extent, largest)

    @property
    def clear(self) -> float:
        """Gap of nodes that cannot touch, at least."""
        return self._apart

    def save(self, frames: Frames) -> dict[str, np.ndarray]:
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


def carried(reaction: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Reactions in other frames: friction keeps its length and, as far as it can, its direction in space."""
    found, tangential = reaction.copy(), reaction.copy()
    tangential[:, -1] = 0.0
    along = times(after, turned_back(before, tangential))[:, :-1]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    kept = np.linalg.norm(tangential, axis=1, keepdims=True)
    found[:, :-1] = np.divide(kept, length, np.zeros_like(length), where=length > 0) * along
    return found
