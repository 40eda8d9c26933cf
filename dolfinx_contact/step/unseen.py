# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What a step cannot see, told once a problem: surfaces between nodes, round bodies of straight cells, wear in leaps,
contacts that do not touch their surface, linear bodies that turn.

Lengths are compared with ``r_n / kappa``, by how much a reaction would push its node in by itself: a length that the
nodes miss is an error of their forces of about ``kappa`` times that length.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from mpi4py import MPI

from dolfinx_contact.bodies.rigid_motion import mean_strain
from dolfinx_contact.contact.fields import turn_of_nodes
from dolfinx_contact.contact.interface import NodalStiffness
from dolfinx_contact.results.record import Counts
from dolfinx_contact.support.collective import raised_together

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.facets import Facets

LOG = logging.getLogger("dolfinx_contact")

# Ratio of sizes of facets, or of stiffnesses, up to which two sides are alike.
ALIKE = 2.0

# What is missed, over the largest ``r_n / kappa``, above which the user is told.
SHARE = 1.0

# A surface stands out between nodes of a round body on its own account if it does by more than so many times the body.
ROUND = 4.0

# By what a linear body that turns is too large, over the lengths by which contact and supports deform it.
GROWN = 0.1

# Part of the reactions by which slopes of a wavy face, which are neglected, turn them; length of differences over the body.
SLOPES, ALONG = 0.1, 1e-5

# Radians by which a body may turn under axes that stay in space, though they are the body's.
STAY = 0.05

# What is rounding, over the size of a facet.
CLEAR = 1e-6

# Displacements turn a body by no more than so many times the half of their spread over its thickness: more than the thickness over the
# root mean square of distances from the middle.
LEVER = 4.0

# Part of a hollow between nodes that these may be open and still count as touching.
TOUCHING = 0.1

# Smallest gap over the size of the body, and cosine between facets and a plane, from which on nothing is likely to touch.
FAR, STEEP = 0.25, 0.1

# How often points of a facet are taken about the deepest one, and by how much nearer to each other.
CLOSER, FACTOR = 3, 0.25

# Part of what friction can carry that supports may take.
LOST = 0.005

# In how many facets of a rank points are moved: the surface may be slow to ask for distances.
DEEPEST = 64


class Missed(NamedTuple):
    """A length that the nodes of a facet miss; of two the larger one is the larger tuple."""

    length: float = 0.0
    where: tuple = ()
    size: float = 0.0  # of the facet
    needed: float = 0.0  # about the size that would see it
    hollow: bool = False  # whether the surface recedes

    def or_more(
        self, lengths: Any, where: Any, size: Any, needed: Any = 0.0, hollow: Any = False
    ) -> Missed:
        """This one, or the largest of those of some facets."""
        if not lengths.size:
            return self
        k = int(lengths.argmax())
        columns = (np.broadcast_to(column, lengths.shape)[k] for column in (size, needed, hollow))
        return max(self, Missed(float(lengths[k]), tuple(where[k].tolist()), *map(float, columns)))


def _has_between(contact: Contact) -> bool:
    """Whether anything rigid may stand between nodes of facets."""
    surface = contact.surface
    return (surface.varies or contact.displacements.degree > 1) and not surface.deformable


def _facets(contact: Contact) -> list[Facets]:
    from dolfinx_contact.contact.facets import facets_of

    return facets_of(contact.displacements, contact.facets)


