"""
Kernel of dolfinx_contact: friction law, cone and maps on NumPy arrays.

Local frame (t1, t2, n), or (t, n) in two dimensions. r, tau: (n, dim); gap, rho:
(n,); slip: (n, dim - 1); branch: uint8, 0 open, 1 stick, 2 slip. All float64 of any
strides, read in place.
"""

from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
import typing_extensions

__all__: list[str] = [
    "CondensedAttempt",
    "CondensedOperator",
    "CondensedSolution",
    "Law2D",
    "Law3D",
    "SymmetricBlocks",
    "clip",
    "instruction_sets",
    "make_law",
    "mortar_rows",
    "stubs",
]

class Law2D:
    def bipotential_gap(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        Gap of the bi-potential for r in the cone and gap >= 0, shape (n,)
        """
    def bipotential_jacobian(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.uint8],
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.float64],
    ]:
        """
        bipotential_map and its derivatives: (r, branch, by r, by (slip, gap))
        """
    def bipotential_map(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint8]]:
        """
        Predictor and corrector of [dSFMH07, Section 2]: (r, branch)
        """
    def load_function(
        self, r: numpy.typing.NDArray[numpy.float64]
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        f = |M^-1 r_t| - r_n, shape (n,)  [dSFMH07, Eq. (1)]
        """
    def project(
        self, tau: numpy.typing.NDArray[numpy.float64]
    ) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint8]]:
        """
        Euclidean projection on the friction cone: (r, branch)  [dSFMH07, Section 2]
        """
    def return_jacobian(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho_n: numpy.typing.NDArray[numpy.float64],
        rho_t: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.uint8],
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.float64],
    ]:
        """
        return_map and its derivatives: (r, branch, by r, by (slip, gap))
        """
    def return_map(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho_n: numpy.typing.NDArray[numpy.float64],
        rho_t: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint8]]:
        """
        Projection in the metric of the slip rule: (r, branch)
        """
    def scaled_jacobian(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.uint8],
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.float64],
    ]:
        """
        scaled_map and its derivatives: (r, branch, by r, by (slip, gap))
        """
    def scaled_map(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint8]]:
        """
        The same in scaled variables, in closed form: (r, branch)
        """
    def slip_defect(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        branch: numpy.typing.NDArray[numpy.uint8],
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        Part of the slip increment that the slip rule does not explain, (n, dim - 1)
        """
    @property
    def dim(self) -> int: ...
    @property
    def kind(self) -> str: ...
    @property
    def nodes(self) -> int | None:
        """
        Number of nodes it has coefficients for, or None.
        """

class Law3D:
    def bipotential_gap(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        Gap of the bi-potential for r in the cone and gap >= 0, shape (n,)
        """
    def bipotential_jacobian(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.uint8],
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.float64],
    ]:
        """
        bipotential_map and its derivatives: (r, branch, by r, by (slip, gap))
        """
    def bipotential_map(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint8]]:
        """
        Predictor and corrector of [dSFMH07, Section 2]: (r, branch)
        """
    def load_function(
        self, r: numpy.typing.NDArray[numpy.float64]
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        f = |M^-1 r_t| - r_n, shape (n,)  [dSFMH07, Eq. (1)]
        """
    def project(
        self, tau: numpy.typing.NDArray[numpy.float64]
    ) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint8]]:
        """
        Euclidean projection on the friction cone: (r, branch)  [dSFMH07, Section 2]
        """
    def return_jacobian(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho_n: numpy.typing.NDArray[numpy.float64],
        rho_t: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.uint8],
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.float64],
    ]:
        """
        return_map and its derivatives: (r, branch, by r, by (slip, gap))
        """
    def return_map(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho_n: numpy.typing.NDArray[numpy.float64],
        rho_t: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint8]]:
        """
        Projection in the metric of the slip rule: (r, branch)
        """
    def scaled_jacobian(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.uint8],
        numpy.typing.NDArray[numpy.float64],
        numpy.typing.NDArray[numpy.float64],
    ]:
        """
        scaled_map and its derivatives: (r, branch, by r, by (slip, gap))
        """
    def scaled_map(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        gap: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        rho: numpy.typing.NDArray[numpy.float64],
    ) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint8]]:
        """
        The same in scaled variables, in closed form: (r, branch)
        """
    def slip_defect(
        self,
        r: numpy.typing.NDArray[numpy.float64],
        slip: numpy.typing.NDArray[numpy.float64],
        branch: numpy.typing.NDArray[numpy.uint8],
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        Part of the slip increment that the slip rule does not explain, (n, dim - 1)
        """
    @property
    def dim(self) -> int: ...
    @property
    def kind(self) -> str: ...
    @property
    def nodes(self) -> int | None:
        """
        Number of nodes it has coefficients for, or None.
        """

class CondensedAttempt:
    @property
    def branch(self) -> str: ...
    @property
    def converged(self) -> bool: ...
    @property
    def error(self) -> float: ...
    @property
    def iterations(self) -> int: ...
    @property
    def seconds(self) -> float: ...
    @property
    def slip_error(self) -> float: ...

class CondensedSolution:
    @property
    def branch(self) -> str: ...
    @property
    def change(self) -> float: ...
    @property
    def converged(self) -> bool: ...
    @property
    def displacement(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def error(self) -> float: ...
    @property
    def iterations(self) -> int: ...
    @property
    def local_error(self) -> float: ...
    @property
    def reaction(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def rounding(self) -> float: ...
    @property
    def seconds(self) -> float: ...
    @property
    def slip_error(self) -> float: ...
    @property
    def status(self) -> numpy.typing.NDArray[numpy.uint8]: ...
    @property
    def tied(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def tried(self) -> list[CondensedAttempt]: ...

class CondensedOperator:
    def __init__(
        self,
        W: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        dim: typing.SupportsInt | typing.SupportsIndex,
        tied: typing.SupportsInt | typing.SupportsIndex = 0,
        algebra: typing_extensions.CapsuleType | None = None,
    ) -> None: ...
    def prepare(self) -> bool: ...
    def solve(
        self,
        mu: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        p: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None,
        q: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        starts: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]],
        tol: typing.SupportsFloat | typing.SupportsIndex,
        slip_tol: typing.SupportsFloat | typing.SupportsIndex,
        stiffness: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        tangential_stiffness: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        tied_stiffness: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        external: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        local_tol: typing.SupportsFloat | typing.SupportsIndex = ...,
        max_seconds: typing.SupportsFloat | typing.SupportsIndex = ...,
        max_iterations: typing.SupportsInt | typing.SupportsIndex = 200000,
        newton_iterations: typing.SupportsInt | typing.SupportsIndex = 60,
        fallbacks: bool = True,
        without: collections.abc.Sequence[str] = [],
        monitor: collections.abc.Callable[
            [float, typing.Annotated[list[int], "FixedSize(3)"]], None
        ]
        | None = None,
    ) -> CondensedSolution: ...
    @property
    def dim(self) -> int: ...
    @property
    def nodes(self) -> int: ...
    @property
    def tied(self) -> int: ...

class SymmetricBlocks:
    """
    A symmetric matrix by its lower half, in blocks of up to 3 rows; those above the diagonal are not used.
    """
    def __init__(
        self,
        starts: typing.Annotated[numpy.typing.ArrayLike, numpy.int32],
        columns: typing.Annotated[numpy.typing.ArrayLike, numpy.int32],
        values: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        size: typing.SupportsInt | typing.SupportsIndex,
    ) -> None:
        """
        From rows of entries: starts of shape (rows * size + 1,), columns and values (m,).
        """
    def diagonal(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The diagonal, shape (rows * size,).
        """
    def multiply(
        self, x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        A x, shape (rows * size,).
        """
    def plus(
        self, blocks: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]
    ) -> SymmetricBlocks:
        """
        The matrix with blocks of shape (rows, size, size) added to those of its diagonal; what is below takes no memory twice.
        """
    def sweep(
        self, b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        x of a symmetric Gauss-Seidel sweep for A x = b from zero, shape (rows * size,).
        """

def clip(
    polygons: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    by: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32]]:
    """
    The common parts of pairs of convex polygons, corners in order, shape (n, k, 2) with k at most 4: (corners of shape (n, k + m, 2), how many of them count of shape (n,)), zero where there is no area.
    """

def instruction_sets() -> list[str]:
    """
    What this processor can run beyond what every one can, the widest first: _algebra_avx512, _algebra_avx2.
    """

def make_law(
    mu: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    p: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None,
    dim: typing.SupportsInt | typing.SupportsIndex,
    axes: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
) -> typing.Any:
    """
    The simplest law with coefficients mu and p of shape (dim-1,) or (n, dim-1). p None: associated. axes: principal direction x (cos, sin) of each node, shape (n, 2).
    """

def mortar_rows(
    slaves: list, masters: list, count: typing.SupportsInt | typing.SupportsIndex, rules: list
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
    numpy.typing.NDArray[numpy.int32],
]:
    """
    Rows of a dual mortar method: (int N_a over the covered part, shape (count,), over all of it, and int psi_a N_b, values, columns and starts of rows). Sides are lists of facets of one shape each, (x of shape (m, k, dim), outward normals (m, dim), nodes on the reference facet (k, dim - 1), coefficients of the shape functions (k, k), a row for each monomial, density of the measure (m, k) or empty, rows or columns of the nodes (m, k), negative is none, nodes at the corners of each straight piece (parts, c), degree); rules are (points, weights) on the unit interval, with ever more points for quadrilaterals that are no parallelograms.
    """

def stubs() -> str:
    """
    SHA-256 of the type stubs that it was compiled with.
    """
