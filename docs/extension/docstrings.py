# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Docstrings in the reference: pages that they name are links, and several attributes may share a line.

Why not napoleon or numpydoc alone: both take the second of two names for a type.
"""

import re


def prepare(app, what, name, obj, options, lines: list[str]) -> None:
    """After napoleon: its fields take a second word for a name, so that "a, b" would be "b" of type "a"."""
    for k, line in enumerate(lines):
        line = re.sub(
            r"^(:ivar )((?:\w+, )+\w+)(?=:)", lambda m: m[1] + m[2].replace(", ", ","), line
        )
        lines[k] = re.sub(r"(?<![\w/])(docs/[\w/]+)\.md", r":doc:`/\1`", line)


def setup(app) -> dict:
    app.connect("autodoc-process-docstring", prepare, priority=900)
    return {"parallel_read_safe": True}
