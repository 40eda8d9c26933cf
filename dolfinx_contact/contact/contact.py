"""The contact of boundary nodes with a rigid surface: reactions and their history."""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem
from dolfinx.mesh import exterior_facet_indices
from mpi4py import MPI
from numpy.typing import ArrayLike
from petsc4py import PETSc

from dolfinx_contact import compat
from dolfinx_contact.contact import fields
from dolfinx_contact.contact.contact_step import ContactStep
from dolfinx_contact.contact.displacements import Displacements
from dolfinx_contact.contact.fields import contact_nodes, weight_on
from dolfinx_contact.contact.input import (
    check_coefficients,
    check_law,
    check_opposite,
    check_space,
    check_wear,
    checked_facets,
    given_facets,
)
from dolfinx_contact.contact.interface import ContactPoints, NodalStiffness, add_to
from dolfinx_contact.contact.laws import Laws, rows
from dolfinx_contact.contact.placement import Placed, Placement
from dolfinx_contact.contact.state import KEPT, OPPOSITE, SUMS, History, State, Status
from dolfinx_contact.law.friction import Friction, as_friction
from dolfinx_contact.law.maps import BipotentialMap, ContactLaw, ReturnMap
from dolfinx_contact.support.attributes import Guarded, frozen
from dolfinx_contact.support.checks import number, place, positive
from dolfinx_contact.support.collective import agree, raised_together
from dolfinx_contact.surfaces.surface import Surface

if TYPE_CHECKING:
    from dolfinx.mesh import MeshTags  # before 0.6 it has another name

    from dolfinx_contact.law.wear import Wear


# Radians by which a plane may turn until areas that it sees, of which the cosine is left, are computed anew.
TILTED = 0.01


