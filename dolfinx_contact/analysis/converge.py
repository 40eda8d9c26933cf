# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Finer meshes and smaller increments, one after another, until a number is accurate enough."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI

from dolfinx_contact.support.checks import number, positive
from dolfinx_contact.support.collective import agree, raised_together

Mesh = TypeVar("Mesh")

# Differences from mesh to mesh are taken to shrink at least and at most by these factors: the rest may be chance.
SMALLEST_LARGEST_RATIO = 2.0, 4.0
# An estimate falls by this factor from one mesh to the next, at most.
LARGEST_DECREASE = 8.0
# Part of the accuracy that is left to the increments.
INCREMENT_SHARE = 0.5


@dataclass(frozen=True)
class Converged:
    """What ``converge`` returns.

    Attributes:
        value: The number from the finest run.
        error: Its estimated relative error, ``mesh_error + increment_error``.
        mesh_error, increment_error: The parts of mesh and increments.
        reached: Whether ``error`` is at most the requested one.
        tried: Values of all runs, by mesh and number of parts.

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
    *,
    halvings: int = 0,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Converged:
    """Refine meshes and halve increments until the estimated error of a number is small enough.  Collective.

    Increments are halved first on the coarser meshes, where this is cheap.  The estimates, which are not bounds:

    - increments: twice the change caused by halving them on the previous mesh, their error if convergence is of first order;
    - mesh: the change from the previous mesh, divided by ``s - 1``, where ``s`` is the factor by which the last change was smaller
      than the one before, within 2 to 4 (2 for two meshes).  With cells of half the size, ``s = 2**p`` for errors of order p (L. F. Richardson,
      Phil. Trans. R. Soc. A 226 (1927) 299).  From mesh to mesh, it falls to an eighth at most: two values may agree by chance.

    Args:
        compute: Function of one of ``meshes`` and a number of parts, 1, 2, 4 ..., that runs the load history with every increment
            divided into this number of parts and returns the number, the same on all ranks.
        accuracy: Requested relative error.
        meshes: First arguments of ``compute``, from the coarsest mesh to the finest, at least two, each with cells of half the
            size.
        halvings: Largest number of halvings of the increments; 0 if there is no history, or its error is not to be estimated.
        comm: The ranks that compute together; ``MPI.COMM_SELF`` if each rank computes a separate number.

    Returns:
        A ``Converged``; ``reached`` says whether meshes and halvings sufficed.

    Raises:
        ValueError: there are fewer than two meshes, or one is given twice; the accuracy is not positive; or a value is zero, not a
            finite real number, or not the same on all ranks.

    Example:
        >>> found = dc.converge(lambda n, parts: 1.0 + n**-2 + 0.1 / parts, 0.01, [4, 8, 16, 32], halvings=6)
        >>> bool(abs(found.value - 1.0) < 0.02)
        True
    """
    with raised_together(comm):
        accuracy = _checked(compute, accuracy, meshes, halvings)
    agree(comm, accuracy=accuracy, meshes=len(meshes), halvings=halvings)
    tried: dict[tuple, float] = {}

    def at(level: int, halved: int) -> float:
        return _value(compute, tried, (meshes[level], 2**halved), comm)

    halved, of_mesh = 0, 0.0
    for level in range(1, len(meshes)):
        halved, increments = _halve(lambda k, n=level - 1: at(n, k), halved, halvings, accuracy)
        last, value = at(level - 1, halved), at(level, halved)
        change = abs(value - last)
        shrunk = SMALLEST_LARGEST_RATIO[0]
        if level > 1 and change > 0:
            shrunk = np.clip(abs(last - at(level - 2, halved)) / change, *SMALLEST_LARGEST_RATIO)
        of_mesh = max(change / (shrunk - 1), of_mesh / LARGEST_DECREASE)
        errors = [float(error / abs(value)) for error in (of_mesh, increments)]
        if sum(errors) <= accuracy:
            break
    _warn_of_equal(tried)
    return Converged(value, *errors, sum(errors) <= accuracy, tried)


def _halve(
    at: Callable[[int], float], halved: int, halvings: int, accuracy: float
) -> tuple[int, float]:
    """How often increments must be halved on one mesh, and the error that is left to them."""
    while halvings:
        before, half = at(halved), at(halved + 1)
        error = 2 * abs(half - before)
        if error <= INCREMENT_SHARE * accuracy * abs(half) or halved == halvings:
            return halved, error
        halved += 1
    return 0, 0.0


def _value(compute: Callable, tried: dict[tuple, float], key: tuple, comm: MPI.Comm) -> float:
    """Of a run, which is made once."""
    if key not in tried:
        with raised_together(comm):
            returned = compute(*key)
        with raised_together(comm):
            value = number(f"what compute returns for {key}", returned)
            if value == 0:
                raise ValueError(
                    f"compute must return a number other than zero, got {value!r} for {key}."
                )
        agree(comm, **{f"what compute returns for {key}": value})
        tried[key] = value
    return tried[key]


def _checked(compute: object, accuracy: Any, meshes: Any, halvings: Any) -> float:
    """The accuracy, if all makes sense."""
    accuracy = positive("accuracy", accuracy, finite=True)
    if not callable(compute):
        raise ValueError(
            f"compute must be a function of a mesh and a number of parts, got {compute!r}."
        )
    if not hasattr(meshes, "__getitem__") or len(meshes) < 2:
        raise ValueError(f"meshes must be at least two, from the coarsest on, got {meshes!r}.")
    if not isinstance(halvings, (int, np.integer)) or halvings < 0:
        raise ValueError(f"halvings must be a whole number, 0 or more, got {halvings!r}.")
    try:
        sizes = dict.fromkeys(meshes)
    except TypeError:
        raise ValueError(
            f"meshes must be numbers, names, tuples or meshes, not lists or arrays, got {meshes!r}."
        ) from None
    if all(isinstance(mesh, Real) for mesh in meshes):
        rises = np.diff(np.array(meshes, dtype=float))
        finer = (rises > 0).all() or (rises < 0).all()
    elif all(hasattr(mesh, "topology") for mesh in meshes):
        sizes = [mesh.topology.index_map(mesh.topology.dim).size_global for mesh in meshes]
        finer = (np.diff(sizes) > 0).all()
    else:
        finer = len(sizes) == len(meshes)
    if not finer:
        raise ValueError(
            f"meshes must be from the coarsest to the finest, each finer than the one before, got {meshes!r}."
        )
    return accuracy


def _warn_of_equal(tried: dict[tuple, float]) -> None:
    """Warn of runs that should differ and do not in any digit: an error estimated from them is zero."""
    first: dict[float, tuple] = {}
    for key, value in tried.items():
        if first.setdefault(value, key) != key:
            warnings.warn(
                f"compute returned {value!r} to the last digit for {first[value]} and for {key}, so no error is seen: check "
                "that it uses the mesh and the number of parts that it is given.",
                stacklevel=3,
            )
            return