class Unseen:
    """What the nodes of some contacts cannot see.  Collective.

    Nothing is set up and nothing looked at for contacts of planes with displacements of first order.

    Args:
        contacts: The contacts.
    """

    def __init__(self, contacts: Sequence[Contact]):
        between = [contact for contact in contacts if _has_between(contact)]
        self._facets = {contact: _facets(contact) for contact in between}
        self._straight = [contact for contact in self._facets if self._is_straight(contact)]
        self._between = [contact for contact in self._facets if contact.surface.varies]
        self._wavy = [c for c in self._between if getattr(c.surface, "height", None) is not None]
        # lists are replaced, not changed: after a failed step the problem goes on with a shallow copy
        self._leaps = self._apart = True  # to be looked at
        self._approach = True  # whether the log has yet to say that no node touches
        self._far = contacts if len(contacts) > 1 else []  # not yet touched while others are
        self._near = [contact for contact in contacts if contact.surface.deformable]
        self._sided = self._near  # which side carries the unknowns is to be looked at
        self._held = self._near  # whether supports take friction from nodes
        self._turn, self._turns = None, bool(contacts)  # to be looked at
        self._stay = [
            contact
            for contact in contacts
            if contact.laws.body_has_axes and not contact.surface.deformable
        ]

    def check(
        self,
        body: ElasticBody,
        contacts: Sequence[Contact],
        stiffness: list[NodalStiffness],
        u: np.ndarray,
        counts: Counts,
        large: bool,
    ) -> None:
        """Warn, of each kind once, of what is not seen in the present state.  Collective.

        Args:
            body: The body.
            contacts: All contacts.
            stiffness: Of their nodes.
            u: Displacement, degrees of freedom of this rank with those of ghosts.
            counts: Nodes of all contacts by status.
            large: Whether a displacement was too large, and the user told.
        """
        if self._facets:
            self._check_facets(u, dict(zip(contacts, stiffness)))
        self._wavy = [contact for contact in self._wavy if not _check_slopes(body, contact, u)]
        self._check_wear(contacts, stiffness)
        self._near = [contact for contact in self._near if not _check_strayed(contact)]
        self._sided = [contact for contact in self._sided if not _check_side(contact)]
        self._held = [contact for contact in self._held if not _check_held(body, contact)]
        self._stay = [contact for contact in self._stay if not _check_axes(contact, u)]
        self._turns = self._turns and not body.nonlinear
        if self._turns:
            self._check_turn(body, contacts, stiffness, u)
        self._apart = self._apart and not large and counts.stick + counts.slip == 0
        if self._apart and counts.open:
            smallest = -max(body.highest(-contact.present.gap) for contact in contacts)
            self._apart = not _check_apart(body, contacts, smallest)
            self._approach = (
                self._apart and self._approach and not _tell_gap(body, contacts, smallest)
            )
        if not self._apart and not large:
            self._far = [contact for contact in self._far if not _tell_far(body, contact)]

    def _check_facets(self, u: np.ndarray, stiffness: dict[Contact, NodalStiffness]) -> None:
        """What nodes of facets do not see.  Collective."""
        given = u, stiffness
        self._straight = self._unsaid(self._straight, self._off_straight, _of_straight, *given)
        self._between = self._unsaid(self._between, _between, _of_between, *given)

    def _unsaid(self, contacts: list, look: Callable, said: Callable, u: np.ndarray, stiffness: dict) -> list:  # fmt: skip
        """Of contacts whose facets a function looks at those of which nothing has been said.  Collective."""
        for contact in contacts:
            lengths = contact.reaction[:, -1] / stiffness[contact].normal
            pushed = contact.comm.allreduce(float(lengths.max(initial=0.0)), op=MPI.MAX)
            worn = None
            if contact.wear is not None:
                worn = contact.displacements.everywhere(contact.nodes, contact.wear_depth)
            with raised_together(contact.comm):
                missed = look(contact, self._facets[contact], u, pushed, worn)
            missed = max(contact.comm.allgather(missed))
            if missed.length > max(SHARE * pushed, CLEAR * missed.size):
                self._apart = self._apart and pushed > 0.0  # nothing touches, and that is why
                warnings.warn(said(contact, missed, pushed), stacklevel=5)
                return []
        return contacts

    def _check_wear(self, contacts: Sequence[Contact], stiffness: list[NodalStiffness]) -> None:
        """A step that wears off so much that the next one is unloaded by more than it carries.  Collective."""
        for contact, of in zip(contacts, stiffness):
            if (
                not self._leaps
                or contact.wear is None
                or contact.laws.wears_within
                or contact.repeats > 1.0
            ):
                continue
            times, depth, where = _worn_in_a_leap(contact, of)
            if times > 1.0:
                self._leaps = False
                warnings.warn(
                    f"the depth of {depth:.2g} that this step wears off at the node at {_said(where)} takes {times:.2g} times its "
                    "reaction from it: wear opens gaps only after a step, and so runs ahead of the pressure that makes it. Divide "
                    f"steps like this one into {int(np.ceil(times))} or more.",
                    stacklevel=4,
                )

    def _check_turn(
        self,
        body: ElasticBody,
        contacts: Sequence[Contact],
        stiffness: list[NodalStiffness],
        u: np.ndarray,
    ) -> None:
        """A linear body that turns, and grows by so much that contact feels it.  Collective."""
        pushed = [c.reaction[:, -1] / of.normal for c, of in zip(contacts, stiffness)]
        felt = GROWN * body.largest(np.concatenate(pushed))
        if self._turn is None:
            most = LEVER * _spread(body, u[: body.size]) / body.thickness  # of rotations
            if body.parts[1] == 1 and 0.5 * most**2 * body.extent <= felt:
                return
            from dolfinx_contact.step.turned import Turn

            self._turns = not any(contact.measure.axial for contact in contacts)
            self._turn = Turn(body)
        angles = self._turn.angles(u[: body.size])
        theta = float(np.linalg.norm(angles, axis=1).max())
        if theta <= CLEAR:
            return
        length = 0.5 * theta**2 * body.extent
        if not self._turns or length <= felt:
            return
        if length <= -body.highest(-np.concatenate([contact.present.gap for contact in contacts])):
            return
        share = self._turn.share(contacts, u[: body.size], angles)
        if share > GROWN and 0.5 * theta**2 > GROWN * mean_strain(body.displacements, u):
            self._turns = False
            warnings.warn(
                f"the body has turned by {theta:.3g} rad, and F is linear in u: so it grows by theta^2 / 2 = {0.5 * theta**2:.2g} of its "
                f"size, which is {share:.2g} times what contact and supports deform it by; pressures may be as far off. Let the surfaces "
                "turn instead of the body, or write F for large rotations, see docs/nonlinear.md.",
                stacklevel=4,
            )

    def _is_straight(self, contact: Contact) -> bool:
        """Whether nodes between vertices stand where straight edges put them, beside a body that is round.  Collective."""
        most = 0.0
        for facets in self._facets[contact]:
            flat = facets.at_nodes @ facets.x[:, facets.vertices]
            off = np.linalg.norm(facets.x - flat, axis=-1) / facets.size[:, None]
            sag = np.abs(facets.sag_at_nodes()) / facets.size[:, None]
            most = max(most, float(np.where(off < CLEAR, sag, 0.0).max(initial=0.0)))
        return contact.comm.allreduce(most, op=MPI.MAX) > CLEAR

    def _off_straight(
        self, contact: Contact, of: list[Facets], u: np.ndarray, pushed: float, _worn: Any
    ) -> Missed:
        """How far nodes amid straight edges stand off a round body, where it touches."""
        missed = Missed()
        for facets in of:
            x = _positions(contact, facets, u)
            sag = facets.sag_at_nodes()
            if (
                pushed == 0.0
            ):  # nodes that stand out of a hollow body, and touch nothing, are no harm
                sag = np.maximum(sag, 0.0)
            sag = np.abs(sag).max(axis=1)
            near = contact.surface.distances(x).min(axis=1) <= sag
            missed = missed.or_more(sag * near, x[:, 0], facets.size)
        return missed


