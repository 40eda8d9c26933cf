# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A load step and its states, both immutable.

``LoadStep.evaluate`` computes the state at a displacement, without side effects.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dolfinx_contact.contact.state import State, Status
from dolfinx_contact.results.record import WORSE_THAN_TOLERANCE, Counts, count_statuses
from dolfinx_contact.step.errors import Errors, as_errors, contact_defects, contact_rounding
from dolfinx_contact.support.checks import ROUNDING_FACTOR, UNIT_ROUNDOFF
from dolfinx_contact.support.collective import raised_together

if TYPE_CHECKING:
    from mpi4py import MPI

    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.shared import SharedNodes, Split
    from dolfinx_contact.law.maps import NodalMap
    from dolfinx_contact.step.statics import Statics
    from dolfinx_contact.surfaces.driven import DrivenSurfaces
    from dolfinx_contact.surfaces.held import HeldSurfaces


# Return a new number, the same on all ranks if all ranks call it equally often.
new_stamp = count(1).__next__


class Stamps(NamedTuple):
    """Version numbers of the parts of a step, the same on all ranks.

    Bound solvers compare them with the numbers of the previous step to find out what has changed.

    Attributes:
        stiffness: Number of times that ``K`` has been assembled.
        rows: Version of the contact frames.
        law: Version of the friction laws.
        parts: Version of the free motions of surfaces, and of their springs.
        step: Version of the problem's load step; it stays the same if a step is repeated.
    """

    stiffness: int = 0
    rows: int = 0
    law: int = 0
    parts: int = 0
    step: int = 0


class Monitor:
    """Caller of the user's function ``monitor`` for every iterate.

    Args:
        function: User function of the iteration number, the largest error and ``Counts``.
        comm: MPI communicator.
    """

    def __init__(self, function: Callable, comm: MPI.Comm):
        self._function, self._comm, self._iterations = function, comm, 0

    def tell(self, error: float, nodes: Sequence[int]) -> None:
        """Call the user's function for the next iterate.  Collective.

        Args:
            error: Largest error of the iterate.
            nodes: Numbers of open, sticking and slipping nodes.
        """
        with raised_together(self._comm):
            self._function(self._iterations, error, Counts(*nodes))
        self._iterations += 1


