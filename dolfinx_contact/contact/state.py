# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the nodes of a contact do, did at the end of the last step, and have summed up since the start."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from dolfinx_contact.support.attributes import Guarded, frozen


class Status(IntEnum):
    """What a contact node does, which is the branch that the projection took; after a step a slip below its ``tol`` is none.

    Example:
        >>> slipping = contact.x[contact.status == dc.Status.SLIP]  # where the nodes are that slip
    """

    OPEN = 0
    STICK = 1
    SLIP = 2


class State(NamedTuple):
    """All that a step leaves to the next one; arrays over the owned contact nodes, local frame."""

    displacement: np.ndarray  # of the node relative to the plane, (n, gdim)
    reaction: np.ndarray  # (n, gdim)
    gap: np.ndarray  # (n,)
    slip_increment: np.ndarray  # (n, gdim - 1)
    status: np.ndarray  # (n,)


SUMS = ("dissipation", "slip_path", "wear_depth")
KEPT = "slip_kept"


class ContactHistory(Guarded):
    """States and sums of ``n`` nodes.  All arrays are read-only: the next step starts from them."""

    _settled_by: Any = None  # friction of the last converged step

    def begin(self, state: State) -> None:
        """Forget everything: this is the state, and all sums are zero."""
        self._sums = {name: frozen(np.zeros(len(state.gap))) for name in SUMS}
        self._sums[KEPT] = frozen(np.zeros_like(state.slip_increment))
        self._last = State(*map(frozen, state))
        self.restore()

    def take(self, **arrays: np.ndarray) -> None:
        """Replace parts of the present state."""
        self._present = self._present._replace(**{k: frozen(a) for k, a in arrays.items()})

    def restore(self) -> None:
        """Return to the last converged state."""
        self._present = self._last

    def settle(
        self, work: np.ndarray, path: np.ndarray, depth: np.ndarray, kept: np.ndarray
    ) -> None:
        """Make the present state the last converged one, and add to the sums what the step did; ``kept`` is the new ``slip_kept``."""
        added = dict(zip(SUMS, (work, path, depth)))
        self._sums = {name: frozen(self._sums[name] + added[name]) for name in SUMS}
        self._sums[KEPT] = frozen(kept)
        self._last = self._present

    def history(self) -> tuple:
        """Last converged state and sums, and the law that was slipped by, for ``go_back``."""
        return self._last, self._sums, self._settled_by

    def go_back(self, history: tuple) -> None:
        """Take back what ``history`` returned."""
        self._last, self._sums, self._settled_by = history
        self.restore()

    def save(self) -> dict[str, np.ndarray]:
        """Last converged state and sums as arrays by name; this rank's nodes."""
        return self._last._asdict() | self._sums

    def check_saved(self, saved: Mapping[str, np.ndarray]) -> None:
        """Raise a ``ValueError`` if an array is missing or of another size."""
        for name, array in ContactHistory.save(self).items():
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
        self._last = State(*(frozen(np.array(saved[name])) for name in State._fields))
        none = np.zeros_like(self._last.slip_increment)
        self._sums = {n: frozen(np.array(saved.get(n, none))) for n in (*SUMS, KEPT)}
        self.restore()

    @property
    def present(self) -> State:
        """The present state; another object as soon as any part of it is replaced."""
        return self._present

    @property
    def last(self) -> State:
        """The state at the end of the last step that converged."""
        return self._last

    @property
    def displacement(self) -> np.ndarray:
        """Displacement of the nodes relative to the plane, ``shape=(n, gdim)``, local frame, length."""
        return self._present.displacement

    @property
    def reaction(self) -> np.ndarray:
        """Force of the plane on each node, ``shape=(n, gdim)``, local frame, force units."""
        return self._present.reaction

    @property
    def previous_reaction(self) -> np.ndarray:
        """Reactions of the last converged step, ``shape=(n, gdim)``, local frame."""
        return self._last.reaction

    @property
    def gap(self) -> np.ndarray:
        """Distance to the plane, ``shape=(n,)``, length units; negative is penetration."""
        return self._present.gap

    @property
    def slip_increment(self) -> np.ndarray:
        """Slip relative to the plane in the last step, ``shape=(n, gdim - 1)``, local frame, length units."""
        return self._present.slip_increment

    @property
    def status(self) -> np.ndarray:
        """A ``Status`` per node, ``shape=(n,)``, integers: 0 open, 1 stick, 2 slip."""
        return self._present.status

    @property
    def dissipation(self) -> np.ndarray:
        """Work of friction since the start, ``shape=(n,)``, force times length; it never decreases."""
        return self._sums["dissipation"]

    @property
    def slip_path(self) -> np.ndarray:
        """Length of the path slipped while in contact since the start, ``shape=(n,)``, length units."""
        return self._sums["slip_path"]

    @property
    def wear_depth(self) -> np.ndarray:
        """Worn depth, ``shape=(n,)``, length; never decreases, zero without ``wear``."""
        return self._sums["wear_depth"]

    @property
    def slip_kept(self) -> np.ndarray:
        """Slip since nodes that stick have last slipped, ``shape=(n, gdim - 1)``, local frame, length.

        A tolerance leaves some of it in every step.  It does no work and is no path until the node slips.
        """
        return self._sums[KEPT]
