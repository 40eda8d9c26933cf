# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The elastic body: what DOLFINx assembles and PETSc solves; vectors are arrays of the degrees of freedom of this rank."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from dolfinx_contact import compat
from dolfinx_contact.bodies import rigid_motion
from dolfinx_contact.bodies.input import (
    agree_on_values,
    check_diagonal,
    check_dilation,
    check_finite,
    digest_of,
    same_values,
    values_of,
    warn_of_unread,
)
from dolfinx_contact.contact.displacements import Displacements
from dolfinx_contact.petsc.linear_solver import (
    DIRECT_OPTIONS,
    MULTIGRID_OPTIONS,
    LinearSolver,
    preconditioner,
)
from dolfinx_contact.support.collective import OverRanks, raised_together

if TYPE_CHECKING:
    import ufl

    from dolfinx_contact.bodies.anchors import Anchors
    from dolfinx_contact.bodies.loose import LooseMotions

_instances = count()


class FreeState(NamedTuple):
    """The displacement without contact under a load, arrays of owned degrees of freedom."""

    digest: np.ndarray  # of the stiffness
    load: np.ndarray
    displacement: np.ndarray
    exact: bool  # or to three digits

    def scaled(self, b: np.ndarray, fixed: np.ndarray, comm: MPI.Comm) -> np.ndarray | None:
        """The displacement under ``b``, if that is the load times a factor.  Collective.

        Args:
            b: As ``ElasticBody.load`` returns it.
            fixed: Fixed degrees of freedom, which hold boundary values.
            comm: MPI communicator.
        """
        asked_again = comm.allreduce(np.array_equal(b, self.load), op=MPI.LAND)
        if asked_again:  # in the same step
            return self.displacement.copy()
        factor = max(comm.allgather(_ratio(b, self.load)))[1]
        sizes = np.abs([b - factor * self.load, b])
        # Forces and boundary values have different units: each to its own rounding.
        given = sizes[:, fixed]
        sizes[:, fixed] = 0.0
        largest = np.array([part.max(axis=1, initial=0.0) for part in (given, sizes)])
        comm.Allreduce(MPI.IN_PLACE, largest, op=MPI.MAX)
        same = (largest[:, 0] <= 16 * np.finfo(float).eps * largest[:, 1]).all()
        return factor * self.displacement if same else None


def _ratio(b: np.ndarray, last: np.ndarray) -> tuple[float, float]:
    """Largest entry of ``last`` in magnitude, and ``b`` over ``last`` there."""
    if not last.any():
        return 0.0, 0.0
    k = np.abs(last).argmax()
    return abs(last[k]), b[k] / last[k]


