# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Nodes of a surface that may touch, their areas, and values at them as functions for output."""

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

# Of the largest integral of a shape function over reference facets: below this it is rounding.
ZERO_INTEGRAL = 1e-10

# By which Cauchy's inequality may miss equality.
CAUCHY_DEFECT = 1e-10

# Radians by which a plane may turn until areas that it sees, of which the cosine is left, are computed anew.
TILT_OF_AREAS = 0.01

# Largest force of a uniform pressure at a node that is left out, relative to the largest nodal force, without a warning.
LEFT_OUT_FORCE = 0.01


class SurfaceMeasure:
    """What integrals over a contact's facets are taken with, and the areas of its nodes, which are computed when they are asked for.

    Args:
        V: Space of the displacements alone.
        weight: Factor of the surface measure, see ``Contact``; None is one.

    Attributes:
        weight: As ``weight_on`` returns it.
    """

    def __init__(self, V: fem.FunctionSpace, weight: Any) -> None:
        self._V, self.weight, self._geometry = V, weight_on(V, weight), V.mesh.geometry.x.copy()
        self._whole: np.ndarray | None = None
        self._opposite: np.ndarray | None = None

    @property
    def mesh_has_moved(self) -> bool:
        """Whether the mesh has been moved or scaled since, on this rank."""
        return not np.array_equal(self._V.mesh.geometry.x, self._geometry)

    @property
    def density(self) -> np.ndarray | None:
        """The weight at the nodes of ``V``, None where it is one.  Collective."""
        return None if self.weight is None else at_nodes(self._V, self.weight)

    @cached_property
    def axial(self) -> bool:
        """Whether the weight is in proportion to the first coordinate, in two dimensions: axial symmetry.  Collective."""
        plain = self.weight is None or self._V.mesh.geometry.dim == 3
        return not plain and grows_with_radius(self._V, self.weight)

    def whole(self, contact: Contact) -> np.ndarray:
        """See ``Contact.whole_area``."""
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
        """See ``Contact.opposite_area``."""
        if self._opposite is None:
            found = np.zeros(0)
            if contact.surface.deformable:
                every = areas(self._V, contact.surface.facets, weight=self.weight)
                found = every[self._V.mesh.geometry.dim * contact.opposite]
            self._opposite = frozen(found)
        return self._opposite

    def renew(self, contact: Contact) -> None:
        """Let areas that are known be those that a plane sees that has turned since.  Collective where it has."""
        if self._whole is None or contact.surface.curved:
            return
        if np.abs(contact.surface.rotation - self._seen_from).max() > TILT_OF_AREAS:
            self._whole = None
            self.whole(contact)


def weight_on(V: fem.FunctionSpace, weight: Any):
    """The weight of the surface measure as UFL takes it: a number, an expression, or a callable of ``x``, interpolated.  Collective."""
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
    """What ``weight_on`` returns at the nodes of ``V`` that this rank knows, ``shape=(n,)``.  Collective."""
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
    """A density with a test function of ``V``, integrated over facets with a weight.  Collective."""
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
    """Integral of each shape function over facets, in the first component of an array on ``V``.  Collective.

    Args:
        V: The space.
        facets: Local indices.
        reference: Whether all facets count as large as the reference facet.
        weight: Of the surface measure, as ``weight_on`` returns it.
    """
    shape = ufl.TestFunction(V)[0]
    if reference:
        shape = shape / abs(ufl.classes.FacetJacobianDeterminant(V.mesh))
    return _assembled(shape, V, facets, weight)


def facing_areas(contact: Contact, weight: Any, turn: np.ndarray) -> np.ndarray:
    r"""Area of each node of a contact that faces its surface, ``shape=(n,)``, undeformed state.  Collective.

    On a plane with normal n it is projected, :math:`A_i = \int N_i \max(0, -n_f \cdot n) ds`, so that a uniform pressure p makes the
    reactions ``p A_i``.  On a curved surface, whose normals will be others when the body has moved, facets count by their own area
    where they face it, :math:`n_f \cdot n < 0`; on a deformable one they are whole.

    Args:
        contact: The contact.
        weight: Of the surface measure, as ``weight_on`` returns it.
        turn: Rotation of the contact nodes as a whole, ``shape=(gdim, gdim)``: the surface is seen from the undeformed body.
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
    """The rotation that takes nodes as a whole nearest to where they are, ``shape=(gdim, gdim)``; none where they do not tell.  Collective.

    Args:
        x, there: Positions of this rank's nodes, undeformed and now, each up to a translation, ``shape=(n, gdim)``.
        comm: MPI communicator.
    """
    count = max(comm.allreduce(len(x)), 1)
    means = comm.allreduce(np.stack((x.sum(axis=0), there.sum(axis=0)))) / count
    return nearest_rotation(comm.allreduce((there - means[1]).T @ (x - means[0])))


def nearest_rotation(products: np.ndarray) -> np.ndarray:
    """The rotation ``R`` for which ``tr(R^T products)`` is largest, ``shape=(gdim, gdim)``; none where they do not tell."""
    left, sizes, right = np.linalg.svd(products)
    if not sizes[len(sizes) - 2] > ZERO_INTEGRAL * sizes[0]:
        return np.eye(len(sizes))
    left[:, -1] *= np.linalg.det(left @ right)
    return left @ right


def per_area(forces: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Nodal forces, ``shape=(n, ...)``, over areas; zero where a node has none."""
    area = area.reshape(-1, *[1] * (forces.ndim - 1))
    return np.divide(forces, area, out=np.zeros_like(forces), where=area > 0.0)


def grows_with_radius(V: fem.FunctionSpace, weight: Any) -> bool:
    """Whether a weight is in proportion to the first coordinate all over the mesh, as in axial symmetry.  Collective."""
    r = ufl.SpatialCoordinate(V.mesh)[0]
    terms = (weight * weight, weight * r, r * r)
    here = [fem.assemble_scalar(fem.form(term * ufl.dx(V.mesh))) for term in terms]
    squares = V.mesh.comm.allreduce(np.array(here, dtype=float))
    return bool(squares[1] ** 2 >= (1 - CAUCHY_DEFECT) * squares[0] * squares[2] > 0.0)


def contact_nodes(
    V: fem.FunctionSpace, facets: np.ndarray, weight: Any = None
) -> tuple[np.ndarray, np.ndarray]:
    """Owned nodes of facets that carry a part of a uniform pressure, and the others.  Collective.

    A uniform pressure p makes the force ``p A_i`` at a node, ``A_i`` the integral of its shape function. With first order,
    and with second order on quadrilaterals and on edges, all are positive. Those of the vertices of triangles of second
    order are zero, and the middles of their edges are the points of a rule that integrates quadratic functions exactly: the
    vertices are left out. It is the element that decides, on the reference facet, so that a curved one cannot change it; and a weight
    of the surface measure: on the axis of symmetry a node of second order carries nothing, either.

    Raises:
        ValueError: on all ranks, if an integral is negative: such a node would have to pull.
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
    """Tell that a uniform pressure acts on nodes that are left out.  Collective."""
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
    """Values at some nodes of ``V`` as a scalar Function.  Collective."""
    scalars, parent = V.sub(0).collapse()
    node = np.ravel(parent) // V.dofmap.index_map_bs
    function = fem.Function(scalars, name=name)
    function.x.array[:] = elsewhere
    function.x.array[np.argsort(node)[nodes]] = values
    function.x.scatter_forward()
    return function
