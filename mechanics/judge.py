# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A judge of contact states, written from the mechanics; it shares no definition with the package.

Signorini, Coulomb's cone and the slip rule are checked node by node, equilibrium from a dense stiffness, and reactions
against a tight solution (judge_solver.py).  Each defect is a force: a length counts by the stiffness of
its own node in its own direction.  All are compared with the forces that act in the judged state,
the largest Euclidean norm of reactions, external forces and forces of supports; the change of the reactions with
reactions and external forces alone, because supports of a long lever carry more than what they hold.

What double precision itself allows is estimated from the terms that cancel, taken off each defect and kept beside it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from mechanics.judge_law import law_defects, norm
from mechanics.judge_solver import (
    METRICS,
    ByCompliance,
    ByStiffness,
    equations,
    jacobian,
    newton,
    solved,
)

EPS = 4 * np.finfo(float).eps  # of each term that cancels: its factors and their sum are rounded
DEFECT, REACTIONS = 10.0, 1000.0  # bounds, times the tolerance
TIGHT = 1e-2  # of the tolerance: what is left of the law in a solution that is called tight
SAMPLES, MARGIN = 8, 10.0  # of rounding errors, and of the change of reactions that they make


@dataclass
class Verdict:
    """Defects as forces, what rounding allows of each, and the forces that act.

    Attributes:
        scale: Forces that act.
        contact_scale: Reactions or external forces, whichever are larger.
        defects: By name: equilibrium, supports, normal, cone, slip, reactions (infinite without a tight solution).
        allowances: By the same names.
        notes: What is wrong beyond numbers.
        from_scratch: Distance from a tight solution whose start the state had no part in, a force; None if none was found.
    """

    scale: float
    contact_scale: float
    defects: dict
    allowances: dict
    notes: list = field(default_factory=list)
    from_scratch: float | None = None

    def excess(self, name: str) -> float:
        """Defect beyond rounding over the forces that act."""
        over = self.defects[name] - self.allowances[name]
        scale = self.contact_scale if name == "reactions" else self.scale
        if np.isnan(over):
            return np.inf
        return 0.0 if over <= 0 else over / scale if scale > 0 else np.inf

    @property
    def error(self) -> float:
        """The largest of all but the reactions."""
        return max(self.errors)

    @property
    def errors(self) -> tuple[float, float]:
        """The largest of all but slips and reactions, and that of slips."""
        others = [self.excess(name) for name in self.defects if name not in ("slip", "reactions")]
        return max(others), self.excess("slip")

    @property
    def rounding(self) -> float:
        """The largest allowance of those, over the forces that act."""
        largest = max(value for name, value in self.allowances.items() if name != "reactions")
        return largest / self.scale if self.scale > 0 else 0.0

    @property
    def reactions(self) -> float:
        """Distance of the reactions from tight ones."""
        return self.excess("reactions")

    def accepts(self, tol: float) -> bool:
        good = self.error <= DEFECT * tol and self.reactions <= REACTIONS * tol
        return bool(good and not self.notes)


