# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A contact in one load step: what follows at its nodes from a displacement of the body.

Kinematics is affine in a step: frames, gaps and ways along the surface were taken for one position, see ``geometry.py``.  Surfaces
that force drives move by further unknowns ``c``, see ``surfaces/driven.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI

from dolfinx_contact.contact.geometry import Frames, carried
from dolfinx_contact.contact.state import (
    OPPOSITE_WEAR,
    SLIP_KEPT,
    History,
    State,
    Status,
    frozen_state,
)
from dolfinx_contact.law.dissipation import slipped_last, work_of_friction
from dolfinx_contact.law.friction import Friction
from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.checks import UNIT_ROUNDOFF, place
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.surfaces.surface import cross

if TYPE_CHECKING:
    from petsc4py import PETSc

    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.displacements import Displacements
    from dolfinx_contact.contact.interface import ContactPoints, NodalStiffness
    from dolfinx_contact.law.maps import ContactLaw, NodalMap
    from dolfinx_contact.surfaces.surface import Surface


@dataclass(frozen=True, eq=False)
class ContactStep:
    """Frames, law and history of ``n`` nodes as a step has them.  Arrays are in the local frame; nothing in it changes.

    Attributes:
        given: The contact: nodes, surface, areas.
        frames: Frames and gaps.
        friction: The law at the nodes; coefficients are numbers.
        law: The kernel's law of this friction.
        last: State at the end of the last step, in these frames.
        moved: Motion of the surface, ``shape=(gdim,)`` or ``(n, gdim)``, length.
        worn: Depths of both sides that have opened gaps before the step, ``shape=(n,)``, length.
        clear: Gap of nodes that cannot touch, at least.
        stiffness: ``NodalStiffness`` of the nodes; None where nothing is measured.
        depth: What the step itself wears, ``shape=(n,)``, length; None is nothing.
        before: Slip before nodes touch, which does not count, ``shape=(n, gdim - 1)``; None is none.
        dragged: Slip of held nodes past which force drives the surface, ``shape=(n, gdim - 1)``, a direction; None is nowhere.
        columns: ``D``, what the unknown motions ``c`` of surfaces move at the nodes, ``shape=(n, gdim, m)``; None where there are none.
        begun: The law as the step began, if it follows the state; else None.
    """

    given: Contact
    frames: Frames
    friction: Friction
    law: ContactLaw
    last: State
    moved: np.ndarray
    worn: np.ndarray
    clear: float
    stiffness: NodalStiffness | None = None
    depth: np.ndarray | None = None
    before: np.ndarray | None = None
    dragged: np.ndarray | None = None
    columns: np.ndarray | None = None
    begun: Friction | None = None

    def but(self, **parts: Any) -> ContactStep:
        """The same with other parts."""
        return replace(self, **parts)

    def where_it_stands(self) -> ContactStep:
        """The same with the surface where it stands now."""
        return self.but(moved=self.given.geometry.surface_moved(self.frames))

    def with_friction(self, friction: Friction) -> ContactStep:
        """The same with another law."""
        if friction is self.friction:
            return self
        return self.but(friction=friction, law=friction.law(self.points.dim))

    # -- what does not depend on the step ------------------------------------------------------

    @property
    def nodes(self) -> np.ndarray:
        """See ``Contact``."""
        return self.given.nodes

    @property
    def x(self) -> np.ndarray:
        """See ``Contact``."""
        return self.given.x

    @property
    def displacements(self) -> Displacements:
        """See ``Contact``."""
        return self.given.displacements

    @property
    def surface(self) -> Surface:
        """See ``Contact``."""
        return self.given.surface

    @property
    def comm(self) -> MPI.Comm:
        """MPI communicator of the mesh."""
        return self.given.comm

    @property
    def area(self) -> np.ndarray:
        """See ``Contact``."""
        return self.given.area

    @property
    def points(self) -> ContactPoints:
        """Rows of the motion, and what supports hold."""
        return self.frames.points

    @property
    def opening(self) -> np.ndarray:
        """Depth by which wear has opened the gap at each node, that of the step included, ``shape=(n,)``."""
        return self.worn if self.depth is None else self.worn + self.depth

    # -- motion --------------------------------------------------------------------------------

    def at(self, u: np.ndarray, c: np.ndarray | None = None) -> State:
        """The state of a displacement without reactions: gaps and slips since the last step.

        Args:
            u: Displacement of owned degrees of freedom, length units.
            c: Motions of surfaces, ``shape=(m,)``, length units.
        """
        points, moved = self.points, self.moved
        if self.columns is not None and c is not None:
            moved = moved + self.columns @ c
        motion = points.motion(u)
        displacement = motion - moved
        gap = self.frames.flat + self.opening + displacement[:, -1]
        slip = displacement - self.last.displacement
        if self.frames.way is not None:
            slip[:, :-1] += self.frames.way
        if self.before is not None:
            slip[:, :-1] -= self.before
        known = points.known(slip, (motion, moved, self.last.displacement))
        slip = slip[:, :-1]
        points.without_held(slip)
        if known is not None:
            slip += known
        slip[points.alone] = 0.0  # opposite nothing
        gap[points.closed] = np.maximum(gap[points.closed], self.clear)
        n = len(gap)
        return State(
            displacement, np.zeros((n, points.dim)), gap, slip, np.zeros(n, np.uint8), known
        )

    def moved_by(self, axis: np.ndarray, turns: bool) -> np.ndarray:
        """What moving the surface by one along, or turning it about an axis, moves at the nodes, ``shape=(n, gdim)``."""
        frame, surface = self.frames.frame, self.surface
        if turns:
            return (frame @ cross(axis, self.frames.arms)[:, :, None])[:, :, 0]
        along = frame @ axis
        if not (surface.curved or surface.spins):  # the axes are those of its frame
            along = np.rint(along)
        return np.broadcast_to(along, (self.points.count, self.points.dim))

    def gap_rounding(self, u: np.ndarray) -> float:
        """Bound of the rounding in a gap, that of solving for ``u`` included, length units."""
        surface, motion = self.surface, self.points.motion(u)
        lengths = (surface.point, surface.displacement, motion)
        largest = max(np.abs(length).max(initial=0.0) for length in lengths)
        return self.given.geometry.gap_rounding_of(largest)

    def motion_rounding(self, u: np.ndarray, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Estimate of the rounding in each gap, ``shape=(n,)``, and slip, ``shape=(n, gdim - 1)``, length units.

        That of the coordinates counts in the gap: a body drawn to rest on the plane may stand a last digit below it.
        """
        terms = self.points.magnitudes(u) + np.abs(self.moved)
        x, point = self.given.geometry.x, self.surface.point
        coordinates = max(np.abs(a).max(initial=0.0) for a in (x, point))
        gap = terms[:, -1] + coordinates + self.opening
        slip = terms[:, :-1] + np.abs(self.last.displacement[:, :-1])
        if state.known is None:
            slip[self.points.held] = 0.0
        return UNIT_ROUNDOFF * gap, UNIT_ROUNDOFF * slip

    # -- reactions -----------------------------------------------------------------------------

    def required(self, forces: np.ndarray) -> np.ndarray:
        """Reactions that balance forces on the body, owned degrees of freedom, global frame: ``shape=(n, gdim)``."""
        reaction = self.points.reactions(-forces)
        reaction[self.points.closed] = 0.0
        return reaction

    def respond(
        self, u: np.ndarray, reaction: np.ndarray, map: NodalMap, c: np.ndarray | None = None
    ) -> State:
        """The state with the reactions that a map makes of those given, at a displacement."""
        state = self.at(u, c)
        law = self.law_of(self.law, state.known)
        reaction, status = map(law, reaction, state.gap, state.slip_increment)
        return state._replace(reaction=reaction, status=status)

    def linearised(
        self, u: np.ndarray, reaction: np.ndarray, map: NodalMap, c: np.ndarray | None = None
    ) -> tuple[State, tuple[np.ndarray, np.ndarray]]:
        """As ``respond``, and the (Clarke) derivatives of the new reactions on the branches taken.

        Returns:
            The state; derivatives by the reaction before, dimensionless, and by slip and gap, force per length, ``shape=(n, gdim, gdim)`` each.
        """
        state = self.at(u, c)
        law = self.law_of(self.law, state.known)
        reaction, status, *both = map.linearised(law, reaction, state.gap, state.slip_increment)
        return state._replace(reaction=reaction, status=status), tuple(both)

    def measuring_map(self) -> NodalMap:
        """The map by which states are measured, and which starts are chosen with."""
        from dolfinx_contact.law.maps import ReturnMap

        return ReturnMap(self.stiffness.normal, self.stiffness.normal)

    # -- nodes that supports hold --------------------------------------------------------------

    def law_of(self, law: Any, known: np.ndarray | None, nodes: Any = slice(None)) -> Any:
        """What takes the place of the kernel's law of some nodes where supports move, guide, or have moved them.

        Args:
            law: Of the kernel, of these nodes.
            known: Slip that supports prescribe, ``shape=(n, gdim - 1)``; None is none.
            nodes: Their indices, ``shape=(k,)``; all of them by default.
        """
        if not self.points.supported.size or self.friction.frictionless:
            return law
        every = isinstance(nodes, slice)
        if every and known is None and self.dragged is None:
            return self._law_of_still_nodes
        return self._supported(law, known, nodes, every)

    @cached_property
    def _law_of_still_nodes(self) -> Any:
        return self._supported(self.law, None, slice(None), True)

    def _supported(self, law: Any, known: np.ndarray | None, nodes: Any, every: bool) -> Any:
        from dolfinx_contact.law.supported import supported

        points = self.points
        at_rows = np.arange(points.count)[nodes]
        at = np.searchsorted(points.supported, at_rows)
        at[at == points.supported.size] = 0
        mine = points.supported[at] == at_rows
        slip = np.zeros((points.count, points.dim - 1)) if known is None else known
        slip, last = slip[at_rows], self.last.reaction[at_rows, :-1]
        if self.dragged is not None:
            slip = np.where(self.dragged[at_rows] != 0.0, self.dragged[at_rows], slip)
        friction = self.friction if every else self.friction.at(at_rows)
        return supported(law, friction, np.flatnonzero(mine), points.along[at[mine]], slip, last)

    @cached_property
    def free_friction(self) -> Friction:
        """Friction along the directions that supports leave free: at guided nodes, whose slip is along ``f``, ``f.d(f)``."""
        points, friction = self.points, self.friction
        if not points.along.any() or friction.frictionless:
            return friction
        from dolfinx_contact.contact.friction_field import guided

        return guided(friction, points.count, points.supported, points.along)

    def known_slip(self, state: State) -> np.ndarray:
        """Part of a state's slip that supports prescribe, ``shape=(n, gdim - 1)``."""
        return np.zeros_like(state.slip_increment) if state.known is None else state.known

    # -- end -----------------------------------------------------------------------------------

    def may_land(self, u: np.ndarray) -> bool:
        """Whether nodes of this rank are open at the last displacement ``u``, and there is friction if they land.  Collective where points are not ``local``."""
        opens = (self.last.reaction[:, -1] == 0.0) & ~self.points.closed
        if self.points.local and not opens.any():
            return False
        landing = self.last.gap[opens] > self.gap_rounding(u)
        return bool(landing.any()) and not self.friction.frictionless

    def with_slip_past_edges(self, state: State, u: np.ndarray) -> State:
        """A state in which nodes that have left what was opposite have slipped past its edge.  Collective between bodies."""
        given = self.given
        found = given.geometry.slip_past_edge(u, self.frames, given.history)
        if found is None:
            return state
        left, slip = found
        return state._replace(slip_increment=np.where(left[:, None], slip, state.slip_increment))

    def with_own_gaps(self, state: State, u: np.ndarray) -> State:
        """A state whose open nodes on a deformable surface have the gaps of a displacement, not of the rows that a step used.  Collective."""
        given = self.given
        if not given.geometry.renews_rows:
            return state
        gap, points = given.geometry.gap_at(u, self.frames)
        gap = gap + given.geometry.opening(points, given.history, self.depth)
        return state._replace(gap=np.where(state.reaction[:, -1] > 0.0, state.gap, gap))

    def ended(self, state: State, u: np.ndarray | None = None) -> History:
        """What the next step gets from this one, which ends in a state.  Collective on deformable surfaces.

        Args:
            state: The state.
            u: Its displacement, owned degrees of freedom; needed between bodies.
        """
        geometry, frames = self.given.geometry, self.frames
        if self.surface.spin is not None:
            turned = geometry.turned_past(state.displacement, frames)
            state = state._replace(displacement=turned)
        state = frozen_state(state)
        sums, worn, doubtful, unloads = self._summed(state)
        bare = None
        if geometry.renews_rows and u is not None:
            bare = geometry.gap_at(u, frames)[1].alone
        ended = geometry.ended(frames)
        return History(
            state, ended, sums, self.friction, worn, bare, self.before, doubtful, unloads
        )

    def _summed(self, state: State) -> tuple:
        """Sums, depths of the other side, doubtful work, and what unloads nodes, of ``History``.  Collective where the other side wears."""
        given, friction = self.given, self.friction
        history, repeats, covered = given.history, given.repeats, given.geometry.covered
        slip = history.slip_kept + state.slip_increment
        sticks = (friction.mu.any(axis=-1) & (state.status == int(Status.STICK)))[:, None]
        slip, kept = np.where(sticks, 0.0, slip), np.where(sticks, slip, 0.0)
        pressed = np.maximum(self.last.reaction[:, -1], state.reaction[:, -1])
        # Of nodes that come in over an edge or leave in the step each slips half of it in the mean: paths of the first count wholly.
        touches = (pressed > 0.0) & (covered(self.frames) > 0.0)
        work, turned = self.work(slip, state.reaction)
        work, turned = repeats * work, repeats * turned
        added = {
            "dissipation": work.sum(axis=1),
            "slip_path": repeats * (touches * np.linalg.norm(slip, axis=1)),
        }
        sums, worn, depth = history.sums | {SLIP_KEPT: kept}, history.worn, np.zeros(len(pressed))
        if given.wear is not None:
            from dolfinx_contact.contact.worn import worn_by

            depth, added["wear_depth"], more = worn_by(self, work)
            if more is not None:
                sums[OPPOSITE_WEAR] = sums.get(OPPOSITE_WEAR, 0.0) + more
                worn = given.geometry.everywhere(sums[OPPOSITE_WEAR])
        sums |= {name: sums[name] + part for name, part in added.items()}
        turns = self.points.dim == 3 and (friction.mu.ndim > 1 or not friction.isotropic)
        doubtful = float(np.abs(turned.sum(axis=1)).sum()) if turns else None
        return {name: frozen(a) for name, a in sums.items()}, worn, doubtful, (depth, pressed)

    # -- results -------------------------------------------------------------------------------

    def bipotential_gap(self, state: State) -> np.ndarray:
        """See ``Contact``."""
        gap = np.maximum(state.gap, 0.0)
        return self.law.bipotential_gap(state.reaction, gap, state.slip_increment)

    def opened(self, state: State) -> np.ndarray:
        """Nodes that touched at the end of the last step and are open now, ``shape=(n,)``, booleans."""
        return (self.last.reaction[:, -1] > 0.0) & (state.reaction[:, -1] == 0.0)

    def still(self, state: State, unknown: float) -> np.ndarray:
        """Nodes called slipping whose slip, since they last stuck, is less than what is unknown of a state, ``shape=(n,)``, booleans.

        On the edge of its cone it is rounding that decides which branch the projection of a node takes that does not move.

        Args:
            state: The state.
            unknown: Force; a slip counts by the force that it makes, ``|K_t Delta u_t|``.
        """
        slips = state.status == int(Status.SLIP)
        if not slips.any():
            return slips
        kept = self.given.history.slip_kept
        slip = kept + state.slip_increment  # else what is slow would never slip
        made = np.linalg.norm(np.einsum("nij,nj->ni", self.stiffness.tangential, slip), axis=1)
        return slips & (made <= unknown) & (self.friction.mu > 0.0).any(axis=-1)

    # -- work ----------------------------------------------------------------------------------

    def work(self, slip: np.ndarray, reaction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Frictional work of the step along each principal direction, and what of it is owed to a turn, ``shape=(n, gdim - 1)`` each.

        Args:
            slip: Of the step, ``shape=(n, gdim - 1)``.
            reaction: At its end, ``shape=(n, gdim)``.
        """
        if self.begun is not None:
            start, end, turned = self.works(slip, reaction)
            return start + end, turned
        before = self.last.reaction, self._slipped
        return work_of_friction(self.friction, *before, reaction, slip, self._friction_before)

    def works(self, slip: np.ndarray, reaction: np.ndarray) -> tuple[np.ndarray, ...]:
        """Shares of that work that the forces at its start and at its end have, and what is owed to a turn, ``shape=(n, gdim - 1)`` each."""
        none, before, slipped = np.zeros_like(reaction), self.last.reaction, self._slipped
        law = self.friction if self.begun is None else self.begun
        start, turned = work_of_friction(law, before, slipped, none, slip, self._friction_before)
        end = work_of_friction(self.friction, none, slipped, reaction, slip)[0]
        return start, end, turned

    @cached_property
    def _slipped(self) -> np.ndarray:
        """See ``slipped_last``, of the last step and its law."""
        slips = self.last.status == int(Status.SLIP)
        return slipped_last(self._friction_before or self.friction, self.last.reaction, slips)

    @cached_property
    def _friction_before(self) -> Friction | None:
        """The law of the last step, its axes carried in space to the frames of this one; None before the first."""
        law, before = self.given.history.friction, self.given.history.frames
        n, gdim = self.points.count, self.points.dim
        turns = gdim == 3 and before.points is not self.points
        if law is None or not turns or (law.axes is None and law.isotropic):
            return law
        # grooves turn with the surface
        along = np.tile([1.0, 0.0], (n, 1)) if law.axes is None else law.axes
        axes = np.column_stack((along, np.zeros(n)))
        axes = carried(axes, before.frame, self.frames.frame)[:, :2]
        return Friction(law.mu, np.where(law.mu > 0, law.p, 1.0), axes=axes)


def step_of(
    contact: Contact,
    stiffness: NodalStiffness | None = None,
    frames: Frames | None = None,
    begins: bool = False,
) -> ContactStep:
    """The contact as a step has it that begins at its last state, where the surface stands.  Collective on deformable surfaces.

    Args:
        contact: The contact.
        stiffness: Of the nodes.
        frames: Of the step; None are those of the last one.
        begins: Whether fields get their present values.  Collective.
    """
    geometry, laws, history = contact.geometry, contact.laws, contact.history
    frames = history.frames if frames is None else frames
    friction, begun = laws.at_start(contact, frames) if begins else (laws.friction, None)
    same = friction is laws.friction
    law = laws.kernel if same else friction.law(contact.displacements.dim)
    last, moved = geometry.last_in(frames, history), geometry.surface_moved(frames)
    given = frames, friction, law, last, moved, geometry.opening(frames.points, history)
    return ContactStep(contact, *given, geometry.clear, stiffness, begun=begun)


def wanders(contact: Contact) -> bool:
    """Whether it matters where on the surface nodes are; the same on all ranks."""
    return contact.surface.varies or contact.laws.textured


def frames_of(
    contact: Contact, start: np.ndarray, at: np.ndarray | None = None, before: Frames | None = None
) -> Frames:
    """Frames and gaps of a step, where the surface is at present, see ``Geometry.following``.  Collective."""
    history, geometry = contact.history, contact.geometry
    moves = wanders(contact)
    if not geometry.follows(moves, history):
        return history.frames
    return geometry.following(start, at, moves, history, before)


def meet_supports(contact: Contact, fixed: np.ndarray) -> None:
    """Let frames that are means of facets' know of supports at these degrees of freedom; the last state goes along.  Collective."""
    history, geometry = contact.history, contact.geometry
    frames = geometry.met(fixed, history.frames)
    if frames is not history.frames:
        last = geometry.turned(frames, history, contact.opening)
        contact.go_back(history.but(last=last, frames=frames))


def nodal_stiffness(
    contact: Contact, K: PETSc.Mat, points: ContactPoints | None = None
) -> NodalStiffness:
    """Normal and tangential blocks of the stiffness at the contact nodes, local frame.  Collective.

    Args:
        contact: The contact.
        K: Assembled PETSc stiffness matrix on ``V``.
        points: Of a step; None are those of the last one.

    Raises:
        ValueError: on all ranks, if a node does not resist being moved along the normal.
    """
    stiffness = (contact.points if points is None else points).stiffness(K)
    with raised_together(contact.comm):
        if not (stiffness.normal > 0.0).all():
            node = int(np.argmin(stiffness.normal))
            raise ValueError(
                f"the stiffness of the contact node at {place(contact.x, node)} along the normal is "
                f"{stiffness.normal[node]:g}, which must be positive: check the sign of F (internal minus "
                "external work) and the moduli."
            )
    return stiffness


def components(contacts: Sequence[ContactStep]) -> int:
    """Components of a reaction: the normal one alone if no contact has friction.  Collective."""
    smooth = all(contact.friction.frictionless for contact in contacts)
    if contacts[0].comm.allreduce(smooth, op=MPI.LAND):
        return 1
    return contacts[0].points.dim