def _spread(body: ElasticBody, u: np.ndarray) -> float:
    """Half of the largest difference of displacements, at most.  Collective."""
    rows = body.displacements.rows(u)
    ends = np.concatenate([of.max(axis=0, initial=-np.inf) for of in (rows, -rows)])
    body.comm.Allreduce(MPI.IN_PLACE, ends, op=MPI.MAX)
    return float(np.linalg.norm(ends.reshape(2, -1).sum(axis=0))) / 2


def _check_side(contact: Contact) -> bool:
    """Log, as soon as nodes press, that the other side would be the better slave; whether they do.  Collective."""
    found = contact.placement.sides(contact.present, contact.points)
    if found is None:
        return False
    size, stiff = found
    coarse, hard = size > ALIKE, stiff > ALIKE
    if (coarse and stiff > 1 / ALIKE) or (hard and size > 1 / ALIKE):
        if contact.comm.rank == 0:
            LOG.info(
                f"{contact!r}: its facets are {size:.2g} times as large as those opposite, and its body is {stiff:.2g} times as stiff. "
                "The finer or softer side is better as the one that carries the unknowns: swap both, and compare."
            )
    return True


def _check_axes(contact: Contact, u: np.ndarray) -> bool:
    """Warn of a body that has turned on a rigid surface, which carries no axes of a body; whether it has.  Collective."""
    dim = contact.points.dim
    x = contact.x[:, :dim]
    moved = u[contact.displacements.dofs(contact.nodes)]
    turned = turn_of_nodes(x, x + moved, contact.comm)
    angle = float(np.arccos(np.clip((np.trace(turned) - dim + 2) / 2, -1.0, 1.0)))
    if angle <= STAY:
        return False
    warnings.warn(
        f"the body has turned by {angle:.2g} rad at {contact!r}, and axes of friction that a callable or Function gives for it stay as they are "
        "in space on a rigid surface: let the surface turn instead of the body, or, if the axes are the surface's, say of='surface'.",
        stacklevel=5,
    )
    return True


