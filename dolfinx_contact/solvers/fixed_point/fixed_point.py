# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Fixed-point iteration on the displacement with predictor, corrector and Anderson acceleration."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.law.maps import BipotentialMap, ReturnMap
from dolfinx_contact.solvers.base import BoundSolver, Solver, SolverName, SolverResult
from dolfinx_contact.solvers.fixed_point.preconditioner import ContactPreconditioner
from dolfinx_contact.solvers.search import Search
from dolfinx_contact.support.anderson import Anderson
from dolfinx_contact.support.checks import positive

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import LoadStep, StepState

# Augmentation parameters relative to the nodal normal stiffness, tried in this order.  The first
# ones needed the fewest iterations on the reference paper's punch.  The paper's map weights slip by
# Q^2, which a larger rho compensates.
RHO_FACTORS = {"bipotential": (3.0, 1.0, 10.0), "return": (1.0, 3.0, 0.3)}

# The contact is linearised every TANGENT_INTERVAL iterations: by then, most nodes have their final
# status, and easy steps are nearly solved.  If the error then grows by a factor above
# LARGEST_GROWTH, the tangent came too early, and the search continues from its best state without a
# tangent.  The limit is multiplied by LARGEST_GROWTH each time; with an unchanged limit, the same
# iterations would repeat forever.  If a tangent does not reduce the error below USELESS_TANGENT
# times its value before the next one is due, the following interval uses no tangent. If the error
# at the start is below NEAR_ERROR, as in a repeated step, most nodes have their final status: the
# contact is linearised at once, and the tangent is dropped as soon as the error grows.
TANGENT_INTERVAL = 20
LARGEST_GROWTH = 30.0
USELESS_TANGENT = 0.9
NEAR_ERROR = 0.1

# Iterations within which the error must halve; otherwise the next attempt begins.
HALVING_ITERATIONS = 60

