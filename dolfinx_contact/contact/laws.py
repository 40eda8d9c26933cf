# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Friction and wear laws of a contact: assignment, evaluation at the nodes, checkpoints."""

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


def _friction_field() -> Any:
    """Return the module that evaluates fields, imported only when a law has any."""
    from dolfinx_contact.contact import friction_field

    return friction_field


class Laws:
    """Friction and wear laws of a contact, evaluated at its nodes.

    Methods receive the contact, which provides space, surface, frames and nodes.

    Attributes:
        friction: Friction law at the nodes, with fields evaluated.
        kernel: Law of the compiled kernel for this friction.
        wear: Wear law, or None.
        wear_field: Wear coefficients at the nodes if they are given by a field, otherwise None.
    """

    friction: Friction
    kernel: Any
    wear: Wear | None = None
    wear_field: Any = None

    def __init__(self) -> None:
        self._field: Friction | None = None  # the law given, if anything in it is a field

    def assign(self, contact: Contact, friction: Friction | float, empty: bool = False) -> None:
        """Assign another friction law.  Collective where there are fields.

        Args:
            contact: The contact.
            friction: The law, or an isotropic coefficient.
            empty: Whether fields are evaluated for the contact without history, in which pressure,
                slip path, frictional work and worn depth are zero; otherwise for its present state.
        """
        friction, field = as_friction(friction), None
        if getattr(friction, "field", False):
            field = friction
            friction = self._evaluated_friction(contact, field, empty)
        else:
            check_law(contact.surface, friction, contact.V.mesh.geometry.dim)
            friction = at_most_rough(friction)
        if field is None or not _friction_field().followed(
            field
        ):  # coefficients may be large at zero pressure
            warn_of_percent(friction)
        self._field = field
        self.take(contact, friction)

    def assign_wear(self, contact: Contact, wear: Wear | None) -> None:
        """Assign another wear law, or None for no wear.  Collective."""
        check_wear(wear, contact.surface)
        field = None
        with raised_together(contact.comm):
            if wear is not None:
                field = _friction_field().nodal_wear_coefficients(contact, wear)
        self.wear, self.wear_field = wear, field

    def _evaluated_friction(
        self,
        contact: Contact,
        field: Friction,
        empty: bool = False,
        axes: Any = None,
        pressure: np.ndarray | None = None,
        frames: Frames | None = None,
    ) -> Friction:
        """Return a friction law of fields evaluated at the contact nodes.  Collective.

        Args:
            contact: The contact.
            field: Friction law with fields.
            empty: Whether pressure, slip path, frictional work and worn depth are taken as zero;
                otherwise they are those of the present state.
            axes: Friction axes at the nodes; None to evaluate them.
            pressure: Contact pressures, ``shape=(n,)``; None for the present ones.
            frames: Frames of the nodes; None for those of the last step.
        """
        frames = contact.history.frames if frames is None else frames
        none, gdim = np.zeros(contact.nodes.size), contact.V.mesh.geometry.dim
        names = _friction_field().followed(field)
        state = {name: none if empty else getattr(contact, name) for name in names}
        if pressure is not None:
            state["pressure"] = pressure
        with raised_together(contact.comm):
            friction = _friction_field().on_nodes(contact, field, state, frames, axes)
            check_law(
                contact.surface, friction, gdim, _friction_field().has_spatial_axes(field, gdim)
            )
        return at_most_rough(friction)

    @property
    def field(self) -> bool:
        """Whether any part of the friction law is a field."""
        return self._field is not None

    def take(self, contact: Contact, friction: Friction) -> None:
        """Set the friction law at the nodes, whose coefficients are numbers."""
        self.friction, self.kernel = friction, friction.law(contact.V.mesh.geometry.dim)

    @property
    def textured(self) -> bool:
        """Whether friction axes depend on the position of nodes on the surface."""
        return self._field is not None and self._field.of == "surface"

    @property
    def _axes_are_field(self) -> bool:
        """Whether the friction axes are a field."""
        return self._field is not None and is_field(self._field.given()["axes"])

    @property
    def wears_within(self) -> bool:
        """Whether wear in a step opens gaps in the same step; the same on all ranks."""
        return self.wear is not None and not self.wear.explicit

    @property
    def body_has_axes(self) -> bool:
        """Whether friction axes are a field that is bound to the body."""
        return self._axes_are_field and self._field.of == "body"

    def turned(
        self, used: ContactStep, at: np.ndarray, frame: np.ndarray, points: Any = None
    ) -> np.ndarray | float:
        """Return angles between present friction axes and those elsewhere, ``shape=(n,)``, radians.

        They are zero unless axes are bound to a rigid surface or the geometry is that of large
        sliding between two bodies.

        Args:
            used: The contact in a step.
            at: Positions relative to the surface, ``shape=(n, gdim)``.
            frame: Frames at these positions, in the axes of the surface.
            points: Contact points at these positions, on a deformable surface.
        """
        contact, friction = used.given, used.friction
        axes, both = friction.axes, contact.geometry.renews_rows
        if not (self.textured or both) or friction.isotropic or used.points.dim == 2:
            return 0.0
        new = axes
        if self._axes_are_field:
            new = _friction_field().axes_at(contact, self._field, at, frame, points)
        if both:  # their frames turn as well
            old = used.frames.frame
            new = np.broadcast_to((1.0, 0.0) if new is None else new, (len(at), 2))
            new = times(old[:, :2], np.einsum("ni,nij->nj", new, frame[:, :2]))
            axes = (1.0, 0.0) if axes is None else axes
        axes = np.broadcast_to(axes, new.shape)
        return np.abs(new[:, 0] * axes[:, 1] - new[:, 1] * axes[:, 0])

    @property
    def depends_on_pressure(self) -> bool:
        """Whether friction depends on the contact pressure at the end of the step."""
        return self._field is not None and "pressure" in _friction_field().followed(self._field)

    def at_start(self, contact: Contact, frames: Frames) -> tuple[Friction, Friction | None]:
        """Return the friction law at the start of a step, in given frames.  Collective.

        Returns:
            The law; and the same law if it depends on the state, otherwise None.
        """
        if self._field is None:
            return self.friction, None
        friction = self._evaluated_friction(contact, self._field, frames=frames)
        friction = self.friction if _same_friction(friction, self.friction) else friction
        return friction, friction if _friction_field().followed(self._field) else None

    def under(
        self, contact: Contact, pressure: np.ndarray, before: Friction, frames: Frames
    ) -> Friction:
        """Return the friction law for other contact pressures, with unchanged axes.  Collective.

        Args:
            contact: The contact.
            pressure: Contact pressures, ``shape=(n,)``, force per area.
            before: The present law, which is returned if its coefficients do not change.
            frames: Frames of the nodes.
        """
        if not self.depends_on_pressure:
            return before
        given = dict(axes=before.axes, pressure=pressure, frames=frames)
        friction = self._evaluated_friction(contact, self._field, **given)
        return before if _same_friction(friction, before) else friction

    def described(self, surface: Surface) -> dict[str, str]:
        """Return descriptions of the surface and the laws, which must be equal on all ranks.

        Coefficients per node are omitted.
        """
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
        """Raise a ``ValueError`` on all ranks if a law does not fit the contact nodes.  Collective.

        The same error is raised if the surface or the laws differ between ranks.
        """
        if contact.comm.size > 1:
            agree(contact.comm, **self.described(contact.surface), repeats=contact.repeats)
        with raised_together(contact.comm):
            check_coefficients(self.friction, contact.nodes.size)

    def save(self, contact: Contact) -> dict[str, np.ndarray]:
        """Return the laws and the parameters of the surface as arrays by name, for a checkpoint.

        Coefficients that depend on the state are those without history.  For a field of axes, its
        given directions are returned, because axes in the local frames change with the state.
        """
        law, texture = self.friction, {}
        if self._field is not None:
            law = self._evaluated_friction(contact, self._field, empty=True, axes=law.axes)
            if self._axes_are_field:
                texture = {"texture": _friction_field().directions(contact, self._field)}
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
        """Raise a ``ValueError`` if a checkpoint was written with another law or surface."""
        named = {"laws": "friction", "texture": "friction", "rigid_plane": "plane or wear"}
        for name, array in self.save(contact).items():
            if name in saved and not _equal_arrays(saved[name], array):
                raise ValueError(
                    f"checkpoint: it was written with another {named[name]}: here {self.friction}, {contact.surface}, "
                    f"wear {self.wear}. Set what the run had, then load."
                )

    def load(self, contact: Contact, saved: Mapping[str, np.ndarray]) -> Friction | None:
        """Evaluate fields for a checkpoint's state and return the friction law of its last step.

        Returns None if no step had been completed.
        """
        if self._field is not None:
            self.take(contact, self._evaluated_friction(contact, self._field))
        if "law_of_last_step" not in saved:
            return None
        then = saved["law_of_last_step"]
        if np.array_equal(then, rows(self.friction, contact.nodes.size)):
            return self.friction
        mu, p, axes = np.split(then, 3, axis=1)
        turned = (axes != (1.0, 0.0)).any()
        return Friction(mu, np.where(mu > 0, p, 1.0), axes=axes if turned else None)


def rows(law: Friction, n: int) -> np.ndarray:
    """Return the coefficients of cone and slip rule and the axes at ``n`` nodes, ``shape=(n, 6)``."""
    parts = (law.mu, law.p, (1.0, 0.0) if law.axes is None else law.axes)
    return np.concatenate([np.broadcast_to(part, (n, 2)) for part in parts], axis=1)


def _equal_arrays(one: np.ndarray, other: np.ndarray) -> bool:
    return one.shape == other.shape and np.allclose(one, other, 1e-12, 0.0, equal_nan=True)


def _same_friction(one: Friction, other: Friction) -> bool:
    """Return whether two nodal friction laws have the same coefficients and axes."""
    return all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in ("mu", "p", "axes")
    )