def _check_held(body: ElasticBody, contact: Contact) -> bool:
    """Warn of nodes that have no friction because supports hold them along a deformable surface; whether any node presses.  Collective."""
    force = contact.friction.mu.max(axis=-1) * contact.reaction[:, -1]
    without = contact.placement.clamped(body.fixed, contact.history.frames)
    all, lost, count = body.total([force.sum(), force[without].sum(), without.sum()])
    if lost > LOST * all:
        warnings.warn(
            f"{count:.0f} contact nodes with {100 * lost / all:.2g} % of what friction can carry are held along the other body by boundary conditions. "
            "They have no friction, as if on a plane of symmetry: hold the body elsewhere, or let the other side carry the unknowns.",
            stacklevel=5,
        )
    return all > 0.0


def _check_strayed(contact: Contact) -> bool:
    """Warn of a node that has slid too far along a deformable surface; whether one has.  Collective."""
    slid, most = max(contact.comm.allgather(contact.placement.strayed(contact.present)))
    if slid <= most:
        return False
    warnings.warn(
        f"a node has slid by {slid:.3g} along a deformable surface, further than half of the shortest edge of a facet, {most:.3g}: "
        "who presses on whom is that of the undeformed state, and forces go to where the other body was. Take sliding='large'.",
        stacklevel=5,
    )
    return True


def _check_slopes(body: ElasticBody, contact: Contact, u: np.ndarray) -> bool:
    """Warn of a wavy face that is steep where nodes press on it, whose reactions are along the plane's normal; whether it is.  Collective."""
    step, force = ALONG * body.extent, contact.reaction[:, -1]
    (_, x), squares = contact.placement.ended_at(u), np.zeros(len(force))
    with raised_together(contact.comm):
        for along in contact.frame[:-1]:
            ends = [contact.surface.distances(x + side * step * along) for side in (1.0, -1.0)]
            with np.errstate(invalid="ignore"):  # infinite where it has none
                slopes = (ends[0] - ends[1]) / (2.0 * step)
            squares += np.square(np.where(np.isfinite(slopes), slopes, 0.0))
    sizes = np.array([squares @ force**2, force @ force])
    turned, pressing = np.sqrt(contact.comm.allreduce(sizes))
    if not turned > SLOPES * pressing:
        return False
    warnings.warn(
        f"the height of {contact.surface!r} slopes by {turned / pressing:.2g} where nodes press on it, and its normal stays that of the plane: "
        "reactions have the wrong direction by that part. Take a dc.RigidSurface, whose distance is that from the face.",
        stacklevel=5,
    )
    return True


