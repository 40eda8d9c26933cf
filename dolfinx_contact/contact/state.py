# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""State and history variables of the nodes of a contact."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dolfinx_contact.support.attributes import frozen

if TYPE_CHECKING:
    from dolfinx_contact.contact.geometry import Frames
    from dolfinx_contact.law.friction import Friction


class Status(IntEnum):
    """Status of a contact node, which is the branch of the projection on the friction cone.

    After a step, a node whose slip is below the step's ``tol`` is reported as sticking.

    Example:
        >>> slipping = contact.x[contact.status == dc.Status.SLIP]  # positions of slipping nodes
    """

    OPEN = 0
    STICK = 1
    SLIP = 2


class State(NamedTuple):
    """State of ``n`` contact nodes at one displacement; read-only arrays, local frame."""

    displacement: np.ndarray  # relative to the surface, (n, gdim), length
    reaction: np.ndarray  # force on the node, (n, gdim)
    gap: np.ndarray  # (n,), length
    slip_increment: np.ndarray  # in the step, (n, gdim - 1), length
    status: np.ndarray  # ``Status``, (n,), integers
    # Slip prescribed by boundary conditions, (n, gdim - 1), length; None for zero:
    known: np.ndarray | None = None


def frozen_state(state: State) -> State:
    """Make the arrays of a state read-only, and return the state."""
    return State(*(None if array is None else frozen(array) for array in state))


# Names of the sums since the start in ``History.sums``, one value per contact node.
SUM_NAMES = ("dissipation", "slip_path", "wear_depth")
# Slip of sticking nodes since they last slipped, in ``History.sums``.
SLIP_KEPT = "slip_kept"

# Worn depth at the nodes of a deformable surface that wears, in ``History.sums``.
OPPOSITE_WEAR = "opposite_wear_depth"


@dataclass(frozen=True, eq=False)
class History:
    """History variables of a contact with ``n`` nodes between two steps; read-only.

    Attributes:
        last: ``State`` at the end of the last converged step, in the frames of that step.
        frames: ``Frames`` of that step, with the pose of the surface at its end.
        sums: Arrays by name: the sums since the start, and the slip of sticking nodes since they
            last slipped.
        friction: Friction law of the last step; None before the first step.
        worn: Worn depths of all nodes of a deformable surface, on every rank; None if it does not
            wear.
        bare: Nodes that face no part of the surface at the end of the last step, ``shape=(n,)``,
            booleans; None if the flags in ``frames`` apply.
        landed_after: Tangential motion in the last step before nodes touched,
            ``shape=(n, gdim - 1)``; None for zero.
        doubtful_work: Sum over this rank's nodes of the part of the last step's frictional work
            that is due to a change of slip direction.  None if friction is two-dimensional or the
            same in all directions.
        unloads: Depth worn in the last step, and the larger of the normal reactions at its two
            ends, ``shape=(n,)`` each; None before the first step.
    """

    last: State
    frames: Frames
    sums: dict[str, np.ndarray]
    friction: Friction | None = None
    worn: np.ndarray | None = None
    bare: np.ndarray | None = None
    landed_after: np.ndarray | None = None
    doubtful_work: float | None = None
    worn_and_force: tuple[np.ndarray, np.ndarray] | None = None

    @staticmethod
    def of(state: State, frames: Frames) -> History:
        """Return the initial history: a given state, with all sums zero."""
        sums = {name: frozen(np.zeros(len(state.gap))) for name in SUM_NAMES}
        sums[SLIP_KEPT] = frozen(np.zeros_like(state.slip_increment))
        return History(frozen_state(state), frames, sums)

    @property
    def empty(self) -> bool:
        """Whether no step has been completed; the same on all ranks."""
        return self.friction is None

    @property
    def slip_kept(self) -> np.ndarray:
        """Slip of sticking nodes since they last slipped, ``shape=(n, gdim - 1)``, length."""
        return self.sums[SLIP_KEPT]

    def replaced(self, **parts: Any) -> History:
        """Return a copy in which the given attributes are replaced."""
        return replace(self, **parts)
