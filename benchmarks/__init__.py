# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Measurements; each program runs from the root of the clone: ``python -m benchmarks.NAME --help``."""

import dolfinx_contact  # noqa: F401  before DOLFINx, which one of its wheels needs