@dataclass(frozen=True, eq=False)
class LoadStep:
    """Equilibrium of a body with its contacts under the loads of one load step.

    Displacements and forces are arrays of owned degrees of freedom.  Arguments ``maps`` contain one
    map of ``law/maps.py`` for each contact.  The motions of surfaces driven by force are unknowns
    ``c``, ``shape=(m,)``, with ``m = 0`` if there are no such surfaces.

    Attributes:
        body: The body, with assembled stiffness.
        contacts: ``ContactStep`` of each contact.
        b: Load vector with the boundary values at fixed degrees of freedom.  For a ``u`` with these
            boundary values, ``b - K u`` are the out-of-balance forces.
        external: External forces.
        starts: Initial guesses of the displacement.
        tol: Largest error of a solution.
        unit: Unit of force, chosen such that squares stay within the range of double precision.
        last: Displacement of the last converged step.
        surfaces: The ``DrivenSurfaces``; None if no surface is driven by force.
        holding: ``HeldSurfaces``; None if no driven surface is held by nodes that supports hold.
        statics: ``Statics`` of a body held by contact alone; else None.
        shared: ``SharedNodes``; None if no node belongs to several contacts.
        monitor: The ``Monitor``; None if the user has set none.
        stamps: Version numbers of the parts of the step.
        continues: Whether the step starts from a solution of the same step, so that tangents
            computed there can be reused.
        motions: Initial values of ``c``; None is zero.
    """

    body: ElasticBody
    contacts: tuple[ContactStep, ...]
    b: np.ndarray
    external: np.ndarray
    starts: tuple[np.ndarray, ...]
    tol: float
    unit: float
    last: np.ndarray
    surfaces: DrivenSurfaces | None = None
    holding: HeldSurfaces | None = None
    statics: Statics | None = None
    shared: SharedNodes | None = None
    monitor: Monitor | None = None
    stamps: Stamps = Stamps()
    continues: bool = False
    motions: np.ndarray | None = None

    def replaced(self, **parts: Any) -> LoadStep:
        """Return a copy of the step with some attributes replaced."""
        return replace(self, **parts)

    def with_contacts(self, contacts: Sequence[ContactStep], **parts: Any) -> LoadStep:
        """Return a copy of the step with other contacts that have the same frames."""
        return self.replaced(contacts=tuple(contacts), **parts)

    def with_laws(self, contacts: Sequence[ContactStep]) -> LoadStep:
        """Return a copy of the step with contacts that have other laws.  Call it on all ranks."""
        return self.with_contacts(contacts, stamps=self.stamps._replace(law=new_stamp()))

    @property
    def may_slide(self) -> bool:
        """Whether the body, or a surface driven by force, may have to be held by contact."""
        return self.surfaces is not None or self.statics is not None

    def may_close(self) -> bool:
        """Return whether open nodes with friction may close in this step.  Collective."""
        may = [contact.may_close(self.last) for contact in self.contacts]
        return bool(self.body.comm.allreduce(any(may)))

    @cached_property
    def was_held_by_contact(self) -> bool:
        """Whether contact alone holds the body and did so at the last step's end.  Collective."""
        if self.statics is None:
            return False
        pressed = [contact.last.reaction[:, -1] for contact in self.contacts]
        return self.body.largest(np.concatenate(pressed)) > 0.0

    @cached_property
    def error_maps(self) -> list[NodalMap]:
        """The return map of each contact, by which errors of states are measured."""
        return [contact.measuring_map() for contact in self.contacts]

    @property
    def first_motions(self) -> np.ndarray:
        """Initial values of the motions of surfaces, ``shape=(m,)``; zero by default."""
        if self.motions is not None:
            return self.motions
        return np.zeros(0 if self.surfaces is None else self.surfaces.count)

    # -- states --------------------------------------------------------------------------------

    def evaluate(
        self,
        x: np.ndarray,
        maps: Sequence[NodalMap],
        *,
        forces: np.ndarray | None = None,
        c: np.ndarray | None = None,
        before: StepState | None = None,
        near: Sequence[np.ndarray] | None = None,
        exact: bool | None = None,
    ) -> StepState:
        """Return the state at a displacement.  Collective.

        The body determines the reaction required at each contact node for equilibrium; the map of
        the contact turns it into a reaction that satisfies the law.

        Args:
            x: Displacement.
            maps: Map of each contact.
            forces: ``forces(x)``, if already computed.
            c: Initial values for the motions of surfaces, which are then brought into equilibrium.
            before: The previous state; used for the change of the reactions and for the split of
                reactions at nodes that several contacts share.
            near: Reactions of each contact as additional initial guesses at shared nodes.
            exact: Whether ``forces`` are computed from the residual form F; None is the value of
                ``exact_forces``, as for ``forces(x)``.
        """
        forces = self.forces(x) if forces is None else forces
        exact = self.exact_forces if exact is None else exact
        c, required, split = self._balanced(x, maps, self.free(forces), c, before, near)
        given = zip(self.contacts, required, maps)
        nodes = tuple(contact.respond(x, reaction, map, c) for contact, reaction, map in given)
        nodes = self._with_held_reactions(nodes)
        return StepState(self, x, c, forces, nodes, required, exact, split, before)

    def measure(
        self,
        x: np.ndarray,
        *,
        c: np.ndarray | None = None,
        before: StepState | None = None,
        near: Sequence[np.ndarray] | None = None,
    ) -> StepState:
        """Return the state at a displacement, with forces by F and the return map.  Collective.

        With the return map, the direction of friction at large slip follows from the slip and is
        insensitive to rounding in the forces.  For arguments see ``evaluate``.
        """
        given: dict[str, Any] = dict(forces=self.residual_forces(x), c=c, before=before, near=near)
        return self.evaluate(x, self.error_maps, exact=True, **given)

    def open(self, x: np.ndarray, c: np.ndarray | None = None) -> StepState:
        """Return the state at a displacement with zero reactions, with forces by F.  Collective."""
        c = self.first_motions if c is None else c
        nodes = tuple(contact.at(x, c) for contact in self.contacts)
        required = tuple(state.reaction for state in nodes)
        return StepState(self, x, c, self.residual_forces(x), nodes, required, True)

    def derivatives(self, state: StepState, maps: Sequence[NodalMap]) -> list[tuple]:
        """Return the derivatives of the reactions of each contact.  Collective.

        Returns:
            For each contact, derivatives by the required reactions and by slip and gap, in the
            local frame, ``shape=(n, gdim, gdim)`` each.
        """
        return self._linearised(state.x, state.c, state.required, maps, state.split)[1]

    def linearise(
        self,
        x: np.ndarray,
        maps: Sequence[NodalMap],
        *,
        forces: np.ndarray,
        c: np.ndarray | None = None,
        before: StepState | None = None,
    ) -> tuple[StepState, list[tuple]]:
        """Return the state at a displacement, and its ``derivatives``.  Collective.

        Both are computed with one call of the law.  For arguments see ``evaluate``.
        """
        free = self.free(forces)
        c, required, split = self._balanced(x, maps, free, c, before, None)
        nodes, derivatives = self._linearised(x, c, required, maps, split)
        exact = self.exact_forces
        state = StepState(self, x, c, forces, nodes, required, exact, split, before)
        return state, derivatives

    def _linearised(self, x: np.ndarray, c: np.ndarray, required: Any, maps: Any, split: Any):
        both = zip(self.contacts, required, maps)
        found = [contact.linearised(x, reaction, map, c) for contact, reaction, map in both]
        derivatives = [derivative for _, derivative in found]
        if split is not None:
            derivatives = self.shared.coupled(derivatives, split)
        return self._with_held_reactions(tuple(state for state, _ in found)), derivatives

    def _balanced(
        self,
        x: np.ndarray,
        maps: Sequence[NodalMap],
        free: np.ndarray,
        c: np.ndarray | None,
        before: StepState | None,
        near: Sequence[np.ndarray] | None,
    ) -> tuple:
        """Return motions of surfaces in equilibrium, required reactions, and the split.

        Returns:
            ``c``, ``shape=(m,)``; the reactions required of each contact for equilibrium of the
            body, ``shape=(n, gdim)``; the ``Split`` of reactions at shared nodes, or None.
        """
        c = c if c is not None else self.first_motions if before is None else before.c
        alone = tuple(contact.required(free) for contact in self.contacts)
        split = None if before is None else before.split
        if near is None and self.shared is not None:
            near = (
                [k.last.reaction for k in self.contacts]
                if before is None
                else [s.reaction for s in before.nodes]
            )

        def required(c: np.ndarray) -> tuple:
            """Return the required reactions, which depend on ``c`` if contacts share nodes."""
            nonlocal split
            if self.shared is None:
                return alone
            given = self.contacts, self.tol, x, c, -free, alone, near, split
            found, split = self.shared.split(*given)
            return found

        if self.surfaces is not None:
            c = self.surfaces.balanced(self.contacts, x, c, maps, required)
        return c, required(c), split

    def _with_held_reactions(self, nodes: tuple[State, ...]) -> tuple[State, ...]:
        """Return the states with the reactions of held nodes on surfaces which these nodes hold."""
        return nodes if self.holding is None else self.holding.shared(self.contacts, nodes)

    def place_surfaces(self, state: StepState) -> None:
        """Move the surfaces driven by force to their positions in a state."""
        if self.surfaces is not None:
            self.surfaces.place(state.c)

    # -- forces --------------------------------------------------------------------------------

    exact_forces = False  # whether ``forces`` evaluates the residual form F

    def forces(self, x: np.ndarray) -> np.ndarray:
        """Return the out-of-balance forces of the linear body, ``b - K x``."""
        return self.b - self.body.multiply(x)

    def residual_forces(self, x: np.ndarray) -> np.ndarray:
        """Return the out-of-balance forces of the residual form, ``-F(x)``."""
        return -self.body.residual(x)

    def supports(self, state: StepState) -> np.ndarray:
        """Return the support forces of a state, at fixed degrees of freedom."""
        if state.exact:
            return -state.forces[self.body.fixed]
        return self.body.support_forces(state.x)

    def free(self, forces: np.ndarray) -> np.ndarray:
        """Return a copy of forces with zeros at fixed degrees of freedom."""
        forces = forces.copy()
        forces[self.body.fixed] = 0.0
        return forces

    def missing(self, x: np.ndarray) -> np.ndarray:
        """Return boundary values minus a displacement, zero at free degrees of freedom."""
        missing, fixed = np.zeros_like(x), self.body.fixed
        missing[fixed] = self.b[fixed] - x[fixed]
        return missing

    def held(self, x: np.ndarray) -> bool:
        """Return whether a displacement satisfies the boundary values exactly.  Collective."""
        return self.body.largest(np.abs(self.missing(x))) == 0.0

    def size(self, forces: np.ndarray) -> float:
        """Return the norm of forces over the free degrees of freedom of all ranks."""
        return self.body.norm(self.free(forces))

    def with_reactions(self, forces: np.ndarray, nodes: Sequence[State]) -> np.ndarray:
        """Return forces plus the reactions of given states of the contacts."""
        forces = forces.copy()
        for contact, state in zip(self.contacts, nodes):
            contact.points.add_forces(state.reaction, forces)
        return forces

    def total(self, array: Any) -> np.ndarray:
        """Return the sum of an array over all ranks."""
        return self.body.total(array)

    # -- where to start ------------------------------------------------------------------------

    def start(self) -> StepState:
        """Return the state at the initial guess nearest to equilibrium.  Collective.

        The states use the return map, since the bipotential map overestimates the error of
        extrapolated displacements.
        """
        guesses = [start.copy() for start in self.starts]
        if self.statics is not None:
            # Start at first contact or, if the step is repeated, at its previous end.
            away = self.statics.placed and len(guesses) > 1
            guesses = [*([] if away else guesses), self.statics.start.copy()]
        for guess in guesses:
            guess[self.body.fixed] = self.b[self.body.fixed]
        states = [self.evaluate(guess, self.error_maps) for guess in guesses]
        # Without acting forces, errors are not relative to forces: such states come last.
        strays = [self.was_held_by_contact and not state.balance.acts for state in states]
        return min(zip(strays, states), key=lambda both: (both[0], both[1].balance.error))[1]

    # -- errors and messages -------------------------------------------------------------------

    def errors_of(self, state: StepState, contacts: np.ndarray | None) -> Errors:
        """Return the errors of a state.  Collective.

        Args:
            state: The state.
            contacts: Its ``contact_sums``; None for errors of equilibrium alone.
        """
        errors = as_errors(state.balance_sums, contacts)
        lost = errors.blind and self.may_slide and self._is_lost(state, errors.acts)
        return errors._replace(error=np.inf) if lost else errors

    def _is_lost(self, state: StepState, acts: bool) -> bool:
        """Return whether body or surfaces are too far away, see ``lost_far_away``.  Collective."""
        from dolfinx_contact.surfaces.sliding import lost_far_away

        return lost_far_away(self, state, acts)

    def balance_sums_of(self, state: StepState) -> np.ndarray:
        """Return squared norms of forces, ``shape=(6,)``, see ``as_errors``.  Collective."""
        body, x = self.body, state.x
        left, acting = state.residual + body.cancelling(self.missing(x)), np.abs(self.external)
        for contact, nodes in zip(self.contacts, state.nodes):
            contact.points.add_magnitudes(nodes.reaction, acting)
        change = (
            np.full(1, np.inf)
            if state.previous_reactions is None
            else state.acts - state.previous_reactions
        )
        cancelling = UNIT_ROUNDOFF * (body.cancelling(x) + acting)
        if self.surfaces is not None:
            on_surfaces, terms = self.surfaces.left(state.nodes, state.c)
            mine = slice(
                None if body.comm.rank == 0 else 0
            )  # the same on all ranks, so count them once
            left = np.append(left, on_surfaces[mine])
            cancelling = np.append(cancelling, UNIT_ROUNDOFF * terms[mine])
        supports = self.supports(state)
        return self.sums(left, state.reactions, self.external, supports, cancelling, change)

    def contact_sums_of(self, state: StepState) -> np.ndarray:
        """Return squared residuals of the law, ``shape=(4,)``, see ``as_errors``.  Collective."""
        columns = [[np.zeros(0)] for _ in range(4)]
        for contact, nodes in zip(self.contacts, state.nodes):
            rounding = contact_rounding(contact, nodes, state.x)
            for column, part in zip(columns, (*contact_defects(contact, nodes), rounding)):
                column.append(part.ravel())
        return self.sums(*map(np.concatenate, columns))

    def sums(self, *parts: np.ndarray) -> np.ndarray:
        """Return the squared norm of each array of forces, in units of ``unit``.  Collective."""
        return self.total([np.square(part / self.unit).sum() for part in parts])

    def scale(self, state: StepState) -> float:
        """Return the norm of the acting forces of a state, in force units."""
        return state.errors.scale * self.unit

    def reaction_scale(self, state: StepState, tol: float) -> float:
        """Return the reference force for errors of which the fraction ``tol`` is acceptable.

        It is the norm of the reactions.  If the reactions are so small compared with the acting
        forces that their errors are reported to the user, it is at least the error of the state
        over ``tol``.
        """
        errors = state.errors
        unknown = max(errors.largest, ROUNDING_FACTOR * errors.rounding)
        told = unknown > WORSE_THAN_TOLERANCE * self.tol * errors.share
        return self.scale(state) * max(errors.share, unknown / tol if told else 0.0)

    def with_small_slip_as_stick(self, state: StepState) -> StepState:
        """Return a state in which nodes with negligible slip have the status stick.

        Slip is negligible if the corresponding force is below the error of the state, or below the
        tolerance times the norm of the reactions.
        """
        errors = state.errors
        unknown = max(self.tol * errors.share, errors.largest, ROUNDING_FACTOR * errors.rounding)
        unknown *= self.scale(state)
        nodes = []
        for contact, one in zip(self.contacts, state.nodes):
            status = np.where(contact.still(one, unknown), int(Status.STICK), one.status)
            nodes.append(one._replace(status=status.astype(np.uint8)))
        return state.with_nodes(nodes)

    def slides(self, state: StepState) -> bool:
        """Return whether a driven surface or the body slides away in a state.  Collective."""
        return self.pushed_off(state) or (self.statics is not None and self.statics.slides(state))

    def pushed_off(self, state: StepState) -> bool:
        """Return whether the force on a driven surface exceeds friction in a state.  Collective."""
        return self.surfaces is not None and bool(
            self.surfaces.beyond(self.contacts, state.nodes, state.c)
        )

    def refusal(self, state: StepState) -> str:
        """Return a message on why the step has not converged, and what may help.  Collective."""
        message = "" if self.statics is None else self.statics.hidden(self)
        message = message or self._reason_without_state(state) or self._advice()
        if any(contact.given.laws.depends_on_pressure for contact in self.contacts):
            message += "; friction follows the pressure, and was that of the last iterate"
        if any(contact.given.laws.wears_within for contact in self.contacts):
            message += (
                "; the depth that the step wears is part of it, and was that of the last iterate"
            )
        return message

    def _advice(self) -> str:
        """Return advice for a step that should have a solution.  Collective."""
        from dolfinx_contact.step.stalled import slow

        return "; ".join(
            filter(None, ("Smaller load steps help most often", slow(self.body, self.b)))
        )

    def _reason_without_state(self, state: StepState) -> str:
        """Return why no static state exists, in words; empty if unknown.  Collective."""
        message = "" if self.statics is None else self.statics.message
        if self.surfaces is not None:
            message = message or self.surfaces.beyond(
                self.contacts, state.nodes, state.c, given=True
            )
            message = message or self.surfaces.beyond(self.contacts, state.nodes, state.c)
            if not message and self.statics is not None:
                from dolfinx_contact.surfaces.sliding import nothing_holds

                message = nothing_holds(self.contacts)
        return message

    def counts(self, state: StepState) -> Counts:
        """Return the numbers of open, sticking and slipping contact nodes.  Collective."""
        return count_statuses(self.body, state.nodes)

    def tell(self, state: StepState) -> None:
        """Pass a state to the user's ``monitor``, if there is one.  Collective."""
        if self.monitor is not None:
            known = state.balance if state.is_far else state.errors
            self.monitor.tell(known.largest, self.counts(state))


