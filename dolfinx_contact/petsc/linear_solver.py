# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""PETSc behind two verbs: solve a linear system, and apply its preconditioner once."""

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

# Of symmetric matrices half of the factors; the ordering, PORD, leaves up to a third fewer entries than METIS, never more
# (notes/2026-11-22-condensed-speed.md).
SYMMETRIC_OPTIONS = DIRECT_OPTIONS | {"pc_type": "cholesky", "mat_mumps_icntl_7": 4}

# Of matrices that are small, or all but full, all orderings are as good, and PORD, which may find no separator in them, ends
# the process. AMD does not.
FULL_OPTIONS = SYMMETRIC_OPTIONS | {"mat_mumps_icntl_7": 0}
SMALL_SIZE = 100
DENSE_PART = 0.5

# Not PETSc's, of a matrix that is symmetric: sweeps over its lower half smooth the finest level, see ``Multigrid``.
GAUSS_SEIDEL = "mg_finest_gauss_seidel"

# Conjugate gradients with smoothed aggregation. A symmetric Gauss-Seidel sweep smooths the finest level, Chebyshev's polynomial
# with Jacobi the others, whose matrices may have rows of zeros (notes/2026-11-27-multigrid.md). Every solve starts from zero, so
# that a run continued from a checkpoint has the same bits.
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

# Workspace of MUMPS beyond its estimate, in per cent (ICNTL(14), by itself 20), once that was too little, and what it answers
# then (INFOG(1)) [MUMPS users' guide, error codes].  On several ranks the estimate does not know which of them is busy, of
# matrices that are not definite it does not know the pivots.
_MUMPS_WORKSPACES = (50, 100, 200, 400, 800)
_SHORT_OF_WORKSPACE = (-8, -9, -17, -20)

# Of a rough solve: enough to see that a body is pressed on a plane, and how hard.
ROUGH_TOLERANCE = 1e-3

# Over the largest sum of a row, an entry's difference from the one across the diagonal that is none.
_SYMMETRY_ROUNDING = 1e-14

# Unknowns beyond which multigrid is the default, by the block size of the matrix, which is the dimension; of two, factors of
# 500,000 unknowns have some 120 entries a row, and no grading of the mesh slows them down
# (notes/2026-11-27-multigrid.md).
LARGE_SIZES = {2: 500_000, 3: 50_000}

# The same of solid bodies with so many contact nodes that the fixed point is tried first, see docs/howto/large_meshes.md.
CROWDED_SIZE = 20_000


@contextmanager
def stage(name: str):
    """A stage of PETSc's ``-log_view``."""
    log = PETSc.Log.Stage(name)
    log.push()
    try:
        yield
    finally:
        log.pop()


def preconditioner(A: PETSc.Mat, options: dict[str, Any] | None, prefix: str) -> str:
    """PETSc's type of the preconditioner that a ``LinearSolver`` with these arguments has."""
    default = _options(A, options).get("pc_type", "")
    return PETSc.Options(prefix).getString("pc_type", default)


def _options(A: PETSc.Mat, options: dict[str, Any] | None) -> dict:
    """The options, or the default for a matrix of that size and dimension."""
    if options is not None:
        return options
    return (
        DIRECT_OPTIONS
        if A.getSize()[0] <= LARGE_SIZES.get(A.getBlockSize(), LARGE_SIZES[3])
        else MULTIGRID_OPTIONS
    )


def _to_factorise(A: PETSc.Mat):
    """A matrix without its zeros, which factors would fill, and the options for it.  Collective.

    Zeros are, among others, all couplings of fixed degrees of freedom.
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
    """PETSc's database with options; a list that afterwards has the names of those that PETSc did not ask for.

    They are deleted again at the end: PETSc 3.18 has room for 512.  What stands there already (PETSC_OPTIONS, the command
    line) goes before them.
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


def _petscs(options: dict) -> dict:
    """Those that are PETSc's."""
    return {key: value for key, value in options.items() if key != GAUSS_SEIDEL}


def _sweeps(options: dict, prefix: str) -> bool:
    """Whether Gauss-Seidel smooths the finest level: the options say so, and the user says nothing of smoothers."""
    database = PETSc.Options(prefix)
    of_levels = {key for key in options if key.startswith("mg_levels_")}
    message = any(
        MULTIGRID_OPTIONS.get(key) != options[key] or database.hasName(key) for key in of_levels
    )
    return bool(options.get(GAUSS_SEIDEL)) and not message


def _heed_signals(*_: object) -> None:
    """A monitor of every iteration: Python answers Ctrl-C only while it runs itself."""


