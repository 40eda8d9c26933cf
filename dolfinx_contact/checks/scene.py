# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Checks of a whole problem, and the selection of all checks that apply to it.

The checks in this module concern the size of displacements and strains, growth by rotation, large
steps of explicit wear, contacts that do not touch, and changes of the slip direction.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from dolfinx_contact.bodies.rigid_motion import mean_strain
from dolfinx_contact.checks.check import NEGLIGIBLE_PART, Check, CheckedStep, place_of

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.checks.growth import Turn
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.facets import Facets
    from dolfinx_contact.contact.interface import NodalStiffness

# Mean strain above which the relative error of linear elasticity, half the strain, exceeds a tenth.
# Displacement, relative to the size of the body, above which units are probably inconsistent.
LARGE_STRAIN = 0.2
LARGE_DISPLACEMENT = 10.0

# Largest spurious growth of a rotating linear body, relative to its deformation by contact and
# supports.
GROWTH_SHARE = 0.1

# Upper bound of the rotation of a body, relative to half the spread of displacements divided by its
# thickness.  It exceeds the ratio of thickness to root mean square distance from the centre.
ROTATION_BOUND = 4.0

# Smallest gap relative to the size of the body above which contact is unlikely; cosine between
# facet normals and the direction to a plane below which contact is unlikely.
FAR_AWAY = 0.25
FACING_COSINE = 0.1

# Largest uncertainty of the frictional work due to changes of the slip direction, relative to the
# work.
DOUBTFUL_WORK = 0.1


class Size(Check):
    """Warning about displacements or strains too large for linear elasticity."""

    def run(self, step: CheckedStep) -> str | None:
        body = step.body
        largest = body.farthest(step.u[: body.size])
        if (
            2.0 * largest <= LARGE_STRAIN * body.thickness
        ):  # factor 2: opposite faces may move towards each other
            return None
        if largest > LARGE_DISPLACEMENT * body.extent:
            return (
                f"the largest displacement, {largest:.3g}, is {largest / body.extent:.2g} times the size of the body, "
                f"{body.extent:.3g}: check the units of lengths, loads and moduli."
                + " (Elasticity is linear here.)"
                * (not body.nonlinear)
            )
        strain = 0.0 if body.nonlinear else mean_strain(body.displacements, step.u)
        if strain <= LARGE_STRAIN:
            return None
        return (
            f"the body is strained by {strain:.0%} (root mean square of the largest principal strain): F is linear in u, which "
            "holds for strains of some per cent. Check loads, moduli and how far supports and surfaces move, or write F for large "
            "strains."
        )


class WearsInLeaps(Check):
    """Warning if explicit wear in a step would unload a node by more than its reaction."""

    def run(self, step: CheckedStep) -> str | None:
        for contact, stiffness in zip(step.contacts, step.stiffness):
            if contact.wear is None or contact.laws.wears_within or contact.repeats > 1.0:
                continue
            times, depth, where = _largest_unloading(contact, stiffness)
            if times > 1.0:
                return (
                    f"the depth of {depth:.2g} that this step wears off at the node at {place_of(where)} takes {times:.2g} times its "
                    "reaction from it: wear opens gaps only after a step, and so runs ahead of the pressure that makes it. Divide "
                    f"steps like this one into {int(np.ceil(times))} or more."
                )
        return None


def _largest_unloading(contact: Contact, stiffness: NodalStiffness) -> tuple[float, float, list]:
    """Largest relative unloading of a node by wear, its worn depth and its position.

    Explicit wear opens the gap of the next step.  With the nodal stiffness ``kappa``, it reduces
    the reaction by ``kappa`` times the depth; the ratio of this to the reaction is returned.
    Collective.

    Args:
        contact: The contact.
        stiffness: Nodal stiffness of the contact.
    """
    depth, carried = contact.history.worn_and_force
    taken = np.divide(stiffness.normal * depth, carried, np.zeros_like(depth), where=carried > 0)
    k = int(taken.argmax()) if taken.size else None
    mine = (
        (0.0, 0.0, []) if k is None else (float(taken[k]), float(depth[k]), contact.x[k].tolist())
    )
    return max(contact.comm.allgather(mine))


