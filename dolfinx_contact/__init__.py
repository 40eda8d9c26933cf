"""Frictional contact of elastic bodies with rigid planes, for FEniCSx, by the bi-potential method."""

from dolfinx_contact import _dolfinx  # noqa: F401  (first: releases differ in what they want first)
from dolfinx_contact.bipotential import bipotential_gap
from dolfinx_contact.condensed_newton import (
    CondensedNewton,
    CondensedNotConverged,
    CondensedResult,
    solve_condensed,
)
from dolfinx_contact.contact import Contact, Status
from dolfinx_contact.fixed_point import FixedPoint
from dolfinx_contact.friction import Friction
from dolfinx_contact.friction_cone import load_function, project_cone
from dolfinx_contact.history import History
from dolfinx_contact.linear_solver import LinearSolverError
from dolfinx_contact.plane import RigidPlane
from dolfinx_contact.problem import ContactProblem, Counts, NotConverged, Step
from dolfinx_contact.wear import Wear

__all__ = [
    "CondensedNewton",
    "CondensedNotConverged",
    "CondensedResult",
    "Contact",
    "ContactProblem",
    "Counts",
    "FixedPoint",
    "Friction",
    "History",
    "LinearSolverError",
    "NotConverged",
    "RigidPlane",
    "Status",
    "Step",
    "Wear",
    "bipotential_gap",
    "load_function",
    "project_cone",
    "solve_condensed",
]
