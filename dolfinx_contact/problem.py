"""An elastic body in contact: one call, one load step."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from dolfinx_contact.bodies.elastic import ElasticBody
from dolfinx_contact.checks import RoundingWarning
from dolfinx_contact.collective import raised_together
from dolfinx_contact.contact.contact import Contact
from dolfinx_contact.petsc.linear_solver import stage
from dolfinx_contact.results import checkpoint
from dolfinx_contact.solvers.automatic import Automatic
from dolfinx_contact.solvers.base import SolverResult
from dolfinx_contact.step import LoadStep


class Counts(NamedTuple):
    """Number of contact nodes by status, over all ranks."""

    open: int
    stick: int
    slip: int


@dataclass(frozen=True)
class Step:
    """Record of a load step, the same on all ranks.

    Attributes:
        error: What is out of balance, off the law or penetrates, over the forces that act; see
            ``dolfinx_contact.error``.
        slip_error: Defect of the slip rule, as a force over the forces that act; see the same place.
        rounding: What double precision leaves of both; where it exceeds the tolerance, no more was asked.
        forward_error: How far the reactions may still be from the exact ones, over the same forces: an
            estimate from the solver's last correction.
        bipotential_gap: Sum of the nodal certificates, >= 0, force times length.
        penetration: Largest penetration, >= 0, length.
        iterations: Iterations of the solver; 0 if the contact-free state already was the solution.
        seconds: Wall time of the step.
        counts: Contact nodes open, sticking and slipping.
        solver: The solver that was used, and why it was chosen where the user did not.
        tried: What the solver tried, in order, where it has more than one method.
    """

    error: float
    slip_error: float
    rounding: float
    forward_error: float
    bipotential_gap: float
    penetration: float
    iterations: int
    seconds: float
    counts: Counts
    solver: str
    tried: tuple = ()


class NotConverged(RuntimeError):
    """A step did not reach its tolerance; the problem is back in its last converged state.

    Attributes:
        step: Record of the step, with what was tried.
        displacement: The best one found, owned degrees of freedom; not a solution.
        reactions: Of each contact in that state, local frame.
    """

    def __init__(self, message: str, step: Step, displacement, reactions):
        super().__init__(message)
        self.step, self.displacement, self.reactions = step, displacement, reactions


NOTHING = "none: nothing touches"

# Penetration over the largest displacement that three digits of it leave no doubt about.
CERTAIN = 0.1


class ContactProblem:
    """An elastic body pressed against rigid planes, solved load step by load step.

    Args:
        F: Residual form, internal minus external virtual work, linear in ``u``.
        u: Displacement, a Function.  Holds the solution after a step; at the start of one it is only
            a guess, the last converged state is kept inside.
        contacts: The contacts; no node in two of them.
        bcs: Dirichlet conditions; their values may change between steps.
        J: Derivative of ``F`` with respect to ``u``; found by UFL if None.
        solver: ``CondensedNewton(...)`` or ``FixedPoint(...)``; None takes the first for small
            contacts and the second for large ones, and says so in ``step.solver``.
        tol: Largest error, slip error and forward error of a converged step, see ``dolfinx_contact.error``.
        petsc_options: Options of the linear solver, as in DOLFINx; by default a factorisation.
        petsc_options_prefix: Their prefix.

    Attributes:
        monitor: None, or a function ``f(iteration, error, counts)`` that is called on all ranks whenever a
            solver evaluates the residual of the whole body, with the largest error and ``Counts``.

    Raises:
        ValueError: on all ranks, for input that makes no sense; the message says what and why.
        NotImplementedError: ``F`` is not linear, or a tangential direction of a contact node is held
            that is no axis of its contact.
    """

    def __init__(
        self,
        F,
        u,
        contacts,
        bcs=(),
        J=None,
        solver=None,
        tol=1e-8,
        petsc_options=None,
        petsc_options_prefix=None,
    ):
        if not isinstance(u, fem.Function):
            raise ValueError(f"u must be a DOLFINx Function, got {type(u).__name__}.")
        with raised_together(u.function_space.mesh.comm):
            self.contacts = _checked_contacts(contacts, u)
            self.solver = Automatic() if solver is None else solver
            if not callable(getattr(self.solver, "bind", None)) or isinstance(self.solver, type):
                raise ValueError(
                    f"solver {solver!r} is unknown: use None, dc.CondensedNewton(...) or dc.FixedPoint(...)."
                )
            self.tol = _checked_tolerance(tol)
        self.u, self.monitor = u, None
        self.body = ElasticBody(F, u, bcs, J, petsc_options, petsc_options_prefix)
        with raised_together(self.body.comm):
            for contact in self.contacts:
                contact.points.held = _held_directions(contact, self.body.fixed)
        self._bound = self._bound_to = None
        self._assembled, self._memory = 0, {}
        self.reset()

    def reset(self) -> None:
        """Return to the undeformed body without reactions or history; planes stay where they are."""
        self._states = [np.zeros(self.body.size)] * 2
        self.body.known = None
        self._memory.clear()
        for contact in self.contacts:
            contact.reset()
        self._restore()

    def solve(self) -> Step:
        """Solve one load step; the history advances when it succeeds.  Collective.

        Returns:
            The record of the step.

        Raises:
            NotConverged: the error stayed above ``tol``; carries the record and the best state.
            ValueError: loads, boundary values, planes or ``u`` that are not finite, or a body that
                nothing holds.  After any exception the last converged state is in place.
        """
        start = perf_counter()
        try:
            self._check_input()
            step, found = self._search()
            record = self._record(step, found, perf_counter() - start)
            if not self._converged(step.errors, record):
                raise NotConverged(
                    f"not converged: error {record.error:.3e}, slip error {record.slip_error:.3e}, forward error "
                    f"{record.forward_error:.3e}, tol {self.tol:.1e}, rounding {record.rounding:.1e}, after {record.iterations} iterations "
                    f"({record.counts.open} open, {record.counts.stick} sticking, {record.counts.slip} slipping nodes). "
                    "Smaller load steps help most often.",
                    record,
                    found.x,
                    [contact.reaction for contact in self.contacts],
                )
        except BaseException:
            self._restore()
            raise
        self._states = [found.x, self._states[0]]
        self._show(found.x)
        for contact in self.contacts:
            contact.advance()
        if max(record.error, record.slip_error, record.forward_error) > self.tol:
            warnings.warn(
                f"double precision allows no smaller error here: error {record.error:.1e}, slip error "
                f"{record.slip_error:.1e}, forward error {record.forward_error:.1e}, rounding {record.rounding:.1e}, "
                f"tol {self.tol:.1e}.",
                RoundingWarning,
                stacklevel=2,
            )
        return record

    def save(self, path) -> None:
        """Write a checkpoint: all that the next step starts from, of all ranks, in one file.

        The file is replaced in one go, so a run that is killed leaves the last one whole.  Collective.

        Args:
            path: File name, usually ending in ``.npz``.
        """
        checkpoint.save(self, path)

    def load(self, path) -> None:
        """Continue from a checkpoint of the same problem, on any number of ranks.  Collective.

        On one rank the steps that follow have the same bits as without the interruption.  On several
        ranks MUMPS adds in the order in which messages arrive, and they agree to rounding.

        Raises:
            ValueError: the file is no checkpoint of this problem.
        """
        checkpoint.load(self, path)
        self._restore()

    def load_step(self) -> LoadStep:
        """The next step as solvers see it: present loads, boundary values and planes.  Collective.

        For solvers of one's own and for measurements; ``solve`` makes it for itself.
        """
        body = self.body
        assembled = body.refresh()
        if assembled != self._assembled:
            self._assembled = assembled
            self._unbind()
            self._set_stiffness()
        b, external = body.load()
        last, before = self._states
        starts = [self.u.x.array[: body.size].copy(), 2 * last - before]
        return LoadStep(
            body, self.contacts, self._stiffness, b, external, starts, self.tol, self._unit, self._watch
        )  # fmt: skip

    def bound(self):
        """The solver, bound to the body as it is now, see ``solver.py``.  Collective."""
        if self._bound_to is not self.solver:
            self._unbind()
            self._bound = self.solver.bind(self.body, self.contacts, self._stiffness, self._memory)
            self._bound_to = self.solver
        return self._bound

    def _search(self) -> tuple[LoadStep, SolverResult]:
        """A displacement that the solver takes for the solution, and the step that has judged it."""
        step = self.load_step()
        with stage("contact: elastic solve"):
            trial = self.body.free_state(step.b, rough=True)
            if not (self.body.known.exact or self._presses(trial)):
                trial = self.body.free_state(step.b)  # whether anything touches takes all digits
        if not self._may_touch(trial):
            trial = self._refined(step, trial)
            if step.errors.within(self.tol):
                return step, SolverResult(trial, 0, 0.0, NOTHING)
        with stage("contact: iterations"):
            found = self.bound().solve(step)
        step.measure(found.x)
        return step, found

    def _converged(self, errors, record: Step) -> bool:
        """Whether all errors are at most the tolerance, or nothing is left above rounding."""
        near = record.forward_error <= self.tol or errors.within(0.0)
        return near and errors.within(self.tol)

    def _refined(self, step: LoadStep, x: np.ndarray) -> np.ndarray:
        """The displacement without reactions, with another digit where what is left of ``b`` counts."""
        errors = step.measure_open(x)
        if errors.largest <= self.tol:
            return x
        finer = x + self.body.solve(step.b - self.body.multiply(x))
        if step.measure_open(finer).largest < errors.largest:
            return finer
        step.measure_open(x)
        return x

    def _unbind(self) -> None:
        """Forget what was set up for a stiffness that has changed.  Collective."""
        if self._bound is not None:
            self._bound.destroy()
        self._bound = self._bound_to = None

    @property
    def _watch(self):
        """The user's monitor with the statuses of all nodes; None costs nothing."""
        if self.monitor is None:
            return None
        return lambda iteration, error: self.monitor(iteration, error, self.counts())

    def _presses(self, trial: np.ndarray) -> bool:
        """Whether a displacement without reactions known to three digits penetrates a plane for certain."""
        deepest = 0.0
        for contact in self.contacts:
            contact.move(trial)
            deepest = max(deepest, -contact.gap.min(initial=0.0))
        deepest, largest = (self.body.largest(a) for a in (np.array([deepest]), np.abs(trial)))
        return deepest > CERTAIN * largest

    def _may_touch(self, trial: np.ndarray) -> bool:
        """Whether a displacement without reactions penetrates a plane by more than rounding."""
        deepest = 0.0
        for contact in self.contacts:
            contact.move(trial)
            deepest = max(deepest, (-contact.gap / contact.gap_rounding(trial)).max(initial=0.0))
        return self.body.largest(np.array([deepest])) > 1.0

    def _set_stiffness(self) -> None:
        """Take what errors and solvers want to know of the stiffness at the contact nodes."""
        body = self.body
        self._stiffness = [contact.nodal_stiffness(body.K) for contact in self.contacts]
        for contact, stiffness in zip(self.contacts, self._stiffness):
            contact.rho = stiffness.normal
        size = body.largest(np.abs(body.V.tabulate_dof_coordinates()))
        # Any unit of force that keeps squares within the range of double precision.
        self._unit = body.largest(body.cancelling(np.full(body.size, size))) or 1.0

    # -- helpers -------------------------------------------------------------------------------

    def _check_input(self) -> None:
        moved = np.concatenate([c.plane.displacement for c in self.contacts] + [np.zeros(0)])
        extremes = np.concatenate([moved, -moved])
        self.body.comm.Allreduce(MPI.IN_PLACE, extremes, op=MPI.MAX)
        with raised_together(self.body.comm):
            if not np.isfinite(self.u.x.array).all():
                raise ValueError(
                    "u contains NaN or infinity: it is the guess of this step, set it anew."
                )
            if not np.isfinite(moved).all():
                raise ValueError(f"plane.displacement must be finite, got {moved}.")
            if (extremes[: moved.size] != -extremes[moved.size :]).any():
                raise ValueError(f"plane.displacement differs between ranks: here {moved}.")

    def _record(self, step: LoadStep, found: SolverResult, seconds: float) -> Step:
        gap, penetration = 0.0, 0.0
        for contact in self.contacts:
            gap += contact.bipotential_gap.sum()
            penetration = max(penetration, -contact.gap.min(initial=0.0))
        return Step(
            error=step.errors.error,
            slip_error=step.errors.slip_error,
            rounding=step.errors.rounding,
            forward_error=found.forward_error,
            bipotential_gap=float(self.body.total(gap)),
            penetration=self.body.largest(np.array([penetration])),
            iterations=found.iterations,
            seconds=self.body.largest(np.array([seconds])),
            counts=self.counts(),
            solver=found.chosen,
            tried=found.tried,
        )

    def counts(self) -> Counts:
        """Contact nodes open, sticking and slipping in the present state.  Collective."""
        counts = sum(np.bincount(contact.status, minlength=3) for contact in self.contacts)
        return Counts(*(int(count) for count in self.body.total(counts + np.zeros(3))))

    def _show(self, x: np.ndarray) -> None:
        self.u.x.array[: self.body.size] = x
        self.u.x.scatter_forward()

    def _restore(self) -> None:
        self._show(self._states[0])
        for contact in self.contacts:
            contact.restore()


