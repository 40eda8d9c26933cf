"""What a solver sees of a load step: a residual, its error, corrections and a condensed operator."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact.condensed import CondensedBody
from dolfinx_contact.contact import Status
from dolfinx_contact.error import Errors, projection_residual, relative
from dolfinx_contact.linear_solver import LinearSolver, stage
from dolfinx_contact.rigid_balance import RigidBalance
from dolfinx_contact.stiffened_multigrid import StiffenedMultigrid
from dolfinx_contact.surface_layer import SurfaceLayer

# Newton's metric over the nodal stiffness, along the normal and along slip, which want their own: along slip
# it weights errors of slip against errors of reaction.
NEWTON = (10.0, 0.1)


class _Stiffened(NamedTuple):
    """The body with the springs of one metric (map and factor) at its contact nodes."""

    metric: tuple[str, float]
    solver: LinearSolver | StiffenedMultigrid
    rigid: RigidBalance


class ContactEquations:
    """What a solver sees of a step: a residual, a correction, a metric and a sum over ranks."""

    def __init__(self, problem, b, load: float, load_displacement: float):
        self.problem, self.body, self.b = problem, problem.body, b
        self.chosen, self.tried = "none: nothing touches", ()
        self.load, self.load_displacement = load, load_displacement
        self.total = problem.body.total
        self._set_metric("bipotential", 1.0)
        self._tangent = None  # SurfaceLayer, once linearised
        self._evaluations = 0
        self._known = None  # a displacement, and the forces b - K x that it leaves
        self._measured = None  # displacement whose errors were measured with F

    @property
    def trial(self) -> np.ndarray:
        """The displacement without reactions."""
        return self.body.free_state(self.b)

    def guess(self) -> np.ndarray:
        """The user's ``u`` or the extrapolated last steps, whichever leaves the smaller error.

        By the return map: the paper's, whose reactions differ more from those before where slip is far from the
        normal of the cone, takes an extrapolation for worse than it is.
        """
        self._set_metric("return", 1.0)
        body, (last, before) = self.body, self.problem._states
        guesses = [self.problem.u.x.array[: body.size].copy(), 2 * last - before]
        for guess in guesses:
            guess[body.fixed] = self.b[body.fixed]
        return min(guesses, key=lambda guess: self.residual(guess)[1])

    def condensed(self) -> CondensedBody:
        """The body condensed to its contact nodes, kept while its matrix stands."""
        problem, self._measured = self.problem, None  # contacts will move
        if problem._condensed is None:
            problem._condensed = CondensedBody(self.body, problem.contacts)
        problem._condensed.past = problem._past
        return problem._condensed

    def use_metric(self, map: str, factor: float) -> None:
        """Set the map of the predictor, rho as a factor of the nodal stiffness, and springs to match."""
        self._set_metric(map, factor)
        self._tangent, problem = None, self.problem
        if problem._stiffened is not None and problem._stiffened.metric == (map, factor):
            return
        problem._free_springs()  # one factorisation at a time: memory counts more than time
        with stage("contact: set-up of springs"):
            S, A = self._springs(map), self.body.K.copy()
            A.axpy(1.0, S, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
            rigid = RigidBalance(self.body, problem.contacts, A)
            problem._stiffened = _Stiffened((map, factor), self.body.stiffened(A, S), rigid)
        A.destroy()  # the solver has its own reference
        S.destroy()

    def _springs(self, map: str):
        """The springs that belong to the metric, a PETSc matrix with entries at contact nodes alone."""
        K = self.body.K
        S = sparse.csr_matrix((self.body.size, K.getSize()[1]))
        for contact in self.problem.contacts:
            blocks = contact.spring_blocks(contact.springs(map))
            i, j = (
                np.broadcast_to(dofs, blocks.shape).ravel()
                for dofs in (contact._dofs[:, :, None], contact._dofs[:, None, :])
            )
            S += sparse.csr_matrix((blocks.ravel(), (i, K.getOwnershipRange()[0] + j)), S.shape)
        csr = (S.indptr.astype(PETSc.IntType), S.indices.astype(PETSc.IntType), S.data)
        return PETSc.Mat().createAIJ(K.getSizes(), csr=csr, comm=self.body.comm)

    def _set_metric(self, map: str, normal: float, tangential: float | None = None) -> None:
        self._map = map
        for contact, stiffness in zip(self.problem.contacts, self.problem._stiffness):
            contact.rho = normal * stiffness
            contact.rho_t = None if tangential is None else tangential * stiffness

    def balanced(self, x: np.ndarray) -> np.ndarray:
        """``x``, moved along the rigid motions that only soft springs resist, see ``RigidBalance``."""
        if len(self.problem._stiffened.rigid) == 0:
            return x
        self._measured = None  # contacts will move
        self._known = self.problem._stiffened.rigid.balanced(x, self._forces(x), self._map)
        return self._known[0]

    def round_off(self, rounding: float, drag: float = 0.0, home=None) -> None:
        """Residuals from now on are those of a law without kink between sticking and slipping.

        Args:
            rounding: Over the load displacement; 0 is the law itself.
            drag: Springs over the nodal stiffness, which pull slips back to those at ``home``.
            home: Displacement, owned degrees of freedom; needed with ``drag``.
        """
        self._set_metric("smoothed", *NEWTON)
        for contact, stiffness in zip(self.problem.contacts, self.problem._stiffness):
            contact.rounding, contact.drag = rounding * self.load_displacement, None
            if drag > 0.0:
                contact.move(home)
                contact.drag = drag * stiffness, contact.slip_increment

    def linearise(self, x: np.ndarray) -> None:
        """From now on corrections know how the contact nodes respond at ``x``, see ``SurfaceLayer``."""
        problem, self._measured = self.problem, None  # contacts will move
        if problem._layer is None:
            prefix = f"{self.body.prefix}layer_"
            problem._layer = SurfaceLayer(self.body, problem.contacts, prefix)
        contacts = self._asked(self._forces(x))
        derivatives = [contact.update_with_derivatives(x, self._map) for contact in contacts]
        with stage("contact: surface layer"):
            problem._layer.linearise(derivatives)
        self._tangent = problem._layer

    def tangent(self, x: np.ndarray) -> np.ndarray:
        """Minus the derivative of the residual along ``x``, at the displacement of ``linearise``."""
        return self._tangent.multiply(x, self.body.multiply(x))

    def along(self, x: np.ndarray, dx: np.ndarray):
        """Function of a length: the norm of the residual of ``x + length dx``, without a product with K."""
        self._measured = None  # contacts will move
        forces, change = self._forces(x), self.body.multiply(dx)

        def size(length: float) -> float:
            return self.size(self._forces_left(x + length * dx, forces - length * change))

        return size

    def out_of_balance(self, x: np.ndarray) -> np.ndarray:
        """The residual alone, as ``residual`` returns it."""
        self._measured = None  # contacts will move
        return self._forces_left(x, self._forces(x))

    def size(self, residual: np.ndarray) -> float:
        """Norm of the forces out of balance at free degrees of freedom."""
        return self.body.norm(self._free(residual))

    def correction(self, residual: np.ndarray) -> np.ndarray:
        """Displacement that removes the residual while the springs hold the contact nodes.

        One application of the preconditioner: exact with a factorisation, one cycle of multigrid.
        After ``linearise`` the layers next to the plane are corrected first.
        """
        residual = self._free(residual)
        near = 0.0
        if self._tangent is not None:
            near, residual = self._tangent.correct(residual)
        correction = near + self.problem._stiffened.solver.apply(residual)
        correction[self.body.fixed] = 0.0
        return correction

    def residual(self, x: np.ndarray) -> tuple[np.ndarray, float]:
        """Forces out of balance once every contact node has its projected reaction, and the error.

        The reactions that enter the predictor are those the body asks for, ``K x - f``.  Once the
        error falls below the tolerance it is measured again with F itself, assembled by DOLFINx.
        """
        residual = self._update(x, self._forces(x))
        self._measured = None
        if self.errors.largest <= self.problem.tol:
            self.errors = self._errors(self._balance(self._assembled(x)))
            self._measured = x.copy()
        if self.problem.monitor is not None:
            counts = self.problem._counts()
            self.problem.monitor(self._evaluations, self.errors.largest, counts)
        self._evaluations += 1
        return residual, self.errors.largest

    def measure(self, x: np.ndarray) -> float:
        """The error of a displacement by F itself; also takes its reactions, gaps and slips."""
        if self._measured is None or not self.body.same(x, self._measured):
            self._update(x, self._assembled(x))
            self._measured = x.copy()
        return self.errors.largest

    def _forces(self, x: np.ndarray) -> np.ndarray:
        """``b - K x``; of the array that was asked for last without another product."""
        if self._known is None or self._known[0] is not x:
            self._known = (x, self.b - self.body.multiply(x))
        return self._known[1]

    def _asked(self, forces: np.ndarray):
        """The contacts, each with the reactions that balance the forces at its nodes."""
        for contact in self.problem.contacts:
            contact.take_reaction(-forces)
            yield contact

    def _update(self, x: np.ndarray, forces: np.ndarray) -> np.ndarray:
        residual = self._forces_left(x, forces)
        self.errors = self._errors(residual)
        return residual

    def _forces_left(self, x: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """What the new reactions leave of ``forces = b - K x``."""
        for contact in self._asked(forces):
            contact.update(x, self._map)
        return self._balance(forces)

    def errors_if_open(self, x: np.ndarray) -> Errors:
        """Errors of a state in which no node touches, to rounding, and all reactions are zero."""
        for contact in self.problem.contacts:
            contact.move(x)
            contact.gap = np.maximum(contact.gap, 0.0)
            contact.reaction = np.zeros_like(contact.reaction)
            contact.status = np.full_like(contact.status, Status.OPEN)
        return self._errors(self._assembled(x))

    def _free(self, forces: np.ndarray) -> np.ndarray:
        """Forces without what supports carry."""
        forces = forces.copy()
        forces[self.body.fixed] = 0.0
        return forces

    def _assembled(self, x: np.ndarray) -> np.ndarray:
        values = self.problem.u.x.array.copy()
        values[: self.body.size] = x
        return self._free(-self.body.internal_force(values))

    def _balance(self, forces: np.ndarray) -> np.ndarray:
        forces = forces.copy()
        for contact in self.problem.contacts:
            contact.assemble_reaction(forces)
        return forces

    def _errors(self, residual: np.ndarray) -> Errors:
        residual = self._free(residual)
        projection, defect = [np.zeros(0)], 0.0
        for contact, stiffness in zip(self.problem.contacts, self.problem._stiffness):
            projection.append(projection_residual(contact, stiffness).ravel())
            defect = max(defect, contact.slip_defect.max(initial=0.0))
        parts = (relative(part, self.load) for part in (residual, np.concatenate(projection)))
        squares = self.body.total([part @ part for part in parts])  # one reduction for both norms
        defect = self.body.largest(relative(np.array([defect]), self.load_displacement))
        return Errors(float(np.sqrt(squares.max())), defect)
