# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The compiled condensed solver, with linear algebra for the instructions of this processor."""

from __future__ import annotations

import importlib
from typing import Any

from dolfinx_contact import _kernel


def widest_algebra() -> Any:
    """Linear algebra of the condensed solver with this processor's widest vector instructions.

    It is the last argument of ``CondensedOperator``.  None selects the code that every processor
    can run.  Results with different instructions differ
    by rounding.
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
    """Return the compiled ``CondensedOperator`` of a compliance ``W``.

    Args:
        W: Compliance: ``dim`` rows per contact node, then ``tied`` rows.
        dim: Number of components per contact node.
        tied: Number of rows of bilateral constraints.
    """
    return _kernel.CondensedOperator(W, dim, tied, widest_algebra())
