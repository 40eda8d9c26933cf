"""Frictional contact of bodies with rigid or deformable surfaces, for FEniCSx, by the bi-potential method.

A name is imported where it is first used: those of arrays, such as ``solve_condensed``, ``project_cone`` and
``Friction``, need NumPy alone; those of bodies, such as ``ContactProblem``, need DOLFINx and PETSc.
"""

from importlib import import_module
from typing import TYPE_CHECKING

try:  # the wheel dolfinx-solver-real wants to be imported before DOLFINx, PETSc and MPI
    import dolfinx_solver  # noqa: F401
except ImportError:
    pass

try:
    from dolfinx_contact import _kernel  # noqa: F401
except ImportError as error:
    if error.name != __name__:  # it is there, and cannot be loaded
        raise
    raise ImportError(
        f"{__path__[0]} has no compiled kernel. If this is a clone of the source, Python has found it in the "
        "present directory, before an installed dolfinx_contact: start Python in another directory, or make the "
        "kernel here by 'make .venv/ready' and use .venv/bin/python."
    ) from error

if TYPE_CHECKING:  # what type checkers and editors read; a test compares it with _HOME
    from dolfinx_contact.analysis.adapt import Adapted as Adapted
    from dolfinx_contact.analysis.adapt import adapt as adapt
    from dolfinx_contact.analysis.converge import Converged as Converged
    from dolfinx_contact.analysis.converge import converge as converge
    from dolfinx_contact.analysis.cycle_jump import CycleJump as CycleJump
    from dolfinx_contact.analysis.cycle_jump import cycle_jump as cycle_jump
    from dolfinx_contact.analysis.estimate import Estimate as Estimate
    from dolfinx_contact.analysis.estimate import estimate as estimate
    from dolfinx_contact.analysis.increments import advance as advance
    from dolfinx_contact.bodies.internal_variables import InternalVariables as InternalVariables
    from dolfinx_contact.contact.contact import Contact as Contact
    from dolfinx_contact.contact.state import Status as Status
    from dolfinx_contact.law.bipotential import bipotential_gap as bipotential_gap
    from dolfinx_contact.law.friction import Friction as Friction
    from dolfinx_contact.law.friction_cone import load_function as load_function
    from dolfinx_contact.law.friction_cone import project_cone as project_cone
    from dolfinx_contact.law.wear import Wear as Wear
    from dolfinx_contact.petsc.linear_solver import LinearSolverError as LinearSolverError
    from dolfinx_contact.problem import ContactProblem as ContactProblem
    from dolfinx_contact.results.history import History as History
    from dolfinx_contact.results.plot import plot as plot
    from dolfinx_contact.results.profile import profile as profile
    from dolfinx_contact.results.record import Counts as Counts
    from dolfinx_contact.results.record import NotConverged as NotConverged
    from dolfinx_contact.results.record import Step as Step
    from dolfinx_contact.results.writer import Writer as Writer
    from dolfinx_contact.solvers.base import SolverName as SolverName
    from dolfinx_contact.solvers.condensed.newton import CondensedNewton as CondensedNewton
    from dolfinx_contact.solvers.condensed.newton import solve_condensed as solve_condensed
    from dolfinx_contact.solvers.condensed.result import (
        CondensedNotConverged as CondensedNotConverged,
    )
    from dolfinx_contact.solvers.condensed.result import CondensedResult as CondensedResult
    from dolfinx_contact.solvers.fixed_point.fixed_point import FixedPoint as FixedPoint
    from dolfinx_contact.solvers.newton.snes import SNES as SNES
    from dolfinx_contact.solvers.newton.sparse_newton import SparseNewton as SparseNewton
    from dolfinx_contact.support.checks import RoundingWarning as RoundingWarning
    from dolfinx_contact.surfaces.deformable import DeformableSurface as DeformableSurface
    from dolfinx_contact.surfaces.level_set import RigidSurface as RigidSurface
    from dolfinx_contact.surfaces.plane import RigidPlane as RigidPlane
    from dolfinx_contact.surfaces.round import RigidCylinder as RigidCylinder
    from dolfinx_contact.surfaces.round import RigidSphere as RigidSphere

    __version__: str

_NAMES = {  # by their module
    "support.checks": ["RoundingWarning"],
    "bodies.internal_variables": ["InternalVariables"],
    "contact.contact": ["Contact"],
    "surfaces.round": ["RigidCylinder", "RigidSphere"],
    "contact.state": ["Status"],
    "surfaces.level_set": ["RigidSurface"],
    "surfaces.deformable": ["DeformableSurface"],
    "surfaces.plane": ["RigidPlane"],
    "analysis.adapt": ["Adapted", "adapt"],
    "analysis.converge": ["Converged", "converge"],
    "analysis.cycle_jump": ["CycleJump", "cycle_jump"],
    "analysis.estimate": ["Estimate", "estimate"],
    "analysis.increments": ["advance"],
    "law.bipotential": ["bipotential_gap"],
    "law.friction": ["Friction"],
    "law.friction_cone": ["load_function", "project_cone"],
    "law.wear": ["Wear"],
    "petsc.linear_solver": ["LinearSolverError"],
    "problem": ["ContactProblem"],
    "results.history": ["History"],
    "results.plot": ["plot"],
    "results.profile": ["profile"],
    "results.record": ["Counts", "NotConverged", "Step"],
    "results.writer": ["Writer"],
    "solvers.base": ["SolverName"],
    "solvers.condensed.newton": ["CondensedNewton", "solve_condensed"],
    "solvers.condensed.result": ["CondensedNotConverged", "CondensedResult"],
    "solvers.fixed_point.fixed_point": ["FixedPoint"],
    "solvers.newton.snes": ["SNES"],
    "solvers.newton.sparse_newton": ["SparseNewton"],
}
_HOME = {name: module for module, names in _NAMES.items() for name in names}
__all__ = list(_HOME)


def _get(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        value = version(__name__)
    elif name in _HOME:
        value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


if not TYPE_CHECKING:  # which would take any name for one of ours
    __getattr__ = _get


def __dir__() -> list[str]:
    return sorted({*_HOME, *(name for name in globals() if name.startswith("__")), "__version__"})