def _checked_contacts(contacts, u) -> list[Contact]:
    contacts = [contacts] if isinstance(contacts, Contact) else list(contacts)
    taken = np.zeros(0, dtype=np.int64)
    for contact in contacts:
        if not isinstance(contact, Contact):
            raise ValueError(
                f"contacts must hold dc.Contact objects, got {type(contact).__name__}."
            )
        if contact.V != u.function_space:
            raise ValueError(
                "a contact lives on another space or mesh than u: build it on u.function_space."
            )
        twice = np.intersect1d(taken, contact.nodes)
        if twice.size:
            raise ValueError(
                f"{twice.size} node(s) are in two contacts, the first at "
                f"{contact.x[np.searchsorted(contact.nodes, twice[0])].tolist()}: separate their facets."
            )
        taken = np.union1d(taken, contact.nodes)
    return contacts


def _checked_tolerance(tol) -> float:
    try:
        value = float(tol)
    except (TypeError, ValueError):
        value = np.nan
    if not 1e-13 <= value < np.inf:
        raise ValueError(
            f"tol must be a finite number of at least 1e-13 (rounding forbids less), got {tol!r}."
        )
    return value


def _held_directions(contact: Contact, fixed: np.ndarray) -> np.ndarray:
    """Tangential directions of the contact nodes that boundary conditions fix, ``shape=(n, gdim - 1)``."""
    left = contact.points.free_of(fixed)
    if (left[:, -1] < 1e-12).any():
        node = np.argmin(left[:, -1])
        raise ValueError(
            f"the normal displacement of the contact node at {contact.x[node].tolist()} is fixed by a "
            "boundary condition: contact and condition contradict each other, take the node out of one."
        )
    # What is left of each local direction without its fixed components: all, nothing, or a part.
    partly = (left > 1e-12) & (left < 1 - 1e-12)
    if partly.any():
        node = np.argmax(partly.any(axis=1))
        raise NotImplementedError(
            f"the contact node at {contact.x[node].tolist()} is held by a boundary condition along "
            "none of the axes of its contact: let plane.axis be along or across that direction."
        )
    return left[:, :-1] < 0.5
