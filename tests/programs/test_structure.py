"""What programs keep to: short functions, no path of their own making, no import circle."""

import ast
import subprocess
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("dolfinx_contact", "demos", "benchmarks", "studies", "mechanics")
PROGRAMS = sorted(file for folder in FOLDERS for file in (ROOT / folder).rglob("*.py"))
TREES = {file: ast.parse(file.read_text()) for file in PROGRAMS}
LINES = 60  # of a function


def name(file: Path) -> str:
    """As it is imported."""
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@pytest.mark.parametrize("file", PROGRAMS, ids=name)
def test_functions_are_short(file):
    """No function has more than 60 lines."""
    functions = [n for n in ast.walk(TREES[file]) if isinstance(n, ast.FunctionDef)]
    long = {f.name: n for f in functions if (n := f.end_lineno - f.lineno + 1) > LINES}
    assert not long


@pytest.mark.parametrize(
    "file", [f for f in PROGRAMS if "dolfinx_contact" in f.parts[len(ROOT.parts) :]], ids=name
)
def test_parameters_have_types(file):
    """Every parameter of the package says what it is."""
    functions = [n for n in ast.walk(TREES[file]) if isinstance(n, ast.FunctionDef)]
    plain = [
        f"{f.name}({of.arg})"
        for f in functions
        for a in [f.args]
        for of in [*a.posonlyargs, *a.args, *a.kwonlyargs, *filter(None, [a.vararg, a.kwarg])]
        if of.annotation is None and of.arg not in ("self", "cls")
    ]
    assert not plain


def test_no_program_changes_the_path():
    """Programs and tests are found by how they are started, not by a path that they change."""
    files = [*PROGRAMS, *(ROOT / "tests").rglob("*.py")]
    changed = [
        f"{file}:{node.lineno}"
        for file in files
        for node in ast.walk(TREES.get(file) or ast.parse(file.read_text()))
        if isinstance(node, ast.Attribute) and ast.unparse(node) == "sys.path"
    ]
    assert not changed


def imports(tree) -> set[str]:
    """Modules that are imported anywhere, in functions, too, but for type checkers alone."""
    found = set()
    for_types = {
        id(node)
        for branch in ast.walk(tree)
        if isinstance(branch, ast.If) and ast.unparse(branch.test) == "TYPE_CHECKING"
        for node in ast.walk(branch)
    }
    for node in ast.walk(tree):
        if id(node) in for_types:
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def test_demos_import_public_names_only():
    """What a demo imports of the package users may import: its own names, and what differs between DOLFINx releases."""
    package = "dolfinx_contact"
    for file in (ROOT / "demos").glob("*.py"):
        ours = {n for n in imports(TREES[file]) if n.split(".")[0] == package} - {package}
        assert all(n.startswith(f"{package}.compat") for n in ours), file
        assert not [n for n in ours if "._" in n], file


def test_there_is_no_import_circle():
    """Modules can be put into an order in which each one imports only those before it."""
    # what the package itself stands for it imports when it is asked for
    graph = {name(file): imports(tree) - {"dolfinx_contact"} for file, tree in TREES.items()}
    order = list(TopologicalSorter(graph).static_order())
    assert set(graph) <= set(order)
    assert "mechanics.judge" in graph["mechanics.judge_scene"]
    assert "dolfinx_contact.step.load_step" in graph["dolfinx_contact.problem"]


def test_no_two_folders_import_each_other():
    """Of two folders of the package at most one imports from the other, be it at the start or later."""
    pairs = set()
    for file, tree in TREES.items():
        for other in imports(tree):
            ends = [module.split(".")[:2] for module in (name(file), other)]
            whole = [
                module.count(".") > 1 and module.startswith("dolfinx_contact.")
                for module in (name(file), other)
            ]
            if all(whole) and ends[0] != ends[1]:
                pairs.add((ends[0][1], ends[1][1]))
    assert ("step", "contact") in pairs
    assert not [pair for pair in pairs if pair[::-1] in pairs]


def test_the_repository_is_light():
    """All tracked files together are below 5 MB: what programs make is made, not tracked."""
    if not (ROOT / ".git").exists():
        pytest.skip("no clone")
    command = ["git", "-c", f"safe.directory={ROOT}", "ls-files", "-z"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    files = [ROOT / name for name in listed.stdout.split("\0") if name]
    assert sum(file.stat().st_size for file in files if file.exists()) < 5e6
