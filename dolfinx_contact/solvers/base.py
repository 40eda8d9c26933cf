# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The interface of solvers.

A ``Solver`` is an object with options and a method ``bind(step)``, which returns a ``BoundSolver``.  The bound solver solves load steps of
one problem.  It owns what it has set up, and is told by ``update(step)``, before each solution, what has become another one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dolfinx_contact.step.load_step import LoadStep, StepState

ASTRAY_ERROR = 1e-3  # error above which it is not digits that miss, and the state is no start for another solver

KEPT_STARTS = 64  # earlier steps in the memory of a problem: more than most load cycles have


class SolverName(str, Enum):
    """Names of this package's solvers in ``step.solver``; ``NONE`` if the contact-free solution was the answer.

    Example:
        >>> step.solver == dc.SolverName.CONDENSED_NEWTON  # equal to "CondensedNewton", too
        True
    """

    CONDENSED_NEWTON = "CondensedNewton"
    FIXED_POINT = "FixedPoint"
    SPARSE_NEWTON = "SparseNewton"
    SNES = "SNES"
    NONE = "none"

    __str__ = str.__str__  # the plain word on every Python
    __format__ = str.__format__


class SolverResult(NamedTuple):
    """What a solver found for a load step; the problem decides whether to accept it.

    Attributes:
        state: The best state found, of ``step.evaluate`` or ``step.measure``.
        iterations: Iterations of the solver.
        forward_error: Estimated error of the reactions, relative to the acting forces.
        solver: A ``SolverName``, or the name of your own solver.
        tried: Methods that were tried, in order, if the solver has several.
        reason: In words: why this solver was chosen, if the user did not choose, and the solver's remarks.
        start: What the solver wants to have among the ``starts`` of later steps; None is nothing.
    """

    state: StepState
    iterations: int
    forward_error: float
    solver: str
    tried: tuple = ()
    reason: str = ""
    start: Any = None


class BoundSolver(ABC):
    """Base class of solvers that are bound to the steps of a problem."""

    def update(self, step: LoadStep) -> None:  # noqa: B027 (may be left out)
        """Keep of what is set up that which is valid for a step, see ``step.stamps``; here nothing is.  Collective."""

    @abstractmethod
    def solve(self, step: LoadStep, starts: Sequence[Any]) -> SolverResult:
        """Search for a state whose errors are at most ``step.tol``; return the best one found.  Collective.

        Args:
            step: The step.
            starts: What solvers have returned as ``start`` in earlier steps, at most ``KEPT``, the last one last.
        """

    def close(self) -> None:  # noqa: B027
        """Free PETSc objects; here there are none.  Collective."""


class Solver(ABC):
    """Base class of solvers' options; one object may serve several problems.

    Attributes:
        nonlinear: Whether the solver handles steps whose residual is a nonlinear function of the displacement; without it, it gets
            a sequence of linear ones.
    """

    nonlinear: ClassVar[bool] = False

    @abstractmethod
    def bind(self, step: LoadStep) -> BoundSolver:
        """The solver for steps like this one.  Collective."""
