# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A load step as solvers see it: forces out of balance, their errors, and where to start."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dolfinx_contact.contact.interface import NodalStiffness
from dolfinx_contact.contact.state import State, Status
from dolfinx_contact.law.maps import NodalMap, ReturnMap
from dolfinx_contact.results.record import WORSE, Counts, counts
from dolfinx_contact.step.errors import (
    Errors,
    as_errors,
    at_rest,
    contact_defects,
    contact_rounding,
)
from dolfinx_contact.support.checks import EPSILON, ROUNDED
from dolfinx_contact.support.collective import raised_together

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.step.statics import Statics
    from dolfinx_contact.surfaces.driven import DrivenSurfaces
    from dolfinx_contact.surfaces.held import HeldSurfaces


def nodal_stiffness(
    body: ElasticBody, contacts: Sequence[Contact]
) -> tuple[list[NodalStiffness], float]:
    """Stiffness at the nodes of each contact, and a unit of force; contacts take their ``rho``.  Collective."""
    stiffness = [contact.nodal_stiffness(body.K) for contact in contacts]
    for contact, of in zip(contacts, stiffness):
        contact.rho = of.normal
    size = body.largest(np.abs(body.displacements.x))
    # Any unit that keeps squares within the range of double precision.
    return stiffness, body.largest(body.cancelling(np.full(body.size, size))) or 1.0


def _shared_nodes(
    contacts: Sequence[Contact], stiffness: Sequence[NodalStiffness], fixed: np.ndarray
):
    """The ``SharedNodes``, None where no node belongs to several contacts.  Collective."""
    if len(contacts) < 2:
        return None
    from dolfinx_contact.contact.shared import shared_nodes

    return shared_nodes(contacts, stiffness, fixed)


def driven_surfaces(body: ElasticBody, contacts: Sequence[Contact]) -> DrivenSurfaces | None:
    """The ``DrivenSurfaces`` of some contacts, None where force drives none.  Collective."""
    if not any(contact.surface.motions for contact in contacts):
        return None
    from dolfinx_contact.surfaces.driven import DrivenSurfaces

    return DrivenSurfaces(body, contacts)


class Judged(NamedTuple):
    """A state of a step, judged by F itself."""

    x: np.ndarray  # displacement, (owned dofs,)
    forces: np.ndarray  # -F(x)
    states: list[State]  # of the contacts
    surfaces: np.ndarray | None  # motions of surfaces that force drives
    errors: Errors


