# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The C++ reference: declarations of a header with the comments above them, as the header has them.

Why not breathe: it needs Doxygen, which pip cannot install, and shows declarations in an order of its own.

```{cpp-header} law/friction.h
```
"""

import re
from pathlib import Path
from typing import NamedTuple

HEADERS = Path(__file__).resolve().parents[2] / "cpp" / "include" / "dolfinx_contact"
TEMPLATE = re.compile(r"^template <[^<>]*>\s*")
NAMED = re.compile(r"(?:struct|class|enum class|using) (\w+)")
OVER_LINES = re.compile(r"\{[^{}\n]*\n")


class Declaration(NamedTuple):
    names: list[str]
    code: str  # without the bodies of functions
    says: list[str]  # lines of the comment above it


def declarations(text: str) -> tuple[list[str], list[Declaration]]:
    """What a header says of itself, and what it declares outside of ``detail`` namespaces."""
    text = re.sub(r"^namespace detail \{.*?^\} // namespace detail$", "", text, flags=re.S | re.M)
    opening, _, body = text.partition("#pragma once")
    says = [line[4:] for line in opening.splitlines() if line.startswith("///")][1:]
    body = re.sub(r"^(?:#|namespace|\} // namespace).*\n", "", body, flags=re.MULTILINE)
    found: list[Declaration] = []
    comment: list[str] = []
    lines = iter(body.splitlines())
    for line in lines:
        if line.startswith("///"):
            comment.append(line[4:])
        elif line.strip() and not line.startswith("//"):
            while line.count("{") > line.count("}") or not line.endswith((";", "}")):
                line += "\n" + next(lines)
            _add(found, line, comment)
            comment = []
    return says, found


def _add(found: list[Declaration], text: str, comment: list[str]) -> None:
    """One more; what has no comment and follows a type goes on with what stands before it."""
    head = TEMPLATE.sub("", text)
    if named := NAMED.match(head):
        name, code = named[1], without_bodies(text)
    elif head.startswith("inline constexpr"):
        name, code = head.split(" =")[0].split()[-1], text
    else:
        name = re.match(r"[^(]*?(\w+)\(", head)[1]
        code = text.split(" {")[0].rstrip(";") + ";"
    if not comment and found:
        last = found.pop()
        found.append(Declaration([*last.names, name], f"{last.code}\n{code}", last.says))
    else:
        found.append(Declaration([name], code, comment))


def without_bodies(text: str) -> str:
    """A type as its user sees it: no private members, no bodies of functions that take several lines."""
    text = re.sub(r"\n *private:.*(?=\n\};)", "", text, flags=re.DOTALL)
    first = text.index("{") + 1 if "{" in text else len(text)
    shown, at = text[:first], first
    while opening := OVER_LINES.search(text, at):
        end, depth = opening.start() + 1, 1
        while depth:
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            end += 1
        signature = re.sub(r"(\))\s*\n\s+: .*", r"\1", text[at : opening.start()], flags=re.DOTALL)
        shown += signature.rstrip() + ";"
        at = end
    return shown + text[at:]


def paragraphs(lines: list[str]):
    """A comment as (kind, text): "text", an "item" of a list, or "formula", which is indented."""
    kind, gathered = "text", []
    for line in [*lines, ""]:
        line = re.sub(r"^@param (\w+)", r"`\1`:", line)
        starts = "item" if line.startswith("- ") else "formula" if line.startswith("    ") else None
        starts = starts or ("item" if kind == "item" and line.startswith("  ") else "text")
        if gathered and (not line or starts != kind or line.startswith("- ")):
            yield kind, ("\n" if kind == "formula" else " ").join(gathered)
            gathered = []
        kind = starts
        if line:
            gathered.append(line[4:] if kind == "formula" else line.removeprefix("- ").strip())


def rendered(lines: list[str]) -> list:
    from docutils import nodes  # tests of the declarations do without Sphinx

    found = []
    for kind, text in paragraphs(lines):
        if kind == "formula":
            found.append(nodes.literal_block(text, text, language="text"))
            continue
        block = nodes.paragraph()
        for k, part in enumerate(text.split("`")):
            block += nodes.literal(part, part) if k % 2 else nodes.Text(part)
        if kind == "item":
            item = nodes.list_item("", block)
            if found and isinstance(found[-1], nodes.bullet_list):
                found[-1] += item
            else:
                found.append(nodes.bullet_list("", item))
        else:
            found.append(block)
    return found


def setup(app) -> dict:
    from docutils import nodes
    from sphinx.util.docutils import SphinxDirective

    class Header(SphinxDirective):
        required_arguments = 1

        def run(self) -> list:
            file = HEADERS / self.arguments[0]
            self.env.note_dependency(str(file))
            says, found = declarations(file.read_text())
            shown = rendered(says)
            for one in found:
                block = nodes.literal_block(one.code, one.code, language="c++")
                block["ids"] = [f"cpp-{file.stem}-{name}".lower() for name in one.names]
                meaning = nodes.container("", *rendered(one.says), classes=["declared"])
                shown += [block, meaning]
            return shown

    app.add_directive("cpp-header", Header)
    return {"parallel_read_safe": True}