class Body:
    """Judges the steps of one body in contact with one plane.

    Args:
        K: Stiffness without boundary conditions, dense; ``K u - f`` is the force out of balance.
        contact: Degrees of freedom of the contact nodes, ``shape=(n, d)``; may be none.
        fixed: Degrees of freedom that boundary conditions hold.
        frame: Rows (t1, t2, n), global components.
        gap0: Gaps at rest, ``shape=(n,)``.
        reach: Size of the terms that add up to ``gap0``, for its rounding.
        mu, p: Coefficients of the law, ``shape=(d - 1,)``; mu zero without friction.
    """

    def __init__(self, K, contact, fixed, frame, gap0, reach, mu, p):
        self.frame, self.gap0, self.reach = frame, np.asarray(gap0, float), reach
        self.mu, self.p, self.contact = np.asarray(mu, float), np.asarray(p, float), contact
        self.fixed = np.unique(np.asarray(fixed, dtype=int))
        self.free = np.setdiff1d(np.arange(len(K)), self.fixed)
        self.relation = ByStiffness(K, contact, self.fixed, frame)
        self.diagonal = np.abs(np.diag(K))
        self.blocks = np.zeros((len(contact), *frame.shape))
        for block, dofs in zip(self.blocks, contact):
            block[:] = frame @ K[np.ix_(dofs, dofs)] @ frame.T
        self.k_n, self.K_t = self.blocks[:, -1, -1], self.blocks[:, :-1, :-1]
        self.k_t = np.trace(self.K_t, axis1=1, axis2=2) / (len(frame) - 1)

    def local(self, u):
        return u[self.contact] @ self.frame.T

    def verdict(
        self, u, reaction, f, before, prescribed, tol, scratch=False, farthest=0.0
    ) -> Verdict:
        """Judge a state.

        Args:
            u: Displacement; reaction: of the contact nodes, local frame; f: external forces.
            before: Displacement at the step before.
            prescribed: Values of boundary conditions on ``fixed``.
            tol: Of the tight solution that it is compared with.
            scratch: Whether the tight solution is also sought from a start that ``u`` has no part in.
            farthest: Largest displacement on the way: a state reached by increments has their rounding.
        """
        K, free = self.relation.K, self.free
        forces = np.zeros(len(u))
        forces[self.contact] = reaction @ self.frame
        left = (K @ u.astype(np.longdouble) - f - forces).astype(float)
        acting = norm(reaction), norm(f[free])
        scale, contact_scale = max(*acting, norm(left[self.fixed])), max(acting)
        start, before = before, self.local(before)
        gap, slip = self.gap0 + self.local(u)[:, -1], (self.local(u) - before)[:, :-1]
        stiff = np.abs(self.k_n)
        normal, cone, slips = law_defects(reaction, gap, slip, stiff, self.K_t, self.mu, self.p)
        moved = self.diagonal[self.fixed] * (u[self.fixed] - prescribed)
        defects = dict(equilibrium=left[free], supports=moved, normal=normal, cone=cone, slip=slips)
        cancelling = K.magnitude(u).astype(float) + np.abs(f) + np.abs(forces)
        # A displacement that was solved for is rounded like the largest one.
        farthest = max(farthest, np.abs(start).max(initial=0.0)) + np.abs(u).max(initial=0.0)
        moved = np.full(len(gap), farthest)
        lengths = self.reach + moved, moved  # of gaps and of slips
        rounding = dict(
            equilibrium=cancelling[free], supports=self.diagonal[self.fixed] * prescribed,
            normal=stiff * lengths[0], cone=reaction, slip=self.k_t * lengths[1],
        )  # fmt: skip
        defects = {name: norm(value) for name, value in defects.items()}
        allowances = {name: EPS * norm(value) for name, value in rounding.items()}
        found = Verdict(scale, contact_scale, defects, allowances)
        if not (self.k_n > 0).all():
            found.notes.append("a nodal stiffness along the normal is not positive")
        defects["reactions"], allowances["reactions"] = 0.0, allowances["equilibrium"]
        if len(self.contact):
            errors = cancelling, self.k_n * lengths[0], self.k_t * lengths[1]
            self._compare(found, reaction, (u, f, self.gap0, before), errors, tol, scratch)
        return found

    def _compare(self, found, reaction, state, errors, tol, scratch):
        """Distance from a tight solution that starts at the state, and if asked for from another one."""
        target = TIGHT * tol * max(found.contact_scale, 0.0)

        def distance(start) -> float:
            tight = polished(self.relation, lambda: start(*state), self, target)
            return np.nan if tight is None else norm(tight - reaction)

        near = distance(self.relation.start)
        if np.isnan(near):
            found.notes.append("no tight solution was found from this state")
        else:
            found.allowances["reactions"] += self._response(errors)
        far = distance(self.relation.start_closed) if scratch else np.nan
        found.defects["reactions"] = np.inf if np.isnan(near) else np.fmax(near, far)
        found.from_scratch = None if np.isnan(far) else far

    def _response(self, errors) -> float:
        """Change of the tight reactions when each term is wrong by its rounding, signs at random."""
        relation, rng = self.relation, np.random.default_rng(0)
        r, gap, slip = relation.state()
        _, by_r, by_w = equations(r, gap, slip, self.mu, self.p, self.k_n, self.k_t)
        J, largest = jacobian(relation, by_r, by_w), 0.0
        cancelling, normal, tangential = errors
        n, d = self.contact.shape
        for _ in range(SAMPLES):
            force = EPS * cancelling * rng.choice([-1.0, 1.0], cancelling.size)
            felt = force[self.contact].ravel() + relation.transfer @ force[relation.inner]
            felt = (felt.reshape(n, d) @ self.frame.T)[:, :, None]
            length = np.repeat((tangential / self.k_t)[:, None], d, axis=1)
            length[:, -1] = normal / self.k_n
            length = (EPS * length * rng.choice([-1.0, 1.0], length.shape))[:, :, None]
            right = by_r.astype(float) @ felt + by_w.astype(float) @ length
            change = felt.ravel() - relation.by_r @ solved(J, right.ravel())
            largest = max(largest, norm(change))
        return MARGIN * largest