class ElasticBody(OverRanks):
    """F(u) = K u - f on the free degrees of freedom, u given on the others.

    Vectors are ``x`` and ``D F`` with ``u = D x``, see ``bodies/unknowns.py``; of displacements alone ``D`` is one.

    Args:
        F: Residual form, linear in ``u``.
        u: Displacement.
        bcs: Dirichlet conditions; their values may change between steps, others come by ``support``.
        derivative: Of ``F``, as ``derivative_of`` returns it.
        options: PETSc options of the solver; by default a factorisation by MUMPS, for large bodies
            conjugate gradients with multigrid, see ``linear_solver.py``.
        prefix: Their prefix.
        displacements: Its ``Displacements``, where they are known.
        form_options: Of the forms' compilation, see ``compat.compiled``.
    """

    K: Any  # the PETSc matrix, None before the first step
    soft: np.ndarray
    nonlinear = False  # whether F is not linear in u, see ``NonlinearBody``
    loose: LooseMotions | None = None  # where rigid motions cost nothing
    crowded = False  # whether many contact nodes make multigrid the default, not factors
    scale: np.ndarray | None = None  # D, (owned dofs,); None where it is one, or not yet known

    def __init__(
        self,
        F: ufl.Form,
        u: fem.Function,
        bcs: Sequence[Any],
        derivative: ufl.Form,
        options: dict[str, Any] | None = None,
        prefix: str | None = None,
        displacements: Displacements | None = None,
        form_options: dict[str, Any] | None = None,
    ):
        self.u, self.V = u, u.function_space
        self.comm = self.V.mesh.comm
        compat.free_garbage(self.comm)  # of bodies that nobody closed
        self.tangent, self.form_options = derivative, form_options or {}
        self._residual_form = compat.compiled(F, **self.form_options)
        self._stiffness_form = compat.compiled(derivative, **self.form_options)
        coefficients = [c for c in derivative.coefficients() if c is not u]
        self._parameters = [*coefficients, *derivative.constants()]
        self._load_parameters = [c for c in F.coefficients() if c is not u] + list(F.constants())
        self._work, self.displacements = (
            fem.Function(self.V),
            displacements or Displacements(self.V),
        )
        self.size = self.displacements.size
        self.support(bcs)
        default = (
            DIRECT_OPTIONS if self.displacements.mixed else None
        )  # a saddle point: no multigrid
        self.options = default if options is None else dict(options)
        self.prefix = prefix or f"dolfinx_contact_{next(_instances)}_"
        self._digest: bytes | None = None  # of the stiffness that is assembled
        self._assembled_with, self._loaded_with = None, None  # values of both kinds of parameters
        self.assemblies = 0
        self.K, self._external, self._elastic, self._anchors = None, None, None, None
        self._coupling = self._lift = self._lifted = self._right = self._left = None
        self.closed = self._message = False
        self.last_free_state: FreeState | None = None
        self.extent, self.thickness = rigid_motion.extents(self.displacements)
        self.parts = rigid_motion.connected_parts(self.displacements)

    def support(self, bcs: Sequence[Any]) -> None:
        """From now on these are the Dirichlet conditions; ``refresh`` sets everything up for them."""
        self.bcs = list(bcs)
        fixed = [compat.bc_dofs(bc, self.size) for bc in self.bcs]
        self.fixed = np.unique(np.concatenate([np.zeros(0, dtype=np.int32), *fixed]))

    def refresh(self, x: np.ndarray | None = None) -> int:
        """Assemble the stiffness if a constant or coefficient in it changed, or what is fixed.

        Args:
            x: Last converged displacement; not used here.

        Returns:
            How often it was assembled so far: a number that changes with the matrix.
        """
        given = *self._parameters, *self._load_parameters, *compat.bc_constants(self.bcs)
        agree_on_values(given, self.comm)
        fixed = self._digest is not None and np.array_equal(self.fixed, self._assembled_fixed)
        if self._all_same(fixed and same_values(self._parameters, self._assembled_with)):
            return self.assemblies
        self._digest = None  # so that a failure below does not leave a stale matrix
        self._assembled_with, self._assembled_fixed = values_of(self._parameters), self.fixed
        self._assemble()
        with raised_together(self.comm):
            check_diagonal(self.diagonal(), self.displacements)
        check_dilation(self)
        self._hold()
        self.soft, self.loose = rigid_motion.soft_motions(self)
        own = digest_of(self._parameters, self.fixed)
        self._digest = digest_of((), *self.comm.allgather(own))
        return self.assemblies

    def _all_same(self, same: bool) -> bool:
        """Whether values are the same as before on all ranks.  Collective."""
        return self.comm.allreduce(bool(same), op=MPI.LAND)

    def _assemble(self) -> None:
        """The stiffness, nothing held yet.  Collective."""
        self.forget_solver()
        self._free_matrices()
        if self.K is None:
            self.K = fem.petsc.assemble_matrix(self._stiffness_form)
        else:
            self.K.zeroEntries()
            fem.petsc.assemble_matrix(self.K, self._stiffness_form)
        self.K.assemble()
        diagonal = np.abs(self.diagonal())
        if self.displacements.mixed:
            from dolfinx_contact.bodies import unknowns

            self.scale = unknowns.scaled(self.K, self.displacements, self.scale)
            diagonal = unknowns.row_sizes(self.K, self.displacements)
        # Rounding of a row of K u: as of a sum of so many terms of random sign as it has entries.
        entries = self.K.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"] / self.K.getSize()[0]
        self._row_size = np.sqrt(entries) * diagonal
        self._right, self._left = self.K.createVecs()
        self.assemblies += 1

    def _hold(self) -> None:
        """Keep the forces of boundary values; then rows and columns of fixed dofs become the identity's."""
        first, last = self.K.getOwnershipRange()
        dofs = np.arange(first, last, dtype=np.int32), (first + self.fixed).astype(np.int32)
        rows, fixed = (PETSc.IS().createGeneral(each, comm=self.comm) for each in dofs)
        self._coupling = self.K.createSubMatrix(rows, fixed)
        self._lift, self._lifted = self._coupling.createVecs()
        self.K.zeroRowsColumns(fixed)
        for part in (rows, fixed):
            part.destroy()

    def diagonal(self) -> np.ndarray:
        """Diagonal of K, owned degrees of freedom."""
        diagonal = self.K.getDiagonal()
        values = diagonal.array_r.copy()
        diagonal.destroy()
        return values

    def stiffness_norm(self) -> float:
        """Frobenius norm of K: to rounding the same however the mesh is shared.  Collective."""
        return self.K.norm(PETSc.NormType.FROBENIUS)

    def _free_matrices(self) -> None:
        """Free what belongs to the last stiffness.  Collective."""
        for part in ("_coupling", "_lift", "_lifted", "_right", "_left"):
            if getattr(self, part) is not None:
                getattr(self, part).destroy()
            setattr(self, part, None)

    def close(self) -> None:
        """Free everything that PETSc holds.  Collective; nothing can be solved any more."""
        self.forget_solver()
        self._free_matrices()
        if self.K is not None:
            self.K.destroy()
        self.K, self.closed = None, True

    def __del__(self):
        if not getattr(self, "closed", True) and compat.may_free_alone(self.comm):
            self.close()

    # -- unknowns ------------------------------------------------------------------------------

    def show(self, x: np.ndarray) -> None:
        """Let ``u`` have these values, the first of which are the owned ones.  Collective."""
        self.u.x.array[: self.size] = self.values(x[: self.size])
        self.u.x.scatter_forward()

    def values(self, x: np.ndarray) -> np.ndarray:
        """``u`` of owned degrees of freedom."""
        return x if self.scale is None else self.scale * x

    def taken(self, values: np.ndarray) -> np.ndarray:
        """``x`` of values of ``u``, the first of which are the owned ones."""
        values = values[: self.size].copy()
        return values if self.scale is None else values / self.scale

    def boundary_values(self) -> np.ndarray:
        """``x`` of the Dirichlet conditions' values, zero at free degrees of freedom."""
        values = np.zeros_like(self.u.x.array)
        compat.set_bc_values(values, self.bcs)
        return self.taken(values)

    def farthest(self, x: np.ndarray) -> float:
        """Largest component of a displacement, of either sign, over all ranks."""
        return self.largest(np.abs(self.displacements.rows(x)))

    def put(self, values: np.ndarray) -> None:
        """As ``show``, and let what the user makes of ``u`` follow, see ``NonlinearBody``.  Collective."""
        self.show(values)

    # -- loads and residuals -------------------------------------------------------------------

    def load(self) -> tuple[np.ndarray, np.ndarray]:
        """Boundary values and loads of this step.

        F is assembled where a constant or coefficient in it changed, else the loads are the last ones.

        Returns:
            ``b`` with ``b - K u`` the residual forces for any ``u`` that has the boundary values
            (which ``b`` holds at fixed degrees of freedom), and the external forces alone.
        """
        lift = self.boundary_values()
        if not self._all_same(same_values(self._load_parameters, self._loaded_with)):
            self._loaded_with = None
            self._external = -self.internal_force(np.zeros(self.size))
            self._loaded_with = values_of(self._load_parameters)
        external = self._external.copy()
        b = external - self.carried(lift)
        check_finite({"boundary values": lift, "loads": [external, b]}, self.comm)
        external[self.fixed] = 0.0
        b[self.fixed] = lift[self.fixed]
        return b, external

    def carried(self, motion: np.ndarray) -> np.ndarray:
        """``K d`` of a motion of supports alone, zero at fixed degrees of freedom."""
        self._lift.array_w[:] = motion[self.fixed]
        self._coupling.mult(self._lift, self._lifted)
        forces = self._lifted.array_r.copy()
        forces[self.fixed] = 0.0
        return forces

    def support_forces(self, x: np.ndarray) -> np.ndarray:
        """What the supports carry at ``x``, at fixed degrees of freedom, contact reactions left out.

        By K, of which one triangle beside the other is taken to be the same.
        """
        self._right.array_w[:] = x
        self._coupling.multTranspose(self._right, self._lift)
        return self._lift.array_r - self._external[self.fixed]

    def cancelling(self, x: np.ndarray) -> np.ndarray:
        """Size of the terms that cancel in ``K x``, ``shape=(owned dofs,)``, force units."""
        return self._row_size * np.abs(x)

    def internal_force(self, values: np.ndarray) -> np.ndarray:
        """F assembled by DOLFINx at a displacement, owned entries; ``u`` itself is left as it was."""
        kept = self.u.x.array.copy()
        try:
            self.put(values)
            compat.assemble_into(self._work.x, self._residual_form)
        finally:
            self.u.x.array[:] = kept
        residual = self._work.x.array[: self.size].copy()
        return residual if self.scale is None else self.scale * residual

    def residual(self, x: np.ndarray) -> np.ndarray:
        """F at a displacement of owned degrees of freedom, what supports carry included."""
        return self.internal_force(x)

    def multiply(self, x: np.ndarray) -> np.ndarray:
        """K x; rows and columns of fixed degrees of freedom are those of the identity."""
        self._right.array_w[:] = x
        known = None if self.loose is not None else self._elastic
        half = None if known is None else known.halved
        (self.K if half is None else half).mult(self._right, self._left)
        return self._left.array_r.copy()

    # -- solves --------------------------------------------------------------------------------

    def solve(
        self, b: np.ndarray, rough: bool = False, start: np.ndarray | None = None
    ) -> np.ndarray:
        """K^-1 b, with anchors where the body is loose; the solver is set up at the first call and kept while K stands."""
        return self._own_solver().solve(b, rough, start)

    def _own_solver(self) -> LinearSolver:
        if self._elastic is None:
            self._elastic = self.anchors.solver if self.loose else self.solver(self.K)
            if self.options is not None and not self._message:
                self._message = True
                warn_of_unread(self._elastic.unread)
        return self._elastic

    def free_state(self, b: np.ndarray, rough: bool = False) -> np.ndarray:
        """Displacement under ``b`` alone; where ``b`` is an earlier one times a factor, so is the answer.

        Args:
            b: As ``load`` returns it.
            rough: Three digits are enough, see ``linear_solver.ROUGH_TOLERANCE``; only where they are cheaper.
        """
        known = self.last_free_state
        if known is not None and known.digest.tobytes() != self._digest:
            known = None
        start = None if known is None else known.scaled(b, self.fixed, self.comm)
        if start is not None and (rough or known.exact):
            return start
        x = self.solve(b, rough, start)
        x[self.fixed] = b[self.fixed]
        exact = self._elastic.exact or not rough
        digest = np.frombuffer(self._digest, dtype=np.uint8)
        self.last_free_state = FreeState(digest, b.copy(), x.copy(), exact)
        return x

    def forget(self) -> None:
        """Assemble and set up everything anew when it is next needed."""
        self.K = self._digest = None

    def forget_solver(self) -> None:
        """Set the solver of K up anew when it is next needed.  Collective."""
        for part in filter(None, (self._elastic, self._anchors)):
            part.destroy()
        self._elastic = self._anchors = None

    @property
    def anchors(self) -> Anchors | None:
        """Springs for the soft rigid motions, None where there are none.  Collective."""
        if self._anchors is None and self.soft.shape[1] > 0:
            from dolfinx_contact.bodies.anchors import Anchors

            self._anchors = Anchors(self)
        return self._anchors

    @property
    def ksp(self):
        """The linear solver of K, for many right-hand sides at a time."""
        return self._own_solver().ksp

    @property
    def exact(self) -> bool:
        """Whether solves are exact and cheap, as with a factorisation.  Collective at first."""
        return self.ksp.getType() == "preonly"

    @property
    def _usual(self) -> dict[str, Any] | None:
        """PETSc options of the solvers of this body, None for those that a matrix of that size has by default."""
        return MULTIGRID_OPTIONS if self.options is None and self.crowded else self.options

    def solver(self, A: PETSc.Mat) -> LinearSolver:
        """The solver of another matrix on ``V`` by the options of this body."""
        return LinearSolver(A, self._usual, self.prefix, self.rigid_modes)

    def stiffened(self, S: PETSc.Mat, how: PETSc.Mat.Structure):
        """The stiffness, anchors included, plus springs ``S``, and what applies its preconditioner; GAMG's levels are those of K.

        ``how`` the entries of S lie to those of K: a PETSc ``Mat.Structure``.

        Collective.
        """
        K = self.anchors.A if self.loose else self.K
        if preconditioner(K, self._usual, self.prefix) == "gamg":
            return self._own_solver().stiffened(S, how)
        A = K.copy()
        A.axpy(1.0, S, how)
        return A, self.solver(A)

    def rigid_modes(self) -> np.ndarray:
        """Orthonormal rigid motions that vanish at fixed degrees of freedom."""
        return rigid_motion.free_modes(self)
