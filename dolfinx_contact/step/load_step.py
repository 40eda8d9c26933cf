# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A load step as a value: ``evaluate`` is the only way to a state, and changes nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dolfinx_contact.contact.state import State, Status
from dolfinx_contact.results.record import WORSE_THAN_TOLERANCE, Counts, counts_of
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


new_stamp = count(1).__next__  # one source, which all ranks ask alike


class Stamps(NamedTuple):
    """Numbers by which bound solvers see what is another one than in the step before, the same on all ranks."""

    stiffness: int = 0  # how often K was assembled
    rows: int = 0  # of the contacts' frames
    law: int = 0
    parts: int = 0  # which motions of surfaces are free, and their springs
    step: int = 0  # of the problem, not of its repetitions


class Monitor:
    """What tells the user of every iterate.

    Args:
        function: Of iteration, largest error and ``Counts``.
        comm: MPI communicator.
    """

    def __init__(self, function: Callable, comm: MPI.Comm):
        self._function, self._comm, self._told = function, comm, 0

    def tell(self, error: float, nodes: Sequence[int]) -> None:
        """Tell the error of another iterate, and its nodes by status.  Collective."""
        with raised_together(self._comm):
            self._function(self._told, error, Counts(*nodes))
        self._told += 1


@dataclass(frozen=True, eq=False)
class LoadStep:
    """Equilibrium of a body under new loads with its contacts.

    Displacements and forces are arrays of owned degrees of freedom.  Maps are one of ``law/maps.py`` for each contact.  Motions of
    surfaces that force drives are unknowns ``c``, ``shape=(m,)``, none of them where there are no such surfaces.

    Attributes:
        body: The body, its stiffness assembled.
        contacts: ``ContactStep`` of each contact.
        b: ``b - K u`` are the forces out of balance for a ``u`` with the boundary values, which ``b`` holds.
        external: External forces.
        starts: Displacements near which the solution may lie.
        tol: Largest error.
        unit: Of force, any that keeps squares within the range of double precision.
        last: Displacement of the last step that converged.
        surfaces: The ``DrivenSurfaces``, None where force drives none.
        holding: ``HeldSurfaces``, None where held nodes hold none of them.
        statics: ``Statics`` of a body that contact alone holds, else None.
        shared: ``SharedNodes``, None where no node belongs to several contacts.
        monitor: None, or the ``Monitor``.
        stamps: Numbers of what it consists of.
        continues: Whether it starts from what was found for the same step, so that tangents there are still good.
        motions: Where the motions of surfaces begin.
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

    def but(self, **parts: Any) -> LoadStep:
        """The step with some things replaced."""
        return replace(self, **parts)

    def with_contacts(self, contacts: Sequence[ContactStep], **parts: Any) -> LoadStep:
        """The step with other contacts on the same rows."""
        return self.but(contacts=tuple(contacts), **parts)

    def with_laws(self, contacts: Sequence[ContactStep]) -> LoadStep:
        """The step with contacts of other laws, on all ranks."""
        return self.with_contacts(contacts, stamps=self.stamps._replace(law=new_stamp()))

    @property
    def may_slide(self) -> bool:
        """Whether a plane, or the body, is held by contact along some direction."""
        return self.surfaces is not None or self.statics is not None

    def may_land(self) -> bool:
        """Whether nodes that are open may land with friction.  Collective."""
        may = [contact.may_land(self.last) for contact in self.contacts]
        return bool(self.body.comm.allreduce(any(may)))

    @cached_property
    def was_pressed(self) -> bool:
        """Whether contact alone holds the body, and did so at the end of the last step.  Collective."""
        if self.statics is None:
            return False
        pressed = [contact.last.reaction[:, -1] for contact in self.contacts]
        return self.body.largest(np.concatenate(pressed)) > 0.0

    @cached_property
    def measuring_maps(self) -> list[NodalMap]:
        """The maps by which states are measured."""
        return [contact.measuring_map() for contact in self.contacts]

    @property
    def no_motions(self) -> np.ndarray:
        """Where the motions of surfaces begin, zero at first."""
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
        """The state of a displacement: every node has the reaction that its map makes of the one which the body asks for.  Collective.

        Args:
            x: Displacement.
            maps: Of the contacts.
            forces: ``forces(x)``, where they are known.
            c: Where motions of surfaces may be; they are balanced from there.
            before: The state before, for the change of the reactions since and what it knows of shared nodes.
            near: Reactions of each contact that a solver knows better than the body tells, at shared nodes.
            exact: Whether ``forces`` are those of F itself; None as ``forces(x)`` are.
        """
        forces = self.forces(x) if forces is None else forces
        exact = self.exact_forces if exact is None else exact
        c, required, split = self._balanced(x, maps, self.free(forces), c, before, near)
        given = zip(self.contacts, required, maps)
        nodes = tuple(contact.respond(x, reaction, map, c) for contact, reaction, map in given)
        nodes = self._with_shares(nodes)
        return StepState(self, x, c, forces, nodes, required, exact, split, before)

    def measure(
        self,
        x: np.ndarray,
        *,
        c: np.ndarray | None = None,
        before: StepState | None = None,
        near: Sequence[np.ndarray] | None = None,
    ) -> StepState:
        """The state of a displacement by F itself, with reactions by the return map.  Collective.

        Beside large slip their direction is that of the slip, not that of rounding in forces.
        """
        given: dict[str, Any] = dict(forces=self.by_form(x), c=c, before=before, near=near)
        return self.evaluate(x, self.measuring_maps, exact=True, **given)

    def open(self, x: np.ndarray, c: np.ndarray | None = None) -> StepState:
        """The state of a displacement without reactions, by F itself.  Collective."""
        c = self.no_motions if c is None else c
        nodes = tuple(contact.at(x, c) for contact in self.contacts)
        required = tuple(state.reaction for state in nodes)
        return StepState(self, x, c, self.by_form(x), nodes, required, True)

    def derivatives(self, state: StepState, maps: Sequence[NodalMap]) -> list[tuple]:
        """Of the new reactions of each contact, by the reactions before and by the motion, ``shape=(n, gdim, gdim)``.  Collective."""
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
        """``evaluate`` and ``derivatives`` there, by one call of the law.  Collective."""
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
        return self._with_shares(tuple(state for state, _ in found)), derivatives

    def _balanced(
        self,
        x: np.ndarray,
        maps: Sequence[NodalMap],
        free: np.ndarray,
        c: np.ndarray | None,
        before: StepState | None,
        near: Sequence[np.ndarray] | None,
    ) -> tuple:
        """Motions of surfaces in balance, the reactions that the body requires of each contact, and how those of shared nodes were split."""
        c = c if c is not None else self.no_motions if before is None else before.c
        alone = tuple(contact.required(free) for contact in self.contacts)
        split = None if before is None else before.split
        if near is None and self.shared is not None:
            near = (
                [k.last.reaction for k in self.contacts]
                if before is None
                else [s.reaction for s in before.nodes]
            )

        def required(c: np.ndarray) -> tuple:
            """Where nodes are shared it depends on where surfaces are."""
            nonlocal split
            if self.shared is None:
                return alone
            given = self.contacts, self.tol, x, c, -free, alone, near, split
            found, split = self.shared.split(*given)
            return found

        if self.surfaces is not None:
            c = self.surfaces.balanced(self.contacts, x, c, maps, required)
        return c, required(c), split

    def _with_shares(self, nodes: tuple[State, ...]) -> tuple[State, ...]:
        """The states with what held nodes carry of the planes that they hold."""
        return nodes if self.holding is None else self.holding.shared(self.contacts, nodes)

    def place_surfaces(self, state: StepState) -> None:
        """Move the surfaces that force drives to where a state has them."""
        if self.surfaces is not None:
            self.surfaces.place(state.c)

    # -- forces --------------------------------------------------------------------------------

    exact_forces = False  # whether ``forces`` are those of F itself

    def forces(self, x: np.ndarray) -> np.ndarray:
        """``b - K x``."""
        return self.b - self.body.multiply(x)

    def by_form(self, x: np.ndarray) -> np.ndarray:
        """``-F(x)``, by which errors are measured."""
        return -self.body.residual(x)

    def supports(self, state: StepState) -> np.ndarray:
        """What supports carry, at fixed degrees of freedom."""
        if state.exact:
            return -state.forces[self.body.fixed]
        return self.body.support_forces(state.x)

    def free(self, forces: np.ndarray) -> np.ndarray:
        """Forces without what supports carry."""
        forces = forces.copy()
        forces[self.body.fixed] = 0.0
        return forces

    def missing(self, x: np.ndarray) -> np.ndarray:
        """What is missing to the boundary values at a displacement, zero at free degrees of freedom."""
        missing, fixed = np.zeros_like(x), self.body.fixed
        missing[fixed] = self.b[fixed] - x[fixed]
        return missing

    def held(self, x: np.ndarray) -> bool:
        """Whether ``x`` has the boundary values.  Collective."""
        return self.body.largest(np.abs(self.missing(x))) == 0.0

    def size(self, forces: np.ndarray) -> float:
        """Norm of forces at free degrees of freedom."""
        return self.body.norm(self.free(forces))

    def with_reactions(self, forces: np.ndarray, nodes: Sequence[State]) -> np.ndarray:
        """Forces plus the reactions of states of the contacts."""
        forces = forces.copy()
        for contact, state in zip(self.contacts, nodes):
            contact.points.add_forces(state.reaction, forces)
        return forces

    def total(self, array: Any) -> np.ndarray:
        """Sum of an array over all ranks."""
        return self.body.total(array)

    # -- where to start ------------------------------------------------------------------------

    def start(self) -> StepState:
        """The start with the smallest imbalance, by the return map: the paper's takes extrapolations for worse than they are.  Collective."""
        guesses = [start.copy() for start in self.starts]
        if self.statics is not None:
            # a body that was placed begins there, or where this step has ended before
            away = self.statics.placed and len(guesses) > 1
            guesses = [*([] if away else guesses), self.statics.start.copy()]
        for guess in guesses:
            guess[self.body.fixed] = self.b[self.body.fixed]
        states = [self.evaluate(guess, self.measuring_maps) for guess in guesses]
        # errors of states without forces are not relative to any
        strays = [self.was_pressed and not state.balance.acts for state in states]
        return min(zip(strays, states), key=lambda both: (both[0], both[1].balance.error))[1]

    # -- what is said of a state ---------------------------------------------------------------

    def errors_of(self, state: StepState, contacts: np.ndarray | None) -> Errors:
        """Errors from sums of balance and, where they are asked for, of the contacts.  Collective."""
        errors = as_errors(state.balance_sums, contacts)
        lost = errors.blind and self.may_slide and self._is_lost(state, errors.acts)
        return errors._replace(error=np.inf) if lost else errors

    def _is_lost(self, state: StepState, acts: bool) -> bool:
        """See ``lost_far_away``.  Collective."""
        from dolfinx_contact.surfaces.sliding import lost_far_away

        return lost_far_away(self, state, acts)

    def balance_sums_of(self, state: StepState) -> np.ndarray:
        """Sums of squares of what balances in a state, ``shape=(6,)``, see ``as_errors``.  Collective."""
        body, x = self.body, state.x
        left, acting = state.residual + body.cancelling(self.missing(x)), np.abs(self.external)
        for contact, nodes in zip(self.contacts, state.nodes):
            contact.points.add_magnitudes(nodes.reaction, acting)
        change = np.full(1, np.inf) if state.acts_before is None else state.acts - state.acts_before
        cancelling = UNIT_ROUNDOFF * (body.cancelling(x) + acting)
        if self.surfaces is not None:
            on_surfaces, terms = self.surfaces.left(state.nodes, state.c)
            mine = slice(None if body.comm.rank == 0 else 0)  # they are the same on all ranks
            left = np.append(left, on_surfaces[mine])
            cancelling = np.append(cancelling, UNIT_ROUNDOFF * terms[mine])
        supports = self.supports(state)
        return self.sums(left, state.reactions, self.external, supports, cancelling, change)

    def contact_sums_of(self, state: StepState) -> np.ndarray:
        """Sums of squares of what is left of the law in a state, ``shape=(4,)``, see ``as_errors``.  Collective."""
        columns = [[np.zeros(0)] for _ in range(4)]
        for contact, nodes in zip(self.contacts, state.nodes):
            rounding = contact_rounding(contact, nodes, state.x)
            for column, part in zip(columns, (*contact_defects(contact, nodes), rounding)):
                column.append(part.ravel())
        return self.sums(*map(np.concatenate, columns))

    def sums(self, *parts: np.ndarray) -> np.ndarray:
        """Sums of squares over all ranks, in the unit of force.  Collective."""
        return self.total([np.square(part / self.unit).sum() for part in parts])

    def scale(self, state: StepState) -> float:
        """Forces that act in a state."""
        return state.errors.scale * self.unit

    def reaction_scale(self, state: StepState, tol: float) -> float:
        """What forces are held against of which a part ``tol`` does not matter: the reactions of a state.

        Beside stiff springs they may be so small that it is told; then what the errors leave unknown does not matter either.
        """
        errors = state.errors
        unknown = max(errors.largest, ROUNDING_FACTOR * errors.rounding)
        told = unknown > WORSE_THAN_TOLERANCE * self.tol * errors.share
        return self.scale(state) * max(errors.share, unknown / tol if told else 0.0)

    def with_small_slip_as_stick(self, state: StepState) -> StepState:
        """A state whose nodes stick that slip by less than is unknown of it, or than the tolerance of its reactions."""
        errors = state.errors
        unknown = max(self.tol * errors.share, errors.largest, ROUNDING_FACTOR * errors.rounding)
        unknown *= self.scale(state)
        nodes = []
        for contact, one in zip(self.contacts, state.nodes):
            status = np.where(contact.still(one, unknown), int(Status.STICK), one.status)
            nodes.append(one._replace(status=status.astype(np.uint8)))
        return state.with_nodes(nodes)

    def slides(self, state: StepState) -> bool:
        """Whether force pushes a plane, or loads a body, by more than friction carries in a state.  Collective."""
        return self.pushed_off(state) or (self.statics is not None and self.statics.slides(state))

    def pushed_off(self, state: StepState) -> bool:
        """Whether force pushes a plane by more than friction carries in a state.  Collective."""
        return self.surfaces is not None and bool(
            self.surfaces.beyond(self.contacts, state.nodes, state.c)
        )

    def refusal(self, state: StepState) -> str:
        """Why it has not converged, in words, as far as anything tells.  Collective."""
        message = "" if self.statics is None else self.statics.hidden(self)
        message = message or self._no_state(state) or self._hard()
        if any(contact.given.laws.follow_pressure for contact in self.contacts):
            message += "; friction follows the pressure, and was that of the last iterate"
        if any(contact.given.laws.wears_within for contact in self.contacts):
            message += (
                "; the depth that the step wears is part of it, and was that of the last iterate"
            )
        return message

    def _hard(self) -> str:
        """What may help where a state should exist, in words.  Collective."""
        from dolfinx_contact.step.stalled import slow

        return "; ".join(
            filter(None, ("Smaller load steps help most often", slow(self.body, self.b)))
        )

    def _no_state(self, state: StepState) -> str:
        """Why there is no static state, in words; empty where nothing tells.  Collective."""
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
        """Contact nodes open, sticking and slipping.  Collective."""
        return counts_of(self.body, state.nodes)

    def tell(self, state: StepState) -> None:
        """Tell the user of a state of the body, if that is wanted.  Collective."""
        if self.monitor is not None:
            known = state.balance if state.is_far else state.errors
            self.monitor.tell(known.largest, self.counts(state))


