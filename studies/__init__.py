# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Studies: computations that reproduce a paper. From the clone's root: ``python -m studies.punch``."""
