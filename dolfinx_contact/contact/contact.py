# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact of the boundary nodes of a body with a surface: results, laws and history."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem
from dolfinx.mesh import exterior_facet_indices
from mpi4py import MPI
from numpy.typing import ArrayLike
from petsc4py import PETSc

from dolfinx_contact import compat
from dolfinx_contact.contact import fields
from dolfinx_contact.contact.contact_step import depends_on_position
from dolfinx_contact.contact.displacements import Displacements
from dolfinx_contact.contact.fields import SurfaceMeasure, contact_nodes
from dolfinx_contact.contact.input import (
    check_law,
    check_opposite,
    check_some,
    check_space,
    check_wear,
    checked_facets,
    given_facets,
)
from dolfinx_contact.contact.interface import ContactPoints
from dolfinx_contact.contact.laws import Laws
from dolfinx_contact.contact.rigid import RigidGeometry
from dolfinx_contact.contact.state import OPPOSITE_WEAR, History, State, frozen_state
from dolfinx_contact.law.friction import Friction, as_friction
from dolfinx_contact.support.attributes import Guarded, frozen
from dolfinx_contact.support.checks import number, positive
from dolfinx_contact.support.collective import agree, raised_together
from dolfinx_contact.surfaces.surface import Surface

if TYPE_CHECKING:
    from dolfinx.mesh import MeshTags  # before 0.6 it has another name

    from dolfinx_contact.contact.geometry import Frames
    from dolfinx_contact.law.wear import Wear


