# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Record of a load step, and the exception and warnings for steps that are not accurate enough."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from mpi4py import MPI

from dolfinx_contact.support.checks import ROUNDING_FACTOR, RoundingWarning

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.solvers.base import SolverResult
    from dolfinx_contact.step.errors import Errors
    from dolfinx_contact.step.load_step import StepState

# Ratio of the error, relative to the reactions alone, to the tolerance above which a warning is
# given.
WORSE_THAN_TOLERANCE = 1e3

# Parts of error messages of steps that have no solution.
NO_SOLUTION = "there is no solution"
NOT_HELD = "a body leaves what held it"


class Counts(NamedTuple):
    """Number of contact nodes by status, over all ranks.

    Attributes:
        open, stick, slip: Number of open, sticking and slipping contact nodes.

    Example:
        >>> sum(step.counts)  # nodes of the contact
        25
    """

    open: int
    stick: int
    slip: int


@dataclass(frozen=True)
class Step:
    """Record of a load step, the same on all ranks.

    Attributes:
        error: Residual of equilibrium, contact law and non-penetration, relative to the acting
            forces; see docs/errors.md.
        slip_error: Residual of the slip rule, as a force relative to the acting forces; see
            docs/errors.md.
        rounding: Rounding error of ``error`` and ``slip_error`` in double precision.  If it exceeds
            the tolerance, it replaces the tolerance.
        forward_error: Estimated error of the reactions, relative to the acting forces, from the
            last correction of the solver.
        contact_error: The largest of error, slip error and forward error, but relative to the
            reactions alone.  It is the accuracy of contact forces that are small compared with
            loads and support forces; 0 without reactions.
        bipotential_gap: Sum of ``contact.bipotential_gap`` over all nodes, >= 0, force times
            length.
        penetration: Largest penetration of contact nodes, >= 0, length.
        vertex_penetration: Largest penetration of facet nodes without reactions (the vertices of
            second-order tetrahedra), >= 0, length; 0 without such nodes, and with wear.
        geometry_error: Change of distances, normals, textures and lever arms between the
            linearised and the final position, as a force relative to the reactions, see
            docs/surfaces.md; 0 on flat planes that do not rotate, and with small sliding.
        iterations: Number of corrections by the solver; 0 if its initial guess (the contact-free
            solution, the last state or an extrapolation) already was the solution.
        seconds: Wall time of the step, seconds.
        counts: Number of open, sticking and slipping contact nodes.
        solver: Solver that found the state: a ``SolverName``, or the name of a user-defined solver.
        reason: Text: why this solver was chosen, if the user did not choose it; how other solvers
            failed; remarks of the solver.
        tried: Methods that the solver tried, in order, if it has several.

    Example:
        >>> step = problem.solve()
        >>> step.error <= 1e-8 and step.counts.open == 0
        True
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
    tried: tuple[Any, ...] = ()
    contact_error: float = 0.0
    geometry_error: float = 0.0
    vertex_penetration: float = 0.0
    reason: str = ""

    def __str__(self) -> str:
        """Return errors, number of iterations and number of nodes by status as one line of text."""
        return (
            f"error {_error_text(self.error)}, slip error {_error_text(self.slip_error)}, forward error {_error_text(self.forward_error)}, "
            f"rounding {self.rounding:.1e}, after {self.iterations} iterations ({self.counts.open} open, "
            f"{self.counts.stick} sticking, {self.counts.slip} slipping nodes)"
        )


def _error_text(error: float) -> str:
    """Return an error as text: the number, or "unknown" if it is not finite."""
    return f"{error:.3e}" if np.isfinite(error) else "unknown"


def named(step: Step) -> str:
    """Return the name of the solver of a step, followed by the reason if there is one, as text."""
    return f"{step.solver}: {step.reason}" if step.reason else str(step.solver)


class NotConverged(RuntimeError):
    """A load step did not converge to its tolerance; the problem keeps its last converged state.

    Attributes:
        step: Record of the step that did not converge, including the methods that were tried.
        displacement: Displacement of the best iterate, owned degrees of freedom; not a solution.
        reactions: Reactions of each contact at the best iterate, a list of arrays
            ``shape=(n, gdim)``, local frame, force units.

    Example:
        >>> try:
        ...     step = problem.solve()
        ... except dc.NotConverged as failure:
        ...     print(failure.step.error, failure.step.tried)
    """

    def __init__(
        self, message: str, step: Step, displacement: np.ndarray, reactions: list[np.ndarray]
    ) -> None:
        super().__init__(message)
        self.step, self.displacement, self.reactions = step, displacement, reactions

    def __reduce__(self) -> tuple:
        # By default, pickle keeps only the message of an exception, and could not call
        # ``__init__``.
        return type(self), (str(self), self.step, self.displacement, self.reactions)


def count_statuses(body: ElasticBody, nodes: Sequence[Any]) -> Counts:
    """Return the number of open, sticking and slipping contact nodes over all ranks.  Collective.

    Args:
        body: The body, for its communicator.
        nodes: Contacts or contact states, which have an attribute ``status``.
    """
    here = sum(np.bincount(state.status, minlength=3) for state in nodes)
    return Counts(*(int(count) for count in body.total(here + np.zeros(3))))


def record(
    state: StepState, found: SolverResult, seconds: float, geometry_error: float = 0.0
) -> Step:
    """Return the record of a load step.  Collective.

    Args:
        state: State at the end of the step, whose errors are computed from the residual form.
        found: Result of the solver.
        seconds: Wall time of the step on this rank, seconds.
        geometry_error: Error of the linearised surface geometry, see ``Step``.
    """
    step, errors = state.step, state.errors
    gap, penetration, of_vertices = 0.0, 0.0, 0.0
    for contact, nodes in zip(step.contacts, state.nodes):
        given = contact.given
        if given.displacements.degree > 1 and given.wear is None:
            of_vertices = max(of_vertices, _vertex_penetration(given, state.x))
        gap += contact.bipotential_gap(nodes).sum()
        penetration = max(penetration, -nodes.gap.min(initial=0.0))
    largest = step.body.largest
    return Step(
        error=errors.error,
        slip_error=errors.slip_error,
        rounding=errors.rounding,
        # without acting forces, it has no scale
        forward_error=found.forward_error if errors.acts else errors.largest,
        bipotential_gap=float(step.total(gap)),
        penetration=largest(np.array([penetration])),
        iterations=found.iterations,
        seconds=largest(np.array([seconds])),
        counts=step.counts(state),
        solver=found.solver,
        tried=found.tried,
        contact_error=errors.of_contact(found.forward_error),
        geometry_error=geometry_error,
        vertex_penetration=of_vertices,
        reason=found.reason,
    )


def converged(errors: Errors, step: Step, tol: float) -> bool:
    """Return whether all errors of a step are at most the tolerance, or at the rounding level.

    Args:
        errors: Errors of equilibrium and of the slip rule.
        step: Record of the step, which has the forward error.
        tol: Tolerance, relative to the acting forces.
    """
    near = step.forward_error <= tol or errors.within(0.0)
    return near and errors.within(tol)


def warn_of_rounding(step: Step, tol: float) -> None:
    """Warn if errors of a step exceed the tolerance, since rounding prevents smaller ones.

    The warning points to the line that called ``solve``.
    """
    if max(step.error, step.slip_error, step.forward_error) > tol:
        warnings.warn(
            f"double precision allows no smaller error here than at present, tol is {tol:.1e}: {step}.",
            RoundingWarning,
            stacklevel=3,
        )


def warn_of_inaccurate_reactions(step: Step, tol: float) -> None:
    """Warn if the reactions are much less accurate than the tolerance.

    There is no warning if rounding dominates the errors, since a smaller tolerance would not help.
    The warning points to the line that called ``solve``.
    """
    left = max(step.error, step.slip_error, step.forward_error)
    known = max(tol, left)  # if ``left`` exceeds tol, ``warn_of_rounding`` warns
    if (
        WORSE_THAN_TOLERANCE * known < step.contact_error < np.inf
        and left > ROUNDING_FACTOR * step.rounding
    ):
        warnings.warn(
            f"contact carries {left / step.contact_error:.1e} of the forces that act: its own may be off by {step.contact_error:.1e}, "
            f"more than {WORSE_THAN_TOLERANCE:g} times tol = {tol:.1e}. For accurate ones set problem.tol to {max(tol * tol / step.contact_error, 1e-13):.0e}.",
            stacklevel=3,
        )


def _vertex_penetration(contact: Contact, u: np.ndarray) -> float:
    """Return the largest penetration of facet nodes without reactions, >= 0, length.  Collective.

    Args:
        contact: The contact.
        u: Displacement, owned degrees of freedom.
    """
    displacements = contact.displacements
    here = displacements.rows(u)[contact.left_out]
    gaps = contact.geometry.distances(displacements.x[contact.left_out, : displacements.dim] + here)
    return max(0.0, -contact.comm.allreduce(float(gaps.min(initial=0.0)), op=MPI.MIN))
