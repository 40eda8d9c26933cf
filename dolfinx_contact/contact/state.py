# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the nodes of a contact do, did at the end of the last step, and have summed up since the start."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from dolfinx_contact.law.friction import Friction
from dolfinx_contact.support.attributes import frozen


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


SAVED = State._fields[:-1]  # of a state, in checkpoints
SUMS = ("dissipation", "slip_path", "wear_depth")
KEPT = "slip_kept"
OPPOSITE = "opposite_wear_depth"  # at nodes of a deformable surface that wears


class History:
    """States and sums of ``n`` nodes.  All arrays are read-only: the next step starts from them.

    Attributes:
        present: The present ``State``.
        last: That at the end of the last step that converged.
        sums: Since the start, and slip that sticking nodes have kept, arrays by name.
        settled_by: Friction of the last step that converged; None before the first.
    """

    present: State
    last: State
    sums: dict[str, np.ndarray]
    settled_by: Friction | None = None

    def begin(self, state: State) -> None:
        """Forget everything: this is the state, and all sums are zero."""
        self.settled_by = None
        self.sums = {name: frozen(np.zeros(len(state.gap))) for name in SUMS}
        self.sums[KEPT] = frozen(np.zeros_like(state.slip_increment))
        self.replace_last(*state[:-1])
        self.restore()

    def take(self, **arrays: np.ndarray) -> None:
        """Replace parts of the present state."""
        self.present = self.present._replace(
            **{k: a if a is None else frozen(a) for k, a in arrays.items()}
        )

    def replace_last(self, *arrays: np.ndarray) -> None:
        """Let the last state have these arrays."""
        self.last = State(*map(frozen, arrays))

    def restore(self) -> None:
        """Return to the last converged state."""
        self.present = self.last

    def settle(
        self, by: Friction, work: np.ndarray, path: np.ndarray, depth: np.ndarray, kept: np.ndarray
    ) -> None:
        """Make the present state the last converged one, and add to the sums what the step did; ``kept`` is the new ``slip_kept``."""
        added = dict(zip(SUMS, (work, path, depth)))
        self.sums = self.sums | {name: frozen(self.sums[name] + added[name]) for name in SUMS}
        self.sums[KEPT] = frozen(kept)
        self.last, self.settled_by = self.present._replace(known=None), by

    def wear_opposite(self, depth: np.ndarray) -> None:
        """Add depths that the step wears off a deformable surface, ``shape=(k,)``."""
        self.sums = self.sums | {OPPOSITE: frozen(self.sums.get(OPPOSITE, 0.0) + depth)}

    def kept(self) -> tuple:
        """Last converged state and sums, and the law that was slipped by, for ``go_back``."""
        return self.last, self.sums, self.settled_by

    def go_back(self, kept: tuple) -> None:
        """Take back what ``kept`` returned."""
        self.last, self.sums, self.settled_by = kept
        self.restore()

    def save(self) -> dict[str, np.ndarray]:
        """Last converged state and sums as arrays by name; this rank's nodes."""
        sums = {name: of for name, of in self.sums.items() if name != OPPOSITE}  # of other nodes
        return {name: getattr(self.last, name) for name in SAVED} | sums

    def check_saved(self, saved: Mapping[str, np.ndarray]) -> None:
        """Raise a ``ValueError`` if an array is missing or of another size."""
        for name, array in self.save().items():
            if name == KEPT and name not in saved:
                continue  # older checkpoints do not have it
            if name not in saved or saved[name].shape != array.shape:
                found = saved[name].shape if name in saved else "nothing"
                raise ValueError(
                    f"checkpoint: {name} needs shape {array.shape}, found {found}. It was written "
                    "for another mesh or another contact."
                )
        wrong = [name for name in SUMS if (saved[name] < 0).any()]
        wrong += ["status"] * (not np.isin(saved["status"], list(map(int, Status))).all())
        if wrong:
            raise ValueError(
                f"checkpoint: {wrong[0]} has values that no step leaves: take another file."
            )

    def load(self, saved: Mapping[str, np.ndarray]) -> None:
        """Take back what ``save`` returned, with the same nodes on this rank."""
        self.replace_last(*(np.array(saved[name]) for name in SAVED))
        none = np.zeros_like(self.last.slip_increment)
        self.sums = {n: frozen(np.array(saved.get(n, none))) for n in (*SUMS, KEPT)}
        if OPPOSITE in saved:
            self.sums[OPPOSITE] = frozen(np.array(saved[OPPOSITE]))
        self.restore()
