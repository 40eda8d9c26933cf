# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The compiled condensed solver for this processor: with AVX-512, with AVX2 and FMA, or what every processor has."""

from __future__ import annotations

import importlib
from typing import Any

from dolfinx_contact import _kernel


def fastest(dim: int) -> Any:
    """The module with ``CondensedOperator`` for so many components.  Answers of two modules differ by rounding."""
    for instructions in _kernel.instruction_sets() if dim == 3 else ():
        try:
            return importlib.import_module(f"dolfinx_contact._kernel_{instructions}")
        except ImportError:  # not built on this platform
            pass
    return _kernel


def condensed_operator(W: Any, dim: int, tied: int = 0) -> Any:
    """The kernel's ``CondensedOperator`` of ``W``, ``dim`` rows a contact, then ``tied`` ones.

    A sparse ``W`` is by columns, sorted, and has no tied rows.
    """
    kernel = fastest(dim).CondensedOperator
    if hasattr(W, "indptr"):
        return kernel.by_columns(W.data, W.indices, W.indptr, dim)
    return kernel(W, dim, tied)
