"""Declarations of the C++ kernel with the comments that stand above them, for the reference."""

import re
from pathlib import Path
from typing import NamedTuple

INCLUDE = Path(__file__).resolve().parents[2] / "cpp" / "include" / "dolfinx_contact"
HIDDEN = re.compile(r"^namespace detail \{$.*?^\} // namespace detail$", re.DOTALL | re.MULTILINE)
COMMENTED = re.compile(r"^((?:///.*\n)+)(?![#/\n])", re.MULTILINE)
BODY = re.compile(r"[^{;]*?\bstruct \w+ \{.*?^\};", re.DOTALL | re.MULTILINE)  # with its members


class Declaration(NamedTuple):
    """What a header declares outside of classes, and what it says of it."""

    signature: str
    comment: str


def about(header: str) -> str:
    """What a header says of itself."""
    return words(re.search(r"/// @file .*\n((?:///.*\n)*)", (INCLUDE / header).read_text())[1])


def declarations(header: str) -> list[Declaration]:
    """All with a comment, but those of a namespace ``detail``."""
    text, found = HIDDEN.sub("", (INCLUDE / header).read_text()), []
    for comment in COMMENTED.finditer(text):
        rest = text[comment.end() :]
        declared = BODY.match(rest) or re.match("[^{;]*", rest)
        found.append(Declaration(declared[0].strip(), words(comment[1])))
    return found


def words(comment: str) -> str:
    """The text of a comment."""
    return re.sub(r"^/// ?", "", comment, flags=re.MULTILINE).replace("@param ", "").strip()


def setup(app) -> dict:
    """A directive ``header`` with the name of one."""
    from docutils import nodes
    from sphinx.util.docutils import SphinxDirective

    def prose(text: str) -> list:
        return [nodes.paragraph("", part) for part in text.split("\n\n")]

    class Header(SphinxDirective):
        required_arguments = 1

        def run(self):
            header = self.arguments[0]
            self.env.note_dependency(str(INCLUDE / header))
            found = prose(about(header))
            for signature, comment in declarations(header):
                found.append(nodes.literal_block(signature, signature, language="cpp"))
                found += prose(comment)
            return found

    app.add_directive("header", Header)
    return {"parallel_read_safe": True}