@dataclass(frozen=True, eq=False)
class StepState:
    """State of a load step: displacement, forces, reactions and errors.

    ``LoadStep.evaluate`` computes it.

    Cached properties are computed at the first access, which is collective.

    Attributes:
        step: The step.
        x: Displacement.
        c: Motions of surfaces driven by force, ``shape=(m,)``.
        forces: ``b - K x`` or ``-F(x)``, support forces included.
        nodes: ``State`` of each contact.
        required: Reactions required of each contact for equilibrium of the body; the maps have
            turned them into the reactions of ``nodes``.
        exact: Whether ``forces`` are computed from the residual form F.
        split: ``Split`` of reactions at nodes that several contacts share.
        before: Reactions and contact rounding of the previous state, or None.
        is_start: Whether the state is the start of an iteration.
    """

    step: LoadStep = field(repr=False)
    x: np.ndarray
    c: np.ndarray
    forces: np.ndarray
    nodes: tuple[State, ...]
    required: tuple[np.ndarray, ...]
    exact: bool
    split: Split | None = field(default=None, repr=False)
    before: Any = field(default=None, repr=False)
    is_start: bool = False

    def __post_init__(self) -> None:
        # Keep only data of the previous state: a reference would keep all earlier states.
        before = self.before
        if isinstance(before, StepState):
            acts = None if before.is_start else before.acts
            object.__setattr__(self, "before", (acts, before.contact_rounding))

    @property
    def as_start(self) -> StepState:
        """A copy of the state as the start of an iteration.

        The change of the reactions of the next state is then unknown.
        """
        return replace(self, is_start=True)

    @property
    def previous_reactions(self) -> np.ndarray | None:
        """Reactions ``acts`` of the previous state; None if unknown."""
        return None if self.before is None else self.before[0]

    @property
    def contact_rounding(self) -> float:
        """Rounding error at the contacts, in the unit of force of the step.

        It is taken from the previous state if this state has not computed it, and is infinite if
        neither has.
        """
        if "contact_sums" in vars(self):
            return float(np.sqrt(self.contact_sums[-1]))
        return np.inf if self.before is None else self.before[1]

    @cached_property
    def reactions(self) -> np.ndarray:
        """Reactions of all contacts in one array, local frames."""
        return np.concatenate([np.zeros(0), *(nodes.reaction.ravel() for nodes in self.nodes)])

    @cached_property
    def acts(self) -> np.ndarray:
        """Reactions whose change measures convergence.

        If contacts share nodes, it is the vector of the reactions' sums, since their split between
        the contacts may be discontinuous.
        """
        if self.step.shared is None:
            return self.reactions
        return self.step.free(self.step.with_reactions(0.0 * self.x, self.nodes))

    @cached_property
    def residual(self) -> np.ndarray:
        """Out-of-balance forces, reactions included, zero at fixed degrees of freedom."""
        return self.step.free(self.step.with_reactions(self.forces, self.nodes))

    @cached_property
    def balance_sums(self) -> np.ndarray:
        """See ``LoadStep.balance_sums_of``."""
        return self.step.balance_sums_of(self)

    @cached_property
    def contact_sums(self) -> np.ndarray:
        """See ``LoadStep.contact_sums_of``."""
        return self.step.contact_sums_of(self)

    @cached_property
    def balance(self) -> Errors:
        """Errors of equilibrium alone, without another call of the law.  Collective."""
        return self.step.errors_of(self, None)

    @cached_property
    def errors(self) -> Errors:
        """Errors of equilibrium and of the contact law.  Collective."""
        return self.step.errors_of(self, self.contact_sums)

    @cached_property
    def is_far(self) -> bool:
        """Whether the error of equilibrium alone shows that the state is no solution.  Collective.

        The rounding error at the contacts is allowed for, if it is known.
        """
        errors = self.balance
        known = self.contact_rounding / errors.scale if errors.scale > 0.0 else np.inf
        errors = errors._replace(rounding=max(errors.rounding, known))
        return not errors.within(self.step.tol)

    @property
    def within(self) -> bool:
        """Whether the errors of the state are within the tolerance of the step.  Collective."""
        return self.errors.within(self.step.tol)

    # Cached properties never store the state itself: such a reference cycle would delay freeing it.

    @property
    def confirmed(self) -> StepState:
        """The state with forces computed from the residual form F.  Collective."""
        return self if self.exact else self._confirmed

    @cached_property
    def _confirmed(self) -> StepState:
        state = replace(self, forces=self.step.residual_forces(self.x), exact=True)
        vars(state)["contact_sums"] = self.contact_sums  # the nodal states are the same
        return state

    @property
    def judged(self) -> StepState:
        """The state with forces by F, for the final assessment.  Collective.

        A solution keeps its reactions.  Otherwise the reactions are computed by the return map.
        """
        stands = self.exact or (not self.is_far and self.within)
        return self.confirmed if stands else self._measured

    @cached_property
    def _measured(self) -> StepState:
        return self.step.measure(self.x, c=self.c, before=self)

    def of(self, step: LoadStep) -> StepState:
        """Return the state in a step with a negligible difference; errors are not recomputed."""
        return self._copy_with_errors(step=step)

    def with_nodes(self, nodes: Sequence[State]) -> StepState:
        """Return a copy with other nodal states; errors are not recomputed."""
        return self._copy_with_errors(nodes=tuple(nodes))

    def _copy_with_errors(self, **parts: Any) -> StepState:
        state = replace(self, **parts)
        vars(state)["errors"] = self.errors
        return state
