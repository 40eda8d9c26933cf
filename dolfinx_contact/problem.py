# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The contact problem of an elastic body; each call of ``solve`` is one load step."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from os import PathLike
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from dolfinx_contact import compat
from dolfinx_contact.accepted import (
    Accepted,
    advanced,
    histories_of,
    poses_of,
    put_surfaces,
    show,
    unloaded,
    values_of,
)
from dolfinx_contact.checks.check import Check, CheckedStep, checked_checks, run_checks
from dolfinx_contact.checks.scene import checks_of
from dolfinx_contact.contact.contact import Contact
from dolfinx_contact.next_step import StepMaker
from dolfinx_contact.petsc.linear_solver import raise_interrupt
from dolfinx_contact.problem_input import (
    PROBLEM_NUMBERS,
    body_of,
    check_alive,
    check_step,
    check_surfaces,
    check_weights,
    checked_conditions,
    checked_contacts,
    checked_form_options,
    checked_internal,
    checked_options,
    checked_solver,
    checked_tolerance,
    checked_undetermined,
    hold,
    multigrid_is_faster,
    support,
    take_contacts,
    validated_lagged,
)
from dolfinx_contact.results.record import (
    NO_SOLUTION,
    NOT_HELD,
    Counts,
    NotConverged,
    Step,
    converged,
    count_statuses,
    named,
    record,
    warn_of_inaccurate_reactions,
    warn_of_rounding,
)
from dolfinx_contact.solution import ended, solution
from dolfinx_contact.solvers.base import BoundSolver, Solver
from dolfinx_contact.step.load_step import LoadStep, StepState
from dolfinx_contact.support.attributes import Guarded
from dolfinx_contact.support.checks import positive
from dolfinx_contact.support.collective import agree, raised_together, uninterrupted

if TYPE_CHECKING:
    from dolfinx_contact.bodies.internal_variables import InternalVariables
    from dolfinx_contact.step.staggered import Lagged
    from dolfinx_contact.surfaces.held import HeldSurfaces

logger = logging.getLogger("dolfinx_contact")


