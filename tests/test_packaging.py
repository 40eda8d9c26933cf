"""What the package promises before it computes anything, and what tools/probe.py refuses."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from mpi4py import MPI

PROBE = Path(__file__).parent.parent / "tools" / "probe.py"

pytestmark = pytest.mark.skipif(
    MPI.COMM_WORLD.size > 1, reason="starts interpreters, which MPI forbids to several ranks"
)


def run(*arguments, **environment):
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMI", "PRTE_"))}
    return subprocess.run(
        [sys.executable, *arguments], env=clean | environment, capture_output=True, text=True
    )


def test_import_needs_no_extras():
    """`import dolfinx_contact` imports none of the packages that only demos and tests need."""
    extras = ["gmsh", "matplotlib", "tqdm", "pytest", "hypothesis", "mpmath"]
    code = (
        f"import sys, dolfinx_contact; print({extras}, [m for m in {extras} if m in sys.modules])"
    )
    result = run("-c", code)
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip().endswith("[]"), result.stdout


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
