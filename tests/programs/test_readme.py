# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""README and docs: short, their scripts run as pasted, their links lead somewhere."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from mpi4py import MPI
from test_packaging import clean_environment

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md")]
PAGES += sorted([*ROOT.glob("docs/**/*.md"), *ROOT.glob("notes/*.md")])
PAGES = [page for page in PAGES if "gallery" not in page.parts]  # made by `make docs`
ON_SITE = {*PAGES[1:], ROOT / "CHANGELOG.md"}
SCRIPTS = [
    (page, script)
    for page in PAGES
    if "docs" not in page.relative_to(ROOT).parts  # those: test_docs.py
    for script in re.findall(r"^```python\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)
]

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts interpreters")


def test_readme_can_be_read_in_two_minutes():
    """README has at most 450 words, one picture, and one script of at most 30 lines."""
    text = (ROOT / "README.md").read_text()
    assert len(text.split()) <= 450
    assert text.count("![") == 1
    (script,) = (script for page, script in SCRIPTS if page.name == "README.md")
    assert len(script.splitlines()) <= 30


@pytest.mark.parametrize("page, script", SCRIPTS, ids=[page.name for page, _ in SCRIPTS])
def test_script_runs_as_pasted(page, script, tmp_path):
    """Every Python script of README and notes runs by itself, in any directory, and prints something."""
    command = [sys.executable, "-c", script]
    done = subprocess.run(
        command, cwd=tmp_path, env=clean_environment(), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout


def anchors(page: Path) -> set[str]:
    """What a heading of the page can be linked by."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    """Every link and picture within the repository exists, with the heading it points to; pages of the site link to no page beside it."""
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if "://" in link:
            continue
        name, _, heading = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), link
        assert target.suffix != ".md" or page.name == "README.md" or target in ON_SITE, link
        assert not heading or heading in anchors(target), link


def test_the_map_shows_every_module():
    """CONTRIBUTING's map has every module of the package that is not private, and no file that is not there."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    rows = [line.split("|")[2:5] for line in text.splitlines() if line.count("|") == 5]
    folders = ("cpp/include/dolfinx_contact", "dolfinx_contact", "tests")
    cells = [[re.findall(r"`([\w/]+\.(?:h|py))`", cell) for cell in row] for row in rows]
    for row in cells:
        for folder, names in zip(folders, row):
            assert all((ROOT / folder / name).exists() for name in names), names
    package = ROOT / "dolfinx_contact"
    modules = {file.relative_to(package).as_posix() for file in package.rglob("[!_]*.py")}
    assert modules == {name for _, names, _ in cells for name in names}
