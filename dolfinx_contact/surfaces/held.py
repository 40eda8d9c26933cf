# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Planes that force drives along directions in which supports hold contact nodes.

The held nodes carry friction, whose support is rigid: while they carry what the force asks of them, the plane stands still
relative to them, and they share it in proportion to what each could carry, ``mu r_n``.  If that is not enough, the plane
slides: then they carry that, against its motion, and the plane moves until springs and other nodes carry the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from mpi4py import MPI

from dolfinx_contact.support.attributes import surfaces_of
from dolfinx_contact.support.checks import STILL, place
from dolfinx_contact.support.collective import raised_together

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.surfaces.drive import Motion
    from dolfinx_contact.surfaces.surface import Surface

# Part of a motion along a held direction that may be rounding.
ALONG = 1e-8


class Holding(NamedTuple):
    """Nodes of a contact that hold a plane."""

    contact: Contact
    rows: np.ndarray  # (k,)
    axes: np.ndarray  # what the plane's motions move there, tangential components, (k, T, m)


def held_surfaces(
    body: ElasticBody, contacts: Sequence[Contact], last: np.ndarray, b: np.ndarray
) -> HeldSurfaces | None:
    """The planes that held nodes hold, None if there are none; from now on these motions are not free.  Collective.

    Args:
        last: The last displacement, owned degrees of freedom.
        b: An array that has the present boundary values.

    Raises:
        ValueError: on all ranks, where the law does not tell how nodes share what drives a surface.
    """
    for contact in contacts:
        if contact.surface.driver is not None:
            contact.surface.driver.hold()
        contact.drag(None)
    u = last.copy()
    u[body.fixed] = b[body.fixed]
    surfaces = surfaces_of(c for c in contacts if c.surface.motions)
    found = [_held_surface(body, contacts, surface, u) for surface in surfaces]
    return HeldSurfaces(body, [one for one in found if one is not None]) if any(found) else None


def _held_surface(
    body: ElasticBody, contacts: Sequence[Contact], surface: Surface, u: np.ndarray
) -> HeldSurface | None:
    """The plane with the motions that nodes hold.  Collective."""
    motions, on = surface.motions, [c for c in contacts if c.surface is surface]
    moving = [np.stack([c.carried_by(m.axis, m.turns) for m in motions], axis=2) for c in on]
    held, resists = [], np.zeros(len(motions))
    for contact, axes in zip(on, moving):
        rows = contact.points.supported
        f, rough = contact.points.along, contact.friction.at(rows).mu[..., :1] > 0.0
        along = axes[rows, :-1] * np.broadcast_to(rough, (rows.size, 1))[:, :, None]
        along -= f[:, :, None] * np.einsum("ni,nim->nm", f, along)[:, None, :]
        held.append(along)
        resists = np.maximum(resists, np.abs(along).max(axis=(0, 1), initial=0.0))
    largest = [np.abs(axes).max(axis=(0, 1), initial=0.0) for axes in moving]
    both = np.array([resists, np.max(largest, axis=0)])
    body.comm.Allreduce(MPI.IN_PLACE, both, op=MPI.MAX)
    resists, largest = both
    which = np.flatnonzero(resists > ALONG * largest)
    if which.size == 0:
        return None
    names, holding = [motions[k].name for k in which], []
    simple = not surface.curved and not any(motions[k].turns for k in which)
    with raised_together(body.comm):
        for contact, along in zip(on, held):
            mine = (np.abs(along[:, :, which]) > ALONG * largest[which]).any(axis=(1, 2))
            rows = contact.points.supported[mine]
            if mine.any() and (not simple or contact.points.along[mine].any()):
                where = place(contact.x, int(rows[0]))
                raise ValueError(
                    f"surface.free has {', '.join(map(repr, names))}, along or about which a boundary condition holds the contact "
                    f"node at {where}, which is free in another direction, or whose surface is no plane or turns: the friction "
                    "with which it holds the surface is not known. Leave these motions out of surface.free (on a plane of "
                    "symmetry they are none), and prescribe them by surface.displacement or surface.rotation."
                )
            holding.append(Holding(contact, rows, along[mine][:, :, which]))
    found = HeldSurface(body, surface, [motions[k] for k in which], holding, on)
    found.follow(u)
    return found


class HeldSurfaces:
    """All planes that held nodes hold."""

    def __init__(self, body: ElasticBody, surfaces: list):
        self._body, self._surfaces, self._beyond = body, surfaces, False

    def share(self) -> None:
        """Give the held nodes their share of what drives the planes, with the present reactions of the others.  Collective."""
        for surface in self._surfaces:
            surface.share()

    def slide(self) -> bool:
        """Let those planes slide whose held nodes cannot hold them; whether there are any.  Collective."""
        self._beyond = any([surface.beyond() for surface in self._surfaces])
        return any([surface.slide() for surface in self._surfaces])

    @property
    def beyond(self) -> bool:
        """Whether a plane that slides is pushed by more than all of its nodes carry with the reactions found before."""
        return self._beyond


