# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Estimates of the discretisation error by a more accurate problem with the same load history."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import ArrayLike
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import KDTree

from dolfinx_contact import compat
from dolfinx_contact.contact.fields import per_area
from dolfinx_contact.support.checks import finite, positive
from dolfinx_contact.support.collective import agree, raised_together

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.problem import ContactProblem


class Estimated(NamedTuple):
    """Value of a quantity and its estimated error.

    Attributes:
        value: Value in the problem whose error is estimated, in the unit of the quantity.
        error: Estimated absolute error of the value, in the same unit.
    """

    value: float
    error: float

    @property
    def relative(self) -> float:
        """Estimated error divided by the absolute value; 0 if both are zero."""
        return 0.0 if self.error == 0 else float(np.divide(self.error, abs(self.value)))


@dataclass(frozen=True)
class Estimate:
    """Result of ``estimate``: quantities with estimated errors, and error indicators of cells.

    Attributes:
        quantities: Value and estimated error of each quantity, as ``Estimated``, by name.
        energy_norm: Energy norm of the difference between both displacements, divided by the energy
            norm of the reference displacement; dimensionless.  It measures the mean error of the
            stresses.  None if the two problems have different meshes.
        cells: Error indicator of each cell, a function of degree 0: the energy norm of the
            difference on this cell.  The sum of squares is the squared energy norm on the body.
            None if the two problems have different meshes.

    Example:
        >>> found = dc.Estimate(quantities={}, energy_norm=0.01, cells=None)
        >>> found.energy_norm
        0.01
    """

    quantities: dict[str, Estimated]
    energy_norm: float | None
    cells: fem.Function | None

    def __getitem__(self, name: str) -> Estimated:
        return self.quantities[name]


def _sum(problem: ContactProblem, quantity: Callable) -> float:
    return sum(
        problem.body.comm.allreduce(float(quantity(contact))) for contact in problem.contacts
    )


def _peak(problem: ContactProblem) -> float:
    tops = [contact.pressure.max(initial=0.0) for contact in problem.contacts]
    return max(problem.body.comm.allgather(float(max(tops))))


ESTIMATED_QUANTITIES = {
    "normal_force": lambda problem: _sum(problem, lambda contact: contact.reaction[:, -1].sum()),
    "tangential_force": lambda problem: _sum(
        problem, lambda contact: np.linalg.norm(contact.reaction[:, :-1], axis=1).sum()
    ),
    "dissipation": lambda problem: _sum(problem, lambda contact: contact.dissipation.sum()),
    "peak_pressure": _peak,
}