class Contact(Guarded):
    """Contact between the nodes of boundary facets and a surface, rigid or deformable.

    Every node belongs to one rank.  All arrays run over the ``n`` nodes that this rank owns.  The
    local frame is (t1, t2, n), in two dimensions (t, n): the axis of the surface, the tangential
    direction across it, and the normal.  On a curved surface every node has its own frame, see
    docs/surfaces.md.

    Args:
        V: Continuous Lagrange space of displacements, one component per dimension, of degree 1 or
            2.  Alternatively a mixed space with exactly one such sub-space, or that sub-space.
        facets: Local indices of boundary facets, integers; a rank may have none.  Alternatively
            ``(facet_tags, tag)`` with one integer tag or several.
        surface: A ``RigidPlane``, ``RigidSphere``, ``RigidCylinder``, ``RigidSurface`` or
            ``DeformableSurface``.
        friction: A ``Friction``, or a number, the isotropic coefficient, the same on all ranks.
            Coefficients may be given per node, ``shape=(n, 2)`` for the n nodes of this rank, or as
            fields, which the contact evaluates at its nodes.
        wear: Archard's law, whose worn depth opens the gap; None for no wear.  Between two
            deformable bodies, the law has a coefficient for each body, see ``Wear``.
        weight: Factor of the surface measure, the same as in the forms: ``2 * pi * r`` with axial
            symmetry, or a thickness.  A number, a UFL expression, or a callable of ``x``,
            ``shape=(3, n)``.  It enters areas, and thus pressures, worn depths and
            pressure-dependent friction.  Reactions follow from the forms, which must contain the
            same factor.

    Raises:
        ValueError: on all ranks, if facets are not boundary facets of the mesh, the space is
            unsuitable, the surface has another dimension than the mesh, or the surface has no axis
            although friction depends on the direction.

    Attributes:
        nodes: Indices of the contact nodes among the blocks of ``displacements.V``, which is ``V``
            or the collapsed displacement sub-space, ``shape=(n,)``.  They are the nodes of the
            facets except the vertices of second-order tetrahedra, where a uniform pressure causes
            no force.
        x: Reference positions of the contact nodes, ``shape=(n, 3)``, global frame.

    Example:
        >>> contact = dc.Contact(V, foot, plane, dc.Friction(mu=0.3))
        >>> contact.x.shape == contact.reaction.shape  # 25 nodes of the block's foot on one rank
        True
    """

    _settable = ("friction", "wear", "repeats", "present", "owner")
    _remedy = (
        "results are read-only, and what a contact was made of stays; friction and wear may be exchanged between "
        "steps, and for another space, plane or other facets make a new Contact."
    )

    def __init__(
        self,
        V: fem.FunctionSpace,
        facets: ArrayLike | tuple[MeshTags, int | Sequence[int]],
        surface: Surface,
        friction: Friction | float,
        *,
        wear: Wear | None = None,
        weight: Any = None,
    ) -> None:
        if not compat.is_function_space(V):
            raise ValueError(f"V must be a DOLFINx function space, got {type(V).__name__}.")
        mesh, friction = V.mesh, as_friction(friction)
        gdim, fdim = mesh.geometry.dim, mesh.topology.dim - 1
        for dims in ((fdim, fdim + 1), (fdim, 0)):
            mesh.topology.create_connectivity(*dims)
        boundary, facets = exterior_facet_indices(mesh.topology), given_facets(facets, mesh)
        with raised_together(mesh.comm):
            check_space(V)
            facets = checked_facets(facets, mesh.topology.index_map(fdim), boundary)
            check_law(surface, friction, gdim)
            check_opposite(V, surface)
            check_wear(wear, surface)
        self.V, self.comm, self.surface = V, mesh.comm, surface
        self.displacements = Displacements(V)
        agree(mesh.comm, weight="given" if weight is not None else None)
        with raised_together(mesh.comm):
            self.measure = SurfaceMeasure(self.displacements.V, weight)
        nodes = contact_nodes(self.displacements.V, facets, self.measure.weight)
        self.nodes, self.left_out = map(frozen, nodes)
        self.x = frozen(self.displacements.x[self.nodes])
        self._repeats = 1.0
        x, dofs = self.x[:, :gdim], self.displacements.dofs(self.nodes)
        with raised_together(mesh.comm):
            surface.check_at(surface.relative(x))
        extent = mesh.comm.allreduce(np.abs(mesh.geometry.x).max(initial=0.0), op=MPI.MAX)
        given = surface, x, dofs, extent, mesh.comm
        if surface.deformable:
            from dolfinx_contact.contact.mortar_points import MortarGeometry

            self.geometry = MortarGeometry(*given, contact=self, facets=facets)
        else:
            self.geometry = RigidGeometry(*given, points_in=self.points_in)
        self.laws = Laws()
        self._begin(self.geometry.standing(surface.varies))
        self.laws.assign(self, friction, empty=True)
        self.wear = wear
        self.laws.check(self)
        check_some(self.nodes, mesh.comm)
        self.facets, self.owner = frozen(facets), None
        self.reset()
        self._made = True

    def __repr__(self) -> str:
        friction = "friction per node" if self.friction.mu.ndim == 2 else repr(self.friction)
        return f"<Contact of {self.nodes.size} nodes on this rank, {self.surface!r}, {friction}, wear={self.wear!r}>"

    # -- laws ----------------------------------------------------------------------------------

    @property
    def friction(self) -> Friction:
        """Friction law at the contact nodes.

        Another law may be assigned between steps, on all ranks.  Fields are evaluated on assignment
        and at the start of each step.  Fields that depend on the contact's state are also evaluated
        during a step.
        """
        return self.laws.friction

    @friction.setter
    def friction(self, friction: Friction | float) -> None:
        self.laws.assign(self, friction)

    @property
    def wear(self) -> Wear | None:
        """Wear law; another law may be assigned between steps, on all ranks."""
        return self.laws.wear

    @wear.setter
    def wear(self, wear: Wear | None) -> None:
        self.laws.assign_wear(self, wear)

    @property
    def repeats(self) -> float:
        """Factor for the wear, frictional work and slip path of each step, dimensionless.

        It is 1 at first, is set by ``cycle_jump``, and must be the same on all ranks.  At 0, steps
        add nothing to these sums.
        """
        return self._repeats

    @repeats.setter
    def repeats(self, times: float) -> None:
        count = number("repeats", times)
        self._repeats = positive("repeats", count) if count != 0.0 else 0.0

    # -- frames and motion ---------------------------------------------------------------------

    @property
    def frame(self) -> np.ndarray:
        """Local frame of the last step, rows (t1, t2, n), in 2-D (t, n), ``shape=(gdim, gdim)``.

        On curved surfaces each node has its own frame, ``shape=(n, gdim, gdim)``.
        """
        return self.history.frames.frame

    @property
    def points(self) -> ContactPoints:
        """Contact points of the last step.

        They express motion as a sparse operator and know the prescribed directions.
        """
        return self.history.frames.points

    def points_in(self, frames: np.ndarray) -> ContactPoints:
        """Return the ``ContactPoints`` on a rigid surface for given local frames.

        Each contact node is one point.  A subclass may return other contact points, see
        docs/extending.md.

        Args:
            frames: Rows (t1, t2, n) at each node, ``shape=(n, gdim, gdim)``, global components,
                orthonormal.
        """
        displacements = self.displacements
        return ContactPoints(displacements.dofs(self.nodes), frames, displacements.owned)

    @property
    def changes(self) -> bool:
        """Whether the contact geometry may change within a step.

        The geometry consists of gaps, normals, lever arms and friction axes bound to the surface.
        The value is the same on all ranks.
        """
        return self.geometry.changes(self.history, self.laws.textured)

    @property
    def slip_before_touching(self) -> np.ndarray:
        """Tangential motion of nodes before they touched in the last step, ``shape=(n, gdim - 1)``.

        Local frame, length.  It is excluded from the slip where the exclusion changes friction, and
        zero for all other nodes.
        """
        before = self.history.landed_after
        return np.zeros_like(self.slip_increment) if before is None else before

    def assemble_reaction(self, b: PETSc.Vec | np.ndarray) -> None:
        """Add the nodal reactions, forces on the body, to ``b``.

        Args:
            b: PETSc vector on ``V``, or the array of its owned degrees of freedom, oriented as
                ``f - K u``: applied minus internal forces.
        """
        array = b if isinstance(b, np.ndarray) else b.array_w
        self.points.add_forces(self.reaction, array[: self.points.size])

    # -- history -------------------------------------------------------------------------------

    def reset(self) -> None:
        """Clear the history: the body is undeformed and unworn, without reactions.

        The surface keeps its present position.
        """
        frames, moves = self.history.frames, depends_on_position(self)
        if self.geometry.follows(moves, self.history):
            frames = self.geometry.standing(moves, frames)
        self._begin(frames)

    def _begin(self, frames: Frames) -> None:
        self.set_history(History.of(self.geometry.at_rest(frames), frames))

    def set_history(self, history: History) -> None:
        """Replace the history and the present state by a given history and its last state.

        If friction is given by fields, the nodal coefficients of that history are restored as well.
        """
        self._history, self._present = history, history.last
        if self.laws.field and history.friction is not None:
            self.laws.take(self, history.friction)

    def accept(self, history: History) -> None:
        """Accept the history variables of a completed step.  Collective.

        See ``ContactStep.ended``.
        """
        self._history, self._present = history, history.last
        self.laws.take(self, history.friction)
        self.measure.renew(self)

    # -- results -------------------------------------------------------------------------------

    @property
    def present(self) -> State:
        """Present state of the contact nodes, which may be replaced by assignment."""
        return self._present

    @present.setter
    def present(self, state: State) -> None:
        self._present = frozen_state(state)

    @property
    def history(self) -> History:
        """History variables from which the next step starts, including the last converged state."""
        return self._history

    @property
    def displacement(self) -> np.ndarray:
        """Displacement of nodes relative to the surface, ``shape=(n, gdim)``, local frame, length."""
        return self.present.displacement

    @property
    def reaction(self) -> np.ndarray:
        """Force of the surface on each node, ``shape=(n, gdim)``, local frame, force units."""
        return self.present.reaction

    @property
    def gap(self) -> np.ndarray:
        """Distance of each node from the surface, ``shape=(n,)``, length.

        Negative values are penetration.  It is infinite at nodes that face no part of a deformable
        surface.
        """
        bare = self.points.alone if self.history.bare is None else self.history.bare
        return frozen(np.where(bare, np.inf, self.present.gap)) if bare.any() else self.present.gap

    @property
    def slip_increment(self) -> np.ndarray:
        """Slip in the last step, relative to the surface, ``shape=(n, gdim - 1)``, length.

        The frame is local.
        """
        return self.present.slip_increment

    @property
    def status(self) -> np.ndarray:
        """``Status`` of each node, ``shape=(n,)``, integers: 0 open, 1 stick, 2 slip."""
        return self.present.status

    @property
    def dissipation(self) -> np.ndarray:
        """Frictional work of each node since the start, ``shape=(n,)``, force times length.

        It never decreases.
        """
        return self.history.sums["dissipation"]

    @property
    def slip_path(self) -> np.ndarray:
        """Length of the slip path while in contact since the start, ``shape=(n,)``, length."""
        return self.history.sums["slip_path"]

    @property
    def wear_depth(self) -> np.ndarray:
        """Depth worn off the contact's own nodes, ``shape=(n,)``, length; zero without ``wear``.

        It never decreases.  Its product with ``whole_area`` is the worn volume of each node.
        """
        return self.history.sums["wear_depth"]

    @property
    def opposite_wear_depth(self) -> np.ndarray:
        """Depth worn off a deformable surface at its nodes ``opposite``, ``shape=(k,)``, length.

        Its product with ``opposite_area`` is the worn volume of each node.
        """
        return self.history.sums.get(OPPOSITE_WEAR, np.zeros(self.opposite.size))

    @property
    def opening(self) -> np.ndarray:
        """Gap opened at each node by the wear of both sides, ``shape=(n,)``, length."""
        return self.geometry.opening(self.points, self.history)

    @property
    def slip_kept(self) -> np.ndarray:
        """Slip of sticking nodes since they last slipped, ``shape=(n, gdim - 1)``, length.

        The frame is local.  Within the tolerance of the solver, sticking nodes move a little in
        every step.  This motion counts for work and slip path only when the node slips.
        """
        return self.history.slip_kept

    @property
    def load_function(self) -> np.ndarray:
        """Load function f = ||M^-1 r_t|| - r_n, ``shape=(n,)``, force units [dSFMH07, Eq. (1)]."""
        return self.laws.kernel.load_function(self.reaction)

    @property
    def bipotential_gap(self) -> np.ndarray:
        """Error measure b_c + Delta u . r >= 0 of each node, ``shape=(n,)``, force times length.

        It is zero exactly where the contact law holds [dSFMH07, Section 1].  It is evaluated at
        ``max(gap, 0)``; penetration appears in ``gap``.
        """
        return self.laws.kernel.bipotential_gap(
            self.reaction, np.maximum(self.present.gap, 0.0), self.slip_increment
        )

    @property
    def slip_residual(self) -> np.ndarray:
        """Residual of the slip rule at each node, ``shape=(n, gdim - 1)``, local frame, length.

        On slipping nodes it is ``Delta u_t + |Delta u_t| d``, where ``d`` is the unit vector along
        ``P^-2 r_t``.  On sticking nodes it is ``Delta u_t`` [dSFMH07, Section 1].  On open and
        frictionless nodes it is zero.
        """
        return self.laws.kernel.slip_defect(self.reaction, self.slip_increment, self.status)

    def force(self) -> np.ndarray:
        """Total reaction, ``shape=(gdim,)``, global frame, the same on all ranks.  Collective.

        With axial symmetry, only the axial component is a force.  The radial component is a sum
        over the circumference, whose resultant is zero.
        """
        if self.surface.curved:
            return self.comm.allreduce(np.einsum("ni,nij->j", self.reaction, self.frame))
        return self.comm.allreduce(self.reaction.sum(axis=0)) @ self.frame

    def moment(self, u: fem.Function | None = None) -> np.ndarray:
        """Moment of the reactions about the point of the surface, global frame.  Collective.

        Its shape is ``(3,)``; in 2-D it is one number.  Lever arms are taken in the deformed state,
        from the present position of the point.  After a step, the moment about free axes equals
        ``surface.moment``.

        Args:
            u: Displacement; required for a deformable surface, for which the moment is about the
                origin.

        Raises:
            ValueError: if ``u`` is missing for a deformable surface.
        """
        forces = np.einsum("ni,nij->nj", self.reaction, self.points.frames)
        x = None if u is None else u.x.array
        arms = self.geometry.arms(self.displacement, self.history.frames, x)
        if arms.shape[1] == 2:
            moments = (arms[:, :1] * forces[:, 1:] - arms[:, 1:] * forces[:, :1]).sum(axis=0)
        else:
            moments = np.cross(arms, forces).sum(axis=0)
        return self.comm.allreduce(moments)

    @property
    def area(self) -> np.ndarray:
        """Area of each node that faces the surface, ``shape=(n,)``, undeformed state.

        It is the integral of the node's shape function times ``weight`` over the facets, projected
        on a plane; facets that face away from the surface do not count, see ``facing_areas``.  On a
        deformable surface only the fraction ``covered`` counts.  In two dimensions it is a length,
        unless there is a weight.  The first call is collective.
        """
        return frozen(self.whole_area * self.covered)

    @property
    def whole_area(self) -> np.ndarray:
        """Area of each node including parts that face no deformable surface, ``shape=(n,)``.

        Worn depth is worn volume divided by this area.  See ``area``.
        """
        return self.measure.whole(self)

    @property
    def opposite_area(self) -> np.ndarray:
        """Area of each node ``opposite`` of a deformable surface, ``shape=(k,)``.

        The first call is collective.
        """
        return self.measure.opposite(self)

    def worn_volume(self) -> tuple[float, float]:
        """Return the worn volumes of the contact's own and of the opposite side.  Collective."""
        own, other = 0.0, 0.0
        if self.wear is not None:
            own = float(self.wear_depth @ self.whole_area)
            other = float(self.opposite_wear_depth @ self.opposite_area)
        return tuple(self.comm.allreduce(np.array([own, other])).tolist())

    @property
    def opposite(self) -> np.ndarray:
        """Local indices of this rank's nodes on the deformable surface, ``shape=(k,)``.

        Empty for rigid surfaces.
        """
        return self.geometry.opposite

    @property
    def covered(self) -> np.ndarray:
        """Fraction of each node's area that faces a deformable surface, ``shape=(n,)``.

        It is 1 on rigid surfaces.
        """
        return self.geometry.covered(self.history.frames)

    @property
    def pressure(self) -> np.ndarray:
        """Contact pressure at each node, normal reaction over ``area``, ``shape=(n,)``.

        Force per area; zero at nodes without area.  The first call is collective.
        """
        return fields.per_area(self.reaction[:, -1], self.area)

    def function(self, values: ArrayLike, name: str = "f", elsewhere: float = 0.0) -> fem.Function:
        """Return a scalar Function for output with given values at the contact nodes.  Collective.

        Args:
            values: Values at the contact nodes, ``shape=(n,)``.
            name: Name of the Function.
            elsewhere: Value at all other nodes.
        """
        return fields.scalar(self.displacements.V, self.nodes, values, name, elsewhere)

    def wear_function(self, name: str = "wear_depth") -> fem.Function:
        """Return the depths worn off both sides as a scalar Function for output.  Collective.

        Each depth is at the nodes of its own side; at all other nodes the Function is zero.
        """
        nodes = np.concatenate((self.nodes, self.opposite))
        depths = np.concatenate((self.wear_depth, self.opposite_wear_depth))
        return fields.scalar(self.displacements.V, nodes, depths, name, 0.0)

    def reaction_function(self) -> fem.Function:
        """Return the nodal reactions as a Function on the displacement space, global components.

        It is zero at all other nodes.
        """
        function = fem.Function(self.displacements.V, name="reaction")
        forces = np.zeros(self.points.size)
        self.points.add_forces(self.reaction, forces)
        rows = self.displacements.rows(forces)
        function.x.array[: rows.size] = rows.ravel()
        function.x.scatter_forward()
        return function
