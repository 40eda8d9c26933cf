# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact nodes, their nodal areas, and nodal values as DOLFINx Functions for output."""

from __future__ import annotations

import warnings
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import meshtags
from mpi4py import MPI

from dolfinx_contact import compat
from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.checks import finite, number, place
from dolfinx_contact.support.collective import raised_together

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from dolfinx_contact.contact.contact import Contact

# Integrals of shape functions below this fraction of the largest one count as zero.
ZERO_INTEGRAL = 1e-10

# Relative tolerance for equality in the Cauchy-Schwarz inequality.
CAUCHY_DEFECT = 1e-10

# Rotation of a plane, radians, above which projected areas are computed again.  They change with
# the cosine of the angle.
TILT_OF_AREAS = 0.01

# Largest nodal force of a uniform pressure at an excluded node, relative to the largest nodal
# force, that causes no warning.
LEFT_OUT_FORCE = 0.01


class SurfaceMeasure:
    """Surface measure of a contact, and the areas of its nodes, computed on first use.

    Args:
        V: Function space of the displacements, not mixed.
        weight: Factor of the surface measure, see ``Contact``; None means one.

    Attributes:
        weight: The factor in UFL, as ``weight_on`` returns it.
    """

    def __init__(self, V: fem.FunctionSpace, weight: Any) -> None:
        self._V, self.weight, self._geometry = V, weight_on(V, weight), V.mesh.geometry.x.copy()
        self._whole: np.ndarray | None = None
        self._opposite: np.ndarray | None = None

    @property
    def mesh_has_moved(self) -> bool:
        """Whether mesh coordinates on this rank have changed since construction."""
        return not np.array_equal(self._V.mesh.geometry.x, self._geometry)

    @property
    def density(self) -> np.ndarray | None:
        """Weight of the surface measure at the nodes of ``V``, or None if it is one.
        Collective.
        """
        return None if self.weight is None else at_nodes(self._V, self.weight)

    @cached_property
    def axial(self) -> bool:
        """Whether the model is axisymmetric: 2-D, with a weight proportional to the radius.
        Collective.
        """
        plain = self.weight is None or self._V.mesh.geometry.dim == 3
        return not plain and grows_with_radius(self._V, self.weight)

    def whole(self, contact: Contact) -> np.ndarray:
        """Nodal areas of the entire facets, see ``Contact.whole_area``."""
        if self._whole is None:
            surface, x = contact.surface, contact.x[:, : contact.points.dim]
            turn = none = np.eye(x.shape[1])
            if not surface.curved:
                arms = contact.geometry.arms(contact.displacement, contact.history.frames)
                turn = turn_of_nodes(x, arms, contact.comm)
            if np.abs(turn - none).max() <= TILT_OF_AREAS:
                turn = none
            self._whole = frozen(facing_areas(contact, self.weight, turn))
            self._seen_from = surface.rotation
        return self._whole

    def opposite(self, contact: Contact) -> np.ndarray:
        """Nodal areas of the master side, see ``Contact.opposite_area``."""
        if self._opposite is None:
            found = np.zeros(0)
            if contact.surface.deformable:
                every = areas(self._V, contact.surface.facets, weight=self.weight)
                found = every[self._V.mesh.geometry.dim * contact.opposite]
            self._opposite = frozen(found)
        return self._opposite

    def renew(self, contact: Contact) -> None:
        """Compute projected areas again if the plane has turned by more than ``TILT_OF_AREAS``.

        Collective in that case.
        """
        if self._whole is None or contact.surface.curved:
            return
        if np.abs(contact.surface.rotation - self._seen_from).max() > TILT_OF_AREAS:
            self._whole = None
            self.whole(contact)


