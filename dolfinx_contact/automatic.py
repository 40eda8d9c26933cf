# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The choice of a solver, where the user makes none."""

from __future__ import annotations

import numpy as np

from dolfinx_contact import condensed
from dolfinx_contact.condensed_newton import CondensedNewton
from dolfinx_contact.fixed_point import FixedPoint

CROSSOVER = 400  # contact nodes, see docs/solvers.md


class Automatic:
    """Newton's method on the condensed problem for small contacts, else the fixed point.

    If the choice fails, the other one is tried.  ``equations.chosen`` says what was done and why.
    """

    def solve(self, equations, x: np.ndarray | None, tol: float) -> tuple[np.ndarray, int]:
        comm = equations.body.comm
        contacts = equations.problem.contacts
        nodes = comm.allreduce(sum(len(contact.nodes) for contact in contacts))
        unknowns = equations.body.K.getSize()[0]
        fits = condensed.fits(comm, nodes, condensed.components(contacts), unknowns)
        solvers = [CondensedNewton(), FixedPoint()]
        if nodes > CROSSOVER:
            why = f"{nodes} contact nodes, more than {CROSSOVER}"
            solvers.reverse()
        elif equations.body.ksp.getPC().getType() not in ("lu", "cholesky"):
            why = "without a factorisation the condensed operator would cost too many solves"
            solvers.reverse()
        elif not fits:
            why = f"the condensed operator of {nodes} contact nodes does not fit into memory"
            solvers.reverse()
        else:
            why = f"{nodes} contact nodes, at most {CROSSOVER}"
        if not fits:
            solvers = solvers[:1]
        iterations, best, chosen = 0, (np.inf, x), ""
        for solver in solvers:
            x, count = solver.solve(equations, best[1], tol)
            iterations += count
            error = equations.measure(x)
            chosen = f"{chosen}{type(solver).__name__} ({why})"
            if error < best[0]:
                best = (error, x)
            if error <= tol:
                break
            why, chosen = f"the other one ended at {error:.1e}", chosen + ", then "
        equations.chosen = chosen.removesuffix(", then ")
        return best[1], iterations
