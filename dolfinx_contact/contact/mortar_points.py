# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Mortar contact points between two deformable surfaces: slave nodes against the opposite mesh.

Row a of the contact operator gives the relative motion ``w_a = F_a (u_a - sum_b m_ab u_b)`` of
slave node a, with its frame ``F_a`` and the mortar coefficients ``m_ab`` of ``mortar.py``.  Its
reaction acts as ``r_a`` on node a and as ``-m_ab r_a`` on each master node b, so forces balance for
any pair of meshes.  The rows are stored in a PETSc matrix, since master nodes may belong to other
ranks.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.spatial.transform import Rotation

from dolfinx_contact import compat
from dolfinx_contact.contact.facets import facets_of
from dolfinx_contact.contact.fields import nearest_rotation
from dolfinx_contact.contact.geometry import (
    CLEAR_GAP,
    Frames,
    NodalGeometry,
    carried,
    times,
    to_global,
)
from dolfinx_contact.contact.interface import (
    FREE_PART,
    ContactPoints,
    NodalStiffness,
    block_diagonal,
    nodal_blocks,
)
from dolfinx_contact.contact.mortar import BY_FACET, NO_AREA, Rows, Side, at_nodes, rows_of
from dolfinx_contact.contact.rigid import LONGEST_TURN
from dolfinx_contact.contact.state import History, State
from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.surfaces.surface import frames_along

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.displacements import Displacements

# Largest slip of a slave node in small sliding, as a fraction of the shortest facet edge.
STRAYED_PART = 0.5

# Updates of the mortar coefficients in a step after which a node that has left the master side
# stays off it for the rest of the step.  Otherwise some nodes alternate between on and off.
LEAVING_RENEWALS = 2


