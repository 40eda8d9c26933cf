# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What a solver is: options that can be bound to a body and its contacts, and then solves load steps.

A solver is an object with options and ``bind(body, contacts, stiffness, memory)``, which returns a ``BoundSolver``.  That owns
everything set up for the body's present stiffness, and is thrown away when the stiffness changes.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dolfinx_contact.solvers.protocols import BodyLike, ContactLike, StepLike
    from dolfinx_contact.step.errors import NodalStiffness

KEPT = 64  # earlier steps in the memory of a problem: more than a cycle has


class SolverName(str, Enum):
    """The solvers of this package, as ``step.solver`` names them; ``NONE`` where there was nothing to solve.

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
    """What a solver found for a load step; the problem judges it.

    Attributes:
        x: Displacement of owned degrees of freedom, the best one found.
        iterations: Iterations of the solver.
        forward_error: Estimate of how far the reactions are from the exact ones, over the forces that act.
        solver: A ``SolverName``, or the name of another one.
        tried: Methods that were tried, in order, where the solver has more than one.
        reason: Why this solver, where the user did not choose it, and what it says of its way; in words.
    """

    x: np.ndarray
    iterations: int
    forward_error: float
    solver: str
    tried: tuple = ()
    reason: str = ""


class BoundSolver(Protocol):
    """A solver bound to a body and its contacts."""

    def solve(self, step: StepLike) -> SolverResult:
        """Search a displacement whose errors are at most ``step.tol``.  Collective."""

    def destroy(self) -> None:
        """Free what PETSc holds.  Collective."""

    # Optional, without it the solver is bound anew:
    # def renew_law(self) -> bool
    #     Take what the contacts' friction is now; whether what was set up is of use.  Collective.


class Solver(Protocol):
    """Options of a solver; one object may be used for many problems."""

    # Optional, without it steps of nonlinear bodies come as a sequence of linear ones:
    # nonlinear = True
    #     Whether it solves steps whose forces out of balance are no linear function of the displacement.

    def bind(
        self,
        body: BodyLike,
        contacts: Sequence[ContactLike],
        stiffness: Sequence[NodalStiffness],
        memory: dict[str, Any],
    ) -> BoundSolver:
        """Set up for a body with its assembled stiffness.  Collective.

        Args:
            body: The body.
            contacts: Its contacts.
            stiffness: ``NodalStiffness`` of each contact.
            memory: Dictionary that outlives the binding.  Its ``past``, a deque of at most ``KEPT`` earlier steps, from which
                the condensed solver starts, is saved in checkpoints.
        """
