# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Formulas as MathML, which browsers draw themselves: no script, nothing is fetched.

Why not sphinx.ext.mathjax or sphinxcontrib-katex: both need a script from elsewhere; sphinx.ext.imgmath needs LaTeX.
"""

import re

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

# One argument of a command: a group, another command, or a character.
ARGUMENT = r"\s*(\{(?:[^{}]|\{[^{}]*\})*\}|\\[A-Za-z]+|[^\s\\{}])"


def grouped(formula: str) -> str:
    r"""Braces that TeX does without and docutils needs: ``\frac12`` would be 12 over what follows, ``\dot u_t`` a t under u.

    Sizes of brackets, ``\big``, are dropped: docutils does not know them.
    """
    formula = re.sub(r"\\[bB]igg?[lrm]?(?![A-Za-z])", "", formula)
    formula = re.sub(r"\\frac" + 2 * ARGUMENT, r"\\frac{\1}{\2}", formula)
    accents = r"\\(dot|ddot|bar|hat|tilde|vec)(?![A-Za-z])"
    return re.sub(accents + ARGUMENT + r"\s*(?=_)", r"\\\1{\2}{}", formula)


def _inline(translator, node) -> None:
    translator.body.append(tex2mathml(grouped(node.astext())))
    raise nodes.SkipNode


def _block(translator, node) -> None:
    formula = tex2mathml(grouped(node.astext()), as_block=True)
    translator.body.append(f'<div class="formula">{formula}</div>\n')
    raise nodes.SkipNode


def setup(app) -> dict:
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True}
