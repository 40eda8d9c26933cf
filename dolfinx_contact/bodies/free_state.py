# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The displacement without contact, and whether that under another load is the same times a factor."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from mpi4py import MPI


class FreeState(NamedTuple):
    """The displacement without contact under a load, arrays of owned degrees of freedom."""

    digest: np.ndarray  # of the stiffness
    load: np.ndarray
    displacement: np.ndarray
    exact: bool  # or to three digits

    def scaled(self, b: np.ndarray, fixed: np.ndarray, comm: MPI.Comm) -> np.ndarray | None:
        """The displacement under ``b``, if that is the load times a factor.  Collective.

        Args:
            b: As ``ElasticBody.load`` returns it.
            fixed: Fixed degrees of freedom, which hold boundary values.
            comm: MPI communicator.
        """
        asked_again = comm.allreduce(np.array_equal(b, self.load), op=MPI.LAND)
        if asked_again:  # in the same step
            return self.displacement.copy()
        factor = max(comm.allgather(_ratio(b, self.load)))[1]
        sizes = np.abs([b - factor * self.load, b])
        # Forces and boundary values have different units: each to its own rounding.
        given = sizes[:, fixed]
        sizes[:, fixed] = 0.0
        largest = np.array([part.max(axis=1, initial=0.0) for part in (given, sizes)])
        comm.Allreduce(MPI.IN_PLACE, largest, op=MPI.MAX)
        same = (largest[:, 0] <= 16 * np.finfo(float).eps * largest[:, 1]).all()
        return factor * self.displacement if same else None


def _ratio(b: np.ndarray, last: np.ndarray) -> tuple[float, float]:
    """Largest entry of ``last`` in magnitude, and ``b`` over ``last`` there."""
    if not last.any():
        return 0.0, 0.0
    k = np.abs(last).argmax()
    return abs(last[k]), b[k] / last[k]
