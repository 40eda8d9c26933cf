# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The elastic body: assembled by DOLFINx, solved by PETSc.

Vectors are NumPy arrays of the degrees of freedom of this rank.
"""

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
    check_diagonal,
    check_dilation,
    check_finite,
    check_same_values,
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
    """Contact-free displacement under a load; arrays of owned degrees of freedom."""

    digest: np.ndarray  # hash of the stiffness
    load: np.ndarray  # right-hand side
    displacement: np.ndarray
    exact: bool  # False if it is accurate to three digits only

    def scaled(self, b: np.ndarray, fixed: np.ndarray, comm: MPI.Comm) -> np.ndarray | None:
        """Return the displacement under ``b`` if ``b`` is a multiple of the stored load, else None.
        Collective.

        Args:
            b: Right-hand side, as ``ElasticBody.load`` returns it.
            fixed: Fixed degrees of freedom, at which ``b`` contains boundary values.
            comm: MPI communicator.
        """
        asked_again = comm.allreduce(np.array_equal(b, self.load), op=MPI.LAND)
        if asked_again:  # the same load, within a step
            return self.displacement.copy()
        factor = max(comm.allgather(_ratio(b, self.load)))[1]
        sizes = np.abs([b - factor * self.load, b])
        # Forces and boundary values have different units: each has its own rounding error.
        given = sizes[:, fixed]
        sizes[:, fixed] = 0.0
        largest = np.array([part.max(axis=1, initial=0.0) for part in (given, sizes)])
        comm.Allreduce(MPI.IN_PLACE, largest, op=MPI.MAX)
        same = (largest[:, 0] <= 16 * np.finfo(float).eps * largest[:, 1]).all()
        return factor * self.displacement if same else None


def _ratio(b: np.ndarray, last: np.ndarray) -> tuple[float, float]:
    """Return the largest magnitude in ``last``, and the ratio of ``b`` to ``last`` there."""
    if not last.any():
        return 0.0, 0.0
    k = np.abs(last).argmax()
    return abs(last[k]), b[k] / last[k]


class ElasticBody(OverRanks):
    """A body with residual ``F(u) = K u - f``, linear in u, with Dirichlet conditions.

    Vectors are ``x`` and ``D F`` with ``u = D x``, see ``bodies/unknowns.py``.  If displacements
    are the only unknowns, ``D`` is the identity.

    Args:
        F: Residual form, linear in ``u``.
        u: Displacement.
        bcs: Dirichlet conditions.  Their values may change between steps; ``support`` replaces
            them.
        derivative: Derivative of ``F``, as ``derivative_of`` returns it.
        options: PETSc options of the solver.  By default a factorisation by MUMPS, for large bodies
            conjugate gradients with multigrid, see ``linear_solver.py``.
        prefix: Prefix of the PETSc options.
        displacements: ``Displacements`` of the body; None creates them.
        form_options: Options to compile the forms, see ``compat.compiled``.
    """

    K: Any  # PETSc matrix of the stiffness, None before the first step
    soft: np.ndarray  # rigid-body modes with little strain energy, (owned dofs, m)
    nonlinear = False  # whether F is nonlinear in u, see ``NonlinearBody``
    loose: LooseMotions | None = None  # rigid-body modes without strain energy, None without any
    multigrid_is_faster = False  # whether multigrid is the default because of many contact nodes
    scale: np.ndarray | None = None  # D, (owned dofs,); None if it is one, or before assembly

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
        compat.free_garbage(self.comm)  # of bodies that were not closed
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
        self._digest: bytes | None = None  # hash of the assembled stiffness
        self._assembled_with, self._loaded_with = None, None  # parameters of stiffness and loads
        self.assemblies = 0
        self.K, self._external, self._elastic, self._anchors = None, None, None, None
        self._coupling = self._lift = self._lifted = self._right = self._left = None
        self.closed = self._warned = False
        self.last_free_state: FreeState | None = None
        self.extent, self.thickness = rigid_motion.extents(self.displacements)
        self.parts = rigid_motion.connected_parts(self.displacements)

    def support(self, bcs: Sequence[Any]) -> None:
        """Replace the Dirichlet conditions; the next ``refresh`` imposes them on the stiffness."""
        self.bcs = list(bcs)
        fixed = [compat.bc_dofs(bc, self.size) for bc in self.bcs]
        self.fixed = np.unique(np.concatenate([np.zeros(0, dtype=np.int32), *fixed]))

    def refresh(self, x: np.ndarray | None = None) -> int:
        """Assemble the stiffness if a constant, a coefficient or the set of fixed dofs has changed.
        Collective.

        Args:
            x: Last converged displacement; not used here.

        Returns:
            Number of assemblies so far, which identifies the matrix.
        """
        given = *self._parameters, *self._load_parameters, *compat.bc_constants(self.bcs)
        check_same_values(given, self.comm)
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
        """Whether a flag is true on all ranks.  Collective."""
        return self.comm.allreduce(bool(same), op=MPI.LAND)

    def _assemble(self) -> None:
        """Assemble the stiffness without Dirichlet conditions.  Collective."""
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
        # Rounding error of a row of K u: a sum of terms of random sign, one for each entry.
        entries = self.K.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"] / self.K.getSize()[0]
        self._row_size = np.sqrt(entries) * diagonal
        self._right, self._left = self.K.createVecs()
        self.assemblies += 1

    def _hold(self) -> None:
        """Impose Dirichlet conditions: set rows and columns of fixed dofs to those of the identity.

        The columns are kept, to compute forces by boundary values and support forces.
        """
        first, last = self.K.getOwnershipRange()
        dofs = np.arange(first, last, dtype=np.int32), (first + self.fixed).astype(np.int32)
        rows, fixed = (PETSc.IS().createGeneral(each, comm=self.comm) for each in dofs)
        self._coupling = self.K.createSubMatrix(rows, fixed)
        self._lift, self._lifted = self._coupling.createVecs()
        self.K.zeroRowsColumns(fixed)
        for part in (rows, fixed):
            part.destroy()

    def diagonal(self) -> np.ndarray:
        """Diagonal of ``K``, owned degrees of freedom."""
        diagonal = self.K.getDiagonal()
        values = diagonal.array_r.copy()
        diagonal.destroy()
        return values

    def stiffness_norm(self) -> float:
        """Frobenius norm of ``K``, independent of the partition of the mesh up to rounding.
        Collective.
        """
        return self.K.norm(PETSc.NormType.FROBENIUS)

    def _free_matrices(self) -> None:
        """Free the PETSc objects that belong to the last stiffness.  Collective."""
        for part in ("_coupling", "_lift", "_lifted", "_right", "_left"):
            if getattr(self, part) is not None:
                getattr(self, part).destroy()
            setattr(self, part, None)

    def close(self) -> None:
        """Free all PETSc objects; the body cannot be solved afterwards.  Collective."""
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
        """Set ``u`` from the unknowns ``x`` and update its ghosts.  Collective.

        Args:
            x: Unknowns, owned degrees of freedom first; ghosts are ignored.
        """
        self.u.x.array[: self.size] = self.values(x[: self.size])
        self.u.x.scatter_forward()

    def values(self, x: np.ndarray) -> np.ndarray:
        """Return values of ``u``, ``D x``, from unknowns ``x``, owned degrees of freedom."""
        return x if self.scale is None else self.scale * x

    def taken(self, values: np.ndarray) -> np.ndarray:
        """Return unknowns ``x = D^-1 u`` from values of ``u``, owned degrees of freedom.

        Args:
            values: Values of ``u``, owned degrees of freedom first; ghosts are ignored.
        """
        values = values[: self.size].copy()
        return values if self.scale is None else values / self.scale

    def boundary_values(self) -> np.ndarray:
        """Return unknowns prescribed by Dirichlet conditions, zero at free degrees of freedom."""
        values = np.zeros_like(self.u.x.array)
        compat.set_bc_values(values, self.bcs)
        return self.taken(values)

    def farthest(self, x: np.ndarray) -> float:
        """Return the largest magnitude of a displacement component over all ranks.  Collective."""
        return self.largest(np.abs(self.displacements.rows(x)))

    def put(self, values: np.ndarray) -> None:
        """Set ``u`` from the unknowns, and update the user's fields that depend on it.  Collective.

        Only a ``NonlinearBody`` has such fields.
        """
        self.show(values)

    # -- loads and residuals -------------------------------------------------------------------

    def load(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the right-hand side ``b`` with boundary values, and the external forces.
        Collective.

        F is assembled only if a constant or coefficient in it has changed.

        Returns:
            ``b``, so that ``b - K u`` is the residual for any ``u`` with the boundary values, which
            ``b`` contains at fixed degrees of freedom; and the external forces, zero at fixed
            degrees of freedom.
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
        """Return ``K d`` for a displacement ``d`` of the supports alone, zero at fixed dofs."""
        self._lift.array_w[:] = motion[self.fixed]
        self._coupling.mult(self._lift, self._lifted)
        forces = self._lifted.array_r.copy()
        forces[self.fixed] = 0.0
        return forces

    def support_forces(self, x: np.ndarray) -> np.ndarray:
        """Return support forces at ``x`` without contact reactions, at fixed degrees of freedom.

        ``K`` is assumed to be symmetric: its stored columns are used as rows.
        """
        self._right.array_w[:] = x
        self._coupling.multTranspose(self._right, self._lift)
        return self._lift.array_r - self._external[self.fixed]

    def cancelling(self, x: np.ndarray) -> np.ndarray:
        """Estimate the magnitude of the terms that cancel in ``K x``, ``shape=(owned dofs,)``."""
        return self._row_size * np.abs(x)

    def internal_force(self, values: np.ndarray) -> np.ndarray:
        """Return F assembled at a displacement, owned entries; ``u`` is restored afterwards."""
        kept = self.u.x.array.copy()
        try:
            self.put(values)
            compat.assemble_into(self._work.x, self._residual_form)
        finally:
            self.u.x.array[:] = kept
        residual = self._work.x.array[: self.size].copy()
        return residual if self.scale is None else self.scale * residual

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Return F at the unknowns ``x``, support forces included, owned degrees of freedom."""
        return self.internal_force(x)

    def multiply(self, x: np.ndarray) -> np.ndarray:
        """Return ``K x``, with rows and columns of the identity for fixed degrees of freedom."""
        self._right.array_w[:] = x
        known = None if self.loose is not None else self._elastic
        half = None if known is None else known.halved
        (self.K if half is None else half).mult(self._right, self._left)
        return self._left.array_r.copy()

    # -- solves --------------------------------------------------------------------------------

    def solve(
        self, b: np.ndarray, rough: bool = False, start: np.ndarray | None = None
    ) -> np.ndarray:
        """Return ``K^-1 b``; for a body with loose motions, ``A^-1 b`` with regularisation springs.

        The solver is set up at the first call and kept until ``K`` changes.

        Args:
            b: Right-hand side, owned degrees of freedom.
            rough: Whether three digits are enough.
            start: Initial guess; None means zero.
        """
        return self._own_solver().solve(b, rough, start)

    def _own_solver(self) -> LinearSolver:
        if self._elastic is None:
            self._elastic = self.anchors.solver if self.loose else self.solver(self.K)
            if self.options is not None and not self._warned:
                self._warned = True
                warn_of_unread(self._elastic.unread)
        return self._elastic

    def free_state(self, b: np.ndarray, rough: bool = False) -> np.ndarray:
        """Return the contact-free displacement under ``b``, owned degrees of freedom.

        If ``b`` is a multiple of the last right-hand side, the last solution is scaled.

        Args:
            b: Right-hand side, as ``load`` returns it.
            rough: Whether three digits are enough, see ``linear_solver.ROUGH_TOLERANCE``; used only
                with iterative solvers.
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
        """Discard the stiffness: the next ``refresh`` assembles it and sets up its solver again."""
        self.K = self._digest = None

    def forget_solver(self) -> None:
        """Discard the solver of ``K``; the next solve sets it up again.  Collective."""
        for part in filter(None, (self._elastic, self._anchors)):
            part.destroy()
        self._elastic = self._anchors = None

    @property
    def anchors(self) -> Anchors | None:
        """Regularisation springs for the soft rigid motions; None if there are none.
        Collective.
        """
        if self._anchors is None and self.soft.shape[1] > 0:
            from dolfinx_contact.bodies.anchors import Anchors

            self._anchors = Anchors(self)
        return self._anchors

    @property
    def ksp(self):
        """PETSc KSP of ``K``, for many right-hand sides at a time."""
        return self._own_solver().ksp

    @property
    def exact(self) -> bool:
        """Whether linear systems are solved by factorisation, exactly and cheaply.

        Collective at the first call, which sets up the solver.
        """
        return self.ksp.getType() == "preonly"

    @property
    def _solver_options(self) -> dict[str, Any] | None:
        """PETSc options for this body's linear systems; None means defaults by matrix size."""
        return (
            MULTIGRID_OPTIONS if self.options is None and self.multigrid_is_faster else self.options
        )

    def solver(self, A: PETSc.Mat) -> LinearSolver:
        """Return a ``LinearSolver`` of another matrix on ``V``, with this body's PETSc options."""
        return LinearSolver(A, self._solver_options, self.prefix, self.rigid_modes)

    def stiffened(self, S: PETSc.Mat, how: PETSc.Mat.Structure):
        """Return the stiffness plus springs, and a preconditioner of the sum.  Collective.

        Regularisation springs are included.  With GAMG, the preconditioner uses the levels of
        ``K``.

        Args:
            S: Matrix of the springs.
            how: PETSc ``Mat.Structure``: relation of the nonzero pattern of ``S`` to the pattern of
                ``K``.
        """
        K = self.anchors.A if self.loose else self.K
        if preconditioner(K, self._solver_options, self.prefix) == "gamg":
            return self._own_solver().stiffened(S, how)
        A = K.copy()
        A.axpy(1.0, S, how)
        return A, self.solver(A)

    def rigid_modes(self) -> np.ndarray:
        """Return orthonormal rigid-body modes, ``shape=(owned dofs, m)``, zero at fixed dofs."""
        return rigid_motion.free_modes(self)
