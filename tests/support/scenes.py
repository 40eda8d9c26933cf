# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The block of many tests, and what is read from its contact on all ranks."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from mechanics.material import elasticity
from mechanics.scenes import block, rotation

__all__ = ["COMM", "MPI", "block", "by_position", "elasticity", "gathered", "rotation", "totals"]
COMM = MPI.COMM_WORLD


def gathered(contact):
    """Positions and local reactions of all nodes on every rank, sorted by position."""
    x = np.concatenate(contact.comm.allgather(contact.x))
    r = np.concatenate(contact.comm.allgather(contact.reaction))
    order = np.lexsort(np.round(x / np.abs(x).max(), 9).T)
    return x[order], r[order]


def totals(contact):
    """Total normal reaction and sum of the norms of the tangential ones, the same on all ranks."""
    _, r = gathered(contact)
    return np.array([r[:, -1].sum(), np.linalg.norm(r[:, :-1], axis=1).sum()])


def by_position(scene, name):
    """An array of all contact nodes, in an order that no rank has to do with."""
    contact = scene.contact
    x, values = (np.concatenate(contact.comm.allgather(a)) for a in (contact.x, getattr(contact, name)))  # fmt: skip
    return values[np.lexsort(np.round(x / np.abs(x).max(), 9).T)]
