"""Predictor and corrector in a loop of your own.

With plain DOLFINx and PETSc, for those who have a solver already and want contact in it: ``dc.OwnLoop`` turns displacements
into reactions, ``contact.assemble_reaction`` adds them to a residual. Without acceleration the loop
takes well over a thousand iterations a step on a coarse punch, each one back-solve; its answer is
checked against ``dc.ContactProblem``.  From the root of the clone: ``python -m demos.demo_own_loop``.
"""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import petsc_vec

# isort: split
import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from demos.helpers import on_all_ranks, say
from studies.punch import Parameters, Punch


class Loop:
    """Fixed point of [dSFMH07, Section 2] with one contact and a residual form F linear in u."""

    def __init__(self, F, u, contact: dc.Contact, bcs):
        self.u, self.contact, self.bcs = u, contact, bcs
        self.minus_F = fem.form(-F)
        A = fem.petsc.assemble_matrix(fem.form(ufl.derivative(F, u)), bcs=bcs)
        A.assemble()
        self.loop = dc.OwnLoop(contact, A)
        self.loop.add_springs(A)
        self.ksp = PETSc.KSP().create(A.comm)
        self.ksp.setOperators(A)
        self.ksp.setType("preonly")
        self.ksp.pc.setType("lu")
        self.ksp.pc.setFactorSolverType("mumps")
        self.correction = A.createVecRight()

    def solve(self, tol: float) -> int:
        """One load step; ends when corrections are below ``tol`` times the displacement."""
        for iteration in range(1, 100_000):
            self.loop.update(self.u)  # gaps, slip increments, predictor, projection
            b = fem.petsc.assemble_vector(self.minus_F)
            b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
            self.contact.assemble_reaction(b)
            fem.petsc.set_bc(b, self.bcs, petsc_vec(self.u))
            self.ksp.solve(b, self.correction)
            b.destroy()
            petsc_vec(self.u).axpy(1.0, self.correction)
            self.u.x.scatter_forward()
            if self.correction.norm() <= tol * petsc_vec(self.u).norm():
                self.loop.advance()  # accepted: the next slip is measured from here
                return iteration
        raise RuntimeError("The loop did not converge.")


def compare(case: str = "C", displacements=(0.05, 0.1, 0.07)) -> float:
    """Both solvers on a coarse punch; returns the largest difference of reactions, relative."""
    coarse = dict(divisions=2, layers=1)
    own = Punch(Parameters(case=case), **coarse)
    reference = Punch(Parameters(case=case, tol=1e-12), **coarse)
    loop = Loop(own.F, own.u, own.contact, own.bcs)
    differences = []
    for displacement in displacements:
        own.move_top(displacement)
        iterations = loop.solve(tol=1e-13)
        record = reference.press(displacement)
        found, expected = on_all_ranks(own.contact.reaction, reference.contact.reaction)
        differences.append(np.abs(found - expected).max() / np.abs(expected).max())
        say(f"{displacement} mm: {iterations} iterations, ContactProblem {record['iterations']}, "
            f"difference {differences[-1]:.1e}")  # fmt: skip
    return max(differences)


if __name__ == "__main__":
    assert compare() < 1e-9
