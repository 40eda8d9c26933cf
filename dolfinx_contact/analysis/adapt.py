# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Adaptive refinement: cells with large errors are divided, mesh after mesh, until a quantity is accurate enough."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from dolfinx import fem

from dolfinx_contact import compat
from dolfinx_contact.analysis.estimate import ESTIMATED_QUANTITIES, Estimate, estimate, largest
from dolfinx_contact.support.checks import positive
from dolfinx_contact.support.collective import agree, raised_together

if TYPE_CHECKING:
    from dolfinx.mesh import Mesh

    from dolfinx_contact.problem import ContactProblem

# Squares that differ by less, as of cells that symmetry makes equal, are divided together.
EQUAL_SQUARES = 1e-6

Pair = tuple["ContactProblem", "ContactProblem"]


class Tried(NamedTuple):
    """A mesh that ``adapt`` has tried: its number of cells, the value of the quantity, and its estimated relative error."""

    cells: int
    value: float
    error: float


@dataclass(frozen=True)
class Adapted:
    """What ``adapt`` returns.

    Attributes:
        value: The quantity in the higher-order problem on the last mesh.
        error: Estimated relative error of the lower-order problem on that mesh; conservative for ``value``.
        reached: Whether ``error`` is at most the requested one.
        problem, reference: The two problems on the last mesh, at the end of the load history.
        estimate: ``Estimate`` of all quantities on the last mesh.
        tried: A ``Tried`` for each mesh.

    Example:
        >>> dc.Adapted.__name__
        'Adapted'
    """

    value: float
    error: float
    reached: bool
    problem: ContactProblem
    reference: ContactProblem
    estimate: Estimate
    tried: tuple[Tried, ...]


def adapt(
    compute: Callable[[Any], Pair],
    mesh: Any,
    accuracy: float,
    quantity: str,
    *,
    meshes: int = 12,
    share: float = 0.5,
    quantities: Mapping[str, Callable[[ContactProblem], float]] | None = None,
) -> Adapted:
    """Refine a mesh where the error is, until a quantity is accurate enough.  Collective.

    On each mesh, ``compute`` repeats the whole load history: no state is transferred from mesh to mesh.
    ``estimate`` gives the error of the quantity and the energy norm of the difference on each cell; the cells with the largest
    norms, which together make up the part ``share`` of the sum of squares, are divided (W. Doerfler, SIAM J. Numer. Anal. 33
    (1996) 1106).  These are estimates, not bounds, and do not include the error of increments.  New boundary nodes are midpoints
    of old edges, also on a curved boundary.

    Args:
        compute: Function of a mesh that returns two problems on it, of lower and of higher order, at the end of the load history.
        mesh: Initial mesh, of triangles or tetrahedra.
        accuracy: Requested relative error of the quantity.
        quantity: Name of one of the quantities of ``estimate``, except ``pressure`` and ``shear``, or of ``quantities``.
        meshes: Largest number of meshes.
        share: Between 0 and 1; a smaller one means more meshes, each better adapted.

    Returns:
        An ``Adapted``; ``reached`` says whether the meshes sufficed.

    Raises:
        ValueError: the mesh has other cells, the quantity is unknown, a number is out of range, or the problems are not on the mesh.

    Example:
        >>> def press(cube, order):  # and all steps of the load history
        ...     V = functionspace(cube, ("Lagrange", order, (3,)))
        ...     U, ends = fem.Function(V), [mesh.locate_entities_boundary(cube, 2, lambda x: x[2] == z) for z in (0, 1)]
        ...     top = fem.dirichletbc(np.array([0, 0, -1e-3]), fem.locate_dofs_topological(V, 2, ends[1]), V)
        ...     form = ufl.inner(ufl.grad(U), ufl.grad(ufl.TestFunction(V))) * ufl.dx
        ...     made = dc.ContactProblem(form, U, [dc.Contact(V, ends[0], plane, friction)], bcs=[top])
        ...     return made.solve() and made
        >>> cube = mesh.create_unit_cube(MPI.COMM_WORLD, 2, 2, 2)
        >>> found = dc.adapt(lambda of: (press(of, 1), press(of, 2)), cube, 0.05, "normal_force")
    """
    mine = {**ESTIMATED_QUANTITIES, **(quantities or {})}
    with raised_together(mesh.comm):
        accuracy, share = positive("accuracy", accuracy, finite=True), positive("share", share)
        _check(mesh, share, quantity, mine, meshes)
    agree(mesh.comm, accuracy=accuracy, share=share, quantity=quantity, meshes=meshes)
    tried: list[Tried] = []
    while True:
        problem, reference = _pair(compute, mesh)
        found = estimate(problem, reference, quantities)
        value, error = found[quantity].value, found[quantity].relative
        tried.append(Tried(_cell_map(mesh).size_global, value, error))
        reached = error <= accuracy
        if reached or len(tried) == meshes:
            better = largest(mine[quantity](reference))
            return Adapted(better, error, reached, problem, reference, found, tuple(tried))
        mesh = compat.refined(mesh, _largest(found.cells, share))
        problem.close(), reference.close()


def _pair(compute: Callable[[Any], Pair], mesh: Any) -> Pair:
    with raised_together(mesh.comm):
        pair = compute(mesh)
    with raised_together(mesh.comm):
        if (
            not isinstance(pair, (tuple, list))
            or len(pair) != 2
            or not all(_is_on(mesh, one) for one in pair)
        ):
            raise ValueError(
                f"compute must return two ContactProblems on the mesh that it is given, of lower and of higher order, got {pair!r}."
            )
    return tuple(pair)


def _is_on(mesh: Any, problem: Any) -> bool:
    return hasattr(problem, "contacts") and problem.body.V.mesh is mesh


def _check(mesh: Mesh, share: float, quantity: str, quantities: Mapping, meshes: int) -> None:
    if mesh.topology.cell_name() not in ("triangle", "tetrahedron"):
        raise ValueError(
            f"mesh must have triangles or tetrahedra, got {mesh.topology.cell_name()}s: DOLFINx divides no other cells. "
            "dc.converge takes a list of meshes of any cells."
        )
    if share > 1:
        raise ValueError(f"share must be between 0 and 1, got {share!r}.")
    if quantity not in quantities:
        raise ValueError(f"quantity must be one of {sorted(quantities)}, got {quantity!r}.")
    if meshes < 1:
        raise ValueError(f"meshes must be at least 1, got {meshes!r}.")


def _cell_map(mesh: Any):
    return mesh.topology.index_map(mesh.topology.dim)


def _largest(cells: fem.Function, share: float) -> np.ndarray:
    """Owned cells with the largest values, which together have this part of the sum of squares of all ranks' cells."""
    comm = cells.function_space.mesh.comm
    squares = cells.x.array[: _cell_map(cells.function_space.mesh).size_local] ** 2
    falling = np.sort(np.concatenate(comm.allgather(squares)))[::-1]
    sums = np.cumsum(falling)
    least = (1 - EQUAL_SQUARES) * falling[np.searchsorted(sums, share * sums[-1])]
    return np.flatnonzero((squares >= least) & (squares > 0)).astype(np.int32)
