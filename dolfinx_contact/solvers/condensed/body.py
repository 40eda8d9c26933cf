# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The condensed problem of a body: compliance of the contact nodes, friction, and solution."""

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

# Iteration limits for a body held by contact alone: if it seems to slide away, and otherwise.
FEW_ITERATIONS = 3000
MANY_ITERATIONS = 6000

# Compliance along a direction that a support prescribes, relative to the mean compliance of free
# directions: small, but not zero, since with zero compliance the normal cone would be too narrow.
RIGID_COMPLIANCE = 1e-9


class BoundCondensedNewton(BoundSolver):
    """Condensed problem ``w = q + W r`` of all contacts of a body, gathered from all ranks.

    Components are along the principal axes of friction; if no contact has friction, there are only
    normal components.  ``W`` is ``K^-1`` between the contact nodes, computed with a factorisation
    of ``K`` and blocks of sparse right-hand sides; rank 0 alone stores it.

    - Tangential directions that a boundary condition fixes have no friction in the condensed
      problem: it moves nothing there, and is computed from the solution.  If a support moves a node
      perpendicular to its one free tangential direction, the law includes both directions, with
      nearly zero compliance along the prescribed one.
    - A body on soft springs is condensed with regularisation springs, see ``Anchors``.  Their
      forces are additional unknowns behind the reactions, with one equation each.
    - The motions of surfaces driven by force are the last unknowns, see ``CondensedSurfaces``.

    Args:
        options: Options of the condensed solver.
        step: The first load step.

    Raises:
        MemoryError: on all ranks, if ``W`` and the work arrays of Newton's method would not fit.
    """

    def __init__(self, options: CondensedNewton, step: LoadStep):
        self._options, self.comm, self._body = options, step.body.comm, step.body
        self._own = None  # own factorisation, if the body uses multigrid
        self._kept: tuple[int, Responses] | None = None
        self._moved = [np.zeros(contact.points.count, dtype=bool) for contact in step.contacts]
        self._bind(step)

    def _bind(self, step: LoadStep) -> None:
        """Set up the condensed problem for a load step; keep factorisations.  Collective."""
        self._stamps, self._contacts = step.stamps, step.contacts
        self.dim = components(step.contacts)
        self._held_by = self._body.anchors or self._body
        self._shared = self._any_shared()
        self._set_up(self._moved)

    def update(self, step: LoadStep) -> None:
        """Set up anew the parts of the condensed problem that are out of date.  Collective.

        ``W`` is set up anew if stiffness, frames, surface motions or the principal axes of friction
        changed, or if the first friction was added or the last removed.  If only friction
        coefficients changed, ``W`` is kept.
        """
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
        """Compute ``W`` and the friction of all nodes.  Collective.

        Args:
            moved: For each contact, the nodes that supports move perpendicular to their free
                direction.
        """
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
                # Fixed directions have zero rows in W; a diagonal entry keeps their reactions at
                # zero.
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
                del W  # the operator has a copy
                slides = any(c.given.geometry.renews_rows for c in contacts)
                if not slides:  # else the next solution has different rows
                    self.operator.prepare()  # worthwhile after about ten iterations
        self.friction = joint_friction(self._laws, self._contacts, self.gather)
        self._scales = self._gathered_stiffness(stiffness) | {
            "tied_stiffness": np.append(a, np.ones(driven))
        }

    def _condensed_surfaces(self, normal: np.ndarray):
        """Return the ``CondensedSurfaces``; None if no surface is driven by force.  Collective.

        Args:
            normal: Normal stiffness of all nodes, force per length.
        """
        if not any(contact.surface.motions for contact in self._contacts):
            return None
        from dolfinx_contact.solvers.condensed.surfaces import CondensedSurfaces

        return CondensedSurfaces(self._body, self._contacts, self._turns, normal)

    def _motions(self, step: LoadStep, force: np.ndarray) -> np.ndarray:
        """Motions of driven surfaces for given forces of all rows, ``shape=(m,)``."""
        return step.first_motions if self._surfaces is None else self._surfaces.moved(force)

    def _driving(self, step: LoadStep, c: np.ndarray) -> np.ndarray:
        """Driving forces of the tied rows of surfaces, at surface motions ``c``."""
        return np.zeros(0) if self._surfaces is None else self._surfaces.driving(step, c)

    def close(self) -> None:
        """Free the factorisation.  Collective."""
        self._free_factors()

    def _free_factors(self) -> None:
        if self._own is not None:
            self._own.destroy()
        self._own = self._kept = None

    def _factors(self) -> Any:
        """Return an object whose ``ksp`` solves for many right-hand sides.  Collective."""
        if not self._body.multigrid_is_faster or self._body.exact:
            return self._held_by
        if self._own is None:
            A = self._body.anchors.A if self._body.anchors else self._body.K
            self._own = LinearSolver(A, None, f"{self._body.prefix}condensed_", None)
        return self._own

    def _acting(self, moved: list[np.ndarray]) -> list[Friction]:
        """Friction of each contact in the condensed problem, see ``acting``.  Collective."""
        laws = [acting(*both) for both in zip(self._contacts, moved)]
        if not self._shared:
            return laws
        from dolfinx_contact.contact.shared import mean_laws

        return mean_laws(laws, self._contacts)

    def _any_shared(self) -> bool:
        """Whether any node on any rank belongs to several contacts.  Collective."""
        if len(self._contacts) < 2:
            return False
        from dolfinx_contact.contact.shared import any_shared

        return any_shared(self._contacts)

    def _begun(self, step: LoadStep) -> tuple[np.ndarray, np.ndarray]:
        """Return contact-free displacement and nearby motions of driven surfaces.  Collective.

        If supports move other nodes perpendicular to their free direction than before, the
        condensed problem is set up anew.
        """
        free = self._held_by.solve(step.b) if self._anchored else self._body.free_state(step.b)
        c = step.first_motions if self._surfaces is None else self._surfaces.begun(step, free)
        if self._guided:
            now = [moved_across(contact, contact.at(free, c)) for contact in step.contacts]
            if self.comm.allreduce(not all(map(np.array_equal, now, self._moved)), op=MPI.LOR):
                self._set_up(now)
                if self._surfaces is not None:  # it was set up anew
                    c = self._surfaces.begun(step, free)
        return free, c

    def solve(
        self,
        step: LoadStep,
        starts: Sequence[Any] = (),
        start: StepState | None = None,
        fallbacks: bool = True,
    ) -> SolverResult:
        """Solve a load step by Newton's method on the condensed problem; return the best state.

        Args:
            step: The load step.
            starts: For each earlier step: ``q``, forces of all rows, and number of tied rows.
            start: Not used: reactions of earlier steps are better starts.
            fallbacks: Whether to try all methods if Newton's method fails for a body or surface
                that may slide.
        """
        self._until = perf_counter() + self._options.max_seconds  # common limit of all searches
        held, first, (free, c) = (
            self._held_by.solve,
            self.dim * self.nodes,
            self._begun(step),
        )
        acting, anchors = self._body.norm(step.external), slice(first, first + self._anchored)
        q = rows = self._motion(step, free, c)
        placed, near = np.zeros(q.size), _similar_starts(q, starts, self._surfaces)
        if step.statics is not None:
            q, placed, near = self._placed(step, free, c, near)
        iterations, error, rounding, best, state = 0, np.inf, 0.0, None, None
        base, known = free, np.zeros(q.size)  # a displacement, and the row forces that it includes
        for factor in (0.1, 1e-2, 1e-2, 1e-3):  # the errors of step and condensed problem differ
            previous = error
            for limits in _search_options(step, fallbacks):
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
            # the change includes shifts of reactions between contacts that share a node
            if self._shared and error <= step.tol < change:
                change = min(change, _next_change(state))
            best = state, force, result, change
            lost = step.may_slide and result.error > max(ASTRAY_ERROR, goal)
            if lost or max(error, change) <= step.tol:
                break
            # Iterative refinement without loss of digits: correct the residual of equilibrium, then
            # replace slip and gap by the body's own values; with long levers or soft supports,
            # those from W are inaccurate.
            left = step.b + self._nodal(force) - self._held_by.multiply(state.x)
            left[self._body.fixed] = 0.0
            base, known, near = state.x + held(left), force, [force]
            anchored = force[anchors] / self._scales["tied_stiffness"][: self._anchored]
            moved = (result.displacement.ravel(), anchored, self._driving(step, state.c))
            rounding = rounding + self._motion(step, base, state.c) - np.concatenate(moved)
        state, force, result, change = best
        forward = max(change, state.errors.largest)
        found = state, iterations, forward, SolverName.CONDENSED_NEWTON, result.tried
        kept = fallbacks or forward <= step.tol  # else another search starts from the same data
        return SolverResult(*found, start=(rows, force, self._tied) if kept else None)

    def _measured(
        self,
        step: LoadStep,
        x: np.ndarray,
        force: np.ndarray,
        reaction: np.ndarray,
        before: StepState | None,
    ) -> StepState:
        """Evaluate the state at a displacement; report it to the monitor.  Collective.

        Args:
            step: The load step.
            x: Displacement of owned degrees of freedom.
            force: Forces of all rows at this displacement.
            reaction: Reactions of all nodes, along the principal axes.
            before: The previous state, or None.
        """
        near = self._shares(reaction) if self._shared else None
        state = step.measure(x, c=self._motions(step, force), before=before, near=near)
        step.tell(state)
        return state

    def _limited(self, step: LoadStep, state: StepState | None) -> dict:
        """Iteration limit of a body held by contact alone; else an empty dictionary.
        Collective."""
        if step.statics is None:
            return {}
        most = (
            FEW_ITERATIONS if state is not None and step.statics.slides(state) else MANY_ITERATIONS
        )
        return {"max_iterations": min(most, self._options.max_iterations or most)}

    def _shares(self, reaction: np.ndarray) -> list[np.ndarray]:
        """Reactions of this rank's nodes for each contact, local frame.

        If a node belongs to several contacts, the displacement determines only the sum of its
        reactions.

        Args:
            reaction: Reactions of all nodes of all ranks, along the principal axes.
        """
        counts = self.comm.allgather(len(self._turns))
        first = sum(counts[: self.comm.rank])
        mine = reaction[first : first + len(self._turns)]
        local = np.einsum("nij,ni->nj", self._turns, mine)
        ends = np.cumsum([contact.points.count for contact in self._contacts])
        return np.split(local, ends[:-1])

    def _placed(
        self, step: LoadStep, free: np.ndarray, c: np.ndarray, starts: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, list]:
        """Move a body held by contact alone to its start position.

        Returns:
            ``q`` at the start position; the forces of all rows that hold the body there; and the
            initial forces of earlier steps, adapted to this position.
        """
        first, stiffness = self.dim * self.nodes, self._scales["tied_stiffness"]
        anchors, rows = slice(first, first + self._anchored), self._parts[1]
        placed, moved = np.zeros((2, first + self._tied))
        held = rows.of(step.statics.start)
        placed[anchors] = stiffness[: self._anchored] * held
        if starts:  # the anchor forces of the last step give the body's position after it
            moved[anchors] = placed[anchors] - starts[0][anchors]
        q = self._motion(step, self.displacement(free, placed), c)
        q[anchors] -= held
        starts = [start + moved for start in starts]
        return q, placed, starts + [step.statics.share() * last for last in starts[:1]]

    def compliance(self) -> np.ndarray:
        """Compliance matrix between all rows on rank 0, empty on other ranks.  Collective."""
        changes = any(contact.given.changes for contact in self._contacts)
        if changes and not self._body.nonlinear:
            kept = self._responses()
            if 2 * kept.bytes_needed(self._parts) <= available_first(self.comm):
                return kept.compliance(self._factors(), self._parts)
        return compliance(self._factors(), self._parts)

    def _responses(self) -> Responses:
        """Return the cached columns of ``K^-1`` for the present stiffness.  Collective.

        They are used if frames or nodes of the contacts change between solutions.
        """
        if self._kept is None or self._kept[0] != self._stamps.stiffness:
            reach = [contact.points.reach for contact in self._contacts]
            anchored = self._parts[1].sums.indices
            columns = np.concatenate([*self.comm.allgather(np.concatenate(reach)), anchored])
            self._kept = self._stamps.stiffness, Responses(np.unique(columns))
        return self._kept[1]

    def _rows(self) -> Rows:
        """Rows of the contact nodes: one per direction, zero at constrained degrees of freedom."""
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
        """Tangential directions that supports prescribe at nodes with one free direction.

        Returns:
            Indices of the two tangential rows of each such node, ``shape=(k, 2)``; and the dyad of
            the prescribed direction, ``shape=(k, 2, 2)``, along the principal axes.
        """
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
        """Rows of the anchors, one for the degree of freedom of each regularisation spring."""
        dofs = self._body.anchors.dofs if self._body.anchors else np.zeros(0, int)
        size, first, whole = self._body.displacements.owned
        rows = (np.ones(dofs.size), first + dofs, np.arange(dofs.size + 1))
        sums = sparse.csr_matrix(rows, (dofs.size, whole))
        return Rows(self.comm, sparse.eye(dofs.size, format="csr"), sums, first, size)

    def _motion(self, step: LoadStep, displacement: np.ndarray, c: np.ndarray) -> np.ndarray:
        """Values of all rows at a displacement, on all ranks.

        These are slip and gap of all nodes along the principal axes, displacements of the anchors,
        and driving forces of the surfaces.

        Args:
            step: The load step.
            displacement: Displacement of owned degrees of freedom.
            c: Motions of driven surfaces.
        """
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
        """Displacement ``base`` plus the response to forces of all rows; owned dofs."""
        correction = self._held_by.solve(self._nodal(force))
        correction[self._body.fixed] = 0.0
        return base + correction

    def _nodal(self, force: np.ndarray) -> np.ndarray:
        """Nodal forces on owned dofs for forces of all rows; surface rows load no node."""
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
        """Solve the condensed problem on rank 0; return the best result on all ranks.

        Args:
            step: The load step, with its monitor.
            q: Values of all rows without forces.
            tol: Largest error.
            starts: Initial forces of all rows.
            acting: Norm of the external forces.
            limits: Options that replace the solver's own.
        """
        left = max(self._until - perf_counter(), 1e-9)
        options = replace(self._options, **limits | {"max_seconds": left})

        def solve(monitor: Callable | None):
            given = self.operator, self.friction, q, max(tol, 1e-14), starts, monitor
            return options.search(*given, external=acting, **self._scales)[0]

        tell = None if step.monitor is None else step.monitor.tell
        return by_first_rank(self.comm, solve, tell)

    # -- gathered from all ranks -----------------------------------------------------------------

    def gather(self, local: np.ndarray) -> np.ndarray:
        """Concatenate nodal rows of all ranks, in the order of ranks and contacts, on all ranks."""
        return np.concatenate(self.comm.allgather(np.ascontiguousarray(local)))

    def _gathered_stiffness(self, stiffness: Sequence[NodalStiffness]) -> dict[str, np.ndarray]:
        """Nodal stiffness of all ranks along the principal axes, force per length.

        Returns:
            A dictionary with ``stiffness``, ``shape=(n,)``, and with friction
            ``tangential_stiffness``, ``shape=(n, dim - 1, dim - 1)``.
        """
        gathered = {"stiffness": self.gather(np.concatenate([k.normal for k in stiffness]))}
        if self.dim > 1:
            blocks = np.concatenate([k.tangential for k in stiffness])
            turns = self._turns[:, :-1, :-1]
            turned = np.einsum("nij,njk,nlk->nil", turns, blocks, turns)
            gathered["tangential_stiffness"] = self.gather(turned)
        return gathered


