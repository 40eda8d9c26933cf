# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Matrices of some of the entries of another one."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc


def with_entries(
    A: PETSc.Mat, starts: np.ndarray, columns: np.ndarray, values: np.ndarray, kept: np.ndarray
) -> PETSc.Mat:
    """A matrix of the layout of A with some of the entries in rows of this rank, ``kept`` true.  Collective."""
    starts = np.append(0, np.cumsum(kept))[starts].astype(PETSc.IntType)
    csr = starts, columns[kept].astype(PETSc.IntType), values[kept]
    return PETSc.Mat().createAIJ(A.getSizes(), csr=csr, comm=A.comm)
