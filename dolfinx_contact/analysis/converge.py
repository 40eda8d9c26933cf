# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Mesh and increment refinement until the estimated error of a result is below a tolerance."""

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

# Smallest and largest ratio of two successive differences between meshes that the estimate of the
# mesh error uses.  Ratios outside this range may be coincidence.
SMALLEST_LARGEST_RATIO = 2.0, 4.0
# Largest factor by which the estimated mesh error may decrease from one mesh to the next.  A larger
# decrease may be coincidence.
LARGEST_DECREASE = 8.0
# Fraction of the requested error that the increments may cause.
INCREMENT_SHARE = 0.5


@dataclass(frozen=True)
class Converged:
    """Result of ``converge``: a computed number and its estimated error.

    Attributes:
        value: Number computed in the finest run.
        error: Estimated relative error of ``value``, ``mesh_error + increment_error``.
        mesh_error, increment_error: Estimated relative errors caused by the mesh and by the
            increments.
        reached: Whether ``error`` is at most the requested relative error.
        tried: Computed numbers of all runs; the keys are pairs of the mesh and the number of parts
            of each increment.

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
    """Refine mesh and increments until a computed number has the requested accuracy.  Collective.

    The number of halvings of the increments is found on the coarser mesh, where it is cheap.  The
    two errors are estimates, not bounds:

    - Increments: twice the change caused by halving the increments on the previous mesh.  This is
      the error if the increments converge with first order.
    - Mesh: the change from the previous mesh, divided by ``s - 1``, where ``s`` is the ratio of the
      last two changes, limited to 2 to 4 (``s = 2`` for two meshes).  If the cell size is halved,
      ``s = 2**p`` for errors of order p (L. F. Richardson, Phil. Trans. R. Soc. A 226 (1927) 299).
      From one mesh to the next, the estimate decreases at most by a factor of eight, since two
      values may agree by coincidence.

    Args:
        compute: Function of one entry of ``meshes`` and a number of parts (1, 2, 4, ...).  It
            solves the load history with every increment divided into this number of parts, and
            returns the computed number, the same on all ranks.
        accuracy: Requested relative error.
        meshes: At least two first arguments of ``compute``, from the coarsest mesh to the finest,
            each with half the cell size of the previous one.
        halvings: Largest number of halvings of the increments.  With 0, the error caused by the
            increments is not estimated, for instance since there is only one step.
        comm: Communicator of the ranks that compute together; ``MPI.COMM_SELF`` if each rank
            computes a separate number.

    Returns:
        A ``Converged``; its attribute ``reached`` is True if the requested accuracy was reached.

    Raises:
        ValueError: there are fewer than two meshes, a mesh is given twice, the accuracy is not
            positive, or a computed number is zero, not finite, not real, or differs between ranks.

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
        halved, increments = _halvings_needed(
            lambda k, n=level - 1: at(n, k), halved, halvings, accuracy
        )
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


def _halvings_needed(
    at: Callable[[int], float], halved: int, halvings: int, accuracy: float
) -> tuple[int, float]:
    """Return the number of halvings that the increments need on one mesh, and the remaining error.

    Args:
        at: Function of the number of halvings that returns the computed number on this mesh.
        halved: Number of halvings to begin with.
        halvings: Largest number of halvings; with 0, both results are zero.
        accuracy: Requested relative error of mesh and increments together.

    Returns:
        Number of halvings, and the absolute error caused by the increments after these halvings.
    """
    while halvings:
        before, half = at(halved), at(halved + 1)
        error = 2 * abs(half - before)
        if error <= INCREMENT_SHARE * accuracy * abs(half) or halved == halvings:
            return halved, error
        halved += 1
    return 0, 0.0


def _value(compute: Callable, tried: dict[tuple, float], key: tuple, comm: MPI.Comm) -> float:
    """Return the number that ``compute`` returns for ``key``.  Collective.

    Each number is computed only once.

    Args:
        compute: Function of a mesh and a number of parts.
        tried: Numbers computed so far, by ``key``; a new number is added.
        key: Mesh and number of parts of each increment.
        comm: Communicator of the ranks that compute together.

    Raises:
        ValueError: the number is zero, not finite, not real, or differs between ranks.
    """
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
    """Return the accuracy as a number after a check of the arguments of ``converge``.

    Raises:
        ValueError: an argument is invalid.
    """
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
    """Warn if two runs returned equal numbers, since the error estimated from them is zero."""
    first: dict[float, tuple] = {}
    for key, value in tried.items():
        if first.setdefault(value, key) != key:
            warnings.warn(
                f"compute returned {value!r} to the last digit for {first[value]} and for {key}, so no error is seen: check "
                "that it uses the mesh and the number of parts that it is given.",
                stacklevel=3,
            )
            return
