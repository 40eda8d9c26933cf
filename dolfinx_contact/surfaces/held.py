# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Force-driven planes whose tangential motion constrained contact nodes prevent by friction.

Dirichlet conditions constrain these nodes along the plane.  While their friction suffices, the
plane sticks to them, and the tangential force that the plane needs is distributed over them in
proportion to their friction limits ``mu r_n``.  If it does not suffice, the plane slides: the nodes
then carry their friction limits against its motion, and springs and other nodes carry the remaining
force.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from mpi4py import MPI

from dolfinx_contact.support.attributes import surfaces_of
from dolfinx_contact.support.checks import NEGLIGIBLE_LENGTH, place
from dolfinx_contact.support.collective import raised_together

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.state import State
    from dolfinx_contact.surfaces.drive import Motion
    from dolfinx_contact.surfaces.surface import Surface

# Component of a motion along constrained directions, relative, up to which it counts as rounding.
HELD_ROUNDING = 1e-8


class Holding(NamedTuple):
    """Constrained nodes of one contact whose friction resists the motion of a plane."""

    contact: int  # index of the contact
    rows: np.ndarray  # indices of the nodes, (k,)
    axes: np.ndarray  # tangential displacement by a unit of each motion of the plane, (k, T, m)


def held_surfaces(
    body: ElasticBody, contacts: Sequence[ContactStep], last: np.ndarray, b: np.ndarray
) -> HeldSurfaces | None:
    """Find planes whose motion constrained nodes prevent by friction, and move them with the nodes.
    Collective.

    These motions are no longer free in the step.

    Args:
        body: The body.
        contacts: ``ContactStep`` of each contact.
        last: Displacement of the last step, owned degrees of freedom.
        b: Array that contains the boundary values of this step at fixed degrees of freedom.

    Returns:
        ``HeldSurfaces``, or None if there are none.

    Raises:
        ValueError: on all ranks, if the friction of the constrained nodes is not determined.
    """
    for contact in contacts:
        if contact.surface.driver is not None:
            contact.surface.driver.hold()
    u = last.copy()
    u[body.fixed] = b[body.fixed]
    surfaces = surfaces_of(c for c in contacts if c.surface.motions)
    found = [_held_surface(body, contacts, surface, u) for surface in surfaces]
    return HeldSurfaces([one for one in found if one is not None]) if any(found) else None


def _held_surface(
    body: ElasticBody, contacts: Sequence[ContactStep], surface: Surface, u: np.ndarray
) -> HeldSurface | None:
    """Return one surface with its motions that constrained nodes prevent, or None.  Collective."""
    motions = surface.motions
    on = [(k, c) for k, c in enumerate(contacts) if c.surface is surface]
    moving = [np.stack([c.unit_motion(m.axis, m.turns) for m in motions], axis=2) for _, c in on]
    held, resists = [], np.zeros(len(motions))
    for (_, contact), axes in zip(on, moving):
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
    which = np.flatnonzero(resists > HELD_ROUNDING * largest)
    if which.size == 0:
        return None
    names, holding = [motions[k].name for k in which], []
    simple = not surface.curved and not any(motions[k].turns for k in which)
    with raised_together(body.comm):
        for (k, contact), along in zip(on, held):
            mine = (np.abs(along[:, :, which]) > HELD_ROUNDING * largest[which]).any(axis=(1, 2))
            rows = contact.points.supported[mine]
            if mine.any() and (not simple or contact.points.along[mine].any()):
                where = place(contact.x, int(rows[0]))
                raise ValueError(
                    f"surface.free has {', '.join(map(repr, names))}, along or about which a boundary condition holds the contact "
                    f"node at {where}, which is free in another direction, or whose surface is no plane or turns: the friction "
                    "with which it holds the surface is not known. Leave these motions out of surface.free (on a plane of "
                    "symmetry they are none), and prescribe them by surface.displacement or surface.rotation."
                )
            holding.append(Holding(k, rows, along[mine][:, :, which]))
    of_nodes = [k for k, _ in on]
    found = HeldSurface(body, surface, [motions[k] for k in which], holding, of_nodes)
    found.follow(contacts, u)
    return found