def _check_apart(body: ElasticBody, contacts: Sequence[Contact], smallest: float) -> bool:
    """Warn, where no node has touched yet, of gaps and normals with which none is likely to; whether it did.  Collective."""
    if smallest > FAR * body.extent:
        warnings.warn(
            f"no node touches: the smallest gap is {smallest:.3g}, in a body of size {body.extent:.3g}. If that is not meant, "
            "check place and units of the surface, the direction of loads and the facets.",
            stacklevel=4,
        )
        return True
    flat = [contact for contact in contacts if not contact.surface.curved]
    facing = [
        body.highest(
            np.concatenate(
                [
                    [-1.0],
                    *(-of.outwards @ contact.frame[-1] for of in _facets(contact)),
                ]
            )
        )
        for contact in flat
    ]
    if len(flat) < len(contacts) or max(facing) > STEEP:
        return False
    warnings.warn(
        f"no node touches, and no facet of the contact faces {flat[0].surface!r}: the normals of all of them are across the "
        "plane's or along it. Check the normal, which shows from the plane into the body, and the facets.",
        stacklevel=4,
    )
    return True


def _tell_gap(body: ElasticBody, contacts: Sequence[Contact], smallest: float) -> bool:
    """Log by how much the nearest node misses its surface: on the way there no mistake, and no warning; whether it does.  Collective."""
    if body.total(sum(contact.covered.sum() for contact in contacts)) == 0.0:
        if contacts[0].comm.rank == 0:
            LOG.warning(
                "no node touches yet, and none is opposite the other body: check the facets of both, if it is not on its way"
            )
        return True
    if smallest <= CLEAR * body.extent:
        return False
    if contacts[0].comm.rank == 0:
        LOG.warning(
            "no node touches yet: the smallest gap is %.3g, in a body of size %.3g",
            smallest,
            body.extent,
        )
    return True


def _tell_far(body: ElasticBody, contact: Contact) -> bool:
    """Log that one surface of several is nowhere near; whether that is said, or it is touched.  Collective."""
    if body.largest(contact.reaction[:, -1]) > 0.0:
        return True
    gap = -body.highest(-contact.present.gap)
    far = gap > FAR * body.extent
    if far and contact.comm.rank == 0:
        LOG.warning(
            "no node touches %r yet: the smallest gap is %.3g, in a body of size %.3g",
            contact.surface,
            gap,
            body.extent,
        )
    return far


def _between(
    contact: Contact, of: list[Facets], u: np.ndarray, _pushed: Any, worn: np.ndarray
) -> Missed:
    """How far the surface goes into facets between nodes, or recedes between nodes that touch."""
    missed = Missed()
    for facets in of:
        x = _positions(contact, facets, u)
        gaps = contact.surface.distances(x)
        opened = gaps if worn is None else gaps + worn[facets.nodes]
        near = opened.min(axis=1) < facets.size
        if near.any():
            some = facets.some(near)
            missed = _within(contact, some, x[near], gaps[near], opened[near], missed)
    return missed


