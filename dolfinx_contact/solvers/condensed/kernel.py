# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The compiled condensed solver with the linear algebra for this processor: AVX-512, AVX2 and FMA, or what all have."""

from __future__ import annotations

import importlib
from typing import Any

from dolfinx_contact import _kernel


def widest_algebra() -> Any:
    """The last argument of ``CondensedOperator``, None for what every processor can run.

    Answers with one and with another differ by rounding.
    """
    for instructions in _kernel.instruction_sets():
        try:
            return importlib.import_module(
                f"dolfinx_contact._algebra_{instructions}"
            ).linear_algebra
        except ImportError:  # not built on this platform
            pass
    return None


def condensed_operator(W: Any, dim: int, tied: int = 0) -> Any:
    """The kernel's ``CondensedOperator`` of ``W``, ``dim`` rows a contact, then ``tied`` ones."""
    return _kernel.CondensedOperator(W, dim, tied, widest_algebra())
