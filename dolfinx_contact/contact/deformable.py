# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Surface of a second deformable body in the same mesh, the master side of a contact."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx.mesh import exterior_facet_indices
from numpy.typing import ArrayLike

from dolfinx_contact import compat
from dolfinx_contact.contact.input import checked_facets, given_facets
from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.surfaces.surface import Surface, unit

SLIDING_KINDS = ("large", "small")


class DeformableSurface(Surface):
    """Surface of a second deformable body, the master side of a contact; meshes need not match.

    Both bodies are parts of one DOLFINx mesh, usually unconnected.  The facets of the ``Contact``
    are the slave side: its nodes carry the reactions, and dual mortar shape functions transfer them
    to the master side, see docs/theory/two_bodies.md.  As slave, prefer the softer, finer or curved
    side.

    Args:
        V: The function space of the contact.
        facets: Local indices of boundary facets of the master side, or ``(facet_tags, tag)``, as in
            ``Contact``.
        axis: First principal friction direction, ``shape=(gdim,)``, global frame, projected on the
            tangent plane at each node.  It is a material direction of the slave at each node.
            Needed in three dimensions unless friction is isotropic.
        sliding: "large" pairs the facets again in each step, at the positions of both bodies at its
            end.  "small" pairs them once, in the undeformed state; this saves time if slip stays
            below a fraction of a facet.

    Raises:
        ValueError: On all ranks, if ``V`` is not a function space, facets are empty or not on the
            boundary, ``axis`` is not a vector of ``gdim`` numbers, or ``sliding`` has another
            value.

    Example:
        >>> below = dc.DeformableSurface(V, foot)  # then: dc.Contact(V, facets_above, below, friction)
    """

    _settable = ("displacement", "rotation")
    _remedy = (
        "a deformable surface moves with its body: prescribe that by boundary conditions and loads."
    )
    curved = deformable = True

    def __init__(
        self, V: Any, facets: Any, *, axis: ArrayLike | None = None, sliding: str = "large"
    ) -> None:
        if not compat.is_function_space(V):
            raise ValueError(f"V must be a DOLFINx function space, got {type(V).__name__}.")
        mesh = V.mesh
        super().__init__(np.zeros(mesh.geometry.dim))
        fdim = mesh.topology.dim - 1
        for dims in ((fdim, fdim + 1), (fdim, 0)):
            mesh.topology.create_connectivity(*dims)
        boundary, facets = exterior_facet_indices(mesh.topology), given_facets(facets, mesh)
        with raised_together(mesh.comm):
            found = checked_facets(facets, mesh.topology.index_map(fdim), boundary)
            if sliding not in SLIDING_KINDS:
                raise ValueError(
                    f"sliding must be one of {', '.join(SLIDING_KINDS)}, got {sliding!r}."
                )
            if axis is not None:
                self.axis = frozen(unit("axis", axis, mesh.geometry.dim))
        if mesh.comm.allreduce(found.size) == 0:
            raise ValueError("facets of the deformable surface are empty on all ranks.")
        self.V, self.facets, self.sliding = V, frozen(found), sliding
        self._made = True

    @property
    def displacement(self) -> np.ndarray:
        """Prescribed displacement of the surface, always zero: the surface moves with its body."""
        return self._displacement

    @displacement.setter
    def displacement(self, value: ArrayLike) -> None:
        self._stay("displacement", value)

    @property
    def rotation(self) -> np.ndarray:
        """Prescribed rotation of the surface, always zero: the surface turns with its body."""
        return self._rotation

    @rotation.setter
    def rotation(self, value: ArrayLike) -> None:
        self._stay("rotation", value)

    def _stay(self, name: str, value: ArrayLike) -> None:
        if np.any(value):
            raise ValueError(f"surface.{name} cannot be {value!r}: {self._remedy}")

    def described(self) -> np.ndarray:
        """Number of facets on all ranks, and the axis (zeros for None), as one array."""
        count = self.V.mesh.comm.allreduce(self.facets.size)
        return np.concatenate(([count], np.zeros(3) if self.axis is None else self.axis))

    def __repr__(self) -> str:
        axis = None if self.axis is None else self.axis.tolist()
        return f"DeformableSurface(V, facets, axis={axis}, sliding={self.sliding!r})"
