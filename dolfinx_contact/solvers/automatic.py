# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The default solver: it chooses a method by the size and kind of the problem."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.contact.contact_step import components
from dolfinx_contact.solvers.base import ASTRAY_ERROR, BoundSolver, Solver, SolverResult

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import LoadStep


# If linear systems are solved by multigrid, the condensed operator needs one solve per column.  Up
# to this number of solves (about a thousand multigrid cycles), it is tried after the fixed point
# failed.
MOST_SOLVES = 100


def most_nodes(unknowns: int, friction: bool) -> int:
    """Largest number of contact nodes for which the condensed solver is tried first.

    The time of the condensed solver grows with the cube of the number of contact nodes, the time of
    the fixed point in proportion to the number of unknowns; see docs/solvers.md.

    Args:
        unknowns: Number of degrees of freedom of the body.
        friction: Whether any contact has friction.
    """
    equal, measured = 4e4, 1010
    return min(measured, round((equal * unknowns) ** (1 / 3))) if friction else measured


# The candidate solvers; each module is imported when its solver is first used.


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


class Automatic(Solver):
    """Default solver: ``CondensedNewton`` for few contact nodes, ``FixedPoint`` for many.

    For non-linear bodies, it uses ``SparseNewton``, Newton's method on body and contact together.
    If linear systems are not factorised or surfaces are driven by force, it applies ``FixedPoint``
    to the linearised body.  If the first choice fails, the other solver is tried;
    ``SolverResult.reason`` records this.
    """

    nonlinear = True

    def bind(self, step: LoadStep) -> BoundAutomatic:
        """See ``Solver``."""
        return BoundAutomatic(step)


class BoundAutomatic(BoundSolver):
    """The default solver, set up for one problem; candidates are set up when first used."""

    def __init__(self, step: LoadStep):
        self._bound: dict[Callable, BoundSolver] = {}
        self._choose(step)

    def _choose(self, step: LoadStep) -> None:
        self._stamps, self._components = step.stamps, None
        if step.body.nonlinear:
            self._choose_nonlinear(step)
        else:
            self._choose_linear(step)

    def update(self, step: LoadStep) -> None:
        """Choose the candidate solvers anew if the problem has changed.

        This concerns stiffness, frames, surface motions and friction.  The candidates themselves
        are updated when they are next used.  Collective.
        """
        new, old, self._stamps = step.stamps, self._stamps, step.stamps
        rows = new.rows != old.rows and new.step != old.step
        if rows or new.stiffness != old.stiffness or new.parts != old.parts:
            self._choose(step)
            for solver in [one for one in self._bound if one is not self._solvers[0]]:
                self._bound.pop(solver).close()  # memory counts more than time
        elif self._components not in (None, components(step.contacts)):
            self._choose(step)  # with friction, another solver may be the faster one

    def _candidate(self, solver: Callable, step: LoadStep) -> BoundSolver:
        if solver in self._bound:
            self._bound[solver].update(step)
        else:
            self._bound[solver] = solver().bind(step)
        return self._bound[solver]

    def _choose_nonlinear(self, step: LoadStep) -> None:
        self._solvers, self._why = [_linearised], "F is not linear in u"
        if step.body.factorised and not any(c.surface.free for c in step.contacts):
            self._solvers.insert(0, _sparse)

    def _choose_linear(self, step: LoadStep) -> None:
        from dolfinx_contact.solvers.condensed.compliance import fits

        body, contacts = step.body, step.contacts
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
        cheap = body.exact or body.multigrid_is_faster or self._components * nodes <= MOST_SOLVES
        if not (enough and cheap):
            self._solvers = self._solvers[:1]

    def close(self) -> None:
        """Free all candidate solvers.  Collective."""
        for bound in self._bound.values():
            bound.close()

    def solve(self, step: LoadStep, starts: Sequence[Any]) -> SolverResult:
        """Apply candidate solvers until one reaches the tolerance; return the best result.

        Collective.
        """
        iterations, smallest, best, start, ended, kept = 0, np.inf, None, None, [], None
        solvers = self._solvers
        # For bodies held by contact alone, the fixed point quickly solves cases that take Newton's
        # fallbacks thousands of iterations.
        brief = step.statics is not None and solvers[0] is _condensed
        for solver in [solvers[0], *solvers[1:], solvers[0]] if brief else solvers:
            options = {"fallbacks": False} if brief and not ended else {}
            found = self._candidate(solver, step).solve(step, starts, start, **options)
            iterations += found.iterations
            found = found._replace(state=found.state.judged)
            errors, kept = found.state.errors, found.start or kept
            ended.append((found, f"{found.solver} ended at {errors.largest:.1e}"))
            near = found.forward_error <= max(step.tol, errors.rounding)
            # Newton's method may have left a state in contact for an open one: the fixed point
            # decides.
            strayed = brief and not errors.acts and (len(ended) == 1 or not near)
            done = errors.within(step.tol if near else 0.0) and not strayed
            # Without acting forces, relative errors cannot be compared.
            size = errors.largest if errors.acts else np.inf
            if best is None or done or size < smallest:
                smallest, best = size, found
                # far from a solution, the state is no better than the next solver's own start
                start = found.state if smallest <= ASTRAY_ERROR else None
            if done:
                break
            if not options and step.slides(found.state):
                break
        message = [self._why, best.reason, *(how for other, how in ended if other is not best)]
        message = "; ".join(filter(None, message))
        return best._replace(iterations=iterations, reason=message, start=kept)
