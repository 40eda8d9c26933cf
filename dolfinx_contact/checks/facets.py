# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Checks for geometry that contact nodes do not resolve.

They find rigid surfaces that vary between nodes, round bodies meshed with straight cells, and
steep slopes of wavy faces.  Lengths are compared with ``r_n / kappa``, the indentation of a node
by its own reaction: an unresolved length causes an error of nodal forces of about ``kappa``
times that length.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from dolfinx_contact.checks.check import NEGLIGIBLE_PART, Check, CheckedStep, place_of
from dolfinx_contact.contact.contact import Contact
from dolfinx_contact.contact.facets import Facets, gauss
from dolfinx_contact.support.collective import raised_together

# Unresolved length, relative to the largest ``r_n / kappa``, above which a warning is issued.
LARGEST_MISS = 1.0

# A surface, and not the faceting of a round body, causes a deviation between nodes if the deviation
# is larger than this factor times the distance of the smooth body from the facet.
SAG_RATIO = 4.0

# Largest slope of a wavy face, weighted by reactions; slopes are neglected in the contact normal.
# Length of finite differences, relative to the size of the body.
LARGEST_SLOPE = 0.1
DIFFERENCE_LENGTH = 1e-5

# Largest gap of nodes that count as touching, as a fraction of the depth of a hollow between them.
TOUCHING_PART = 0.1

# Number of sampling passes per facet, each around the deepest point so far, and the ratio of
# sampling distances of successive passes.
CLOSER_LOOKS = 3
CLOSER_FACTOR = 0.25

# Number of facets of a rank that are sampled more than once, as distances of a surface may be slow
# to evaluate.
DEEPEST_FACETS = 64


class Missed(NamedTuple):
    """Length that the nodes of a facet do not resolve; tuples compare by length."""

    length: float = 0.0
    where: tuple = ()  # position
    size: float = 0.0  # facet size
    needed: float = 0.0  # approximate facet size that resolves the length
    hollow: bool = False  # whether the surface recedes between the nodes

    def or_more(
        self, lengths: Any, where: Any, size: Any, needed: Any = 0.0, hollow: Any = False
    ) -> Missed:
        """The entry with the largest length among this one and those of some facets.

        Args:
            lengths: Unresolved length of each facet, ``shape=(m,)``.
            where: Positions, ``shape=(m, gdim)``.
            size, needed, hollow: Fields of this name, one value per facet or for all.
        """
        if not lengths.size:
            return self
        k = int(lengths.argmax())
        columns = (np.broadcast_to(column, lengths.shape)[k] for column in (size, needed, hollow))
        return max(self, Missed(float(lengths[k]), tuple(where[k].tolist()), *map(float, columns)))


class _FacetCheck(Check):
    """Base class of checks for lengths that the nodes of facets do not resolve.  Collective.

    Args:
        facets: Facets of each contact.
    """

    def __init__(self, facets: dict[Contact, list[Facets]]):
        self._facets = {
            contact: parts for contact, parts in facets.items() if self._concerns(contact, parts)
        }

    def run(self, step: CheckedStep) -> str | None:
        stiffness = dict(zip(step.contacts, step.stiffness))
        for contact, facets in self._facets.items():
            lengths = contact.reaction[:, -1] / stiffness[contact].normal
            pushed = contact.comm.allreduce(float(lengths.max(initial=0.0)), op=MPI.MAX)
            worn = None
            if contact.wear is not None:
                worn = contact.displacements.on_all_ranks(contact.nodes, contact.wear_depth)
            with raised_together(contact.comm):
                missed = self._missed(contact, facets, step.u, pushed, worn)
            missed = max(contact.comm.allgather(missed))
            if missed.length > max(LARGEST_MISS * pushed, NEGLIGIBLE_PART * missed.size):
                return self._message(contact, missed, pushed)
        return None

    @abstractmethod
    def _concerns(self, contact: Contact, facets: list[Facets]) -> bool:
        """Whether the check applies to a contact.  Collective."""

    @abstractmethod
    def _missed(
        self,
        contact: Contact,
        parts: list[Facets],
        u: np.ndarray,
        pushed: float,
        worn: np.ndarray | None,
    ) -> Missed:
        """The largest length that the nodes of this rank's facets do not resolve.

        Args:
            contact: The contact.
            parts: Facets of the contact.
            u: Displacement, owned degrees of freedom and ghosts.
            pushed: Largest indentation of a node by its own reaction, length.
            worn: Worn depth at this rank's nodes and ghosts; None without wear.
        """

    @abstractmethod
    def _message(self, contact: Contact, missed: Missed, pushed: float) -> str:
        """Message for an unresolved length.

        Args:
            contact: The contact.
            missed: The unresolved length.
            pushed: Largest indentation of a node by its own reaction, length.
        """


