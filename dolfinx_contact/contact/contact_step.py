# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A contact in one load step: gaps, slips and reactions for a displacement of the body.

Kinematics is affine within a step.  Frames, gaps and path lengths along the surface are evaluated
at one position, see ``geometry.py``.  The unknown motions of surfaces driven by force are ``c``,
see ``surfaces/driven.py``.
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
from dolfinx_contact.law.dissipation import frictional_work, slipped_last
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
    """State-independent data of ``n`` contact nodes in one load step: frames, laws, history.

    Instances are immutable.  Arrays are in the local frame.

    Attributes:
        given: The ``Contact``: nodes, surface, areas, laws and history.
        frames: Frames and gaps in the step.
        friction: Friction law at the nodes, whose coefficients are numbers.
        law: Law of the compiled kernel for this friction.
        last: ``State`` at the end of the last step, in the frames of this step.
        moved: Displacement of the surface, ``shape=(gdim,)`` or ``(n, gdim)``, length.
        worn: Gap opened by the wear of both sides before the step, ``shape=(n,)``, length.
        clear: Smallest gap of nodes that cannot touch, length.
        stiffness: ``NodalStiffness`` of the nodes; None if it is not needed.
        depth: Depth worn in this step, ``shape=(n,)``, length; None for zero.
        before: Tangential motion before nodes touch, which does not count as slip,
            ``shape=(n, gdim - 1)``, length; None for zero.
        dragged: Slip directions of nodes held by supports along which a force-driven surface
            slides, ``shape=(n, gdim - 1)``; zero at all other nodes, None if there are no such
            nodes.
        columns: Matrix ``D``: motion of the nodes per unit of the unknown surface motions ``c``,
            ``shape=(n, gdim, m)``; None without unknown motions.
        begun: Friction law at the start of the step if it depends on the state; otherwise None.
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

    def replaced(self, **parts: Any) -> ContactStep:
        """Return a copy in which the given attributes are replaced."""
        return replace(self, **parts)

    def with_present_surface(self) -> ContactStep:
        """Return a copy of the step with the present displacement of the surface."""
        return self.replaced(moved=self.given.geometry.surface_moved(self.frames))

    def with_friction(self, friction: Friction) -> ContactStep:
        """Return a copy of the step with another friction law."""
        if friction is self.friction:
            return self
        return self.replaced(friction=friction, law=friction.law(self.points.dim))

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
        """Contact points of the step: motion operator and prescribed directions."""
        return self.frames.points

    @property
    def opening(self) -> np.ndarray:
        """Gap opened at each node by wear, including wear in this step, ``shape=(n,)``, length."""
        return self.worn if self.depth is None else self.worn + self.depth

    # -- motion --------------------------------------------------------------------------------

    def at(self, u: np.ndarray, c: np.ndarray | None = None) -> State:
        """Return the state at a displacement: gaps, slips since the last step, zero reactions.

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
        points.remove_constrained(slip)
        if known is not None:
            slip += known
        slip[points.alone] = 0.0  # facing no surface
        gap[points.closed] = np.maximum(gap[points.closed], self.clear)
        n = len(gap)
        return State(
            displacement, np.zeros((n, points.dim)), gap, slip, np.zeros(n, np.uint8), known
        )

    def unit_motion(self, axis: np.ndarray, turns: bool) -> np.ndarray:
        """Return the surface's motion at each node for a unit rigid motion, ``shape=(n, gdim)``.

        The frame is local.

        Args:
            axis: Unit vector of the motion, global frame; for rotations in 2-D one number.
            turns: Whether the motion is a rotation about ``axis``; otherwise a translation along
                it.
        """
        frame, surface = self.frames.frame, self.surface
        if turns:
            return (frame @ cross(axis, self.frames.arms)[:, :, None])[:, :, 0]
        along = frame @ axis
        if not (surface.curved or surface.spins):  # motions are along the frame of a plane
            along = np.rint(along)
        return np.broadcast_to(along, (self.points.count, self.points.dim))

    def gap_rounding(self, u: np.ndarray) -> float:
        """Return an upper bound of the rounding error in a gap, length units.

        It includes the rounding error of the solution ``u``.
        """
        surface, motion = self.surface, self.points.motion(u)
        lengths = (surface.point, surface.displacement, motion)
        largest = max(np.abs(length).max(initial=0.0) for length in lengths)
        return self.given.geometry.gap_rounding_of(largest)

    def motion_rounding(self, u: np.ndarray, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return the estimated rounding errors of gaps and slips, length units.

        The arrays have ``shape=(n,)`` and ``(n, gdim - 1)``.  The error of gaps includes that of
        the coordinates: a body meant to rest on a plane may lie below it by rounding.
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
        """Return the reactions that balance given forces on the body, ``shape=(n, gdim)``.

        Args:
            forces: Forces on owned degrees of freedom, global frame.
        """
        reaction = self.points.reactions(-forces)
        reaction[self.points.closed] = 0.0
        return reaction

    def respond(
        self, u: np.ndarray, reaction: np.ndarray, map: NodalMap, c: np.ndarray | None = None
    ) -> State:
        """Return the state at a displacement, with the reactions and statuses from a nodal map.

        Args:
            u: Displacement of owned degrees of freedom, length units.
            reaction: Reactions to which the map is applied, ``shape=(n, gdim)``, local frame.
            map: Map from reactions, gaps and slips to new reactions.
            c: Motions of surfaces, ``shape=(m,)``, length units.
        """
        state = self.at(u, c)
        law = self.law_of(self.law, state.known)
        reaction, status = map(law, reaction, state.gap, state.slip_increment)
        return state._replace(reaction=reaction, status=status)

    def linearised(
        self, u: np.ndarray, reaction: np.ndarray, map: NodalMap, c: np.ndarray | None = None
    ) -> tuple[State, tuple[np.ndarray, np.ndarray]]:
        """Return the state as in ``respond``, and the (Clarke) derivatives of its reactions.

        Derivatives are those of the branches that the map selects.

        Returns:
            The state; derivatives with respect to the previous reaction, dimensionless, and with
                respect
            to slip and gap, force per length, ``shape=(n, gdim, gdim)`` each.
        """
        state = self.at(u, c)
        law = self.law_of(self.law, state.known)
        reaction, status, *both = map.linearised(law, reaction, state.gap, state.slip_increment)
        return state._replace(reaction=reaction, status=status), tuple(both)

    def measuring_map(self) -> NodalMap:
        """Return the map with which residuals are computed and starting states are chosen.

        It is the return map whose augmentation parameters are the normal stiffnesses.
        """
        from dolfinx_contact.law.maps import ReturnMap

        return ReturnMap(self.stiffness.normal, self.stiffness.normal)

    # -- nodes that supports hold --------------------------------------------------------------

    def law_of(self, law: Any, known: np.ndarray | None, nodes: Any = slice(None)) -> Any:
        """Return the contact law of nodes, replaced at nodes whose slip is constrained by supports.

        At these nodes a boundary condition prescribes the slip, leaves one direction free, or has
        prescribed a slip in an earlier step.

        Args:
            law: Law of the kernel for these nodes.
            known: Slip prescribed by supports, ``shape=(n, gdim - 1)``; None for zero.
            nodes: Indices of the nodes, ``shape=(k,)``; by default all nodes.
        """
        if not self.points.supported.size or self.friction.frictionless:
            return law
        every = isinstance(nodes, slice)
        if every and known is None and self.dragged is None:
            return self._law_without_prescribed_slip
        return self._supported(law, known, nodes, every)

    @cached_property
    def _law_without_prescribed_slip(self) -> Any:
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
        """Friction law along the tangential directions that supports leave free.

        At nodes that can slide along one direction ``f`` alone, the coefficient is ``f.d(f)``,
        where ``d(f)`` is friction per unit normal reaction against slip along ``f``.
        """
        points, friction = self.points, self.friction
        if not points.along.any() or friction.frictionless:
            return friction
        from dolfinx_contact.contact.friction_field import guided

        return guided(friction, points.count, points.supported, points.along)

    def known_slip(self, state: State) -> np.ndarray:
        """Return the part of a state's slip that supports prescribe, ``shape=(n, gdim - 1)``."""
        return np.zeros_like(state.slip_increment) if state.known is None else state.known

    # -- end -----------------------------------------------------------------------------------

    def may_close(self, u: np.ndarray) -> bool:
        """Return whether open nodes of this rank may touch with friction in this step. Collective
        where points are not ``local``.

        Nodes count that were open at the end of the last step, with a gap above rounding.

        Args:
            u: Last displacement of owned degrees of freedom, length units.
        """
        opens = (self.last.reaction[:, -1] == 0.0) & ~self.points.closed
        if self.points.local and not opens.any():
            return False
        landing = self.last.gap[opens] > self.gap_rounding(u)
        return bool(landing.any()) and not self.friction.frictionless

    def with_slip_past_edges(self, state: State, u: np.ndarray) -> State:
        """Return a copy of a state with the slip of nodes that left the opposite surface.
        Collective between bodies.

        The slip of these nodes is measured against the points opposite at the start of the step.

        Args:
            state: State at the end of the step.
            u: Displacement of owned degrees of freedom, length units.
        """
        given = self.given
        found = given.geometry.slip_past_edge(u, self.frames, given.history)
        if found is None:
            return state
        left, slip = found
        return state._replace(slip_increment=np.where(left[:, None], slip, state.slip_increment))

    def with_own_gaps(self, state: State, u: np.ndarray) -> State:
        """Return a copy of a state with the gaps of open nodes at displacement ``u``.  Collective.

        On a deformable surface with large sliding, the step's mortar coefficients belong to another
        displacement.  On other surfaces the state is returned unchanged.
        """
        given = self.given
        if not given.geometry.renews_rows:
            return state
        gap, points = given.geometry.gap_at(u, self.frames)
        gap = gap + given.geometry.opening(points, given.history, self.depth)
        return state._replace(gap=np.where(state.reaction[:, -1] > 0.0, state.gap, gap))

    def ended(self, state: State, u: np.ndarray | None = None) -> History:
        """Return the history variables at the end of this step.  Collective on deformable surfaces.

        Args:
            state: State at the end of the step.
            u: Displacement of owned degrees of freedom at the end; needed between bodies.
        """
        geometry, frames = self.given.geometry, self.frames
        if self.surface.spin is not None:
            turned = geometry.turned_past(state.displacement, frames)
            state = state._replace(displacement=turned)
        state = frozen_state(state)
        sums, worn, doubtful, worn_and_force = self._updated_sums(state)
        bare = None
        if geometry.renews_rows and u is not None:
            bare = geometry.projected(u, frames.left).points.alone
        ended = geometry.ended(frames)
        return History(
            state, ended, sums, self.friction, worn, bare, self.before, doubtful, worn_and_force
        )

    def _updated_sums(self, state: State) -> tuple:
        """Return the sums and the wear and work data of this step for its ``History``. Collective
        if the opposite side wears.

        Returns:
            The attributes ``sums``, ``worn``, ``doubtful_work`` and ``worn_and_force`` of ``History``.
        """
        given, friction = self.given, self.friction
        history, repeats, covered = given.history, given.repeats, given.geometry.covered
        slip = history.slip_kept + state.slip_increment
        sticks = (friction.mu.any(axis=-1) & (state.status == int(Status.STICK)))[:, None]
        slip, kept = np.where(sticks, 0.0, slip), np.where(sticks, slip, 0.0)
        pressed = np.maximum(self.last.reaction[:, -1], state.reaction[:, -1])
        # Nodes that cross an edge in the step touch for half of it on average.  As many enter as
        # leave: the whole slip of those that enter counts, none of those that leave.
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
                worn = given.geometry.on_all_ranks(sums[OPPOSITE_WEAR])
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
        """Nodes in contact at the end of the last step that are open now, ``shape=(n,)``, booleans."""
        return (self.last.reaction[:, -1] > 0.0) & (state.reaction[:, -1] == 0.0)

    def still(self, state: State, unknown: float) -> np.ndarray:
        """Slipping nodes whose slip is within the error of a state, ``shape=(n,)``, booleans.

        Slip counts since the node last stuck.  On the boundary of the friction cone, rounding
        decides the status of a node that does not move.

        Args:
            state: The state.
            unknown: Error of the state, force; a slip is compared by the force ``|K_t Delta u_t|``.
        """
        slips = state.status == int(Status.SLIP)
        if not slips.any():
            return slips
        kept = self.given.history.slip_kept
        slip = kept + state.slip_increment  # so that slow slip over many steps counts
        made = np.linalg.norm(np.einsum("nij,nj->ni", self.stiffness.tangential, slip), axis=1)
        return slips & (made <= unknown) & (self.friction.mu > 0.0).any(axis=-1)

    # -- work ----------------------------------------------------------------------------------

    def work(self, slip: np.ndarray, reaction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the frictional work of the step and the part due to a change of slip direction.

        Both have one column per principal friction direction, ``shape=(n, gdim - 1)``, force times
        length.

        Args:
            slip: Slip in the step, ``shape=(n, gdim - 1)``, length.
            reaction: Reactions at the end of the step, ``shape=(n, gdim)``, force.
        """
        if self.begun is not None:
            start, end, turned = self.works(slip, reaction)
            return start + end, turned
        before = self.last.reaction, self._slipped
        return frictional_work(self.friction, *before, reaction, slip, self._friction_before)

    def works(self, slip: np.ndarray, reaction: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the frictional work due to the forces at the start and at the end of the step.

        The third array is the part due to a change of slip direction.  Each has one column per
        principal friction direction, ``shape=(n, gdim - 1)``, force times length.  Arguments as for
        ``work``.
        """
        none, before, slipped = np.zeros_like(reaction), self.last.reaction, self._slipped
        law = self.friction if self.begun is None else self.begun
        start, turned = frictional_work(law, before, slipped, none, slip, self._friction_before)
        end = frictional_work(self.friction, none, slipped, reaction, slip)[0]
        return start, end, turned

    @cached_property
    def _slipped(self) -> np.ndarray:
        """Nodes whose last reaction determines their slip direction, ``shape=(n,)``, booleans.

        See ``slipped_last``.
        """
        slips = self.last.status == int(Status.SLIP)
        return slipped_last(self._friction_before or self.friction, self.last.reaction, slips)

    @cached_property
    def _friction_before(self) -> Friction | None:
        """Friction law of the last step; None before the first step.

        Its axes are carried in space to the frames of this step.
        """
        law, before = self.given.history.friction, self.given.history.frames
        n, gdim = self.points.count, self.points.dim
        turns = gdim == 3 and before.points is not self.points
        if law is None or not turns or (law.axes is None and law.isotropic):
            return law
        # Friction axes turn with the surface.
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
    """Return the next step of a contact, from its last state.  Collective on deformable surfaces.

    The surface is in its present position.

    Args:
        contact: The contact.
        stiffness: Stiffness of the contact nodes.
        frames: Frames of the step; None for the frames of the last step.
        begins: Whether friction given by fields is evaluated.  Collective.
    """
    geometry, laws, history = contact.geometry, contact.laws, contact.history
    frames = history.frames if frames is None else frames
    friction, begun = laws.at_start(contact, frames) if begins else (laws.friction, None)
    same = friction is laws.friction
    law = laws.kernel if same else friction.law(contact.displacements.dim)
    last, moved = geometry.last_in(frames, history), geometry.surface_moved(frames)
    given = frames, friction, law, last, moved, geometry.opening(frames.points, history)
    return ContactStep(contact, *given, geometry.clear, stiffness, begun=begun)


def depends_on_position(contact: Contact) -> bool:
    """Whether the contact geometry depends on the position of nodes on the surface.

    The value is the same on all ranks.
    """
    return contact.surface.varies or contact.laws.textured


def frames_of(
    contact: Contact, start: np.ndarray, at: np.ndarray | None = None, before: Frames | None = None
) -> Frames:
    """Return frames and gaps of a step for the present position of the surface.  Collective.

    See ``Geometry.following``.
    """
    history, geometry = contact.history, contact.geometry
    moves = depends_on_position(contact)
    if not geometry.follows(moves, history):
        return history.frames
    return geometry.following(start, at, moves, history, before)


def exclude_fixed_directions(contact: Contact, fixed: np.ndarray) -> None:
    """Exclude directions fixed by boundary conditions from averaged nodal normals.  Collective.

    The last state is expressed in the new frames.  Frames that are not averaged over facets stay.

    Args:
        contact: The contact.
        fixed: Owned degrees of freedom that boundary conditions fix.
    """
    history, geometry = contact.history, contact.geometry
    frames = geometry.met(fixed, history.frames)
    if frames is not history.frames:
        last = geometry.turned(frames, history, contact.opening)
        contact.set_history(history.replaced(last=last, frames=frames))


def nodal_stiffness(
    contact: Contact, K: PETSc.Mat, points: ContactPoints | None = None
) -> NodalStiffness:
    """Return the normal and tangential blocks of the stiffness at the contact nodes.  Collective.

    The blocks are in the local frame.

    Args:
        contact: The contact.
        K: Assembled PETSc stiffness matrix on ``V``.
        points: Contact points of a step; None for those of the last step.

    Raises:
        ValueError: on all ranks, if a node has no positive stiffness along the normal.
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
    """Return the number of reaction components that are needed.  Collective.

    It is 1, the normal component, if no contact has friction; otherwise the dimension.
    """
    smooth = all(contact.friction.frictionless for contact in contacts)
    if contacts[0].comm.allreduce(smooth, op=MPI.LAND):
        return 1
    return contacts[0].points.dim
