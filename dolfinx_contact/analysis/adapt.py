# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Adaptive mesh refinement until the estimated error of a quantity is below a tolerance."""

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

# Relative difference below which two squared cell errors count as equal.  Cells that are equal by
# symmetry are then refined together, in spite of rounding.
EQUAL_SQUARES = 1e-6

Pair = tuple["ContactProblem", "ContactProblem"]


class Tried(NamedTuple):
    """Result of ``adapt`` on one mesh.

    Attributes:
        cells: Number of cells of the mesh.
        value: Value of the quantity in the lower-order problem.
        error: Estimated relative error of the value.
    """

    cells: int
    value: float
    error: float


@dataclass(frozen=True)
class Adapted:
    """Result of ``adapt``: a quantity, its estimated error, and the problems on the last mesh.

    Attributes:
        value: Value of the quantity in the higher-order problem on the last mesh.
        error: Estimated relative error of the lower-order problem on the last mesh; conservative
            for ``value``.
        reached: Whether ``error`` is at most the requested relative error.
        problem, reference: The lower-order and the higher-order problem on the last mesh, at the
            end of the load history.
        estimate: ``Estimate`` of all quantities on the last mesh.
        tried: Number of cells, value and error for each mesh, as ``Tried``.

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
    """Refine cells with large errors until a quantity has the requested accuracy.  Collective.

    On each mesh, ``compute`` solves the whole load history: no state is transferred between meshes.
    ``estimate`` gives the error of the quantity, and an error indicator for each cell: the energy
    norm of the difference between the two problems.  The cells with the largest indicators are
    refined (Doerfler marking): their squares make up the fraction ``share`` of the sum of squares
    (W. Doerfler, SIAM J. Numer. Anal. 33 (1996) 1106).  The errors are estimates, not bounds, and
    do not include the error caused by finite load increments.  New boundary nodes are midpoints of
    edges of the coarser mesh, also on a curved boundary.

    Args:
        compute: Function of a mesh.  It returns two problems on this mesh at the end of the load
            history: first the problem of lower order, then the problem of higher order.
        mesh: Initial mesh of triangles or tetrahedra.
        accuracy: Requested relative error of the quantity.
        quantity: Name of a quantity, built in (see ``estimate``; not ``pressure`` or ``shear``) or
            from ``quantities``.
        meshes: Largest number of meshes.
        share: Fraction of the squared error on the refined cells, greater than 0 and at most 1.  A
            smaller fraction leads to more meshes, each better adapted.
        quantities: Further quantities: functions of a problem, by name (see ``estimate``).

    Returns:
        An ``Adapted``; its attribute ``reached`` is True if the requested accuracy was reached.

    Raises:
        ValueError: the cells are neither triangles nor tetrahedra, the quantity is unknown, a
            number is out of range, or ``compute`` does not return two problems on the mesh.

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
    """Return the owned cells to refine: those with the largest error indicators.  Collective.

    Args:
        cells: Error indicator of each cell, a function of degree 0.
        share: Fraction of the sum of squares over all ranks that the cells to refine make up.
    """
    comm = cells.function_space.mesh.comm
    squares = cells.x.array[: _cell_map(cells.function_space.mesh).size_local] ** 2
    falling = np.sort(np.concatenate(comm.allgather(squares)))[::-1]
    sums = np.cumsum(falling)
    least = (1 - EQUAL_SQUARES) * falling[np.searchsorted(sums, share * sums[-1])]
    return np.flatnonzero((squares >= least) & (squares > 0)).astype(np.int32)
