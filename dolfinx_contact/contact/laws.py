# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The laws of a contact: friction and wear, exchanged between steps, compared between ranks and with checkpoints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.contact.geometry import times
from dolfinx_contact.contact.input import check_coefficients, check_law, check_wear, warn_of_percent
from dolfinx_contact.law.friction import Friction, as_friction, at_most_rough, is_field
from dolfinx_contact.support.collective import agree, raised_together

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.contact_step import ContactStep
    from dolfinx_contact.contact.geometry import Frames
    from dolfinx_contact.law.wear import Wear
    from dolfinx_contact.surfaces.surface import Surface


def _fields() -> Any:
    """What evaluates fields, imported where a law has any."""
    from dolfinx_contact.contact import friction_field

    return friction_field


class Laws:
    """Friction and wear of a contact, which methods are given: it has space, surface, frames and nodes.

    Attributes:
        friction: The law at the nodes; fields are evaluated.
        kernel: The kernel's law of this friction.
        wear: The law of wear, or None.
        wear_field: Its coefficients at the nodes, if they are a field.
    """

    friction: Friction
    kernel: Any
    wear: Wear | None = None
    wear_field: Any = None

    def __init__(self) -> None:
        self._field: Friction | None = None  # the law given, if anything in it is a field

    def assign(self, contact: Contact, friction: Friction | float, empty: bool = False) -> None:
        """Take another law; fields as before anything has touched if ``empty``.  Collective where there are fields."""
        friction, field = as_friction(friction), None
        if getattr(friction, "field", False):
            field = friction
            friction = self._evaluated(contact, field, empty)
        else:
            check_law(contact.surface, friction, contact.V.mesh.geometry.dim)
            friction = at_most_rough(friction)
        if field is None or not _fields().followed(
            field
        ):  # what follows the pressure may be large without any
            warn_of_percent(friction)
        self._field = field
        self.take(contact, friction)

    def assign_wear(self, contact: Contact, wear: Wear | None) -> None:
        """Take another law of wear, or none.  Collective."""
        check_wear(wear, contact.surface)
        field = None
        with raised_together(contact.comm):
            if wear is not None:
                field = _fields().wear_on_nodes(contact, wear)
        self.wear, self.wear_field = wear, field

    def _evaluated(
        self,
        contact: Contact,
        field: Friction,
        empty: bool = False,
        axes: Any = None,
        pressure: np.ndarray | None = None,
        frames: Frames | None = None,
    ) -> Friction:
        """A law of fields at the nodes in some frames: of the present state, or as before anything has touched if ``empty``.  Collective."""
        frames = contact.history.frames if frames is None else frames
        none, gdim = np.zeros(contact.nodes.size), contact.V.mesh.geometry.dim
        names = _fields().followed(field)
        state = {name: none if empty else getattr(contact, name) for name in names}
        if pressure is not None:
            state["pressure"] = pressure
        with raised_together(contact.comm):
            friction = _fields().on_nodes(contact, field, state, frames, axes)
            check_law(contact.surface, friction, gdim, _fields().directed(field, gdim))
        return at_most_rough(friction)

    @property
    def field(self) -> bool:
        """Whether anything in the law is a field."""
        return self._field is not None

    def take(self, contact: Contact, friction: Friction) -> None:
        """These are the numbers at the nodes."""
        self.friction, self.kernel = friction, friction.law(contact.V.mesh.geometry.dim)

    @property
    def textured(self) -> bool:
        """Whether axes of friction depend on where nodes are on the surface."""
        return self._field is not None and self._field.of == "surface"

    @property
    def _axes_vary(self) -> bool:
        """Whether axes are a field."""
        return self._field is not None and is_field(self._field.given()["axes"])

    @property
    def wears_within(self) -> bool:
        """Whether what a step wears opens gaps in the same step; the same on all ranks."""
        return self.wear is not None and not self.wear.explicit

    @property
    def body_has_axes(self) -> bool:
        """Whether a field of axes belongs to the body."""
        return self._axes_vary and self._field.of == "body"

    def turned(
        self, used: ContactStep, at: np.ndarray, frame: np.ndarray, points: Any = None
    ) -> np.ndarray | float:
        """Radians by which axes at other positions differ from those in use, ``shape=(n,)``: of a texture of the surface, or of bodies.

        Args:
            used: The contact in a step.
            at: Positions relative to the surface, ``shape=(n, gdim)``.
            frame: Frames there, in its axes.
            points: Rows there, of a deformable surface.
        """
        contact, friction = used.given, used.friction
        axes, both = friction.axes, contact.geometry.renews_rows
        if not (self.textured or both) or friction.isotropic or used.points.dim == 2:
            return 0.0
        new = axes
        if self._axes_vary:
            new = _fields().axes_at(contact, self._field, at, frame, points)
        if both:  # their frames turn as well
            old = used.frames.frame
            new = np.broadcast_to((1.0, 0.0) if new is None else new, (len(at), 2))
            new = times(old[:, :2], np.einsum("ni,nij->nj", new, frame[:, :2]))
            axes = (1.0, 0.0) if axes is None else axes
        axes = np.broadcast_to(axes, new.shape)
        return np.abs(new[:, 0] * axes[:, 1] - new[:, 1] * axes[:, 0])

    @property
    def follow_pressure(self) -> bool:
        """Whether friction follows the pressure at the end of the step."""
        return self._field is not None and "pressure" in _fields().followed(self._field)

    def at_start(self, contact: Contact, frames: Frames) -> tuple[Friction, Friction | None]:
        """The law with which a step begins in some frames, and that itself where it follows the state; else None.  Collective."""
        if self._field is None:
            return self.friction, None
        friction = self._evaluated(contact, self._field, frames=frames)
        friction = self.friction if _same(friction, self.friction) else friction
        return friction, friction if _fields().followed(self._field) else None

    def under(
        self, contact: Contact, pressure: np.ndarray, before: Friction, frames: Frames
    ) -> Friction:
        """The law of other pressures, ``shape=(n,)``, with the axes of the one before, or that itself if nothing changes.  Collective."""
        if not self.follow_pressure:
            return before
        given = dict(axes=before.axes, pressure=pressure, frames=frames)
        friction = self._evaluated(contact, self._field, **given)
        return before if _same(friction, before) else friction

    def described(self, surface: Surface) -> dict[str, str]:
        """Surface and laws, but coefficients per node, in words, which have to be the same on all ranks."""
        driven = surface.driver.driven() if surface.free else "by displacement"
        law = "friction per node" if self.friction.mu.ndim == 2 else repr(self.friction)
        moved, turned = (repr(v.tolist()) for v in (surface.displacement, surface.rotation))
        return {
            "surface": repr(surface),
            "surface.displacement": moved,
            "surface.rotation": turned,
            "surface.free": driven,
            "friction": law,
            "wear": repr(self.wear),
        }

    def check(self, contact: Contact) -> None:
        """Raise a ``ValueError`` on all ranks if a law does not fit the nodes of one, or surface or laws differ.  Collective."""
        if contact.comm.size > 1:
            agree(contact.comm, **self.described(contact.surface), repeats=contact.repeats)
        with raised_together(contact.comm):
            check_coefficients(self.friction, contact.nodes.size)

    def save(self, contact: Contact) -> dict[str, np.ndarray]:
        """Coefficients, of a law that follows the state those without one, and axes of all nodes; surface and wear.

        Of a field of axes the directions that were given: those in the frames change with the state.
        """
        law, texture = self.friction, {}
        if self._field is not None:
            law = self._evaluated(contact, self._field, empty=True, axes=law.axes)
            if self._axes_vary:
                texture = {"texture": _fields().directions(contact, self._field)}
                law = Friction(law.mu, np.where(law.mu > 0, law.p, 1.0))
        wear = np.nan if self.wear is None else np.inf if self.wear.field else self.wear.coefficient
        parts = [contact.surface.described(), np.broadcast_to(wear, 2)]
        if self.wear is not None and self.wear.opposite.any():
            parts.append(np.broadcast_to(self.wear.opposite, 2))
        return {
            "laws": rows(law, contact.nodes.size),
            "rigid_plane": np.concatenate(parts),
        } | texture

    def check_saved(self, contact: Contact, saved: Mapping[str, np.ndarray]) -> None:
        """Raise a ``ValueError`` if another law or surface was saved."""
        named = {"laws": "friction", "texture": "friction", "rigid_plane": "plane or wear"}
        for name, array in self.save(contact).items():
            if name in saved and not _alike(saved[name], array):
                raise ValueError(
                    f"checkpoint: it was written with another {named[name]}: here {self.friction}, {contact.surface}, "
                    f"wear {self.wear}. Set what the run had, then load."
                )

    def load(self, contact: Contact, saved: Mapping[str, np.ndarray]) -> Friction | None:
        """Let fields have the values of the state that was saved; returns the law by which its last step was settled, None before the first."""
        if self._field is not None:
            self.take(contact, self._evaluated(contact, self._field))
        if "law_of_last_step" not in saved:
            return None
        then = saved["law_of_last_step"]
        if np.array_equal(then, rows(self.friction, contact.nodes.size)):
            return self.friction
        mu, p, axes = np.split(then, 3, axis=1)
        turned = (axes != (1.0, 0.0)).any()
        return Friction(mu, np.where(mu > 0, p, 1.0), axes=axes if turned else None)


def rows(law: Friction, n: int) -> np.ndarray:
    """Coefficients of cone and slip rule, and axes, of each of ``n`` nodes, ``shape=(n, 6)``."""
    parts = (law.mu, law.p, (1.0, 0.0) if law.axes is None else law.axes)
    return np.concatenate([np.broadcast_to(part, (n, 2)) for part in parts], axis=1)


def _alike(one: np.ndarray, other: np.ndarray) -> bool:
    return one.shape == other.shape and np.allclose(one, other, 1e-12, 0.0, equal_nan=True)


def _same(one: Friction, other: Friction) -> bool:
    """Whether two laws of nodes have the same coefficients and axes."""
    return all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in ("mu", "p", "axes")
    )