def _search_options(step: LoadStep, fallbacks: bool) -> tuple[dict, ...]:
    """Options of the successive searches of a load step.

    If the body or a surface may slide, the first search uses Newton's method only.
    """
    return ({"fallbacks": False}, {})[: 1 + fallbacks] if step.may_slide else ({},)


def moved_across(contact: ContactStep, state: State) -> np.ndarray:
    """Whether supports prescribe only one tangential direction and move it, ``shape=(n,)``."""
    points, moved = contact.points, np.zeros(contact.points.count, dtype=bool)
    rows = points.supported
    moved[rows] = points.along.any(axis=1) & contact.known_slip(state)[rows].any(axis=1)
    return moved


def acting(contact: ContactStep, moved: np.ndarray) -> Friction:
    """Friction of a contact as it acts in the condensed problem.

    It acts only along the tangential directions that supports leave free.  At nodes that supports
    move perpendicular to their free direction, it acts along both.

    Args:
        contact: The contact.
        moved: Nodes that supports move perpendicular to their free direction, ``shape=(n,)``.
    """
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
    """Initial forces of all rows, computed from earlier load steps.

    The list contains the forces of the last step; their linear extrapolation; with a driven
    surface, the forces of the last step scaled to the new driving force; the forces of the step
    with the most similar ``q``; and the forces of the last step plus the change in that similar
    step.

    Args:
        q: Values of all rows without forces in the present step.
        starts: For each earlier step: ``q``, forces of all rows, and number of tied rows.
        surfaces: The driven surfaces, or None.
    """
    past = [(a, b) for a, b, _ in starts if a.size == q.size]
    if not past:
        return []
    last = past[-1]
    before = past[-2][1] if len(past) > 1 else 0.0  # nothing acted before the first step
    near = [last[1], 2 * last[1] - before]
    tied = 0 if surfaces is None else surfaces.tied
    if tied and last[0][-1] * q[-1] > 0.0:  # in equilibrium with the new driving force
        near.append(q[-1] / last[0][-1] * last[1])
    scale, others = np.abs(q[: q.size - tied]).max(), np.array([other for other, _ in past])
    distances = surfaces.distances(others, q) if tied else np.abs(others - q).max(axis=1)
    similar = int(np.argmin(distances))
    if similar < len(past) - 1 and distances[similar] < 0.1 * scale:
        near.append(past[similar][1])
        if similar > 0:
            near.append(last[1] + past[similar][1] - past[similar - 1][1])
    return near