class Grows(Check):
    """Warning if a linear body rotates so far that its spurious growth affects contact."""

    def __init__(self) -> None:
        self._turn: Turn | None = None

    def run(self, step: CheckedStep) -> str | None:
        body, contacts, u = step.body, step.contacts, step.u
        pushed = [c.reaction[:, -1] / nodal.normal for c, nodal in zip(contacts, step.stiffness)]
        felt = GROWTH_SHARE * body.largest(np.concatenate(pushed))
        if self._turn is None:
            most = (
                ROTATION_BOUND * _half_spread(body, u[: body.size]) / body.thickness
            )  # upper bound of the rotation, radians
            if body.parts[1] == 1 and 0.5 * most**2 * body.extent <= felt:
                return None
            from dolfinx_contact.checks.growth import Turn

            if any(contact.measure.axial for contact in contacts):
                return ""
            self._turn = Turn(body)
        angles = self._turn.angles(u[: body.size])
        theta = float(np.linalg.norm(angles, axis=1).max())
        length = 0.5 * theta**2 * body.extent
        if theta <= NEGLIGIBLE_PART or length <= felt:
            return None
        if length <= smallest_gap(body, contacts):
            return None
        share = self._turn.share(contacts, u[: body.size], angles)
        if not (
            share > GROWTH_SHARE
            and 0.5 * theta**2 > GROWTH_SHARE * mean_strain(body.displacements, u)
        ):
            return None
        return (
            f"the body has turned by {theta:.3g} rad, and F is linear in u: so it grows by theta^2 / 2 = {0.5 * theta**2:.2g} of its "
            f"size, which is {share:.2g} times what contact and supports deform it by; pressures may be as far off. Let the surfaces "
            "turn instead of the body, or write F for large rotations, see docs/nonlinear.md."
        )


def _half_spread(body: ElasticBody, u: np.ndarray) -> float:
    """Upper bound of half the largest difference between nodal displacements, length.
    Collective.
    """
    rows = body.displacements.rows(u)
    ends = np.concatenate([side.max(axis=0, initial=-np.inf) for side in (rows, -rows)])
    body.comm.Allreduce(MPI.IN_PLACE, ends, op=MPI.MAX)
    return float(np.linalg.norm(ends.reshape(2, -1).sum(axis=0))) / 2


class NothingTouches(Check):
    """Warning if no node has touched yet, and gaps or normals make contact unlikely."""

    def run(self, step: CheckedStep) -> str | None:
        body, contacts, counts = step.body, step.contacts, step.counts
        if step.over & {"Size", "Straight", "Between"} or counts.stick + counts.slip > 0:
            return ""
        if not counts.open:
            return None
        smallest = smallest_gap(body, contacts)
        if smallest > FAR_AWAY * body.extent:
            return (
                f"no node touches: the smallest gap is {smallest:.3g}, in a body of size {body.extent:.3g}. If that is not meant, "
                "check place and units of the surface, the direction of loads and the facets."
            )
        flat = [contact for contact in contacts if not contact.surface.curved]
        if (
            len(flat) < len(contacts)
            or max(_facing(body, contact) for contact in flat) > FACING_COSINE
        ):
            return None
        return (
            f"no node touches, and no facet of the contact faces {flat[0].surface!r}: the normals of all of them are across the "
            "plane's or along it. Check the normal, which shows from the plane into the body, and the facets."
        )


def smallest_gap(body: ElasticBody, contacts: Sequence[Contact]) -> float:
    """Smallest gap of all contact nodes on all ranks, length.  Collective."""
    return -body.highest(-np.concatenate([contact.present.gap for contact in contacts]))


def _facing(body: ElasticBody, contact: Contact) -> float:
    """Largest cosine between the outward facet normals of a contact and the direction to its plane.

    It is positive if any facet faces the plane.  Collective.
    """
    cosines = (-part.outwards @ contact.frame[-1] for part in _facets(contact))
    return body.highest(np.concatenate([[-1.0], *cosines]))