def polished(relation, start, law, target, reaction=None, near=0.0):
    """Reactions of a tight solution, or None if Newton's method finds none with any metric.

    It is tight when the law's own conditions hold and the last change of the reactions was small, both within
    ``target``; slips beyond what a node's force would make count by the turn of the force that explains them.
    Where there are several solutions, one within ``near`` of ``reaction`` is looked for, else the nearest; as Newton's
    method moves along them, a hundredth of ``near`` is a small change then.
    """
    best, closest = None, np.inf
    for factor in METRICS:
        start()
        left, last, floor = newton(relation, law.mu, law.p, factor * law.k_n, factor * law.k_t)
        r, gap, slip = relation.state()
        normal, cone, slips = law_defects(r, gap, slip, law.k_n, law.K_t, law.mu, law.p)
        far = law.k_t * np.linalg.norm(slip, axis=1)
        turns = slips * np.minimum(1, np.linalg.norm(r[:, :-1], axis=1) / np.maximum(far, 1e-300))
        holds = max(map(norm, (normal, cone, turns))) <= target + 100 * floor
        if np.isfinite(left) and holds and last <= max(target, 0.01 * near) + 100 * floor:
            r = r.astype(float)
            if reaction is None or norm(r - reaction) <= near:
                return r
            if norm(r - reaction) < closest:
                best, closest = r, norm(r - reaction)
    return best


def condensed(W, q, mu, p, reaction, tol) -> Verdict:
    """Judge reactions of ``w = q + W r``, ``shape=(n, d)``; slips first, the gap last.

    Stiffnesses are those of a node whose neighbours carry what they carry: one over the compliance along the
    normal, and one over the largest compliance along the plane.
    """
    n, d = q.shape
    W = np.asarray(W, float).reshape(n * d, n * d)
    blocks = W.reshape(n, d, n, d)[np.arange(n), :, np.arange(n), :]
    k_n = 1 / np.maximum(blocks[:, -1, -1], EPS * np.abs(W).max())
    largest = np.linalg.norm(blocks[:, :-1, :-1], 2, axis=(1, 2)) if d > 1 else np.zeros(n)
    k_t = 1 / np.maximum(largest, EPS * np.abs(W).max())
    mu, p = np.atleast_1d(np.asarray(mu, float)), np.atleast_1d(np.asarray(p, float))
    law = SimpleNamespace(mu=mu, p=p, k_n=k_n, k_t=k_t, K_t=k_t[:, None, None] * np.eye(d - 1))
    relation = ByCompliance(W, q)
    relation.start(reaction)
    _, gap, slip = (part.astype(float) for part in relation.state())
    normal, cone, slips = law_defects(reaction, gap, slip, k_n, law.K_t, mu, p)
    terms = np.abs(q) + (np.abs(W) @ np.abs(reaction).ravel()).reshape(n, d)
    defects = dict(normal=norm(normal), cone=norm(cone), slip=norm(slips))
    allowances = dict(
        normal=EPS * norm(k_n * terms[:, -1]), cone=EPS * norm(reaction),
        slip=EPS * norm(k_t[:, None] * terms[:, :-1]),
    )  # fmt: skip
    found = Verdict(norm(reaction), norm(reaction), defects, allowances)
    near = REACTIONS * tol * found.scale
    tight = polished(relation, lambda: relation.start(reaction), law, TIGHT * tol * found.scale, reaction, near)  # fmt: skip
    defects["reactions"] = np.inf if tight is None else norm(tight - reaction)
    allowances["reactions"] = MARGIN * (allowances["normal"] + allowances["slip"])
    if tight is None:
        found.notes.append("no tight solution was found from this state")
    return found
