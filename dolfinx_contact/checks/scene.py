# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Checks of every scene: sizes, growth by turning, wear in leaps, contacts that do not touch, slip that turns; and which apply to a scene."""

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
    from dolfinx_contact.contact.interface import NodalStiffness

# Mean strain above which what linear elasticity leaves out, half the strain as a part of it, is a tenth; a displacement of so many times
# the size of a body is one in other units.
LARGE_STRAIN = 0.2
LARGE_DISPLACEMENT = 10.0

# By what a linear body that turns is too large, over the lengths by which contact and supports deform it.
GROWTH_SHARE = 0.1

# Displacements turn a body by no more than so many times the half of their spread over its thickness: more than the thickness over the
# root mean square of distances from the middle.
ROTATION_BOUND = 4.0

# Smallest gap over the size of the body, and cosine between facets and a plane, from which on nothing is likely to touch.
FAR_AWAY = 0.25
FACING_COSINE = 0.1

# Part of the frictional work that a turn of slip may leave unknown.
DOUBTFUL_WORK = 0.1


class Size(Check):
    """Of displacements far larger than the body, and of strains that are not small."""

    def run(self, step: CheckedStep) -> str | None:
        body = step.body
        largest = body.farthest(step.u[: body.size])
        if (
            2.0 * largest <= LARGE_STRAIN * body.thickness
        ):  # opposite faces may move against each other
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
    """Of a step that wears off so much, after it, that the next one is unloaded by more than it carries."""

    def run(self, step: CheckedStep) -> str | None:
        for contact, stiffness in zip(step.contacts, step.stiffness):
            if contact.wear is None or contact.laws.wears_within or contact.repeats > 1.0:
                continue
            times, depth, where = _worn_in_a_leap(contact, stiffness)
            if times > 1.0:
                return (
                    f"the depth of {depth:.2g} that this step wears off at the node at {place_of(where)} takes {times:.2g} times its "
                    "reaction from it: wear opens gaps only after a step, and so runs ahead of the pressure that makes it. Divide "
                    f"steps like this one into {int(np.ceil(times))} or more."
                )
        return None


def _worn_in_a_leap(contact: Contact, stiffness: NodalStiffness) -> tuple[float, float, list]:
    """Of the node whose depth worn in the last step unloads it most: by how many times its reaction, depth and position.  Collective.

    Wear is explicit: the depth opens the gap of the next step.  With the node's own stiffness ``kappa`` it takes ``kappa`` times
    the depth from the reaction.
    """
    depth, carried = contact.history.unloads
    taken = np.divide(stiffness.normal * depth, carried, np.zeros_like(depth), where=carried > 0)
    k = int(taken.argmax()) if taken.size else None
    mine = (
        (0.0, 0.0, []) if k is None else (float(taken[k]), float(depth[k]), contact.x[k].tolist())
    )
    return max(contact.comm.allgather(mine))


class Grows(Check):
    """Of a linear body that turns, and grows by so much that contact feels it."""

    def __init__(self) -> None:
        self._turn: Turn | None = None

    def run(self, step: CheckedStep) -> str | None:
        body, contacts, u = step.body, step.contacts, step.u
        pushed = [c.reaction[:, -1] / nodal.normal for c, nodal in zip(contacts, step.stiffness)]
        felt = GROWTH_SHARE * body.largest(np.concatenate(pushed))
        if self._turn is None:
            most = ROTATION_BOUND * _spread(body, u[: body.size]) / body.thickness  # of rotations
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
        if length <= -body.highest(-np.concatenate([contact.present.gap for contact in contacts])):
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


def _spread(body: ElasticBody, u: np.ndarray) -> float:
    """Half of the largest difference of displacements, at most.  Collective."""
    rows = body.displacements.rows(u)
    ends = np.concatenate([side.max(axis=0, initial=-np.inf) for side in (rows, -rows)])
    body.comm.Allreduce(MPI.IN_PLACE, ends, op=MPI.MAX)
    return float(np.linalg.norm(ends.reshape(2, -1).sum(axis=0))) / 2


class NothingTouches(Check):
    """Where no node has touched yet, of gaps and normals with which none is likely to."""

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
    """The smallest gap of any node.  Collective."""
    return -max(body.highest(-contact.present.gap) for contact in contacts)


def _facing(body: ElasticBody, contact: Contact) -> float:
    """Largest cosine between facets and a plane that they face.  Collective."""
    from dolfinx_contact.contact.facets import facets_of

    facets = facets_of(contact.displacements, contact.facets)
    return body.highest(
        np.concatenate([[-1.0], *(-part.outwards @ contact.frame[-1] for part in facets)])
    )


class NearestGap(Check):
    """By how much the nearest node misses its surface: on the way there no mistake, and no warning."""

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
    """Of one surface of several that is nowhere near while others are touched."""

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
    """Of work that a turn of slip within the step leaves unknown."""

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
    """The checks that apply to a body and its contacts.  Collective."""
    found: list[Check] = [Size()]
    rigid = [contact for contact in contacts if not contact.surface.deformable]
    between = [c for c in rigid if c.surface.varies or c.displacements.degree > 1]
    if between:
        from dolfinx_contact.checks import facets

        given = {contact: facets.facets_of_contact(contact) for contact in between}
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