class HeldSurfaces:
    """All planes whose motion constrained nodes prevent by friction; immutable.

    Attributes:
        beyond: Whether the force on a sliding plane exceeds the friction of all its nodes, computed
            with the last normal reactions.
        dragged: Slip directions imposed by sliding planes, by index of the contact,
            ``shape=(n, gdim - 1)``.
    """

    def __init__(self, surfaces: list[HeldSurface], beyond: bool = False):
        self._surfaces, self.beyond = surfaces, beyond
        self.dragged: dict[int, np.ndarray] = {}
        for surface in surfaces:
            self.dragged |= surface.dragged

    def shared(self, contacts: Sequence[ContactStep], nodes: Sequence[State]) -> tuple[State, ...]:
        """Return states with the friction of constrained nodes that balances the force on planes.
        Collective.

        All other reactions are kept.
        """
        for surface in self._surfaces:
            nodes = surface.shared(contacts, nodes)
        return tuple(nodes)

    def slid(self, contacts: Sequence[ContactStep], nodes: Sequence[State]) -> HeldSurfaces | None:
        """Return a copy in which planes slide whose constrained nodes cannot hold them, or None.
        Collective.

        None means that all constrained nodes can carry the friction required of them.
        """
        beyond = any([surface.beyond(contacts, nodes) for surface in self._surfaces])
        found = [surface.slid(contacts, nodes) for surface in self._surfaces]
        if not any(one is not None for one in found):
            return None
        return HeldSurfaces([new or old for new, old in zip(found, self._surfaces)], beyond)