class HeldSurface:
    """A plane that held nodes hold along some of its free motions.

    Args:
        body: The body, for sums over ranks.
        surface: The plane.
        motions: Those that are held, ``m`` of them, translations.
        holding: ``Holding`` of each contact on the plane.
        contacts: All contacts on it.
    """

    def __init__(
        self,
        body: ElasticBody,
        surface: Surface,
        motions: list[Motion],
        holding: list[Holding],
        contacts: Sequence[Contact],
    ):
        self._body, self._surface, self._motions = body, surface, motions
        self._holding, self._contacts = holding, contacts
        self._part = np.zeros(len(motions))
        self._slid = False
        surface.driver.hold(tuple(motion.name for motion in motions))

    def follow(self, u: np.ndarray) -> None:
        """Move the plane with the held nodes.  Collective.

        Raises:
            ValueError: on all ranks, if these do not move alike.
        """
        for _ in range(2):
            slips, columns, sizes = (
                [np.zeros(0)],
                [np.zeros((0, len(self._motions)))],
                [np.zeros(1)],
            )
            for contact, rows, axes in self._holding:
                contact.move(u)
                slips.append(contact.known_slip[rows].ravel())
                columns.append(axes.reshape(-1, len(self._motions)))
                sizes.append(np.abs(contact.displacement[rows]).ravel())
                sizes.append(np.abs(contact.last.displacement[rows]).ravel())
            s, D = np.concatenate(slips), np.concatenate(columns)
            sums = self._body.total(np.concatenate([(D.T @ D).ravel(), D.T @ s]))
            m = len(self._motions)
            way = np.linalg.solve(sums[: m * m].reshape(m, m), sums[m * m :])
            axes = np.array([motion.axis for motion in self._motions])
            self._surface.displacement = self._surface.displacement + way @ axes
            scale = STILL * self._body.largest(np.concatenate(sizes))
        apart = self._body.largest(np.abs(s - D @ way)) > scale
        if apart:
            names = ", ".join(repr(motion.name) for motion in self._motions)
            raise ValueError(
                f"surface.free has {names}, and boundary conditions move contact nodes differently along the plane: with which of "
                "them it moves is not known. Leave these motions out of surface.free, and prescribe them by surface.displacement."
            )

    def _carried(self) -> list[np.ndarray]:
        """What each held node could carry along each motion, ``shape=(k, T, m)``."""
        most = []
        for contact, rows, axes in self._holding:
            law, R = contact.friction.at(rows), contact.reaction[rows, -1]
            if axes.shape[1] == axes.shape[2] == 2:
                parts = [law.along_radii(axis) for axis in np.moveaxis(axes, 2, 0)]
            else:
                parts = [law.drag(axis) for axis in np.moveaxis(axes, 2, 0)]
            most.append(R[:, None, None] * np.stack(parts, axis=2))
        return most

    def share(self) -> None:
        """Give the held nodes their share.  Collective."""
        if self._slid:
            return
        m, most = len(self._motions), self._carried()
        sums = np.zeros((m, m + 1))
        for (contact, rows, axes), part in zip(self._holding, most):
            sums[:, :m] += np.einsum("nti,ntj->ij", axes, part)
            sums[:, m] -= np.einsum("nt,nti->i", contact.reaction[rows, :-1], axes)
        for contact in self._contacts:
            moved = [contact.carried_by(motion.axis, False) for motion in self._motions]
            sums[:, m] += [np.sum(contact.reaction * way) for way in moved]
        sums = self._body.total(sums)
        asked = self._surface.driver.pulled_by(self._motions) - sums[:, m]
        with np.errstate(divide="ignore", invalid="ignore"):
            self._part = np.linalg.lstsq(sums[:, :m], asked, rcond=ALONG)[0]
        if asked.any() and not np.allclose(sums[:, :m] @ self._part, asked):
            self._part = np.where(asked == 0.0, 0.0, np.sign(asked) * np.inf)
        length = np.linalg.norm(self._part)
        given = self._part / max(length, 1.0) if length < np.inf else np.zeros(m)
        for (contact, rows, _), part in zip(self._holding, most):
            reaction = contact.reaction.copy()
            reaction[rows, :-1] = part @ given
            contact.take(reaction=reaction)

    def beyond(self) -> bool:
        """Whether no spring pulls the plane, and its force along a motion is more than all nodes carry.  Collective."""
        most = sum((c.friction.mu.max(axis=-1) * c.reaction[:, -1]).sum() for c in self._contacts)
        most = float(self._body.total([most])[0])
        loose = [motion for motion in self._motions if motion.spring == 0.0]
        return bool((np.abs(self._surface.driver.pulled_by(loose)) > most).any())

    def slide(self) -> bool:
        """Let the plane slide if its held nodes cannot hold it; whether they cannot.  Collective.

        Raises:
            ValueError: on all ranks, if nothing tells the direction.
        """
        if np.linalg.norm(self._part) <= 1.0:
            return False
        if len(self._motions) > 1:
            raise ValueError(
                "surface.force is more than the friction of contact nodes that boundary conditions hold, and surface.free leaves two "
                "directions along the plane: in which it slides is not known. Leave one of them free, or prescribe the motion by "
                "surface.displacement."
            )
        sign = float(np.sign(self._part[0]))
        for contact, rows, axes in self._holding:
            slip = np.zeros((contact.points.count, axes.shape[1]))
            slip[rows] = -sign * axes[:, :, 0]
            contact.drag(slip)
        self._surface.driver.hold(past=sign)
        self._slid = True
        return True
