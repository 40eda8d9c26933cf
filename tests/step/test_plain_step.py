# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What a scene does not need it does not meet: a plain step knows nothing of forces that drive surfaces, shared nodes and the like."""

import subprocess
import sys
from pathlib import Path

import pytest
from mpi4py import MPI

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts programs of its own")

# What a linear body on one plane imports, friction a number: whoever adds a module to these lists says why. What is needed by the solver follows.
PLAIN = {
    "accepted", "checks.check", "checks.scene", "bodies.elastic", "bodies.input", "bodies.rigid_motion", "compat",
    "contact.contact", "contact.contact_step", "contact.displacements", "contact.fields", "contact.input", "contact.interface", "contact.laws", "contact.geometry", "contact.rigid",
    "contact.state", "law.dissipation", "law.friction", "law.maps", "next_step", "petsc.linear_solver", "problem", "problem_input",
    "results.record", "solution", "solvers.base", "step.errors", "step.load_step",  "support.attributes",
    "support.checks", "support.collective", "surfaces.plane", "surfaces.surface",
}  # fmt: skip
SPARSE = {
    "solvers.newton.contact_tangent",
    "solvers.newton.sparse_newton",
    "solvers.search",
    "support.line_search",
}
SOLVER = {
    "CondensedNewton": {f"solvers.condensed.{name}" for name in ("body", "compliance", "input", "kernel", "newton", "result")},
    "FixedPoint": {f"solvers.fixed_point.{name}" for name in ("fixed_point", "preconditioner", "rigid_balance", "surface_layer")}
    | {"solvers.newton.contact_tangent", "solvers.search", "support.anderson", "support.line_search"},
    "SparseNewton": SPARSE,
    "SNES": SPARSE | {"solvers.newton.snes"},
}  # fmt: skip

# Of these nothing is run after the import: values without methods, and lengths of steps of motions that this body does not have.
NOT_RUN = (
    {"solvers.base", "solvers.condensed.result"},
    {"solvers.base", "support.line_search"},
    {"solvers.base"},
    {"solvers.base"},
)

DRIVEN = {f"surfaces.{name}" for name in ("drive", "driven", "held", "balance", "sliding")}


# Two steps of a block; with an argument its plane is driven by force. Prints what was imported and what was run.
SCRIPT = """
import sys
run = set()
sys.setprofile(lambda frame, event, _: frame.f_code.co_flags & 1 and run.add(frame.f_code.co_filename))  # functions
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
files = {name: getattr(module, "__file__", None) or "" for name, module in sys.modules.items()}
print(*sorted(name for name, file in files.items() if name.startswith("dolfinx_contact.") and file.endswith(".py") and not file.endswith("__init__.py")))
print(*sorted(name for name in run if "/dolfinx_contact/" in name))
"""


def met(*arguments):
    """Modules of the package, as ``step.load_step``, that are imported, and those of which anything is run."""
    command = [sys.executable, "-c", SCRIPT, *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    imported, run = (line.split() for line in done.stdout.splitlines()[-2:])
    files = [file.rpartition("/dolfinx_contact/")[2].removesuffix(".py") for file in run]
    return {n.partition(".")[2] for n in imported}, {f.replace("/", ".") for f in files}


@pytest.mark.parametrize("solver, idle", [*zip(SOLVER, NOT_RUN)])
def test_a_plain_step_meets_what_it_needs(solver, idle):
    """A linear body on one plane, friction a number: exactly these modules are imported, and something is run of all but those that are named."""
    imported, run = met(solver)
    assert imported == PLAIN | SOLVER[solver]
    assert imported - run == idle
    assert len(imported) <= (40 if solver == "CondensedNewton" else 46)


def test_a_driven_plane_meets_its_drive():
    """The same scene on a plane that a force drives imports and runs what that needs, and no more."""
    imported, run = met("FixedPoint", "500")
    assert imported - PLAIN - SOLVER["FixedPoint"] >= DRIVEN
    assert DRIVEN <= run
