"""The contact of boundary nodes with a rigid plane: kinematics, reactions and their history."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import exterior_facet_indices, meshtags
from mpi4py import MPI

from dolfinx_contact import compat
from dolfinx_contact.collective import raised_together
from dolfinx_contact.contact.interface import ContactPoints, add_to
from dolfinx_contact.contact.plane import RigidPlane
from dolfinx_contact.error import EPSILON, NodalStiffness
from dolfinx_contact.law.dissipation import work_of_friction
from dolfinx_contact.law.friction import Friction
from dolfinx_contact.law.maps import BipotentialMap, ReturnMap
from dolfinx_contact.law.wear import Wear


class Status(IntEnum):
    """What a contact node does, which is the branch that the projection took."""

    OPEN = 0
    STICK = 1
    SLIP = 2


class _State(NamedTuple):
    """All that a step leaves to the next one; arrays over the owned contact nodes, local frame."""

    displacement: np.ndarray  # of the node relative to the plane, (n, gdim)
    reaction: np.ndarray  # (n, gdim)
    gap: np.ndarray  # (n,)
    slip_increment: np.ndarray  # (n, gdim - 1)
    status: np.ndarray  # (n,)


class Contact:
    """Nodes of boundary facets that may touch a rigid plane.

    Every node belongs to one rank; all arrays run over the ``n`` nodes that this rank owns.  The
    local frame is (t1, t2, n), in two dimensions (t, n): the plane's axis, the direction across
    it, and the normal.

    Args:
        V: First-order continuous Lagrange space of displacements, one component per dimension.
        facets: Local indices of boundary facets, integers; a rank may have none.
        plane: The rigid plane.
        friction: The friction law, the same on all ranks; or on all of them one with coefficients
            per node, ``shape=(n, 2)``, for the n nodes of each.
        wear: Archard's law, if worn depth is to open the gap; None costs nothing.

    Raises:
        ValueError: on all ranks, for facets that are not boundary facets of the mesh, a space that
            does not fit, a plane of another dimension or without an axis where friction needs one.

    Attributes:
        nodes: Indices of the nodes among the blocks of ``V``, ``shape=(n,)``.
        x: Reference positions, ``shape=(n, 3)``, global frame.
        gap: Distance to the plane, ``shape=(n,)``; negative is penetration.
        slip_increment: Slip relative to the plane since the last step, ``shape=(n, gdim - 1)``, local.
        reaction: Force of the plane on the body, ``shape=(n, gdim)``, local frame.
        status: A ``Status`` per node, ``shape=(n,)``.
        rho: Augmentation parameter of ``update``, ``shape=(n,)``, force per length; see ``set_metric``.
        points: The ``ContactPoints``: motion as a sparse operator, directions that supports hold.
        dissipation: Work of friction since the start, ``shape=(n,)``, force times length; it never
            decreases, see ``work_of_friction`` in ``dissipation.py``.
        slip_path: Length of the path slipped while in contact since the start, ``shape=(n,)``.
        wear_depth: Worn depth, ``shape=(n,)``, length; never decreases, zero without ``wear``.
    """

    def __init__(self, V, facets, plane: RigidPlane, friction: Friction, wear: Wear | None = None):
        if not compat.is_function_space(V):
            raise ValueError(f"V must be a DOLFINx function space, got {type(V).__name__}.")
        mesh = V.mesh
        gdim, fdim = mesh.geometry.dim, mesh.topology.dim - 1
        for dims in ((fdim, fdim + 1), (fdim, 0)):
            mesh.topology.create_connectivity(*dims)
        boundary = exterior_facet_indices(mesh.topology)
        with raised_together(mesh.comm):
            _check_space(V)
            facets = _checked_facets(facets, mesh.topology.index_map(fdim), boundary)
            _check_law(plane, friction, gdim)
            if not (wear is None or isinstance(wear, Wear)):
                raise ValueError(
                    f"wear must be a Wear or None, got {type(wear).__name__}: {wear!r}."
                )
        law = "friction per node" if friction.mu.ndim == 2 else friction
        described = repr((plane, plane.displacement.tolist(), law, wear))
        same = described == mesh.comm.bcast(described, root=0)
        blocks = fem.locate_dofs_topological(V, fdim, facets)
        owned = V.dofmap.index_map.size_local
        self.nodes = np.unique(blocks[blocks < owned])
        total = mesh.comm.allreduce(self.nodes.size, op=MPI.SUM)
        with raised_together(mesh.comm):
            if not same:
                raise ValueError(f"plane and friction differ between ranks: here {described}.")
            if total == 0:
                raise ValueError("facets is empty on all ranks: name the facets that may touch.")
            _check_coefficients(friction, self.nodes.size)

        self.V, self.plane, self.friction, self.wear = V, plane, friction, wear
        self._facets, self._area = facets, None
        self.comm = mesh.comm
        self.law = friction.law(gdim)
        self.frame = plane.frame
        self.x = V.tabulate_dof_coordinates()[self.nodes]
        self.rho = None
        dofs = gdim * self.nodes[:, None] + np.arange(gdim)
        frames = np.tile(self.frame, (self.nodes.size, 1, 1))
        self.points = ContactPoints(dofs, frames, gdim * owned)
        self.reset()

    def reset(self) -> None:
        """Forget the history: undeformed, unworn body, no reactions, the plane where it is now."""
        n, gdim = self.points.count, self.points.dim
        self.dissipation, self.slip_path, self.wear_depth = np.zeros((3, n))
        self._converged = _State(
            np.tile(-self.frame @ self.plane.displacement, (n, 1)),
            np.zeros((n, gdim)),
            self._gap0 - (self.frame @ self.plane.displacement)[-1],
            np.zeros((n, gdim - 1)),
            np.full(n, Status.OPEN, dtype=np.uint8),
        )
        self.restore()

    @property
    def _gap0(self) -> np.ndarray:
        flat = (self.x[:, : self.plane.point.size] - self.plane.point) @ self.plane.normal
        return flat + self.wear_depth

    # -- one iteration -------------------------------------------------------------------------

    def set_metric(self, K) -> None:
        """Take ``rho`` from the assembled stiffness: the normal diagonal entry of each node.

        Args:
            K: Assembled PETSc stiffness matrix on ``V``.  Collective.
        """
        self.rho = self.nodal_stiffness(K).normal

    def nodal_stiffness(self, K) -> NodalStiffness:
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

    def add_springs(self, K, springs: np.ndarray) -> None:
        """Add a spring per contact node and local direction to a PETSc matrix.  Collective.

        Args:
            K: Assembled PETSc matrix on ``V``, changed in place.
            springs: Stiffnesses, ``shape=(n, gdim)``, local frame, force per length.
        """
        add_to(K, self.points.matrix(springs[:, :, None] * np.eye(self.points.dim)))

    def move(self, u) -> None:
        """Gaps and slip increments for a displacement, from the last converged step on.

        Args:
            u: Function on ``V``, or the array of its owned degrees of freedom; length units.
        """
        values = u.x.array if hasattr(u, "x") else u
        moved = self.frame @ self.plane.displacement
        self._displacement = self.points.motion(values[: self.points.size]) - moved
        self.gap = self._gap0 + self._displacement[:, -1]
        self.slip_increment = (self._displacement - self._converged.displacement)[:, :-1]
        self.slip_increment[self.points.held] = 0.0

    def gap_rounding(self, u: np.ndarray) -> float:
        """Bound of the rounding in a gap, that of solving for ``u`` included, length units."""
        lengths = (self.x, self.plane.point, self.plane.displacement, self.points.motion(u))
        return 16 * np.finfo(float).eps * max(np.abs(length).max(initial=0.0) for length in lengths)

    def motion_rounding(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Estimate of the rounding in each gap, ``shape=(n,)``, and slip, ``shape=(n, gdim - 1)``, length units.

        That of the coordinates counts in the gap: a body drawn to rest on the plane may stand a last digit below it.

        Args:
            u: Displacement of owned degrees of freedom, for which gaps and slips were computed.
        """
        terms = self.points.magnitudes(u) + np.abs(self.frame) @ np.abs(self.plane.displacement)
        coordinates = max(np.abs(a).max(initial=0.0) for a in (self.x, self.plane.point))
        gap = terms[:, -1] + coordinates + self.wear_depth
        slip = terms[:, :-1] + np.abs(self._converged.displacement[:, :-1])
        slip[self.points.held] = 0.0
        return EPSILON * gap, EPSILON * slip

    def update(self, u, map: str = "bipotential") -> None:
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
        self.reaction, self.status = map(self.law, self.reaction, self.gap, self.slip_increment)

    def respond_with_derivatives(self, u, map) -> tuple[np.ndarray, np.ndarray]:
        """As ``respond``, and the (Clarke) derivatives of the new reactions on the branches taken.

        Returns:
            Derivatives by the reaction before, dimensionless, and by slip and gap, force per length;
            ``shape=(n, gdim, gdim)`` each, local frame.
        """
        self.move(u)
        state = self.reaction, self.gap, self.slip_increment
        self.reaction, self.status, *derivatives = map.linearised(self.law, *state)
        return tuple(derivatives)

    def take_reaction(self, forces: np.ndarray) -> None:
        """Take reactions from nodal forces on the body, owned degrees of freedom, global frame."""
        self.reaction = self.points.reactions(forces)

    def assemble_reaction(self, b) -> None:
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
        before, slipped = self._converged.reaction, self._converged.status == Status.SLIP
        work = work_of_friction(self.friction, before, slipped, self.reaction, self.slip_increment)
        self.dissipation += work.sum(axis=1)
        if self.wear is not None:
            self.wear_depth += self.wear.depth(work, self.area)
        touched = (before[:, -1] > 0.0) | (self.reaction[:, -1] > 0.0)
        self.slip_path += touched * np.linalg.norm(self.slip_increment, axis=1)
        self._converged = _State(
            self._displacement, self.reaction, self.gap, self.slip_increment, self.status
        )

    def restore(self) -> None:
        """Return to the last converged state."""
        last = self._converged
        self._displacement, self.reaction, self.gap, self.slip_increment, self.status = last

    def save(self) -> dict[str, np.ndarray]:
        """All that the next step starts from, as arrays by name; this rank's nodes."""
        cumulative = ("dissipation", "slip_path", "wear_depth")
        return {
            **self._converged._asdict(),
            **{name: getattr(self, name).copy() for name in cumulative},
            "plane": self.plane.displacement.copy(),
        }

    def load(self, saved) -> None:
        """Take back what ``save`` returned, with the same nodes on this rank.

        Raises:
            ValueError: an array is missing or of another size.
        """
        present = self.save()
        for name, array in present.items():
            if name not in saved or saved[name].shape != array.shape:
                found = saved[name].shape if name in saved else "nothing"
                raise ValueError(
                    f"checkpoint: {name} needs shape {array.shape}, found {found}. It was written "
                    "for another mesh or another contact."
                )
        self._converged = _State(*(np.array(saved[name]) for name in _State._fields))
        for name in ("dissipation", "slip_path", "wear_depth"):
            setattr(self, name, np.array(saved[name]))
        self.plane.displacement = saved["plane"]
        self.restore()

    @property
    def displacement(self) -> np.ndarray:
        """Displacement of the nodes relative to the plane, ``shape=(n, gdim)``, local frame, length."""
        return self._displacement

    @property
    def previous_reaction(self) -> np.ndarray:
        """Reactions of the last converged step, ``shape=(n, gdim)``, local frame."""
        return self._converged.reaction

    # -- results -------------------------------------------------------------------------------

    @property
    def load_function(self) -> np.ndarray:
        """f = ||M^-1 r_t|| - r_n, ``shape=(n,)``, force units [dSFMH07, Eq. (1)]."""
        return self.law.load_function(self.reaction)

    @property
    def bipotential_gap(self) -> np.ndarray:
        """Certificate b_c + Delta u . r >= 0 of each node, ``shape=(n,)``, force times length.

        Zero exactly where the law holds [dSFMH07, Section 1].  Evaluated at ``max(gap, 0)``;
        penetration is reported by itself.
        """
        return self.law.bipotential_gap(
            self.reaction, np.maximum(self.gap, 0.0), self.slip_increment
        )

    @property
    def slip_residual(self) -> np.ndarray:
        """What of the slip increments the slip rule leaves unexplained, ``shape=(n, gdim - 1)``, length.

        ``Delta u_t + |Delta u_t| d`` on slipping nodes, ``d`` the unit vector along ``P^-2 r_t``, and ``Delta u_t``
        on sticking ones [dSFMH07, Section 1]; zero on open and frictionless nodes.
        """
        slip, mu = self.slip_increment, self.friction.mu[..., :1]
        against = self.friction.against_slip(self.reaction[:, :-1])
        length = np.linalg.norm(slip, axis=1, keepdims=True)
        slips = (self.status == Status.SLIP)[:, None]
        bound = (self.status != Status.OPEN)[:, None] & (mu > 0)
        return np.where(bound, slip + slips * length * against, 0.0)

    def force(self) -> np.ndarray:
        """Total reaction, ``shape=(gdim,)``, global frame, the same on all ranks.  Collective."""
        return self.comm.allreduce(self.reaction.sum(axis=0)) @ self.frame

    @property
    def area(self) -> np.ndarray:
        """Area of the contact surface that belongs to each node, ``shape=(n,)``, reference state.

        The integral of the node's shape function over the facets; a length in two dimensions.
        Collective at the first call.
        """
        if self._area is None:
            mesh, fdim = self.V.mesh, self.V.mesh.topology.dim - 1
            mine = np.unique(self._facets[self._facets < mesh.topology.index_map(fdim).size_local])
            tags = meshtags(mesh, fdim, mine, np.ones(mine.size, dtype=np.int32))
            ds = ufl.Measure("ds", domain=mesh, subdomain_data=tags)(1)
            form = fem.form(ufl.TestFunction(self.V)[0] * ds)
            work = fem.Function(self.V)
            compat.assemble_into(work.x, form)
            self._area = work.x.array[self.points.dofs[:, 0]]
        return self._area

    @property
    def pressure(self) -> np.ndarray:
        """Normal reaction over nodal area, ``shape=(n,)``, force per area.  Collective at first."""
        return self.reaction[:, -1] / self.area

    def function(self, values, name: str = "f", elsewhere: float = 0.0):
        """Values at the contact nodes, ``shape=(n,)``, as a scalar Function for output.  Collective."""
        scalars, parent = self.V.sub(0).collapse()
        node = np.ravel(parent) // self.frame.shape[0]
        function = fem.Function(scalars, name=name)
        function.x.array[:] = elsewhere
        function.x.array[np.argsort(node)[self.nodes]] = values
        function.x.scatter_forward()
        return function

    def reaction_function(self):
        """Nodal reactions in global components as a Function on ``V``, zero elsewhere."""
        function = fem.Function(self.V, name="reaction")
        self.assemble_reaction(function.x.array)
        function.x.scatter_forward()
        return function


