# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""PETSc's linear solvers: solve a linear system, or apply its preconditioner once."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact import compat

if TYPE_CHECKING:
    from dolfinx_contact.petsc.multigrid import Multigrid

DIRECT_OPTIONS = {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}

# For symmetric matrices: half the factors. The ordering PORD leaves up to a third fewer entries
# than METIS, never more (notes/2026-11-22-condensed-speed.md).
SYMMETRIC_OPTIONS = DIRECT_OPTIONS | {"pc_type": "cholesky", "mat_mumps_icntl_7": 4}

# For symmetric matrices that are small or almost dense: PORD may find no separator in them and then
# ends the process. AMD does not, and no ordering is better for them. SMALL_SIZE is a number of
# unknowns, DENSE_PART a fraction of nonzero entries.
FULL_OPTIONS = SYMMETRIC_OPTIONS | {"mat_mumps_icntl_7": 0}
SMALL_SIZE = 100
DENSE_PART = 0.5

# Option of this package, unknown to PETSc: symmetric Gauss-Seidel smooths the finest level of a
# symmetric matrix, see ``Multigrid``.
GAUSS_SEIDEL = "mg_finest_gauss_seidel"

# Conjugate gradients with smoothed aggregation. A symmetric Gauss-Seidel sweep smooths the finest
# level. Chebyshev iteration with Jacobi smooths the other levels, whose matrices may have zero rows
# (notes/2026-11-27-multigrid.md). Every solve starts from zero, so that a run continued from a
# checkpoint is identical bit by bit.
MULTIGRID_OPTIONS = {
    "ksp_type": "cg",
    "ksp_rtol": 1e-12,
    "pc_type": "gamg",
    "pc_gamg_type": "agg",
    "pc_gamg_agg_nsmooths": 1,
    "pc_gamg_threshold": 0.01,
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 2,
    "mg_levels_pc_type": "jacobi",
    GAUSS_SEIDEL: True,
}

# Workspace of MUMPS beyond its estimate, in per cent (ICNTL(14), 20 by default), tried after a
# failure for lack of workspace; and the status INFOG(1) of such a failure [MUMPS users' guide,
# error codes]. The estimate neglects load balancing between ranks, and pivoting in indefinite
# matrices.
_MUMPS_WORKSPACES = (50, 100, 200, 400, 800)
_SHORT_OF_WORKSPACE = (-8, -9, -17, -20)

# Relative tolerance of a rough solve: enough to estimate contact pressure.
ROUGH_TOLERANCE = 1e-3

# Difference of an entry from its transposed entry, over the matrix's infinity norm, up to which the
# matrix counts as symmetric.
_SYMMETRY_ROUNDING = 1e-14

# Number of unknowns above which multigrid is the default, by block size of the matrix, which is the
# dimension. In 2-D, factors of 500,000 unknowns have about 120 entries per row, independent of the
# grading of the mesh (notes/2026-11-27-multigrid.md).
LARGE_SIZES = {2: 500_000, 3: 50_000}

# Number of unknowns above which multigrid is the default for a 3-D body with so many contact nodes
# that the fixed-point solver is tried first, see docs/howto/large_meshes.md.
CROWDED_SIZE = 20_000


@contextmanager
def stage(name: str):
    """Context manager of a named stage of PETSc's ``-log_view``."""
    log = PETSc.Log.Stage(name)
    log.push()
    try:
        yield
    finally:
        log.pop()


def preconditioner(A: PETSc.Mat, options: dict[str, Any] | None, prefix: str) -> str:
    """Return PETSc's type of the preconditioner of a ``LinearSolver`` with these arguments."""
    default = _options(A, options).get("pc_type", "")
    return PETSc.Options(prefix).getString("pc_type", default)


def _options(A: PETSc.Mat, options: dict[str, Any] | None) -> dict:
    """Return the user's options, or defaults for the size and block size of the matrix."""
    if options is not None:
        return options
    return (
        DIRECT_OPTIONS
        if A.getSize()[0] <= LARGE_SIZES.get(A.getBlockSize(), LARGE_SIZES[3])
        else MULTIGRID_OPTIONS
    )


def _to_factorise(A: PETSc.Mat):
    """Return a copy of the matrix without zero entries, and the options to factorise it.
    Collective.

    Factors would fill zero entries.  Among them are all couplings of fixed degrees of freedom.
    """
    symmetric = A.isSymmetric(_SYMMETRY_ROUNDING * A.norm(PETSc.NormType.INFINITY))
    starts, columns, values = A.getValuesCSR()
    rows = sparse.csr_matrix((values, columns, starts), (len(starts) - 1, A.getSize()[1]))
    rows.eliminate_zeros()
    csr = rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data
    A = PETSc.Mat().createAIJ(A.getSizes(), csr=csr, comm=A.comm)
    if not symmetric:
        return A, DIRECT_OPTIONS
    n, entries = A.getSize()[0], A.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]
    return A, FULL_OPTIONS if n <= SMALL_SIZE or entries > DENSE_PART * n**2 else SYMMETRIC_OPTIONS


