"""An elastic body in contact: one call, one load step."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from copy import copy
from os import PathLike
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from dolfinx_contact import compat
from dolfinx_contact.contact.contact import Contact
from dolfinx_contact.contact.contact_step import frames_of, nodal_stiffness, step_of
from dolfinx_contact.petsc.linear_solver import raise_interrupt, stage
from dolfinx_contact.problem_input import (
    NUMBERS,
    body_of,
    check_alive,
    check_size,
    check_step,
    check_surfaces,
    check_weights,
    checked_conditions,
    checked_contacts,
    checked_internal,
    checked_lagged,
    checked_options,
    checked_solver,
    checked_tolerance,
    checked_undetermined,
    crowded,
    frames_of_step,
    hold,
    support,
    take_contacts,
)
from dolfinx_contact.problem_states import Kept, ProblemStates
from dolfinx_contact.results.record import (
    NO_SOLUTION,
    UNHELD,
    Counts,
    NotConverged,
    Step,
    converged,
    counts_of,
    named,
    record,
    warn_of_contact,
    warn_of_corners,
    warn_of_rounding,
)
from dolfinx_contact.solvers.base import BoundSolver, Solver, SolverResult
from dolfinx_contact.solvers.trial import floating, unmoved, without_reactions
from dolfinx_contact.step.load_step import LoadStep, Monitor, Stamps, StepState, new_stamp
from dolfinx_contact.step.unseen import Unseen
from dolfinx_contact.support.attributes import Guarded
from dolfinx_contact.support.checks import positive
from dolfinx_contact.support.collective import agree, raised_together, uninterrupted

if TYPE_CHECKING:
    from dolfinx_contact.bodies.internal_variables import InternalVariables
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.placement import Placed
    from dolfinx_contact.step.staggered import Lagged
    from dolfinx_contact.surfaces.held import HeldSurfaces

LOG = logging.getLogger("dolfinx_contact")

# How many times as far as supports move bodies may be expected to move in a step; and the part of that within which they are expected
# to go on as in the step before.
FARTHER, STEADY = 2.0, 0.05

# Tolerance of a solution on the way to the geometry of the end, over that of the geometry.
PART = 0.03


class ContactProblem(Guarded):
    """A body in contact with surfaces, solved load step by load step.

    Args:
        F: Residual form, internal minus external virtual work.  If it is not linear in ``u``, the body is nonlinear, see
            docs/nonlinear.md.
        u: Displacement, a Function, or one of a mixed space with displacements.  Holds the solution after a step.  At the start
            of any step, it is only an initial guess; the problem keeps the last converged state itself.
        contacts: One ``Contact`` or several; a node on an edge may belong to several.
        bcs: Dirichlet conditions; their values may change between steps, and ``problem.bcs = [...]`` releases or adds supports.
        J: Derivative of ``F`` with respect to ``u``; by UFL if None.
        solver: ``CondensedNewton(...)``, ``FixedPoint(...)`` or ``SparseNewton(...)``; None takes the first for small contacts,
            the second for large ones, the third for nonlinear bodies; ``step.solver`` names the choice, ``step.reason`` its reason.
        tol: Largest error, slip error and forward error of a converged step, see docs/errors.md.
        petsc_options: Options of the linear solver, as in DOLFINx; by default a factorisation, for large bodies multigrid.
        petsc_options_prefix: Their prefix.
        internal: ``InternalVariables`` of the material, None if it has none.
        form_compiler_options: Options of FFCx, as in ``fem.form``.
        jit_options: Options of the compilation of generated code, as in ``fem.form``.
        entity_maps: Relation between meshes, if ``F`` has Functions on another mesh than that of ``u``, as in ``fem.form``: a
            dictionary in DOLFINx 0.9, a list of ``EntityMap`` since 0.10.  Not available in older releases.
        undetermined: What to do if a body held by contact alone can move without changing the reactions: "refused" raises a
            ``ValueError`` that names the motion; "nearest" takes the state nearest to the last one, that with the smallest
            integral of ``|du|^2`` over the volume.
        geometry_tol: Largest ``step.geometry_error`` of a converged step, on curved, rotating, wavy, textured or deformable
            surfaces, see docs/surfaces.md.

    Attributes:
        lagged: What a step takes for known beside this package's quantities, of classes of your own, see docs/extending.md; none at first.
        monitor: None, or a function ``f(iteration, error, counts)``, called on all ranks with every iterate: its number in the
            step, largest error and ``Counts``; far from ``tol`` the error of equilibrium alone.  For iterates of the condensed
            problem, the error is the residual over the largest reaction; the errors of the body follow.

    ``logging.getLogger("dolfinx_contact")`` gets a line per step, of level INFO, on rank 0; ``logging.basicConfig(level=20, force=True)``
    prints them.

    On several ranks, constants in ``F`` and ``bcs`` must be the same on all; for Functions, the values on the owning ranks count.

    ``close``, or ``with dc.ContactProblem(...) as problem``, frees PETSc objects.  On one rank, a problem that is no longer used
    is freed automatically.  On several ranks, PETSc frees objects only on all ranks at once: the next problem on the same mesh
    does this, and a run that makes many meshes must close its problems.

    Raises:
        ValueError: on all ranks, for invalid input; the message names the argument and its value, and says what to do.

    Example:
        >>> other = dc.Contact(V, foot, plane, friction)  # of this problem alone
        >>> problem = dc.ContactProblem(F, u, [other], bcs=[bc])
        >>> problem.solve().error <= 1e-8
        True
    """

    monitor: Callable[[int, float, Counts], object] | None
    _settable = ("bcs", "monitor", "solver", "tol", "undetermined", "geometry_tol", "lagged")
    _remedy = "bcs, monitor, solver, tol, geometry_tol and undetermined may be changed between steps; for anything else make a new ContactProblem."

    def __init__(
        self,
        F: Any,
        u: fem.Function,
        contacts: Contact | Sequence[Contact],
        *,
        bcs: Sequence[Any] = (),
        J: Any = None,
        solver: Solver | None = None,
        tol: float = 1e-8,
        petsc_options: dict[str, Any] | None = None,
        petsc_options_prefix: str | None = None,
        internal: InternalVariables | None = None,
        undetermined: str = "refused",
        form_compiler_options: dict[str, Any] | None = None,
        jit_options: dict[str, Any] | None = None,
        entity_maps: Any = None,
        geometry_tol: float = 1e-3,
    ) -> None:
        if not isinstance(u, fem.Function):
            raise ValueError(f"u must be a DOLFINx Function, got {type(u).__name__}.")
        comm = u.function_space.mesh.comm
        with raised_together(comm):
            self.contacts = checked_contacts(contacts, u)
            bcs = checked_conditions(bcs, u.function_space)
            self.solver, self.tol = solver, tol
            self.undetermined, self.geometry_tol = undetermined, geometry_tol
            petsc_options = checked_options("petsc_options", petsc_options)
            form_options = dict(
                form_compiler_options=checked_options(
                    "form_compiler_options", form_compiler_options
                ),
                jit_options=checked_options("jit_options", jit_options),
                entity_maps=entity_maps,
            )
            self._variables = checked_internal(internal)
        agree(comm, contacts=len(self.contacts), bcs=len(bcs), petsc_options=petsc_options, petsc_options_prefix=petsc_options_prefix, entity_maps=entity_maps is not None)  # fmt: skip
        self.u, self.monitor, self.lagged = u, None, ()
        self._agree(comm)
        of = self.contacts[0].displacements if self.contacts else None
        before = None if internal is None else internal.before_residual
        self.body = body_of(F, u, bcs, J, petsc_options, petsc_options_prefix, before, of, form_options)  # fmt: skip
        hold(self.contacts, self.body)
        self.body.crowded = crowded(self.solver, self.body, self.contacts)
        check_surfaces(self.contacts, self.body)
        check_weights(F, self.contacts)
        self._points = [contact.points for contact in self.contacts]
        self._unseen = Unseen(self.contacts)
        self._large = False  # whether a displacement was, and the user told
        self._turned = False  # the same of slip that turns
        self._bound = self._bound_to = None
        self._stamps, self._stiffness, self._unit = Stamps(), [], 1.0
        self._laws = [contact.friction for contact in self.contacts]
        self._freedom = self._present_freedom()
        take_contacts(self, self.contacts)
        self._states = ProblemStates(self.body, self.contacts, self._variables)
        self.number = next(NUMBERS)
        self._made = True

    def __repr__(self) -> str:
        nodes = ", ".join(f"{contact.nodes.size}" for contact in self.contacts) or "no"
        unknowns = self.u.function_space.dofmap.index_map.size_global * self.u.function_space.dofmap.index_map_bs  # fmt: skip
        return f"<ContactProblem of {unknowns} unknowns, {nodes} contact nodes on this rank, solver={self.solver!r}, tol={self.tol:g}>"

    @property
    def solver(self) -> Solver:
        """The solver's options; another one may be assigned between steps, on all ranks."""
        return self._solver

    @solver.setter
    def solver(self, solver: Solver | None) -> None:
        self._solver = checked_solver(solver)

    @property
    def bcs(self) -> tuple[Any, ...]:
        """The Dirichlet conditions.  Others may be assigned between steps, on all ranks, see docs/howto/stages.md.  Collective.

        Displacement, reactions, history variables and surfaces stay; the next step starts from them with the new supports.  A new
        support moves from its present displacement to the prescribed value; the force of a released one vanishes.

        Raises:
            ValueError: on all ranks, for invalid conditions; the previous ones stay.
        """
        return tuple(self.body.bcs)

    @bcs.setter
    def bcs(self, bcs: Sequence[Any]) -> None:
        check_alive(self, self.body, self.contacts)
        self._unbind()
        support(self.body, self.contacts, bcs)

    @property
    def tol(self) -> float:
        """The tolerance; another one may be assigned between steps, on all ranks."""
        return self._tol

    @tol.setter
    def tol(self, tol: float) -> None:
        self._tol = checked_tolerance(tol)

    @property
    def geometry_tol(self) -> float:
        """Largest ``step.geometry_error``; another one may be assigned between steps, on all ranks."""
        return self._geometry_tol

    @geometry_tol.setter
    def geometry_tol(self, tol: float) -> None:
        self._geometry_tol = positive("geometry_tol", tol)

    @property
    def undetermined(self) -> str:
        """What to do with undetermined rigid motions, "refused" or "nearest"; may change between steps, on all ranks."""
        return self._undetermined

    @undetermined.setter
    def undetermined(self, choice: str) -> None:
        self._undetermined = checked_undetermined(choice)

    @property
    def lagged(self) -> tuple[Lagged, ...]:
        """Lagged quantities of your own; others may be assigned between steps, on all ranks."""
        return self._lagged

    @lagged.setter
    def lagged(self, quantities: Sequence[Lagged]) -> None:
        self._lagged = checked_lagged(quantities)

    def close(self) -> None:
        """Free PETSc's matrices, factors and multigrid levels; results stay, but no step can follow.  Collective."""
        self._unbind()
        self.body.close()

    def __del__(self) -> None:
        # On several ranks only the next problem on the mesh can, see ``free_garbage``: Python collects when it likes.
        if "_made" in self.__dict__ and compat.may_free_alone(self.body.comm):
            self._unbind()

    def __enter__(self) -> ContactProblem:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def solve(self) -> Step:
        """Solve one load step; if it converges, the history advances.  Collective.

        Returns:
            The record of the step.

        Raises:
            NotConverged: the error stayed above ``tol``; carries the record and the best state.
            ValueError: loads, boundary values, surfaces or ``u`` are not finite, or nothing holds the body.

        After any exception, the problem is in its last converged state.
        """
        start = perf_counter()
        check_alive(self, self.body, self.contacts)
        self._states.take_variables()
        stood, told = self._states.standing(), self._told()
        try:
            with raised_together(self.body.comm):  # whatever happens on one rank alone
                done, found = self._step(start)
                with uninterrupted():
                    self._accept(found)
                    x = found.state.x
                    self._large = self._large or check_size(self.body, x, self.u.x.array)
                    now = self.u.x.array, done.counts, self._large
                    self._unseen.check(self.body, self.contacts, self._stiffness, *now)
                    warn_of_rounding(done, self.tol)
                    warn_of_contact(done, self.tol)
                    self._turned = self._turned or warn_of_corners(self.body, self.contacts)
                    self._log(lambda: f"step solved: {done}, {done.seconds:.3g} s, {named(done)}")
        except BaseException as failure:
            with uninterrupted():
                self._undo(failure, stood, told)
            raise_interrupt(failure)
            raise
        return done

    def _undo(self, failure: BaseException, stood: tuple, told: tuple) -> None:
        """Nothing has happened, whatever did: also while a step that has converged was booked.  Collective."""
        said = f"step failed: {type(failure).__name__}: {failure}"
        self._log(lambda: said)
        stopped = not isinstance(failure, Exception) or isinstance(failure, PETSc.Error)
        known = isinstance(failure, NotConverged)
        doubt = self.body.comm.allreduce(2 if stopped else 0 if known else 1, op=MPI.MAX)
        if doubt > 0:
            self._unbind()  # a solver may have been told of a part of the step
        if doubt > 1:
            self.body.forget()  # in the midst of PETSc, which keeps vectors locked
        self._states.stand_again(stood)
        self._large, self._turned, self._unseen = told

    def _told(self) -> tuple:
        """What users have been told of, and what is still to be looked at."""
        return self._large, self._turned, copy(self._unseen)

    def _step(self, start: float) -> tuple[Step, SolverResult]:
        """Record and displacement of a step that has converged, shown and given to internal variables."""
        self._check_input()
        found, changes, said = self._staggered()
        state = found.state.step.with_small_slip_as_stick(found.state)
        missed = changes.get("EndGeometry", 0.0)  # over the reactions
        done = record(state, found, perf_counter() - start, missed)
        if said or not converged(state.errors, done, self.tol):
            if not said:
                tried = f"{done}, tol {self.tol:.1e}, by {named(done)}"
                if done.reason in (NO_SOLUTION, UNHELD):  # untried: errors are of the last state
                    tried = done.reason
                said = f"not converged: {tried}. {state.step.refusal(state)}"
            reactions = [nodes.reaction for nodes in state.nodes]
            raise NotConverged(f"{said}.", done, self.body.values(state.x), reactions)
        found = found._replace(state=self._finished(state))
        self.body.put(state.x)
        if self._variables is not None:
            self._variables.move_on(self.u)
        return done, found

    def _finished(self, state: StepState) -> StepState:
        """A converged state with what only its end tells: gaps of open nodes, slip of those that have left or opened.  Collective."""
        both, nodes = zip(state.step.contacts, state.nodes), []
        for contact, one in both:
            one = contact.with_slip_past_edges(one, state.x)
            nodes.append(contact.with_own_gaps(one, state.x))
        opens = any(c.opened(one).any() for c, one in zip(state.step.contacts, nodes))
        if self.body.comm.allreduce(opens, op=MPI.LOR):
            from dolfinx_contact.lagged.landing import slip_up_to_opening

            nodes = slip_up_to_opening(state, nodes, self.geometry_tol)
        return state.with_nodes(nodes)

    def _accept(self, found: SolverResult) -> None:
        """Let what was found be the last converged state.  Collective."""
        found.state.step.place_surfaces(found.state)
        self._states.accept(found.state, found.start)

    def load_step(
        self,
        at: np.ndarray | None = None,
        before: LoadStep | None = None,
        holding: HeldSurfaces | None = None,
    ) -> LoadStep:
        """The next step as solvers see it, with the present loads, boundary values and surfaces.  Collective.

        For your own solvers and for measurements; ``solve`` makes its own.

        Args:
            at: Displacement at which tangent planes and lever arms are taken, owned degrees of freedom; None takes the last one.
            before: The same step, solved before with other frames; None where it begins.
            holding: Planes that held nodes cannot hold, if that has turned out.

        Returns:
            A ``LoadStep``, for a nonlinear body a ``NonlinearStep``.
        """
        body, start = self.body, self._states.last
        assembled = body.refresh(start)
        driven = [contact for contact in self.contacts if contact.surface.free]
        curved = [contact for contact in driven if contact.surface.curved]
        if curved:
            from dolfinx_contact.surfaces.driven import approach

            u = start if at is None else at
            approach(body, lambda: [step_of(c, frames=frames_of(c, u)) for c in curved], u)
        b, external = body.load()
        likely, known = self._predicted(b) if at is None else at, self._points
        old = [None] * len(self.contacts) if before is None else [k.frames for k in before.contacts]
        frames, turned = frames_of_step(self.contacts, body, start, likely, old, known)
        contacts = self._in_step(assembled, frames, turned, begins=before is None)
        given = dict(b=b, external=external, tol=self.tol, unit=self._unit, last=start)
        guess = body.taken(self.u.x.array), 2 * start - self._states.before
        starts = guess if at is None else (at,)
        holding = None if before is None else holding or before.holding
        if before is None and driven:
            from dolfinx_contact.surfaces.held import held_surfaces

            holding = held_surfaces(body, contacts, start, b)
            contacts = [k.where_it_stands() for k in contacts]  # planes go with what holds them
        given |= self._parts(contacts, holding)
        kind = LoadStep
        if body.nonlinear:
            from dolfinx_contact.step.nonlinear import NonlinearStep as kind
        monitor = None if self.monitor is None else Monitor(self.monitor, body.comm)
        return kind(body, starts=starts, stamps=self._stamps, monitor=monitor, **given)

    def _in_step(
        self, assembled: int, frames: Sequence[Placed], turned: bool, begins: bool
    ) -> list[ContactStep]:
        """The contacts as the step has them, and notes of what is another one than in the last: stiffness, rows, laws.  Collective."""
        old, body = self._stamps, self.body
        if turned or assembled != old.stiffness:
            both = zip(self.contacts, frames)
            self._stiffness = [nodal_stiffness(c, body.K, of.points) for c, of in both]
            size = body.largest(np.abs(body.displacements.x))
            # Any unit that keeps squares within the range of double precision.
            self._unit = body.largest(body.cancelling(np.full(body.size, size))) or 1.0
        given = zip(self.contacts, self._stiffness, frames)
        contacts = [step_of(contact, *of, begins=True) for contact, *of in given]
        laws = [contact.friction for contact in contacts]
        changed = any(one is not other for one, other in zip(laws, self._laws))
        changed = body.comm.allreduce(changed, op=MPI.LOR)
        self._laws = laws
        rows, law = new_stamp() if turned else old.rows, new_stamp() if changed else old.law
        begun = new_stamp() if begins else old.step
        self._stamps = Stamps(assembled, rows, law, old.parts, begun)
        return contacts

    def _parts(self, contacts: Sequence[ContactStep], holding: HeldSurfaces | None) -> dict:
        """Contacts and optional parts of a step, by their names there.  Collective."""
        parts: dict[str, Any] = {"holding": holding}
        if holding is not None and holding.dragged:
            dragged = holding.dragged
            contacts = [c.but(dragged=dragged.get(k)) for k, c in enumerate(contacts)]
        if any(contact.surface.motions for contact in contacts):
            from dolfinx_contact.surfaces.driven import DrivenSurfaces

            parts["surfaces"] = surfaces = DrivenSurfaces(self.body, contacts)
            contacts = surfaces.with_columns(contacts)
        if len(contacts) > 1:
            from dolfinx_contact.contact.shared import shared_nodes

            parts["shared"] = shared_nodes(contacts, self.body.fixed)
        freedom = [*self._present_freedom(), holding is not None and sorted(holding.dragged)]
        if freedom != self._freedom:
            self._freedom = freedom
            self._stamps = self._stamps._replace(parts=new_stamp())
        return parts | {"contacts": tuple(contacts)}

    def _predicted(self, b: np.ndarray) -> np.ndarray | None:
        """Where a step is likely to end, for rows between bodies that slide: under the new loads, with the last reactions.  Collective.

        None where it is farther off than the supports move, as on soft springs, where nothing slides, and for all other contacts.
        """
        body, last = self.body, self._states.last
        sliding = [
            c for c in self.contacts if c.surface.deformable and c.changes and not c.history.empty
        ]
        if not sliding or body.nonlinear or body.loose is not None:
            return None
        known = self._states.snapshot().known  # without contact, under the last loads
        if known is None or body.displacements.mixed:  # of which checkpoints do not have it
            return None
        given = np.zeros_like(last)
        given[body.fixed] = (b - last)[body.fixed]
        x = 2 * last - self._states.before  # friction and what deforms go on, too
        x[body.fixed] = b[body.fixed]
        load, exact = b - known.load, body.exact
        more = body.free_state(b) - known.displacement if exact else body.solve(load, rough=True)
        if body.farthest(last + more - x) > STEADY * body.farthest(given):
            x = last + more
            if not exact:  # six digits
                x += body.solve(load - body.multiply(more), rough=True)
        slid = body.largest(np.array([c.placement.slid(x - last, c.history) for c in sliding]))
        if slid < self.geometry_tol or body.farthest(x - last) > FARTHER * body.farthest(given):
            return None
        return x

    def bound(self, step: LoadStep | None = None) -> BoundSolver:
        """The solver, bound to steps like this one, see ``solvers/base.py``; None is the next step.  Collective."""
        step = self.load_step() if step is None else step
        if self._bound_to != self.solver:
            self._unbind()
            solver = self.solver
            if self.body.nonlinear and not solver.nonlinear:
                from dolfinx_contact.solvers.newton.linearised import Linearised

                solver = Linearised(solver)
            self._bound, self._bound_to = solver.bind(step), self.solver
            return self._bound
        try:
            self._bound.update(step)
        except BaseException:
            self._unbind()
            raise
        return self._bound

    def _staggered(self) -> tuple[SolverResult, dict, str]:
        """What is found with all that the step takes for known, which is that of the state found: see ``Staggered``.  Collective."""
        step, own = self.load_step(), ()
        goal, levels = step.tol, self._levels(step)
        if self._digits_later():
            step = step.but(tol=max(goal, PART * self.geometry_tol))
        if not levels:
            return self._found(step, self._states.starts), {}, ""
        from dolfinx_contact.step.staggered import solve_staggered

        def search(step: LoadStep) -> SolverResult:
            nonlocal own  # of the starts found within a step the last one alone
            found = self._found(step, (*self._states.starts, *own))
            own = own if found.start is None else (found.start,)
            return found._replace(start=own[0] if own else None)

        return solve_staggered(step, levels, search, goal)

    def _levels(self, step: LoadStep) -> list:
        """What the step takes for known, level by level, the fastest first; imported where there is any.  Collective."""
        contacts, levels = self.contacts, []
        if any(contact.laws.follow_pressure for contact in contacts):
            from dolfinx_contact.lagged.friction import PressureFriction

            levels.append([PressureFriction()])
        levels += [[quantity] for quantity in self.lagged]
        if any(contact.laws.wears_within for contact in contacts):
            from dolfinx_contact.lagged.wear import WearOfStep

            levels.append([WearOfStep(step, self.geometry_tol)])
        if step.holding is not None:
            from dolfinx_contact.lagged.held import HeldPlanes

            levels.append([HeldPlanes(self._with_planes)])
        if any(contact.changes for contact in contacts) or step.may_land():
            from dolfinx_contact.lagged.end_geometry import EndGeometry
            from dolfinx_contact.lagged.landing import SlipBeforeLanding

            end = EndGeometry(step, self.geometry_tol, self._step_at)
            levels.append([end, SlipBeforeLanding(self.geometry_tol)])
        return levels

    def _with_planes(self, step: LoadStep, holding: HeldSurfaces) -> LoadStep:
        """The step anew, with other planes held.  Collective."""
        return self.load_step(None, step, holding)

    def _step_at(self, step: LoadStep, at: np.ndarray) -> LoadStep:
        """The step anew, with frames of a displacement.  Collective."""
        return self.load_step(at, step)

    def _digits_later(self) -> bool:
        """Whether the step is solved to as many digits as its geometry needs first: all digits take cycles of multigrid."""
        renewed = any(c.surface.deformable and c.changes for c in self.contacts)
        return renewed and not (self.body.exact or self.body.nonlinear)

    def _found(self, step: LoadStep, starts: Sequence[Any]) -> SolverResult:
        """What is found with the laws as they are, whatever holds the body.  Collective."""
        if step.holding is not None and step.holding.beyond:
            return unmoved(step)
        if step.surfaces is not None:
            step.surfaces.check(step.contacts)
            last = [contact.last for contact in step.contacts]
            if step.surfaces.beyond(step.contacts, last, step.no_motions, given=True):
                return unmoved(step)
        if self.body.loose is not None:
            return self._held_by_contact(step, starts)
        found = None if self.body.nonlinear else without_reactions(step)
        return found or self._solved(step, starts)

    def _held_by_contact(self, step: LoadStep, starts: Sequence[Any]) -> SolverResult:
        """What is found of a body that contact alone holds.  Collective.

        Raises:
            ValueError: on all ranks, if nothing can hold the body, or nothing determines a motion that is to be refused.
        """
        from dolfinx_contact.step.statics import Statics

        found, statics = None, Statics(step, self._states.last)
        step = step.but(statics=statics)
        if statics.said:
            return unmoved(step, statics.reason)
        if not statics.loads.any():
            found = floating(step)
        pressed = np.concatenate([contact.last.reaction[:, -1] for contact in step.contacts])
        if not self.body.largest(pressed) > 0.0:
            statics.place()
        else:
            statics.follow()
        found = found or self._solved(step, starts)
        if not found.state.within:
            return found
        if not statics.balanced(found.state):
            return unmoved(step)
        return found._replace(state=statics.settled(found.state, self.undetermined))

    def _solved(self, step: LoadStep, starts: Sequence[Any]) -> SolverResult:
        """What the solver finds, judged by F itself.  Collective."""
        with stage("contact: iterations"):
            found = self.bound(step).solve(step, starts)
        return found._replace(state=found.state.judged)

    def _unbind(self) -> None:
        """Forget what was set up for a stiffness that has changed.  Collective."""
        if self._bound is not None:
            self._bound.close()
        self._bound = self._bound_to = None

    # -- converged states ----------------------------------------------------------------------

    def rewind(self) -> None:
        """Undo the last accepted step.  Collective.

        Displacement, history variables of contacts, and planes return to the end of the step before; loads, boundary values and
        laws stay as they are.  Only one step can be undone, until another one is accepted.

        Raises:
            ValueError: no step has been accepted since the beginning or the last ``reset``, ``load`` or ``rewind``.
        """
        check_alive(self, self.body, self.contacts)
        self._states.rewind()

    def snapshot(self) -> Kept:
        """The last converged state, kept in memory for ``restore``, which may be called any number of times.

        It contains displacement, history variables of contacts, and positions of surfaces.  ``save`` writes the same to a file.
        """
        check_alive(self, self.body, self.contacts)
        return self._states.snapshot()

    def restore(self, snapshot: Kept) -> None:
        """Continue from a snapshot; loads, boundary values and laws stay as they are.  Collective.

        Args:
            snapshot: A result of this problem's ``snapshot``.

        Raises:
            ValueError: it belongs to another problem.
        """
        check_alive(self, self.body, self.contacts)
        self._states.go_to(snapshot)

    def reset(self) -> None:
        """Return to the undeformed body without reactions or history, and surfaces to their positions when the problem was made."""
        check_alive(self, self.body, self.contacts)
        self._states.reset()

    def save(self, path: str | PathLike[str]) -> None:
        """Write a checkpoint: everything that the next step starts from, of all ranks, in one file.

        The file is replaced only when the new one is complete, so a killed run leaves the last one intact.  Collective.

        Args:
            path: File name, usually ending in ``.npz``.
        """
        check_alive(self, self.body, self.contacts)
        self._states.save(path)

    def load(self, path: str | PathLike[str]) -> None:
        """Continue from a checkpoint of the same problem, on any number of ranks.  Collective.

        On one rank, the following steps agree bit for bit with an uninterrupted run.  On several ranks, MUMPS adds in the order
        in which messages arrive, and they agree to rounding.

        Raises:
            ValueError: the file is not a checkpoint of this problem.
        """
        check_alive(self, self.body, self.contacts)
        self._states.load(path)

    # -- helpers -------------------------------------------------------------------------------

    def _check_input(self) -> None:
        check_step(self.u, self.body.comm, self.contacts)
        self._agree(self.body.comm)

    def _agree(self, comm: MPI.Comm) -> None:
        """Raise a ``ValueError`` on all ranks if what may change between steps differs between them.  Collective."""
        agree(comm, solver=self.solver, tol=self.tol, undetermined=self.undetermined, geometry_tol=self.geometry_tol, lagged=len(self.lagged), monitor=self.monitor is not None)  # fmt: skip

    def _present_freedom(self) -> list:
        """Free motions and springs of each contact's surface."""
        drivers = [contact.surface.driver for contact in self.contacts]
        return [() if driver is None else driver.freedom for driver in drivers]

    def _log(self, line: Callable[[], str]) -> None:
        if self.body.comm.rank == 0 and LOG.isEnabledFor(logging.INFO):
            LOG.info(line())

    def counts(self) -> Counts:
        """Contact nodes open, sticking and slipping in the last converged state.  Collective."""
        return counts_of(self.body, self.contacts)