class MortarGeometry(NodalGeometry):
    """Frames, gaps and relative motions of the slave nodes of a contact with a deformable surface.

    Within a solution they are linear in the displacement, with the mortar coefficients of one
    state. For small sliding, this is the undeformed state.  For large sliding, it is the state at
    the start of the step or an estimate of its end, see ``lagged/end_geometry.py``.
    """

    shares_nodes = False

    def __init__(self, *given: Any, contact: Contact, facets: np.ndarray):
        super().__init__(*given)
        displacements, nodes, comm = contact.displacements, contact.nodes, contact.comm
        self._slave = Skin(displacements, facets, comm, contact.measure.density)
        self._master = Skin(displacements, self.surface.facets, comm)
        numbers = _numbers(displacements.V.dofmap.index_map, nodes)
        self._mine = np.searchsorted(self._slave.numbers, numbers)
        self._slave.keep(self._mine)
        self._at_nodes = [at_nodes(side, nodes.size) for side in self._slave.sides]
        self._supported = np.zeros((nodes.size, displacements.dim), dtype=bool)
        # Caches: (displacement with the mask of departed nodes, its frames), and (displacement at
        # the start of the step, rotations of both sides there).
        self._projected: tuple = (None, None)
        self._began: tuple = (None, None)
        self._planes: list = []  # symmetry planes: index of the normal axis, coordinate
        self._owned = displacements.owned

    @property
    def renews_rows(self) -> bool:
        """See ``NodalGeometry``."""
        return self.surface.sliding == "large"

    def standing(self, depends_on_position: bool, before: Frames | None = None) -> Frames:
        """See ``Geometry``: frames and gaps of the undeformed bodies.  Collective."""
        found = self.projected(np.zeros(self._owned[0]))
        self._undeformed = found.frame
        return found

    def projected(self, u: np.ndarray, left: np.ndarray | None = None) -> Frames:
        """Frames, gaps and mortar rows of the slave nodes at a displacement.  Collective.

        Args:
            u: Displacement, owned degrees of freedom.
            left: Slave nodes that have left the master side in the step, ``shape=(n,)``, bool; they
                get no row.  By default, no node has left.
        """
        left = np.zeros(len(self.x), dtype=bool) if left is None else left
        (known, found), key = self._projected, np.append(u, left)
        if self._comm.allreduce(known is not None and np.array_equal(known, key), op=MPI.LAND):
            return found
        compat.free_garbage(self._comm)  # rows of earlier steps
        slaves, moved = self._slave.moved(u)
        masters, there = self._master.moved(u)
        with raised_together(self._comm):
            rows = rows_of(slaves, masters, len(self.x), len(there))
            rows = rows._replace(covered=rows.covered & ~left)
            normals = _unconstrained_normals(self._supported, self._mean_normals(slaves))
            turns = self._turns(moved, there)
            axis = self.surface.axis
            if axis is not None and len(axis) == 3:
                axis = self._slave.deformed(moved)[self._mine] @ axis
            frames = frames_along(normals, axis, self.x, self.surface)
        # Undeformed position of the opposite point: textures of the master side are evaluated there
        home = np.where(rows.covered[:, None], rows.m @ self._master.x, self.x)
        flat = ((self.x - home) * frames[:, -1]).sum(axis=1)
        flat[~rows.covered] = self._apart  # no opposite point: the gap is open
        points = MortarPoints(self._dofs, frames, self._owned, rows, self._master, self._comm)
        points.met, points.turns, points.sides = self._supported, turns, (moved, there)
        still = self.surface.rotation
        home, frames, flat, at = map(frozen, (home, frames, flat, u.view()))
        found = Frames(
            home, still, frames, frames, flat, points, None, None, still, at=at, left=left
        )
        self._projected = key, found
        return found

    def _mean_normals(self, slaves: list[Side]) -> np.ndarray:
        """Unit normals at the slave nodes, into their own body, ``shape=(n, gdim)``.

        Each one is the area-weighted mean of the normals of the adjacent facets.
        """
        sums = np.zeros_like(self.x)
        for at, side in zip(self._at_nodes, slaves):
            sums -= at @ side.outwards
        return sums / np.linalg.norm(sums, axis=1, keepdims=True)

    def _turns(self, slave: np.ndarray, master: np.ndarray) -> list[np.ndarray]:
        """Mean rotations of the slave and the master side, ``shape=(gdim, gdim)`` each.

        Args:
            slave, master: Current positions of all nodes of each side, on all ranks,
                ``shape=(m, gdim)``.
        """
        pairs = [(self._slave.x, slave), (self._master.x, master)]
        for k, plane in self._planes:  # symmetry plane: add the mirror image of each body
            mirror, foot = np.ones(self.x.shape[1]), np.zeros(self.x.shape[1])
            mirror[k], foot[k] = -1.0, 2.0 * plane
            pairs = [[np.concatenate((x, mirror * x + foot)) for x in pair] for pair in pairs]
        return [nearest_rotation((y - y.mean(axis=0)).T @ (x - x.mean(axis=0))) for x, y in pairs]

    def directions(self, given: np.ndarray, owner: str, points: MortarPoints) -> np.ndarray:
        """Material directions in the deformed state, ``shape=(gdim, n)``, global frame.

        They deform with the side that owns them: with the slave at its nodes, or with the master
        side at the opposite points.

        Args:
            given: Directions in the undeformed state, ``shape=(gdim, n)``, global frame, or
                ``(2, n)``, tangential components in the undeformed local frames.
            owner: "body" (the slave) or "surface" (the master side).
            points: Contact points in the deformed state.
        """
        if len(given) == 2:
            given = np.einsum("nij,in->jn", self._undeformed[:, :2], given)
        moved, there = points.sides
        if owner == "body":
            lines = self._slave.deformed(moved)[self._mine]
        else:
            lines = self._master.deformed(there)
            lines = (points.m @ lines.reshape(len(lines), -1)).reshape(-1, *lines.shape[1:])
            lines[points.alone] = points.turns[1]
        return np.einsum("nij,jn->in", lines, given)

    def too_long(
        self, contact: ContactStep, state: State, u: np.ndarray, last: np.ndarray | None
    ) -> tuple[float, str]:
        """See ``Geometry``.  Collective."""
        turned = 0.0
        if last is not None:
            turned = _between(*self._since(last, self._mean_rotations_at(u)))[2]
        if turned <= LONGEST_TURN:
            return 2.0, ""
        return (
            0.0,
            f"two bodies turn against each other by {turned:.2g} radians in it, {LONGEST_TURN:g} is the most",
        )

    def _mean_rotations_at(self, u: np.ndarray) -> list[np.ndarray]:
        """Mean rotations of the slave and the master side at a displacement ``u``.  Collective."""
        return self._turns(*(side.moved(u)[1] for side in (self._slave, self._master)))

    def _since(self, start: np.ndarray, turns: list[np.ndarray]) -> list[np.ndarray]:
        """Mean rotations of both sides relative to those at displacement ``start``.  Collective.

        Args:
            start: Displacement at the start of the step, owned degrees of freedom.
            turns: Present mean rotations of the slave and the master side.
        """
        known, began = self._began
        if not self._comm.allreduce(
            known is not None and np.array_equal(known, start), op=MPI.LAND
        ):
            began = self._mean_rotations_at(start)
            self._began = start, began
        return [new @ old.T for new, old in zip(turns, began)]

    def _arc_correction(self, placed: Frames, start: np.ndarray) -> np.ndarray:
        """Slip correction for rotating bodies, ``shape=(n, gdim - 1)``, local frame, length.

        It is the slip along the arc of the relative rotation minus the slip along its chord.  The
        distance ``d`` at the start between two points that coincide at the end is turned to the
        mean orientation of both sides, and lengthened from the chord of their relative rotation to
        the arc.  Collective.

        Args:
            placed: Frames at the end of the step.
            start: Displacement at the start of the step, owned degrees of freedom.
        """
        mean, axis, angle = _between(*self._since(start, placed.points.turns))
        apart = self.x - placed.home
        apart = apart + to_global(placed.frame, placed.points.motion(start))
        turned = apart @ mean.T
        along = (turned @ axis)[:, None] * axis
        arc = angle / 2 / np.sin(angle / 2) if angle > 0.0 else 1.0
        return times(placed.frame, apart - along - arc * (turned - along))[:, :-1]

    def following(
        self,
        start: np.ndarray,
        at: np.ndarray | None,
        depends_on_position: bool,
        history: History,
        before: Frames | None,
    ) -> Frames:
        """See ``Geometry``; mortar rows of the last step, or new ones if ``at`` is given."""
        none = np.zeros(len(self.x), dtype=bool)
        begun = history.frames._replace(start=start, left=none, renewed=-1, leaving=False)
        if at is None:
            return begun
        before = begun if before is None else before
        found, renewed, left = self.projected(at, before.left), before.renewed + 1, before.left
        alone = found.points.alone
        if renewed > LEAVING_RENEWALS:
            left = left | (alone & ~before.points.alone)
        leaving = (alone & ~history.frames.points.alone).any()
        leaving = bool(self._comm.allreduce(leaving, op=MPI.LOR))
        way = frozen(self._arc_correction(found, start))
        return found._replace(start=start, left=left, renewed=renewed, leaving=leaving, way=way)

    def last_in(self, frames: Frames, history: History) -> State:
        """See ``Geometry``; slip is measured between the material points paired by the new rows.
        Collective.
        """
        before, last = history.frames, history.last
        if frames.points is before.points:
            return last
        moved = frozen(frames.points.motion(frames.start))
        turned = frozen(carried(last.reaction, before.frame, frames.frame))
        # A node that arrives across the edge of the master side has no gap to close.
        gap = frozen(np.where(before.points.alone, 0.0, last.gap))
        return last._replace(displacement=moved, reaction=turned, gap=gap)

    def slip_past_edge(
        self, u: np.ndarray, frames: Frames, history: History
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """See ``NodalGeometry``; the slip follows from the mortar rows at the start of the step."""
        if not frames.leaving:
            return None
        before, alone = history.frames, frames.points.alone
        slip = before.points.motion(u - frames.start)
        slip[:, -1] = 0.0
        slip = times(frames.frame, to_global(before.frame, slip))[:, :-1]
        frames.points.remove_constrained(slip)
        return alone & ~before.points.alone, slip

    def saved_at(self, at: np.ndarray | None, before: Frames) -> Frames:
        """See ``Geometry``: frames, gaps and mortar rows at the saved displacement ``at``."""
        return self.projected(np.zeros(self._owned[0]) if at is None else at)

    def missed(self, contact: ContactStep, state: State, u: np.ndarray, fixed: np.ndarray) -> tuple:
        """See ``Geometry``; the error is measured against the mortar rows at ``u`` itself.

        In place of the errors of the normals, the second entry has the errors of the nodal forces
        on both sides, and behind these the errors due to turned friction axes.
        """
        from dolfinx_contact.contact.end import dragged, pressed

        frames, given = contact.frames, contact.given
        start, there = frames.start, self.projected(u, frames.left)
        alone = there.points.alone
        slip, used = (placed.points.motion(u - start) for placed in (there, frames))
        slip[:, :-1] += self._arc_correction(there, start)
        used[:, :-1] += 0.0 if frames.way is None else frames.way
        slip[:, -1] = used[:, -1] = 0.0
        slip = times(frames.frame, to_global(there.frame, slip)) - used
        reaction = carried(state.reaction, frames.frame, there.frame)
        reaction[alone] = 0.0
        forces = np.zeros(self._owned[0])
        there.points.add_forces(reaction, forces)
        frames.points.add_forces(-state.reaction, forces)
        forces[fixed] = 0.0
        gap = there.flat + there.points.motion(u)[:, -1]
        gap += self.opening(there.points, given.history, contact.depth)
        with raised_together(contact.comm):  # the user's functions
            angle = given.laws.turned(contact, there.home, there.frame, there.points)
        turned = np.linalg.norm(state.reaction[:, :-1], axis=1) * angle
        turned[alone] = 0.0
        came = contact.points.alone & ~alone  # opposite the master side at the end of the step only
        return (
            pressed(contact, state, gap, contact.points.closed & ~came),
            np.append(forces, turned),
            dragged(contact, state, slip[:, :-1]),
        )

    def on_all_ranks(self, worn: np.ndarray) -> np.ndarray:
        """See ``NodalGeometry``.  Collective."""
        return self._master.on_all_ranks(worn[:, None])[:, 0]

    def opened(self, points: MortarPoints, worn: np.ndarray | None) -> np.ndarray | None:
        """See ``NodalGeometry``."""
        return None if worn is None else points.m @ worn

    def taken(
        self, volume: np.ndarray, area: np.ndarray, frames: Frames, history: History
    ) -> np.ndarray:
        """See ``NodalGeometry``: worn depths of the master nodes.  Collective.

        Node b loses the volume ``sum_a m_ab V_a``.  Negative volumes are set to zero and the others
        scaled, so that the total is kept.  Vertices of second-order triangles have no area; they
        get the mean depth of the neighbouring nodes.

        Args:
            volume: Volume ``V_a`` that slave node a wears off the master side, ``shape=(n,)``.
            area: Areas of this rank's master nodes, ``shape=(k,)``.
        """
        now, before = (
            frames.points,
            history.frames.points,
        )  # rows at the start: for nodes that have left in the step
        mine = now.m.T @ volume + before.m.T @ np.where(now.alone, volume, 0.0)
        volumes = self._comm.allreduce(mine)
        area = self._master.on_all_ranks(area[:, None])[:, 0]
        bears = area > NO_AREA * area.max(initial=0.0)
        kept = np.where(bears, np.maximum(volumes, 0.0), 0.0)
        if kept.any():
            kept *= volumes.sum() / kept.sum()
        depth = np.divide(kept, area, out=np.zeros_like(area), where=bears)
        sums = np.zeros((2, area.size))
        for side in self._master.sides:
            some = bears[side.nodes]
            mean = (depth[side.nodes] * some).sum(axis=1) / np.maximum(some.sum(axis=1), 1)
            np.add.at(
                sums, (slice(None), side.nodes), np.stack((mean, np.ones_like(mean)))[:, :, None]
            )
        return np.where(bears, depth, sums[0] / sums[1])[self._master.mine]

    def gap_at(self, u: np.ndarray, frames: Frames) -> tuple[np.ndarray, MortarPoints]:
        """Gaps without wear, ``shape=(n,)``, length, and contact points at a displacement.

        Nodes opposite no master facet get an open gap.  Collective.

        Args:
            u: Displacement, owned degrees of freedom.
            frames: Frames of the step, with the nodes that have left.
        """
        there = self.projected(u, frames.left)
        gap = there.flat + there.points.motion(u)[:, -1]
        return np.where(there.points.alone, np.maximum(gap, self._apart), gap), there.points

    def check_start(self, contact: Contact, body: ElasticBody) -> str:
        """See ``Geometry``: raise if contact would compress one body between its opposite faces.

        Raises:
            ValueError: Both sides belong to one connected part of the mesh and overlap by more than
                the shortest facet edge.
        """
        part, parts = body.parts
        sides, frames = (contact.nodes, self.opposite), contact.history.frames
        here = body.total([np.bincount(part[nodes], minlength=parts) for nodes in sides])
        lengths = np.append(-frames.flat[~frames.points.alone], 0.0)
        depth = body.largest(lengths) / self._master.smallest
        if (here > 0).all(axis=0).any() and depth > 1.0:
            raise ValueError(
                f"both sides of {contact!r} belong to one part of the mesh, and stand inside each other by {depth:.3g} times the smallest facet, "
                "like its head and its foot: the gap would be closed through the body. Name facets that face each other."
            )
        return ""

    def changes(self, history: History, textured: bool = False) -> bool:
        """See ``Geometry``."""
        return self.renews_rows

    @property
    def opposite(self) -> np.ndarray:
        """See ``NodalGeometry``."""
        return self._master.nodes

    def covered(self, frames: Frames) -> np.ndarray:
        """See ``NodalGeometry``."""
        return frames.points.share

    def slid(self, motion: np.ndarray, history: History) -> float:
        """Largest slip of a slave node on the master side, relative to its shortest facet edge.
        Collective.

        Args:
            motion: Displacement increment, owned degrees of freedom.
            history: History with the frames that give the mortar rows.
        """
        points = history.frames.points
        along = points.motion(motion)[~points.alone, :-1]
        return float(np.linalg.norm(along, axis=1).max(initial=0.0)) / self._master.smallest

    def strayed(self, state: State) -> tuple[float, float]:
        """Largest total slip of a node in contact, and the limit for small sliding, both lengths.

        The limit is half of the shortest master facet edge.  For large sliding the slip is zero and
        the limit infinite.
        """
        if self.renews_rows:
            return 0.0, np.inf
        slid = np.linalg.norm(state.displacement[:, :-1], axis=1)
        slid = slid[state.reaction[:, -1] > 0.0].max(initial=0.0)
        return float(slid), STRAYED_PART * self._master.smallest

    def sides(self, state: State, points: MortarPoints) -> tuple[float, float] | None:
        """Ratios slave to master of facet size and of body stiffness; None without contact.
        Collective.

        Both are medians over the slave nodes in contact.  In three dimensions the nodal stiffness
        is proportional to modulus times size, so its ratio is divided by the ratio of sizes.
        """
        some = state.reaction[:, -1] > 0.0
        dim = self.x.shape[1]
        size = (self._slave.size[self._mine] / np.where(some, points.m @ self._master.size, 1.0))[
            some
        ]
        pairs = np.stack((size, points.stiffer[some] / size ** (dim - 2)))
        found = np.concatenate(self._comm.allgather(pairs), axis=1)
        size, stiff = np.median(found, axis=1) if found.size else (None, None)
        return None if size is None else (float(size), float(stiff))

    def clamped(self, fixed: np.ndarray, frames: Frames) -> np.ndarray:
        """Mask of nodes without friction due to tangential supports, ``shape=(n,)``.

        Nodes on a symmetry plane, where the master nodes are constrained as well, are not included.
        Collective.

        Args:
            fixed: Degrees of freedom with boundary conditions.
            frames: Frames of the slave nodes.
        """
        master, found = self._master, np.zeros(len(self.x), dtype=bool)
        held = master.on_all_ranks(np.isin(master.own, fixed))
        size = CLEAR_GAP * self._extent
        for k, axis in enumerate(np.eye(self.x.shape[1])):
            along = np.linalg.norm(frames.frame[:, :-1] @ axis, axis=1) > FREE_PART
            planes = np.unique(master.x[held[:, k], k])
            beside = np.abs(self.x[:, k, None] - planes).min(axis=1, initial=np.inf) > size
            found |= self._supported[:, k] & along & beside
        return found

    def follows(self, depends_on_position: bool, history: History) -> bool:
        """See ``Geometry``."""
        return self.renews_rows

    def arms(self, displacement: np.ndarray, frames: Frames, u: np.ndarray | None) -> np.ndarray:
        """See ``Geometry``: current nodal positions, so moments are about the origin."""
        if u is None:
            raise ValueError(
                "contact.moment on a deformable surface needs the displacement: contact.moment(problem.u)."
            )
        return self.x + u[self._dofs]

    def met(self, fixed: np.ndarray, frames: Frames) -> Frames:
        """Frames whose normals have no component along constrained directions.  Collective.

        So the normal of a node on a symmetry plane lies in that plane.

        Args:
            fixed: Degrees of freedom with boundary conditions.
            frames: The present frames.
        """
        held = np.isin(self._dofs, fixed)
        if not self._comm.allreduce(bool((held != frames.points.met).any())):
            return frames
        self._supported, self._projected = held, (None, None)
        self._planes = []
        for k, at in enumerate(self.x.T):
            where = np.concatenate(self._comm.allgather(at[held[:, k]]))
            if where.size and np.ptp(where) <= CLEAR_GAP * self._extent:
                self._planes.append((k, where.mean()))
        return self.projected(frames.at)._replace(start=frames.start, renewed=frames.renewed)


class Skin:
    """Facets of one contact side and their ``m`` nodes, gathered from all ranks on each rank.

    Nodes are numbered ``0 ... m - 1``, in the order of their global indices ("skin numbers").

    Args:
        displacements: Nodes and degrees of freedom of the displacement space.
        facets: Local facet indices.
        comm: MPI communicator.  Collective.
        density: Weight of the surface measure at the local nodes; None means one everywhere.

    Attributes:
        sides: The facets, grouped by shape, with skin numbers of their nodes until ``keep`` changes
            these.
        nodes: Local indices of the ``k`` nodes that this rank owns.
        mine: Skin numbers of the nodes that this rank owns, ``shape=(k,)``.
        own: Owned degrees of freedom of these nodes, ``shape=(k, gdim)``.
        smallest: Length of the shortest facet edge (the first edge of each facet is measured).
        size: Mean edge length of the facets at each node, ``shape=(m,)``.
        numbers: Global node indices, sorted, ``shape=(m,)``.
        x: Undeformed positions of the nodes, ``shape=(m, gdim)``.
        dofs: Global degrees of freedom of the nodes, ``shape=(m, gdim)``.
    """

    def __init__(
        self,
        displacements: Displacements,
        facets: np.ndarray,
        comm: MPI.Comm,
        density: np.ndarray | None = None,
    ):
        sides, self._comm = _facets_of_all_ranks(displacements, facets, comm, density), comm
        self.numbers = np.unique(
            np.concatenate([np.zeros(0, int), *(side.nodes.ravel() for side in sides)])
        )
        self.x = np.zeros((self.numbers.size, displacements.dim))
        for side in sides:
            self.x[np.searchsorted(self.numbers, side.nodes)] = side.x
        self.sides = [s._replace(nodes=np.searchsorted(self.numbers, s.nodes)) for s in sides]
        self._nodes = [side.nodes for side in self.sides]
        self._inside_out = [side.inside_out for side in sides]
        ends = [side.x[:, side.corners] for side in sides]
        edges = [np.linalg.norm(x[:, 1] - x[:, 0], axis=1) for x in ends]
        self.smallest = min([edge.min(initial=np.inf) for edge in edges], default=np.inf)
        sums = np.zeros((2, self.numbers.size))
        for side, edge in zip(self.sides, edges):
            np.add.at(
                sums, (slice(None), side.nodes), np.stack((edge, np.ones_like(edge)))[:, :, None]
            )
        self.size = sums[0] / sums[1]
        index_map, count = displacements.V.dofmap.index_map, displacements.count
        own = np.isin(_numbers(index_map, np.arange(count)), self.numbers)
        self.nodes = np.flatnonzero(own)
        self.own = displacements.dofs(self.nodes)
        given = comm.allgather(_numbers(index_map, self.nodes))
        self._at = np.searchsorted(self.numbers, np.concatenate(given))
        self.mine = np.searchsorted(self.numbers, given[comm.rank])
        self.dofs = self.on_all_ranks(displacements.owned[1] + self.own)
        self._compliance: tuple = (None, None, None)  # matrix, its state counter, inverse blocks

    def on_all_ranks(self, rows: np.ndarray) -> np.ndarray:
        """Nodal values of all ``m`` nodes, gathered from the ``k`` nodes of each rank.  Collective.

        Args:
            rows: Values at the nodes that this rank owns, ``shape=(k, ...)``.

        Returns:
            ``shape=(m, ...)``.
        """
        found = np.zeros((self.numbers.size, *rows.shape[1:]), dtype=rows.dtype)
        found[self._at] = np.concatenate(self._comm.allgather(rows))
        return found

    def compliance(self, K: PETSc.Mat) -> np.ndarray:
        """Inverse diagonal blocks of ``K``, ``shape=(m, gdim, gdim)``, length per force.

        Entries along constrained directions are zero.  The result is cached; collective if ``K``
        has changed.
        """
        matrix, state, C = self._compliance
        if matrix is not K or state != K.stateGet():
            blocks = nodal_blocks(K, self.own)
            alone = np.abs(blocks - blocks * np.eye(self.own.shape[1])).sum(axis=2) == 0.0
            fixed = alone & (np.einsum("nii->ni", blocks) == 1.0)  # rows of boundary conditions
            C = np.linalg.inv(blocks)
            C[fixed] = 0.0
            C = self.on_all_ranks(C)
            self._compliance = K, K.stateGet(), C
        return C

    def moved(self, u: np.ndarray) -> tuple[list[Side], np.ndarray]:
        """Deformed facets and positions of all nodes, ``shape=(m, gdim)``, at displacement ``u``.
        Collective.
        """
        there = self.x + self.on_all_ranks(u[self.own])
        sides = zip(self.sides, self._nodes, self._inside_out)
        return [side.moved(there[nodes], signs) for side, nodes, signs in sides], there

    def deformed(self, there: np.ndarray) -> np.ndarray:
        """Surface deformation gradient at each node, ``shape=(m, 3, 3)``; in 3-D only.

        It is the area-weighted mean over the adjacent facets, and maps unit normals to unit
        normals.

        Args:
            there: Deformed positions of the nodes, ``shape=(m, 3)``.
        """
        sums, areas = np.zeros((self.numbers.size, 3, 3)), np.zeros((self.numbers.size, 1, 1))
        for side, nodes in zip(self.sides, self._nodes):
            corners = nodes[:, side.corners]
            (before, area), (after, _) = (_facet_bases(x[corners]) for x in (self.x, there))
            parts = area[:, None, None] * after @ np.linalg.inv(before)
            np.add.at(sums, nodes, parts[:, None])
            np.add.at(areas, nodes, area[:, None, None, None])
        return np.divide(sums, areas, np.zeros_like(sums), where=areas > 0.0)

    def keep(self, nodes: np.ndarray) -> None:
        """Discard all facets without any of the given nodes, and renumber the nodes of the others.

        Args:
            nodes: Skin numbers; node ``nodes[i]`` becomes node i, and all others become -1.
        """
        places = np.full(self.numbers.size, -1)
        places[nodes] = np.arange(nodes.size)
        near = [(places[at] >= 0).any(axis=1) for at in self._nodes]
        sides = [side.some(kept) for side, kept in zip(self.sides, near)]
        self._nodes = [side.nodes for side in sides]
        self._inside_out = [side.inside_out for side in sides]
        self.sides = [side._replace(nodes=places[side.nodes]) for side in sides]


class MortarPoints(ContactPoints):
    """Slave nodes, each coupled to master nodes by mortar coefficients; see ``ContactPoints``.

    Args:
        dofs, frames, owned: As in ``ContactPoints``.
        rows: Mortar coefficients of the slave nodes.
        opposite: The ``Skin`` of the master side.
        comm: MPI communicator.  All methods that compute motions or forces are collective.

    Attributes:
        alone: Nodes opposite no master facet (or with too small an overlap), which never touch,
            ``shape=(n,)``, bool.
        share: Fraction of each node's area that is opposite the master side, ``shape=(n,)``.
        turns: Mean rotations of the slave and the master side, ``shape=(gdim, gdim)`` each.
        sides: Positions of the nodes of the slave and the master side, ``shape=(m, gdim)`` each.
        met: Constrained degrees of freedom for which the normals were computed
            (``MortarGeometry.met``), ``shape=(n, gdim)``, bool.
        m: Mortar coefficients of the master nodes, sparse, ``shape=(n, m)``.
        stiffer: Normal stiffness of each slave node divided by that of the opposite nodes, set by
            ``stiffness``, ``shape=(n,)``.
    """

    local = False
    met: np.ndarray
    turns: list[np.ndarray]
    sides: tuple[np.ndarray, np.ndarray]
    stiffer: np.ndarray

    def __init__(
        self,
        dofs: np.ndarray,
        frames: np.ndarray,
        owned: tuple[int, int, int],
        rows: Rows,
        opposite: Skin,
        comm: MPI.Comm,
    ):
        (size, self.first, self._whole), (self.count, self.dim) = owned, dofs.shape
        self.size, self.dofs, self.frames = size, dofs, frames
        self.m, self._opposite, self._comm = rows.m, opposite, comm
        self.alone = ~rows.covered
        none = np.zeros(self.count)
        part = np.divide(rows.area, rows.whole, out=none, where=rows.whole > 0.0)
        self.share = frozen(np.where(rows.covered, part, 0.0))
        own, starts = np.arange(self.count), self.m.indptr + np.arange(self.count + 1)
        nodes = np.concatenate((own, self.count + self.m.indices))
        owner = np.concatenate((own, np.repeat(own, np.diff(self.m.indptr))))
        known = np.concatenate((self.first + dofs, opposite.dofs))[nodes]
        order = np.argsort(
            owner * self._whole + known[:, 0], kind="stable"
        )  # as PETSc wants columns
        values = np.concatenate((np.ones(self.count), -self.m.data))[order]
        counts = np.repeat(np.diff(starts), self.dim)  # of nodes in each row
        ends, rows = np.cumsum(counts), np.repeat(np.arange(dofs.size), counts)
        at = np.arange(rows.size) - np.repeat(
            ends - counts - np.repeat(starts[:-1], self.dim), counts
        )
        values, columns = values[at], known[order[at]]
        B = values[:, None] * frames.reshape(-1, self.dim)[rows]
        starts = np.append(0, ends)
        self._B = self._petsc(self.dim * starts, columns.ravel(), B)
        own = columns[np.arange(rows.size), rows % self.dim]
        self._sums = values, own, starts
        self._points, self._body = self._B.createVecLeft(), self._B.createVecRight()
        self.hold(
            np.zeros((self.count, self.dim - 1), dtype=bool), np.zeros(self.count, dtype=bool)
        )

    def _petsc(self, starts: np.ndarray, columns: np.ndarray, values: np.ndarray) -> PETSc.Mat:
        csr = (starts.astype(PETSc.IntType), columns.astype(PETSc.IntType), np.ravel(values))
        size = ((self.dofs.size, None), (self.size, self._whole))
        return PETSc.Mat().createAIJWithArrays(size, csr, comm=self._comm)

    @cached_property
    def _S(self) -> PETSc.Mat:
        """Matrix that maps forces to their local components at the slave nodes.  Collective."""
        turned = block_diagonal(self.frames)
        return self._petsc(
            turned.indptr, (self.first + self.dofs).ravel()[turned.indices], turned.data
        )

    @cached_property
    def _sizes(self) -> PETSc.Mat:
        """Matrix of the absolute values of the entries of ``B``.  Collective."""
        starts, columns, values = self._B.getValuesCSR()
        return self._petsc(starts, columns, np.abs(values))

    def known(self, motion: np.ndarray, terms: Iterable[np.ndarray]) -> None:
        """See ``ContactPoints``: None, as there is no friction along constrained directions.

        Across a symmetry plane, for example, the motions of opposite nodes and of their mirror
        images cancel, but the mortar rows do not contain the mirror images.
        """

    def motion(self, u: np.ndarray) -> np.ndarray:
        """See ``ContactPoints``."""
        return self._rows(self._B, u)

    def magnitudes(self, u: np.ndarray) -> np.ndarray:
        """See ``ContactPoints``."""
        return self._rows(self._sizes, np.abs(u))

    def reactions(self, forces: np.ndarray) -> np.ndarray:
        """See ``ContactPoints``: local components of the forces on the slave nodes."""
        return np.einsum("nij,nj...->ni...", self.frames, forces[self.dofs])

    def add_forces(self, reaction: np.ndarray, forces: np.ndarray) -> None:
        """See ``ContactPoints``."""
        forces += self._columns(self._B, reaction)

    def add_magnitudes(self, reaction: np.ndarray, forces: np.ndarray) -> None:
        """See ``ContactPoints``."""
        forces += self._columns(self._sizes, np.abs(reaction))

    def _rows(self, matrix: PETSc.Mat, u: np.ndarray) -> np.ndarray:
        if u.ndim > 1:
            return np.stack([self._rows(matrix, column) for column in u.T], axis=-1)
        self._body.array_w[:] = u
        matrix.mult(self._body, self._points)
        return self._points.array_r.reshape(self.count, self.dim).copy()

    def _columns(self, matrix: PETSc.Mat, reaction: np.ndarray) -> np.ndarray:
        self._points.array_w[:] = reaction.ravel()
        matrix.multTranspose(self._points, self._body)
        return self._body.array_r.copy()

    def matrix(self, blocks: np.ndarray) -> sparse.csr_matrix:
        """See ``ContactPoints``."""
        return self._product(blocks, self._B)

    def reaction_stiffness(self, blocks: np.ndarray) -> sparse.csr_matrix:
        """See ``ContactPoints``."""
        return self._product(blocks, self._S)

    def _product(self, blocks: np.ndarray, by: PETSc.Mat) -> sparse.csr_matrix:
        """The matrix product ``B^T D by``, with ``D`` block diagonal.  Collective."""
        D, size = block_diagonal(blocks), (self.dofs.size, None)
        first = self._B.getOwnershipRange()[0]
        csr = (D.indptr.astype(PETSc.IntType), (D.indices + first).astype(PETSc.IntType), D.data)
        D = PETSc.Mat().createAIJ((size, size), csr=csr, comm=self._comm)
        turned = D.matMult(by)
        product = self._B.transposeMatMult(turned)
        starts, columns, values = product.getValuesCSR()
        for matrix in (D, turned, product):
            matrix.destroy()
        return sparse.csr_matrix((values, columns, starts), (self.size, self._whole))

    def rows(
        self, turns: np.ndarray, free: np.ndarray
    ) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """See ``ContactPoints``.  Collective."""
        directions = turns @ self.frames
        own = np.linalg.norm(directions * free[self.dofs][:, None, :], axis=2)
        # Constrained slave node: the support carries the motion of the opposite nodes.
        directions[(own < FREE_PART) | self.closed[:, None]] = 0.0
        held = np.concatenate(self._comm.allgather(self.first + np.flatnonzero(~free)))
        values, columns, starts = self._sums
        values = np.where(np.isin(columns, held), 0.0, values)
        sums = sparse.csr_matrix((values, columns, starts), (self.dofs.size, self._whole))
        return block_diagonal(directions), sums

    @property
    def reach(self) -> np.ndarray:
        """See ``ContactPoints``."""
        return np.append(super().reach, self._opposite.dofs)

    def stiffness(self, K: PETSc.Mat) -> NodalStiffness:
        """See ``ContactPoints``: the nodes of both sides act as springs in series.  Collective.

        The stiffness ``k`` of node a follows from ``1/k = 1/k_a + sum_b m_ab^2 / k_b``;
        tangentially, this is an equation of matrices.
        """
        alone = super().stiffness(K)
        C = self._opposite.compliance(K)
        squares = self.m.multiply(self.m).tocsr()
        flat = (squares @ C.reshape(len(C), -1)).reshape(-1, self.dim, self.dim)
        local = self.frames @ flat @ self.frames.transpose(0, 2, 1)
        self.stiffer = alone.normal * local[:, -1, -1]
        normal = 1.0 / (1.0 / alone.normal + local[:, -1, -1])
        along = local[:, :-1, :-1]
        eye = np.eye(self.dim - 1)
        tangential = np.linalg.solve(eye + alone.tangential @ along, alone.tangential)
        return NodalStiffness(normal, tangential)


def _facet_bases(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bases of ``m`` facets, ``shape=(m, 3, 3)``, and the areas spanned by their first two columns.

    The columns are two edges of a triangle or the diagonals of a quadrilateral, and the unit
    normal.

    Args:
        x: Positions of the corners, ``shape=(m, 3, 3)`` or ``(m, 4, 3)``.
    """
    one, other = x[:, -1] - x[:, 0], x[:, 1] - x[:, 2 * (x.shape[1] - 3)]
    normal = np.cross(one, other)
    area = np.linalg.norm(normal, axis=1)
    return np.stack((one, other, normal / area[:, None]), axis=2), area


def _between(slave: np.ndarray, master: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean of two rotations, and axis and angle (radians) of their relative rotation."""
    dim = len(slave)
    first, second = np.eye(3), np.eye(3)
    first[:dim, :dim], second[:dim, :dim] = slave, master
    one, vector = Rotation.from_matrix(first), Rotation.from_matrix(first.T @ second).as_rotvec()
    angle = float(np.linalg.norm(vector))
    mean = one * Rotation.from_rotvec(vector / 2)
    axis = one.apply(vector / angle) if angle > 0.0 else vector
    return mean.as_matrix()[:dim, :dim], axis[:dim], angle


def _facets_of_all_ranks(
    displacements: Displacements, facets: np.ndarray, comm: MPI.Comm, density: np.ndarray | None
) -> list[Side]:
    """Facets of all ranks, grouped by shape, with global node numbers.  Collective.

    Args:
        displacements: Nodes and degrees of freedom of the displacement space.
        facets: Local facet indices.
        comm: MPI communicator.
        density: Weight of the surface measure at the local nodes; None means one everywhere.
    """
    mine = []
    for part in facets_of(displacements, facets):
        numbers = _numbers(displacements.V.dofmap.index_map, part.nodes.ravel()).reshape(
            part.nodes.shape
        )
        here = None if density is None else density[part.nodes]
        mine.append(
            Side(
                numbers,
                part.x,
                part.outwards,
                part.local,
                part.vertices,
                part.degree,
                part.inverse,
                here,
            )
        )
    shapes: dict = {}
    for side in [side for sides in comm.allgather(mine) for side in sides]:
        key = (side.corners.tobytes(), np.round(side.local, 9).tobytes())
        shapes.setdefault(key, []).append(side)
    names = BY_FACET if density is not None else BY_FACET[:-1]
    return [
        same[0]._replace(**{n: np.concatenate([getattr(s, n) for s in same]) for n in names})
        for same in shapes.values()
    ]


def _numbers(index_map: Any, nodes: np.ndarray) -> np.ndarray:
    """Global indices of nodes given by local indices."""
    return index_map.local_to_global(nodes.astype(np.int32)).astype(np.int64)


def _unconstrained_normals(held: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Unit normals without their components along constrained directions, ``shape=(n, gdim)``.

    A normal with constrained components only is left unchanged.
    """
    left = np.where(held, 0.0, normals)
    length = np.linalg.norm(left, axis=1, keepdims=True)
    some = length > FREE_PART  # else the support holds the node along its normal
    return np.where(some, left / np.where(some, length, 1.0), normals)
