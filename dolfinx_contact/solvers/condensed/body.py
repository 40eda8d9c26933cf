# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The body condensed to its contact nodes: W, the compliance of the nodes to each other's reactions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI
from scipy import sparse

from dolfinx_contact.contact.contact_step import components
from dolfinx_contact.law.friction import Friction, principal_axes
from dolfinx_contact.petsc.linear_solver import LinearSolver
from dolfinx_contact.solvers.base import ASTRAY_ERROR, BoundSolver, SolverName, SolverResult
from dolfinx_contact.solvers.condensed.compliance import (
    Responses,
    Rows,
    along_diagonal,
    available_first,
    bytes_needed,
    check_memory,
    compliance,
    one_below_other,
    tie,
)
from dolfinx_contact.solvers.condensed.input import joint_friction
from dolfinx_contact.solvers.condensed.kernel import condensed_operator
from dolfinx_contact.support.collective import by_first_rank, raised_together

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.interface import NodalStiffness
    from dolfinx_contact.contact.state import State
    from dolfinx_contact.solvers.condensed.newton import CondensedNewton
    from dolfinx_contact.solvers.condensed.surfaces import CondensedSurfaces
    from dolfinx_contact.step.load_step import LoadStep, StepState

# Iterations for a loose body that seems to slide away, and for any other.
FEW_ITERATIONS = 3000
MANY_ITERATIONS = 6000

# Compliance along a direction that a support prescribes, over that of free ones: with none the normal cone is too narrow.
RIGID_COMPLIANCE = 1e-9


