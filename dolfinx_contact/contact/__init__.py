# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact points of a body and the rigid planes that they may touch."""
