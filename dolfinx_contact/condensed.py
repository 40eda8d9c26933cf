# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The condensed contact problem: ``w = q + W r`` and the friction law between ``w`` and ``r``; arrays alone, without DOLFINx."""

from dolfinx_contact.solvers.condensed.newton import CondensedNewton, solve_condensed
from dolfinx_contact.solvers.condensed.result import CondensedNotConverged, CondensedResult

__all__ = ["CondensedNewton", "CondensedNotConverged", "CondensedResult", "solve_condensed"]