def weight_on(V: fem.FunctionSpace, weight: Any):
    """Weight of the surface measure as a UFL expression, or None for None.  Collective.

    Args:
        V: Function space of the displacements.
        weight: A number, a UFL expression, or a callable of ``x``, which is interpolated.
    """
    if weight is None or isinstance(weight, ufl.core.expr.Expr):
        return weight
    if not callable(weight):
        return ufl.as_ufl(number("weight", weight))
    scalars = V.sub(0).collapse()[0]
    values = fem.Function(scalars)
    x = scalars.tabulate_dof_coordinates()
    values.x.array[:] = np.broadcast_to(finite("what weight gives", weight(x.T.copy())), len(x))
    return values


def at_nodes(V: fem.FunctionSpace, weight: Any) -> np.ndarray:
    """Weight of the surface measure at this rank's nodes of ``V`` and ghosts, ``shape=(n,)``.
    Collective.

    Args:
        V: Function space of the displacements.
        weight: UFL expression, as ``weight_on`` returns it.
    """
    scalars, parent = V.sub(0).collapse()
    values = fem.Function(scalars)
    if isinstance(weight, ufl.constantvalue.ConstantValue):  # it has no mesh
        values.x.array[:] = float(weight)
    else:
        values.interpolate(fem.Expression(weight, compat.interpolation_points(scalars)))
    found = np.zeros(len(values.x.array))
    found[np.ravel(parent) // V.dofmap.index_map_bs] = values.x.array
    return found


def _assembled(density: Any, V: fem.FunctionSpace, facets: np.ndarray, weight: Any) -> np.ndarray:
    """Vector of a linear form on ``V``, integrated over facets, owned entries and ghosts.
    Collective.

    Args:
        density: Integrand, which contains a test function of ``V``.
        V: Function space.
        facets: Local facet indices.
        weight: Weight of the surface measure in UFL; None means one.
    """
    mesh, fdim = V.mesh, V.mesh.topology.dim - 1
    mine = np.unique(facets[facets < mesh.topology.index_map(fdim).size_local])
    tags = meshtags(mesh, fdim, mine, np.ones(mine.size, dtype=np.int32))
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tags)(1)
    work = fem.Function(V)
    compat.assemble_into(work.x, fem.form((density if weight is None else density * weight) * ds))
    return work.x.array.copy()


def areas(
    V: fem.FunctionSpace, facets: np.ndarray, reference: bool = False, weight: Any = None
) -> np.ndarray:
    """Integrals of scalar shape functions over facets, in component 0 of an array on ``V``.

    Collective.

    Args:
        V: Function space of the displacements.
        facets: Local facet indices.
        reference: Whether to integrate over the reference facet in place of each facet.
        weight: Weight of the surface measure, as ``weight_on`` returns it.
    """
    shape = ufl.TestFunction(V)[0]
    if reference:
        shape = shape / abs(ufl.classes.FacetJacobianDeterminant(V.mesh))
    return _assembled(shape, V, facets, weight)


