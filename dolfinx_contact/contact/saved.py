# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""History variables and laws of a contact as arrays by name, for this rank's nodes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from dolfinx_contact.contact.contact_step import depends_on_position
from dolfinx_contact.contact.laws import rows
from dolfinx_contact.contact.state import (
    OPPOSITE_WEAR,
    SLIP_KEPT,
    SUM_NAMES,
    History,
    State,
    Status,
)
from dolfinx_contact.support.attributes import frozen

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact

# Arrays of ``State`` in a checkpoint: all but the prescribed slip ``known``.
STATE_FIELDS = State._fields[:-1]


def saved_of(contact: Contact) -> dict[str, np.ndarray]:
    """Return all data from which the next step starts, and the laws, as arrays by name."""
    history, surface = contact.history, contact.surface
    arrays = _history_arrays(history) | contact.laws.save(contact) | {"plane": surface.displacement}
    if history.friction is not None:
        arrays["law_of_last_step"] = rows(history.friction, contact.nodes.size)
    if surface.placed.any():
        arrays["placed_rotation_of_plane"] = surface.placed
    return arrays | contact.geometry.save(history.frames)


def _history_arrays(history: History) -> dict[str, np.ndarray]:
    sums = {
        name: values for name, values in history.sums.items() if name != OPPOSITE_WEAR
    }  # the omitted array belongs to nodes of the other side
    return {name: getattr(history.last, name) for name in STATE_FIELDS} | sums


def check_saved(contact: Contact, arrays: Mapping[str, np.ndarray]) -> None:
    """Raise a ``ValueError`` if the arrays of a checkpoint do not fit a contact.

    They do not fit if an array is missing or of another shape, if values are impossible, or if
    another law or surface was saved.
    """
    for name, array in _history_arrays(contact.history).items():
        if name not in arrays or arrays[name].shape != array.shape:
            found = arrays[name].shape if name in arrays else "nothing"
            raise ValueError(
                f"checkpoint: {name} needs shape {array.shape}, found {found}. It was written "
                "for another mesh or another contact."
            )
    wrong = [name for name in SUM_NAMES if (arrays[name] < 0).any()]
    wrong += ["status"] * (not np.isin(arrays["status"], list(map(int, Status))).all())
    if wrong:
        raise ValueError(
            f"checkpoint: {wrong[0]} has values that no step leaves: take another file."
        )
    contact.laws.check_saved(contact, arrays)
    if contact.surface.varies and "home" not in arrays:
        raise ValueError(f"checkpoint: it was written with another plane: here {contact.surface}.")


def load_saved(contact: Contact, arrays: Mapping[str, np.ndarray]) -> None:
    """Restore the data that ``saved_of`` returned, with the same nodes on this rank.

    The arrays must have passed ``check_saved``.
    """
    surface, geometry, frames = contact.surface, contact.geometry, contact.history.frames
    placed = frozen(np.array(arrays.get("placed_rotation_of_plane", surface.placed)))
    surface.place(arrays.get("rotation_of_plane", np.zeros_like(surface.rotation)), placed)
    if geometry.follows(depends_on_position(contact), contact.history):
        at = arrays["home"] if surface.varies else arrays.get("at")
        frames = geometry.saved_at(at, frames)
    surface.displacement = arrays["plane"]
    found = arrays.get("found_rotation_of_plane", surface.rotation)
    frames = geometry.ended(frames, found)
    last, worn = State(*(frozen(np.array(arrays[name])) for name in STATE_FIELDS)), None
    sums = {name: frozen(np.array(arrays[name])) for name in (*SUM_NAMES, SLIP_KEPT)}
    if OPPOSITE_WEAR in arrays:
        sums[OPPOSITE_WEAR] = frozen(np.array(arrays[OPPOSITE_WEAR]))
        worn = geometry.on_all_ranks(sums[OPPOSITE_WEAR])
    contact.set_history(History(last, frames, sums, worn=worn))
    contact.set_history(contact.history.replaced(friction=contact.laws.load(contact, arrays)))
    surface.set_rotation(found)
