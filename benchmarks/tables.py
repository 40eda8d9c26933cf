# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Tables that benchmarks print or show on a page."""


def table(titles, lines) -> str:
    """Titles and lines of cells in Markdown."""
    return "\n".join(f"| {' | '.join(map(str, x))} |" for x in (titles, ["---"] * len(titles), *lines))  # fmt: skip


def chosen(rows, titles: dict) -> list[dict]:
    """Of each row what it has under these keys, with other titles."""
    return [{title: row.get(key) for key, title in titles.items()} for row in rows]
