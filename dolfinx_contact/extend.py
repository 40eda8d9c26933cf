# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Base classes and interfaces for your own extensions.

Extensions are surfaces, laws, contact points, lagged quantities, checks and solvers.  See
docs/extending.md and docs/own_solver.md.  No other module of the package imports this module.
"""

from dolfinx_contact.checks.check import Check, CheckedStep
from dolfinx_contact.contact.interface import ContactPoints
from dolfinx_contact.lagged.friction import LaggedFriction
from dolfinx_contact.law.maps import BipotentialMap, ContactLaw, NodalLaw, NodalMap, ReturnMap
from dolfinx_contact.solvers.base import BoundSolver, Solver, SolverResult
from dolfinx_contact.solvers.fixed_point.preconditioner import ContactPreconditioner
from dolfinx_contact.step.staggered import Change, Lagged
from dolfinx_contact.surfaces.surface import CurvedSurface, Surface

__all__ = [
    "BipotentialMap",
    "BoundSolver",
    "Change",
    "Check",
    "CheckedStep",
    "ContactLaw",
    "ContactPoints",
    "ContactPreconditioner",
    "CurvedSurface",
    "Lagged",
    "LaggedFriction",
    "NodalLaw",
    "NodalMap",
    "ReturnMap",
    "Solver",
    "SolverResult",
    "Surface",
]
