# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The Python blocks of a page are one script.  It is run, and what each block prints and draws is shown below it.

Why not myst-nb: on the pages of a repository its cells are no Python, and it keeps what they printed when the package has changed.

The same script is what ``tests/programs/test_docs.py`` runs.  A run is kept in ``build/docs`` until the script or the
package changes.
"""

import ast
import hashlib
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "build" / "docs"
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PICTURE = re.compile(r"""["']([\w-]+\.(?:png|svg|gif))["']""")
END = "----- end of block -----"
APART = "# a script of its own"  # a block that begins so does not go on with those before it


def blocks(text: str) -> list[str]:
    """Python blocks of a page, in order."""
    return BLOCK.findall(text)


def environment() -> dict[str, str]:
    """One thread; pictures without a display; the package that this interpreter has, not a folder's."""
    return {**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "agg"}


def run(parts: list[str], folder: Path, command=(sys.executable,)) -> list[str]:
    """Run parts of one script, or of several, in a folder; what each of them prints.

    Raises:
        RuntimeError: a script failed; with what it wrote to stderr.
    """
    folder.mkdir(parents=True, exist_ok=True)
    apart = next((k for k, part in enumerate(parts) if k and part.startswith(APART)), len(parts))
    first, rest = parts[:apart], parts[apart:]
    return _run(first, folder, command) + (run(rest, folder, command) if rest else [])


def _run(parts: list[str], folder: Path, command) -> list[str]:
    script = folder / "script.py"
    script.write_text(f"\nprint({END!r}, flush=True)\n".join(parts))
    done = subprocess.run(
        [*command, script.name], cwd=folder, env=environment(), capture_output=True, text=True
    )
    if done.returncode != 0:
        raise RuntimeError(f"{done.stdout[-500:]}\n{done.stderr[-3000:]}")
    printed = [part.strip("\n") for part in done.stdout.split(END)]
    return printed + (len(parts) - len(printed)) * [""]  # it may end before its last block


def without_words(text: str) -> str:
    """A Python module without comments and docstrings."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        documented = isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
        if documented and ast.get_docstring(node) is not None:
            node.body[0].value.value = ""
    return ast.dump(tree)


def fingerprint(*texts: str) -> str:
    """Of a script and of the package that it uses, but for what the package says of itself."""
    digest = hashlib.sha256("\0".join(texts).encode())
    for file in sorted((ROOT / "dolfinx_contact").rglob("*.py")):
        digest.update(without_words(file.read_text()).encode())
    for file in sorted((ROOT / "cpp").rglob("*.h")):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def kept(folder: Path, key: str, make):
    """The result of ``make()``, a value for JSON, kept in a folder for as long as the key stays."""
    file = folder / "kept.json"
    if file.exists():
        found = json.loads(file.read_text())
        if found["key"] == key:
            return found["result"]
    folder.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    print(f"  {folder.relative_to(KEPT)} ...", end=" ", flush=True)
    result = make()
    print(f"{time.perf_counter() - start:.0f} s", flush=True)
    written = file.with_suffix(".new")  # an interruption leaves no half of a file
    written.write_text(json.dumps({"key": key, "result": result}))
    written.replace(file)
    return result


def shown(output: str, pictures: list[Path]) -> str:
    """What a block made, as Markdown."""
    parts = [f"```{{code-block}} text\n:class: output\n\n{output}\n```\n"] if output else []
    parts += [f"![{file.stem}](/{file.relative_to(ROOT).as_posix()})\n" for file in pictures]
    return "\n".join(["", "", *parts]) if parts else ""


def show_outputs(app, page: str, source: list[str]) -> None:
    parts = blocks(source[0])
    if not parts or not page.startswith("docs/"):
        return
    folder = KEPT / page.removeprefix("docs/")
    try:
        outputs = kept(folder, fingerprint(*parts), lambda: run(parts, folder))
    except RuntimeError as error:
        from sphinx.errors import ExtensionError  # tests of the scripts do without Sphinx

        raise ExtensionError(f"the script of {page} failed: {error}") from None
    remaining = iter(outputs)

    def with_output(match: re.Match) -> str:
        files = [folder / name for name in dict.fromkeys(PICTURE.findall(match.group(1)))]
        return match.group(0) + shown(next(remaining), [file for file in files if file.exists()])

    source[0] = BLOCK.sub(with_output, source[0])


def lead_to_gallery(app, page: str, source: list[str]) -> None:
    """Links to demos lead to their pages; those pages themselves lead to the scripts."""
    if not page.startswith("docs/gallery/"):
        source[0] = re.sub(r"\]\([./]*demos/(demo_\w+)\.py\)", r"](/docs/gallery/\1.md)", source[0])
        source[0] = re.sub(r"\]\([./]*demos/?\)", "](/docs/gallery/index.md)", source[0])


def setup(app) -> dict:
    app.connect("source-read", show_outputs)
    app.connect("source-read", lead_to_gallery)
    return {"parallel_read_safe": True}
