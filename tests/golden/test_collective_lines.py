# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Ranks that call collective functions from different lines are told both of them."""

import numpy as np
import pytest
from mpi4py import MPI

from dolfinx_contact.support.collective import OverRanks, raised_together

COMM = MPI.COMM_WORLD
pytestmark = [
    pytest.mark.ranks,
    pytest.mark.usefixtures("same_lines"),
    pytest.mark.skipif(COMM.size == 1, reason="needs several ranks"),
]


class Sums(OverRanks):
    comm = COMM


def test_sums_from_different_lines_are_told_apart():
    """A sum on one rank, and another one on the others: each rank names the file and both lines, and the next sum is right."""
    with pytest.raises(AssertionError, match=r"rank 0 from golden/.*:(\d+), rank 1 from golden/") as told:  # fmt: skip
        if COMM.rank == 0:
            Sums().total(1.0)
        else:
            Sums().total(2.0)
    first, second = str(told.value).split("rank ")[1:3]
    assert first.split(":")[1] != second.split(":")[1]
    assert Sums().total(1.0) == COMM.size


def test_a_block_on_one_rank_is_told_from_a_norm_on_another():
    """Where different functions wait for each other, too."""
    with pytest.raises(AssertionError, match="different lines"):
        if COMM.rank == 0:
            with raised_together(COMM):
                pass
        else:
            Sums().norm(np.ones(2))
