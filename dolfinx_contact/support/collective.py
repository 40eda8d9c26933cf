# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What all ranks do together: mistakes are raised on all, so that none waits for another for ever; sums and norms."""

from __future__ import annotations

import pickle
import signal
import sys
from collections.abc import Callable
from threading import current_thread, main_thread
from time import monotonic, sleep
from traceback import print_exception
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike

# Seconds that a rank that failed waits for the others, which may be busy with work of their own.
WAITING_SECONDS = 60.0


class raised_together:
    """Raise on every rank of ``comm`` what the block raised on any of them.

    One shared flag is exchanged after the block; only if it is up does the first rank that failed send its message to the
    others.  A block that communicates may leave the others in its midst, where they wait for the rank that failed: if they
    have not come to the end of the block ``PATIENCE`` seconds later, that rank prints its error and ends all of them.
    """

    def __init__(self, comm: MPI.Comm):
        self._comm = comm

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, _: type[BaseException] | None, error: BaseException | None, __: object
    ) -> None:  # Ctrl-C, too, must not leave the others waiting
        comm = self._comm
        if comm.size == 1 or (first := _first_to_fail(comm, error)) == comm.size:
            return
        kind, message = comm.bcast(_told(error) if comm.rank == first else None, root=first)
        if error is None:
            raise kind(f"{message} (found on rank {first})")


class uninterrupted:
    """Ctrl-C in the block is answered after it; in the main thread, which alone receives it."""

    def __enter__(self) -> None:
        self._came: tuple = ()
        self._handler: Any = signal.getsignal(signal.SIGINT)
        self._holds = current_thread() is main_thread() and callable(self._handler)
        if self._holds:
            signal.signal(signal.SIGINT, self._wait)

    def _wait(self, *came: Any) -> None:
        self._came = came

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if self._holds:
            signal.signal(signal.SIGINT, self._handler)
            if self._came and error is None:
                self._handler(*self._came)


def _first_to_fail(comm: MPI.Comm, error: BaseException | None) -> int:
    """The lowest rank with an error, or the number of ranks."""
    mine, first = np.array([comm.size if error is None else comm.rank]), np.empty(1, dtype=int)
    request = comm.Iallreduce(mine, first, op=MPI.MIN)
    if error is None:
        request.Wait()
    until = monotonic() + WAITING_SECONDS
    while error is not None and not request.Test():
        if monotonic() > until:
            print_exception(type(error), error, error.__traceback__)
            print(
                f"dolfinx_contact: rank {comm.rank} failed with the error above. {WAITING_SECONDS:g} s later others still wait for it "
                "in the midst of what it left: all of them are ended.",
                file=sys.stderr,
                flush=True,
            )
            comm.Abort(1)
        sleep(1e-3)
    return int(first[0])


def by_first_rank(comm: MPI.Comm, work: Callable, tell: Callable | None = None):
    """What ``work(monitor)`` returns on rank 0, or its error, on all ranks.

    Every ``line`` that it gives its monitor becomes ``tell(*line)`` on all ranks, whose error ends the work; without
    ``tell`` it has no monitor.  Collective.
    """
    failed = result = None

    def monitor(*line: Any) -> None:
        comm.bcast(line, root=0)
        tell(*line)

    if comm.rank == 0:
        try:
            result = work(monitor if tell else None)
        except BaseException as caught:
            failed = caught
        if tell:
            comm.bcast(None, root=0)
    while comm.rank > 0 and tell and (line := comm.bcast(None, root=0)) is not None:
        try:
            tell(*line)
        except BaseException as caught:  # raised on rank 0, too
            failed = caught
    with raised_together(comm):
        if failed is not None:
            raise failed
    return from_first(comm, result)


def from_first(comm: MPI.Comm, value: Any):
    """A value of rank 0, on all ranks.  On one rank it is not taken apart for it."""
    return value if comm.size == 1 else comm.bcast(value, root=0)


def agree(comm: MPI.Comm, **values: object) -> None:
    """Raise a ``ValueError`` on every rank if a value that all ranks should have the same differs."""
    if comm.size == 1:
        return
    mine = {name: described(value) for name, value in values.items()}
    first = from_first(comm, mine)
    with raised_together(comm):
        for name, value in mine.items():
            if value != first[name]:
                raise ValueError(
                    f"{name} differs between ranks: here {value}, on rank 0 {first[name]}. Give the same on all."
                )


def described(value: object) -> str:
    """A value in words that are the same on all ranks, which an object's address is not."""
    if type(value).__repr__ is not object.__repr__:
        return repr(value)
    plain = {k: v for k, v in vars(value).items() if isinstance(v, (bool, int, float, str))}
    return f"{type(value).__name__}({', '.join(f'{k}={v!r}' for k, v in sorted(plain.items()))})"


def _told(error: BaseException) -> tuple[type, str]:
    """Type and message of an error for the other ranks: the nearest of its types that can be sent, and made from a message."""
    for kind in type(error).__mro__:
        try:
            pickle.dumps(kind)
            kind(str(error))
            break
        except Exception:
            continue
    if kind is type(error):
        return kind, str(error)
    return RuntimeError if kind is Exception else kind, f"{type(error).__name__}: {error}"


class OverRanks:
    """Sums, norms and comparisons over the ranks of ``self.comm``.  Collective."""

    comm: MPI.Comm

    def total(self, array: ArrayLike) -> np.ndarray:
        """Sum of an array over all ranks."""
        result = np.array(array, dtype=np.float64)
        self.comm.Allreduce(MPI.IN_PLACE, result, op=MPI.SUM)
        return result

    def largest(self, x: np.ndarray) -> float:
        """Largest entry over all ranks, at least zero."""
        return self.comm.allreduce(float(x.max(initial=0.0)), op=MPI.MAX)

    def highest(self, x: np.ndarray) -> float:
        """Largest entry over all ranks, which may be below zero."""
        return self.comm.allreduce(float(x.max(initial=-np.inf)), op=MPI.MAX)

    def norm(self, x: np.ndarray) -> float:
        """Euclidean norm over all ranks, safe against under- and overflow of squares."""
        largest = self.largest(np.abs(x))
        if largest == 0.0 or not np.isfinite(largest):
            return largest
        return largest * float(np.sqrt(self.total(np.sum((x / largest) ** 2))))

    def same(self, x: np.ndarray, y: np.ndarray | None) -> bool:
        """Whether two arrays are equal on all ranks; None equals none."""
        return self.comm.allreduce(np.array_equal(x, y), op=MPI.LAND)
