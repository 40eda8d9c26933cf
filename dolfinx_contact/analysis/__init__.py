# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Adaptive increments, mesh refinement, error estimates, and wear over many cycles."""
