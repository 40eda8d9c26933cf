# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the package promises before it computes anything, and what tools/probe.py refuses."""

import ast
import os
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import dolfinx_contact  # before MPI, which one of DOLFINx's wheels needs

# isort: split
import pytest
from mpi4py import MPI

from dolfinx_contact import _kernel

ROOT = Path(__file__).parents[2]
PROBE = ROOT / "tools" / "probe.py"

pytestmark = pytest.mark.skipif(
    MPI.COMM_WORLD.size > 1, reason="starts interpreters, which MPI forbids to several ranks"
)


def clean_environment() -> dict[str, str]:
    """Without what an MPI launcher left, which would make a new interpreter one of its ranks, and what make left."""
    return {
        k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMI", "PRTE_", "MAKE"))
    }


def run(*arguments, cwd=None, **environment):
    return subprocess.run(
        [sys.executable, *arguments], cwd=cwd, env=clean_environment() | environment, capture_output=True, text=True
    )  # fmt: skip


def test_the_version_has_one_source():
    """Package, conda recipe and changelog have the version of pyproject.toml, and no other file states one."""
    (version,) = re.findall(
        r'^version = "(.+?)"', (ROOT / "pyproject.toml").read_text(), re.MULTILINE
    )
    assert dolfinx_contact.__version__ == version
    assert f'version: "{version}"' in (ROOT / "recipe.yaml").read_text()
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text()
    others = ("CITATION.cff", "CMakeLists.txt", "docs/conf.py", "dolfinx_contact/__init__.py")
    assert not [name for name in others if version in (ROOT / name).read_text()]


def test_checks_are_pinned_once():
    """What formats and checks has its version in .pre-commit-config.yaml alone; CI and `make format` run these hooks."""
    pinned = re.findall(r"([\w-]+)==", (ROOT / ".pre-commit-config.yaml").read_text())
    assert len(pinned) == len(set(pinned)) and {"ruff", "clang-format"} <= set(pinned)
    files = [*(ROOT / "tools").iterdir(), *(ROOT / ".github").rglob("*.yml")]
    files += [ROOT / name for name in ("pyproject.toml", "Makefile", ".ci/run", "recipe.yaml")]
    texts = {file: file.read_text() for file in files if file.is_file()}
    assert not [
        file for file, text in texts.items() for name in pinned if re.search(rf"{name}==\d", text)
    ]
    for name in (".ci/run", "Makefile"):
        assert re.search(r"^\s*tools/lint\b", texts[ROOT / name], re.MULTILINE), name


def test_workflows_run_scripts_of_ours():
    """Jobs run make and scripts of tools/ and .ci, which run without the service, too; else they only install git."""
    commands = [
        line
        for file in (ROOT / ".github" / "workflows").glob("*.yml")
        for line in re.findall(r"^ +- run: (.+)$", file.read_text(), re.MULTILINE)
    ]
    ours = [line for line in commands if not re.match("apt-get|git config", line)]
    assert len(ours) >= 4
    for line in ours:
        program, *words = line.split()
        if program == "make":
            assert re.search(rf"^{words[0]}:", (ROOT / "Makefile").read_text(), re.MULTILINE), line
        else:
            assert (ROOT / (words[0] if program == "bash" else program)).is_file(), line


def test_the_paper_is_short_and_complete():
    """The paper for JOSS has at most 1,100 words; what it cites is in its bibliography and nothing else; its figures exist."""
    text, bib = ((ROOT / "paper" / f"paper.{end}").read_text() for end in ("md", "bib"))
    body = text.split("\n# Summary\n")[1]
    assert 750 <= len(body.split()) <= 1100
    assert set(re.findall(r"@(\w+)", body)) == set(re.findall(r"^@\w+\{(\w+),", bib, re.MULTILINE))
    figures = re.findall(r"\]\((\S+)\)", body)
    assert figures and all((ROOT / "paper" / name).exists() for name in figures)


def test_import_needs_no_extras():
    """No public name imports any of the packages that only demos and tests need."""
    extras = ["gmsh", "matplotlib", "tqdm", "pytest", "hypothesis", "mpmath"]
    code = "import sys, dolfinx_contact as dc; [getattr(dc, name) for name in dc.__all__]; "
    result = run("-c", code + f"print([m for m in {extras} if m in sys.modules])")
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == "[]"


def test_arrays_need_numpy_alone(tmp_path):
    """Without DOLFINx, PETSc, MPI and SciPy the functions of arrays work; what needs DOLFINx says so."""
    blocked = ["dolfinx", "dolfinx_solver", "petsc4py", "mpi4py", "ufl", "basix", "ffcx", "scipy"]
    code = (
        f"import sys; sys.modules.update(dict.fromkeys({blocked}))"
        + """
import dolfinx_contact as dc
import numpy as np

friction = dc.Friction(mu=(0.3, 0.15), p=(0.05, 0.2))
W, q = np.eye(6) + 0.1, np.array([[0.02, 0.0, -0.1], [0.0, 0.3, -0.1]])
found = dc.solve_condensed(W, q, friction)
w = q + (W @ found.reaction.ravel()).reshape(2, 3)
assert np.abs(dc.law.bipotential_gap(found.reaction, w[:, 2], w[:, :2], friction)).max() < 1e-9
assert np.abs(dc.law.project_cone(found.reaction, friction.mu) - found.reaction).max() < 1e-9
assert dc.law.load_function(found.reaction, friction.mu).max() < 1e-9
assert set(dc.__all__) | {"__version__"} <= set(dir(dc)) and dc.__version__
assert {name for name in dir(dc) if not name.startswith("_")} == {*dc.__all__, "condensed", "law"}
assert dc.condensed.solve_condensed is dc.solve_condensed and dc.law.Friction is dc.Friction
try:
    dc.ContactProblem
except ImportError as error:
    print(error.name)
"""
    )
    result = run("-c", code)
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() in blocked


