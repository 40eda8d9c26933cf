# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The interface of solvers.

A solver is an object with options and a method ``bind(body, contacts, stiffness, memory)``, which returns a ``BoundSolver``.  The
bound solver solves load steps.  It owns everything set up for the body's present stiffness, and is discarded when the stiffness changes.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.interface import NodalStiffness
    from dolfinx_contact.step.load_step import LoadStep

ASTRAY = 1e-3  # error above which it is not digits that miss, and the state is no start for another solver

KEPT = 64  # earlier steps in the memory of a problem: more than most load cycles have


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
    """What a solver found for a load step; the problem computes the errors and decides whether to accept it.

    Attributes:
        x: The best displacement found, owned degrees of freedom, length units.
        iterations: Iterations of the solver.
        forward_error: Estimated error of the reactions, relative to the acting forces.
        solver: A ``SolverName``, or the name of your own solver.
        tried: Methods that were tried, in order, if the solver has several.
        reason: In words: why this solver was chosen, if the user did not choose, and the solver's remarks.
    """

    x: np.ndarray
    iterations: int
    forward_error: float
    solver: str
    tried: tuple = ()
    reason: str = ""


class BoundSolver(Protocol):
    """A solver bound to a body and its contacts."""

    def solve(self, step: LoadStep) -> SolverResult:
        """Search for a displacement whose errors are at most ``step.tol``; return the best one found.  Collective."""

    def destroy(self) -> None:
        """Free PETSc objects.  Collective."""

    # Optional; without it, the solver is bound again when friction changes:
    # def renew_law(self) -> bool
    #     Take the present friction of the contacts; return whether the set-up is still valid.  Collective.
    # and when rows are renewed within a step, with the geometry of where it has ended:
    # def renew_rows(self, stiffness: Sequence[NodalStiffness]) -> bool
    #     The same for the present contact points.  Collective.


class Solver(Protocol):
    """Options of a solver; one object may serve several problems."""

    # Optional; without it, a step of a nonlinear body is passed to the solver as a sequence of linear ones:
    # nonlinear = True
    #     Whether the solver handles steps whose residual is a nonlinear function of the displacement.

    def bind(
        self,
        body: ElasticBody,
        contacts: Sequence[Contact],
        stiffness: Sequence[NodalStiffness],
        memory: dict[str, Any],
    ) -> BoundSolver:
        """Set up the solver for a body with its assembled stiffness.  Collective.

        Args:
            body: The body.
            contacts: Its contacts.
            stiffness: ``NodalStiffness`` of each contact.
            memory: Dictionary that outlives the bound solver.  ``memory["past"]`` is a deque of at most ``KEPT`` earlier steps, the
                starting points of the condensed solver; checkpoints contain it.

        Returns:
            A ``BoundSolver``.
        """
