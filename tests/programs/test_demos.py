# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Every demo that is a text notebook runs, on any number of ranks, and what it asserts holds."""

import importlib
import re
from pathlib import Path

import dolfinx_contact  # noqa: F401  before DOLFINx, which one of its wheels needs

# isort: split
import pytest
from mpi4py import MPI

DEMOS = Path(__file__).parents[2] / "demos"
TESTED_ELSEWHERE = {"demo_punch"}  # a command with options: test_demo_punch.py
NOTEBOOKS = [  # the shortest first, as `--once` runs that one
    path.stem
    for path in sorted(DEMOS.glob("demo_*.py"), key=lambda path: len(path.read_text()))
    if "# %%" in path.read_text() and path.stem not in TESTED_ELSEWHERE
]


def test_notebooks_are_found():
    """Discovery is not empty: the demos of this list are among what it finds."""
    names = {"turning_path", "hertz", "partial_slip", "fretting", "quarter_punch"}
    assert {f"demo_{name}" for name in names} <= set(NOTEBOOKS)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_demo(name, capsys):
    """The demo's own assertions hold; rank 0 prints a result, the others nothing."""
    importlib.import_module(name).main()
    printed = capsys.readouterr().out
    assert bool(printed) == (MPI.COMM_WORLD.rank == 0)


@pytest.mark.parametrize("name", [*NOTEBOOKS, *sorted(TESTED_ELSEWHERE)])
def test_demo_reads_as_one(name):
    """Notation, strong form, weak form, code, result, in this order, between cells of percent format."""
    text = (DEMOS / f"{name}.py").read_text()
    assert text.startswith("# %% [markdown]\n# # ")
    headings = re.findall(r"^# ## (Notation|Strong form|Weak form|Code|Result)", text, re.MULTILINE)
    assert list(dict.fromkeys(headings)) == [
        "Notation",
        "Strong form",
        "Weak form",
        "Code",
        "Result",
    ]
