# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Assembly of a load step from the accepted state, loads, boundary values, surfaces and laws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI

from dolfinx_contact.contact.contact_step import frames_of, nodal_stiffness, step_of
from dolfinx_contact.problem_input import frames_of_step
from dolfinx_contact.step.load_step import LoadStep, Monitor, Stamps, new_stamp

if TYPE_CHECKING:
    from dolfinx_contact.accepted import Accepted
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.geometry import Frames
    from dolfinx_contact.contact.interface import NodalStiffness
    from dolfinx_contact.problem import ContactProblem
    from dolfinx_contact.surfaces.held import HeldSurfaces

# Largest predicted motion of a body in a step, relative to the largest motion of supports.
FARTHEST_RATIO = 2.0

# The body moves as in the last step if the two predictions differ by at most this fraction of the
# largest motion of supports.
STEADY_PART = 0.05


class StepMaker:
    """Builder of the load steps of a problem, which keeps data that do not change between steps.

    Args:
        problem: The problem, with its body.

    Attributes:
        stiffness: ``NodalStiffness`` of each contact in the last step.
    """

    def __init__(self, problem: ContactProblem) -> None:
        self._contacts = problem.contacts
        self._points = [contact.points for contact in problem.contacts]
        self.stiffness: list[NodalStiffness] = []
        self._stamps, self._unit = Stamps(), 1.0
        self._laws = [contact.friction for contact in problem.contacts]
        self._freedom = self._present_freedom()

    def step(
        self,
        problem: ContactProblem,
        at: np.ndarray | None = None,
        before: LoadStep | None = None,
        holding: HeldSurfaces | None = None,
    ) -> LoadStep:
        """See ``ContactProblem.load_step``.  Collective."""
        body, last = problem.body, problem.accepted
        start = last.x
        assembled = body.refresh(start)
        driven = [contact for contact in self._contacts if contact.surface.free]
        curved = [contact for contact in driven if contact.surface.curved]
        if curved:
            from dolfinx_contact.surfaces.driven import approach

            u = start if at is None else at
            approach(body, lambda: [step_of(c, frames=frames_of(c, u)) for c in curved], u)
        b, external = body.load()
        likely = _predicted_displacement(problem, last, b) if at is None else at
        old = (
            [None] * len(self._contacts) if before is None else [c.frames for c in before.contacts]
        )
        frames, turned = frames_of_step(self._contacts, body, start, likely, old, self._points)
        contacts = self._contact_steps(body, assembled, frames, turned, begins=before is None)
        guess = body.taken(problem.u.x.array), 2 * start - last.x_before
        if before is not None:
            holding = holding or before.holding
        elif driven:
            from dolfinx_contact.surfaces.held import held_surfaces

            holding = held_surfaces(body, contacts, start, b)
            contacts = [
                c.with_present_surface() for c in contacts
            ]  # surfaces move with the nodes that hold them
        parts = self._contacts_and_options(body, contacts, holding)
        kind = LoadStep
        if body.nonlinear:
            from dolfinx_contact.step.nonlinear import NonlinearStep as kind
        monitor = None if problem.monitor is None else Monitor(problem.monitor, body.comm)
        return kind(
            body,
            b=b,
            external=external,
            starts=guess if at is None else (at,),
            tol=problem.tol,
            unit=self._unit,
            last=start,
            monitor=monitor,
            stamps=self._stamps,
            **parts,
        )

    def _contact_steps(
        self, body: Any, assembled: int, frames: Sequence[Frames], turned: bool, begins: bool
    ) -> list[ContactStep]:
        """Return ``ContactStep`` of each contact, and update the version numbers.  Collective.

        Args:
            body: The body.
            assembled: Number of times that its stiffness has been assembled.
            frames: Frames of each contact.
            turned: Whether the rows of any contact have changed.
            begins: Whether the step is new, not a repetition.
        """
        old = self._stamps
        if turned or assembled != old.stiffness:
            both = zip(self._contacts, frames)
            self.stiffness = [nodal_stiffness(c, body.K, placed.points) for c, placed in both]
            size = body.largest(np.abs(body.displacements.x))
            # Any unit that keeps squares within the range of double precision.
            self._unit = body.largest(body.cancelling(np.full(body.size, size))) or 1.0
        given = zip(self._contacts, self.stiffness, frames)
        contacts = [step_of(contact, *parts, begins=True) for contact, *parts in given]
        laws = [contact.friction for contact in contacts]
        changed = any(one is not other for one, other in zip(laws, self._laws))
        changed = body.comm.allreduce(changed, op=MPI.LOR)
        self._laws = laws
        rows, law = new_stamp() if turned else old.rows, new_stamp() if changed else old.law
        begun = new_stamp() if begins else old.step
        self._stamps = Stamps(assembled, rows, law, old.parts, begun)
        return contacts

    def _contacts_and_options(
        self, body: Any, contacts: Sequence[ContactStep], holding: HeldSurfaces | None
    ) -> dict:
        """Return contacts and optional attributes of a ``LoadStep``, by name.  Collective."""
        parts: dict[str, Any] = {"holding": holding}
        if holding is not None and holding.dragged:
            dragged = holding.dragged
            contacts = [c.replaced(dragged=dragged.get(k)) for k, c in enumerate(contacts)]
        if any(contact.surface.motions for contact in contacts):
            from dolfinx_contact.surfaces.driven import DrivenSurfaces

            parts["surfaces"] = surfaces = DrivenSurfaces(body, contacts)
            contacts = surfaces.with_columns(contacts)
        if len(contacts) > 1:
            from dolfinx_contact.contact.shared import shared_nodes

            parts["shared"] = shared_nodes(contacts, body.fixed)
        setup_key = [*self._present_freedom(), holding is not None and sorted(holding.dragged)]
        if setup_key != self._freedom:
            self._freedom = setup_key
            self._stamps = self._stamps._replace(parts=new_stamp())
        return parts | {"contacts": tuple(contacts)}

    def _present_freedom(self) -> list:
        """Return the free motions and springs of each contact's surface."""
        drivers = [contact.surface.driver for contact in self._contacts]
        return [() if driver is None else driver.setup_key for driver in drivers]


