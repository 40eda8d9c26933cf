# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Guarded attributes of the user's objects, and read-only arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def frozen(array: np.ndarray) -> np.ndarray:
    """Make an array read-only and return it: results computed from it then remain valid."""
    array.flags.writeable = False
    return array


class Whole(np.ndarray):
    """A read-only array attribute that can only be assigned as a whole.

    Setting an entry raises a ``ValueError`` that explains this.  Results of arithmetic are plain
    arrays.  ``surface.displacement += d`` assigns a new array.
    """

    message: str = ""  # what to do instead of setting an entry

    def __array_finalize__(self, source: object) -> None:
        self.message = getattr(source, "message", "")

    def __array_wrap__(self, array: np.ndarray, context: Any = None, return_scalar: bool = False):
        return array[()] if array.ndim == 0 else array.view(np.ndarray)

    def __setitem__(self, key: Any, value: ArrayLike) -> None:
        if self.flags.writeable:  # a copy of the attribute
            super().__setitem__(key, value)
            return
        raise ValueError(self.message)

    def __iadd__(self, other: Any):
        return super().__iadd__(other) if self.flags.writeable else self + other

    def __isub__(self, other: Any):
        return super().__isub__(other) if self.flags.writeable else self - other

    def __imul__(self, other: Any):
        return super().__imul__(other) if self.flags.writeable else self * other

    def copy(self, order: Any = "C") -> np.ndarray:
        """Return a writable plain array."""
        return np.array(self, order=order)

    def __repr__(self) -> str:
        return repr(self.view(np.ndarray))


def whole(name: str, array: np.ndarray | None, instead: str = "") -> Any:
    """Return a read-only view of an array attribute, whose entries cannot be set; None for None.

    Args:
        name: Name of the attribute in the error message.
        array: Read-only array, or None.
        instead: What to do instead of setting an entry, for the error message.
    """
    if array is None:
        return None
    view = array.view(Whole)
    instead = (
        instead or f"it is assigned as a whole: {name} = ..., or {name} += ... for all components."
    )
    view.message = f"{name} is read-only, {instead}"
    return view


class Guarded:
    """Base class of objects that reject unknown and read-only attributes once they are complete.

    This catches misspelt names, which would have no effect, and changes that would make results
    outdated.
    """

    _settable: tuple[str, ...] = ()
    _checked: Mapping[str, Callable] = {}  # functions that convert assigned values, or raise
    _remedy: str = ""  # what to do instead of setting a read-only attribute, for the message

    def __setattr__(self, name: str, value: object) -> None:
        if name in self._settable or name.startswith("_") or "_made" not in self.__dict__:
            check = self._checked.get(name)
            object.__setattr__(self, name, check(value) if check else value)
            return
        kind = type(self).__name__
        if name in dir(self):
            raise AttributeError(f"{kind}.{name} cannot be set: {self._remedy}")
        near = get_close_matches(name, [known for known in dir(self) if known[0] != "_"], 1)
        meant = f", did you mean {near[0]!r}?" if near else "."
        raise AttributeError(f"{kind} has no attribute {name!r}{meant}")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{type(self).__name__}.{name} cannot be deleted.")


def surfaces_of(contacts: Iterable[Any]) -> list[Any]:
    """List of the surfaces of contacts, each surface once."""
    return list({id(contact.surface): contact.surface for contact in contacts}.values())
