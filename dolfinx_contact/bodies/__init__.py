# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Bodies, as assembled by DOLFINx, without contact."""
