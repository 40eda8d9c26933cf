# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The site: scripts of its pages run, on two ranks where a page says so; the reference has every public name."""

import doctest
import inspect
import os
import re
import shlex
import shutil
import subprocess
import sys
from importlib.util import find_spec
from operator import attrgetter
from pathlib import Path

import pytest
from mpi4py import MPI
from test_packaging import clean_environment

import dolfinx_contact as dc
from docs.extension.gallery import THEMES, cells
from docs.extension.headers import HEADERS, declarations, without_bodies
from docs.extension.links import dead_links, opened
from docs.extension.runs import APART, blocks, kept, run
from docs.extension.together import together

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
TEXTS = {
    file.relative_to(DOCS).as_posix(): file.read_text()
    for file in sorted(DOCS.rglob("*.md"))
    if "gallery" not in file.parts
}
SCRIPTS = {page: parts for page, text in TEXTS.items() if (parts := blocks(text))}
# Names as users write them behind ``dc.``; one that has two places has the shorter one.
PUBLIC = [*dc.__all__, *(f"{room}.{n}" for room in ("law", "condensed") for n in getattr(dc, room).__all__ if n not in dc.__all__)]  # fmt: skip
FAST = {"tutorial/2_friction.md", "howto/condensed.md", "howto/external_operator.md", "howto/fields.md", "howto/submeshes.md", "extending.md", "own_solver.md", "solvers.md"}  # fmt: skip

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


def test_blocks_behind_the_end_of_a_script_print_nothing(tmp_path):
    """Of a page whose script ends in its first block, as where a release lacks what it shows."""
    assert run(["print(1)\nraise SystemExit\n", "print(2)\n", "print(3)\n"], tmp_path) == [
        "1",
        "",
        "",
    ]


def test_reference_has_every_public_name():
    """Names of ``dolfinx_contact``, and of its rooms of arrays, and of the reference are the same."""
    listed = re.findall(
        r"^\.\. auto(?:class|function|exception):: ([\w.]+)$", TEXTS["reference.md"], re.M
    )
    names = [name.removeprefix("dolfinx_contact.") for name in listed]
    assert sorted(name for name in names if not name.startswith("compat.")) == sorted(PUBLIC)


def test_every_public_name_has_an_example_that_runs(tmp_path, monkeypatch):
    """The docstring of each public name has an example; it runs after the first script of the reference."""
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(SCRIPTS["reference.md"][0], names)
    runner = doctest.DocTestRunner(verbose=False)
    for name in PUBLIC:
        text = inspect.getdoc(attrgetter(name)(dc)) or ""
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
    assert all(re.match(r"(python|sh|\{[\w:-]+\}.*)$", says) for says in opening), opening
    assert not any(says.startswith("{code-block}") for says in opening)
    indented = re.findall(
        r"^\n {4}(\S+)", TEXTS[page], re.MULTILINE
    )  # formulas, not commands and scripts
    assert not {"make", "python", "pip", "cmake", "mpirun", "import", "for", "from"} & set(indented)


