# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A page for each demo, run at the build, and an index with thumbnails; written to docs/gallery.

Why not sphinx-gallery: it reads text of demos as reStructuredText, not as the Markdown of notebooks, runs all demos in one
process with one MPI, and does not run them again when the package has changed.
"""

import ast
import re
import shutil
import subprocess
import sys
from pathlib import Path

from docs.extension.runs import KEPT, ROOT, environment, fingerprint, kept

PAGES = ROOT / "docs" / "gallery"
# what runs a demo, and where its picture is; the others are scripts that write to their argument
COMMANDS = {
    "demo_punch": (["-m", "demos.demo_punch", "--output", "{folder}"], "punch.png"),
    "demo_own_loop": (["-m", "demos.demo_own_loop"], None),
}
# Themes of the index and their demos, the picture that says most first.
THEMES = {
    "The paper's punch": ("punch", "quarter_punch", "own_loop"),
    "Pressed": ("hertz", "ball_on_flat", "press_fit", "conforming_pin", "grooves"),
    "Partial slip, fretting, wear": ("partial_slip", "two_cylinders", "dead_weight", "fretting", "wear"),
    "Sliding": ("turning_path", "turntable", "impact"),
    "Held by contact alone": ("pushed_cube", "box", "v_groove"),
    "Large strains, plasticity": ("seal", "ironing", "indentation"),
}  # fmt: skip


def cells(text: str) -> list[tuple[bool, str]]:
    """Cells of a text notebook in percent format: whether it is text, and what it says."""
    if not text.startswith("# %% [markdown]"):
        docstring = ast.get_docstring(ast.parse(text), clean=True)
        title, _, rest = docstring.partition("\n")
        return [(True, f"# {title.rstrip('.')}\n{rest}"), (False, text.split('"""', 2)[2].strip())]
    found = []
    for cell in re.split(r"^# %%", text, flags=re.MULTILINE)[1:]:
        kind, _, body = cell.partition("\n")
        prose = "[markdown]" in kind
        if prose:
            body = "\n".join(line.removeprefix("#").removeprefix(" ") for line in body.splitlines())
        found.append((prose, body.strip()))
    return found


def run(name: str, folder: Path) -> dict:
    """What a demo prints, and the names of its pictures, the one of the body first."""
    arguments, drawn = COMMANDS.get(
        name, ([f"demos/{name}.py", "{folder}/picture.png"], "picture.png")
    )
    command = [sys.executable, *(part.format(folder=folder) for part in arguments)]
    env = environment() | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True)
    if done.returncode != 0:
        from sphinx.errors import ExtensionError  # tests of the cells do without Sphinx

        raise ExtensionError(f"{name} failed: {done.stdout[-500:]}\n{done.stderr[-3000:]}")
    printed = re.sub(r"^(numbers|ParaView|picture) .*\n?", "", done.stdout, flags=re.MULTILINE)
    drawn = [name for name in ("body.png", drawn) if name and (folder / name).exists()]
    return {"printed": printed.strip("\n"), "pictures": drawn}


def page(name: str, text: str, result: dict) -> str:
    """The page of a demo: pictures, text and code, output."""
    found = cells(text)
    title, _, opening = found[0][1].partition("\n")
    pictures = "\n".join(
        f"![Picture of {name}](/build/docs/gallery/{name}/{drawn})\n"
        for drawn in result["pictures"]
    )
    source = f"Source: [{name}.py](../../demos/{name}.py), run when this page was built."
    parts = [title, pictures, opening.strip(), source]
    parts += [
        body if prose else f"```{{code-block}} python\n{body}\n```" for prose, body in found[1:]
    ]
    parts.append(
        f"## Printed\n\n```{{code-block}} text\n:class: output\n\n{result['printed']}\n```"
    )
    return "\n\n".join(part for part in parts if part) + "\n"


def card(name: str, text: str, drawn: list[str]) -> str:
    """A thumbnail with the title and the first sentences."""
    title, _, rest = cells(text)[0][1].partition("\n")
    first = " ".join(rest.split("##")[0].split()).split(". ")[0].rstrip(".") + "."
    image = f"![](/build/docs/gallery/{name}/{drawn[0]})" if drawn else ""
    return (
        f":::{{container}} card\n{image}\n\n**[{title.lstrip('# ')}]({name}.md)**\n\n{first}\n:::\n"
    )


def write_pages(app) -> None:
    shutil.rmtree(PAGES, ignore_errors=True)
    PAGES.mkdir(parents=True)
    helpers = (ROOT / "demos" / "helpers.py").read_text()
    cards, names = {}, [f"demo_{name}" for theme in THEMES.values() for name in theme]
    for name in names:
        text = (ROOT / "demos" / f"{name}.py").read_text()
        folder = KEPT / "gallery" / name
        result = kept(folder, fingerprint(text, helpers), lambda: run(name, folder))  # noqa: B023
        (PAGES / f"{name}.md").write_text(page(name, text, result))
        cards[name] = card(name, text, result["pictures"])
    tree = "\n".join(["```{toctree}", ":hidden:", "", *names, "```"])
    says = "Each demo is a script in `demos`. It states its problem, solves it, and asserts what it claims."
    parts = [f"# Gallery\n\n{says}"]
    for theme, of in THEMES.items():
        grid = "\n".join(
            [":::::{container} cards", *(cards[f"demo_{name}"] for name in of), ":::::"]
        )
        parts.append(f"## {theme}\n\n{grid}")
    (PAGES / "index.md").write_text("\n\n".join([*parts, tree]) + "\n")


def setup(app) -> dict:
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True}
