# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Results of a run: step records, tables, profiles, VTK files, pictures and checkpoints."""