def _within(
    contact: Contact,
    facets: Facets,
    x: np.ndarray,
    gaps: np.ndarray,
    opened: np.ndarray | None,
    missed: Missed,
) -> Missed:
    """The same of facets with nodes at ``x``, at these distances from the surface and these gaps."""
    from dolfinx_contact.contact.facets import gauss

    half, centre = 0.5, np.full((len(x), 1, facets.dim), 0.5)
    rule = 2.0 * gauss(facets.dim) - 1.0
    for _ in range(CLOSER):
        rows, touch = np.arange(len(x)), opened.max(axis=1)[:, None]
        at = np.clip(centre + half * rule, 0.0, 1.0)
        shapes = facets.shapes(at)
        points = shapes @ x
        there = contact.surface.distances(points)
        bulge = np.einsum("mqk,mk->mq", shapes, gaps) - there
        bulge[np.isinf(there)] = 0.0
        above = np.einsum("mqk,mk->mq", shapes, opened)
        hollow = np.where(touch < -TOUCHING * bulge, -bulge, 0.0)
        sunk = bulge - np.maximum(above, 0.0)
        own = np.abs(bulge) > ROUND * np.abs(facets.sag(facets.hats(at)))
        lengths = np.where(own, np.maximum(sunk, hollow), 0.0)
        k = lengths.argmax(axis=1)
        lengths, of_all = lengths[rows, k], np.abs(bulge[rows, k])
        part = np.divide(lengths, of_all, np.zeros(len(x)), where=of_all > 0)
        needed = facets.size * np.sqrt(part) / 8
        receding = hollow[rows, k] > sunk[rows, k]
        missed = missed.or_more(lengths, points[rows, k], facets.size, needed, receding)
        depth = bulge - above
        some = np.argsort(-depth.max(axis=1), kind="stable")[:DEEPEST]
        centre, half = at[some, depth[some].argmax(axis=1)][:, None], half * FACTOR
        facets, x, gaps, opened = facets.some(some), x[some], gaps[some], opened[some]
    return missed


def _of_between(contact: Contact, missed: Missed, pushed: float) -> str:
    near = f"near {_said(missed.where)}"
    if missed.hollow:
        does = f"recedes by {missed.length:.2g} between nodes that touch, {near}"
    else:
        does = f"goes {missed.length:.2g} into the body between its nodes, {near}"
    felt = f"more than reactions push nodes in, {pushed:.2g}" if pushed else "and no node feels it"
    return (
        f"{contact.surface!r} {does}, {felt}: contact is asked for at nodes alone, and facets of size {missed.size:.2g} "
        f"there do not see the surface, so that forces may be off by as much as they are large. Take facets of about "
        f"{missed.needed:.1g} there, unless this is but a first touch that later steps leave behind."
    )


def _of_straight(contact: Contact, missed: Missed, pushed: float) -> str:
    felt = f"more than reactions push nodes in, {pushed:.2g}" if pushed else "where nothing touches"
    return (
        f"displacements of second order on straight-sided cells of a round surface: near {_said(missed.where)} nodes between "
        f"vertices stand {missed.length:.2g} off the round surface through these, {felt}, so that they carry too much or "
        "nothing. Take a mesh whose cells are of second order, with curved edges, or displacements of first order, or "
        f"smaller cells; they are {missed.size:.2g} there."
    )


def _said(where: ArrayLike) -> str:
    where = np.where(np.abs(where) < CLEAR * np.abs(where).max(), 0.0, where)
    return f"({', '.join(f'{x:.3g}' for x in where)})"


def _positions(contact: Contact, facets: Facets, u: np.ndarray) -> np.ndarray:
    """Where the nodes of facets now stand, ``shape=(m, k, gdim)``."""
    return facets.x + u[contact.displacements.dofs(facets.nodes.ravel())].reshape(facets.x.shape)


def _worn_in_a_leap(contact: Contact, stiffness: NodalStiffness) -> tuple[float, float, list]:
    """Of the node whose depth worn in the last step unloads it most: by how many times its reaction, depth and position.  Collective.

    Wear is explicit: the depth opens the gap of the next step.  With the node's own stiffness ``kappa`` it takes ``kappa`` times
    the depth from the reaction.
    """
    depth, carried = contact.history.unloads
    taken = np.divide(stiffness.normal * depth, carried, np.zeros_like(depth), where=carried > 0)
    k = int(taken.argmax()) if taken.size else None
    mine = (0.0, 0.0, []) if k is None else (float(taken[k]), float(depth[k]), contact.x[k].tolist())  # fmt: skip
    return max(contact.comm.allgather(mine))
