# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Solver of the condensed contact problem for given arrays, without DOLFINx.

The unknowns are relative motions ``w`` and reactions ``r`` of the contact nodes, with ``w = q + W
r`` and the contact and friction law between ``w`` and ``r``.
"""

from dolfinx_contact.solvers.condensed.newton import CondensedNewton, solve_condensed
from dolfinx_contact.solvers.condensed.result import CondensedNotConverged, CondensedResult

__all__ = ["CondensedNewton", "CondensedNotConverged", "CondensedResult", "solve_condensed"]