def test_type_checkers_see_every_name():
    """The names that type checkers read in __init__.pyi are those of run time, and the same objects."""
    tree = ast.parse(Path(dolfinx_contact.__file__).with_suffix(".pyi").read_text())
    imported = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    written = {name.asname: node.module for node in imported for name in node.names}
    assert sorted(written) == [name for name in dir(dolfinx_contact) if not name.startswith("_")]
    for name, module in written.items():
        assert getattr(dolfinx_contact, name) is getattr(import_module(module), name)


def test_source_without_kernel_says_what_to_do(tmp_path):
    """Where Python finds the source folder, which has no kernel, the error names it and what to do."""
    folder = tmp_path / "dolfinx_contact"
    folder.mkdir()
    (folder / "__init__.py").write_text(Path(dolfinx_contact.__file__).read_text())
    result = run("-S", "-c", "import dolfinx_contact", cwd=tmp_path)
    assert result.returncode == 1
    assert (
        f"{folder} has no compiled kernel" in result.stderr and "make .venv/ready" in result.stderr
    )


def test_a_kernel_of_other_sources_is_refused(tmp_path):
    """Beside type stubs that are not those it was compiled with, the kernel is refused by a sentence with what to do."""
    folder = tmp_path / "dolfinx_contact"
    folder.mkdir()
    for name in ("__init__.py", "_kernel.pyi"):
        (folder / name).write_text(Path(dolfinx_contact.__file__).with_name(name).read_text())
    (folder / Path(_kernel.__file__).name).symlink_to(_kernel.__file__)
    with (folder / "_kernel.pyi").open("a") as stubs:
        stubs.write("def newer() -> None: ...\n")
    result = run("-S", "-c", "import dolfinx_contact", cwd=tmp_path)
    assert result.returncode == 1
    assert "does not fit the Python files" in result.stderr and "make .venv/ready" in result.stderr


def stand_in(folder, scalar="float", release="0.9.0", petsc=True):
    """A DOLFINx with nothing in it but what the probe asks for."""
    (folder / "dolfinx").mkdir()
    (folder / "dolfinx/__init__.py").write_text(f"__version__ = '{release}'")
    if petsc:
        (folder / "petsc4py").mkdir()
        (folder / "petsc4py/__init__.py").write_text("")
        (folder / "petsc4py/PETSc.py").write_text(f"ScalarType = {scalar}")


@pytest.mark.parametrize(
    "properties, message",
    [
        (dict(scalar="complex"), "complex numbers"),
        (dict(release="0.3.0"), "0.5 or newer"),
        (dict(petsc=False), "without PETSc"),
    ],
)
def test_unusable_dolfinx_is_refused(tmp_path, properties, message):
    """A DOLFINx that is complex, too old or without PETSc is refused by a sentence saying so."""
    stand_in(tmp_path, **properties)
    result = run("-S", PROBE, PYTHONPATH=str(tmp_path))
    assert result.returncode == 3
    assert message in result.stderr
    assert result.stdout == ""


def test_real_dolfinx_is_accepted(tmp_path):
    """A stand-in with nothing wrong is accepted: the refusals are for the reasons they give."""
    stand_in(tmp_path)
    result = run("-S", PROBE, PYTHONPATH=str(tmp_path))
    assert result.returncode == 0, result.stderr
    assert str(tmp_path / "dolfinx") in result.stdout


def test_no_dolfinx_is_no_refusal():
    """An interpreter without DOLFINx, and the environment to be made, are passed over silently."""
    for arguments in (["-S", PROBE], [PROBE, sys.prefix]):
        result = run(*arguments)
        assert (result.returncode, result.stdout, result.stderr) == (1, "", "")


@pytest.mark.slow
def test_kernel_without_eigen_says_what_is_missing(tmp_path):
    """Where CMake finds no Eigen, its message names Eigen and how to get it."""
    cmake = shutil.which("cmake", path=f"{sys.prefix}/bin:{os.environ['PATH']}")
    if cmake is None:
        pytest.skip("no CMake here")
    source, arguments = PROBE.parent.parent, ["-DCMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON"]
    found = subprocess.run(
        [cmake, "-S", source, "-B", tmp_path, *arguments], capture_output=True, text=True
    )
    assert found.returncode == 1
    assert (
        "needs the headers of Eigen" in " ".join(found.stderr.split())
        and "libeigen3-dev" in found.stderr
    )
