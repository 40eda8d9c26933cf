# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Finer meshes and smaller increments, one after another, until a number is as accurate as asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from dolfinx_contact.checks import positive

Mesh = TypeVar("Mesh")

# Differences from mesh to mesh are taken to shrink at least and at most by these factors: the rest may be chance.
SHRINK = 2.0, 4.0
# An estimate falls by this factor from one mesh to the next, at most.
FALL = 8.0
# Part of the accuracy that is left to the increments.
SHARE = 0.5


@dataclass(frozen=True)
class Converged:
    """What ``converge`` returns.

    Attributes:
        value: Of the finest run.
        error: Its estimated error over its size: ``mesh_error + increment_error``.
        mesh_error, increment_error: Their shares.
        reached: Whether ``error`` is at most what was asked for.
        tried: Values by mesh and number of parts, of all runs.

    Example:
        >>> found = dc.converge(lambda n, parts: 1.0 + n**-2, 0.01, meshes=[4, 8, 16])
        >>> found.reached
        True
    """

    value: float
    mesh_error: float
    increment_error: float
    reached: bool
    tried: dict[tuple, float]

    @property
    def error(self) -> float:
        return self.mesh_error + self.increment_error


def converge(
    compute: Callable[[Mesh, int], float],
    accuracy: float,
    meshes: Sequence[Mesh],
    halvings: int = 0,
) -> Converged:
    """Refine meshes and halve increments until the estimated error of a number is small enough.

    On every mesh but the last in use the increments are halved first, where it costs least.  The estimates:

    - increments: twice the change that halving them makes on the mesh before, which is their error if it falls with the first order;
    - mesh: the change from the mesh before, over ``s - 1``, where ``s`` is the factor by which changes shrank last, but 2 at
      least and 4 at most.  With cells of half the size ``s = 2**p`` for errors of order p (L. F. Richardson, Phil. Trans. R. Soc. A 226
      (1927) 299).  With two meshes s = 2.  From mesh to mesh the estimate falls to an eighth at most, since two values may agree by chance.

    Estimates, no bounds.

    Args:
        compute: Function of one of ``meshes`` and a number of parts, 1, 2, 4 ..., that takes the programme with every
            increment divided into so many parts and returns the number, the same on all ranks.
        accuracy: Relative.
        meshes: What ``compute`` makes a mesh of, from the coarsest to the finest, at least two; each with cells of half the size.
        halvings: Of the increments, at most; 0 if there is no history, or none is to be estimated.

    Returns:
        A ``Converged``.  Where meshes or halvings do not suffice it says so by ``reached``.

    Raises:
        ValueError: fewer than two meshes, an accuracy that is not positive, a value that is zero or not finite.

    Example:
        >>> found = dc.converge(lambda n, parts: 1.0 + n**-2 + 0.1 / parts, 0.01, [4, 8, 16, 32], halvings=6)
        >>> bool(abs(found.value - 1.0) < 0.02)
        True
    """
    accuracy = positive("accuracy", accuracy, finite=True)
    if len(meshes) < 2:
        raise ValueError(f"meshes must be at least two, from the coarsest on, got {meshes!r}.")
    tried: dict[tuple, float] = {}

    def at(level: int, halved: int) -> float:
        return _value(compute, tried, (meshes[level], 2**halved))

    halved, of_mesh = 0, 0.0
    for level in range(1, len(meshes)):
        halved, increments = _halve(lambda k, of=level - 1: at(of, k), halved, halvings, accuracy)
        last, value = at(level - 1, halved), at(level, halved)
        change = abs(value - last)
        shrunk = SHRINK[0]
        if level > 1 and change > 0:
            shrunk = np.clip(abs(last - at(level - 2, halved)) / change, *SHRINK)
        of_mesh = max(change / (shrunk - 1), of_mesh / FALL)
        errors = [float(error / abs(value)) for error in (of_mesh, increments)]
        if sum(errors) <= accuracy:
            break
    return Converged(value, *errors, sum(errors) <= accuracy, tried)


def _halve(
    at: Callable[[int], float], halved: int, halvings: int, accuracy: float
) -> tuple[int, float]:
    """How often increments must be halved on one mesh, and the error that is left to them."""
    while halvings:
        before, half = at(halved), at(halved + 1)
        error = 2 * abs(half - before)
        if error <= SHARE * accuracy * abs(half) or halved == halvings:
            return halved, error
        halved += 1
    return 0, 0.0


def _value(compute, tried: dict[tuple, float], key: tuple) -> float:
    """Of a run, which is made once."""
    if key not in tried:
        value = float(compute(*key))
        if not np.isfinite(value) or value == 0:
            raise ValueError(
                f"compute must return a finite number other than zero, got {value!r} for {key}."
            )
        tried[key] = value
    return tried[key]
