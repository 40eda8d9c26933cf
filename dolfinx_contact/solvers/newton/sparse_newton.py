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

SOLVER_NAME = "SparseNewton"

# Augmentation parameters over the nodal stiffness, along the normal and along slip; the next one where steps get SHORT_STEP.
NORMAL_FACTOR = 10.0
TANGENTIAL_FACTORS = (1.0, 0.3, 0.1)
SHORT_STEP = 0.1

# Of the parameter along the normal: with so little predictors are the reactions that the body asks for.
TINY_FACTOR = 1e-12

# Of a step is taken the largest half, quarter, ... after which the residual is smaller than the largest of the last
# RESIDUALS_BEFORE ones; below SHORTEST_STEP there is none. Iterations in which the smallest error has to halve.
RESIDUALS_BEFORE = 5
SHORTEST_STEP = 2.0**-9
HALVING_ITERATIONS = 12


@dataclass(frozen=True)
class SparseNewton(Solver):
    """Newton's method on body and contact together: ``-F(u) + r(F(u), u) = 0``, with the nodal map r of the law, see docs/nonlinear.md.

    An iteration assembles the tangent of the body, replaces its rows at contact nodes with the derivatives of predictor and
    corrector, and factorises it (MUMPS).  Bodies that are linear in ``u`` are not assembled again.

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
    """The method for one body."""

    def solve(
        self, step: LoadStep, starts: Sequence[Any] = (), start: StepState | None = None
    ) -> SolverResult:
        """Iterate until the errors are at most the tolerance, or nothing helps any more.

        Args:
            step: The ``LoadStep``.
            starts: Not used.
            start: Where to begin; None asks the step.
        """
        state = step.start() if start is None else start
        search = Search(step, state, self._options.max_seconds)
        search.begin(search.best, self._options.max_iterations, HALVING_ITERATIONS)
        descent, self._seen = Descent(step, self._tangent, stands=start is None), state.as_start
        x, forces = state.x, state.forces
        state = start = None  # no more than three are kept
        for tangential in cycle(TANGENTIAL_FACTORS):
            parameters = [contact.stiffness.normal for contact in step.contacts]
            maps = [ReturnMap(NORMAL_FACTOR * rho, tangential * rho) for rho in parameters]
            try:
                with np.errstate(all="ignore"):  # a trial may turn elements inside out
                    x, forces = self._fall(search, descent, x, forces, maps)
            except LinearSolverError:
                break
            if not search.goes_on:
                break
        return SolverResult(
            search.best, search.iterations, search.forward_error, SolverName.SPARSE_NEWTON
        )

    def _fall(
        self,
        search: Search,
        descent: Descent,
        x: np.ndarray,
        forces: np.ndarray,
        maps: Sequence[ReturnMap],
    ) -> tuple[np.ndarray, np.ndarray]:
        """Steps with the same maps until the search ends or one gets short: displacement and forces of the last iterate."""
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
    """Steps of Newton's method, each no longer than it helps.

    Supports that are not where they should be are moved with the step: where ``d`` is missing, ``J d`` is part of the
    residual, and a step of length t leaves ``1 - t`` of it.
    """

    def __init__(self, step: LoadStep, tangent: ContactTangent, stands: bool):
        self._step, self._body, self._tangent = step, step.body, tangent
        self._stands = stands  # the body's tangent is good enough

    def begin(self, maps: Sequence[ReturnMap]) -> None:
        """With these maps from now on; the first step may lead to a larger residual: it finds who touches."""
        self._maps, self._sizes, self._free = maps, deque(maxlen=RESIDUALS_BEFORE), True

    def advance(self, state: StepState, chord: bool) -> tuple[StepState, float]:
        """The next iterate, and the part of the step that leads to it: 0 if none helps.

        Args:
            state: The iterate.
            chord: Whether the last tangent is good enough.
        """
        step, maps, x = self._step, self._maps, state.x
        if not chord or self._tangent.matrix is None:
            if self._body.nonlinear and not self._stands:
                self._body.linearise(x)
            maps = self._following(state) if self._stands else maps
            self._stands = False
            closing = self._closing(x, maps) if self._free else maps
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

    def _following(self, state: StepState) -> list:
        """Maps for which nodes under load stay pressed where their plane moves off: Newton's step closes their gaps.

        Let go, all would spring back at once. Where gaps close does not depend on the augmentation parameter ``rho``, as
        long as the predictor ``r - rho g`` is positive. With friction they are let go, along the plane, too: held, steps
        that turn back took more iterations.
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

    def _closing(self, x: np.ndarray, maps: Sequence[ReturnMap]) -> list:
        """Maps for which nodes that just touch do so under load: a body at rest on a plane is not to fall through."""
        both = zip(self._step.contacts, maps)
        return [_Closing(map, contact.gap_rounding(x)) for contact, map in both]


class _Closing(NamedTuple):
    """The derivatives of a map at smaller gaps."""

    map: ReturnMap
    depth: float  # length

    def linearised(self, law: NodalLaw, reaction: np.ndarray, gap: np.ndarray, slip: np.ndarray):
        return self.map.linearised(law, reaction, gap - self.depth, slip)
