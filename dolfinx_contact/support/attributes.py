# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Attributes of the user's objects: those that may be set, and read-only arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def frozen(array: np.ndarray) -> np.ndarray:
    """The array itself, from now on read-only: what is computed from it cannot be changed behind its back."""
    array.flags.writeable = False
    return array


class Whole(np.ndarray):
    """A read-only array of an attribute that is assigned as a whole, and says so; what is computed from it is a plain array.

    ``surface.displacement += way`` assigns a new one.
    """

    message: str = ""  # what to do instead of setting an entry

    def __array_finalize__(self, source: object) -> None:
        self.message = getattr(source, "message", "")

    def __array_wrap__(self, array: np.ndarray, context: Any = None, return_scalar: bool = False):
        return array[()] if array.ndim == 0 else array.view(np.ndarray)

    def __setitem__(self, key: Any, value: ArrayLike) -> None:
        if self.flags.writeable:  # a copy of it
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
        """A plain array that may be changed."""
        return np.array(self, order=order)

    def __repr__(self) -> str:
        return repr(self.view(np.ndarray))


def whole(name: str, array: np.ndarray | None, instead: str = "") -> Any:
    """A view of a read-only array that is the attribute ``name``, and says what to do instead of setting its entries; None stays None."""
    if array is None:
        return None
    view = array.view(Whole)
    instead = (
        instead or f"it is assigned as a whole: {name} = ..., or {name} += ... for all components."
    )
    view.message = f"{name} is read-only, {instead}"
    return view


class Guarded:
    """An object that, once made, takes no attributes but those it has room for.

    A misspelt one would be kept and never read, and one that results were computed from would no longer fit them.
    """

    _settable: tuple[str, ...] = ()
    _checked: Mapping[str, Callable] = {}  # what is kept of values given, or raises
    _remedy: str = ""  # what to do instead of setting one of the others

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
    """The surfaces of contacts, each once."""
    return list({id(contact.surface): contact.surface for contact in contacts}.values())
