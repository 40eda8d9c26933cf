# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Newton's method on body and contact together: one sparse factorisation an iteration."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from dolfinx_contact.law.maps import NodalLaw, ReturnMap
from dolfinx_contact.petsc.linear_solver import LinearSolverError
from dolfinx_contact.solvers.base import BoundSolver, Solver, SolverName, SolverResult
from dolfinx_contact.solvers.newton.contact_tangent import ContactTangent, OnTangent
from dolfinx_contact.solvers.search import Search
from dolfinx_contact.support.checks import positive
from dolfinx_contact.support.line_search import enough, halves

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import LoadStep, StepState


# Augmentation parameters relative to the nodal normal stiffness, for the normal and the tangential
# reactions.  If the line search takes less than SHORT_STEP of a Newton step, the next tangential
# one follows.
NORMAL_FACTOR = 10.0
TANGENTIAL_FACTORS = (1.0, 0.3, 0.1)
SHORT_STEP = 0.1

# Factor on the normal augmentation parameter.  With a parameter this small, the predictor equals
# the reaction required for equilibrium.
TINY_FACTOR = 1e-12

# Non-monotone line search: lengths 1, 1/2, 1/4, ... down to SHORTEST_STEP are tried until the
# residual falls below the largest of the last RESIDUALS_BEFORE residuals.
# The search ends if the smallest error does not halve within HALVING_ITERATIONS iterations.
RESIDUALS_BEFORE = 5
SHORTEST_STEP = 2.0**-9
HALVING_ITERATIONS = 12


@dataclass(frozen=True)
class SparseNewton(Solver):
    """Newton's method on body and contact together: ``-F(u) + r(F(u), u) = 0``.

    ``F`` is the residual form and ``r`` the nodal map (predictor and corrector) of the contact law,
    see docs/nonlinear.md.  An iteration assembles the tangent of the body, replaces its rows at
    contact nodes with the derivatives of predictor and corrector, and factorises it (MUMPS).  If
    ``F`` is linear in ``u``, the stiffness is not assembled again.

    Attributes:
        max_iterations: Iteration limit.
        max_seconds: Wall time after which the search ends, seconds; infinite by default.

    Raises:
        ValueError: a limit is not positive.

    Example:
        >>> solver = dc.SparseNewton()  # for ContactProblem(..., solver=solver)
    """

    nonlinear: ClassVar[bool] = True
    max_iterations: int = 60
    max_seconds: float = math.inf

    def __post_init__(self) -> None:
        positive("max_iterations", self.max_iterations, whole=True)
        positive("max_seconds", self.max_seconds)

    def bind(self, step: LoadStep) -> BoundSolver:
        """See ``Solver``."""
        return BoundSparseNewton(self, step)


class BoundSparseNewton(OnTangent):
    """Newton's method with a sparse factorisation, set up for the load steps of one problem."""

    def solve(
        self, step: LoadStep, starts: Sequence[Any] = (), start: StepState | None = None
    ) -> SolverResult:
        """Iterate until the errors are at most the tolerance or a limit is reached.

        Returns the best state.

        Args:
            step: The load step.
            starts: Not used.
            start: The initial state; None takes ``step.start()``.
        """
        state = step.start() if start is None else start
        search = Search(step, state, self._options.max_seconds)
        search.begin(search.best, self._options.max_iterations, HALVING_ITERATIONS)
        descent, self._seen = Descent(step, self._tangent, stands=start is None), state.as_start
        x, forces = state.x, state.forces
        state = start = None  # to save memory: at most three states are kept
        for tangential in cycle(TANGENTIAL_FACTORS):
            parameters = [contact.stiffness.normal for contact in step.contacts]
            maps = [ReturnMap(NORMAL_FACTOR * rho, tangential * rho) for rho in parameters]
            try:
                with np.errstate(all="ignore"):  # a trial displacement may invert elements
                    x, forces = self._iterate(search, descent, x, forces, maps)
            except LinearSolverError:
                break
            if not search.goes_on:
                break
        return SolverResult(
            search.best, search.iterations, search.forward_error, SolverName.SPARSE_NEWTON
        )

    def _iterate(
        self,
        search: Search,
        descent: Descent,
        x: np.ndarray,
        forces: np.ndarray,
        maps: Sequence[ReturnMap],
    ) -> tuple[np.ndarray, np.ndarray]:
        """Apply Newton steps with the same nodal maps until the search ends or a step is short.

        Returns:
            Displacement and forces of the last iterate.
        """
        descent.begin(maps)
        step = search.step
        while True:
            state = step.evaluate(x, maps, forces=forces, before=self._seen)
            if step.held(x):
                self._seen = search.see(state)
                if not search.goes_on:
                    return x, forces
            state, length = descent.advance(state, search.error <= step.tol)
            x, forces = state.x, state.forces
            search.count(1)
            if length < SHORT_STEP:
                return x, forces


