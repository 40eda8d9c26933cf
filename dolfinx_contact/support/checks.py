# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Numbers and arrays that users give, checked once."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


# Part of a coordinate, over the largest one, that is rounding of a mesh generator.
COORDINATE_ROUNDING = 1e-12


UNIT_ROUNDOFF = np.finfo(float).eps / 2  # of one operation

# Rounding is an estimate: up to this factor, errors may be rounding alone.
ROUNDING_FACTOR = 2.0

# Part of a length, or of a motion, that is none.
NEGLIGIBLE_LENGTH = 64 * UNIT_ROUNDOFF


class RoundingWarning(UserWarning):
    """The answer is as accurate as double precision allows, but not to the requested tolerance.

    Example:
        >>> warnings.simplefilter("error", dc.RoundingWarning)  # a step limited by rounding raises it
    """


def valued(name: str, value: Any) -> Any:
    """The value itself; a ``ValueError`` of an expression of UFL, which NumPy would read without end."""
    if hasattr(value, "ufl_shape") and not hasattr(value, "function_space"):
        raise ValueError(
            f"{name} is an expression of UFL, {str(value):.60}, and has no values at nodes: interpolate it into a Function before each "
            "step, give a callable of x, or of a Constant its value."
        )
    return value


def a_problem(given: Any) -> Any:
    """What was given as ``problem``, if it has contacts; a ``ValueError`` of what has none, such as a contact."""
    if not hasattr(given, "contacts"):
        raise ValueError(f"problem must be a ContactProblem, got {given!r}.")
    return given


def a_field(name: str, given: Any) -> Any:
    """What was given as a field, if UFL knows it, or a ``ValueError``."""
    if not hasattr(given, "ufl_shape"):
        raise ValueError(f"{name} must be a Function or another UFL expression, got {given!r}.")
    return given


def finite(name: str, value: Any, copy: bool = True) -> np.ndarray:
    """A float64 array of finite numbers, a new one if ``copy``, or a ``ValueError``."""
    if np.ma.is_masked(valued(name, value)):
        raise ValueError(f"{name} has masked entries: give numbers for them, {name}.filled(...).")
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf":
            raise ValueError
    except ValueError:
        raise ValueError(f"{name} must be an array of real numbers, not {value!r}.") from None
    if not np.isfinite(array).all():
        at = tuple(np.argwhere(~np.isfinite(array))[0])
        entry = f"{name}[{', '.join(map(str, at))}]" if array.ndim else "it"
        raise ValueError(
            f"{name} must be finite, but contains NaN or infinity: {entry} is {array[at]}."
        )
    return array.astype(np.float64, copy=copy)


def vector(name: str, value: ArrayLike, size: int | None = None) -> np.ndarray:
    """A vector of finite real numbers, as floats."""
    try:
        array = np.asarray(value)
        real = np.issubdtype(array.dtype, np.number) and not np.iscomplexobj(array)
    except ValueError:  # ragged nesting
        real = False
    if not real or array.ndim != 1 or array.size not in ((2, 3) if size is None else (size,)):
        wanted = "2 or 3" if size is None else str(size)
        raise ValueError(f"{name} must be a vector of {wanted} real numbers, got {value!r}.")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, got {value!r}.")
    return array.astype(np.float64)


def place(x: np.ndarray, node: int) -> str:
    """The position of one of some nodes, ``shape=(n, 2 or 3)``, in words: coordinates that are rounding beside theirs are zero."""
    at = np.where(np.abs(x[node]) < COORDINATE_ROUNDING * np.abs(x).max(), 0.0, x[node])
    return f"({', '.join(f'{c:.6g}' for c in at)})"


def number(name: str, value: Any) -> float:
    """One finite real number, alone or in an array of one, or a ``ValueError``."""
    array = np.asarray(value)
    if array.size != 1 or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        raise ValueError(f"{name} must be one finite real number, got {value!r}.")
    return float(array.item())


def positive(name: str, value: Any, whole: bool = False, finite: bool = False) -> float:
    """A positive number, or a ``ValueError``; a whole number must be finite."""
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):  # of 10**400, too
        number = math.nan
    fits = number > 0 and not ((whole or finite) and math.isinf(number))
    if not fits or whole and number != int(number):
        kind = "whole " if whole else ""
        raise ValueError(f"{name} must be a positive {kind}number, got {value!r}.")
    return number


def free_memory() -> float:
    """Bytes of memory that this machine can give, what its cache of files holds among them; infinite where it does not say."""
    try:
        with open("/proc/meminfo") as file:
            message = dict(line.split(":") for line in file)
        return 1024.0 * int(message["MemAvailable"].split()[0])  # in kB [proc(5)]
    except (OSError, KeyError, ValueError):
        return np.inf