class LoadStep:
    """Equilibrium of a body under new loads, its contacts, and the errors of a displacement.

    Displacements and forces are arrays of owned degrees of freedom.  Maps are one of ``law/maps.py`` for each contact.

    Args:
        body: The body, its stiffness assembled.
        contacts: Its contacts; their reactions, gaps and statuses are those of the displacement asked for last.
        stiffness: ``NodalStiffness`` of each contact.
        b: ``b - K u`` are the forces out of balance for a ``u`` with the boundary values, which ``b`` holds.
        external: External forces.
        starts: Displacements near which the solution may lie.
        tol: Largest error.
        unit: Of force, any that keeps squares within the range of double precision.
        monitor: None, or the user's function of iteration, largest error and ``Counts``.
        holding: As the attribute.
        last: Displacement of the last step that converged; None is the first start.

    Attributes:
        surfaces: The ``DrivenSurfaces``, None where force drives none.  They follow every displacement that is asked for.
        holding: ``HeldSurfaces``, None where held nodes hold none of them.
        statics: ``Statics`` of a body that contact alone holds, else None; see ``held_by``.
        errors: Of the state judged last.
        continues: Whether it starts from what was found for the same step, so that tangents there are still good.
    """

    continues = False
    surfaces: DrivenSurfaces | None
    statics: Statics | None
    errors: Errors

    def __init__(
        self,
        body: ElasticBody,
        contacts: Sequence[Contact],
        stiffness: Sequence[NodalStiffness],
        b: np.ndarray,
        external: np.ndarray,
        starts: Sequence[np.ndarray],
        tol: float,
        unit: float,
        monitor: Callable | None = None,
        holding: HeldSurfaces | None = None,
        last: np.ndarray | None = None,
    ):
        self.body, self.contacts, self.stiffness = body, contacts, stiffness
        self.b, self.external, self.tol = b, external, tol
        self.surfaces = driven_surfaces(body, contacts)
        self._shared = _shared_nodes(contacts, stiffness, body.fixed)
        self.statics, self.holding = None, holding
        self._starts, self.unit, self._monitor = starts, unit, monitor
        self.last = starts[0] if last is None else last
        self._before, self._told = None, 0  # reactions of the state judged before, states told
        self._contact_rounding = np.inf  # the last one, in the unit of force; none is known yet
        self._judged: Judged | None = None  # the state judged last by F

    @property
    def may_slide(self) -> bool:
        """Whether a plane, or the body, is held by contact along some direction."""
        return self.surfaces is not None or self.statics is not None

    def held_by(self, statics: Statics) -> LoadStep:
        """The step of a body that contact alone holds, with its ``Statics``."""
        return self._but(statics=statics)

    def within(self, tol: float) -> LoadStep:
        """The step with another tolerance."""
        return self._but(tol=tol)

    def with_laws_of(self, x: np.ndarray) -> LoadStep:
        """The step with the laws that contacts have now, to start from a displacement; nothing is judged by them yet.  Collective."""
        shared = _shared_nodes(self.contacts, self.stiffness, self.body.fixed)
        return self._but(_starts=[x], _judged=None, _shared=shared)

    def finer(self, tol: float, x: np.ndarray) -> LoadStep:
        """The step with a smaller tolerance, from what was found with another one."""
        return self._but(tol=tol, _starts=[x], continues=True)

    def half_way(self) -> LoadStep:
        """The step with half of what its loads and boundary values change, for a start; of tolerance zero, since F itself has all of them."""
        last, fixed, reactions = self.last, self.body.fixed, np.zeros_like(self.b)
        for contact in self.contacts:
            contact.points.add_forces(contact.last.reaction, reactions)
        b = 0.5 * (self.b + self.body.multiply(last) - reactions)
        b[fixed] = 0.5 * (self.b + last)[fixed]
        return self._but(b=b, tol=0.0, _starts=[last], _judged=None, _before=None)

    def _but(self, **parts: Any) -> LoadStep:
        other = copy(self)
        vars(other).update(parts)
        return other

    def slides(self) -> bool:
        """Whether force pushes a plane, or loads a body, by more than friction carries in the present state.  Collective."""
        slides = self.surfaces is not None and bool(self.surfaces.beyond())
        return slides or (self.statics is not None and self.statics.slides(self))

    def refusal(self) -> str:
        """Why it has not converged, in words, as far as anything tells.  Collective."""
        said = "" if self.statics is None else self.statics.hidden(self)
        said = said or self._no_state() or self._hard()
        if any(contact.follows_pressure for contact in self.contacts):
            said += "; friction follows the pressure, and was that of the last iterate"
        if any(contact.wears_within for contact in self.contacts):
            said += (
                "; the depth that the step wears is part of it, and was that of the last iterate"
            )
        return said

    def _hard(self) -> str:
        """What may help where a state should exist, in words.  Collective."""
        from dolfinx_contact.step.stalled import slow

        return "; ".join(
            filter(None, ("Smaller load steps help most often", slow(self.body, self.b)))
        )

    def _no_state(self) -> str:
        """Why there is no static state, in words; empty where nothing tells.  Collective."""
        said = "" if self.statics is None else self.statics.said
        if self.surfaces is not None:
            said = said or self.surfaces.beyond(True) or self.surfaces.beyond()
            if not said and self.statics is not None:
                from dolfinx_contact.surfaces.sliding import nothing_holds

                said = nothing_holds(self.contacts)
        return said

    def total(self, array: Any) -> np.ndarray:
        """Sum of an array over all ranks."""
        return self.body.total(array)

    def start(self) -> np.ndarray:
        """The start with the smallest error, by the return map: the paper's takes extrapolations for worse than they are."""
        guesses = [start.copy() for start in self._starts]
        if self.statics is not None:
            # a body that was placed begins there, or where this step has ended before
            away = self.statics.placed and len(guesses) > 1
            guesses = [*([] if away else guesses), self.statics.start.copy()]
        for guess in guesses:
            guess[self.body.fixed] = self.b[self.body.fixed]
        maps = [ReturnMap(of.normal, of.normal) for of in self.stiffness]
        best = min(guesses, key=lambda guess: self._imbalance(guess, maps))
        self._before = None
        return best

    def _imbalance(self, x: np.ndarray, maps: Sequence[NodalMap]) -> float:
        """The error of equilibrium alone.  Collective."""
        left = self.out_of_balance(x, maps)
        return self._as_errors(x, self._balance(left, x, self.body.support_forces(x))).error

    # -- forces --------------------------------------------------------------------------------

    def forces(self, x: np.ndarray) -> np.ndarray:
        """``b - K x``."""
        return self.b - self.body.multiply(x)

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

    def out_of_balance(
        self, x: np.ndarray, maps: Sequence[NodalMap], forces: np.ndarray | None = None
    ) -> np.ndarray:
        """Forces that are left once every contact node has its new reaction, ``b - K x + B^T R(K x - b, x)``.

        Args:
            x: Displacement.
            maps: Of the contacts.
            forces: ``forces(x)``, where they are known; so with the other methods.
        """
        forces = self.free(self.forces(x) if forces is None else forces)
        self._respond(x, forces, maps)
        return self.with_reactions(forces)

    def derivatives(
        self, x: np.ndarray, maps: Sequence[NodalMap], forces: np.ndarray | None = None
    ) -> list[tuple]:
        """Of the new reactions of each contact, by the reactions before and by the motion, ``shape=(n, gdim, gdim)``."""
        forces = self.free(self.forces(x) if forces is None else forces)
        self._balance_surfaces(x, forces, maps)
        both = zip(self._asked(x, forces), maps)
        derivatives = [contact.respond_with_derivatives(x, map) for contact, map in both]
        return derivatives if self._shared is None else self._shared.coupled(derivatives)

    # -- errors --------------------------------------------------------------------------------

    @property
    def scale(self) -> float:
        """Forces that act in the state judged last."""
        return self.errors.scale * self.unit

    def carried(self, tol: float) -> float:
        """What forces are held against of which a part ``tol`` does not matter: the reactions of that state.

        Beside stiff springs they may be so small that it is told; then what the errors leave unknown does not matter either.
        """
        errors = self.errors
        unknown = max(errors.largest, ROUNDED * errors.rounding)
        told = unknown > WORSE * self.tol * errors.share
        return self.scale * max(errors.share, unknown / tol if told else 0.0)

    def rest(self) -> None:
        """Call sticking what slips by less than is unknown of the state judged last, or than the tolerance of its reactions."""
        errors = self.errors
        unknown = max(self.tol * errors.share, errors.largest, ROUNDED * errors.rounding)
        unknown *= errors.scale * self.unit
        for contact, stiffness in zip(self.contacts, self.stiffness):
            still = at_rest(contact, stiffness, unknown)
            if still.any():
                contact.take(status=np.where(still, int(Status.STICK), contact.status).astype(np.uint8))  # fmt: skip

    def residual(
        self, x: np.ndarray, maps: Sequence[NodalMap], forces: np.ndarray | None = None
    ) -> tuple[np.ndarray, Errors]:
        """``out_of_balance`` and the errors of the state.

        The reactions that enter the predictor are those the body asks for, ``K x - b``.  Far from the tolerance the errors are
        those of equilibrium alone, which costs no other call of the law.  Once they fall below the tolerance they are measured
        again with F itself, assembled by DOLFINx.
        """
        left = self.out_of_balance(x, maps, forces)
        self._left = self._balance(left, x, self.body.support_forces(x))
        self.errors = self._as_errors(x, self._left)
        if not self._is_far(self.errors):
            contacts = self._at_contacts(x)
            self.errors = self._as_errors(x, self._left, contacts)
            if self.errors.within(self.tol):
                self._judge(x, self.by_form(x), contacts, self.errors.change)
        self._tell()
        return left, self.errors

    def errors_in_full(self, x: np.ndarray) -> Errors:
        """The errors of the displacement that ``residual`` was asked for last, those of the law included.  Collective."""
        if self._is_far(self.errors):
            self.errors = self._as_errors(x, self._left, self._at_contacts(x))
        return self.errors

    def measure(self, x: np.ndarray) -> Errors:
        """Errors of a displacement by F itself; also takes its reactions, gaps and slips, see ``judged``."""
        return self.judged(x).errors

    def judged(self, x: np.ndarray) -> Judged:
        """The state of a displacement, judged by F itself; contacts and surfaces are in that state then.  Collective.

        Reactions by the return map: beside large slip their direction is that of the slip, not that of rounding in forces.
        """
        if not self._is_judged(x):
            forces = self.by_form(x)
            maps = [ReturnMap(of.normal, of.normal) for of in self.stiffness]
            self._respond(x, self.free(forces), maps)
            self._judge(x, forces)
            self._tell()
        elif self.surfaces is not None:  # where they were judged
            self.surfaces.move_to(self._judged.surfaces)
        self.errors = self._judged.errors
        return self._judged

    def by_form(self, x: np.ndarray) -> np.ndarray:
        """``-F(x)``, by which errors are measured."""
        return -self.body.residual(x)

    def _is_judged(self, x: np.ndarray) -> bool:
        """Whether the state judged last is that of ``x``, and contacts are in it.  Collective."""
        last = self._judged
        if last is None:
            return False
        both = zip(self.contacts, last.states)
        stand = all(same_states(contact.present, state) for contact, state in both)
        return self.body.same(x, last.x if stand else None)  # asked on all ranks

    def measure_open(self, x: np.ndarray) -> Errors:
        """Errors of a displacement without reactions."""
        for contact in self.contacts:
            contact.move(x)
            contact.release()
        self._judge(x, self.by_form(x))
        return self.errors

    @property
    def monitored(self) -> bool:
        """Whether the user wants to be told."""
        return self._monitor is not None

    def tell(self, error: float, nodes: Sequence[int]) -> None:
        """Tell the user's monitor the error of another iterate, and its nodes by status.  Collective."""
        with raised_together(self.body.comm):
            self._monitor(self._told, error, Counts(*nodes))
        self._told += 1

    def _tell(self) -> None:
        """Tell the errors of another state of the body."""
        if self.monitored:
            self.tell(self.errors.largest, counts(self.body, self.contacts))

    def _asked(self, x: np.ndarray, forces: np.ndarray):
        """The contacts, each with the reactions that balance the forces at its nodes, of shared ones with its own part."""
        if self._shared is not None:
            self._shared.split(x, -forces, self.tol)
        for k, contact in enumerate(self.contacts):
            contact.take_reaction(-forces)
            if self._shared is not None:
                self._shared.give(k)
            yield contact

    def _balance_surfaces(
        self, x: np.ndarray, forces: np.ndarray, maps: Sequence[NodalMap]
    ) -> None:
        if self.surfaces is not None:
            self.surfaces.balance(x, maps, lambda: self._asked(x, forces))

    def _respond(self, x: np.ndarray, forces: np.ndarray, maps: Sequence[NodalMap]) -> None:
        """Give contacts the reactions that maps make of those which balance the forces."""
        self._balance_surfaces(x, forces, maps)
        for contact, map in zip(self._asked(x, forces), maps):
            contact.respond(x, map)
        if self.holding is not None:
            self.holding.share()

    def with_reactions(self, forces: np.ndarray) -> np.ndarray:
        """Forces plus the contacts' present reactions."""
        forces = forces.copy()
        for contact in self.contacts:
            contact.assemble_reaction(forces)
        return forces

    def _judge(
        self,
        x: np.ndarray,
        forces: np.ndarray,
        contacts: np.ndarray | None = None,
        change: float | None = None,
    ) -> None:
        """Errors of the contacts' present state, ``forces = -F(x)``; with sums at the contacts and a change that are known."""
        balance = self._balance(self.with_reactions(forces), x, -forces[self.body.fixed])
        contacts = self._at_contacts(x) if contacts is None else contacts
        errors = self._as_errors(x, balance, contacts)
        self.errors = errors if change is None else errors._replace(change=change)
        moved = None if self.surfaces is None else self.surfaces.moved
        states = [contact.present for contact in self.contacts]
        self._judged = Judged(x.copy(), forces, states, moved, self.errors)

    def _balance(self, left: np.ndarray, x: np.ndarray, supports: np.ndarray) -> np.ndarray:
        """Sums of squares of what balances in the contacts' present state, ``shape=(6,)``, see ``as_errors``.  Collective.

        Args:
            left: Forces out of balance, ``f - F(u) + r``; at fixed degrees of freedom they do not count.
            x: Displacement.
            supports: What the supports carry, at fixed degrees of freedom.
        """
        left, acting = self.free(left), np.abs(self.external)
        left += self.body.cancelling(self.missing(x))
        for contact in self.contacts:
            contact.points.add_magnitudes(contact.reaction, acting)
        reaction = np.concatenate([np.zeros(0), *(c.reaction.ravel() for c in self.contacts)])
        # Where contacts share a node only the sum is the state's; how they share it may jump.
        acts = reaction if self._shared is None else self.free(self.with_reactions(0.0 * left))
        before, self._before = self._before, acts
        change = np.full(1, np.inf) if before is None else acts - before
        cancelling = EPSILON * (self.body.cancelling(x) + acting)
        if self.surfaces is not None:
            on_surfaces, terms = self.surfaces.left()
            mine = slice(None if self.body.comm.rank == 0 else 0)  # they are the same on all ranks
            left = np.append(left, on_surfaces[mine])
            cancelling = np.append(cancelling, EPSILON * terms[mine])
        return self._sums(left, reaction, self.external, supports, cancelling, change)

    def _at_contacts(self, x: np.ndarray) -> np.ndarray:
        """Sums of squares of what is left of the law in the contacts' present state, ``shape=(4,)``, see ``as_errors``.  Collective."""
        columns = [[np.zeros(0)] for _ in range(4)]
        for contact, stiffness in zip(self.contacts, self.stiffness):
            parts = (*contact_defects(contact, stiffness), contact_rounding(contact, stiffness, x))
            for column, part in zip(columns, parts):
                column.append(part.ravel())
        sums = self._sums(*map(np.concatenate, columns))
        self._contact_rounding = float(np.sqrt(sums[-1]))
        return sums

    def _sums(self, *parts: np.ndarray) -> np.ndarray:
        """Sums of squares over all ranks, in the unit of force.  Collective."""
        return self.total([np.square(part / self.unit).sum() for part in parts])

    def _is_far(self, errors: Errors) -> bool:
        """Whether equilibrium alone tells that a state is no solution, whatever the law adds, known rounding at the contacts allowed for."""
        known = self._contact_rounding / errors.scale if errors.scale > 0.0 else np.inf
        return not errors._replace(rounding=max(errors.rounding, known)).within(self.tol)

    def _as_errors(
        self, x: np.ndarray, balance: np.ndarray, contacts: np.ndarray | None = None
    ) -> Errors:
        """Errors of a displacement from both kinds of sums; without those of the contacts they are smaller.  Collective."""
        errors = as_errors(balance, contacts)
        lost = errors.blind and self.may_slide and self._is_lost(x, errors.acts)
        return errors._replace(error=np.inf) if lost else errors

    def _is_lost(self, x: np.ndarray, acts: bool) -> bool:
        """See ``lost_far_away``.  Collective."""
        from dolfinx_contact.surfaces.sliding import lost_far_away

        return lost_far_away(self.body, self.statics, self.surfaces, x, acts)


def same_states(one: State, other: State) -> bool:
    """Whether two states of a contact have the same values."""
    return one is other or all(
        a is b or (a is not None and b is not None and np.array_equal(a, b, equal_nan=True))
        for a, b in zip(one, other)
    )