@dataclass(frozen=True, eq=False)
class StepState:
    """A displacement in a step, and all that follows from it: ``LoadStep.evaluate`` makes it.

    What is lazy is computed when it is first asked for, on all ranks together.

    Attributes:
        step: The step.
        x: Displacement.
        c: Motions of surfaces that force drives.
        forces: ``b - K x`` or ``-F(x)``, with what supports carry.
        nodes: ``State`` of each contact.
        required: Reactions that the body requires of each contact, from which maps have made those of ``nodes``.
        exact: Whether ``forces`` are those of F itself.
        split: How reactions of shared nodes were split.
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
        # Of the state before, its reactions and what is known of rounding: not that state itself, and all before it.
        before = self.before
        if isinstance(before, StepState):
            acts = None if before.is_start else before.acts
            object.__setattr__(self, "before", (acts, before.contact_rounding))

    @property
    def as_start(self) -> StepState:
        """The same as a start: of the next state it is not known by how much reactions have changed."""
        return replace(self, is_start=True)

    @property
    def acts_before(self) -> np.ndarray | None:
        """``acts`` of the state before."""
        return None if self.before is None else self.before[0]

    @property
    def contact_rounding(self) -> float:
        """Rounding at the contacts, in the unit of force, as far as any state has told; else infinite."""
        if "contact_sums" in vars(self):
            return float(np.sqrt(self.contact_sums[-1]))
        return np.inf if self.before is None else self.before[1]

    @cached_property
    def reactions(self) -> np.ndarray:
        """Reactions of all contacts, flat."""
        return np.concatenate([np.zeros(0), *(nodes.reaction.ravel() for nodes in self.nodes)])

    @cached_property
    def acts(self) -> np.ndarray:
        """Reactions of which a change counts: where contacts share a node their sum alone, how they share it may jump."""
        if self.step.shared is None:
            return self.reactions
        return self.step.free(self.step.with_reactions(0.0 * self.x, self.nodes))

    @cached_property
    def residual(self) -> np.ndarray:
        """Forces that are left once every contact node has its new reaction, zero at fixed degrees of freedom."""
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
        """Errors of equilibrium alone, which take no other call of the law.  Collective."""
        return self.step.errors_of(self, None)

    @cached_property
    def errors(self) -> Errors:
        """All errors.  Collective."""
        return self.step.errors_of(self, self.contact_sums)

    @cached_property
    def is_far(self) -> bool:
        """Whether equilibrium alone tells that the state is no solution, whatever the law adds, known rounding at the contacts allowed for.  Collective."""
        errors = self.balance
        known = self.contact_rounding / errors.scale if errors.scale > 0.0 else np.inf
        errors = errors._replace(rounding=max(errors.rounding, known))
        return not errors.within(self.step.tol)

    @property
    def within(self) -> bool:
        """Whether its errors are at most the tolerance of the step.  Collective."""
        return self.errors.within(self.step.tol)

    # What is lazy is never the state itself: a state that holds itself stays in memory until Python looks for such.

    @property
    def confirmed(self) -> StepState:
        """The same state with forces of F itself, by which it is judged.  Collective."""
        return self if self.exact else self._confirmed

    @cached_property
    def _confirmed(self) -> StepState:
        state = replace(self, forces=self.step.by_form(self.x), exact=True)
        vars(state)["contact_sums"] = self.contact_sums  # of the same nodes
        return state

    @property
    def judged(self) -> StepState:
        """The state by F itself: with its reactions where it is a solution, else with those of the return map.  Collective."""
        stands = self.exact or (not self.is_far and self.within)
        return self.confirmed if stands else self._measured

    @cached_property
    def _measured(self) -> StepState:
        return self.step.measure(self.x, c=self.c, before=self)

    def of(self, step: LoadStep) -> StepState:
        """The same state in a step that differs from its own by less than counts; errors stay."""
        return self._with_its_errors(step=step)

    def with_nodes(self, nodes: Sequence[State]) -> StepState:
        """The same displacement with other states of the nodes; errors stay those of this state."""
        return self._with_its_errors(nodes=tuple(nodes))

    def _with_its_errors(self, **parts: Any) -> StepState:
        state = replace(self, **parts)
        vars(state)["errors"] = self.errors
        return state