def _facets(contact: Contact) -> list[Facets]:
    """Geometry of the facets of a contact, grouped by shape.  Collective."""
    from dolfinx_contact.contact.facets import facets_of

    return facets_of(contact.displacements, contact.facets)


class NearestGap(Check):
    """Log message with the smallest gap while no node touches, which may be intended."""

    level = logging.WARNING

    def run(self, step: CheckedStep) -> str | None:
        body, contacts = step.body, step.contacts
        if "NothingTouches" in step.over:
            return ""
        if not step.counts.open:
            return None
        if body.total(sum(contact.covered.sum() for contact in contacts)) == 0.0:
            return "no node touches yet, and none is opposite the other body: check the facets of both, if it is not on its way"
        smallest = smallest_gap(body, contacts)
        if smallest <= NEGLIGIBLE_PART * body.extent:
            return None
        return f"no node touches yet: the smallest gap is {smallest:.3g}, in a body of size {body.extent:.3g}"


class OneFarAway(Check):
    """Log message if one surface is far away from all nodes while others are in contact.

    Args:
        contact: The contact with this surface.
    """

    level = logging.WARNING

    def __init__(self, contact: Contact):
        self._contact = contact

    def run(self, step: CheckedStep) -> str | None:
        body, contact = step.body, self._contact
        if "Size" in step.over or "NothingTouches" not in step.over:
            return None
        if body.largest(contact.reaction[:, -1]) > 0.0:
            return ""
        gap = smallest_gap(body, [contact])
        if gap <= FAR_AWAY * body.extent:
            return None
        return f"no node touches {contact.surface!r} yet: the smallest gap is {gap:.3g}, in a body of size {body.extent:.3g}"


class SlipTurns(Check):
    """Warning if changes of the slip direction within a step make the frictional work uncertain."""

    def run(self, step: CheckedStep) -> str | None:
        may = [c for c in step.contacts if c.history.doubtful_work is not None]
        if not may:
            return None
        sums = [[c.history.doubtful_work for c in may], [c.dissipation.sum() for c in may]]
        doubtful, work = step.body.total(np.sum(sums, axis=1))
        if doubtful <= DOUBTFUL_WORK * work:
            return None
        return (
            f"slip has turned in this step between directions of different friction, which leaves the frictional work unknown by {doubtful:.2g}, "
            f"{doubtful / work:.0%} of all so far: it counts as a part of a curve, a sharp corner has so much more or less. Divide the step that turns."
        )


def checks_of(body: ElasticBody, contacts: Sequence[Contact]) -> tuple[Check, ...]:
    """All checks that apply to a body and its contacts.  Collective."""
    found: list[Check] = [Size()]
    rigid = [contact for contact in contacts if not contact.surface.deformable]
    between = [c for c in rigid if c.surface.varies or c.displacements.degree > 1]
    if between:
        from dolfinx_contact.checks import facets

        given = {contact: _facets(contact) for contact in between}
        found += [facets.Straight(given), facets.Between(given)]
        wavy = [c for c in between if getattr(c.surface, "height", None) is not None]
        found += map(facets.Slopes, wavy)
    found.append(WearsInLeaps())
    pairs = [contact for contact in contacts if contact.surface.deformable]
    if pairs:
        from dolfinx_contact.checks import two_bodies

        kinds = two_bodies.Strayed, two_bodies.BetterSlave, two_bodies.HeldAlong
        found += [kind(contact) for kind in kinds for contact in pairs]
    textured = [contact for contact in rigid if contact.laws.body_has_axes]
    if textured:
        from dolfinx_contact.checks.axes import AxesStay

        found += map(AxesStay, textured)
    if contacts and not body.nonlinear:
        found.append(Grows())
    found += [NothingTouches(), NearestGap()]
    if len(contacts) > 1:
        found += map(OneFarAway, contacts)
    return (*found, SlipTurns())