def estimate(
    problem: ContactProblem,
    reference: ContactProblem,
    quantities: Mapping[str, Callable[[ContactProblem], ArrayLike]] | None = None,
    *,
    share: float = 1.0,
) -> Estimate:
    """Estimate the discretisation error of a problem's present state.  Collective.

    ``reference`` is a problem of the same body after the same load history, but with second order
    on the same mesh, with a finer mesh, or with smaller increments.  The estimated error of a
    quantity J is ``abs(J(u) - J(U)) * share`` with the displacement ``U`` of the reference.  It is
    close to the true error if the error of the reference is much smaller (saturation; R. E. Bank,
    R. K. Smith, SIAM J. Numer. Anal. 30 (1993) 921).  It is an estimate, not a bound.

    Each problem has its own slip history, so the estimates for dissipation and other history
    variables include accumulated errors.  Both problems may share a surface driven by displacement.
    A surface driven by force moves differently in the two problems, so each needs its own surface.

    Args:
        problem: The problem whose error is estimated.
        reference: The more accurate problem.  If it has the same mesh object and a space that
            contains the space of ``problem``, ``energy_norm`` and ``cells`` are computed, too.
        quantities: Further quantities by name: functions of a problem that return one number or
            several numbers, the same on all ranks, for instance the forces after all steps so far.
            For several numbers, the value is the number of largest absolute value, and the error is
            the largest of all errors.  The built-in quantities are ``normal_force``, the sum of the
            normal reactions of all contacts; ``tangential_force``, the sum of the norms of the
            tangential reactions; ``dissipation``; and ``peak_pressure``, the largest nodal
            pressure.  If both problems have the same mesh object, or if all contact surfaces are
            plane, ``pressure`` and ``shear`` are added: root mean squares of the nodal normal and
            tangential tractions (reaction divided by area) over all contact facets.  Their errors
            are the root mean squares of the differences.
        share: Ratio of the error to the difference: ``1 / (1 - 2**-p)`` if the reference has half
            the cell size and the quantities converge with order p.

    Returns:
        The ``Estimate``.

    Raises:
        ValueError: the two problems do not match, or a quantity is not a finite number.

    Example:
        >>> W = functionspace(block, ("Lagrange", 2, (3,)))  # the same body in second order
        >>> U = fem.Function(W)
        >>> finer_F = ufl.replace(F, {u: U, v: ufl.TestFunction(W)})
        >>> finer_bc = fem.dirichletbc(held, fem.locate_dofs_topological(W, 2, head), W)
        >>> finer = dc.ContactProblem(finer_F, U, dc.Contact(W, foot, plane, friction), bcs=[finer_bc])
        >>> step = finer.solve()  # and all other steps of the load history
        >>> off = dc.estimate(problem, finer)["normal_force"].relative
    """
    comm = problem.body.comm
    with raised_together(comm):
        share = positive("share", share, finite=True)
        _check_pair(problem, reference)
    agree(comm, share=share, quantities=sorted(quantities or ()))
    found = {}
    for name, quantity in {**ESTIMATED_QUANTITIES, **(quantities or {})}.items():
        with raised_together(comm):
            value, better = _numbers(name, quantity(problem), quantity(reference))
        agree(comm, **{f"quantity {name!r}": (value.tolist(), better.tolist())})
        found[name] = Estimated(largest(value), share * float(np.abs(better - value).max()))
    same_mesh = problem.body.V.mesh is reference.body.V.mesh
    if same_mesh or not any(contact.surface.curved for contact in problem.contacts):
        for name, values in tractions(problem, reference).items():
            found.setdefault(name, values._replace(error=share * values.error))
    if not same_mesh:
        return Estimate(found, None, None)
    norm, cells = indicators(problem, reference)
    return Estimate(found, share * norm, cells)


def indicators(problem: ContactProblem, reference: ContactProblem) -> tuple[float, fem.Function]:
    """Return the energy norm of the displacement difference, on body and cells.  Collective.

    The squared norm on a cell K is ``a_K(e, e)`` with the difference ``e = U - u`` and the tangent
    form ``a(v, w)`` of the reference at its displacement ``U``.  Facet integrals are added to the
    cells of the facets.

    Returns:
        Norm on the body, relative to the norm of ``U``, and a function of degree 0 with the norm on
        each cell, not divided by the norm of ``U``.
    """
    body = reference.body
    e, square = fem.Function(body.V), fem.Function(compat.functionspace(body.V.mesh, ("DG", 0)))
    e.interpolate(problem.u)
    e.x.array[:] = body.u.x.array - e.x.array
    test, trial = body.tangent.arguments()
    q = ufl.TestFunction(square.function_space)
    form = compat.compiled(ufl.replace(body.tangent, {test: e * q, trial: e}), **body.form_options)
    own = square.function_space.dofmap.index_map.size_local
    compat.assemble_into(square.x, form)
    of_difference = square.x.array.copy()
    e.x.array[:] = body.u.x.array
    compat.assemble_into(square.x, form)
    sums = body.comm.allreduce(np.array([of_difference[:own].sum(), square.x.array[:own].sum()]))
    square.x.array[:] = np.sqrt(np.maximum(of_difference, 0.0))
    square.x.scatter_forward()
    part, whole = np.maximum(sums, 0.0)
    return float(np.sqrt(part / whole)) if part > 0 else 0.0, square


def tractions(problem: ContactProblem, reference: ContactProblem) -> dict[str, Estimated]:
    """Return root mean squares of pressure and shear, with estimated errors.  Collective.

    The means are taken over the contact surfaces.  Nodal tractions of ``problem``, local frame, are
    interpolated at the contact nodes of ``reference``.  The nodal areas of ``reference`` are the
    quadrature weights.  For second order, this is Simpson's rule on edges and quadrilaterals, and
    the midpoint rule on edges of triangles.

    Returns:
        ``pressure`` and ``shear``; each error is the root mean square of the difference.
    """
    sums, area = np.zeros((2, 2)), 0.0
    for contact, better in zip(problem.contacts, reference.contacts):
        own, other = interpolated(contact, better), per_area(better.reaction, better.area)
        area += better.area.sum()
        for row, part in zip(sums, (own, other - own)):
            row += better.area @ part[:, -1] ** 2, better.area @ (part[:, :-1] ** 2).sum(axis=1)
    comm = problem.body.comm
    means = np.sqrt(comm.allreduce(sums) / comm.allreduce(area)).T
    return {name: Estimated(*map(float, pair)) for name, pair in zip(("pressure", "shear"), means)}