class HeldSurface:
    """A plane whose tangential motion constrained contact nodes prevent by friction.

    Args:
        body: The body, for sums over ranks.
        surface: The plane.
        motions: Translations that the nodes prevent, ``m`` of them.
        holding: ``Holding`` of each contact on the plane that has such nodes.
        contacts: Indices of all contacts on the plane.
        dragged: Slip directions of the nodes if the plane slides, see ``HeldSurfaces``; None if
            not.
    """

    def __init__(
        self,
        body: ElasticBody,
        surface: Surface,
        motions: list[Motion],
        holding: list[Holding],
        contacts: Sequence[int],
        dragged: dict[int, np.ndarray] | None = None,
    ):
        self._body, self._surface, self._motions = body, surface, motions
        self._holding, self._contacts, self.dragged = holding, contacts, dragged or {}
        self._slides = dragged is not None
        if not self._slides:
            surface.driver.hold(tuple(motion.name for motion in motions))

    def follow(self, contacts: Sequence[ContactStep], u: np.ndarray) -> None:
        """Move the plane by the mean displacement of its constrained nodes.  Collective.

        Raises:
            ValueError: on all ranks, if the nodes' displacements along the plane differ.
        """
        for _ in range(2):
            slips, columns, sizes = (
                [np.zeros(0)],
                [np.zeros((0, len(self._motions)))],
                [np.zeros(1)],
            )
            for k, rows, axes in self._holding:
                contact = contacts[k].with_present_surface()
                state = contact.at(u)
                slips.append(contact.known_slip(state)[rows].ravel())
                columns.append(axes.reshape(-1, len(self._motions)))
                sizes.append(np.abs(state.displacement[rows]).ravel())
                sizes.append(np.abs(contact.last.displacement[rows]).ravel())
            s, D = np.concatenate(slips), np.concatenate(columns)
            sums = self._body.total(np.concatenate([(D.T @ D).ravel(), D.T @ s]))
            m = len(self._motions)
            way = np.linalg.solve(sums[: m * m].reshape(m, m), sums[m * m :])
            axes = np.array([motion.axis for motion in self._motions])
            self._surface.displacement = self._surface.displacement + way @ axes
            scale = NEGLIGIBLE_LENGTH * self._body.largest(np.concatenate(sizes))
        apart = self._body.largest(np.abs(s - D @ way)) > scale
        if apart:
            names = ", ".join(repr(motion.name) for motion in self._motions)
            raise ValueError(
                f"surface.free has {names}, and boundary conditions move contact nodes differently along the plane: with which of "
                "them it moves is not known. Leave these motions out of surface.free, and prescribe them by surface.displacement."
            )

    def _friction_limits(
        self, contacts: Sequence[ContactStep], nodes: Sequence[State]
    ) -> list[np.ndarray]:
        """Return friction limits of the constrained nodes along each motion, ``shape=(k, T, m)``.

        One array for each ``Holding``, force units, ``T = gdim - 1``.
        """
        most = []
        for k, rows, axes in self._holding:
            law, R = contacts[k].friction.at(rows), nodes[k].reaction[rows, -1]
            if axes.shape[1] == axes.shape[2] == 2:
                parts = [law.times_radii(axis) for axis in np.moveaxis(axes, 2, 0)]
            else:
                parts = [law.drag(axis) for axis in np.moveaxis(axes, 2, 0)]
            most.append(R[:, None, None] * np.stack(parts, axis=2))
        return most

    def _required_fraction(
        self,
        contacts: Sequence[ContactStep],
        nodes: Sequence[State],
        most: list[np.ndarray],
    ) -> np.ndarray:
        """Return the fraction of the friction limits that equilibrium requires, ``shape=(m,)``.
        Collective.

        One value for each motion, infinite if the limits are zero.  Present tangential reactions of
        the constrained nodes are disregarded: they are the unknowns.
        """
        m = len(self._motions)
        sums = np.zeros((m, m + 1))
        for (k, rows, axes), part in zip(self._holding, most):
            sums[:, :m] += np.einsum("nti,ntj->ij", axes, part)
            sums[:, m] -= np.einsum("nt,nti->i", nodes[k].reaction[rows, :-1], axes)
        for k in self._contacts:
            moved = [contacts[k].unit_motion(motion.axis, False) for motion in self._motions]
            sums[:, m] += [np.sum(nodes[k].reaction * way) for way in moved]
        sums = self._body.total(sums)
        asked = self._surface.driver.prescribed_forces(self._motions) - sums[:, m]
        with np.errstate(divide="ignore", invalid="ignore"):
            part = np.linalg.lstsq(sums[:, :m], asked, rcond=HELD_ROUNDING)[0]
        if asked.any() and not np.allclose(sums[:, :m] @ part, asked):
            part = np.where(asked == 0.0, 0.0, np.sign(asked) * np.inf)
        return part

    def shared(self, contacts: Sequence[ContactStep], nodes: Sequence[State]) -> list[State]:
        """Return the states with the friction of constrained nodes in balance with the force.
        Collective.

        The friction is capped at the limit.  The states of a sliding plane are returned unchanged.
        """
        nodes = list(nodes)
        if self._slides:
            return nodes
        most = self._friction_limits(contacts, nodes)
        asked = self._required_fraction(contacts, nodes, most)
        length = np.linalg.norm(asked)
        given = asked / max(length, 1.0) if length < np.inf else np.zeros(len(asked))
        for (k, rows, _), part in zip(self._holding, most):
            reaction = nodes[k].reaction.copy()
            reaction[rows, :-1] = part @ given
            nodes[k] = nodes[k]._replace(reaction=reaction)
        return nodes

    def beyond(self, contacts: Sequence[ContactStep], nodes: Sequence[State]) -> bool:
        """Whether the force on the plane along a motion exceeds the friction of all nodes.
        Collective.

        Only motions without a spring are considered.
        """
        pressed = ((contacts[k], nodes[k].reaction[:, -1]) for k in self._contacts)
        most = sum((contact.friction.mu.max(axis=-1) * R).sum() for contact, R in pressed)
        most = float(self._body.total([most])[0])
        loose = [motion for motion in self._motions if motion.spring == 0.0]
        return bool((np.abs(self._surface.driver.prescribed_forces(loose)) > most).any())

    def slid(self, contacts: Sequence[ContactStep], nodes: Sequence[State]) -> HeldSurface | None:
        """Return the plane in the sliding state if its nodes cannot carry the force, or None.
        Collective.

        Raises:
            ValueError: on all ranks, if the direction of sliding is not determined.
        """
        if self._slides:
            return None
        part = self._required_fraction(contacts, nodes, self._friction_limits(contacts, nodes))
        if np.linalg.norm(part) <= 1.0:
            return None
        if len(self._motions) > 1:
            raise ValueError(
                "surface.force is more than the friction of contact nodes that boundary conditions hold, and surface.free leaves two "
                "directions along the plane: in which it slides is not known. Leave one of them free, or prescribe the motion by "
                "surface.displacement."
            )
        sign, dragged = float(np.sign(part[0])), {}
        for k, rows, axes in self._holding:
            slip = np.zeros((contacts[k].points.count, axes.shape[1]))
            slip[rows] = -sign * axes[:, :, 0]
            dragged[k] = slip
        self._surface.driver.hold(past=sign)
        given = self._surface, self._motions, self._holding, self._contacts, dragged
        return HeldSurface(self._body, *given)
