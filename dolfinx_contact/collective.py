"""What users are told: mistakes, raised by all ranks together so that none waits for another for
ever, and what rounding does not let be reached."""

from __future__ import annotations

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
    kind, message = comm.bcast(
        (type(error), str(error)) if comm.rank == first else None, root=first
    )
    if error is not None:
        raise error
    raise kind(f"{message} (found on rank {first})")
