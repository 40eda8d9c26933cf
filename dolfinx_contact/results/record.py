# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The record of a load step, and what is raised when it fails."""

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

# Times the tolerance that errors over the reactions alone may have without a word.
WORSE_THAN_TOLERANCE = 1e3

# Reasons of steps that have no solution, in words.
NO_SOLUTION = "there is no solution"
NOT_HELD = "a body leaves what held it"


class Counts(NamedTuple):
    """Number of contact nodes by status, over all ranks.

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
        error: Error of equilibrium, law and non-penetration, relative to the acting forces; see docs/errors.md.
        slip_error: Defect of the slip rule, as a force relative to the acting forces; see docs/errors.md.
        rounding: Rounding error of both in double precision; if it exceeds the tolerance, it replaces the tolerance.
        forward_error: Estimated error of the reactions, relative to the same forces, from the solver's last correction.
        contact_error: The largest of error, slip error and forward error, relative to the reactions alone: the accuracy of
            contact forces that are small compared with loads and support forces; 0 without reactions.
        bipotential_gap: Sum of ``contact.bipotential_gap`` over all nodes, >= 0, force times length.
        penetration: Largest penetration of contact nodes, >= 0, length.
        vertex_penetration: Largest penetration of facet nodes that carry no load, the vertices of second-order tetrahedra; 0
            without such nodes, and with wear.
        geometry_error: Change of distances, normals, textures and lever arms between the solution and its end position, as a
            force relative to the reactions, see docs/surfaces.md; 0 on flat planes that do not rotate, and with small sliding.
        iterations: Corrections by the solver; 0 if the contact-free solution, or the solver's initial state (the last step's, or
            its extrapolation), already was the solution.
        seconds: Wall time of the step.
        counts: Contact nodes open, sticking and slipping.
        solver: The solver that found the state: a ``SolverName``, or the name that your own solver gives.
        reason: In words: why this solver was chosen, if the user did not choose; how others ended; remarks of the solver.
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
        """One line: errors, iterations, nodes by status."""
        return (
            f"error {_message(self.error)}, slip error {_message(self.slip_error)}, forward error {_message(self.forward_error)}, "
            f"rounding {self.rounding:.1e}, after {self.iterations} iterations ({self.counts.open} open, "
            f"{self.counts.stick} sticking, {self.counts.slip} slipping nodes)"
        )


def _message(error: float) -> str:
    """A number; of what cannot be measured, as where rounding hides the loads on what has moved far away, that it cannot."""
    return f"{error:.3e}" if np.isfinite(error) else "unknown"


def named(step: Step) -> str:
    """Solver and reason of a step in words."""
    return f"{step.solver}: {step.reason}" if step.reason else str(step.solver)


class NotConverged(RuntimeError):
    """A step did not reach its tolerance; the problem keeps its last converged state.

    Attributes:
        step: Record of the step, with what was tried.
        displacement: The best state found, owned degrees of freedom; not a solution.
        reactions: Reactions of each contact in that state, a list of arrays ``shape=(n, gdim)``, local frame, force units.

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
        # An exception is taken apart into its message alone, and could not be put together on the other side.
        return type(self), (str(self), self.step, self.displacement, self.reactions)


def counts_of(body: ElasticBody, nodes: Sequence[Any]) -> Counts:
    """Contact nodes open, sticking and slipping, of the states of some contacts, or these themselves.  Collective."""
    here = sum(np.bincount(state.status, minlength=3) for state in nodes)
    return Counts(*(int(count) for count in body.total(here + np.zeros(3))))


def record(
    state: StepState, found: SolverResult, seconds: float, geometry_error: float = 0.0
) -> Step:
    """Record of a state.  Collective.

    Args:
        state: The state, judged by F itself.
        found: What the solver has found.
        seconds: That the step took on this rank.
        geometry_error: As ``Step`` has it.
    """
    step, errors = state.step, state.errors
    gap, penetration, of_vertices = 0.0, 0.0, 0.0
    for contact, nodes in zip(step.contacts, state.nodes):
        given = contact.given
        if given.displacements.degree > 1 and given.wear is None:
            of_vertices = max(of_vertices, _penetration_between(given, state.x))
        gap += contact.bipotential_gap(nodes).sum()
        penetration = max(penetration, -nodes.gap.min(initial=0.0))
    largest = step.body.largest
    return Step(
        error=errors.error,
        slip_error=errors.slip_error,
        rounding=errors.rounding,
        # where nothing acts it has no scale
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
    """Whether all errors are at most the tolerance, or nothing is left above rounding."""
    near = step.forward_error <= tol or errors.within(0.0)
    return near and errors.within(tol)


def warn_of_rounding(step: Step, tol: float) -> None:
    """Warn, in the name of who called ``solve``, of errors above the tolerance that rounding leaves."""
    if max(step.error, step.slip_error, step.forward_error) > tol:
        warnings.warn(
            f"double precision allows no smaller error here than at present, tol is {tol:.1e}: {step}.",
            RoundingWarning,
            stacklevel=3,
        )


def warn_of_contact(step: Step, tol: float) -> None:
    """Warn, in the name of who called ``solve``, of reactions far less accurate than the tolerance, if a smaller one would help."""
    left = max(step.error, step.slip_error, step.forward_error)
    known = max(tol, left)  # where that is more than tol, rounding is warned of
    if (
        WORSE_THAN_TOLERANCE * known < step.contact_error < np.inf
        and left > ROUNDING_FACTOR * step.rounding
    ):
        warnings.warn(
            f"contact carries {left / step.contact_error:.1e} of the forces that act: its own may be off by {step.contact_error:.1e}, "
            f"more than {WORSE_THAN_TOLERANCE:g} times tol = {tol:.1e}. For accurate ones set problem.tol to {max(tol * tol / step.contact_error, 1e-13):.0e}.",
            stacklevel=3,
        )


def _penetration_between(contact: Contact, u: np.ndarray) -> float:
    """Largest penetration of nodes of the facets that carry nothing, >= 0, length, at owned degrees of freedom.  Collective."""
    displacements = contact.displacements
    here = displacements.rows(u)[contact.left_out]
    gaps = contact.geometry.distances(displacements.x[contact.left_out, : displacements.dim] + here)
    return max(0.0, -contact.comm.allreduce(float(gaps.min(initial=0.0)), op=MPI.MIN))
