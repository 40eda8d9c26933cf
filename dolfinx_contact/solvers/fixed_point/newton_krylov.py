# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Newton's method on the residual of the fixed point: GMRES with the fixed point's own correction."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np
from petsc4py import PETSc

from dolfinx_contact.law.maps import ReturnMap
from dolfinx_contact.support.line_search import enough, halves

if TYPE_CHECKING:
    from dolfinx_contact.solvers.fixed_point.preconditioner import ContactPreconditioner
    from dolfinx_contact.solvers.protocols import MapLike, StepLike
    from dolfinx_contact.solvers.search import Search

# Augmentation parameters over the nodal stiffness, along the normal and along slip. The latter weights errors of slip
# against errors of reaction; the next one is taken where a step gets SHORT.
NORMAL, TANGENTIAL, SHORT = 10.0, (0.1, 0.3, 0.03, 1.0), 0.25

# Iterations at most, and those in which the smallest error has to halve.
MOST, PATIENCE = 600, 100

# Iterations of GMRES for one step at most, each of which keeps a vector, and the part of the residual it may leave.
INNER, ACCURACY = 20, 0.1

# Of a step is taken the largest half, quarter, ... that makes the residual smaller; below it there is none.
SHORTEST = 2.0**-9


def search_by_newton(search: Search, preconditioner: ContactPreconditioner, x: np.ndarray) -> None:
    """Steps of Newton's method from ``x`` until the search is over, or the error no longer halves.

    Args:
        search: The ``Search`` of the fixed point, which keeps the best iterate.
        preconditioner: Its ``ContactPreconditioner``.
        x: Displacement of owned degrees of freedom.
    """
    step = search.step
    search.begin(x, MOST, PATIENCE)
    with closing(NewtonKrylov(step, preconditioner)) as newton:
        for tangential in cycle(TANGENTIAL):
            maps = [ReturnMap(NORMAL * k.normal, tangential * k.normal) for k in step.stiffness]
            length = 1.0
            while length >= SHORT:
                forces = step.forces(x)
                residual = search.residual(x, maps, forces)
                if not search.goes_on:
                    return
                preconditioner.linearise(step.derivatives(x, maps, forces))
                dx, length, iterations = newton.step(x, residual, maps, forces)
                search.count(max(iterations, 1))
                x = x + length * dx


class NewtonKrylov:
    """Steps of Newton's method for the contact residual of a body, each no longer than it helps.

    The linear system is ``J dx = F``, ``J`` as in ``SurfaceLayer``, ``F`` the forces out of balance.  GMRES is
    preconditioned by the correction of the fixed point.  No matrix but the preconditioner's is set up.

    Args:
        step: The ``LoadStep``.
        preconditioner: The ``ContactPreconditioner``, linearised before every step.
    """

    def __init__(self, step: StepLike, preconditioner: ContactPreconditioner):
        self._step, self._preconditioner, body = step, preconditioner, step.body
        right, left = body.K.createVecs()
        size = (body.K.getSizes()[0],) * 2
        self._solver = ksp = PETSc.KSP().create(body.comm)
        ksp.setOptionsPrefix(f"{body.prefix}newton_")
        ksp.setOperators(PETSc.Mat().createPython(size, self, body.comm))
        ksp.setType("gmres")
        ksp.setGMRESRestart(INNER)
        ksp.setTolerances(rtol=ACCURACY, atol=0.0, max_it=INNER)
        ksp.setPCSide(PETSc.PC.Side.RIGHT)
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(self)
        ksp.setFromOptions()
        self._direction, self._residual = right, left

    def close(self) -> None:
        """Free the vectors of GMRES.  Collective."""
        self._solver.destroy()

    def mult(self, _: object, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """PETSc's product with J."""
        y.array_w[:] = self._preconditioner.tangent(x.array_r.copy())

    def apply(self, _: object, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """PETSc's preconditioner."""
        y.array_w[:] = self._preconditioner.correct(x.array_r)

    def step(
        self,
        x: np.ndarray,
        residual: np.ndarray,
        maps: Sequence[MapLike],
        forces: np.ndarray | None = None,
    ) -> tuple[np.ndarray, float, int]:
        """Direction of Newton's step, how much of it makes the residual smaller, and iterations of GMRES.

        Args:
            x: Displacement at which the system was linearised, owned degrees of freedom.
            residual: Forces out of balance there.
            maps: Of the contacts.
            forces: The step's at ``x``, where they are known.

        Returns:
            Direction, length (1 for the whole step, 0 if none is short enough), iterations.
        """
        self._residual.array_w[:] = self._step.free(residual)
        self._solver.solve(self._residual, self._direction)
        dx, iterations = self._direction.array_r.copy(), self._solver.getIterationNumber()
        size, before = self._step.along(x, dx, maps, forces), self._step.size(residual)
        fitting = (t for t in halves(SHORTEST) if size(t) <= enough(t) * before)
        return dx, next(fitting, 0.0), iterations
