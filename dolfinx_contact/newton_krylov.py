# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Newton's method on the residual of the fixed point: GMRES with the fixed point's own correction."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

# Iterations of GMRES for one step of Newton's method at most, each of which keeps a vector.
INNER = 20

# The linear systems are solved to this; to a hundredth takes half as many iterations again.
ACCURACY = 0.1

# Of a step is taken the largest half, quarter, ... that makes the residual smaller; below it there is none.
SHORTEST = 2.0**-9


class NewtonKrylov:
    """Steps of Newton's method for the contact residual of a body, each no longer than it helps.

    The linear system is ``J dx = F``, ``J`` as in ``SurfaceLayer``, ``F`` the forces out of balance.  GMRES is
    preconditioned by the correction of the fixed point: the layers next to the plane, then one application
    of the preconditioner of stiffness and springs.  No matrix but these is set up.

    Args:
        system: Offers ``body``, ``correction(residual)``, ``tangent(x)``, ``size(residual)`` and ``along(x, dx)``.
    """

    def __init__(self, system):
        self._system, body = system, system.body
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
        self._step, self._residual = right, left

    def close(self) -> None:
        """Free the vectors of GMRES.  Collective."""
        self._solver.destroy()

    def mult(self, _, x, y) -> None:
        """PETSc's product with J."""
        y.array_w[:] = self._system.tangent(x.array_r.copy())

    def apply(self, _, x, y) -> None:
        """PETSc's preconditioner."""
        y.array_w[:] = self._system.correction(x.array_r)

    def step(self, x: np.ndarray, residual: np.ndarray) -> tuple[np.ndarray, float, int]:
        """Direction of Newton's step, how much of it makes the residual smaller, and iterations of GMRES.

        Args:
            x: Displacement at which the system was linearised, owned degrees of freedom.
            residual: Forces out of balance there.

        Returns:
            Direction, length (1 for the whole step, 0 if none is short enough), iterations.
        """
        self._residual.array_w[:] = residual
        self._residual.array_w[self._system.body.fixed] = 0.0
        self._solver.solve(self._residual, self._step)
        dx, iterations = self._step.array_r.copy(), self._solver.getIterationNumber()
        size, before, length = self._system.along(x, dx), self._system.size(residual), 1.0
        while not size(length) <= (1 - 1e-4 * length) * before:
            length /= 2
            if length < SHORTEST:
                return dx, 0.0, iterations
        return dx, length, iterations