def facing_areas(contact: Contact, weight: Any, turn: np.ndarray) -> np.ndarray:
    r"""Nodal areas of the part of the contact facets that faces the surface, ``shape=(n,)``.

    They are integrals over the undeformed facets.  For a plane with normal n they are projected,
    :math:`A_i = \int N_i \max(0, -n_f \cdot n) ds`, so that a uniform pressure p gives the
    reactions ``p A_i``.  For a curved surface, whose normals change when the body moves, facets
    have their full area where :math:`n_f \cdot n < 0`, and zero elsewhere.  For a deformable
    surface, all facets have their full area.  Collective.

    Args:
        contact: The contact.
        weight: Weight of the surface measure, as ``weight_on`` returns it.
        turn: Mean rotation of the contact nodes, ``shape=(gdim, gdim)``, by which the normals of
            the surface are turned back to the undeformed body.

    Raises:
        ValueError: On all ranks, if an area is negative or not finite.
    """
    V, surface = contact.displacements.V, contact.surface
    if surface.deformable:
        return areas(V, contact.facets, weight=weight)[V.mesh.geometry.dim * contact.nodes]
    dim = V.mesh.geometry.dim
    towards, n_f, v = fem.Function(V), ufl.FacetNormal(V.mesh), ufl.TestFunction(V)
    at = fem.locate_dofs_topological(V, V.mesh.topology.dim - 1, contact.facets)
    x = V.tabulate_dof_coordinates()[at, :dim]
    frames = surface.turned(surface.frames(surface.relative(x) if surface.curved else x)) @ turn
    towards.x.array.reshape(-1, dim)[at] = frames[..., -1, :]
    density = -ufl.inner(n_f, v) if not surface.curved else v[0]
    faces = ufl.conditional(ufl.lt(ufl.inner(n_f, towards), 0.0), density, 0.0)
    rows = _assembled(faces, V, contact.facets, weight).reshape(-1, dim)[contact.nodes]
    found = rows[:, 0].copy() if surface.curved else rows @ frames[-1]
    largest = contact.comm.allreduce(np.abs(found).max(initial=0.0), op=MPI.MAX)
    with raised_together(contact.comm):
        if not np.isfinite(found).all() or (found < -ZERO_INTEGRAL * largest).any():
            node = int(np.argmin(np.nan_to_num(found, nan=-np.inf)))
            raise ValueError(
                f"the area of the contact node at {place(contact.x, node)} is {found[node]:.3g}: weight must be positive "
                "on the facets, or zero on an axis."
            )
    found[found <= ZERO_INTEGRAL * largest] = 0.0
    return found


def turn_of_nodes(x: np.ndarray, there: np.ndarray, comm: MPI.Comm) -> np.ndarray:
    """Mean rotation of nodes by a least-squares fit, ``shape=(gdim, gdim)``.  Collective.

    It is the identity if the positions do not determine a rotation.

    Args:
        x, there: Undeformed and current positions of this rank's nodes, each up to a translation,
            ``shape=(n, gdim)``.
        comm: MPI communicator.
    """
    count = max(comm.allreduce(len(x)), 1)
    means = comm.allreduce(np.stack((x.sum(axis=0), there.sum(axis=0)))) / count
    return nearest_rotation(comm.allreduce((there - means[1]).T @ (x - means[0])))


def nearest_rotation(products: np.ndarray) -> np.ndarray:
    """Rotation ``R`` that maximises ``tr(R^T products)``, ``shape=(gdim, gdim)``.

    It is the identity if ``products`` does not determine a rotation.
    """
    left, sizes, right = np.linalg.svd(products)
    if not sizes[len(sizes) - 2] > ZERO_INTEGRAL * sizes[0]:
        return np.eye(len(sizes))
    left[:, -1] *= np.linalg.det(left @ right)
    return left @ right