@contextmanager
def options_given(prefix: str, options: dict):
    """Context manager that sets PETSc options and yields a list for the names of unread ones.

    The list is filled at the end of the block.  The options are then deleted, because PETSc 3.18
    has room for 512.  Options already in the database (PETSC_OPTIONS, the command line) have
    precedence.
    """
    database, unread = PETSc.Options(prefix), []
    ours = {key: value for key, value in options.items() if not database.hasName(key)}
    for key, value in ours.items():
        database[key] = value
    try:
        yield unread
        unread += [key for key in ours if not compat.option_was_read(f"{prefix}{key}")]
    finally:
        for key in ours:
            del database[key]


def _petsc_options(options: dict) -> dict:
    """Return the options that PETSc itself knows."""
    return {key: value for key, value in options.items() if key != GAUSS_SEIDEL}


def _uses_gauss_seidel(options: dict, prefix: str) -> bool:
    """Whether Gauss-Seidel smooths the finest level.

    The options must request it, and the user must not set other smoothers.
    """
    database = PETSc.Options(prefix)
    of_levels = {key for key in options if key.startswith("mg_levels_")}
    chosen = any(
        MULTIGRID_OPTIONS.get(key) != options[key] or database.hasName(key) for key in of_levels
    )
    return bool(options.get(GAUSS_SEIDEL)) and not chosen


def _process_signals(*_: object) -> None:
    """KSP monitor without effect: while Python runs it, Ctrl-C is processed."""


def raise_interrupt(failure: BaseException) -> None:
    """Raise the ``KeyboardInterrupt`` that PETSc has converted to an error, if there is one.

    Since PETSc 3.25, an exception in a callback is the cause of a PETSc error.
    """
    cause = failure.__cause__ if isinstance(failure, PETSc.Error) else None
    if isinstance(cause, KeyboardInterrupt):
        raise cause


class LinearSolverError(RuntimeError):
    """PETSc's linear solver did not converge; the message has PETSc's reason and the options.

    Example:
        >>> try:
        ...     step = problem.solve()
        ... except dc.LinearSolverError as failure:
        ...     print(failure)
    """


def mumps_factors(ksp: PETSc.KSP):
    """Return the MUMPS factors of a solver, a PETSc matrix, or None for any other solver."""
    pc = ksp.getPC()
    if pc.getType() not in ("lu", "cholesky") or pc.getFactorSolverType() != "mumps":
        return None
    return pc.getFactorMatrix()


def _mumps_status(ksp: PETSc.KSP) -> int | None:
    """Return the status INFOG(1) of a MUMPS factorisation, or None for any other solver.

    A negative status means failure.
    """
    factors = mumps_factors(ksp)
    return None if factors is None else factors.getMumpsInfog(1)


def check_solved(ksp: PETSc.KSP, options: dict[str, Any] | None = None) -> None:
    """Raise ``LinearSolverError`` if the last solve of a ``PETSc.KSP`` did not converge."""
    if ksp.getConvergedReason() >= 0:
        return
    answer = _mumps_status(ksp)
    mumps = "" if answer is None else f", MUMPS with INFOG(1) = {answer}"
    given = "" if options is None else f"; options {options}"
    direct = ksp.getType() == "preonly"
    raise LinearSolverError(
        f"PETSc's linear solver failed (KSPConvergedReason {ksp.getConvergedReason()}) after {ksp.getIterationNumber()} "
        f"iterations{mumps}{given}."
        + (
            ""
            if direct
            else f" A factorisation needs no iteration: petsc_options={DIRECT_OPTIONS}."
        )
    )


