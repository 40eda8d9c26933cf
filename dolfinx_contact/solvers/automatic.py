# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The default choice of a solver."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.contact.interface import components
from dolfinx_contact.solvers.base import ASTRAY, SolverResult

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.interface import NodalStiffness
    from dolfinx_contact.solvers.base import Solver
    from dolfinx_contact.step.load_step import LoadStep


# Largest number of multigrid solves for the condensed operator after the fixed point has failed: about a thousand cycles.
MOST_SOLVES = 100


def most_nodes(unknowns: int, friction: bool) -> int:
    """Largest number of contact nodes for which the condensed solver is tried first, see docs/solvers.md.

    Its time grows with the cube of the contact nodes, that of the fixed point with the unknowns.

    Args:
        unknowns: Unknowns of the body.
        friction: Whether any contact has friction.
    """
    equal, measured = 4e4, 1010
    return min(measured, round((equal * unknowns) ** (1 / 3))) if friction else measured


# The candidates, each imported when it is first used.


def _condensed() -> Solver:
    from dolfinx_contact.solvers.condensed.newton import CondensedNewton

    return CondensedNewton()


def _fixed_point() -> Solver:
    from dolfinx_contact.solvers.fixed_point.fixed_point import FixedPoint

    return FixedPoint()


def _linearised() -> Solver:
    from dolfinx_contact.solvers.newton.linearised import Linearised

    return Linearised(_fixed_point())


def _sparse() -> Solver:
    from dolfinx_contact.solvers.newton.sparse_newton import SparseNewton

    return SparseNewton()


class Automatic:
    """Newton's method on the condensed problem for small contacts, the fixed point for large ones.

    For nonlinear bodies, Newton's method on body and contact together; or, if linear systems are not factorised or planes are driven
    by force, the fixed point on the linearised body.  If the first choice fails, the other is tried; ``SolverResult.reason`` says so.
    """

    nonlinear = True

    def bind(
        self,
        body: ElasticBody,
        contacts: Sequence[Contact],
        stiffness: Sequence[NodalStiffness],
        memory: dict[str, Any],
    ):
        """See ``Solver``."""
        return BoundAutomatic(body, contacts, stiffness, memory)


class BoundAutomatic:
    """The candidate solvers for one body, each set up when it is first used."""

    def __init__(
        self,
        body: ElasticBody,
        contacts: Sequence[Contact],
        stiffness: Sequence[NodalStiffness],
        memory: dict[str, Any],
    ):
        self._arguments, self._bound = (body, contacts, stiffness, memory), {}
        if body.nonlinear:
            self._choose_nonlinear()
        else:
            self._choose_linear()

    def _choose_nonlinear(self) -> None:
        body, self._components = self._arguments[0], None
        self._solvers, self._why = [_linearised], "F is not linear in u"
        if body.factorised and not any(c.surface.free for c in self._arguments[1]):
            self._solvers.insert(0, _sparse)

    def _choose_linear(self) -> None:
        from dolfinx_contact.solvers.condensed.compliance import fits

        body, contacts, *_ = self._arguments
        nodes = body.comm.allreduce(sum(contact.points.count for contact in contacts))
        self._components = components(contacts)
        unknowns = body.K.getSize()[0]
        enough = fits(body.comm, nodes, self._components, unknowns)
        self._solvers = [_condensed, _fixed_point]
        most = most_nodes(unknowns, friction=self._components > 1)
        self._why = f"{nodes} contact nodes, up to {most} by CondensedNewton first"
        if nodes > most:
            self._why = f"{nodes} contact nodes, more than {most} by FixedPoint first"
            self._solvers.reverse()
        elif not body.exact:
            self._why = "without a factorisation the condensed operator would cost too many solves"
            self._solvers.reverse()
        elif not enough:
            self._why = f"the condensed operator of {nodes} contact nodes does not fit into memory"
            self._solvers.reverse()
        cheap = body.exact or body.crowded or self._components * nodes <= MOST_SOLVES
        if not (enough and cheap):
            self._solvers = self._solvers[:1]

    def destroy(self) -> None:
        """Free all solvers.  Collective."""
        for bound in self._bound.values():
            bound.destroy()

    def renew_rows(self, stiffness: Sequence[NodalStiffness]) -> bool:
        """See ``BoundSolver``."""
        self._arguments = (*self._arguments[:2], stiffness, self._arguments[3])
        self._keep(lambda bound: hasattr(bound, "renew_rows") and bound.renew_rows(stiffness))
        return bool(self._bound)

    def _keep(self, valid: Callable) -> None:
        """Of what is set up that which is still valid.  Collective."""
        for solver in list(self._bound):
            if not valid(self._bound[solver]):
                self._bound.pop(solver).destroy()

    def renew_law(self) -> bool:
        """See ``BoundSolver``."""
        self._keep(lambda bound: bound.renew_law())
        if self._components is None:  # nonlinear: the choice does not depend on friction
            return True
        return components(self._arguments[1]) == self._components

    def solve(self, step: LoadStep) -> SolverResult:
        """See ``BoundSolver``."""
        iterations, smallest, best, start, ended = 0, np.inf, None, None, []
        solvers = self._solvers
        # For bodies held by contact alone, the fixed point quickly solves cases that take Newton's fallbacks thousands of iterations.
        brief = step.statics is not None and solvers[0] is _condensed
        for solver in [solvers[0], *solvers[1:], solvers[0]] if brief else solvers:
            if solver not in self._bound:
                self._bound[solver] = solver().bind(*self._arguments)
            options = {"fallbacks": False} if brief and not ended else {}
            found = self._bound[solver].solve(step, start, **options)
            iterations += found.iterations
            errors = step.measure(found.x)
            ended.append((found, f"{found.solver} ended at {errors.largest:.1e}"))
            near = found.forward_error <= max(step.tol, errors.rounding)
            # An open state may be one that Newton's method strayed to, away from a pressed one: the fixed point decides.
            strayed = brief and not errors.acts and (len(ended) == 1 or not near)
            done = errors.within(step.tol if near else 0.0) and not strayed
            # Without acting forces, relative errors cannot be compared.
            size = errors.largest if errors.acts else np.inf
            if best is None or done or size < smallest:
                smallest, best = size, found
                # far from a solution, the state is no better than the other solver's own start
                start = found.x if smallest <= ASTRAY else None
            if done:
                break
            if not options and step.slides():
                break
        said = [self._why, best.reason, *(how for other, how in ended if other is not best)]
        return best._replace(iterations=iterations, reason="; ".join(filter(None, said)))
