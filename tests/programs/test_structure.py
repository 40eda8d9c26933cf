# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What programs keep to: short functions, no path of their own making, no import circle, few interfaces."""

import ast
import re
import subprocess
from graphlib import TopologicalSorter
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from docs.extension.runs import blocks

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("dolfinx_contact", "demos", "benchmarks", "studies", "mechanics")
PROGRAMS = sorted(file for folder in FOLDERS for file in (ROOT / folder).rglob("*.py"))
TREES = {file: ast.parse(file.read_text()) for file in PROGRAMS}
PACKAGE = {file: tree for file, tree in TREES.items() if ROOT / "dolfinx_contact" in file.parents}
PUBLIC = ("dolfinx_contact.compat", "dolfinx_contact.extend")  # beside the package itself
STATEMENTS = 50  # of a function
CIRCLE = 7  # files that import each other, in a circle, some for type checkers alone
INTERFACES, MEMBERS = 8, 12


def name(file: Path) -> str:
    """As it is imported."""
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@pytest.mark.parametrize("file", PROGRAMS, ids=name)
def test_functions_are_short(file):
    """No function has more than 50 statements, however they are broken into lines; docstrings do not count."""
    functions = [n for n in ast.walk(TREES[file]) if isinstance(n, ast.FunctionDef)]
    counts = {f.name: sum(isinstance(n, ast.stmt) for n in ast.walk(f)) - 2 for f in functions}
    assert not {function: count for function, count in counts.items() if count > STATEMENTS}


@pytest.mark.parametrize("file", PACKAGE, ids=name)
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
    for_types = {
        id(node)
        for branch in ast.walk(tree)
        if isinstance(branch, ast.If) and ast.unparse(branch.test) == "TYPE_CHECKING"
        for node in ast.walk(branch)
    }
    return imported(node for node in ast.walk(tree) if id(node) not in for_types)


def imported(nodes) -> set[str]:
    """Modules that these nodes import themselves, and names that may be modules."""
    found = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def outside_functions(node):
    """Nodes that are run when a module is imported, or are for type checkers."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.FunctionDef):
            yield child
            yield from outside_functions(child)


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Largest groups of which each member leads to each other one."""
    names = sorted(graph)
    edges = np.array([[other in graph[one] for other in names] for one in names])
    count, group = connected_components(edges, connection="strong")
    return [[names[k] for k in np.flatnonzero(group == of)] for of in range(count)]


DEMOS = {file: TREES[file] for file in (ROOT / "demos").glob("*.py")}
PAGES = {
    file: ast.parse("".join(blocks(file.read_text())))
    for file in (ROOT / "docs").rglob("*.md")
    if "gallery" not in file.parts
}


def test_demos_and_pages_import_public_names_only():
    """What users read imports of the package its own names, what differs between DOLFINx releases, and what extensions need."""
    package = "dolfinx_contact"
    for file, tree in (DEMOS | PAGES).items():
        ours = {n for n in imports(tree) if n.split(".")[0] == package} - {package}
        assert all(n.startswith(PUBLIC) for n in ours), file
        assert not [n for n in ours if "._" in n], file
    assert "dolfinx_contact.extend" in imports(PAGES[ROOT / "docs" / "extending.md"])


def test_package_does_not_import_what_extensions_need():
    """The module from which extensions import is imported by nothing in the package."""
    assert not [file for file, tree in PACKAGE.items() if PUBLIC[1] in imported(ast.walk(tree))]


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


def test_circles_of_types_are_small():
    """At most seven files of the package import each other in a circle, imports for type checkers counted, those in functions not."""
    assert circles({"a": {"b"}, "b": {"a"}, "c": {"a"}}) == [["a", "b"], ["c"]]
    graph = {name(file): imported(outside_functions(tree)) for file, tree in PACKAGE.items()}
    assert "dolfinx_contact.step.load_step" in graph["dolfinx_contact.solvers.base"]
    large = [" ".join(circle) for circle in circles(graph) if len(circle) > CIRCLE]
    assert not large, "\n".join(large)


