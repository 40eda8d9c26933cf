"""Frictional contact of elastic bodies with rigid planes, for FEniCSx, by the bi-potential method.

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
    from dolfinx_contact.checks import RoundingWarning as RoundingWarning
    from dolfinx_contact.contact.contact import Contact as Contact
    from dolfinx_contact.contact.curved import RigidCylinder as RigidCylinder
    from dolfinx_contact.contact.curved import RigidSphere as RigidSphere
    from dolfinx_contact.contact.history import Status as Status
    from dolfinx_contact.contact.plane import RigidPlane as RigidPlane
    from dolfinx_contact.increments import advance as advance
    from dolfinx_contact.law.bipotential import bipotential_gap as bipotential_gap
    from dolfinx_contact.law.friction import Friction as Friction
    from dolfinx_contact.law.friction_cone import load_function as load_function
    from dolfinx_contact.law.friction_cone import project_cone as project_cone
    from dolfinx_contact.law.wear import Wear as Wear
    from dolfinx_contact.petsc.linear_solver import LinearSolverError as LinearSolverError
    from dolfinx_contact.problem import ContactProblem as ContactProblem
    from dolfinx_contact.results.history import History as History
    from dolfinx_contact.results.record import Counts as Counts
    from dolfinx_contact.results.record import NotConverged as NotConverged
    from dolfinx_contact.results.record import Step as Step
    from dolfinx_contact.solvers.condensed_newton import CondensedNewton as CondensedNewton
    from dolfinx_contact.solvers.condensed_newton import solve_condensed as solve_condensed
    from dolfinx_contact.solvers.condensed_result import (
        CondensedNotConverged as CondensedNotConverged,
    )
    from dolfinx_contact.solvers.condensed_result import CondensedResult as CondensedResult
    from dolfinx_contact.solvers.fixed_point import FixedPoint as FixedPoint
    from dolfinx_contact.solvers.sparse_newton import SparseNewton as SparseNewton

    __version__: str

_HOME = {  # the module of every name
    "CondensedNewton": "solvers.condensed_newton",
    "CondensedNotConverged": "solvers.condensed_result",
    "CondensedResult": "solvers.condensed_result",
    "Contact": "contact.contact",
    "ContactProblem": "problem",
    "Counts": "results.record",
    "FixedPoint": "solvers.fixed_point",
    "Friction": "law.friction",
    "History": "results.history",
    "LinearSolverError": "petsc.linear_solver",
    "NotConverged": "results.record",
    "RigidCylinder": "contact.curved",
    "RigidPlane": "contact.plane",
    "RigidSphere": "contact.curved",
    "RoundingWarning": "checks",
    "SparseNewton": "solvers.sparse_newton",
    "Status": "contact.history",
    "Step": "results.record",
    "Wear": "law.wear",
    "advance": "increments",
    "bipotential_gap": "law.bipotential",
    "load_function": "law.friction_cone",
    "project_cone": "law.friction_cone",
    "solve_condensed": "solvers.condensed_newton",
}
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