class ContactProblem(Guarded):
    """A body in contact with surfaces, solved load step by load step.

    Args:
        F: Residual form, internal minus external virtual work.  If it is not linear in ``u``, the
            body is nonlinear, see docs/nonlinear.md.
        u: Displacement Function, or a Function of a mixed space that contains the displacement.
            After a step, it holds the solution.  At the start of a step, it is only an initial
            guess; the problem stores the last converged state itself.
        contacts: One ``Contact`` or several; a node on an edge may belong to several.
        bcs: Dirichlet conditions.  Their values may change between steps;
            ``problem.bcs = [...]`` releases or adds supports.
        J: Derivative of ``F`` with respect to ``u``; if None, UFL computes it.
        solver: ``CondensedNewton(...)``, ``FixedPoint(...)`` or ``SparseNewton(...)``.  None
            chooses the first for small contacts, the second for large contacts and the third for
            nonlinear bodies.  ``step.solver`` names the choice, ``step.reason`` explains it.
        tol: Largest error, slip error and forward error of a converged step, see docs/errors.md.
        petsc_options: Options of the linear solver, as in DOLFINx.  The default is a direct
            factorisation, and multigrid for large bodies.
        petsc_options_prefix: Prefix of the options of the linear solver.
        internal: ``InternalVariables`` of the material, None if it has none.
        form_compiler_options: Options of FFCx, as in ``fem.form``.
        jit_options: Options for compiling the generated code, as in ``fem.form``.
        entity_maps: Relation between meshes, as in ``fem.form``, needed if ``F`` contains
            Functions on a mesh other than the mesh of ``u``: a dictionary in DOLFINx 0.9, a list
            of ``EntityMap`` since 0.10.  Not available in older releases.
        undetermined: How to treat a body that is held by contact alone and can move without
            changing the reactions.  "refused" raises a ``ValueError`` that names the motion;
            "nearest" selects the state nearest to the last converged one, with the smallest
            integral of ``|du|^2`` over the volume.
        geometry_tol: Largest ``step.geometry_error`` of a converged step, on curved, rotating,
            wavy, textured or deformable surfaces, see docs/surfaces.md.

    Attributes:
        solver: The solver's options.  ``solver``, ``tol``, ``geometry_tol``, ``undetermined`` and
            ``lagged`` may be changed between steps, on all ranks.
        lagged: Lagged quantities of your own classes, in addition to those of this package, see
            docs/extending.md; initially empty.
        checks: ``Check`` objects that are evaluated after each step until each has issued its
            warning; you may add your own, see docs/extending.md.
        monitor: None, or a function ``f(iteration, error, counts)`` that is called on all ranks
            for every iterate, with its number in the step, its largest error and ``Counts``.  Far
            from ``tol``, the error is the error of equilibrium alone.  For iterates of the
            condensed problem, the error is the residual over the largest reaction; the errors of
            the body follow.

    On rank 0, ``logging.getLogger("dolfinx_contact")`` receives one line of level INFO for each
    step; ``logging.basicConfig(level=20, force=True)`` prints these lines.

    On several ranks, constants in ``F`` and ``bcs`` must have the same values on all ranks.  For
    Functions, the values on the owning ranks are used.

    ``close``, or ``with dc.ContactProblem(...) as problem``, frees PETSc objects.  On one rank, a
    problem that is no longer used is freed automatically.  On several ranks, PETSc frees objects
    only on all ranks at once: the next problem on the same mesh does this, and a program that
    creates many meshes must close its problems.

    Raises:
        ValueError: on all ranks, for invalid input; the message names the argument and its value,
            and says what to do.

    Example:
        >>> other = dc.Contact(V, foot, plane, friction)  # belongs to this problem only
        >>> problem = dc.ContactProblem(F, u, [other], bcs=[bc])
        >>> problem.solve().error <= 1e-8
        True
    """

    monitor: Callable[[int, float, Counts], object] | None
    solver: Solver
    tol: float
    geometry_tol: float
    undetermined: str
    lagged: tuple[Lagged, ...]
    checks: tuple[Check, ...]
    _checked = dict(
        solver=checked_solver,
        tol=checked_tolerance,
        geometry_tol=partial(positive, "geometry_tol"),
        undetermined=checked_undetermined,
        lagged=validated_lagged,
        checks=checked_checks,
    )
    _settable = ("bcs", "monitor", *_checked)
    _remedy = "bcs, monitor, solver, tol, geometry_tol, undetermined, lagged and checks may be changed between steps; for anything else make a new ContactProblem."

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
            options = checked_form_options(form_compiler_options, jit_options, entity_maps)
            self.internal = checked_internal(internal)
        agree(
            comm,
            contacts=len(self.contacts),
            bcs=len(bcs),
            petsc_options=petsc_options,
            petsc_options_prefix=petsc_options_prefix,
            entity_maps=entity_maps is not None,
        )
        self.u, self.monitor, self.lagged = u, None, ()
        self._agree(comm)
        displacements = self.contacts[0].displacements if self.contacts else None
        before = None if internal is None else internal.before_residual
        given = J, petsc_options, petsc_options_prefix, before, displacements, options
        self.body = body_of(F, u, bcs, *given)
        hold(self.contacts, self.body)
        self.body.multigrid_is_faster = multigrid_is_faster(self.solver, self.body, self.contacts)
        check_surfaces(self.contacts, self.body)
        check_weights(F, self.contacts)
        self.checks, self._over = checks_of(self.body, self.contacts), frozenset()
        self._bound = self._bound_to = None
        self._maker = StepMaker(self)
        take_contacts(self, self.contacts)
        self.number, self._before = next(PROBLEM_NUMBERS), None
        self._accepted = self._first = unloaded(self)
        self._made = True

    def __repr__(self) -> str:
        nodes = ", ".join(f"{contact.nodes.size}" for contact in self.contacts) or "no"
        dofmap = self.u.function_space.dofmap
        unknowns = dofmap.index_map.size_global * dofmap.index_map_bs
        return f"<ContactProblem of {unknowns} unknowns, {nodes} contact nodes on this rank, solver={self.solver!r}, tol={self.tol:g}>"

    @property
    def bcs(self) -> tuple[Any, ...]:
        """The Dirichlet conditions, which may be replaced between steps on all ranks.  Collective.

        Displacement, reactions, history variables and surfaces are kept; the next step starts from
        them with the new supports.  A new support moves from its present displacement to the
        prescribed value; the force of a released support vanishes.  See docs/howto/stages.md.

        Raises:
            ValueError: on all ranks, for invalid conditions; the previous conditions are kept.
        """
        return tuple(self.body.bcs)

    @bcs.setter
    def bcs(self, bcs: Sequence[Any]) -> None:
        check_alive(self, self.body, self.contacts)
        self._unbind()
        support(self.body, self.contacts, bcs)

    def close(self) -> None:
        """Free PETSc's matrices, factors and multigrid levels.  Collective.

        Results remain available, but no further step can be solved.
        """
        self._unbind()
        self.body.close()

    def __del__(self) -> None:
        # On several ranks, Python's garbage collection is not simultaneous, so the next problem on
        # the mesh frees the PETSc objects, see ``free_garbage``.
        if "_made" in self.__dict__ and compat.may_free_alone(self.body.comm):
            self._unbind()

    def __enter__(self) -> ContactProblem:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def solve(self) -> Step:
        """Solve one load step and, if it converges, update the history variables.  Collective.

        Returns:
            The record of the step.

        Raises:
            NotConverged: the error stayed above ``tol``; contains the record and the best state.
            ValueError: loads, boundary values, surfaces or ``u`` are not finite, or the body is
                not held by supports or contact.

        After any exception, the problem is in its last converged state.
        """
        start = perf_counter()
        check_alive(self, self.body, self.contacts)
        began, checks = self._state_before(), (self.checks, self._over)
        try:
            with raised_together(self.body.comm):  # an error on one rank is raised on all ranks
                check_step(self.u, self.body.comm, self.contacts)
                self._agree(self.body.comm)
                found, changes, refused = solution(self)
                state = found.state.step.with_small_slip_as_stick(found.state)
                missed = changes.get("EndGeometry", 0.0)  # relative to the reactions
                done = record(state, found, perf_counter() - start, missed)
                self._check_converged(state, done, refused)
                found = found._replace(state=ended(state, self.geometry_tol))
                self.body.put(state.x)
                if self.internal is not None:
                    self.internal.move_on(self.u)
                with uninterrupted():
                    self._accept(advanced(self, found))
                    warn_of_rounding(done, self.tol)
                    warn_of_inaccurate_reactions(done, self.tol)
                    shown = self._maker.stiffness, self.u.x.array, done.counts
                    ended_in = CheckedStep(self.body, self.contacts, *shown, self._over)
                    self.checks, self._over = run_checks(self.checks, ended_in)
                    self._log(lambda: f"step solved: {done}, {done.seconds:.3g} s, {named(done)}")
        except BaseException as failure:
            with uninterrupted():
                self._undo(failure, began, checks)
            raise_interrupt(failure)
            raise
        return done

    def _state_before(self) -> tuple:
        """Return the accepted state, the state one step earlier, and the poses of the surfaces.

        Histories and internal variables that the user has changed since the last step are first
        stored in the accepted state.
        """
        histories, values = histories_of(self.contacts), values_of(self.internal)
        self._accepted = self._accepted.replaced(histories=histories, variables=values)
        return self._accepted, self._before, poses_of(self.contacts)

    def _check_converged(self, state: StepState, done: Step, refused: str) -> None:
        """Raise ``NotConverged`` if a state is not a solution.  Collective."""
        if not refused and converged(state.errors, done, self.tol):
            return
        if not refused:
            tried = f"{done}, tol {self.tol:.1e}, by {named(done)}"
            if done.reason in (
                NO_SOLUTION,
                NOT_HELD,
            ):  # no solver ran: errors belong to the last state
                tried = done.reason
            refused = f"not converged: {tried}. {state.step.refusal(state)}"
        reactions = [nodes.reaction for nodes in state.nodes]
        raise NotConverged(f"{refused}.", done, self.body.values(state.x), reactions)

    def _accept(self, accepted: Accepted) -> None:
        """Store a state, and its histories in the contacts, as the last one.  Collective."""
        self._before, self._accepted = self._accepted, accepted
        for contact, history in zip(self.contacts, accepted.histories):
            contact.accept(history)

    def _undo(self, failure: BaseException, began: tuple, checks: tuple) -> None:
        """Restore the state before a failed call of ``solve``.  Collective.

        This includes failures while the results of a converged step are being stored.
        """
        message = f"step failed: {type(failure).__name__}: {failure}"
        self._log(lambda: message)
        stopped = not isinstance(failure, Exception) or isinstance(failure, PETSc.Error)
        known = isinstance(failure, NotConverged)
        doubt = self.body.comm.allreduce(2 if stopped else 0 if known else 1, op=MPI.MAX)
        if doubt > 0:
            self._unbind()  # the bound solver may have been partly updated
        if doubt > 1:
            self.body.forget()  # interrupted within PETSc, which leaves vectors locked
        accepted, before, poses = began
        self._go_to(accepted)
        self._before = before
        put_surfaces(self.contacts, poses)
        self.checks, self._over = checks

    def load_step(
        self,
        at: np.ndarray | None = None,
        before: LoadStep | None = None,
        holding: HeldSurfaces | None = None,
    ) -> LoadStep:
        """Return the next load step.  Collective.

        It has the present loads, boundary values and surfaces.

        Use it for your own solvers and for measurements; ``solve`` builds its own load step.

        Args:
            at: Displacement at which tangent planes and lever arms are evaluated, owned degrees of
                freedom; None is the last converged displacement.
            before: The previous version of the same step, if it is solved again with other frames;
                None for a new step.
            holding: ``HeldSurfaces`` with the present status of each held surface, if the step is
                repeated because nodes held by supports cannot hold a surface; else None.

        Returns:
            A ``LoadStep``, for a nonlinear body a ``NonlinearStep``.
        """
        return self._maker.step(self, at, before, holding)

    def bound(self, step: LoadStep | None = None) -> BoundSolver:
        """Return the solver, set up for a load step, see ``solvers/base.py``.  Collective.

        Args:
            step: The load step; None is the next one.
        """
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

    def _unbind(self) -> None:
        """Close and discard the bound solver, with its factors and preconditioners.  Collective."""
        if self._bound is not None:
            self._bound.close()
        self._bound = self._bound_to = None

    # -- converged states ----------------------------------------------------------------------

    @property
    def accepted(self) -> Accepted:
        """The last converged state, see ``Accepted``; ``snapshot()`` returns the same object."""
        return self._accepted

    def _go_to(self, accepted: Accepted) -> None:
        """Make a state the last converged one; ``rewind`` has no earlier one.  Collective."""
        self._before, self._accepted = None, show(self, accepted)

    def rewind(self) -> None:
        """Undo the last accepted step.  Collective.

        Displacement, history variables of contacts, and surfaces return to the end of the previous
        step.  Loads, boundary values and laws are not changed.  Only one step can be undone, until
        another one is accepted.

        Raises:
            ValueError: no step has been accepted since the start or the last ``reset``,
                ``restore``, ``load`` or ``rewind``.
        """
        check_alive(self, self.body, self.contacts)
        if self._before is None:
            raise ValueError(
                "there is no step to go back by: rewind goes back once after a step; save and load go further."
            )
        self._go_to(self._before)

    def snapshot(self) -> Accepted:
        """Return the last converged state, for any number of calls of ``restore``.

        It contains the displacement, history variables of contacts, and poses of surfaces, in
        memory.  ``save`` writes the same data to a file.
        """
        check_alive(self, self.body, self.contacts)
        return self._accepted

    def restore(self, snapshot: Accepted) -> None:
        """Return to a snapshot; loads, boundary values and laws are not changed.  Collective.

        Args:
            snapshot: A state returned by this problem's ``snapshot``.

        Raises:
            ValueError: it belongs to another problem.
        """
        check_alive(self, self.body, self.contacts)
        with raised_together(self.body.comm):
            if not isinstance(snapshot, Accepted) or snapshot.problem != self.number:
                raise ValueError(
                    f"restore takes what snapshot of the same problem has returned, got {type(snapshot).__name__}."
                )
        self._go_to(snapshot)

    def reset(self) -> None:
        """Return to the initial state: undeformed body, no reactions, no history.

        Surfaces return to the poses which they had when the problem was created.
        """
        check_alive(self, self.body, self.contacts)
        self._go_to(self._first)

    def save(self, path: str | PathLike[str]) -> None:
        """Write a checkpoint: one file with all data that the next step starts from.

        The file is replaced only when the new one is complete, so a run that is killed leaves the
        previous checkpoint intact.  Collective.

        Args:
            path: File name, usually ending in ``.npz``.
        """
        from dolfinx_contact.results import checkpoint

        check_alive(self, self.body, self.contacts)
        checkpoint.save(path, self)

    def load(self, path: str | PathLike[str]) -> None:
        """Continue from a checkpoint of the same problem, on any number of ranks.  Collective.

        On one rank, the following steps agree bit for bit with an uninterrupted run.  On several
        ranks, they agree to rounding, because MUMPS adds in the order in which messages arrive.

        Raises:
            ValueError: the file is not a checkpoint of this problem.
        """
        from dolfinx_contact.results import checkpoint

        check_alive(self, self.body, self.contacts)
        self._go_to(checkpoint.load(path, self))

    # -- helpers -------------------------------------------------------------------------------

    def _agree(self, comm: MPI.Comm) -> None:
        """Raise a ``ValueError`` on all ranks if the options differ between ranks.  Collective."""
        agree(
            comm,
            solver=self.solver,
            tol=self.tol,
            undetermined=self.undetermined,
            geometry_tol=self.geometry_tol,
            lagged=len(self.lagged),
            monitor=self.monitor is not None,
        )

    def _log(self, line: Callable[[], str]) -> None:
        if self.body.comm.rank == 0 and logger.isEnabledFor(logging.INFO):
            logger.info(line())

    def counts(self) -> Counts:
        """Return the numbers of open, sticking and slipping contact nodes.  Collective.

        They refer to the last converged state.
        """
        return count_statuses(self.body, self.contacts)
