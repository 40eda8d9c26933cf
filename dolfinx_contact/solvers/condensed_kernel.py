# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The compiled condensed solver for this processor: with AVX2 and FMA, or what every processor has."""

from __future__ import annotations

import importlib
from typing import Any

from dolfinx_contact import _kernel


def fastest() -> Any:
    """The module for this processor; it has ``CondensedOperator``.  Answers of two differ by rounding."""
    if _kernel.has_avx2():
        try:
            return importlib.import_module("dolfinx_contact._kernel_avx2")
        except ImportError:  # not built on this platform
            pass
    return _kernel


CondensedOperator = fastest().CondensedOperator