def raise_interrupt(failure: BaseException) -> None:
    """Raise Ctrl-C from an error that PETSc made of it: since 3.25 what a callback raises is hidden behind one."""
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
    """The factors of a solver set up with MUMPS, a PETSc matrix that tells of them; None of any other solver."""
    pc = ksp.getPC()
    if pc.getType() not in ("lu", "cholesky") or pc.getFactorSolverType() != "mumps":
        return None
    return pc.getFactorMatrix()


def _mumps_answer(ksp: PETSc.KSP) -> int | None:
    """INFOG(1) of a factorisation by MUMPS, negative if it failed; None of any other solver."""
    factors = mumps_factors(ksp)
    return None if factors is None else factors.getMumpsInfog(1)


def check_solved(ksp: PETSc.KSP, options: dict[str, Any] | None = None) -> None:
    """Raise ``LinearSolverError`` if the last solve of a ``PETSc.KSP`` did not converge."""
    if ksp.getConvergedReason() >= 0:
        return
    answer = _mumps_answer(ksp)
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
    """A matrix and the PETSc solver that its user's options describe.

    Args:
        A: Assembled PETSc matrix.
        options: PETSc options without prefix; None takes ``SYMMETRIC`` or ``DIRECT``, or ``MULTIGRID`` if ``A`` is large.
        prefix: Prefix of the options.
        near_nullspace: Function that returns the rigid motions, ``shape=(n, 6 or 3)``, orthonormal, zero
            at fixed degrees of freedom; called only where the preconditioner is no factorisation.

    Attributes:
        unread: Names of options that PETSc did not ask for.
        levels: PETSc's preconditioner; ``ksp`` has a ``Multigrid`` on its levels instead where Gauss-Seidel smooths the finest.
        halved: The matrix there, by its lower half; else None.
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
            if _mumps_answer(self.ksp) not in _SHORT_OF_WORKSPACE:
                break
            self.ksp.reset()  # what MUMPS has analysed cannot be factorised after a failure
            self._set_up(A, prefix, options | {"mat_mumps_icntl_14": workspace})
        self.levels, self.halved, self._multigrid = self.ksp.getPC(), None, None
        gamg = self.levels.getType() == "gamg" and self.levels.getMGLevels() > 1
        if gamg and _sweeps(options, prefix):
            from dolfinx_contact.petsc.symmetric_matrix import halved

            self.halved = halved(A)
        if self.halved is not None:
            from dolfinx_contact.petsc.multigrid import Multigrid

            self._multigrid = Multigrid(self.levels, self.halved)
            self.ksp.setPC(self._multigrid.pc)
        if not self.exact:
            self.ksp.setMonitor(_heed_signals)
        self._right, self._left = A.createVecs()

    def _set_up(self, A: PETSc.Mat, prefix: str, options: dict) -> list[str]:
        """Factorise, or set up the levels; the options that PETSc did not ask for."""
        self.ksp.setOperators(A)
        with options_given(prefix, _petscs(options)) as unread:
            self.ksp.setFromOptions()
            self.ksp.setUp()  # reads the options of the levels, which must still be there
        return unread

    def stiffened(self, S: PETSc.Mat, how: PETSc.Mat.Structure) -> tuple[PETSc.Mat, Multigrid]:
        """The matrix plus springs, and multigrid for it on the levels of this solver, whose preconditioner is GAMG.

        Args:
            S: The springs alone.
            how: How their entries lie to those of the matrix.  Collective.
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
        with options_given(prefix, _petscs(self._options)):  # smoothers read them once more
            return A, Multigrid(self.levels, A, S, how)

    def destroy(self) -> None:
        """Free the factors or levels: Python's collector does not reach them (PETSc 3.18).  Collective."""
        for part in filter(None, (self.ksp, self.levels, self._multigrid, self.halved)):
            part.destroy()

    @property
    def exact(self) -> bool:
        """Whether every solve is, as with a factorisation."""
        return self.ksp.getType() == "preonly"

    def solve(
        self, b: np.ndarray, rough: bool = False, start: np.ndarray | None = None
    ) -> np.ndarray:
        """A^-1 b to the tolerance of the options; arrays of owned degrees of freedom.

        Args:
            b: Right-hand side.
            rough: ``ROUGH`` is enough.
            start: Where to start; None is zero.

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
        finally:  # others use the KSP, too, also after a solve that was interrupted
            self.ksp.setTolerances(rtol=rtol)
            self.ksp.setInitialGuessNonzero(False)
        check_solved(self.ksp, self._options)
        return self._right.array_r.copy()

    def apply(self, b: np.ndarray) -> np.ndarray:
        """The preconditioner applied once: a back-solve, or one multigrid cycle."""
        self._left.array_w[:] = b
        self.ksp.getPC().apply(self._left, self._right)
        return self._right.array_r.copy()