def _check_space(V) -> None:
    mesh = V.mesh
    gdim, tdim = mesh.geometry.dim, mesh.topology.dim
    components = V.dofmap.index_map_bs
    if gdim != tdim or gdim not in (2, 3):
        raise ValueError(
            f"V lives on a mesh of dimension {tdim} in {gdim}-D space: need 2 or 3 in both."
        )
    if components != gdim:
        raise ValueError(
            f"V has {components} component(s) on a {gdim}-D mesh: a displacement has one per "
            f'dimension, functionspace(mesh, ("Lagrange", 1, ({gdim},))).'
        )
    if compat.lagrange_degree(V) != 1:
        raise ValueError(
            f"V must be continuous Lagrange of degree 1 (other orders are not supported yet), "
            f"got {V.ufl_element()}."
        )


def _checked_facets(facets, index_map, boundary) -> np.ndarray:
    array = np.asarray(facets)
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


def _check_law(plane, friction, gdim: int) -> None:
    if not isinstance(plane, RigidPlane):
        raise ValueError(f"plane must be a RigidPlane, got {type(plane).__name__}: {plane!r}.")
    if not isinstance(friction, Friction):
        raise ValueError(
            f"friction must be a Friction, got {type(friction).__name__}: {friction!r}."
        )
    if plane.point.size != gdim:
        raise ValueError(f"{plane} has {plane.point.size} dimensions, the mesh {gdim}.")
    friction.law(gdim)  # refuses what has no meaning in two dimensions
    if gdim == 3 and plane.axis is None and not friction.isotropic:
        raise ValueError(
            f"plane.axis is None, but {friction} depends on the direction: give RigidPlane the first "
            "principal friction direction, axis=(...)."
        )


def _check_coefficients(friction, n: int) -> None:
    for name in ("mu", "p", "axes"):
        shape = np.shape(getattr(friction, name))
        if len(shape) == 2 and shape[0] != n:
            raise ValueError(
                f"friction.{name} has {shape[0]} rows, this rank owns {n} contact nodes."
            )
