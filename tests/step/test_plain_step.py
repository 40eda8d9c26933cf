"""What a scene does not need it does not meet: a plain step knows nothing of forces that drive surfaces, shared nodes and the like."""

import subprocess
import sys
from pathlib import Path

import pytest
from mpi4py import MPI

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts programs of its own")

SPECIAL = {
    "surfaces.drive", "surfaces.driven", "surfaces.held", "surfaces.balance", "surfaces.sliding", "surfaces.round",
    "contact.shared", "contact.nodal", "bodies.unknowns", "bodies.internal_variables", "step.loose", "step.statics",
    "solvers.condensed.surfaces",
}  # fmt: skip

# Two steps of a block; with an argument its plane is driven by force. Prints what was imported and what was run.
SCRIPT = """
import sys
run = set()
sys.setprofile(lambda frame, event, _: run.add(frame.f_code.co_filename))
from mechanics.scenes import block
import dolfinx_contact as dc

solver, *force = sys.argv[1:]
scene = block(cells=(2, 2, 2), mu=0.3, p=None, tol=1e-8, solver=getattr(dc, solver)())
if force:
    scene.surface.free, scene.surface.force = ("n",), (0.0, 0.0, float(force[0]))
for factor in (1.0, 2.0):
    scene.move_top(1e-3 * factor, 5e-4 * factor, -5e-3 * factor)
    scene.problem.solve()
sys.setprofile(None)
print(*sorted(name for name in sys.modules if name.startswith("dolfinx_contact.")))
print(*sorted(name for name in run if "/dolfinx_contact/" in name))
"""


def met(*arguments):
    """Modules of the package, as ``step.load_step``, that are imported, and those of which anything is run."""
    command = [sys.executable, "-c", SCRIPT, *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    imported, run = (line.split() for line in done.stdout.splitlines()[-2:])
    files = [file.rpartition("/dolfinx_contact/")[2].removesuffix(".py") for file in run]
    return {n.partition(".")[2] for n in imported}, {f.replace("/", ".") for f in files}


@pytest.mark.parametrize("solver", ["CondensedNewton", "FixedPoint", "SparseNewton", "SNES"])
def test_a_plain_step_meets_nothing_special(solver):
    """A linear body on one plane, friction a number: nothing is imported or run that belongs to other scenes."""
    imported, run = met(solver)
    assert {"step.load_step", "surfaces.plane"} <= imported & run
    assert not SPECIAL & (imported | run)


def test_a_driven_plane_meets_its_drive():
    """The same scene on a plane that a force drives imports and runs what that needs, and no more."""
    imported, run = met("FixedPoint", "500")
    needed = {f"surfaces.{name}" for name in ("drive", "driven", "held", "balance", "sliding")}
    assert SPECIAL & imported == SPECIAL & run == needed