# Further attempts: iterations between tangents, and the start.  The start is the start of the load
# step, the solution under half of the load increment, or the best state after resetting the slip of
# the nodes whose violation of the contact law exceeds this part of the largest one: with their
# present slip there may be no solution nearby.
FROM_START = "from the start"
HALF_WAY = "half the way"
FURTHER_ATTEMPTS = (
    (TANGENT_INTERVAL, FROM_START),
    (TANGENT_INTERVAL, HALF_WAY),
    (TANGENT_INTERVAL, 0.5),
    (TANGENT_INTERVAL, 0.05),
    (TANGENT_INTERVAL // 2, 0.05),
)

# If the norm of the correction grows by this factor, Anderson's method is restarted from the best
# state.
ASTRAY_GROWTH = 1e3


@dataclass(frozen=True)
class FixedPoint(Solver):
    """Fixed-point iteration with predictor and corrector, without a condensed operator.

    An iteration computes the reactions required for equilibrium, ``K u - f`` at the contact nodes,
    and applies predictor and projection on the friction cone [dSFMH07, Section 2].  The new
    reactions enter the residual, and one back-solve with the stiffness plus springs at the contact
    nodes corrects the displacement.  Anderson's method accelerates the iteration.  Every twenty
    iterations, the contact is linearised.  With this tangent, the near-contact subdomain is
    corrected before the back-solve, see ``SurfaceLayer``, unless the last tangent did not help.

    If the error does not halve within sixty iterations, further attempts begin: from the start of
    the step, from the solution under half of the load increment, then from the best state after
    resetting the slip of the nodes that violate the contact law most; finally with tangents twice
    as often.  If they also fail, the fixed point continues with another ``rho``.  The solution does
    not depend on ``rho``.  ``step.reason`` lists the attempts.

    Attributes:
        map: "return", the return map, or "bipotential", the reference paper's predictor and
            Euclidean projection, see ``Contact.update``.  Both have the same solutions; with
            strongly non-associated friction, "return" needs fewer iterations.
        rho: Augmentation parameter relative to the nodal normal stiffness.  None tries the values
            of a short list until one converges, at the cost of one factorisation per value.
        depth: Number of previous corrections that Anderson's method combines.
        max_iterations: Iteration limit of each attempt.
        max_seconds: Wall time after which the search ends, seconds; infinite by default.

    Raises:
        ValueError: ``map`` is unknown, or ``rho``, ``depth`` or a limit is not positive.

    Example:
        >>> solver = dc.FixedPoint(max_iterations=2000)  # for ContactProblem(..., solver=solver)
    """

    map: str = "return"
    rho: float | None = None
    depth: int = 20
    max_iterations: int = 400
    max_seconds: float = math.inf

    def __post_init__(self) -> None:
        if self.map not in RHO_FACTORS:
            raise ValueError(f"map must be one of {', '.join(RHO_FACTORS)}, got {self.map!r}.")
        if self.rho is not None:
            positive("rho", self.rho, finite=True)
        positive("depth", self.depth, whole=True)
        positive("max_iterations", self.max_iterations, whole=True)
        positive("max_seconds", self.max_seconds)

    def bind(self, step: LoadStep) -> BoundSolver:
        """See ``Solver``."""
        return BoundFixedPoint(self, step)


def _slides(state: StepState, tried: bool = False) -> bool:
    """Whether the force on a driven surface exceeds the frictional resistance in this state.
    Collective.

    Args:
        state: The state.
        tried: Whether all attempts failed; then the loads on a body held by contact alone are
            checked, too.
    """
    step = state.step
    if step.surfaces is None and not (tried and step.statics is not None):
        return False
    state = step.measure(state.x, before=state)
    return step.slides(state) if tried else step.pushed_off(state)


def half_step(step: LoadStep) -> LoadStep:
    """Return the load step with half of the increment of its loads and boundary values.

    Its solution serves as a start for the full step.  The tolerance is zero, because errors
    measured with the form F would refer to the full loads.
    """
    last, fixed, reactions = step.last, step.body.fixed, np.zeros_like(step.b)
    for contact in step.contacts:
        contact.points.add_forces(contact.last.reaction, reactions)
    b = 0.5 * (step.b + step.body.multiply(last) - reactions)
    b[fixed] = 0.5 * (step.b + last)[fixed]
    return step.replaced(b=b, tol=0.0, starts=(last,))


class BoundFixedPoint(BoundSolver):
    """The fixed-point solver, set up for the load steps of one problem.

    It keeps the preconditioner for the ``rho`` used last.
    """

    def __init__(self, options: FixedPoint, step: LoadStep):
        self._options, self._stamps = options, step.stamps
        self.preconditioner: ContactPreconditioner | None = None
        self._factor = 0.0

    def close(self) -> None:
        """Free the preconditioner.  Collective."""
        if self.preconditioner is not None:
            self.preconditioner.destroy()
        self.preconditioner, self._factor = None, 0.0

    def update(self, step: LoadStep) -> None:
        """Discard the preconditioner if stiffness, frames or friction changed too much.
        Collective.

        If only the frames of contact nodes changed within a step, the springs are kept, unless
        motions of driven surfaces or of anchors are part of the preconditioner.
        """
        new, old, self._stamps = step.stamps, self._stamps, step.stamps
        if self.preconditioner is None:
            return
        stale = new.stiffness != old.stiffness or new.parts != old.parts
        if new.rows != old.rows:
            stale = stale or new.step != old.step or self.preconditioner.followed
        if stale or (new.law != old.law and not self.preconditioner.same_springs(step.contacts)):
            self.close()

    def solve(
        self, step: LoadStep, starts: Sequence[Any] = (), start: StepState | None = None
    ) -> SolverResult:
        """Iterate until the errors are at most the tolerance or all attempts failed.

        Returns the best state.

        Args:
            step: The load step.
            starts: Not used.
            start: The initial state; None takes ``step.start()``.
        """
        start = step.start() if start is None else start
        search, attempts = Search(step, start, self._options.max_seconds), []
        where = start.x, start.c
        start = None  # to save memory: at most three states are kept
        for name, factor, every in self._attempts(search, *where):
            attempts.append(f"{name} ({search.iterations})")
            self._fall(search, factor, every)
            if search.over or _slides(search.best):
                break
        found = search.best, search.iterations, search.forward_error, SolverName.FIXED_POINT
        if not search.within and search.strayed is not None:
            found = search.strayed.judged, search.iterations, 0.0, SolverName.FIXED_POINT
        message = []
        if not search.within and not _slides(search.best, tried=True):
            from dolfinx_contact.solvers.fixed_point.put_back import wrong
            from dolfinx_contact.step.stalled import stalled

            message += stalled(step.body, step.contacts, search.changes, wrong(search.best))
        if len(attempts) > 1:
            message.append(f"attempts, begun after so many iterations: {', '.join(attempts)}")
        return SolverResult(*found, reason="; ".join(message))

    def _attempts(
        self, search: Search, x: np.ndarray, c: np.ndarray
    ) -> Iterator[tuple[str, float, int]]:
        """Begin one attempt after another and yield its settings.  Collective.

        Args:
            search: The ``Search``.
            x: Displacement at the start of the load step.
            c: Motions of driven surfaces at the start of the load step.

        Yields:
            Name of the attempt, ``rho`` relative to the nodal stiffness, and iterations between
            tangents.
        """
        options, step = self._options, search.step

        def begin(state: StepState) -> None:
            search.begin(state, options.max_iterations, HALVING_ITERATIONS)

        again = FURTHER_ATTEMPTS if options.max_iterations > TANGENT_INTERVAL else ()
        for factor in RHO_FACTORS[options.map] if options.rho is None else (options.rho,):
            begin(search.best)
            yield f"rho {factor:g}", factor, TANGENT_INTERVAL
            if self.preconditioner.add_soft_motions():
                begin(search.best)
                yield "soft motions", factor, TANGENT_INTERVAL
            for every, where in again:
                if where == FROM_START:
                    begin(step.evaluate(x, step.error_maps, c=c).as_start)
                elif where == HALF_WAY:
                    begin(self._half_way(search, factor))
                else:
                    from dolfinx_contact.solvers.fixed_point.put_back import put_back

                    begin(put_back(search.best, where))
                yield where if where in (FROM_START, HALF_WAY) else "nodes put back", factor, every
            if _slides(search.best, tried=True):
                return

    def _half_way(self, search: Search, factor: float) -> StepState:
        """Approximate solution under half of the load increment, with full boundary values.
        Collective."""
        step, half = search.step, half_step(search.step)
        other = Search(half, half.start(), self._options.max_seconds)
        other.begin(
            other.best, min(2 * TANGENT_INTERVAL, self._options.max_iterations), HALVING_ITERATIONS
        )
        self._fall(other, factor, TANGENT_INTERVAL)
        search.count(other.iterations)
        x = other.nearest.x.copy()
        x[step.body.fixed] = step.b[step.body.fixed]
        return step.evaluate(x, step.error_maps, c=other.nearest.c)

    def _fall(self, search: Search, factor: float, every: int) -> None:
        """Iterate with Anderson acceleration and one ``rho`` until the present attempt ends.

        The contact is linearised every ``every`` iterations, and at once if the error is small.  If
        the error has grown too much since the last tangent, the iteration restarts from the best
        state of the attempt.
        """
        step, first = search.step, search.iterations == 0
        near, growth, anderson = (
            NEAR_ERROR if first and step.contacts else 0.0,
            LARGEST_GROWTH,
            None,
        )
        while search.goes_on:
            if anderson is None:
                known = step.continues and search.iterations == 0
                maps = self._set_up_maps(step, factor, known)
                near = 0.0 if known and self.preconditioner.linearised else near
                x, before = search.nearest.x, search.nearest.as_start
                anderson = Anderson(x.size, self._options.depth, step.total)
                tangent = smallest = np.inf  # error at the last tangent; smallest correction
                due, limit = search.left - every, growth
            x, forces, c = self.preconditioner.rigid.balanced(x, step, maps, before)
            state = step.evaluate(x, maps, forces=forces, c=c, before=before)
            before = search.see(state)
            if not search.goes_on:
                return
            if search.error > limit * tangent:
                near, growth, anderson = 0.0, LARGEST_GROWTH * growth, None
                continue
            if search.left <= due or search.error < near:
                search.error = before.errors.largest
            if search.left <= due or search.error < near:
                limit = growth if near == 0.0 else 1.0  # an early tangent may not raise the error
                due, near = search.left - every, 0.0
                useless = search.error > USELESS_TANGENT * tangent
                # keep a tangent that reduced the error by more than the reduction still needed
                if useless or tangent == np.inf or search.error**2 > step.tol * tangent:
                    self.preconditioner.use_springs_only()
                    if not useless:
                        self.preconditioner.linearise(step, step.derivatives(state, maps))
                    anderson.restart()
                    smallest = np.inf
                tangent = np.inf if useless else search.error
            following, norm = anderson.step(x, self.preconditioner.correct(state.residual))
            search.count(1)
            if norm > ASTRAY_GROWTH * smallest:  # restart from the best state
                anderson.restart()
                following, smallest = search.nearest.x, np.inf
            smallest = min(smallest, norm)
            x = following

    def _set_up_maps(self, step: LoadStep, factor: float, known: bool) -> list:
        """Return the nodal maps for an augmentation parameter and set up their preconditioner.

        Args:
            step: The load step.
            factor: Augmentation parameter relative to the nodal normal stiffness.
            known: Whether to keep the last tangent of the preconditioner.
        """
        bipotential = self._options.map == "bipotential"
        parameters = [factor * contact.stiffness.normal for contact in step.contacts]
        maps = [BipotentialMap(rho) if bipotential else ReturnMap(rho, rho) for rho in parameters]
        if self._factor != factor:
            self.close()  # one factorisation at a time: memory counts more than time
            self.preconditioner = ContactPreconditioner(step, maps)
            self._factor = factor
        if not known:
            self.preconditioner.use_springs_only()
        return maps
