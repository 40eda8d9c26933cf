# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Collective operations: errors raised on all ranks, so that none waits forever; sums and norms."""

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

# Time in seconds that a failed rank waits for the others, which may still be computing.
WAITING_SECONDS = 60.0


class raised_together:
    """Context manager that raises an exception of any rank on every rank of ``comm``.  Collective.

    Ranks exchange one flag after the block.  Only if it is set, the first rank that failed sends
    its message to the others.  If the block itself communicates, other ranks may wait inside it for
    the rank that failed.  If they do not reach the end of the block within ``WAITING_SECONDS``,
    that rank prints its error and aborts all ranks.
    """

    def __init__(self, comm: MPI.Comm):
        self._comm = comm

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, _: type[BaseException] | None, error: BaseException | None, __: object
    ) -> None:  # Ctrl-C on one rank must not leave the others waiting, either
        comm = self._comm
        if comm.size == 1 or (first := _first_to_fail(comm, error)) == comm.size:
            return
        kind, message = comm.bcast(_sendable(error) if comm.rank == first else None, root=first)
        if error is None:
            raise kind(f"{message} (found on rank {first})")


class uninterrupted:
    """Context manager that delays Ctrl-C until the end of the block.

    It acts in the main thread only, where Python handles signals.
    """

    def __enter__(self) -> None:
        self._signal_arguments: tuple = ()
        self._handler: Any = signal.getsignal(signal.SIGINT)
        self._delays = current_thread() is main_thread() and callable(self._handler)
        if self._delays:
            signal.signal(signal.SIGINT, self._wait)

    def _wait(self, *came: Any) -> None:
        self._signal_arguments = came

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if self._delays:
            signal.signal(signal.SIGINT, self._handler)
            if self._signal_arguments and error is None:
                self._handler(*self._signal_arguments)


def _first_to_fail(comm: MPI.Comm, error: BaseException | None) -> int:
    """Return the lowest rank with an error, or the number of ranks if there is none.
    Collective.
    """
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
    """Run ``work(monitor)`` on rank 0, and return its result or raise its error on all ranks.
    Collective.

    Args:
        comm: MPI communicator.
        work: Function of a monitor, called on rank 0 only.
        tell: Function that is called on all ranks with the arguments of each call of the monitor;
            an error in it ends the work.  If None, ``work`` receives None as monitor.
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
    """Return the value of rank 0 on all ranks; on one rank, the same object.  Collective."""
    return value if comm.size == 1 else comm.bcast(value, root=0)


def agree(comm: MPI.Comm, **values: object) -> None:
    """Raise a ``ValueError`` on every rank if one of the values differs between ranks.
    Collective.
    """
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
    """Return a text that describes a value and is the same on all ranks.

    Objects without their own ``__repr__`` are described by type and plain attributes, not by
    address.
    """
    if type(value).__repr__ is not object.__repr__:
        return repr(value)
    plain = {k: v for k, v in vars(value).items() if isinstance(v, (bool, int, float, str))}
    return f"{type(value).__name__}({', '.join(f'{k}={v!r}' for k, v in sorted(plain.items()))})"


def _sendable(error: BaseException) -> tuple[type, str]:
    """Return type and message of an error, to be sent to other ranks.

    The type is the nearest base class that can be pickled and be constructed from a message.
    """
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
    """Base class with sums, norms and comparisons over the ranks of ``self.comm``.  Collective."""

    comm: MPI.Comm

    def total(self, array: ArrayLike) -> np.ndarray:
        """Return the sum of an array over all ranks."""
        result = np.array(array, dtype=np.float64)
        self.comm.Allreduce(MPI.IN_PLACE, result, op=MPI.SUM)
        return result

    def largest(self, x: np.ndarray) -> float:
        """Return the largest entry over all ranks, or zero if all are negative."""
        return self.comm.allreduce(float(x.max(initial=0.0)), op=MPI.MAX)

    def highest(self, x: np.ndarray) -> float:
        """Return the largest entry over all ranks, of any sign; minus infinity without entries."""
        return self.comm.allreduce(float(x.max(initial=-np.inf)), op=MPI.MAX)

    def norm(self, x: np.ndarray) -> float:
        """Return the Euclidean norm over all ranks, without underflow or overflow of squares."""
        largest = self.largest(np.abs(x))
        if largest == 0.0 or not np.isfinite(largest):
            return largest
        return largest * float(np.sqrt(self.total(np.sum((x / largest) ** 2))))

    def same(self, x: np.ndarray, y: np.ndarray | None) -> bool:
        """Whether two arrays are equal on all ranks; False if ``y`` is None."""
        return self.comm.allreduce(np.array_equal(x, y), op=MPI.LAND)
