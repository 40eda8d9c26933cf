# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A number and its unit stay on one line, and so do the two sides of "n = 4" and of "1 ± 2".

Why not smartquotes or typographic replacements of MyST: they know quotes and dashes, no spaces.
"""

import re

BREAKS = re.compile(
    r"(?<=\d) (?=(?:%|°|(?:[µmkMG]?(?:m|s|N|J|Pa|B)|min)\b))|(?<=\w) (?== \d)|(?<= =) (?=\d)"
    r"|(?<=\d) (?=± ?\d)|(?<=±) (?=\d)"
)


def together(text: str) -> str:
    """Text with spaces at which no line ends, where one would part what is one."""
    return BREAKS.sub("\N{NO-BREAK SPACE}", text)


def join(app, doctree, name) -> None:
    from docutils import nodes

    apart = (nodes.literal, nodes.literal_block, nodes.math, nodes.math_block, nodes.raw)
    for text in list(doctree.findall(nodes.Text)):
        if not isinstance(text.parent, apart):
            text.parent.replace(text, nodes.Text(together(text.astext())))


def setup(app) -> dict:
    app.connect("doctree-resolved", join)
    return {"parallel_read_safe": True}
