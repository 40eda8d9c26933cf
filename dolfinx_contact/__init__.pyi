# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
# All public names: __init__.py imports each when it is first used; type checkers and editors read this file.
from dolfinx_contact import condensed as condensed
from dolfinx_contact import law as law
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
from dolfinx_contact.contact.deformable import DeformableSurface as DeformableSurface
from dolfinx_contact.contact.own_loop import OwnLoop as OwnLoop
from dolfinx_contact.contact.state import Status as Status
from dolfinx_contact.law.friction import Friction as Friction
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
from dolfinx_contact.solvers.condensed.result import CondensedNotConverged as CondensedNotConverged
from dolfinx_contact.solvers.fixed_point.fixed_point import FixedPoint as FixedPoint
from dolfinx_contact.solvers.newton.snes import SNES as SNES
from dolfinx_contact.solvers.newton.sparse_newton import SparseNewton as SparseNewton
from dolfinx_contact.support.checks import RoundingWarning as RoundingWarning
from dolfinx_contact.surfaces.level_set import RigidSurface as RigidSurface
from dolfinx_contact.surfaces.plane import RigidPlane as RigidPlane
from dolfinx_contact.surfaces.round import RigidCylinder as RigidCylinder
from dolfinx_contact.surfaces.round import RigidSphere as RigidSphere

__version__: str
