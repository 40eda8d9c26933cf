# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Ranks call collective functions from the same lines: each call first says on all ranks where it comes from.

Ranks that come from different lines may exchange numbers that mean different things, and no error follows.
"""

from inspect import currentframe
from pathlib import Path
from time import monotonic, sleep
from zlib import crc32

import numpy as np
import pytest
from mpi4py import MPI

from dolfinx_contact.support.collective import OverRanks, raised_together

PATIENCE = 30.0  # seconds that a rank waits for the others
LONGEST = 200  # of the name of a line


class Lines:
    """The line from which each rank called last, in memory that all ranks of a machine see."""

    def __init__(self, comm):
        self.comm = comm.Dup()  # never mistaken for a call of the tested code
        self.window = MPI.Win.Allocate_shared(LONGEST, 1, comm=self.comm)

    def of(self, rank) -> np.ndarray:
        return np.frombuffer(self.window.Shared_query(rank)[0], dtype=np.uint8)

    def all(self) -> str:
        said = (bytes(self.of(rank)).rstrip(b"\0").decode() for rank in range(self.comm.size))
        return ", ".join(f"rank {rank} from {line}" for rank, line in enumerate(said))

    def check(self, line) -> None:
        """Raise an error on all ranks unless they come from the same line.  Collective."""
        name = line.encode()[:LONGEST]
        self.of(self.comm.rank)[:] = np.frombuffer(name.ljust(LONGEST, b"\0"), dtype=np.uint8)
        ends, mine = np.empty(2, dtype=np.int64), crc32(name)
        request = self.comm.Iallreduce(np.array([mine, -mine], dtype=np.int64), ends, op=MPI.MAX)
        until = monotonic() + PATIENCE
        while not request.Test():
            if monotonic() > until:
                raise AssertionError(f"a rank waits for the others; last calls: {self.all()}")
            sleep(1e-5)
        if ends[0] != -ends[1]:
            apart = self.all()
            self.comm.Barrier()  # no rank goes on before all have read
            raise AssertionError(f"ranks call from different lines: {apart}")

    def close(self) -> None:
        self.window.Free()
        self.comm.Free()


def line_of(frame) -> str:
    """The nearest line outside this file."""
    while frame.f_code.co_filename == __file__:
        frame = frame.f_back
    return f"{'/'.join(Path(frame.f_code.co_filename).parts[-2:])}:{frame.f_lineno}"


def watched(method, lines, comm_of):
    def call(self, *given):
        if comm_of(self, *given).size == lines.comm.size:
            lines.check(line_of(currentframe()))
        return method(self, *given)

    return call


@pytest.fixture(scope="session")
def lines():
    made = Lines(MPI.COMM_WORLD)
    yield made
    made.close()


@pytest.fixture
def same_lines(request, monkeypatch):
    """On several ranks, sums, norms, comparisons and blocks that raise together fail where ranks come from different lines."""
    if MPI.COMM_WORLD.size == 1:
        return
    lines = request.getfixturevalue("lines")
    for name in ("total", "largest", "highest", "norm", "same"):
        method = watched(getattr(OverRanks, name), lines, lambda self, *_: self.comm)
        monkeypatch.setattr(OverRanks, name, method)
    begun = watched(raised_together.__init__, lines, lambda _, comm: comm)
    monkeypatch.setattr(raised_together, "__init__", begun)