class LinearSolver:
    """A matrix and its PETSc solver.

    Args:
        A: Assembled PETSc matrix.
        options: PETSc options without prefix.  None means ``SYMMETRIC_OPTIONS``, ``FULL_OPTIONS``
            or ``DIRECT_OPTIONS``, or ``MULTIGRID_OPTIONS`` if ``A`` is large.
        prefix: Prefix of the options.
        near_nullspace: Function that returns the rigid-body modes, ``shape=(n, 6 or 3)``,
            orthonormal, zero at fixed degrees of freedom.  It is called only if the preconditioner
            is not a factorisation.

    Attributes:
        unread: Names of options that PETSc did not read.
        levels: PETSc's preconditioner.  If Gauss-Seidel smooths the finest level, ``ksp`` uses a
            ``Multigrid`` with the levels of this preconditioner instead.
        halved: The matrix stored by its lower half if Gauss-Seidel smooths the finest level; else
            None.
    """

    def __init__(
        self,
        A: PETSc.Mat,
        options: dict[str, Any] | None,
        prefix: str,
        near_nullspace: Callable[[], np.ndarray] | None,
    ):
        given, options = options, _options(A, options)
        if given is None and options is DIRECT_OPTIONS:
            A, options = _to_factorise(A)
        self._options = options
        self.ksp = PETSc.KSP().create(A.comm)
        self.ksp.setOptionsPrefix(prefix)
        if options.get("pc_type") not in ("lu", "cholesky"):
            vectors = []
            for mode in near_nullspace().T:
                vectors.append(A.createVecRight())
                vectors[-1].array_w[:] = mode
            A.setNearNullSpace(PETSc.NullSpace().create(vectors=vectors, comm=A.comm))
        self.unread = self._set_up(A, prefix, options)
        for workspace in _MUMPS_WORKSPACES:
            if _mumps_status(self.ksp) not in _SHORT_OF_WORKSPACE:
                break
            self.ksp.reset()  # after a failure, MUMPS cannot reuse its analysis
            self._set_up(A, prefix, options | {"mat_mumps_icntl_14": workspace})
        self.levels, self.halved, self._multigrid = self.ksp.getPC(), None, None
        gamg = self.levels.getType() == "gamg" and self.levels.getMGLevels() > 1
        if gamg and _uses_gauss_seidel(options, prefix):
            from dolfinx_contact.petsc.symmetric_matrix import halved

            self.halved = halved(A)
        if self.halved is not None:
            from dolfinx_contact.petsc.multigrid import Multigrid

            self._multigrid = Multigrid(self.levels, self.halved)
            self.ksp.setPC(self._multigrid.pc)
        if not self.exact:
            self.ksp.setMonitor(_process_signals)
        self._right, self._left = A.createVecs()

    def _set_up(self, A: PETSc.Mat, prefix: str, options: dict) -> list[str]:
        """Factorise or set up multigrid levels, and return names of options unread by PETSc."""
        self.ksp.setOperators(A)
        with options_given(prefix, _petsc_options(options)) as unread:
            self.ksp.setFromOptions()
            self.ksp.setUp()  # reads the options of the levels, which must still be there
        return unread

    def stiffened(self, S: PETSc.Mat, how: PETSc.Mat.Structure) -> tuple[PETSc.Mat, Multigrid]:
        """Return the matrix plus springs, and multigrid for the sum on the levels of this solver.
        Collective.

        The preconditioner of this solver must be GAMG.

        Args:
            S: Matrix of the springs.
            how: PETSc ``Mat.Structure``: relation of the nonzero pattern of ``S`` to the pattern of
                the matrix.
        """
        from dolfinx_contact.petsc.multigrid import Multigrid
        from dolfinx_contact.petsc.symmetric_matrix import halved, plus

        A = None if self.halved is None else plus(self.halved, S)
        if A is None:
            A = self.levels.getOperators()[1].copy()
            A.axpy(1.0, S, how)
            half = None if self.halved is None else halved(A)
            if half is not None:
                A.destroy()
                A = half
        prefix = self.ksp.getOptionsPrefix()
        with options_given(prefix, _petsc_options(self._options)):  # smoothers read them again
            return A, Multigrid(self.levels, A, S, how)

    def destroy(self) -> None:
        """Free the factors or multigrid levels.  Collective.

        Python's garbage collector does not free them (PETSc 3.18).
        """
        for part in filter(None, (self.ksp, self.levels, self._multigrid, self.halved)):
            part.destroy()

    @property
    def exact(self) -> bool:
        """Whether the solver is direct, a factorisation."""
        return self.ksp.getType() == "preonly"

    def solve(
        self, b: np.ndarray, rough: bool = False, start: np.ndarray | None = None
    ) -> np.ndarray:
        """Return ``A^-1 b`` to the tolerance of the options; arrays of owned degrees of freedom.

        Args:
            b: Right-hand side.
            rough: Whether the relative tolerance ``ROUGH_TOLERANCE`` is enough.
            start: Initial guess; None means zero.

        Raises:
            LinearSolverError: PETSc did not converge.
        """
        self._left.array_w[:] = b
        if start is not None:
            self._right.array_w[:] = start
        self.ksp.setInitialGuessNonzero(start is not None)
        rtol = self.ksp.getTolerances()[0]
        self.ksp.setTolerances(rtol=max(rtol, ROUGH_TOLERANCE) if rough else rtol)
        try:
            self.ksp.solve(self._left, self._right)
        finally:  # other code uses this KSP too, even after an interrupted solve
            self.ksp.setTolerances(rtol=rtol)
            self.ksp.setInitialGuessNonzero(False)
        check_solved(self.ksp, self._options)
        return self._right.array_r.copy()

    def apply(self, b: np.ndarray) -> np.ndarray:
        """Return the preconditioner applied once to ``b``: a back-solve or a multigrid cycle."""
        self._left.array_w[:] = b
        self.ksp.getPC().apply(self._left, self._right)
        return self._right.array_r.copy()
