# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Solvers of a load step, each set up for one body and its contacts."""
