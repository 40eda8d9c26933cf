# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The interface of solvers.

A ``Solver`` holds options.  Its method ``bind(step)`` returns a ``BoundSolver``, which solves the
load steps of one problem and owns the matrices and factorisations it sets up.  Before each
solution, the problem calls ``update(step)``, so that the bound solver can discard data that are out
of date.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dolfinx_contact.step.load_step import LoadStep, StepState

# Relative error above which a state is too far from a solution to serve as another solver's start.
ASTRAY_ERROR = 1e-3

# Number of earlier steps whose start data a problem keeps: more than most load cycles have steps.
KEPT_STARTS = 64


class SolverName(str, Enum):
    """Name of one of this package's solvers, as ``step.solver`` records it.

    ``NONE`` means that no solver ran: the contact-free solution solved the step.

    Example:
        >>> step.solver == dc.SolverName.CONDENSED_NEWTON  # equal to "CondensedNewton", too
        True
    """

    CONDENSED_NEWTON = "CondensedNewton"
    FIXED_POINT = "FixedPoint"
    SPARSE_NEWTON = "SparseNewton"
    SNES = "SNES"
    NONE = "none"

    __str__ = str.__str__  # the same text on every Python version
    __format__ = str.__format__


class SolverResult(NamedTuple):
    """Result of a solver for one load step; the problem decides whether to accept it.

    Attributes:
        state: The best state found, as returned by ``step.evaluate`` or ``step.measure``.
        iterations: Number of iterations of the solver.
        forward_error: Estimated error of the reactions, relative to the acting forces.
        solver: A ``SolverName``, or the name of your own solver.
        tried: Methods that were tried, in order, if the solver has several.
        reason: Text: why this solver was chosen, if the user did not choose, and the solver's
            remarks.
        start: Data that the solver will receive among the ``starts`` of later steps; None if it
            needs no data.
    """

    state: StepState
    iterations: int
    forward_error: float
    solver: str
    tried: tuple = ()
    reason: str = ""
    start: Any = None


class BoundSolver(ABC):
    """Base class of solvers that are set up for the load steps of one problem."""

    def update(self, step: LoadStep) -> None:  # noqa: B027 (may be left out)
        """Discard the set-up data that ``step.stamps`` shows to be out of date.  Collective.

        The base class keeps no such data.
        """

    @abstractmethod
    def solve(self, step: LoadStep, starts: Sequence[Any]) -> SolverResult:
        """Search for a state whose errors are at most ``step.tol``; return the best one found.
        Collective.

        Args:
            step: The load step.
            starts: The ``SolverResult.start`` of earlier steps, at most ``KEPT_STARTS`` of them,
                the latest one last.
        """

    def close(self) -> None:  # noqa: B027
        """Free the solver's PETSc objects; the base class has none.  Collective."""


class Solver(ABC):
    """Base class of solver options; one object may serve several problems.

    Attributes:
        nonlinear: Whether the solver handles a residual that is a non-linear function of the
            displacement.  If not, it receives a sequence of linearised load steps instead.
    """

    nonlinear: ClassVar[bool] = False

    @abstractmethod
    def bind(self, step: LoadStep) -> BoundSolver:
        """Return a ``BoundSolver`` with these options, set up for the problem of a load step.
        Collective."""
