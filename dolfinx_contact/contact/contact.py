"""The contact of boundary nodes with a rigid surface: reactions and their history."""

from __future__ import annotations

import hashlib
import weakref
from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx.mesh import exterior_facet_indices
from mpi4py import MPI
from numpy.typing import ArrayLike
from petsc4py import PETSc

from dolfinx_contact import compat
from dolfinx_contact.contact.displacements import Displacements
from dolfinx_contact.contact.fields import contact_nodes, weight_on
from dolfinx_contact.contact.input import (
    check_law,
    check_space,
    check_wear,
    checked_facets,
)
from dolfinx_contact.contact.interface import add_to
from dolfinx_contact.contact.kinematics import ContactKinematics
from dolfinx_contact.contact.state import Status
from dolfinx_contact.law.dissipation import work_of_friction
from dolfinx_contact.law.friction import Friction, as_friction
from dolfinx_contact.law.maps import BipotentialMap, ReturnMap
from dolfinx_contact.law.wear import Wear
from dolfinx_contact.step.errors import NodalStiffness
from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.surfaces.surface import Surface

# Gap at least of nodes that cannot touch, over the largest coordinate: any that rounding leaves open.
CLEAR = 1e-9


class Contact(ContactKinematics):
    """Nodes of boundary facets that may touch a rigid plane, or another rigid surface.

    Every node belongs to one rank; all arrays run over the ``n`` nodes that this rank owns.  The
    local frame is (t1, t2, n), in two dimensions (t, n): the plane's axis, the direction across
    it, and the normal.  On a curved surface every node has its own, see docs/surfaces.md.

    Args:
        V: Continuous Lagrange space of displacements, one component per dimension, of degree 1 or 2; or a mixed
            space, whose first such sub-space they are, or that sub-space itself.
        facets: Local indices of boundary facets, integers; a rank may have none.
        plane: The ``RigidPlane``, ``RigidSphere``, ``RigidCylinder`` or ``RigidSurface``.
        friction: The friction law, or a number, its isotropic coefficient, the same on all ranks; or on all of them one with coefficients
            per node, ``shape=(n, 2)``, for the n nodes of each; or of fields, evaluated at the nodes here.
        wear: Archard's law, if worn depth is to open the gap; None costs nothing.
        weight: Of the surface measure, where the forms have one: ``2 * pi * r`` with axial symmetry, a thickness.  A number, a UFL
            expression, or a callable of ``x``, ``shape=(3, n)``.  It enters areas, and so pressures, worn depths and friction that
            follows the pressure; reactions have it from the forms.

    Raises:
        ValueError: on all ranks, for facets that are not boundary facets of the mesh, a space that
            does not fit, a plane of another dimension or without an axis where friction needs one.

    Attributes:
        nodes: Indices of the nodes among the blocks of ``displacements.V``, which is ``V`` or that sub-space collapsed,
            ``shape=(n,)``: those of the facets, but not vertices of tetrahedra of second order, on which an even pressure makes no force.
        x: Reference positions, ``shape=(n, 3)``, global frame.
        rho: Augmentation parameter of ``update``, ``shape=(n,)``, force per length; see ``set_metric``.

    Example:
        >>> contact = dc.Contact(V, foot, plane, dc.Friction(mu=0.3))
        >>> contact.x.shape == contact.reaction.shape  # 25 nodes of the block's foot on one rank
        True
    """

    rho: np.ndarray | None
    _settable = ("friction", "wear", "rho")
    _remedy = (
        "results are read-only, and what a contact was made of stays; friction and wear may be exchanged between "
        "steps, and for another space, plane or other facets make a new Contact."
    )

    def __init__(self, V: fem.FunctionSpace, facets: ArrayLike, surface: Surface, friction: Friction | float, wear: Wear | None = None, weight: Any = None) -> None:  # fmt: skip
        if not compat.is_function_space(V):
            raise ValueError(f"V must be a DOLFINx function space, got {type(V).__name__}.")
        mesh, friction = V.mesh, as_friction(friction)
        gdim, fdim = mesh.geometry.dim, mesh.topology.dim - 1
        for dims in ((fdim, fdim + 1), (fdim, 0)):
            mesh.topology.create_connectivity(*dims)
        boundary = exterior_facet_indices(mesh.topology)
        with raised_together(mesh.comm):
            check_space(V)
            facets = checked_facets(facets, mesh.topology.index_map(fdim), boundary)
            check_law(surface, friction, gdim)
            check_wear(wear)
        self.V, self.comm, self.surface = V, mesh.comm, surface
        self.displacements = Displacements(V)
        with raised_together(mesh.comm):
            self._weight = weight_on(self.displacements.V, weight)
        self.nodes = frozen(contact_nodes(self.displacements.V, facets, self._weight))
        self.x = frozen(self.displacements.x[self.nodes])
        with raised_together(mesh.comm):
            surface.check_at(surface.relative(self._at))
        self.place()
        self.friction, self.wear, self.rho = friction, wear, None
        total = mesh.comm.allreduce(self.nodes.size, op=MPI.SUM)
        described = mesh.comm.bcast(self.described(), root=0)
        with raised_together(mesh.comm):
            self.check(described)
            if total == 0:
                raise ValueError(
                    "facets is empty on all ranks: name the facets that may touch. If they come from tags, "
                    "facet_tags.values has the tags that the mesh has; if from a position, compare it with mesh.geometry.x."
                )
        self.facets, self._geometry, self._owner = frozen(facets), self._digest(), None
        self._apart = CLEAR * np.abs(mesh.geometry.x).max(initial=0.0)
        self.reset()
        self._made = True

    def __repr__(self) -> str:
        friction = "friction per node" if self.friction.mu.ndim == 2 else repr(self.friction)
        return f"<Contact of {self.nodes.size} nodes on this rank, {self.surface!r}, {friction}, wear={self.wear!r}>"

    def belong_to(self, problem) -> None:
        """From now on ``problem`` makes this contact's history."""
        self._owner = weakref.ref(problem)

    def belongs_to(self, problem) -> bool:
        """Whether no later problem has taken this contact."""
        return self._owner is not None and self._owner() is problem

    @property
    def has_history(self) -> bool:
        """Whether a step was made since the contact was, or since it was reset; the same on all ranks."""
        return self._settled_by is not None

    def mesh_has_moved(self) -> bool:
        """Whether the mesh has been moved or scaled since the contact was made, on this rank."""
        return self._digest() != self._geometry

    def _digest(self) -> bytes:
        return hashlib.blake2b(np.ascontiguousarray(self.V.mesh.geometry.x)).digest()

    # -- one iteration -------------------------------------------------------------------------

    def set_metric(self, K: PETSc.Mat) -> None:
        """Take ``rho`` from the assembled stiffness: the normal diagonal entry of each node.

        Args:
            K: Assembled PETSc stiffness matrix on ``V``.  Collective.
        """
        self.rho = self.nodal_stiffness(K).normal

    def nodal_stiffness(self, K: PETSc.Mat) -> NodalStiffness:
        """Normal and tangential blocks of the stiffness at the contact nodes, local frame.

        Args:
            K: Assembled PETSc stiffness matrix on ``V``.  Collective.

        Raises:
            ValueError: on all ranks, if a node does not resist being moved along the normal.
        """
        stiffness = self.points.stiffness(K)
        with raised_together(self.comm):
            if not (stiffness.normal > 0.0).all():
                node = int(np.argmin(stiffness.normal))
                raise ValueError(
                    f"the stiffness of the contact node at {self.x[node].tolist()} along the normal is "
                    f"{stiffness.normal[node]:g}, which must be positive: check the sign of F (internal minus "
                    "external work) and the moduli."
                )
        return stiffness

    def add_springs(self, K: PETSc.Mat, springs: np.ndarray) -> None:
        """Add a spring per contact node and local direction to a PETSc matrix.  Collective.

        Args:
            K: Assembled PETSc matrix on ``V``, changed in place.
            springs: Stiffnesses, ``shape=(n, gdim)``, local frame, force per length.
        """
        add_to(K, self.points.matrix(springs[:, :, None] * np.eye(self.points.dim)))

    def update(self, u: fem.Function | np.ndarray, map: str = "bipotential") -> None:
        """One predictor and corrector for all nodes, with the augmentation parameter ``rho``.

        Takes ``u``, computes gaps and slip increments, and replaces ``reaction`` by its predictor's
        projection on the friction cone, and ``status`` by the branch that the projection took.

        Args:
            u: Function on ``V``, or the array of its owned degrees of freedom; length units.
            map: "bipotential" for the paper's predictor and Euclidean projection [dSFMH07, Section
                2], "return" for a predictor without the translated normal term and a projection in
                the metric of the slip rule.  Both have the same fixed points.

        Raises:
            ValueError: ``rho`` has not been set; see ``set_metric``.
        """
        self.respond(u, self._map(map))

    def springs(self, map: str = "bipotential") -> np.ndarray:
        """Springs that belong to ``update``, ``shape=(n, gdim)``, local frame, force per length.

        ``rho diag(Q^2, 1)`` for the paper's map, ``rho`` in all directions for the return map;
        none along the plane without friction.
        """
        return self._map(map).springs(self.friction, self.points.dim)

    def _map(self, name: str):
        if self.rho is None:
            raise ValueError("contact.rho is not set: call contact.set_metric(K) first.")
        return BipotentialMap(self.rho) if name == "bipotential" else ReturnMap(self.rho, self.rho)

    def respond(self, u, map) -> None:
        """Move to ``u``, and replace ``reaction`` and ``status`` by what a map of ``maps.py`` makes of them."""
        self.move(u)
        reaction, status = map(self.law_of(self.law), self.reaction, self.gap, self.slip_increment)
        self.take(reaction=reaction, status=status)

    def respond_with_derivatives(self, u, map) -> tuple[np.ndarray, np.ndarray]:
        """As ``respond``, and the (Clarke) derivatives of the new reactions on the branches taken.

        Returns:
            Derivatives by the reaction before, dimensionless, and by slip and gap, force per length;
            ``shape=(n, gdim, gdim)`` each, local frame.
        """
        self.move(u)
        state = self.reaction, self.gap, self.slip_increment
        reaction, status, *derivatives = map.linearised(self.law_of(self.law), *state)
        self.take(reaction=reaction, status=status)
        return tuple(derivatives)

    def take_reaction(self, forces: np.ndarray) -> None:
        """Take reactions from nodal forces on the body, owned degrees of freedom, global frame."""
        reaction = self.points.reactions(forces)
        reaction[self.points.closed] = 0.0
        self.take(reaction=reaction)

    def release(self) -> None:
        """No reactions: all nodes open."""
        status = np.full_like(self.status, int(Status.OPEN))
        self.take(reaction=np.zeros_like(self.reaction), status=status)

    def assemble_reaction(self, b: PETSc.Vec | np.ndarray) -> None:
        """Add the nodal reactions, forces on the body, to ``b``.

        Args:
            b: PETSc vector on ``V``, or the array of its owned degrees of freedom, oriented as
                ``f - K u``: applied minus internal forces.
        """
        array = b if isinstance(b, np.ndarray) else b.array_w
        self.points.add_forces(self.reaction, array[: self.points.size])

    # -- history -------------------------------------------------------------------------------

    def advance(self) -> None:
        """Make the present state the last converged one, from which the next slip is measured."""
        before, slipped = self.last.reaction, self.last.status == int(Status.SLIP)
        law, law_before = self.friction, self.law_before
        slip = self.slip_kept + self.slip_increment
        rough = np.broadcast_to(law.mu, (len(slip), 2)).any(axis=1)
        sticks = (rough & (self.status == int(Status.STICK)))[:, None]
        slip, kept = np.where(sticks, 0.0, slip), np.where(sticks, slip, 0.0)
        if self._begun is None:
            work = work_of_friction(law, before, slipped, self.reaction, slip, law_before)
        else:  # forces before the step with the law at its beginning
            none = np.zeros_like(before)
            work = work_of_friction(self._begun, before, slipped, none, slip, law_before)
            work += work_of_friction(law, none, slipped, self.reaction, slip)
        touched = (before[:, -1] > 0.0) | (self.reaction[:, -1] > 0.0)
        path = touched * np.linalg.norm(slip, axis=1)
        depth = np.zeros_like(path) if self.wear is None else self.wear.depth(work, self.area)
        self._unloads = depth, np.maximum(before[:, -1], self.reaction[:, -1])
        self.settle(work.sum(axis=1), path, depth, kept)
        self._settled_by = self.friction

    def worn_in_a_leap(self, stiffness: NodalStiffness) -> tuple[float, float, list]:
        """Of the node whose depth worn in the last step unloads it most: by how many times its reaction, depth and position.

        Wear is explicit: the depth opens the gap of the next step.  With the node's own stiffness ``kappa`` it takes
        ``kappa`` times the depth from the reaction.

        Args:
            stiffness: Of the nodes.  Collective.
        """
        depth, carried = self._unloads
        taken = np.divide(stiffness.normal * depth, carried, np.zeros_like(depth), where=carried > 0)  # fmt: skip
        k = int(taken.argmax()) if taken.size else None
        mine = (0.0, 0.0, []) if k is None else (float(taken[k]), float(depth[k]), self.x[k].tolist())  # fmt: skip
        return max(self.comm.allgather(mine))