class Straight(_FacetCheck):
    """Warning if nodes on straight edges deviate from a round body in the contact zone."""

    def _concerns(self, contact: Contact, parts: list[Facets]) -> bool:
        """Whether mid-edge nodes lie on straight edges although the body is round.  Collective."""
        most = 0.0
        for facets in parts:
            flat = facets.at_nodes @ facets.x[:, facets.vertices]
            off = np.linalg.norm(facets.x - flat, axis=-1) / facets.size[:, None]
            sag = np.abs(facets.sag_at_nodes()) / facets.size[:, None]
            most = max(most, float(np.where(off < NEGLIGIBLE_PART, sag, 0.0).max(initial=0.0)))
        return contact.comm.allreduce(most, op=MPI.MAX) > NEGLIGIBLE_PART

    def _missed(
        self, contact: Contact, parts: list[Facets], u: np.ndarray, pushed: float, worn: Any
    ) -> Missed:
        missed = Missed()
        for facets in parts:
            x = _positions(contact, facets, u)
            sag = facets.sag_at_nodes()
            # Without contact, nodes that protrude from a concave body do no harm.
            if pushed == 0.0:
                sag = np.maximum(sag, 0.0)
            sag = np.abs(sag).max(axis=1)
            near = contact.surface.distances(x).min(axis=1) <= sag
            missed = missed.or_more(sag * near, x[:, 0], facets.size)
        return missed

    def _message(self, contact: Contact, missed: Missed, pushed: float) -> str:
        felt = (
            f"more than reactions push nodes in, {pushed:.2g}"
            if pushed
            else "where nothing touches"
        )
        return (
            f"displacements of second order on straight-sided cells of a round surface: near {place_of(missed.where)} nodes between "
            f"vertices stand {missed.length:.2g} off the round surface through these, {felt}, so that they carry too much or "
            "nothing. Take a mesh whose cells are of second order, with curved edges, or displacements of first order, or "
            f"smaller cells; they are {missed.size:.2g} there."
        )


class Between(_FacetCheck):
    """Warning if the surface penetrates facets between nodes, or recedes between touching nodes."""

    def _concerns(self, contact: Contact, parts: list[Facets]) -> bool:
        return contact.surface.varies

    def _missed(
        self,
        contact: Contact,
        parts: list[Facets],
        u: np.ndarray,
        pushed: float,
        worn: np.ndarray | None,
    ) -> Missed:
        missed = Missed()
        for facets in parts:
            x = _positions(contact, facets, u)
            gaps = contact.surface.distances(x)
            opened = gaps if worn is None else gaps + worn[facets.nodes]
            near = opened.min(axis=1) < facets.size
            if near.any():
                some = facets.some(near)
                missed = _within(contact, some, x[near], gaps[near], opened[near], missed)
        return missed

    def _message(self, contact: Contact, missed: Missed, pushed: float) -> str:
        near = f"near {place_of(missed.where)}"
        if missed.hollow:
            does = f"recedes by {missed.length:.2g} between nodes that touch, {near}"
        else:
            does = f"goes {missed.length:.2g} into the body between its nodes, {near}"
        felt = (
            f"more than reactions push nodes in, {pushed:.2g}" if pushed else "and no node feels it"
        )
        return (
            f"{contact.surface!r} {does}, {felt}: contact is asked for at nodes alone, and facets of size {missed.size:.2g} "
            f"there do not see the surface, so that forces may be off by as much as they are large. Take facets of about "
            f"{missed.needed:.1g} there, unless this is but a first touch that later steps leave behind."
        )


