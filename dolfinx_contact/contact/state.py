# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the nodes of a contact do, did at the end of the last step, and have summed up since the start."""

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
    """Status of a contact node, the branch that the projection took.  After a step, slip below its ``tol`` counts as stick.

    Example:
        >>> slipping = contact.x[contact.status == dc.Status.SLIP]  # where the nodes are that slip
    """

    OPEN = 0
    STICK = 1
    SLIP = 2


class State(NamedTuple):
    """A state of ``n`` contact nodes; read-only arrays, local frame."""

    displacement: np.ndarray  # of the node relative to the surface, (n, gdim)
    reaction: np.ndarray  # (n, gdim)
    gap: np.ndarray  # (n,)
    slip_increment: np.ndarray  # (n, gdim - 1)
    status: np.ndarray  # (n,)
    known: np.ndarray | None = (
        None  # part of the slip that supports prescribe, (n, gdim - 1); None where there is none
    )


def frozen_state(state: State) -> State:
    """The state with read-only arrays."""
    return State(*(None if array is None else frozen(array) for array in state))


SUM_NAMES = ("dissipation", "slip_path", "wear_depth")
SLIP_KEPT = "slip_kept"
OPPOSITE_WEAR = "opposite_wear_depth"  # at nodes of a deformable surface that wears


@dataclass(frozen=True, eq=False)
class History:
    """All that a contact hands from one step to the next, ``n`` nodes.  All arrays are read-only.

    Attributes:
        last: ``State`` at the end of the last step that converged, in its frames.
        frames: Those of that step, with the surface where it has ended.
        sums: Since the start, and slip that sticking nodes have kept, arrays by name.
        friction: The law of that step; None before the first.
        worn: Depths of all nodes of a deformable surface that wears, of all ranks; None where none does.
        bare: Nodes opposite nothing where that step has ended, ``shape=(n,)``; None as the frames say.
        landed_after: In that step, slip before nodes touched, ``shape=(n, gdim - 1)``; None is none.
        doubtful_work: Of that step, on this rank: by how much slip that went straight on would have another frictional work; None where it cannot turn.
        unloads: Depths worn in that step, and the larger normal reaction of its ends, ``shape=(n,)`` each; None before the first.
    """

    last: State
    frames: Frames
    sums: dict[str, np.ndarray]
    friction: Friction | None = None
    worn: np.ndarray | None = None
    bare: np.ndarray | None = None
    landed_after: np.ndarray | None = None
    doubtful_work: float | None = None
    unloads: tuple[np.ndarray, np.ndarray] | None = None

    @staticmethod
    def of(state: State, frames: Frames) -> History:
        """No history: a state, and all sums zero."""
        sums = {name: frozen(np.zeros(len(state.gap))) for name in SUM_NAMES}
        sums[SLIP_KEPT] = frozen(np.zeros_like(state.slip_increment))
        return History(frozen_state(state), frames, sums)

    @property
    def empty(self) -> bool:
        """Whether no step was made; the same on all ranks."""
        return self.friction is None

    @property
    def slip_kept(self) -> np.ndarray:
        """Slip since nodes that stick have last slipped, ``shape=(n, gdim - 1)``."""
        return self.sums[SLIP_KEPT]

    def but(self, **parts: Any) -> History:
        """The same with other parts."""
        return replace(self, **parts)