class Descent:
    """Newton steps on body and contact, with a line search.

    Boundary values are imposed by the same steps.  If prescribed displacements still lack an
    increment ``d``, then ``J d`` is part of the residual, and a step of length ``t`` leaves ``(1 -
    t) J d`` of it.

    Args:
        step: The load step.
        tangent: The tangent matrix of body and contact.
        stands: Whether the first iteration reuses the body's present stiffness.
    """

    def __init__(self, step: LoadStep, tangent: ContactTangent, stands: bool):
        self._step, self._body, self._tangent = step, step.body, tangent
        self._stands = stands  # reuse the body's present stiffness in the first iteration

    def begin(self, maps: Sequence[ReturnMap]) -> None:
        """Set the nodal maps for the following steps and restart the line search.

        The first step may increase the residual, since it finds which nodes are in contact.
        """
        self._maps, self._sizes, self._free = maps, deque(maxlen=RESIDUALS_BEFORE), True

    def advance(self, state: StepState, chord: bool) -> tuple[StepState, float]:
        """Return the next iterate and the step length, relative to the full Newton step.

        If no length reduces the residual enough, the iterate itself and length 0 are returned.

        Args:
            state: The present iterate.
            chord: Whether to reuse the last tangent.
        """
        step, maps, x = self._step, self._maps, state.x
        if not chord or self._tangent.matrix is None:
            if self._body.nonlinear and not self._stands:
                self._body.linearise(x)
            maps = self._maps_keeping_contact(state) if self._stands else maps
            self._stands = False
            closing = self._maps_at_zero_gap(x, maps) if self._free else maps
            self._tangent.linearise(step.derivatives(state, closing))
        here = step.evaluate(x, maps, forces=state.forces, before=state)
        carried, missing = np.zeros_like(x), step.missing(x)
        if not step.held(x):
            carried = self._tangent.multiply(missing, self._body.carried(missing))
        dx = self._tangent.solve(here.residual - carried)
        dx[self._body.fixed] = missing[self._body.fixed]
        self._sizes.append(step.size(here.residual - carried))
        most, self._free = np.inf if self._free else max(self._sizes), False
        for length in halves(SHORTEST_STEP):
            following = x + length * dx
            if length == 1.0:
                following[self._body.fixed] = step.b[self._body.fixed]
            there = step.evaluate(following, self._maps, before=state)
            if step.size(there.residual - (1 - length) * carried) < enough(length) * most:
                return there, length
        return state, 0.0

    def _maps_keeping_contact(self, state: StepState) -> list:
        """Nodal maps that keep frictionless nodes in contact if their surface moves away.

        The Newton step then closes the gaps of these nodes; if they were open instead, all would
        spring back at once.  The normal parameter ``rho`` of such a node is reduced until its
        predictor ``r - rho g`` is positive; the solution of the linear system does not depend on
        ``rho``.  Nodes with friction keep their maps, since load reversals took more iterations
        otherwise.
        """
        asked = [ReturnMap(TINY_FACTOR * m.normal, m.tangential) for m in self._maps]
        state = self._step.evaluate(state.x, asked, forces=state.forces, before=state)
        maps = []
        for contact, nodes, map in zip(self._step.contacts, state.nodes, self._maps):
            pressed, gap = nodes.reaction[:, -1], nodes.gap
            off = (gap > 0.0) & (pressed > 0.0) & (pressed < 2 * map.normal * gap)
            off &= contact.friction.frictionless
            normal = np.where(off, 0.5 * pressed / np.where(off, gap, 1.0), map.normal)
            maps.append(ReturnMap(normal, map.tangential))
        return maps

    def _maps_at_zero_gap(self, x: np.ndarray, maps: Sequence[ReturnMap]) -> list:
        """Nodal maps whose derivatives count nodes at zero gap as nodes in contact.

        Otherwise a body that rests on a surface without pressure would pass through it.
        """
        both = zip(self._step.contacts, maps)
        return [_ShiftedMap(map, contact.gap_rounding(x)) for contact, map in both]


class _ShiftedMap(NamedTuple):
    """A nodal map whose derivatives are taken at gaps reduced by ``depth``."""

    map: ReturnMap
    depth: float  # length units

    def linearised(self, law: NodalLaw, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return self.map.linearised(law, reaction, gap - self.depth, slip)
