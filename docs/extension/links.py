# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Every link and picture of every page leads to a file of the site, and to an anchor that is there; pages are opened, not saved.

Why not Sphinx's linkcheck: it asks addresses of other sites, and takes links within this one for granted.
"""

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """Anchors of a page and where it leads to."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list) -> None:
        given = dict(attributes)
        self.anchors |= {given[name] for name in ("id", "name") if given.get(name)}
        self.links |= {given[name] for name in ("href", "src") if given.get(name)}


def dead_links(folder: Path) -> list[str]:
    """Links within a folder of pages that lead nowhere, as "page: link"."""
    pages = {file.resolve(): Page(file) for file in folder.rglob("*.html")}
    dead = []
    for file, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            anchor = unquote(parts.fragment)
            known = target in pages and (not anchor or anchor in pages[target].anchors)
            if not known and (target in pages or not target.is_file()):
                dead.append(f"{file.relative_to(folder.resolve())}: {link}")
    return sorted(dead)


def opened(body: str) -> str:
    """A page whose links to other pages, such as the report, open these: Sphinx takes them for files to be saved."""
    return re.sub(r' download="" (href="[^"]+\.html")', r" \1", body)


def open_pages(app, name, template, context, doctree) -> None:
    context["body"] = opened(context.get("body", ""))


def check(app, exception) -> None:
    if exception is None and app.builder.format == "html":
        dead = dead_links(Path(app.outdir))
        if dead:
            from sphinx.errors import ExtensionError  # tests of the links do without Sphinx

            raise ExtensionError("links lead nowhere:\n  " + "\n  ".join(dead))


def setup(app) -> dict:
    app.connect("html-page-context", open_pages)
    app.connect("build-finished", check)
    return {"parallel_read_safe": True}