class Contact(Guarded):
    """Nodes of boundary facets that may touch a surface, rigid or deformable.

    Every node belongs to one rank; all arrays run over the ``n`` nodes that this rank owns.  The local frame is (t1, t2, n), in
    two dimensions (t, n): the plane's axis, the direction across it, and the normal.  On a curved surface every node has its own
    frame, see docs/surfaces.md.

    Args:
        V: Continuous Lagrange space of displacements, one component per dimension, of degree 1 or 2; or a mixed space, whose
            first such sub-space is taken, or that sub-space itself.
        facets: Local indices of boundary facets, integers; a rank may have none.  Or ``(facet_tags, tag)`` with one tag, an
            integer, or several.
        plane: The ``RigidPlane``, ``RigidSphere``, ``RigidCylinder``, ``RigidSurface`` or ``DeformableSurface``.
        friction: A ``Friction``, or a number, the isotropic coefficient, the same on all ranks.  Coefficients may be given per
            node, ``shape=(n, 2)`` for this rank's n nodes, or as fields, which the contact evaluates at its nodes.
        wear: Archard's law, whose worn depth opens the gap; None is no wear.  Between two deformable bodies, the law has a
            coefficient for each, see ``Wear``.
        weight: Factor of the surface measure, the same as in the forms: ``2 * pi * r`` with axial symmetry, or a thickness.  A
            number, a UFL expression, or a callable of ``x``, ``shape=(3, n)``.  It enters areas, and thus pressures, worn depths
            and pressure-dependent friction.  Reactions follow from the forms, which must contain it.

    Raises:
        ValueError: on all ranks, for facets that are not boundary facets of the mesh, an unsuitable space, a plane of another
            dimension, or a plane without an axis if friction needs one.

    Attributes:
        nodes: Indices of the nodes among the blocks of ``displacements.V``, which is ``V`` or that sub-space collapsed,
            ``shape=(n,)``: those of the facets, without the vertices of second-order tetrahedra, where a uniform pressure causes
            no force.
        x: Reference positions, ``shape=(n, 3)``, global frame.
        rho: Augmentation parameter of ``update``, ``shape=(n,)``, force per length; see ``set_metric``.

    Example:
        >>> contact = dc.Contact(V, foot, plane, dc.Friction(mu=0.3))
        >>> contact.x.shape == contact.reaction.shape  # 25 nodes of the block's foot on one rank
        True
    """

    rho: np.ndarray | None
    _settable = ("friction", "wear", "rho", "repeats")
    _remedy = (
        "results are read-only, and what a contact was made of stays; friction and wear may be exchanged between "
        "steps, and for another space, plane or other facets make a new Contact."
    )

    def __init__(self, V: fem.FunctionSpace, facets: ArrayLike | tuple[MeshTags, int | Sequence[int]], surface: Surface, friction: Friction | float, *, wear: Wear | None = None, weight: Any = None) -> None:  # fmt: skip
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
            self._weight = weight_on(self.displacements.V, weight)
        nodes = contact_nodes(self.displacements.V, facets, self._weight)
        self.nodes, self.left_out = map(frozen, nodes)
        self.x = frozen(self.displacements.x[self.nodes])
        self._area: np.ndarray | None = None
        self._opposite_area: np.ndarray | None = None
        self._repeats = 1.0
        self._axial: bool | None = None
        x, dofs = self.x[:, :gdim], self.displacements.dofs(self.nodes)
        with raised_together(mesh.comm):
            surface.check_at(surface.relative(x))
        extent = mesh.comm.allreduce(np.abs(mesh.geometry.x).max(initial=0.0), op=MPI.MAX)
        owned = self.displacements.owned
        if surface.deformable:
            from dolfinx_contact.contact.mortar_points import MortarPlacement

            self._placement = MortarPlacement(self, facets, owned, extent)
        else:
            self._placement = Placement(surface, x, dofs, self.points_in, extent, mesh.comm)
        self._laws, self.rho = Laws(), None
        self._begin(self._placement.standing(surface.varies))
        self._laws.assign(self, friction, empty=True)
        self.wear = wear
        total = mesh.comm.allreduce(self.nodes.size, op=MPI.SUM)
        self.check()
        with raised_together(mesh.comm):
            if total == 0:
                raise ValueError(
                    "facets is empty on all ranks: name the facets that may touch. If they come from tags, "
                    "facet_tags.values has the tags that the mesh has; if from a position, compare it with mesh.geometry.x."
                )
        self.facets, self._geometry, self._owner = frozen(facets), mesh.geometry.x.copy(), None
        self.reset()
        self._made = True

    def __repr__(self) -> str:
        friction = "friction per node" if self.friction.mu.ndim == 2 else repr(self.friction)
        return f"<Contact of {self.nodes.size} nodes on this rank, {self.surface!r}, {friction}, wear={self.wear!r}>"

    def belong_to(self, problem: object) -> None:
        """From now on ``problem`` makes this contact's history."""
        self._owner = weakref.ref(problem)

    def belongs_to(self, problem: object) -> bool:
        """Whether no later problem has taken this contact."""
        return self._owner is not None and self._owner() is problem

    @property
    def has_history(self) -> bool:
        """Whether a step was made since the contact was, or since it was reset; the same on all ranks."""
        return self.history.friction is not None

    def mesh_has_moved(self) -> bool:
        """Whether the mesh has been moved or scaled since the contact was made, on this rank."""
        return not np.array_equal(self.V.mesh.geometry.x, self._geometry)

    @property
    def plane(self) -> Surface:
        """``surface``, as scripts call it whose surface is a plane."""
        return self.surface

    # -- laws ----------------------------------------------------------------------------------

    @property
    def friction(self) -> Friction:
        """The friction law.  Another one may be assigned between steps, on all ranks.  Fields are evaluated then, at the start of
        each step, and during a step if they depend on its state.
        """
        return self._laws.friction

    @friction.setter
    def friction(self, friction: Friction | float) -> None:
        self._laws.assign(self, friction)

    @property
    def wear(self) -> Wear | None:
        """The law of wear.  Another one may be assigned between steps, on all ranks."""
        return self._laws.wear

    @wear.setter
    def wear(self, wear: Wear | None) -> None:
        check_wear(wear, self.surface)
        field = None
        with raised_together(self.comm):
            if wear is not None:
                from dolfinx_contact.contact.friction_field import wear_on_nodes

                field = wear_on_nodes(self, wear)
        self._laws.wear, self._laws.wear_field = wear, field

    @property
    def repeats(self) -> float:
        """How many times what a step wears, works and slips counts, 1 at first, none at 0; ``cycle_jump`` sets it.  The same on all ranks."""
        return self._repeats

    @repeats.setter
    def repeats(self, times: float) -> None:
        count = number("repeats", times)
        self._repeats = positive("repeats", count) if count != 0.0 else 0.0

    @property
    def law(self) -> ContactLaw:
        """The kernel's law of this friction."""
        return self._laws.kernel

    @property
    def follows_pressure(self) -> bool:
        """Whether friction follows the pressure at the end of the step."""
        return self._laws.follow_pressure

    def friction_under(self, step: ContactStep, state: State) -> Friction:
        """The law of the pressures in a state, that of the step itself if it stays.  Collective."""
        pressure = fields.per_area(state.reaction[:, -1], self.area)
        return self._laws.under(self, pressure, step.friction, step.frames)

    def check(self) -> None:
        """Raise a ``ValueError`` on all ranks if a law does not fit their nodes, or surface or laws differ.  Collective."""
        if self.comm.size > 1:
            agree(self.comm, **self._laws.described(self.surface), repeats=self._repeats)
        with raised_together(self.comm):
            check_coefficients(self.friction, self.nodes.size)

    # -- nodes that supports hold --------------------------------------------------------------

    def meet(self, fixed: np.ndarray) -> None:
        """Let frames that are means of facets' know of supports at these degrees of freedom; the last state goes along.  Collective."""
        history = self.history
        frames = self._placement.met(fixed, history.frames)
        if frames is not history.frames:
            last = self._placement.turned(frames, history, self.opening)
            self.go_back(history.but(last=last, frames=frames))

    # -- in a step -----------------------------------------------------------------------------

    def in_step(
        self,
        stiffness: NodalStiffness | None = None,
        frames: Placed | None = None,
        begins: bool = False,
    ) -> ContactStep:
        """The contact as a step has it that begins at its last state, where the surface stands.  Collective on deformable surfaces.

        Args:
            stiffness: Of the nodes.
            frames: Of the step; None are those of the last one.
            begins: Whether fields get their present values.  Collective.
        """
        placement, laws, history = self._placement, self._laws, self.history
        frames = history.frames if frames is None else frames
        friction, begun = laws.at_start(self, frames) if begins else (laws.friction, None)
        same = friction is laws.friction
        law = laws.kernel if same else friction.law(self.displacements.dim)
        last, moved = placement.last_in(frames, history), placement.surface_moved(frames)
        given = frames, friction, law, last, moved, self.opening_at(frames.points)
        return ContactStep(self, *given, placement.clear, stiffness, begun=begun)

    def frames_of_step(
        self, start: np.ndarray, at: np.ndarray | None = None, before: Placed | None = None
    ) -> Placed:
        """Frames and gaps of a step, where the surface is at present, see ``Placement.following``.  Collective."""
        history, wanders = self.history, self._wanders
        if not self._placement.follows(wanders, history):
            return history.frames
        return self._placement.following(start, at, wanders, history, before)

    def at(self, u: fem.Function | np.ndarray) -> State:
        """Gaps and slip increments at a displacement, as a state without reactions; slip counts from the last converged step.

        Args:
            u: Function on ``V``, or the array of its owned degrees of freedom; length units.
        """
        values = (u.x.array if hasattr(u, "x") else u)[: self.points.size]
        return self.in_step().at(values)

    # -- frames and motion ---------------------------------------------------------------------

    @property
    def frame(self) -> np.ndarray:
        """Rows (t1, t2, n), in 2-D (t, n), of the last step: ``shape=(gdim, gdim)``; on curved surfaces ``(n, gdim, gdim)``."""
        return self.history.frames.frame

    @property
    def points(self) -> ContactPoints:
        """The ``ContactPoints``: the motion as a sparse operator, and the directions that supports hold."""
        return self.history.frames.points

    def points_in(self, frames: np.ndarray) -> ContactPoints:
        """The contact points with these frames, on rigid surfaces: the nodes.  A subclass may have others, see docs/extending.md.

        Args:
            frames: Rows (t1, t2, n) at each node, ``shape=(n, gdim, gdim)``, global components, orthonormal.
        """
        of = self.displacements
        return ContactPoints(of.dofs(self.nodes), frames, of.owned)

    @property
    def arms(self) -> np.ndarray:
        """Lever arms of the nodes about the surface's point, ``shape=(n, gdim)``, global frame, at the end of the last step."""
        return self._placement.arms(self.displacement, self.history.frames)

    @property
    def _wanders(self) -> bool:
        """Whether it matters where on the surface nodes are."""
        return self.surface.varies or self._laws.textured

    @property
    def changes(self) -> bool:
        """Whether distances, normals, arms or a texture may change within a step; the same on all ranks."""
        changes = self._placement.changes(self.history)
        return changes or (self._laws.textured and not self.surface.deformable)

    @property
    def body_has_axes(self) -> bool:
        """Whether axes are a field of the body on a rigid surface, which does not carry them; the same on all ranks."""
        return self._laws.body_has_axes and not self.surface.deformable

    def axes_turned(
        self,
        used: ContactStep,
        at: np.ndarray,
        frame: np.ndarray,
        points: ContactPoints | None = None,
    ) -> np.ndarray | float:
        """By how much axes at other positions differ from those in use, see ``Laws.turned``."""
        return self._laws.turned(used, at, frame, points)

    @property
    def placement(self) -> Placement:
        """Frames, gaps and motions relative to the surface."""
        return self._placement

    def may_land(self, u: np.ndarray) -> bool:
        """Whether nodes of this rank are open at the last displacement, and there is friction if they land.

        Collective where points are not ``local``.
        """
        opens = (self.last.reaction[:, -1] == 0.0) & ~self.points.closed
        if self.points.local and not opens.any():
            return False
        landing = self.last.gap[opens] > self.in_step().gap_rounding(u)
        return bool(landing.any()) and not self.friction.frictionless

    @property
    def slip_before_touching(self) -> np.ndarray:
        """Tangential motion before touching, of nodes that landed in the last step, ``shape=(n, gdim - 1)``, local frame, length.

        It does not count as slip if that changes friction.
        """
        before = self.history.landed_after
        return np.zeros_like(self.slip_increment) if before is None else before

    def with_own_gaps(self, step: ContactStep, state: State, u: np.ndarray) -> State:
        """A state whose open nodes on a deformable surface have the gaps of a displacement, not of the rows that a step used.  Collective."""
        if not (self.surface.deformable and self.changes):
            return state
        gap, points = self._placement.gap_at(u, step.frames)
        gap = gap + self.opening_at(points, step.depth)
        return state._replace(gap=np.where(state.reaction[:, -1] > 0.0, state.gap, gap))

    def take(self, **arrays: np.ndarray) -> None:
        """Replace parts of the present state."""
        given = {k: a if a is None else frozen(a) for k, a in arrays.items()}
        self._present = self._present._replace(**given)

    # -- one iteration -------------------------------------------------------------------------

    def set_metric(self, K: PETSc.Mat) -> None:
        """Take ``rho`` from the assembled stiffness: the normal diagonal entry of each node.

        Args:
            K: Assembled PETSc stiffness matrix on ``V``.  Collective.
        """
        self.rho = self.nodal_stiffness(K).normal

    def nodal_stiffness(self, K: PETSc.Mat, points: ContactPoints | None = None) -> NodalStiffness:
        """Normal and tangential blocks of the stiffness at the contact nodes, local frame.

        Args:
            K: Assembled PETSc stiffness matrix on ``V``.  Collective.
            points: Of a step; None are those of the last one.

        Raises:
            ValueError: on all ranks, if a node does not resist being moved along the normal.
        """
        stiffness = (self.points if points is None else points).stiffness(K)
        with raised_together(self.comm):
            if not (stiffness.normal > 0.0).all():
                node = int(np.argmin(stiffness.normal))
                raise ValueError(
                    f"the stiffness of the contact node at {place(self.x, node)} along the normal is "
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
        values = (u.x.array if hasattr(u, "x") else u)[: self.points.size]
        state = self.in_step().respond(values, self.reaction, self._map(map))
        self.take(**state._asdict())

    def springs(self, map: str = "bipotential") -> np.ndarray:
        """Spring stiffnesses that match ``update``, ``shape=(n, gdim)``, local frame, force per length.

        ``rho diag(Q^2, 1)`` for the paper's map, ``rho`` in all directions for the return map; zero along the plane without
        friction.
        """
        return self._map(map).springs(self.friction, self.points.dim)

    def _map(self, name: str):
        if self.rho is None:
            raise ValueError("contact.rho is not set: call contact.set_metric(K) first.")
        return BipotentialMap(self.rho) if name == "bipotential" else ReturnMap(self.rho, self.rho)

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
        """Clear the history: undeformed, unworn body, no reactions, the surface in its present position."""
        frames = self.history.frames
        if self._placement.follows(self._wanders, self.history):
            frames = self._placement.standing(self._wanders, frames)
        self._begin(frames)

    def _begin(self, frames: Placed) -> None:
        self.go_back(History.of(self._placement.at_rest(frames), frames))

    def go_back(self, history: History) -> None:
        """Let this be the history; of a law of fields the numbers go along."""
        self._history, self._present = history, history.last
        if self._laws.field and history.friction is not None:
            self._laws.take(self, history.friction)

    def advance(self) -> None:
        """Accept the present state as the last converged one, from which the next slip counts."""
        self.accept(self.in_step(), self._present)

    def accept(self, step: ContactStep, state: State, u: np.ndarray | None = None) -> None:
        """Let a state in a step be the last converged one.  Collective.

        Args:
            step: The contact in the step.
            state: The state.
            u: Its displacement, owned degrees of freedom; needed between bodies.
        """
        placement, frames, before = self._placement, step.frames, self.history
        if self.surface.spin is not None:
            turned = placement.turned_past(state.displacement, frames)
            state = state._replace(displacement=turned)
        state = State(*(None if a is None else frozen(a) for a in state))
        self._history = self._advanced(step, state).but(frames=placement.ended(frames))
        if self.surface.deformable and u is not None and self._placement.changes(before):
            bare = placement.gap_at(u, frames)[1].alone
            self._history = self._history.but(bare=bare)
        self._laws.take(self, step.friction)
        self._present = state
        self._renew_area()

    def _advanced(self, step: ContactStep, state: State) -> History:
        """The history with what a step has worked, slipped and worn.  Collective where the other side wears."""
        history, law = self.history, step.friction
        slip = history.slip_kept + state.slip_increment
        sticks = (law.mu.any(axis=-1) & (state.status == int(Status.STICK)))[:, None]
        slip, kept = np.where(sticks, 0.0, slip), np.where(sticks, slip, 0.0)
        pressed = np.maximum(step.last.reaction[:, -1], state.reaction[:, -1])
        # Of nodes that come in over an edge or leave in the step each slips half of it in the mean: paths of the first count wholly.
        covered = self._placement.covered(step.frames) > 0.0
        path = ((pressed > 0.0) & covered) * np.linalg.norm(slip, axis=1)
        work, turned = step.work(slip, state.reaction)
        work, path, turned = (self.repeats * part for part in (work, path, turned))
        depth = step.depth
        if depth is None:
            depth = np.zeros_like(path) if self.wear is None else self._depth(work)
        added, more, worn = dict(zip(SUMS, (work.sum(axis=1), path, depth))), {}, history.worn
        if self.wear is not None and self.wear.opposite.any():
            other = depth * self.wear.opposite_share(work, self._laws.wear_field)
            given = self.whole_area * other, self.opposite_area, step.frames, history
            more[OPPOSITE] = history.sums.get(OPPOSITE, 0.0) + self._placement.taken(*given)
            added["wear_depth"], worn = depth - other, self._placement.everywhere(more[OPPOSITE])
        more |= {name: history.sums[name] + part for name, part in added.items()}
        sums = history.sums | {name: frozen(part) for name, part in (more | {KEPT: kept}).items()}
        doubtful = float(np.abs(turned.sum(axis=1)).sum()) if self.may_turn else 0.0
        last, unloads = state._replace(known=None), (depth, pressed)
        return History(last, step.frames, sums, law, worn, None, step.before, doubtful, unloads)

    # -- wear within the step ------------------------------------------------------------------

    @property
    def wears_within(self) -> bool:
        """Whether what a step wears opens gaps in the same step; the same on all ranks but for friction per node."""
        return self.wear is not None and not self.wear.explicit

    def wear_rates(
        self, step: ContactStep, state: State, u: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Depth that the slip of a state wears under the force at the start of the step, and that per normal force at its end; none of nodes that stick.

        Args:
            step: The contact in the step.
            state: The state.
            u: Its displacement, owned degrees of freedom; None is the last one.

        Returns:
            Length, and length per force, ``shape=(n,)`` each.
        """
        if u is not None:
            state = self.with_slip_past_edges(step, state, u)
        slips = (state.status != int(Status.STICK))[:, None]
        slip = slips * (self.history.slip_kept + state.slip_increment)
        unit = np.zeros_like(state.reaction)
        unit[:, -1] = 1.0
        works = step.works(slip, unit)[:2]
        start, end = (2.0 * self.repeats * work for work in works)  # a half each
        begun = 1.0
        if self.wear.threshold:
            force = np.maximum(state.reaction[:, -1:], 0.0)
            begun = self._begun(0.5 * (start + force * end))
        return begun * self._rate(start), begun * self._rate(end)

    def with_slip_past_edges(self, step: ContactStep, state: State, u: np.ndarray) -> State:
        """A state in which nodes that have left what was opposite have slipped past its edge.  Collective between bodies."""
        found = self._placement.slip_past_edge(u, step.frames, self.history)
        if found is None:
            return state
        left, slip = found
        return state._replace(slip_increment=np.where(left[:, None], slip, state.slip_increment))

    @property
    def may_turn(self) -> bool:
        """Whether slip may turn between directions of different friction; the same on all ranks."""
        return self.points.dim == 3 and (self.friction.mu.ndim > 1 or not self.friction.isotropic)

    def _rate(self, work: np.ndarray) -> np.ndarray:
        return self.wear.depth(work, self.whole_area, self._laws.wear_field)

    def _depth(self, work: np.ndarray) -> np.ndarray:
        """Depth that the work of a step wears, ``shape=(n,)``."""
        depth = self._rate(work)
        return depth * self._begun(work) if self.wear.threshold else depth

    def _begun(self, work: np.ndarray) -> np.ndarray:
        """Part of the work of a step that is above the threshold of wear, ``shape=(n,)``."""
        return self.wear.part(work.sum(axis=1), self.dissipation, self.whole_area)

    @property
    def sums(self) -> dict[str, np.ndarray]:
        """What nodes have worked, slipped and worn since the start, ``shape=(n,)`` each, by name."""
        return {name: of for name, of in self.history.sums.items() if name != KEPT}

    def take_sums(self, sums: dict[str, np.ndarray]) -> None:
        """Let the next step start from other ``sums``, none of them negative."""
        sums = self.history.sums | {name: frozen(of) for name, of in sums.items()}
        worn = self._placement.everywhere(sums[OPPOSITE]) if OPPOSITE in sums else None
        self.go_back(self.history.but(sums=sums, worn=worn))

    def save(self) -> dict[str, np.ndarray]:
        """All that the next step starts from, and the laws, as arrays by name; this rank's nodes."""
        history = self.history
        saved = history.saved() | self._laws.save(self) | {"plane": self.surface.displacement}
        if history.friction is not None:
            saved["law_of_last_step"] = rows(history.friction, self.nodes.size)
        if self.surface.placed.any():
            saved["placed_rotation_of_plane"] = self.surface.placed
        return saved | self._placement.save(history.frames)

    def check_saved(self, saved: Mapping[str, np.ndarray]) -> None:
        """Raise a ``ValueError`` if an array is missing or of another size, or another law or surface was saved."""
        self.history.check_saved(saved)
        self._laws.check_saved(self, saved)
        if self.surface.varies and "home" not in saved:
            raise ValueError(f"checkpoint: it was written with another plane: here {self.surface}.")

    def load(self, saved: Mapping[str, np.ndarray]) -> None:
        """Take back what ``save`` returned, with the same nodes on this rank; see ``check_saved``."""
        surface, placement = self.surface, self._placement
        rotation = saved.get("rotation_of_plane", np.zeros_like(surface.rotation))
        surface.place(
            rotation, frozen(np.array(saved.get("placed_rotation_of_plane", surface.placed)))
        )
        frames = self.history.frames
        if placement.follows(self._wanders, self.history):
            frames = placement.saved_at(
                saved["home"] if surface.varies else saved.get("at"), frames
            )
        history = self.history.loaded(saved)
        surface.displacement = saved["plane"]
        found = saved.get("found_rotation_of_plane", surface.rotation)
        frames = placement.ended(frames, found)
        worn = history.sums.get(OPPOSITE)
        worn = None if worn is None else placement.everywhere(worn)
        self.go_back(history.but(frames=frames, worn=worn))
        self._history = self._history.but(friction=self._laws.load(self, saved))
        surface.turn_to(found)

    # -- results -------------------------------------------------------------------------------

    @property
    def present(self) -> State:
        """The present state; another object as soon as any part of it is replaced."""
        return self._present

    @property
    def history(self) -> History:
        """The ``History``: what the next step gets from those before."""
        return self._history

    @property
    def last(self) -> State:
        """The state at the end of the last step that converged, in its frames."""
        return self.history.last

    @property
    def displacement(self) -> np.ndarray:
        """Displacement of the nodes relative to the surface, ``shape=(n, gdim)``, local frame, length."""
        return self.present.displacement

    @property
    def reaction(self) -> np.ndarray:
        """Force of the surface on each node, ``shape=(n, gdim)``, local frame, force units."""
        return self.present.reaction

    @property
    def previous_reaction(self) -> np.ndarray:
        """Reactions of the last converged step, ``shape=(n, gdim)``, local frame."""
        return self.last.reaction

    @property
    def gap(self) -> np.ndarray:
        """Distance to the surface, ``shape=(n,)``, length units; negative is penetration, infinite where nothing is opposite."""
        bare = self.points.alone if self.history.bare is None else self.history.bare
        return frozen(np.where(bare, np.inf, self.present.gap)) if bare.any() else self.present.gap

    @property
    def slip_increment(self) -> np.ndarray:
        """Slip relative to the surface in the last step, ``shape=(n, gdim - 1)``, local frame, length units."""
        return self.present.slip_increment

    @property
    def status(self) -> np.ndarray:
        """A ``Status`` per node, ``shape=(n,)``, integers: 0 open, 1 stick, 2 slip."""
        return self.present.status

    @property
    def dissipation(self) -> np.ndarray:
        """Frictional work since the start, ``shape=(n,)``, force times length; it never decreases."""
        return self.history.sums["dissipation"]

    @property
    def slip_path(self) -> np.ndarray:
        """Length of the path slipped while in contact since the start, ``shape=(n,)``, length units."""
        return self.history.sums["slip_path"]

    @property
    def wear_depth(self) -> np.ndarray:
        """Depth worn off the contact's own nodes, ``shape=(n,)``, length; never decreases, zero without ``wear``.  Times ``whole_area`` it is volume."""
        return self.history.sums["wear_depth"]

    @property
    def opposite_wear_depth(self) -> np.ndarray:
        """Depth worn off a deformable surface, at its nodes ``opposite``, ``shape=(k,)``, length.  Times ``opposite_area`` it is volume."""
        return self.history.sums.get(OPPOSITE, np.zeros(self.opposite.size))

    @property
    def opening(self) -> np.ndarray:
        """Depth by which wear of both sides opens the gap at each node, ``shape=(n,)``."""
        return self.opening_at(self.points)

    def opening_at(self, points: ContactPoints, depth: np.ndarray | None = None) -> np.ndarray:
        """The same with nodes opposite others, and what a step wears, ``shape=(n,)``."""
        own, other = self.wear_depth, self._placement.opened(points, self.history.worn)
        worn = own if depth is None else own + depth
        return worn if other is None else worn + other

    @property
    def slip_kept(self) -> np.ndarray:
        """Slip since nodes that stick have last slipped, ``shape=(n, gdim - 1)``, local frame, length.

        A tolerance leaves some of it in every step.  It does no work and is no path until the node slips.
        """
        return self.history.slip_kept

    def penetration_between(self, u: np.ndarray) -> float:
        """Largest penetration of nodes of the facets that carry nothing, >= 0, length, at owned degrees of freedom.  Collective."""
        here = self.displacements.rows(u)[self.left_out]
        gaps = self.surface.distances(self.displacements.x[self.left_out, : here.shape[1]] + here)
        return max(0.0, -self.comm.allreduce(float(gaps.min(initial=0.0)), op=MPI.MIN))

    @property
    def load_function(self) -> np.ndarray:
        """f = ||M^-1 r_t|| - r_n, ``shape=(n,)``, force units [dSFMH07, Eq. (1)]."""
        return self.law.load_function(self.reaction)

    @property
    def bipotential_gap(self) -> np.ndarray:
        """Certificate b_c + Delta u . r >= 0 of each node, ``shape=(n,)``, force times length.

        Zero exactly where the law holds [dSFMH07, Section 1].  Evaluated at ``max(gap, 0)``; ``gap`` shows penetration.
        """
        return self.law.bipotential_gap(
            self.reaction, np.maximum(self.present.gap, 0.0), self.slip_increment
        )

    @property
    def slip_residual(self) -> np.ndarray:
        """Defect of the slip increments from the slip rule, ``shape=(n, gdim - 1)``, length.

        ``Delta u_t + |Delta u_t| d`` on slipping nodes, ``d`` the unit vector along ``P^-2 r_t``, and ``Delta u_t``
        on sticking ones [dSFMH07, Section 1]; zero on open and frictionless nodes.
        """
        return self.law.slip_defect(self.reaction, self.slip_increment, self.status)

    def force(self) -> np.ndarray:
        """Total reaction, ``shape=(gdim,)``, global frame, the same on all ranks.  Collective.

        With axial symmetry, only the axial component is a force; the radial one is a sum over the circumference, whose resultant
        is zero.
        """
        if self.surface.curved:
            return self.comm.allreduce(np.einsum("ni,nij->j", self.reaction, self.frame))
        return self.comm.allreduce(self.reaction.sum(axis=0)) @ self.frame

    def moment(self, u: fem.Function | None = None) -> np.ndarray:
        """Moment of the reactions about the surface's point, ``shape=(3,)``, in 2-D one number, global frame.  Collective.

        Lever arms are taken in the deformed state, from the present position of the point.  After a step, the moment about free
        axes equals ``surface.moment``.

        Args:
            u: The displacement, with a deformable surface, which has no point: the moment is about the origin.

        Raises:
            ValueError: a deformable surface without ``u``, which contacts know relative to the other body alone.
        """
        forces = np.einsum("ni,nij->nj", self.reaction, self.points.frames)
        if not self.surface.deformable:
            arms = self.arms
        elif u is None:
            raise ValueError(
                "contact.moment on a deformable surface needs the displacement: contact.moment(problem.u)."
            )
        else:
            _, arms = self._placement.ended_at(u.x.array)
        if arms.shape[1] == 2:
            moments = (arms[:, :1] * forces[:, 1:] - arms[:, 1:] * forces[:, :1]).sum(axis=0)
        else:
            moments = np.cross(arms, forces).sum(axis=0)
        return self.comm.allreduce(moments)

    @property
    def area(self) -> np.ndarray:
        """Area of the contact surface that belongs to each node, ``shape=(n,)``, undeformed state, see ``facing_areas``.

        The integral of the node's shape function times ``weight`` over the facets, projected on the surface; facets facing away
        do not count.  In two dimensions it is a length, unless there is a weight.  The first call is collective.
        """
        whole = self.whole_area
        return frozen(whole * self.covered) if self.surface.deformable else whole

    @property
    def whole_area(self) -> np.ndarray:
        """The same with what is opposite nothing of a deformable surface, ``shape=(n,)``; worn depth is volume over it."""
        if self._area is None:
            self._area, self._area_of = frozen(self._facing_areas()), self.surface.rotation  # fmt: skip
        return self._area

    @property
    def opposite_area(self) -> np.ndarray:
        """Area of a deformable surface that belongs to its nodes ``opposite``, ``shape=(k,)``.  The first call is collective."""
        if self._opposite_area is None:
            V, found = self.displacements.V, np.zeros(0)
            if self.surface.deformable:
                every = fields.areas(V, self.surface.facets, weight=self._weight)
                found = every[V.mesh.geometry.dim * self.opposite]
            self._opposite_area = frozen(found)
        return self._opposite_area

    def worn_volume(self) -> tuple[float, float]:
        """Volume that both sides have lost, the contact's own and the opposite one.  Collective."""
        own, other = 0.0, 0.0
        if self.wear is not None:
            own = float(self.wear_depth @ self.whole_area)
            other = float(self.opposite_wear_depth @ self.opposite_area)
        return tuple(self.comm.allreduce(np.array([own, other])).tolist())

    def _facing_areas(self) -> np.ndarray:
        x = self.x[:, : self.points.dim]
        turn = none = np.eye(x.shape[1])
        if not (self.surface.curved or self.surface.deformable):
            turn = fields.turn_of_nodes(x, self.arms, self.comm)
        if np.abs(turn - none).max() <= TILTED:
            turn = none
        return fields.facing_areas(self, self._weight, turn)

    def _renew_area(self) -> None:
        """Let areas that are known be those that a plane sees that has turned since.  Collective where it has."""
        if self._area is None or self.surface.curved or self.surface.deformable:
            return
        turned = self.surface.rotation
        if np.abs(turned - self._area_of).max() > TILTED:
            self._area = None
            _ = self.area

    @property
    def opposite(self) -> np.ndarray:
        """Local indices of this rank's nodes on the deformable surface, none on rigid ones, ``shape=(k,)``."""
        return self._placement.opposite

    @property
    def covered(self) -> np.ndarray:
        """Part of each node's area that is opposite a deformable surface, ``shape=(n,)``; one on rigid ones."""
        return self._placement.covered(self.history.frames)

    @property
    def pressure(self) -> np.ndarray:
        """Normal reaction over nodal area, ``shape=(n,)``, force per area; zero at nodes without area.  The first call is
        collective."""
        return fields.per_area(self.reaction[:, -1], self.area)

    @property
    def density(self) -> np.ndarray | None:
        """``weight`` at the nodes of ``displacements.V``, None where it is one.  Collective."""
        weight = self._weight
        return None if weight is None else fields.at_nodes(self.displacements.V, weight)

    @property
    def weighted(self) -> bool:
        """Whether the surface measure has a weight."""
        return self._weight is not None

    @property
    def axial(self) -> bool:
        """Whether ``weight`` is in proportion to the first coordinate, in two dimensions: axial symmetry.  Collective at first."""
        if self._axial is None:
            V = self.displacements.V
            plain = self._weight is None or V.mesh.geometry.dim == 3
            self._axial = not plain and fields.grows_with_radius(V, self._weight)
        return self._axial

    def function(self, values: ArrayLike, name: str = "f", elsewhere: float = 0.0) -> fem.Function:
        """A scalar Function for output with these values at the contact nodes, ``shape=(n,)``, and zero elsewhere.  Collective."""
        return fields.scalar(self.displacements.V, self.nodes, values, name, elsewhere)

    def wear_function(self, name: str = "wear_depth") -> fem.Function:
        """Depth worn off both sides as a scalar Function for output, each at its own nodes, zero elsewhere.  Collective."""
        nodes = np.concatenate((self.nodes, self.opposite))
        depths = np.concatenate((self.wear_depth, self.opposite_wear_depth))
        return fields.scalar(self.displacements.V, nodes, depths, name, 0.0)

    def everywhere(self, values: ArrayLike) -> np.ndarray:
        """Values at the contact nodes at those of all nodes that this rank knows, ghosts included, zero elsewhere.  Collective."""
        function = fem.Function(self.displacements.V)
        rows = function.x.array.reshape(-1, self.displacements.dim)
        rows[self.nodes, 0] = values
        function.x.scatter_forward()
        return rows[:, 0].copy()

    def reaction_function(self) -> fem.Function:
        """Nodal reactions in global components as a Function on the space of displacements, zero elsewhere."""
        function = fem.Function(self.displacements.V, name="reaction")
        forces = np.zeros(self.points.size)
        self.points.add_forces(self.reaction, forces)
        rows = self.displacements.rows(forces)
        function.x.array[: rows.size] = rows.ravel()
        function.x.scatter_forward()
        return function

    def worn_in_a_leap(self, stiffness: NodalStiffness) -> tuple[float, float, list]:
        """Of the node whose depth worn in the last step unloads it most: by how many times its reaction, depth and position.

        Wear is explicit: the depth opens the gap of the next step.  With the node's own stiffness ``kappa`` it takes
        ``kappa`` times the depth from the reaction.

        Args:
            stiffness: Of the nodes.  Collective.
        """
        depth, carried = self.history.unloads
        taken = np.divide(stiffness.normal * depth, carried, np.zeros_like(depth), where=carried > 0)  # fmt: skip
        k = int(taken.argmax()) if taken.size else None
        mine = (0.0, 0.0, []) if k is None else (float(taken[k]), float(depth[k]), self.x[k].tolist())  # fmt: skip
        return max(self.comm.allgather(mine))
