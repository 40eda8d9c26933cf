# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
from collective_lines import lines, same_lines

__all__ = ["lines", "same_lines"]