class BoundCondensedNewton(BoundSolver):
    """``w = q + W r`` of all contacts of a body, gathered from all ranks, along the principal axes.

    ``W`` are the rows of ``K^-1`` at the contact nodes, by a factorisation of ``K`` and blocks of
    sparse right-hand sides; it is held by rank 0 alone.  Directions that a boundary condition fixes have no friction here:
    it moves nothing, and follows from the answer.  Where a support moves a node across its free direction, both take
    part in the law, with next to no compliance along the prescribed one.  Without friction at any contact there are
    normal components alone.  A body on soft springs is condensed with its anchors, see ``Anchors``: their
    forces are unknowns behind the reactions, and what they move has to agree with them.  Last come the motions of
    planes that force drives, see ``CondensedSurfaces``.

    Args:
        options: ``CondensedNewton``, which solves the condensed problem.
        step: The first step.

    Raises:
        MemoryError: on all ranks, if ``W`` and what Newton's method needs beside it would not fit.
    """

    def __init__(self, options: CondensedNewton, step: LoadStep):
        self._options, self.comm, self._body = options, step.body.comm, step.body
        self._own = None  # factors, where the body has multigrid for a solver that goes first
        self._kept: tuple[int, Responses] | None = None
        self._moved = [np.zeros(contact.points.count, dtype=bool) for contact in step.contacts]
        self._bind(step)

    def _bind(self, step: LoadStep) -> None:
        """Set everything up for a step but what belongs to the stiffness alone.  Collective."""
        self._stamps, self._contacts = step.stamps, step.contacts
        self.dim = components(step.contacts)
        self._held_by = self._body.anchors or self._body
        self._shared = self._any_shared()
        self._set_up(self._moved)

    def update(self, step: LoadStep) -> None:
        """See ``BoundSolver``: ``W`` is along the principal directions, and has no slip without friction."""
        new, old = step.stamps, self._stamps
        if new.stiffness != old.stiffness:
            self._free_factors()
        if new[:2] != old[:2] or new.parts != old.parts:
            self._bind(step)
            return
        self._stamps, self._contacts = new, step.contacts
        if new.law == old.law:
            return
        laws = self._acting(self._moved)
        turned = not all(np.array_equal(a.axes, b.axes) for a, b in zip(laws, self._laws))
        if self.comm.allreduce(turned, op=MPI.LOR) or components(step.contacts) != self.dim:
            self._bind(step)
            return
        self._laws = laws
        self.friction = joint_friction(laws, self._contacts, self.gather)

    def _set_up(self, moved: list[np.ndarray]) -> None:
        """``W`` and the law, where supports move nodes across their free direction.  Collective."""
        body, contacts = self._body, self._contacts
        stiffness = [contact.stiffness for contact in contacts]
        guided = any(contact.points.along.any() for contact in contacts)
        self._guided = self.dim == 3 and self.comm.allreduce(guided, op=MPI.LOR)
        self._moved = moved
        self._laws = self._acting(moved)
        nodes, anchored = self._rows(), self._anchor_rows()
        self._parts = [nodes, anchored]
        self.nodes, self._anchored = nodes.size // self.dim, anchored.size
        normal = self.gather(np.concatenate([nodal.normal for nodal in stiffness]))
        self._surfaces = self._condensed_surfaces(normal)
        driven = 0 if self._surfaces is None else self._surfaces.tied
        self._tied = anchored.size + driven
        check_memory(self.comm, bytes_needed(self.nodes, self.dim, body.K.getSize()[0]))
        W, (prescribed, blocks) = self.compliance(), self._prescribed()
        a = anchored.gather(body.anchors.stiffness if body.anchors else np.zeros(0))
        self.operator, size = None, nodes.size
        with raised_together(self.comm):
            if self.comm.rank == 0:
                # A direction that is fixed: W has no entry there, and its reaction is to stay zero.
                inert = np.flatnonzero(~W.any(axis=0) & ~W.any(axis=1))
                share = 1 - len(inert) / size
                usual = np.diag(W)[:size].mean() / max(share, 1 / size)
                inert = np.setdiff1d(inert, prescribed)
                W[inert, inert] = usual
                for rows, block in zip(prescribed, blocks):
                    W[np.ix_(rows, rows)] += RIGID_COMPLIANCE * usual * block
                tie(W, size, a, body.loose is not None and body.loose.modes.shape[1] == a.size)
                if self._surfaces is not None:
                    W = self._surfaces.border(W, size)
                self.operator = condensed_operator(W, self.dim, self._tied)
                del W  # copied
                slides = any(c.given.geometry.renews_rows for c in contacts)
                if not slides:  # else the next solution has other rows
                    self.operator.prepare()  # pays after some ten iterations
        self.friction = joint_friction(self._laws, self._contacts, self.gather)
        self._scales = self._gathered_stiffness(stiffness) | {
            "tied_stiffness": np.append(a, np.ones(driven))
        }

    def _condensed_surfaces(self, normal: np.ndarray):
        """Surfaces that force drives, None where there are none.  Collective."""
        if not any(contact.surface.motions for contact in self._contacts):
            return None
        from dolfinx_contact.solvers.condensed.surfaces import CondensedSurfaces

        return CondensedSurfaces(self._body, self._contacts, self._turns, normal)

    def _motions(self, step: LoadStep, force: np.ndarray) -> np.ndarray:
        """Motions of surfaces that forces of all rows make."""
        return step.no_motions if self._surfaces is None else self._surfaces.moved(force)

    def _driving(self, step: LoadStep, c: np.ndarray) -> np.ndarray:
        """Forces that drive the surfaces of the tied rows."""
        return np.zeros(0) if self._surfaces is None else self._surfaces.driving(step, c)

    def close(self) -> None:
        """Free the factors.  Collective."""
        self._free_factors()

    def _free_factors(self) -> None:
        if self._own is not None:
            self._own.destroy()
        self._own = self._kept = None

    def _factors(self) -> Any:
        """What has the linear solver for many right-hand sides as its ``ksp``.  Collective."""
        if not self._body.crowded or self._body.exact:
            return self._held_by
        if self._own is None:
            A = self._body.anchors.A if self._body.anchors else self._body.K
            self._own = LinearSolver(A, None, f"{self._body.prefix}condensed_", None)
        return self._own

    def _acting(self, moved: list[np.ndarray]) -> list[Friction]:
        """Friction of each contact as it acts on this problem.  Collective."""
        laws = [acting(*both) for both in zip(self._contacts, moved)]
        if not self._shared:
            return laws
        from dolfinx_contact.contact.shared import mean_laws

        return mean_laws(laws, self._contacts)

    def _any_shared(self) -> bool:
        """Whether any node of any rank belongs to several contacts.  Collective."""
        if len(self._contacts) < 2:
            return False
        from dolfinx_contact.contact.shared import any_shared

        return any_shared(self._contacts)

    def _begun(self, step: LoadStep) -> tuple[np.ndarray, np.ndarray]:
        """The displacement without reactions, and surfaces near it; set up anew if supports move other nodes.  Collective."""
        free = self._held_by.solve(step.b) if self._anchored else self._body.free_state(step.b)
        c = step.no_motions if self._surfaces is None else self._surfaces.begun(step, free)
        if self._guided:
            now = [moved_across(contact, contact.at(free, c)) for contact in step.contacts]
            if self.comm.allreduce(not all(map(np.array_equal, now, self._moved)), op=MPI.LOR):
                self._set_up(now)
                if self._surfaces is not None:  # made anew
                    c = self._surfaces.begun(step, free)
        return free, c

    def solve(
        self,
        step: LoadStep,
        starts: Sequence[Any] = (),
        start: StepState | None = None,
        fallbacks: bool = True,
    ) -> SolverResult:
        """One load step by Newton's method on the condensed problem.

        Args:
            step: The ``LoadStep``.
            starts: q and forces of all rows of earlier steps, and how many of these are tied.
            start: Not used: reactions of earlier steps are better starts.
            fallbacks: Whether a body that may slide is searched by all methods where Newton's fails.
        """
        self._until = perf_counter() + self._options.max_seconds  # of all searches together
        held, first, (free, c) = self._held_by.solve, self.dim * self.nodes, self._begun(step)
        acting, anchors = self._body.norm(step.external), slice(first, first + self._anchored)
        q = rows = self._motion(step, free, c)
        placed, near = np.zeros(q.size), _similar_starts(q, starts, self._surfaces)
        if step.statics is not None:
            q, placed, near = self._placed(step, free, c, near)
        iterations, error, rounding, best, state = 0, np.inf, 0.0, None, None
        base, known = free, np.zeros(q.size)  # a displacement, and the forces of all rows in it
        for factor in (0.1, 1e-2, 1e-2, 1e-3):  # this error is not quite the condensed problem's
            previous = error
            for limits in _searches(step, fallbacks):
                goal, given = factor * step.tol, [one - placed for one in near]
                limits = limits or self._limited(step, state)
                result = self._reactions(step, q + rounding, goal, given, acting, limits)
                iterations += result.iterations
                force = placed + np.concatenate((result.reaction.ravel(), result.tied))
                x = self.displacement(base, force - known)
                state = self._measured(step, x, force, result.reaction, state)
                error = state.errors.largest
                solved = max(result.error, result.slip_error) <= max(goal, result.rounding)
                if solved or step.pushed_off(state):
                    break
            if best is not None and not error < previous:
                break
            change = result.change
            if self._shared and error <= step.tol < change:  # moves reactions within nodes, too
                change = min(change, _next_change(state))
            best = state, force, result, change
            lost = step.may_slide and result.error > max(ASTRAY_ERROR, goal)
            if lost or max(error, change) <= step.tol:
                break
            # From here on by differences, of which no digit is lost: what is left of equilibrium, then slip and
            # gap of the body itself in place of those by W, which a long lever or a soft support makes large.
            left = step.b + self._nodal(force) - self._held_by.multiply(state.x)
            left[self._body.fixed] = 0.0
            base, known, near = state.x + held(left), force, [force]
            anchored = force[anchors] / self._scales["tied_stiffness"][: self._anchored]
            moved = (result.displacement.ravel(), anchored, self._driving(step, state.c))
            rounding = rounding + self._motion(step, base, state.c) - np.concatenate(moved)
        state, force, result, change = best
        forward = max(change, state.errors.largest)
        found = state, iterations, forward, SolverName.CONDENSED_NEWTON, result.tried
        kept = fallbacks or forward <= step.tol  # else another search follows, from the same steps
        return SolverResult(*found, start=(rows, force, self._tied) if kept else None)

    def _measured(
        self,
        step: LoadStep,
        x: np.ndarray,
        force: np.ndarray,
        reaction: np.ndarray,
        before: StepState | None,
    ) -> StepState:
        """The state of a displacement, to which forces of all rows and reactions belong.  Collective."""
        near = self._shares(reaction) if self._shared else None
        state = step.measure(x, c=self._motions(step, force), before=before, near=near)
        step.tell(state)
        return state

    def _limited(self, step: LoadStep, state: StepState | None) -> dict:
        """Limits of the search for a loose body, none for others.  Collective."""
        if step.statics is None:
            return {}
        most = (
            FEW_ITERATIONS if state is not None and step.statics.slides(state) else MANY_ITERATIONS
        )
        return {"max_iterations": min(most, self._options.max_iterations or most)}

    def _shares(self, reaction: np.ndarray) -> list[np.ndarray]:
        """The reactions of each contact: at nodes of several ``x`` tells no more than the sums."""
        counts = self.comm.allgather(len(self._turns))
        first = sum(counts[: self.comm.rank])
        mine = reaction[first : first + len(self._turns)]
        local = np.einsum("nij,ni->nj", self._turns, mine)
        ends = np.cumsum([contact.points.count for contact in self._contacts])
        return np.split(local, ends[:-1])

    def _placed(
        self, step: LoadStep, free: np.ndarray, c: np.ndarray, starts: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, list]:
        """Of a loose body: q where it stands at first, the forces of all rows that hold it there, and starts moved there."""
        first, stiffness = self.dim * self.nodes, self._scales["tied_stiffness"]
        anchors, rows = slice(first, first + self._anchored), self._parts[1]
        placed, moved = np.zeros((2, first + self._tied))
        held = rows.of(step.statics.start)
        placed[anchors] = stiffness[: self._anchored] * held
        if starts:  # of the last one anchors tell where it left the body
            moved[anchors] = placed[anchors] - starts[0][anchors]
        q = self._motion(step, self.displacement(free, placed), c)
        q[anchors] -= held
        starts = [start + moved for start in starts]
        return q, placed, starts + [step.statics.share() * last for last in starts[:1]]

    def compliance(self) -> np.ndarray:
        """Motion of all rows by a unit force on each, on rank 0; an empty array on the others.  Collective."""
        changes = any(contact.given.changes for contact in self._contacts)
        if changes and not self._body.nonlinear:
            kept = self._responses()
            if 2 * kept.bytes_needed(self._parts) <= available_first(self.comm):
                return kept.compliance(self._factors(), self._parts)
        return compliance(self._factors(), self._parts)

    def _responses(self) -> Responses:
        """Columns of ``K^-1`` that rows whose frames or nodes change have needed so far, of the present stiffness.  Collective."""
        if self._kept is None or self._kept[0] != self._stamps.stiffness:
            reach = [contact.points.reach for contact in self._contacts]
            anchored = self._parts[1].sums.indices
            columns = np.concatenate([*self.comm.allgather(np.concatenate(reach)), anchored])
            self._kept = self._stamps.stiffness, Responses(np.unique(columns))
        return self._kept[1]

    def _rows(self) -> Rows:
        """One row per local direction of a node: its global components, none at fixed dofs."""
        gdim, body = self._contacts[0].points.dim, self._body
        free = np.ones(body.size, dtype=bool)
        free[body.fixed] = False
        turns, rows = [], []
        for contact, law in zip(self._contacts, self._laws):
            points = contact.points
            turns.append(principal_axes(law, points.count, gdim)[:, -self.dim :])
            rows.append(points.rows(turns[-1], free))
        self._turns = np.concatenate(turns)
        directions, sums = zip(*rows)
        both = along_diagonal(directions), one_below_other(sums)
        return Rows(self.comm, *both, points.first, body.size)

    def _prescribed(self) -> tuple[np.ndarray, np.ndarray]:
        """Tangential rows of nodes that supports move in one direction, and that direction's dyads, in the order of rows."""
        if self.dim < 3:
            return np.zeros((0, 2), int), np.zeros((0, 2, 2))
        moved, across = np.concatenate(self._moved), []
        for contact in self._contacts:
            f = np.zeros((contact.points.count, 2))
            f[contact.points.supported] = contact.points.along
            across.append(np.column_stack((-f[:, 1], f[:, 0])))
        turned = np.einsum("nij,nj->ni", self._turns[:, :2, :2], np.concatenate(across))[moved]
        first = self.dim * np.flatnonzero(self.gather(moved))
        return first[:, None] + np.arange(2), self.gather(turned[:, :, None] * turned[:, None, :])

    def _anchor_rows(self) -> Rows:
        """One row per anchor."""
        dofs = self._body.anchors.dofs if self._body.anchors else np.zeros(0, int)
        size, first, whole = self._body.displacements.owned
        rows = (np.ones(dofs.size), first + dofs, np.arange(dofs.size + 1))
        sums = sparse.csr_matrix(rows, (dofs.size, whole))
        return Rows(self.comm, sparse.eye(dofs.size, format="csr"), sums, first, size)

    def _motion(self, step: LoadStep, displacement: np.ndarray, c: np.ndarray) -> np.ndarray:
        """Slip and gap of all nodes, motion of the anchors, and forces that drive planes, at a displacement."""
        rows = [np.zeros((0, self._turns.shape[2]))]
        for contact, moved in zip(step.contacts, self._moved):
            state = contact.at(displacement, c)
            known = np.where(moved[:, None], 0.0, contact.known_slip(state))
            rows.append(np.column_stack((state.slip_increment - known, state.gap)))
        local = np.einsum("nij,nj->ni", self._turns, np.concatenate(rows)).ravel()
        nodes, anchored = self._parts
        held = anchored.of(displacement)
        return np.concatenate((nodes.gather(local), held, self._driving(step, c)))

    def displacement(self, base: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Displacement of owned dofs with more forces of all rows than ``base`` has."""
        correction = self._held_by.solve(self._nodal(force))
        correction[self._body.fixed] = 0.0
        return base + correction

    def _nodal(self, force: np.ndarray) -> np.ndarray:
        """Forces of all rows on owned degrees of freedom; those of surfaces act on no node."""
        forces, start = np.zeros(self._body.size), 0
        for part in self._parts:
            part.add_forces(force[start : start + part.size], forces)
            start += part.size
        return forces

    def _reactions(
        self,
        step: LoadStep,
        q: np.ndarray,
        tol: float,
        starts: Sequence[np.ndarray],
        acting: float,
        limits: dict,
    ):
        """The condensed problem solved on rank 0; its result, the best one if it failed, on all ranks."""
        left = max(self._until - perf_counter(), 1e-9)
        options = replace(self._options, **limits | {"max_seconds": left})

        def solve(monitor: Callable | None):
            given = self.operator, self.friction, q, max(tol, 1e-14), starts, monitor
            return options.search(*given, external=acting, **self._scales)[0]

        tell = None if step.monitor is None else step.monitor.tell
        return by_first_rank(self.comm, solve, tell)

    # -- gathered from all ranks -----------------------------------------------------------------

    def gather(self, local: np.ndarray) -> np.ndarray:
        """Rows of all nodes, in the order of ranks and contacts, on all ranks."""
        return np.concatenate(self.comm.allgather(np.ascontiguousarray(local)))

    def _gathered_stiffness(self, stiffness: Sequence[NodalStiffness]) -> dict[str, np.ndarray]:
        """Normal and tangential blocks of all nodes along the principal axes, for rank 0's errors."""
        gathered = {"stiffness": self.gather(np.concatenate([k.normal for k in stiffness]))}
        if self.dim > 1:
            blocks = np.concatenate([k.tangential for k in stiffness])
            turns = self._turns[:, :-1, :-1]
            turned = np.einsum("nij,njk,nlk->nil", turns, blocks, turns)
            gathered["tangential_stiffness"] = self.gather(turned)
        return gathered


def _searches(step: LoadStep, fallbacks: bool) -> tuple[dict, ...]:
    """Options of one search after another: where something may slide Newton's method alone first."""
    return ({"fallbacks": False}, {})[: 1 + fallbacks] if step.may_slide else ({},)


def moved_across(contact: ContactStep, state: State) -> np.ndarray:
    """Nodes that supports move in one tangential direction and leave free in the other, ``shape=(n,)``."""
    points, moved = contact.points, np.zeros(contact.points.count, dtype=bool)
    rows = points.supported
    moved[rows] = points.along.any(axis=1) & contact.known_slip(state)[rows].any(axis=1)
    return moved


def acting(contact: ContactStep, moved: np.ndarray) -> Friction:
    """Friction along the directions that supports leave free; of nodes ``moved`` across them, that of both directions."""
    free, whole = contact.free_friction, contact.friction
    if free is whole or not moved.any():
        return free
    mu, p = (np.where(moved[:, None], a, b) for a, b in ((whole.mu, free.mu), (whole.p, free.p)))
    axes = np.tile([1.0, 0.0], (moved.size, 1)) if whole.axes is None else whole.axes
    return Friction(mu, np.where(mu > 0, p, 1.0), axes=np.where(moved[:, None], axes, free.axes))


def _next_change(state: StepState) -> float:
    from dolfinx_contact.solvers.newton.contact_tangent import next_change

    return next_change(state)


def _similar_starts(
    q: np.ndarray, starts: Sequence[Any], surfaces: CondensedSurfaces | None
) -> list[np.ndarray]:
    """Reactions to start from: last step's, extrapolated, those of the most similar step, and last step's with the change that led to the most similar one."""
    past = [(a, b) for a, b, _ in starts if a.size == q.size]
    if not past:
        return []
    last = past[-1]
    before = past[-2][1] if len(past) > 1 else 0.0  # nothing acted before the first step
    near = [last[1], 2 * last[1] - before]
    tied = 0 if surfaces is None else surfaces.tied
    if tied and last[0][-1] * q[-1] > 0.0:  # in balance with the new weight
        near.append(q[-1] / last[0][-1] * last[1])
    scale, others = np.abs(q[: q.size - tied]).max(), np.array([other for other, _ in past])
    distances = surfaces.distances(others, q) if tied else np.abs(others - q).max(axis=1)
    similar = int(np.argmin(distances))
    if similar < len(past) - 1 and distances[similar] < 0.1 * scale:
        near.append(past[similar][1])
        if similar > 0:
            near.append(last[1] + past[similar][1] - past[similar - 1][1])
    return near
