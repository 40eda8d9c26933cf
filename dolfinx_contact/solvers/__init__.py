# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Solvers of a load step, each bound to a body and its contacts."""
