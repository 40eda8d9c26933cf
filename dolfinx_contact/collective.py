"""What users are told: mistakes, raised by all ranks together so that none waits for another for
ever, and what rounding does not let be reached."""

from __future__ import annotations

import pickle
from contextlib import contextmanager

from mpi4py import MPI


@contextmanager
def raised_together(comm):
    """Raise on every rank of ``comm`` what the block raised on any of them.

    The block must not communicate.  One shared flag is exchanged after it; only if it is up does
    the first rank that failed send its message to the others.
    """
    error = None
    try:
        yield
    except Exception as caught:  # whatever it is, the other ranks must not be left waiting
        error = caught
    first = comm.allreduce(comm.rank if error is not None else comm.size, op=MPI.MIN)
    if first == comm.size:
        return
    kind, message = comm.bcast(_told(error) if comm.rank == first else None, root=first)
    if error is not None:
        raise error
    raise kind(f"{message} (found on rank {first})")


def agree(comm, **values) -> None:
    """Raise a ``ValueError`` on every rank if a value that all ranks should have the same differs."""
    mine = {name: described(value) for name, value in values.items()}
    first = comm.bcast(mine, root=0)
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