def commands(text: str) -> list[str]:
    """Commands of the ``sh`` blocks of a page, without comments."""
    found = re.findall(r"^```sh\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    lines = "".join(found).replace("\\\n", " ").splitlines()
    return [line for each in lines if (line := re.sub(r"\s+#.*", "", each).strip())]


PAGES = TEXTS | {name: (ROOT / name).read_text() for name in ("README.md", "CONTRIBUTING.md")}
PAGES |= {file.name: file.read_text() for file in (ROOT / "notes").glob("*.md")}
COMMANDS = sorted({line for text in PAGES.values() for line in commands(text)})


def command_that_make_runs(line: str) -> str:
    """The last command of a line with make, which has to have that target."""
    said = subprocess.run(["make", "--dry-run", "--assume-old=.venv/ready", *shlex.split(line)[1:]],
                          cwd=ROOT, env=clean_environment(), capture_output=True, text=True)  # fmt: skip
    assert said.returncode == 0, said.stderr
    return said.stdout.strip().splitlines()[-1]


PROGRAMS = [line for line in COMMANDS if "-m" in line or "study" in line]  # these are started


@pytest.mark.parametrize(
    "line",
    [pytest.param(line, marks=pytest.mark.slow if line in PROGRAMS else []) for line in COMMANDS],
)
def test_command_of_page_is_one_that_is_run(line):
    """A command of a page is run by CI or, if it is a program of ours, has options that the program knows."""
    if line.startswith("cmake "):
        assert line in commands(TEXTS["howto/cpp.md"])  # run by the test below
    elif line == "pip install .":
        assert re.search(
            r"/pip install .*\n.* \"\$package\"$",
            (ROOT / "tools" / "check-wheel").read_text(),
            re.M,
        )
        assert "\ntools/check-wheel .venv\n" in (ROOT / "tools" / "test-all").read_text()
    elif line in ("make punch", "make test"):  # of the README: in CI, and in minimal systems
        assert "make punch && make test" in (ROOT / "tools" / "prove-minimal-root").read_text()
        assert f"\n{line}\n" in (ROOT / ".ci" / "run").read_text() and command_that_make_runs(line)
    else:
        words = shlex.split(command_that_make_runs(line) if line.startswith("make ") else line)
        at = words.index("-m") + 1
        said = subprocess.run([sys.executable, "-m", *words[at:], "--help"], cwd=ROOT,
                              env=clean_environment(), capture_output=True, text=True)  # fmt: skip
        assert said.returncode == 0, said.stderr
        known = set(re.findall(r"--[\w-]+", said.stdout))
        assert {word for word in words[at:] if word.startswith("--")} <= known


@pytest.mark.slow
def test_kernel_is_installed_as_the_page_says(tmp_path):
    """The commands of the page on C++ configure and install the kernel, and a project finds it as the page says."""
    clone, home = tmp_path / "clone", tmp_path / "home"
    clone.mkdir()
    for name in ("CMakeLists.txt", "pyproject.toml", "cpp"):
        (clone / name).symlink_to(ROOT / name)
    lines = commands(TEXTS["howto/cpp.md"])
    assert len(lines) == 2
    (project,) = re.findall(r"configured with `(cmake [^`]*)`", TEXTS["howto/cpp.md"])
    path = f"{Path(sys.prefix) / 'bin'}:{os.environ['PATH']}"
    shutil.copytree(ROOT / "cpp" / "example", tmp_path / "project")
    for line, folder in [*((line, clone) for line in lines), (project, tmp_path / "project")]:
        done = subprocess.run(["sh", "-c", line], cwd=folder, capture_output=True, text=True,
                              env=clean_environment() | {"HOME": str(home), "PATH": path})  # fmt: skip
        assert done.returncode == 0, done.stderr
    found = home.rglob("include/dolfinx_contact/**/*.h")
    assert sorted(file.name for file in found) == sorted(file.name for file in HEADERS.rglob("*.h"))


def test_cpp_reference_has_every_public_header():
    """Each header is on the page, but for parts of the condensed solver, the mortar operator and multigrid, which the page names as such."""
    listed = re.findall(r"^```\{cpp-header\} (\S+)$", TEXTS["cpp.md"], re.MULTILINE)
    headers = {str(file.relative_to(HEADERS)) for file in HEADERS.rglob("*.h")}
    parts = {
        name
        for name in headers
        if name.startswith(("algebra/", "condensed/", "mortar/", "sparse/"))
    }
    parts |= {"condensed.h", "tuning.h"}
    assert sorted({*listed, *parts}) == sorted(headers) and len(listed) == len(set(listed))


# what a program calls; the other functions are parts of these
CALLED = """normalised_q make_law project load_function against_slip slip_defect predictor bipotential_map scaled_map
    return_map bipotential_jacobian scaled_jacobian return_jacobian bipotential_gap for_each_node Operator Options Solution
    solve Inputs Outputs Tangent Local Branch NonAssociated BipotentialMap""".split()


def test_cpp_reference_has_every_declaration():
    """What begins in the first column of a public header is on the page, with words; what is called has an example."""
    listed = re.findall(r"^```\{cpp-header\} (\S+)$", TEXTS["cpp.md"], re.MULTILINE)
    shown: set[str] = set()
    for name in listed:
        text = (HEADERS / name).read_text()
        says, found = declarations(text)
        assert says and all(one.says for one in found), name
        names = {each for one in found for each in one.names}
        text = re.sub(r"^namespace detail.*?^\} // namespace detail", "", text, flags=re.S | re.M)
        text = re.sub(r"^template <[^<>]*>\s+", "", text, flags=re.MULTILINE)
        types = re.findall(r"^(?:struct|class|enum class|using) (\w+)", text, re.MULTILINE)
        functions = re.findall(
            r"^(?!using|//|inline constexpr)\w[^\n(=;{]*?\b(\w+)\(", text, re.MULTILINE
        )
        assert names >= {*types, *functions}, {*types, *functions} - names
        shown |= names
    programs = [
        ROOT / "cpp" / "example" / "functions.cpp",
        ROOT / "cpp" / "tests" / "condensed" / "test_search.cpp",
    ]
    example = (
        programs[0].read_text()
        + programs[1].read_text().split("docs/cpp.md begins")[1].split("docs/cpp.md ends")[0]
    )
    assert set(CALLED) <= shown & set(re.findall(r"\w+", example))


def test_declarations_are_those_of_a_header():
    """Bodies and private members are left out, comments kept; what stands in detail namespaces is not shown."""
    says, found = declarations(
        "/// @file a.h\n/// Says this.\n#pragma once\nnamespace a {\nnamespace detail {\nint hidden();\n"
        "} // namespace detail\n/// Adds.\ntemplate <int N>\nint add(int a) {\n    return a + N;\n}\n} // namespace a\n"
    )
    assert says == ["Says this."]
    assert found == [(["add"], "template <int N>\nint add(int a);", ["Adds."])]
    text = "class A {\n  public:\n    A(int a)\n        : a_(a) {\n        f();\n    }\n    int b = {};\n\n  private:\n    int a_;\n};"
    assert without_bodies(text) == "class A {\n  public:\n    A(int a);\n    int b = {};\n\n};"


def test_reference_has_what_scripts_read_of_a_contact():
    """Attributes of a contact that scripts of the pages use are members in the reference, or in the class's docstring."""
    (members,) = re.findall(r"autoclass:: Contact\n   :members: (.+)", TEXTS["reference.md"])
    known = {*members.split(", "), "x", "surface", "nodes", "rho"}
    for page in set(SCRIPTS) - {"own_solver.md"}:
        used = set(re.findall(r"(?<![.\w])contact\.([a-z]\w*)", "".join(SCRIPTS[page])))
        assert used <= known, page


MEASURED = re.compile(r"\d ?(?:%|s\b|ms\b|GB\b)|\d times\b")
MONTHS = "January|February|March|April|May|June|July|August|September|October|November|December"
DATED = re.compile(rf"\d+ (?:{MONTHS}) 20\d\d")


@pytest.mark.parametrize("page", TEXTS)
def test_page_with_measured_numbers_has_a_date(page):
    """Where a page's words state times, shares or ratios, it names the day of their record."""
    words = re.sub(r"^```.*?^```$", "", TEXTS[page], flags=re.DOTALL | re.MULTILINE)
    assert not MEASURED.search(words) or DATED.search(words)


def test_pages_are_opened_and_data_is_saved():
    """A link to a page shows it; one to a table or a record saves it."""
    page, data = (f'<a download="" href="a/b.{kind}">' for kind in ("html", "json"))
    assert opened(page + data) == '<a href="a/b.html">' + data


def test_numbers_keep_their_units():
    """No line ends between a number and its unit; words and what is no unit may be parted."""
    kept = {
        "6.0 %, 8.3 s": "6.0~%, 8.3~s",
        "0.1 ± 0.2 %": "0.1~±~0.2~%",
        "n = 4 cells": "n~=~4 cells",
    }
    kept |= {"2 steps of 3 mm": "2 steps of 3~mm", "353 ± 2 N mm": "353~±~2~N mm"}
    assert {text: together(text).replace("\xa0", "~") for text in kept} == kept


def test_formulas_are_grouped_as_tex_does():
    """A fraction of two digits is one, with what follows beside it; the index of a dotted letter is not under it."""
    pytest.importorskip("docutils")
    from docs.extension.formulas import grouped, tex2mathml

    drawn = {
        text: "".join(tex2mathml(grouped(text)).split())
        for text in (r"\frac12 (p + q)", r"\dot u_t")
    }
    assert "<mfrac><mn>1</mn><mn>2</mn></mfrac><mo" in drawn[r"\frac12 (p + q)"]
    assert "munder" not in drawn[r"\dot u_t"] and "<mi>t</mi></msub>" in drawn[r"\dot u_t"]
    assert grouped(r"\frac{a_{1}}{2} x") == r"\frac{{a_{1}}}{{2}} x"


def test_every_displayed_formula_can_be_drawn():
    """Those of demos and pages have no command that docutils does not know."""
    pytest.importorskip("docutils")
    from docs.extension.formulas import grouped, tex2mathml

    texts = [body for file in (ROOT / "demos").glob("demo_*.py") for prose, body in cells(file.read_text()) if prose]  # fmt: skip
    texts += [
        file.read_text() for file in (ROOT / "docs").rglob("*.md") if "gallery" not in file.parts
    ]
    formulas = [found for text in texts for found in re.findall(r"\$\$(.+?)\$\$", text, re.DOTALL)]
    assert len(formulas) > 50 and all(tex2mathml(grouped(found), as_block=True) for found in formulas)  # fmt: skip


def test_extensions_say_why_they_are_our_own():
    """Each module of docs/extension says which well-kept extension it stands in for, and why."""
    for file in (DOCS / "extension").glob("[!_]*.py"):
        assert "\nWhy not " in file.read_text().split('"""')[1], file


def test_an_interruption_leaves_no_half_of_a_result(tmp_path, monkeypatch):
    """What is kept of a script is whole, or not there: the next build runs it again."""
    monkeypatch.setattr("docs.extension.runs.KEPT", tmp_path)

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as now, pytest.raises(KeyboardInterrupt):
        now.setattr(Path, "replace", interrupted)
        kept(tmp_path / "a", "key", lambda: 1)
    assert kept(tmp_path / "a", "key", lambda: 2) == kept(tmp_path / "a", "key", lambda: 3) == 2


def test_cells_of_demos():
    """Every demo has a theme in the gallery, begins with a heading, which is its title there, and has code."""
    named = sorted(f"demo_{name}" for theme in THEMES.values() for name in theme)
    assert named == sorted(file.stem for file in (ROOT / "demos").glob("demo_*.py"))
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