def per_area(forces: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Nodal forces divided by nodal areas, ``shape=(n, ...)``; zero where the area is zero."""
    area = area.reshape(-1, *[1] * (forces.ndim - 1))
    return np.divide(forces, area, out=np.zeros_like(forces), where=area > 0.0)


def grows_with_radius(V: fem.FunctionSpace, weight: Any) -> bool:
    """Whether a weight is proportional to the first coordinate, as in axial symmetry.
    Collective.
    """
    r = ufl.SpatialCoordinate(V.mesh)[0]
    terms = (weight * weight, weight * r, r * r)
    here = [fem.assemble_scalar(fem.form(term * ufl.dx(V.mesh))) for term in terms]
    squares = V.mesh.comm.allreduce(np.array(here, dtype=float))
    return bool(squares[1] ** 2 >= (1 - CAUCHY_DEFECT) * squares[0] * squares[2] > 0.0)


def contact_nodes(
    V: fem.FunctionSpace, facets: np.ndarray, weight: Any = None
) -> tuple[np.ndarray, np.ndarray]:
    """Owned nodes of facets that carry load under a uniform pressure, and all others.  Collective.

    A uniform pressure p gives the nodal force ``p A_i``, where ``A_i`` is the integral of the shape
    function.  For degree 1, and for degree 2 on quadrilaterals and intervals, all ``A_i`` are
    positive.  At the vertices of second-order triangles ``A_i`` is zero, so they are no contact
    nodes; the mid-edge nodes are the points of a quadrature rule that is exact for quadratic
    functions.

    Without a weight, the integrals are over the reference facet, so curved facets do not change the
    selection.  A weight of the surface measure may exclude further nodes: on an axis of symmetry,
    second-order nodes carry no load.

    Args:
        V: Function space of the displacements.
        facets: Local facet indices.
        weight: Weight of the surface measure in UFL; None means one.

    Returns:
        Local indices of the loaded nodes, and of the other nodes.

    Raises:
        ValueError: On all ranks, if an integral is negative, as the node would have to carry
            tension.
    """
    nodes = fem.locate_dofs_topological(V, V.mesh.topology.dim - 1, facets)
    nodes = np.unique(nodes[nodes < V.dofmap.index_map.size_local])
    if compat.lagrange_degree(V) == 1:
        return nodes, nodes[:0]
    comm = V.mesh.comm
    weights = areas(V, facets, weight is None, weight)[V.mesh.geometry.dim * nodes]
    zero = ZERO_INTEGRAL * comm.allreduce(np.abs(weights).max(initial=0.0), op=MPI.MAX)
    with raised_together(comm):
        if (weights < -zero).any():
            node = int(np.argmin(weights))
            raise ValueError(
                f"V has degree {compat.lagrange_degree(V)}, and the integral of the shape function of the node at "
                f"{place(V.tabulate_dof_coordinates(), nodes[node])} over the facets is negative: under a uniform pressure "
                "it would have to pull, which contact cannot. Take degree 1 or 2."
            )
    kept = weights > zero
    _warn_of_curved_edges(V, facets, nodes[kept], nodes[~kept], weight)
    return nodes[kept], nodes[~kept]


def _warn_of_curved_edges(
    V: fem.FunctionSpace, facets: np.ndarray, kept: np.ndarray, left_out: np.ndarray, weight: Any
) -> None:
    """Warn if a uniform pressure gives forces at excluded nodes, as on curved edges.  Collective.

    Args:
        V: Function space of the displacements.
        facets: Local facet indices.
        kept, left_out: Local indices of the contact nodes and of the excluded nodes.
        weight: Weight of the surface measure in UFL; None means one.
    """
    comm, dim = V.mesh.comm, V.mesh.geometry.dim
    if comm.allreduce(left_out.size) == 0:
        return
    acting = np.abs(areas(V, facets, weight=weight))
    most = [acting[dim * nodes].max(initial=0.0) for nodes in (left_out, kept)]
    missed, largest = (comm.allreduce(float(force), op=MPI.MAX) for force in most)
    if missed > LEFT_OUT_FORCE * largest:
        warnings.warn(
            f"edges of contact facets are curved: a uniform pressure would make forces of up to {missed / largest:.1%} of "
            "the largest at vertices of second-order tetrahedra, which are no contact nodes. Results are off by about that "
            "there. Take smaller cells there, or bricks.",
            stacklevel=4,
        )


def scalar(V: fem.FunctionSpace, nodes: np.ndarray, values: ArrayLike, name: str, elsewhere: float):
    """Scalar Function with given values at some nodes of ``V``.  Collective.

    Args:
        V: Function space of the displacements.
        nodes: Local node indices, ``shape=(n,)``.
        values: Values at these nodes, ``shape=(n,)``.
        name: Name of the Function.
        elsewhere: Value at all other nodes.
    """
    scalars, parent = V.sub(0).collapse()
    node = np.ravel(parent) // V.dofmap.index_map_bs
    function = fem.Function(scalars, name=name)
    function.x.array[:] = elsewhere
    function.x.array[np.argsort(node)[nodes]] = values
    function.x.scatter_forward()
    return function
