# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Checks of the user's input to a contact: space, facets, surface, friction and wear."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact import compat
from dolfinx_contact.contact.displacements import displacement_part
from dolfinx_contact.law.friction import Friction
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.surfaces.surface import Surface

if TYPE_CHECKING:
    from dolfinx.mesh import Mesh
    from mpi4py import MPI
    from numpy.typing import ArrayLike

# Range of friction coefficients that are probably per cent or degrees by mistake, dimensionless:
# real coefficients are smaller, and larger ones are used for sticking.
PER_CENT_RANGE = 10.0, 1000.0


def check_space(V: Any) -> None:
    mesh = V.mesh
    gdim, tdim = mesh.geometry.dim, mesh.topology.dim
    part = displacement_part(V)
    components = compat.value_size(V) if part is None else gdim
    if gdim != tdim or gdim not in (2, 3):
        raise ValueError(
            f"V lives on a mesh of dimension {tdim} in {gdim}-D space: need 2 or 3 in both. Of a mesh from gmsh: a body "
            "without a physical group of its own is left out, and a mesh in the plane needs gdim=2."
        )
    if components != gdim:
        raise ValueError(
            f"V has {components} component(s) on a {gdim}-D mesh: a displacement has one per "
            f'dimension, functionspace(mesh, ("Lagrange", 1, ({gdim},))).'
        )
    if compat.lagrange_degree(V if part is None else part) is None:
        raise ValueError(f"V must be continuous Lagrange, got {V.ufl_element()}.")


def given_facets(facets: Any, mesh: Mesh) -> np.ndarray:
    """Return facets as an array, from an array or from ``(facet_tags, tag)``.  Collective.

    Raises:
        ValueError: on all ranks, if the tags or their values do not fit the mesh.
    """
    fdim, found, tags = mesh.topology.dim - 1, None, None
    with raised_together(mesh.comm):
        if isinstance(facets, (tuple, list)) and len(facets) == 2 and hasattr(facets[0], "indices"):
            found, tags = facets[0], np.atleast_1d(facets[1])
            if found.dim != fdim or not compat.tagged(found, mesh):
                raise ValueError(
                    f"facet_tags must tag the facets of the mesh of V, of dimension {fdim}: got tags of dimension {found.dim}"
                    f"{'' if compat.tagged(found, mesh) else ' of another mesh'}."
                )
            if tags.ndim != 1 or not np.issubdtype(tags.dtype, np.integer) or not tags.size:
                raise ValueError(f"tag must be an integer or several, got {facets[1]!r}.")
    if mesh.comm.allreduce(found is None):
        return facets
    known = sorted(set().union(*mesh.comm.allgather(set(found.values.tolist()))))
    missing = sorted(set(tags.tolist()) - set(known))
    with raised_together(mesh.comm):
        if missing:
            raise ValueError(
                f"facet_tags have no facets with the tag {missing}: there are {known}."
            )
    return found.indices[np.isin(found.values, tags)]


def checked_facets(facets: ArrayLike, index_map: Any, boundary: np.ndarray) -> np.ndarray:
    array = np.asarray(facets)
    if hasattr(facets, "indices") or (array.ndim == 0 and np.issubdtype(array.dtype, np.integer)):
        given = "facet tags" if hasattr(facets, "indices") else f"the number {facets}"
        raise ValueError(
            f"facets must be an array of facets, got {given}: pass facet_tags.find(tag), the facets that have a tag, or (facet_tags, tag)."
        )
    if array.size == 0:
        return np.zeros(0, dtype=np.int32)
    if array.ndim != 1 or not np.issubdtype(array.dtype, np.integer):
        raise ValueError(
            f"facets must be a one-dimensional array of integers, got shape {array.shape} of "
            f"{array.dtype}."
        )
    available = index_map.size_local + index_map.num_ghosts
    if array.min() < 0 or array.max() >= available:
        raise ValueError(
            f"facets range from {array.min()} to {array.max()}, but this rank has facets "
            f"0 to {available - 1}: pass local indices, of the mesh's own facets."
        )
    inside = np.setdiff1d(array[array < index_map.size_local], boundary)
    if inside.size:
        raise ValueError(
            f"facets {inside[:5].tolist()} ({inside.size} in all) are not on the boundary: pass "
            "facets of dimension tdim - 1 found by locate_entities_boundary or facet tags."
        )
    return array.astype(np.int32)


