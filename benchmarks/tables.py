# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Markdown tables of records, as benchmarks print them."""

from __future__ import annotations


def ratio(value: float) -> str:
    """A ratio as a reader wants it: two digits."""
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}" if value >= 1 else f"{value:.2f}"


def table(titles, lines) -> str:
    """Titles and lines of cells in Markdown."""
    return "\n".join(f"| {' | '.join(map(str, x))} |" for x in (titles, ["---"] * len(titles), *lines))  # fmt: skip