def test_interfaces_are_few_and_small():
    """The package has at most eight protocols and abstract classes, none of more than twelve members."""
    members: dict[str, set[str]] = {}
    for tree in PACKAGE.values():
        for of in (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)):
            bases = {ast.unparse(base).split("[")[0].split(".")[-1] for base in of.bases}
            if bases & {"Protocol", "ABC"}:
                own = {getattr(node, "name", None) or ast.unparse(node.target) for node in of.body
                       if isinstance(node, (ast.FunctionDef, ast.AnnAssign))}  # fmt: skip
                members[of.name] = own.union(*(members.get(base, ()) for base in bases))
    assert {"Solver", "BoundSolver", "NodalMap"} <= set(members) and len(members) <= INTERFACES
    assert "return_map" in members["ContactLaw"]  # of its base
    assert not {of: names for of, names in members.items() if len(names) > MEMBERS}


def test_names_in_words_exist():
    """What CONTRIBUTING calls by name, and a docstring of the package by ``Class.name`` or a constant's, is there: renamed things are renamed in words, too."""
    defined = {"dc", "dolfinx_contact"}
    for tree in PACKAGE.values():
        for node in ast.walk(tree):
            defined |= {getattr(node, key) for key in ("id", "name", "attr", "arg") if hasattr(node, key)}  # fmt: skip
    cpp = [file.read_text() for end in ("h", "cpp") for file in (ROOT / "cpp").rglob(f"*.{end}")]
    defined |= set(re.findall(r"\w+", " ".join(cpp)))
    text = (ROOT / "CONTRIBUTING.md").read_text()
    path = text[text.index("## One load step") : text.index("## What we ask")]
    called = re.findall(r"`([A-Za-z_][\w.]*)(?:\([^`]*\))?`", path)
    called = [one for one in called if not one.endswith((".py", ".h"))]
    assert len(called) > 60
    for tree in PACKAGE.values():
        for node in ast.walk(tree):
            if isinstance(node, (ast.FunctionDef, ast.ClassDef, ast.Module)):
                words = ast.get_docstring(node) or ""
                called += re.findall(r"``([A-Z]\w+\.[a-z_]\w+)``", words)
                called += re.findall(r"\b([A-Z]{3,}_[A-Z_0-9]{2,}|(?<=``)[A-Z]{4,}(?=``))", words)
    defined.add("PETSC_OPTIONS")  # a variable of the shell
    missing = [one for one in called if not set(one.split(".")) <= defined]
    assert not missing


def test_constants_have_two_words():
    """A constant of the package says what it is: its name has two words or more."""
    short = []
    for file, tree in PACKAGE.items():
        for node in (n for n in tree.body if isinstance(n, (ast.Assign, ast.AnnAssign))):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [e.id for of in targets for e in ast.walk(of) if isinstance(e, ast.Name)]
            short += [f"{name(file)}.{n}" for n in names if n.isupper() and "_" not in n.strip("_")]
    assert not short


def test_sources_name_their_licence():
    """Every source of kernel, package, tests and benchmarks has its licence on top; demos begin with the text that the site shows."""
    folders = ("cpp", "dolfinx_contact", "tests", "benchmarks", "mechanics", "studies")
    found = [
        f for of in folders for end in ("py", "h", "cpp") for f in (ROOT / of).rglob(f"*.{end}")
    ]
    assert len(found) > 300
    head = "SPDX-License-Identifier: MIT"
    assert not [str(file) for file in found if head not in file.read_text()[:200]]


def test_the_repository_is_light():
    """All tracked files together are below 5 MB: what programs make is made, not tracked."""
    if not (ROOT / ".git").exists():
        pytest.skip("no clone")
    command = ["git", "-c", f"safe.directory={ROOT}", "ls-files", "-z"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    files = [ROOT / name for name in listed.stdout.split("\0") if name]
    assert sum(file.stat().st_size for file in files if file.exists()) < 5e6
