# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Tables that benchmarks print."""


def table(titles, lines) -> str:
    """Titles and lines of cells in Markdown."""
    return "\n".join(f"| {' | '.join(map(str, x))} |" for x in (titles, ["---"] * len(titles), *lines))  # fmt: skip
