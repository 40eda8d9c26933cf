# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Checks of numbers and arrays given by users."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


# Coordinates below this fraction of the largest one are rounding errors of a mesh generator.
COORDINATE_ROUNDING = 1e-12


# Largest relative rounding error of one floating-point operation.
UNIT_ROUNDOFF = np.finfo(float).eps / 2

# Rounding errors are only estimated: errors up to this multiple of the estimate may be rounding.
ROUNDING_FACTOR = 2.0

# A length or displacement is treated as zero below this fraction of its scale.
NEGLIGIBLE_LENGTH = 64 * UNIT_ROUNDOFF


class RoundingWarning(UserWarning):
    """The answer is as accurate as double precision allows, but not to the requested tolerance.

    Example:
        >>> warnings.simplefilter("error", dc.RoundingWarning)  # a step limited by rounding raises it
    """


def valued(name: str, value: Any) -> Any:
    """Return a user's value; raise a ``ValueError`` if it is a UFL expression.

    NumPy would not terminate when converting a UFL expression to an array.
    """
    if hasattr(value, "ufl_shape") and not hasattr(value, "function_space"):
        raise ValueError(
            f"{name} is an expression of UFL, {str(value):.60}, and has no values at nodes: interpolate it into a Function before each "
            "step, give a callable of x, or of a Constant its value."
        )
    return value


def a_problem(given: Any) -> Any:
    """Return an object given as ``problem``; raise a ``ValueError`` if it has no contacts."""
    if not hasattr(given, "contacts"):
        raise ValueError(f"problem must be a ContactProblem, got {given!r}.")
    return given


def a_field(name: str, given: Any) -> Any:
    """Return an object given as a field; raise a ``ValueError`` if it is not a UFL expression."""
    if not hasattr(given, "ufl_shape"):
        raise ValueError(f"{name} must be a Function or another UFL expression, got {given!r}.")
    return given


def finite(name: str, value: Any, copy: bool = True) -> np.ndarray:
    """Return a value as a float64 array; raise a ``ValueError`` unless it is real and finite.

    Args:
        name: Name of the value in error messages.
        value: Array or number.
        copy: Whether the array is always a new one.
    """
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
    """Return a value as a float64 vector; raise a ``ValueError`` unless it is a finite real vector.

    Args:
        name: Name of the value in error messages.
        value: Vector.
        size: Required size; None means 2 or 3.
    """
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
    """Return the position of a node as text, with coordinates that are rounding errors set to zero.

    Args:
        x: Positions of all nodes, ``shape=(n, 2 or 3)``.
        node: Index of the node.
    """
    at = np.where(np.abs(x[node]) < COORDINATE_ROUNDING * np.abs(x).max(), 0.0, x[node])
    return f"({', '.join(f'{c:.6g}' for c in at)})"


def number(name: str, value: Any) -> float:
    """Return a value as a float; raise a ``ValueError`` unless it is one finite real number.

    An array with one entry is accepted.
    """
    array = np.asarray(value)
    if array.size != 1 or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        raise ValueError(f"{name} must be one finite real number, got {value!r}.")
    return float(array.item())


def positive(name: str, value: Any, whole: bool = False, finite: bool = False) -> float:
    """Return a value as a positive float; raise a ``ValueError`` if it is not positive.

    Args:
        name: Name of the value in the error message.
        value: Number.
        whole: Whether it must be a finite whole number.
        finite: Whether it must be finite.
    """
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):  # such as 10**400
        number = math.nan
    fits = number > 0 and not ((whole or finite) and math.isinf(number))
    if not fits or whole and number != int(number):
        kind = "whole " if whole else ""
        raise ValueError(f"{name} must be a positive {kind}number, got {value!r}.")
    return number


def free_memory() -> float:
    """Return available memory in bytes, file caches included; infinite if it is unknown."""
    try:
        with open("/proc/meminfo") as file:
            fields = dict(line.split(":") for line in file)
        return 1024.0 * int(fields["MemAvailable"].split()[0])  # in kB [proc(5)]
    except (OSError, KeyError, ValueError):
        return np.inf
