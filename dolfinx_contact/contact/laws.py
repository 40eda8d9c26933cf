# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The laws of a contact: friction and wear, exchanged between steps, compared between ranks and with checkpoints."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dolfinx_contact.contact.friction_field import directed, directions, followed, on_nodes
from dolfinx_contact.contact.input import (
    check_coefficients,
    check_law,
    check_wear,
    warn_of_percent,
)
from dolfinx_contact.contact.state import ContactHistory
from dolfinx_contact.law.friction import Friction, as_friction, at_most_rough, is_field
from dolfinx_contact.law.wear import Wear
from dolfinx_contact.support.collective import raised_together


class ContactLaws(ContactHistory):
    """Friction and wear of a ``Contact``, which has space, plane, frame and nodes."""

    _field: Friction | None = None  # the law given, if anything in it is a field
    _begun: Friction | None = None  # the law as the step began, if it follows the state
    _rested: Friction | None = None  # a field's law in the last converged state

    @property
    def friction(self) -> Friction:
        """The friction law.  Another one may be assigned between steps, on all ranks; fields are evaluated then, anew at the start
        of each step, and as the state goes on if they follow it.
        """
        return self._friction

    @friction.setter
    def friction(self, friction: Friction | float) -> None:
        gdim, field, friction = self.V.mesh.geometry.dim, None, as_friction(friction)
        if getattr(friction, "field", False):
            field = friction
            friction = self._evaluated(field, empty="_present" not in self.__dict__)
        else:
            check_law(self.surface, friction, gdim)
            warn_of_percent(friction)
            friction = at_most_rough(friction)
        self._field, self._begun, self._rested = field, None, None
        self._take_law(friction)

    def _evaluated(self, field: Friction, empty: bool = False, axes=None) -> Friction:
        """A law of fields at the nodes: of the present state, or as before anything has touched if ``empty``.  Collective."""
        state, gdim = self._state(followed(field), empty), self.V.mesh.geometry.dim
        with raised_together(self.comm):
            friction = on_nodes(self, field, state, axes)
            check_law(self.surface, friction, gdim, directed(field, gdim))
        return at_most_rough(friction)

    @property
    def textured(self) -> bool:
        """Whether axes of friction depend on where nodes are on the surface."""
        return self._field is not None and self._field.of == "surface"

    @property
    def follows_pressure(self) -> bool:
        """Whether friction follows the pressure at the end of the step."""
        return self._field is not None and "pressure" in followed(self._field)

    def renew_friction(self, begin: bool = False) -> None:
        """Let fields have their present values.  Collective.

        Args:
            begin: A step begins here, with frames of its own; else only what follows the pressure has changed.
        """
        if self._field is None or not (begin or self.follows_pressure):
            return
        before = self._friction
        friction = self._evaluated(self._field, axes=None if begin else before.axes)
        if not _same(friction, before):
            self._take_law(friction)
        if not begin:
            return
        self._rested = before
        if followed(self._field):
            self._begun = self._friction

    def restore(self) -> None:
        """Return to the last converged state; friction given by fields, too."""
        super().restore()
        if self._rested is not None:
            self._take_law(self._rested)

    def _state(self, names, empty: bool = False) -> dict[str, np.ndarray]:
        """Arrays of this contact by name; zeros, as before anything has touched, if ``empty``.  Collective."""
        return {name: np.zeros(self.nodes.size) if empty else getattr(self, name) for name in names}

    def _take_law(self, friction: Friction) -> None:
        self._friction, self._law = friction, friction.law(self.V.mesh.geometry.dim)

    @property
    def law(self):
        """The kernel's law of this friction."""
        return self._law

    @property
    def wear(self) -> Wear | None:
        """The law of wear.  Another one may be assigned between steps, on all ranks."""
        return self._wear

    @wear.setter
    def wear(self, wear: Wear | None) -> None:
        check_wear(wear)
        self._wear = wear

    def described(self) -> dict[str, str]:
        """Plane and laws, but coefficients per node, in words: the same on all ranks."""
        driven = self.surface.driven() if self.surface.free else "by displacement"
        law = "friction per node" if self.friction.mu.ndim == 2 else repr(self.friction)
        moved, turned = (
            repr(v.tolist()) for v in (self.surface.displacement, self.surface.rotation)
        )
        return {"surface": repr(self.surface), "surface.displacement": moved, "surface.rotation": turned, "surface.free": driven, "friction": law, "wear": repr(self.wear)}  # fmt: skip

    def check(self, first: dict[str, str]) -> None:
        """Raise a ``ValueError`` if a law does not fit this rank's nodes, or what is ``described`` on rank 0."""
        for name, value in self.described().items():
            if value != first[name]:
                raise ValueError(
                    f"{name} differs between ranks: here {value}, on rank 0 {first[name]}. Planes and laws must not "
                    "differ between ranks."
                )
        check_coefficients(self.friction, self.nodes.size)

    def save(self) -> dict[str, np.ndarray]:
        """All that the next step starts from, and the laws, as arrays by name; this rank's nodes."""
        saved = super().save() | self._laws() | {"plane": self.surface.displacement}
        if self._settled_by is not None:
            saved["law_of_last_step"] = self._rows(self._settled_by)
        return saved

    def check_saved(self, saved: Mapping[str, np.ndarray]) -> None:
        """Raise a ``ValueError`` if an array is missing or of another size, or another law or plane was saved."""
        super().check_saved(saved)
        for name, array in self._laws().items():
            if name in saved and not _alike(saved[name], array):
                what = {"laws": "friction", "texture": "friction", "rigid_plane": "plane or wear"}[
                    name
                ]
                raise ValueError(
                    f"checkpoint: it was written with another {what}: here {self.friction}, {self.surface}, "
                    f"wear {self.wear}. Set what the run had, then load."
                )

    def load(self, saved: Mapping[str, np.ndarray]) -> None:
        """Take back what ``save`` returned, with the same nodes on this rank; see ``check_saved``."""
        super().load(saved)
        self.surface.displacement = saved["plane"]
        if self._field is not None:
            self._take_law(
                self._evaluated(self._field)
            )  # in the frames of the state that was saved
        self._settled_by = self.friction  # of older checkpoints nothing else is known
        rows = saved.get("law_of_last_step", self._rows(self.friction))
        if not np.array_equal(rows, self._rows(self.friction)):
            mu, p, axes = np.split(rows, 3, axis=1)
            turned = (axes != (1.0, 0.0)).any()
            self._settled_by = Friction(mu, np.where(mu > 0, p, 1.0), axes=axes if turned else None)

    def _laws(self) -> dict[str, np.ndarray]:
        """Coefficients, of a law that follows the state those without one, and axes of all nodes; plane and wear.

        Of a field of axes the directions that were given: those in the frames change with the state.
        """
        law, texture = self.friction, {}
        if self._field is not None:
            law = self._evaluated(self._field, empty=True, axes=law.axes)
            if is_field(self._field.given()["axes"]):
                texture = {"texture": directions(self, self._field)}
                law = Friction(law.mu, np.where(law.mu > 0, law.p, 1.0))
        wear = np.nan if self.wear is None else self.wear.coefficient
        parts = (self.surface.described(), np.broadcast_to(wear, 2))
        return {"laws": self._rows(law), "rigid_plane": np.concatenate(parts)} | texture

    def _rows(self, law: Friction) -> np.ndarray:
        """Coefficients of cone and slip rule, and axes, of each node, ``shape=(n, 6)``."""
        rows = (law.mu, law.p, (1.0, 0.0) if law.axes is None else law.axes)
        return np.concatenate([np.broadcast_to(row, (self.nodes.size, 2)) for row in rows], axis=1)


def _alike(one: np.ndarray, other: np.ndarray) -> bool:
    return one.shape == other.shape and np.allclose(one, other, 1e-12, 0.0, equal_nan=True)


def _same(one: Friction, other: Friction) -> bool:
    """Whether two laws of nodes have the same coefficients and axes."""
    return all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in ("mu", "p", "axes")
    )
