"""One HTML file with all that is shown: figures inside it, tables from rows; nothing is fetched from elsewhere."""

import base64
import html
import math
from pathlib import Path

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 1500px; margin: 2em auto; padding: 0 1em; }
img { max-width: 100%; } table { border-collapse: collapse; margin: 1em 0; } .bad { color: #b00020; }
td, th { border: 1px solid #bbb; padding: 0.2em 0.6em; text-align: right; vertical-align: top; }
td.text { text-align: left; } figure { margin: 2em 0; }
"""


def write(file: Path, title: str, parts: list[str]) -> None:
    """A page of a heading and parts, which are HTML."""
    head = f'<meta charset="utf-8"><title>{html.escape(title)}</title><style>{STYLE}</style>'
    body = "\n".join([f"<h1>{html.escape(title)}</h1>", *parts])
    text = f'<!doctype html><html lang="en"><head>{head}</head><body>{body}</body></html>\n'
    file.write_text(text, encoding="utf-8")


def paragraph(text: str, kind: str = "") -> str:
    return f'<p class="{kind}">{html.escape(text)}</p>' if text else ""


def picture(file: Path, caption: str) -> str:
    """An SVG with its caption."""
    data, caption = base64.b64encode(file.read_bytes()).decode(), html.escape(caption)
    image = f'<img src="data:image/svg+xml;base64,{data}" alt="{caption}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"


def table(rows: list[dict]) -> str:
    """Dictionaries with the same keys as rows; numbers to four digits."""
    if not rows:
        return ""
    titles = "".join(f"<th>{html.escape(key.replace('_', ' '))}</th>" for key in rows[0])
    lines = ["".join(_cell(row.get(key)) for key in rows[0]) for row in rows]
    return "<table>" + "\n".join(f"<tr>{line}</tr>" for line in (titles, *lines)) + "</table>"


def _cell(value) -> str:
    if value is None or isinstance(value, float) and math.isnan(value):
        return "<td>–</td>"
    if isinstance(value, (int, float)):
        return f"<td>{value if isinstance(value, int) else format(value, '.4g')}</td>"
    return f'<td class="text">{html.escape(str(value).replace("_", " "))}</td>'