def _within(
    contact: Contact,
    facets: Facets,
    x: np.ndarray,
    gaps: np.ndarray,
    opened: np.ndarray | None,
    missed: Missed,
) -> Missed:
    """The larger of ``missed`` and the largest length that the nodes of some facets do not resolve.

    Args:
        contact: The contact.
        facets: The facets.
        x: Current positions of their nodes, ``shape=(m, k, gdim)``.
        gaps: Distances of these nodes from the surface without wear, ``shape=(m, k)``.
        opened: Gaps of these nodes with wear, ``shape=(m, k)``.
        missed: Largest unresolved length of other facets.
    """
    half, centre = 0.5, np.full((len(x), 1, facets.dim), 0.5)
    rule = 2.0 * gauss(facets.dim) - 1.0
    for _ in range(CLOSER_LOOKS):
        rows, touch = np.arange(len(x)), opened.max(axis=1)[:, None]
        at = np.clip(centre + half * rule, 0.0, 1.0)
        shapes = facets.shapes(at)
        points = shapes @ x
        there = contact.surface.distances(points)
        bulge = np.einsum("mqk,mk->mq", shapes, gaps) - there
        bulge[np.isinf(there)] = 0.0
        above = np.einsum("mqk,mk->mq", shapes, opened)
        hollow = np.where(touch < -TOUCHING_PART * bulge, -bulge, 0.0)
        sunk = bulge - np.maximum(above, 0.0)
        own = np.abs(bulge) > SAG_RATIO * np.abs(facets.sag(facets.hats(at)))
        lengths = np.where(own, np.maximum(sunk, hollow), 0.0)
        k = lengths.argmax(axis=1)
        lengths, of_all = lengths[rows, k], np.abs(bulge[rows, k])
        part = np.divide(lengths, of_all, np.zeros(len(x)), where=of_all > 0)
        needed = facets.size * np.sqrt(part) / 8
        receding = hollow[rows, k] > sunk[rows, k]
        missed = missed.or_more(lengths, points[rows, k], facets.size, needed, receding)
        depth = bulge - above
        some = np.argsort(-depth.max(axis=1), kind="stable")[:DEEPEST_FACETS]
        centre, half = at[some, depth[some].argmax(axis=1)][:, None], half * CLOSER_FACTOR
        facets, x, gaps, opened = facets.some(some), x[some], gaps[some], opened[some]
    return missed


def _positions(contact: Contact, facets: Facets, u: np.ndarray) -> np.ndarray:
    """Current positions of the nodes of facets, ``shape=(m, k, gdim)``, at displacement ``u``."""
    return facets.x + u[contact.displacements.dofs(facets.nodes.ravel())].reshape(facets.x.shape)


class Slopes(Check):
    """Warning if a wavy face is steep in the contact zone, as its normal reactions ignore slopes.

    Args:
        contact: A contact on a plane with a ``height``.
    """

    def __init__(self, contact: Contact):
        self._contact = contact

    def run(self, step: CheckedStep) -> str | None:
        contact, u = self._contact, step.u
        length, force = DIFFERENCE_LENGTH * step.body.extent, contact.reaction[:, -1]
        (_, x), squares = contact.geometry.ended_at(u), np.zeros(len(force))
        with raised_together(contact.comm):
            for along in contact.frame[:-1]:
                ends = [
                    contact.surface.distances(x + side * length * along) for side in (1.0, -1.0)
                ]
                with np.errstate(invalid="ignore"):  # distances are infinite outside the surface
                    slopes = (ends[0] - ends[1]) / (2.0 * length)
                squares += np.square(np.where(np.isfinite(slopes), slopes, 0.0))
        sizes = np.array([squares @ force**2, force @ force])
        turned, pressing = np.sqrt(contact.comm.allreduce(sizes))
        if not turned > LARGEST_SLOPE * pressing:
            return None
        return (
            f"the height of {contact.surface!r} slopes by {turned / pressing:.2g} where nodes press on it, and its normal stays that of the plane: "
            "reactions have the wrong direction by that part. Take a dc.RigidSurface, whose distance is that from the face."
        )