def check_law(
    surface: object, friction: Friction | float, gdim: int, has_spatial_axes: bool = False
) -> None:
    """Raise a ``ValueError`` if surface, friction and dimension do not fit together.

    Args:
        surface: The surface.
        friction: The friction law.
        gdim: Dimension of the mesh.
        directed: Whether the friction axes are given as directions in space, so that the surface
            needs no axis.
    """
    if not isinstance(surface, Surface):
        raise ValueError(
            f"plane must be a RigidPlane or another rigid surface, got {type(surface).__name__}: {surface!r}."
        )
    if not isinstance(friction, Friction):
        raise ValueError(
            f"friction must be a Friction or a number, got {type(friction).__name__}: {friction!r}."
        )
    if surface.point.size != gdim:
        raise ValueError(f"{surface} has {surface.point.size} dimensions, the mesh {gdim}.")
    if friction.field:
        return  # the values of the field are checked later
    friction.law(gdim)  # refuses what has no meaning in two dimensions
    if gdim == 3 and surface.axis is None and not friction.isotropic and not has_spatial_axes:
        raise ValueError(
            f"plane.axis is None, but {friction} depends on the direction: give {type(surface).__name__} the "
            "first principal friction direction, axis=(...)."
        )


def check_some(nodes: np.ndarray, comm: MPI.Comm) -> None:
    """Raise a ``ValueError`` on all ranks if no rank has contact nodes.  Collective."""
    total = comm.allreduce(nodes.size)
    with raised_together(comm):
        if total == 0:
            raise ValueError(
                "facets is empty on all ranks: name the facets that may touch. If they come from tags, "
                "facet_tags.values has the tags that the mesh has; if from a position, compare it with mesh.geometry.x."
            )


def check_opposite(V: Any, surface: Surface) -> None:
    """Raise a ``ValueError`` if a deformable surface belongs to another mesh than ``V``.

    Facet indices are valid only in one mesh.
    """
    if surface.deformable and not compat.same_mesh(V, surface.V):
        raise ValueError(
            "V of the DeformableSurface is a space of another mesh than V of the Contact: both bodies have to be parts of one mesh, which "
            "need not be connected. In gmsh, make both volumes in one model."
        )


def warn_of_percent(friction: Friction | float) -> None:
    """Warn of friction coefficients that look like per cent or degrees.

    Larger coefficients are assumed to mean sticking.
    """
    largest = friction.mu.max(initial=0.0)
    if PER_CENT_RANGE[0] < largest < PER_CENT_RANGE[1]:
        warnings.warn(
            f"a coefficient of friction of {largest:g}: it is force over force, so that 30 % is 0.3 and an angle of 30 degrees is "
            f"tan(30 degrees) = 0.577. For what never slips take inf.",
            stacklevel=4,
        )


def check_coefficients(friction: Friction, n: int) -> None:
    for name in ("mu", "p", "axes"):
        shape = np.shape(getattr(friction, name))
        if len(shape) == 2 and shape[0] != n:
            raise ValueError(
                f"friction.{name} has {shape[0]} rows, this rank owns {n} contact nodes."
            )


def check_wear(wear: object, surface: Surface) -> None:
    if wear is None:
        return
    from dolfinx_contact.law.wear import Wear

    if not isinstance(wear, Wear):
        raise ValueError(
            f"wear must be a Wear or None, got {type(wear).__name__}: {wear!r}; of a coefficient k, volume per frictional work, make dc.Wear(k)."
        )
    if wear.opposite.any() and not surface.deformable:
        raise ValueError(
            f"{wear!r}: {surface!r} does not wear, only a DeformableSurface does: give the sum of both as coefficient."
        )