def interpolated(contact: Contact, better: Any) -> np.ndarray:
    """Return nodal tractions of a contact, interpolated at the nodes of another one.  Collective.

    If both contacts have the same mesh object, the shape functions of the finite elements are used.
    Otherwise the surface must be plane.  The interpolation is then linear between the nodes, in
    three dimensions on their Delaunay triangulation.  Outside of it, the value of the nearest node
    is used.

    Args:
        contact: The contact with the tractions.
        better: The contact at whose nodes the tractions are interpolated.

    Returns:
        ``shape=(n, gdim)``, local frame, force per area, for the ``n`` nodes of ``better``.
    """
    tractions, dim = per_area(contact.reaction, contact.area), contact.reaction.shape[1]
    if contact.V.mesh is better.V.mesh:
        here, there = (fem.Function(one.displacements.V) for one in (contact, better))
        here.x.array.reshape(-1, dim)[contact.nodes] = tractions
        here.x.scatter_forward()
        there.interpolate(here)
        return there.x.array.reshape(-1, dim)[better.nodes]
    along = contact.surface.frame[:-1, :dim].T
    x, y = (one.x[:, :dim] @ along for one in (contact, better))
    x, values = map(np.concatenate, zip(*contact.comm.allgather((x, tractions))))
    if dim == 2:
        order = np.argsort(x[:, 0])
        return np.array([np.interp(y[:, 0], x[order, 0], column[order]) for column in values.T]).T
    found = LinearNDInterpolator(x, values)(y)
    outside = np.isnan(found[:, 0])
    found[outside] = values[KDTree(x).query(y[outside])[1]]
    return found


def largest(numbers: ArrayLike) -> float:
    """Return the number with the largest absolute value."""
    numbers = np.ravel(numbers)
    return float(numbers[np.abs(numbers).argmax()])


def _check_pair(problem: ContactProblem, reference: ContactProblem) -> None:
    if reference is problem or not hasattr(reference, "contacts"):
        raise ValueError(
            "reference must be another ContactProblem: the same body with a space of higher order or a finer mesh."
        )
    if len(reference.contacts) != len(problem.contacts):
        raise ValueError(
            f"problem and reference must have the same contacts, got {len(problem.contacts)} and "
            f"{len(reference.contacts)}."
        )
    same_mesh = problem.body.V.mesh is reference.body.V.mesh
    pairs = zip(problem.contacts, reference.contacts)
    if same_mesh and any(set(one.facets) != set(other.facets) for one, other in pairs):
        raise ValueError(
            "on the same mesh contacts of problem and reference must have the same facets, in the same order of contacts."
        )
    if same_mesh and any(one.body.displacements.mixed for one in (problem, reference)):
        raise ValueError(
            "on the same mesh dc.estimate does not know mixed spaces, which have no energy norm of their own: give a "
            "reference on a finer mesh, whose quantities alone are compared."
        )
    orders = [compat.lagrange_degree(one.body.V) for one in (problem, reference)]
    if same_mesh and orders[0] >= orders[1]:
        raise ValueError(
            f"on the same mesh the reference must be of higher order, got degrees {orders[0]} and {orders[1]}: give the "
            "problem of lower order first, or a reference on a finer mesh."
        )


def _numbers(name: str, *values: Any) -> list[np.ndarray]:
    value, better = found = [np.ravel(finite(f"quantity {name!r}", numbers)) for numbers in values]
    if value.size == 0:
        raise ValueError(
            f"quantity {name!r} must be a finite number or several, got {values[0]!r}."
        )
    if value.size != better.size:
        raise ValueError(
            f"quantity {name!r} has {value.size} numbers of the problem, {better.size} of the reference."
        )
    return found
