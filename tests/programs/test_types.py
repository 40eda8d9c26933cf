# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Types for those who check theirs: a user's script passes ``mypy --strict``, and a mistake in it does not."""

import subprocess
import sys
from pathlib import Path

import pytest
from mpi4py import MPI

import dolfinx_contact as dc

mypy = pytest.importorskip("mypy")
pytestmark = [
    pytest.mark.slow,  # mypy reads NumPy's types, some 20 seconds
    pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts programs of its own"),
]
SCRIPT = Path(__file__).parents[1] / "support" / "user_script.py"
CONFIG = Path(__file__).parents[2] / "pyproject.toml"

MISTAKES = {
    "dc.Fricton(0.3)": "attr-defined",
    "dc.Friction('0.3', k='associated')": "arg-type",
    "dc.RigidPlane((0, 0, 0))": "call-arg",
    "problem.solve().eror": "attr-defined",
    "contact.reaction.upper()": "attr-defined",
}
KNOWN = {
    "contact.reaction": "ndarray",
    "contact.friction": "Friction",
    "contact.surface.displacement": "ndarray",
    "problem.solve()": "Step",
    "problem.solve().error": "float",
    "problem.solve().counts": "Counts",
    "problem.monitor": "Counts",
    "dc.solve_condensed": "CondensedResult",
    "dc.History(problem).rows": "dict",
    "dc.__version__": "str",
}

# Interfaces, and the classes of the package that fit them.
PARTS = """
import dolfinx_contact as dc
from dolfinx_contact import _kernel, extend
from dolfinx_contact.law.supported import SupportedLaw


solvers: list[extend.Solver] = [dc.CondensedNewton(), dc.FixedPoint(), dc.SparseNewton(), dc.SNES()]


def maps(one: extend.BipotentialMap, other: extend.ReturnMap) -> list[extend.NodalMap]:
    return [one, other]


def laws(plane: _kernel.Law2D, solid: _kernel.Law3D, held: SupportedLaw) -> list[extend.NodalLaw]:
    whole: list[extend.ContactLaw] = [plane, solid]
    return [*whole, held]
"""


def checked(folder, text):
    """What mypy says of a script by the settings of pyproject.toml, which are strict; a list of lines."""
    (folder / "script.py").write_text(text)
    result = subprocess.run(
        [
            sys.executable,
            "-m",
            "mypy",
            f"--config-file={CONFIG}",
            "--no-error-summary",
            "script.py",
        ],
        cwd=folder,
        env={"MYPYPATH": str(Path(dc.__file__).parents[1]), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
    )
    assert not result.stderr, result.stderr
    return result.stdout.splitlines()


def test_a_users_script_is_well_typed(tmp_path):
    """Nothing of ours lacks a type; each mistake is one of its own; and what users read most is known, not Any."""
    script = SCRIPT.read_text()
    start = len(script.splitlines()) + 2
    body = [*MISTAKES, *(f"reveal_type({name})" for name in KNOWN)]
    tail = "\ndef f(problem: dc.ContactProblem, contact: dc.Contact) -> None:\n    "
    said = checked(tmp_path, script + tail + "\n    ".join(body) + "\n")
    by_line = {}
    for line in said:
        by_line.setdefault(int(line.split(":")[1]) - start, []).append(line)
    assert sorted(by_line) == list(range(1, len(body) + 1)), said
    for k, kind in enumerate(MISTAKES.values(), start=1):
        assert f"[{kind}]" in by_line[k][0], by_line[k]
    for k, kind in enumerate(KNOWN.values(), start=len(MISTAKES) + 1):
        assert kind in by_line[k][0] and '"Any"' not in by_line[k][0], by_line[k]


def test_classes_fit_their_interfaces(tmp_path):
    """Solvers, maps and laws fit the interfaces by which parameters are typed; one that lacks a member does not."""
    assert checked(tmp_path, PARTS) == []
    wrong = PARTS.replace("[plane, solid]", "[plane, held]")
    (said,) = [line for line in checked(tmp_path, wrong) if "error" in line]
    assert "ContactLaw" in said


def test_a_users_script_runs(tmp_path):
    """The script is one that works."""
    result = subprocess.run(
        [sys.executable, str(SCRIPT), str(tmp_path)], capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr
    assert float(result.stdout.splitlines()[-1]) < 1e-9
