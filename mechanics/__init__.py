# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What tests and benchmarks share: scenes, a material, a judge of answers; no part of any solver."""
