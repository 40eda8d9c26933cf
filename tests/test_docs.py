# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The site: scripts of its pages run, on two ranks where a page says so; the reference has every public name."""

import doctest
import inspect
import re
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from mpi4py import MPI

import dolfinx_contact as dc
from docs.extension.gallery import cells
from docs.extension.links import dead_links
from docs.extension.runs import APART, blocks, run

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
TEXTS = {
    file.relative_to(DOCS).as_posix(): file.read_text()
    for file in sorted(DOCS.rglob("*.md"))
    if "gallery" not in file.parts
}
SCRIPTS = {page: parts for page, text in TEXTS.items() if (parts := blocks(text))}
FAST = {"tutorial/2_friction.md", "howto/condensed.md", "howto/fields.md", "own_solver.md", "solvers.md"}  # fmt: skip

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts interpreters")


def test_pages_are_found():
    """Discovery is not empty, and what is named fast is there."""
    assert set(SCRIPTS) >= FAST and len(SCRIPTS) >= 18


def without_missing(parts: list[str]) -> list[str]:
    """Parts up to a script that needs a package which is not installed: PyVista comes with ``make docs``."""
    apart = next((k for k, part in enumerate(parts) if part.startswith(APART)), len(parts))
    return parts if find_spec("pyvista") else parts[:apart]


@pytest.mark.parametrize(
    "page", [pytest.param(page, marks=[] if page in FAST else pytest.mark.slow) for page in SCRIPTS]
)
def test_script_of_page_runs(page, tmp_path):
    """The blocks of a page, one after another, are a script that runs in an empty folder and prints something."""
    assert "".join(run(without_missing(SCRIPTS[page]), tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in SCRIPTS if "mpirun" in TEXTS[page]])
def test_script_runs_on_two_ranks(page, tmp_path):
    """Where a page says that its script runs with mpirun, it does."""
    launcher = Path(sys.prefix) / "bin" / "mpiexec"
    if not launcher.exists():
        pytest.skip("no mpiexec beside this interpreter")
    assert "".join(run(SCRIPTS[page], tmp_path, (launcher, "-n", "2", sys.executable)))


def test_a_script_that_fails_is_seen(tmp_path):
    """An exception in any block fails the page, and what stood in the block is named."""
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        run(["print(1)\n", "print(1 / 0)\n"], tmp_path)
    assert run(["x = 1\n", "print(x)\n"], tmp_path) == ["", "1"]


def test_reference_has_every_public_name():
    """Names of ``dolfinx_contact`` and of the reference are the same."""
    listed = re.findall(
        r"^\.\. auto(?:class|function|exception):: (\w+)$", TEXTS["reference.md"], re.M
    )
    assert sorted(listed) == sorted(dc.__all__)


def test_every_public_name_has_an_example_that_runs(tmp_path, monkeypatch):
    """The docstring of each public name has an example; it runs after the first script of the reference."""
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(SCRIPTS["reference.md"][0], names)
    runner = doctest.DocTestRunner(verbose=False)
    for name in dc.__all__:
        text = inspect.getdoc(getattr(dc, name)) or ""
        test = doctest.DocTestParser().get_doctest(text, dict(names), name, None, None)
        assert test.examples, name
        said: list[str] = []
        assert runner.run(test, out=said.append).failed == 0, "".join(said)


def test_members_of_the_reference_exist():
    """Methods and properties that the reference lists are those of the class; none is missing by a wrong name."""
    page = TEXTS["reference.md"]
    entries = re.findall(r"autoclass:: (\w+)\n   :members: (.+)", page)
    assert len(entries) >= 5
    for name, members in entries:
        assert all(hasattr(getattr(dc, name), member) for member in members.split(", ")), name


@pytest.mark.parametrize("page", TEXTS)
def test_code_is_marked_by_its_language(page):
    """Every fenced block names a language or a directive, so that no Python block escapes the run."""
    fences = re.findall(r"^ *(`{3,})(.*)$", TEXTS[page], re.MULTILINE)
    assert len(fences) % 2 == 0
    opening = [says for _, says in fences[::2]]
    assert all(re.match(r"(python|sh|cmake|text|\{[\w:-]+\}.*)$", says) for says in opening), (
        opening
    )
    assert "{code-block} python" not in opening


def test_reference_has_what_scripts_read_of_a_contact():
    """Attributes of a contact that scripts of the pages use are members in the reference, or in the class's docstring."""
    (members,) = re.findall(r"autoclass:: Contact\n   :members: (.+)", TEXTS["reference.md"])
    known = {*members.split(", "), "x", "plane", "nodes", "rho"}
    for page in set(SCRIPTS) - {"own_solver.md"}:
        used = set(re.findall(r"\bcontact\.([a-z]\w*)", "".join(SCRIPTS[page])))
        assert used <= known, page


MEASURED = re.compile(r"\d ?(?:%|s\b|ms\b|GB\b)|\d times\b")
MONTHS = "January|February|March|April|May|June|July|August|September|October|November|December"
DATED = re.compile(rf"\d+ (?:{MONTHS}) 20\d\d")


@pytest.mark.parametrize("page", TEXTS)
def test_page_with_measured_numbers_has_a_date(page):
    """Where a page's words state times, shares or ratios, it names the day of their record."""
    words = re.sub(r"^```.*?^```$", "", TEXTS[page], flags=re.DOTALL | re.MULTILINE)
    assert not MEASURED.search(words) or DATED.search(words)


def test_cells_of_demos():
    """Every demo begins with a heading, which is its title in the gallery, and has code."""
    for file in (ROOT / "demos").glob("demo_*.py"):
        found = cells(file.read_text())
        assert found[0][0] and found[0][1].startswith("# "), file
        assert any(not prose and "import" in body for prose, body in found), file


def test_dead_links_are_found(tmp_path):
    """Links to a missing file or anchor are named; good and external ones are not."""
    (tmp_path / "a.html").write_text(
        '<h1 id="top"></h1><a href="b.html#there"><a href="#top"><a href="https://example.org/x">'
        '<a href="b.html#gone"><img src="c.png"><a href="d.html">'
    )
    (tmp_path / "b.html").write_text('<p id="there"></p>')
    assert dead_links(tmp_path) == ["a.html: b.html#gone", "a.html: c.png", "a.html: d.html"]