def _predicted_displacement(
    problem: ContactProblem, last: Accepted, b: np.ndarray
) -> np.ndarray | None:
    """Return a predicted displacement for the end of a step, or None.  Collective.

    The mortar rows between bodies that slide on each other are evaluated at this displacement.  The
    prediction is the displacement under the new loads ``b`` with the last reactions, or a linear
    extrapolation of the last two steps if both nearly agree.  The result is None if bodies do not
    slide, or if the predicted motion is large compared with the motion of supports, as on soft
    springs.
    """
    body = problem.body
    sliding = [c for c in problem.contacts if c.geometry.renews_rows and not c.history.empty]
    if not sliding or body.nonlinear or body.loose is not None:
        return None
    known = last.free_state
    if known is None or body.displacements.mixed:  # checkpoints do not contain it for mixed spaces
        return None
    given = np.zeros_like(last.x)
    given[body.fixed] = (b - last.x)[body.fixed]
    x = 2 * last.x - last.x_before  # extrapolation, with friction and deformation
    x[body.fixed] = b[body.fixed]
    load, exact = b - known.load, body.exact
    more = body.free_state(b) - known.displacement if exact else body.solve(load, rough=True)
    if body.farthest(last.x + more - x) > STEADY_PART * body.farthest(given):
        x = last.x + more
        if not exact:  # refine to six digits
            x += body.solve(load - body.multiply(more), rough=True)
    slid = body.largest(np.array([c.geometry.slid(x - last.x, c.history) for c in sliding]))
    if slid < problem.geometry_tol or body.farthest(x - last.x) > FARTHEST_RATIO * body.farthest(
        given
    ):
        return None
    return x
