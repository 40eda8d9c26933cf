# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""One HTML file with all that is shown: figures inside it, tables from rows; nothing is fetched from elsewhere."""

import base64
import html
import math
from pathlib import Path

STYLE = """
:root { color-scheme: light dark; --line: #bbb; --bad: #b00020; }
@media (prefers-color-scheme: dark) { :root { --line: #555; --bad: #ff8a8a; } }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 1500px; margin: 2em auto; padding: 0 1em; }
.bad { color: var(--bad); } .scroll { overflow-x: auto; } figure { margin: 2em 0; }
img { width: 100%; min-width: 44em; background: white; } figcaption { max-width: 60em; }
table { border-collapse: collapse; margin: 1em 0; font-size: 0.85em; } summary { margin: 1em 0; cursor: pointer; }
td, th { border: 1px solid var(--line); padding: 0.2em 0.6em; text-align: right; vertical-align: top; }
td { white-space: nowrap; } .text { text-align: left; } td.long { white-space: normal; min-width: 14em; }
p, h1, h2 { overflow-wrap: anywhere; }
"""
LONG = 24  # letters of a text beyond which its cell may have several lines
FOLDED = 30  # rows beyond which a table is shown when asked for
UNITS = {"_Nmm": " [N mm]", "_mm3": " [mm³]", "_um": " [µm]"}


def write(file: Path, title: str, parts: list[str]) -> None:
    """A page of a heading and parts, which are HTML."""
    head = (
        '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    )
    head += f"<title>{html.escape(title)}</title><style>{STYLE}</style>"
    body = "\n".join([f"<h1>{html.escape(title)}</h1>", *parts])
    text = f'<!doctype html><html lang="en"><head>{head}</head><body>{body}</body></html>\n'
    file.write_text(text, encoding="utf-8")


def paragraph(text: str, kind: str = "") -> str:
    return f'<p class="{kind}">{html.escape(text)}</p>' if text else ""


def picture(file: Path, caption: str, data: str = "") -> str:
    """An SVG with its caption, and a link to the file that has its data."""
    image, caption = base64.b64encode(file.read_bytes()).decode(), html.escape(caption)
    shown = f'<img src="data:image/svg+xml;base64,{image}" alt="{caption}">'
    link = f' <a href="{html.escape(data)}">{html.escape(Path(data).name)}</a>' if data else ""
    return f'<figure><div class="scroll">{shown}</div><figcaption>{caption}{link}</figcaption></figure>'


def table(rows: list[dict]) -> str:
    """Dictionaries with the same keys as rows; numbers to four digits; columns in which nothing stands are left out."""
    if not rows:
        return ""
    keys = [key for key in rows[0] if not all(_missing(row.get(key)) for row in rows)]
    kinds = {key: _kind([row.get(key) for row in rows]) for key in keys}
    titles = "".join(f"<th{kinds[key]}>{html.escape(_title(key))}</th>" for key in keys)
    lines = ["".join(_cell(row.get(key), kinds[key]) for key in keys) for row in rows]
    lines = "\n".join(f"<tr>{line}</tr>" for line in (titles, *lines))
    shown = f'<div class="scroll"><table>{lines}</table></div>'
    if len(rows) <= FOLDED:
        return shown
    return f"<details><summary>Table of {len(rows)} rows</summary>{shown}</details>"


def _title(key: str) -> str:
    for ending, unit in UNITS.items():
        if key.endswith(ending):
            key = key.removesuffix(ending) + unit
    return key.replace("_", " ").replace("N mm", "N\N{NO-BREAK SPACE}mm")


def _missing(value) -> bool:
    return value is None or value == "" or isinstance(value, float) and math.isnan(value)


def _kind(column: list) -> str:
    """Words begin at the left, titles above them too; numbers end at the right."""
    return (
        ' class="text"'
        if any(isinstance(value, (str, list, tuple)) and value for value in column)
        else ""
    )


def _cell(value, kind: str) -> str:
    if _missing(value):
        return f"<td{kind}>–</td>"
    if isinstance(value, (int, float)):
        return f"<td{kind}>{value if isinstance(value, int) else format(value, '.4g')}</td>"
    if isinstance(value, (list, tuple)) and all(isinstance(each, (int, float)) for each in value):
        size = max(map(abs, value), default=0)  # rounding beside the others is zero
        value = ", ".join(format(x if abs(x) > 1e-12 * size else 0.0, ".4g") for x in value)
    text = str(value).replace("_", " ")
    return f'<td class="text{" long" if len(text) > LONG else ""}">{html.escape(text)}</td>'
