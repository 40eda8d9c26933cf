"""What all ranks do together: mistakes are raised on all, so that none waits for another for ever; sums and norms."""

from __future__ import annotations

import pickle
from contextlib import contextmanager

import numpy as np
from mpi4py import MPI


@contextmanager
def raised_together(comm):
    """Raise on every rank of ``comm`` what the block raised on any of them.

    The block must not communicate.  One shared flag is exchanged after it; only if it is up does
    the first rank that failed send its message to the others.
    """
    if comm.size == 1:
        yield
        return
    error = None
    try:
        yield
    except BaseException as caught:  # Ctrl-C, too: the other ranks must not be left waiting
        error = caught
    first = comm.allreduce(comm.rank if error is not None else comm.size, op=MPI.MIN)
    if first == comm.size:
        return
    kind, message = comm.bcast(_told(error) if comm.rank == first else None, root=first)
    if error is not None:
        raise error
    raise kind(f"{message} (found on rank {first})")


def by_first_rank(comm, work, tell=None):
    """What ``work(monitor)`` returns on rank 0, or its error, on all ranks.

    Every ``line`` that it gives its monitor becomes ``tell(*line)`` on all ranks, whose error ends the work; without
    ``tell`` it has no monitor.  Collective.
    """
    failed = result = None

    def monitor(*line) -> None:
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


def from_first(comm, value):
    """A value of rank 0, on all ranks.  On one rank it is not taken apart for it."""
    return value if comm.size == 1 else comm.bcast(value, root=0)


def agree(comm, **values) -> None:
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


def described(value) -> str:
    """A value in words that are the same on all ranks, which an object's address is not."""
    if type(value).__repr__ is not object.__repr__:
        return repr(value)
    plain = {k: v for k, v in vars(value).items() if isinstance(v, (bool, int, float, str))}
    return f"{type(value).__name__}({', '.join(f'{k}={v!r}' for k, v in sorted(plain.items()))})"


def _told(error) -> tuple[type, str]:
    """Type and message of an error for the other ranks, to which not every type can be sent, or made from a message."""
    kind = type(error)
    try:
        pickle.dumps(kind)
        kind(str(error))
    except Exception:
        return RuntimeError, f"{kind.__name__}: {error}"
    return kind, str(error)


class OverRanks:
    """Sums, norms and comparisons over the ranks of ``self.comm``.  Collective."""

    comm: MPI.Comm

    def total(self, array: np.ndarray) -> np.ndarray:
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

    def same(self, x: np.ndarray, y: np.ndarray) -> bool:
        """Whether two arrays are equal on all ranks."""
        return self.comm.allreduce(np.array_equal(x, y), op=MPI.LAND)
