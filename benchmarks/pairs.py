# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Scenes said in two ways that mechanics says are one: a judge that knows no equation of the solvers.

    python -m benchmarks.pairs            # some minutes; with words, scenes whose name has one of them

Each scene is played as it stands and in variants: the surface moves instead of the body, springs hold instead of supports, another
frame, other units, one contact in two, another solver, another way to give the same friction, half of a symmetric body.  Forces, work
and wear have to agree.  A pair that does not is "WRONG WITHOUT A WORD" if neither of the two was refused or warned of.
"""

from __future__ import annotations

import sys
import warnings
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import ufl
from mpi4py import MPI
from scipy.spatial.transform import Rotation

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh

from benchmarks.tables import table
from dolfinx_contact.compat import functionspace, mixed_functionspace
from dolfinx_contact.petsc.linear_solver import MULTIGRID_OPTIONS
from dolfinx_contact.surfaces.surface import rotation_between
from mechanics.material import elasticity
from mechanics.scenes import rotation

REFUSALS = dc.NotConverged, dc.LinearSolverError, ValueError
EDGES = np.array([1.0, 1.0, 0.6])
MIRRORED, PERMUTED, TURNED = np.diag([-1.0, 1.0, 1.0]), np.eye(3)[[1, 2, 0]], rotation(3)


class Leg(NamedTuple):
    """Part of a programme: where the head has gone at its end relative to the surface, over its edge, the scene's axes.

    Attributes:
        at: Along both tangents and the normal; of a loose block, the force on it over modulus and area.
        turn: About the normal at the middle of the foot, radians.
        tilt: About the second axis, small.
    """

    at: tuple
    turn: float = 0.0
    tilt: float = 0.0


PRESS = (Leg((0.0, 0.0, -0.004)), Leg((4e-4, 2e-4, -0.004)), Leg((0.012, 6e-3, -0.005)))
ALONG = tuple(Leg((leg.at[0], 0.0, leg.at[2])) for leg in PRESS)
ABOVE, ASIDE = Leg((0.0, 0.0, 0.05)), Leg((0.3, -0.2, 0.05))
DOWN = (Leg((0.0, 0.0, -0.002)), Leg((0.0, 0.0, -0.006)))


@dataclass(frozen=True)
class Way:
    """One way to say a scene: a block of edges 1, 1, 0.6 (1, 0.6) whose foot meets a surface and whose head is moved.

    Attributes:
        surface, radius: A key of ``SURFACES``, and its radius over the edge.
        given: How friction is given: "number", "array", "callable", "function" or "k".
        moves: Which part of the motion is that of the surface, 0 to 1.
        steps: In which each leg is divided.
        support: "held", "spring" at the head, or "loose".
        frame: Orthogonal matrix, the scene's axes as columns.
        part: "whole", "half" of it, or "slab", as thin in the second direction as a cell, and plane.
        form: "linear", "finite", StVenant-Kirchhoff's, or "mixed" with a pressure.
        free: Motions of the surface that ``at`` drives, forces then, over modulus and area; those that turn with a moment.
        away: How far from the origin of coordinates the scene is, over its edge.
        guess: Whether ``u`` holds nonsense when a step begins.
        petsc: Options of the linear solver.
        posed: Whether the surface is made at the origin and moved to its place before anything else.
        driven: Forces that drive the surface along the normal, one for each step; None prescribes it.
        again: Whether it is played, reset and played again.
        twice: Whether each step is taken back once and made again.
        texture: None, "body" or "surface": axes turned from place to place.
    """

    legs: tuple = PRESS
    d: int = 3
    cells: tuple = (4, 4, 2)
    order: int = 1
    simplex: bool = False
    surface: str = "plane"
    radius: float = 3.0
    mu: tuple = (0.3, 0.15)
    p: tuple = (0.3, 0.15)
    given: str = "number"
    texture: str | None = None
    wear: float | None = None
    weight: float | None = None
    moves: float = 0.0
    steps: int = 1
    support: str = "held"
    spring: float = 1e8
    frame: np.ndarray = field(default_factory=lambda: np.eye(3))
    length: float = 1.0
    E: float = 200.0
    nu: float = 0.3
    split: bool = False
    part: str = "whole"
    form: str = "linear"
    solver: str | None = None
    free: tuple = ()
    posed: bool = False
    away: float = 0.0
    guess: bool = False
    petsc: dict | None = None
    driven: tuple | None = None
    twice: bool = False
    again: bool = False

    @property
    def base(self) -> np.ndarray:
        """The middle of the foot, ``shape=(d,)``."""
        return self.away * self.length * np.array([1.0, -0.7, 0.4])[: self.d]


# -- surfaces, the scene's axes and lengths -----------------------------------------------------


def _round(way, function=False, inside=False):
    d, R = way.d, way.radius * way.length
    F = way.frame[:d, :d]
    centre = way.base + F @ np.eye(d)[-1] * (R if inside else -R)
    axis = None if d == 2 else F[:, 0]
    if not function:
        return dc.RigidSphere(centre, R, axis=axis, inside=inside)

    def distance(y):
        return np.linalg.norm(y - centre[:, None], axis=0) - R

    return dc.RigidSurface(distance, point=centre, axis=axis)


def _roll(way, function=False):
    F, R = way.frame, way.radius * way.length
    if not function:
        return dc.RigidCylinder(way.base - R * F[:, 2], F[:, 1], R)

    def distance(y):
        x, _, z = F.T @ (y - way.base[:, None])
        return np.hypot(x, z + R) - R

    return dc.RigidSurface(distance, point=way.base - R * F[:, 2], axis=F[:, 1])


def _plane(way, height=None):
    d = way.d
    F = way.frame[:d, :d]
    axis = None if d == 2 else F[:, 0]
    return dc.RigidPlane(way.base, F[:, -1], axis, height=height)


def _wavy(way, function=False):
    F, L = way.frame[: way.d, : way.d], way.length

    def height(y):
        return 1e-3 * L * (np.cos(2 * np.pi * (F.T @ (y - way.base[:, None]))[0] / L) - 1.0)

    return _plane(way, height)


def _flat(way):
    F = way.frame[: way.d, : way.d]
    axis = None if way.d == 2 else F[:, 0]

    def height(y):
        return 7.0 * (F.T @ (y - way.base[:, None]))[-1]

    return dc.RigidSurface(height, point=way.base, axis=axis)


SURFACES = {
    "plane": _plane, "ball": _round, "roll": _roll, "wavy": _wavy, "level set": _flat,
    "ball as function": lambda way: _round(way, True), "roll as function": lambda way: _roll(way, True),
    "socket": lambda way: _round(way, inside=True),
}  # fmt: skip


# -- the body ------------------------------------------------------------------------------------


def _box(way):
    """The mesh in the scene's axes and lengths 1, its facets at foot and head, and those on planes of symmetry by axis."""
    d, cells = way.d, list(way.cells)
    high = EDGES[[0, 1, 2][-d:]] / np.array([2.0] * (d - 1) + [1.0])
    low = np.append(-high[:-1], 0.0)
    if way.part == "half":
        low[0], cells[0] = 0.0, cells[0] // 2
    if way.part == "slab":
        low[1], high[1], cells[1] = 0.0, 1.0 / cells[0], 1
    kinds = mesh.CellType
    kind = [kinds.quadrilateral, kinds.triangle][way.simplex] if d == 2 else [kinds.hexahedron, kinds.tetrahedron][way.simplex]  # fmt: skip
    create = mesh.create_rectangle if d == 2 else mesh.create_box
    domain = create(MPI.COMM_WORLD, [low, high], cells, kind)

    def face(axis, at):
        return mesh.locate_entities_boundary(domain, d - 1, lambda x: np.isclose(x[axis], at))

    foot, head = face(d - 1, 0.0), face(d - 1, high[-1])
    return domain, foot, head, face(0, 0.0) if way.part == "half" else None


def _form(way, u, v):
    E, nu = (fem.Constant(u.function_space.mesh, float(c)) for c in (way.E, way.nu))
    if way.form == "finite":
        strain = (ufl.grad(u).T + ufl.grad(u) + ufl.grad(u).T * ufl.grad(u)) / 2
        lame = E * nu / ((1 + nu) * (1 - 2 * nu))
        S = lame * ufl.tr(strain) * ufl.Identity(len(u)) + E / (1 + nu) * strain
        virtual = ufl.sym(ufl.grad(v)) + ufl.sym(ufl.grad(u).T * ufl.grad(v))
        return ufl.inner(S, virtual) * ufl.dx(metadata={"quadrature_degree": 3})
    if way.form == "mixed":
        (w, q), (t, s) = ufl.split(u), ufl.split(v)
        G, lame = E / (2 + 2 * nu), E * nu / ((1 + nu) * (1 - 2 * nu))
        work = 2 * G * ufl.inner(ufl.sym(ufl.grad(w)), ufl.grad(t)) + q * ufl.div(t)
        return (work + s * (ufl.div(w) - q / lame)) * ufl.dx
    return elasticity(u, v, E, nu)


class Played:
    """A scene made in one way, and what came of it.

    Attributes:
        numbers: ``forces``, ``work`` and ``worn`` after each leg, and of a surface that a force drives its ``way``; None if refused.
        said: Warnings, and what a refusal said.
        pressing: Force along the normal in each step.
    """

    def __init__(self, way: Way):
        self.way, self.said, self.numbers, self.pressing = way, [], None, []
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always", UserWarning)
            try:
                self._make()
                self.numbers = {name: np.array(values) for name, values in self._play().items()}
            except REFUSALS as refused:
                self.said.append(f"{type(refused).__name__}: {refused}")
        self.said += [str(w.message) for w in heard if issubclass(w.category, UserWarning)]

    def _make(self):
        way, d = self.way, self.way.d
        self.F = F = way.frame[:d, :d]
        domain, foot, head, symmetry = _box(way)
        sides = [foot]
        if way.split:
            last = d - 1
            first = mesh.locate_entities_boundary(domain, last, lambda x: np.isclose(x[last], 0) & (x[0] < 1e-9))  # fmt: skip
            sides = [first, np.setdiff1d(foot, first)]
        domain.geometry.x[:, :d] = way.base + way.length * domain.geometry.x[:, :d] @ F.T
        lagrange, mixed = ("Lagrange", way.order, (d,)), way.form == "mixed"
        V = mixed_functionspace(domain, [lagrange, ("Lagrange", 1)]) if mixed else functionspace(domain, lagrange)  # fmt: skip
        part = V.sub(0) if mixed else V
        space = part.collapse()[0] if mixed else V
        u, v = fem.Function(V), ufl.TestFunction(V)
        moved, test = (ufl.split(f)[0] if mixed else f for f in (u, v))
        self.held, self.force = fem.Function(space), fem.Constant(domain, np.zeros(d))
        form, bcs = _form(way, u, v), self._symmetry(V, domain, symmetry)
        if way.support == "held":
            dofs = fem.locate_dofs_topological((part, space) if mixed else V, d - 1, head)
            bcs.append(fem.dirichletbc(self.held, dofs, *([part] if mixed else [])))
        elif way.support == "spring":
            tags = mesh.meshtags(domain, d - 1, np.sort(head), np.ones(head.size, dtype=np.int32))
            ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)(1)
            stiff = fem.Constant(domain, way.spring * way.E / way.length)
            form += stiff * ufl.inner(moved - self.held, test) * ds
        else:
            form -= ufl.inner(self.force, test) * ufl.dx
        self.x = space.tabulate_dof_coordinates()[:, :d]
        self.surface = SURFACES[way.surface](replace(way, frame=np.eye(3)) if way.posed else way)
        if way.posed:
            vector = Rotation.from_matrix(way.frame).as_rotvec()
            self.surface.rotation = vector if d == 3 else vector[2]
            arm = self.surface.point - way.base
            self.surface.displacement = F @ arm - arm
        self.home, self.pose = self.surface.displacement, self.surface.rotation
        if way.free:
            self.surface.free = way.free
        if way.free and way.surface != "plane":
            self.surface.guides = F.T
        options = {} if way.weight is None else {"weight": way.weight}
        wear = None if way.wear is None else dc.Wear(way.wear / way.E)
        self.contacts = [dc.Contact(V, side, self.surface, way.mu[0], wear=wear, **options) for side in sides]  # fmt: skip
        for contact in self.contacts:
            contact.friction = self._friction(contact, space)
        solver = None if way.solver is None else getattr(dc, way.solver)()
        self.problem = dc.ContactProblem(form, u, self.contacts, bcs=bcs, solver=solver, tol=1e-10, geometry_tol=1e-6, petsc_options=way.petsc)  # fmt: skip

    def _symmetry(self, V, domain, facets):
        way, zero, found = self.way, fem.Constant(domain, 0.0), []
        if way.part == "half":
            dofs = fem.locate_dofs_topological(V.sub(0), way.d - 1, facets)
            found.append(fem.dirichletbc(zero, dofs, V.sub(0)))
        if way.part == "slab":
            count = V.dofmap.index_map.size_local + V.dofmap.index_map.num_ghosts
            dofs = (3 * np.arange(count) + 1).astype(np.int32)
            found.append(fem.dirichletbc(zero, dofs, V.sub(1)))
        return found

    def _friction(self, contact, space):
        """The same law in the way in which it is to be given."""
        way, n, axes = self.way, contact.nodes.size, {}
        mu, p = np.array(way.mu), np.array(way.p)
        if way.d == 2:
            mu = p = mu[0]
        if way.texture is not None:
            F, L = np.eye(3) if way.posed and way.texture == "surface" else self.F, way.length

            def grooves(y):
                x = (F.T @ (y[: way.d] - way.base[:, None]))[0] / L
                return np.array([np.cos(0.3 + x), np.sin(0.3 + x)])

            axes = dict(axes=grooves, of=way.texture)
        if way.given == "array":
            mu, p = (np.tile(c, (n, 1)) if way.d == 3 else np.full((n, 2), c) for c in (mu, p))
        elif way.given == "callable":
            mu, p = (lambda x, c=c: np.multiply.outer(c, 1.0 + 0 * x[0]) for c in (mu, p))
        elif way.given == "pressure":
            mu = lambda x, pressure, c=mu: np.multiply.outer(c, 1.0 + 0 * pressure)  # noqa: E731
        elif way.given == "function":
            mu, p = (_function(space.mesh, c) for c in (mu, p))
        elif way.given == "k":
            return dc.Friction(mu, k=np.log(p[1] / p[0]) / np.log(mu[1] / mu[0]), **axes)
        return dc.Friction(mu, **axes) if way.d == 2 else dc.Friction(mu, p, **axes)

    def _place(self, leg: Leg) -> None:
        """Move head and surface, each by its part of the motion."""
        way, d, F, L = self.way, self.way.d, self.F, self.way.length
        at = np.array(leg.at)[[0, 1, 2][: d - 1] + [2]] if d == 3 else np.array(leg.at)[[0, 2]]
        body, sign = 1.0 - way.moves, np.linalg.det(way.frame)
        if way.support == "loose":
            self.force.value[:] = way.E / (0.6 * L) * F @ at
        turned = np.zeros_like(self.x)
        if leg.turn or leg.tilt:  # the scene's axes
            x = (self.x - way.base) @ F
            along = [-leg.tilt * x[:, -1], *([0 * x[:, 0]] * (d - 2)), leg.tilt * x[:, 0]]
            if d == 3:
                along[0], along[1] = along[0] - leg.turn * x[:, 1], leg.turn * x[:, 0]
            if way.form == "finite":
                c, s = np.cos(body * leg.turn) - 1.0, np.sin(body * leg.turn)
                along[0], along[1] = c * x[:, 0] - s * x[:, 1], s * x[:, 0] + c * x[:, 1]
            turned = np.column_stack(along) @ F.T / (body if way.form == "finite" and body else 1.0)
        held = self.held.x.array
        if not way.free:
            held[:] = (body * (L * F @ at + turned)).ravel()[: held.size]
        if way.free:
            self.surface.force = way.E * L ** (d - 1) * F @ at
            if self.surface.spins:
                arm = L * np.array([0.15, 0.1, 0.0])[:d]
                if d == 3:
                    self.surface.moment = way.E * L**2 * sign * F @ np.cross(arm, at)
                else:
                    self.surface.moment = way.E * L * sign * arm[0] * at[1]
            return
        if way.support == "loose" or not way.moves and way.driven is None:
            return
        if way.moves and (leg.turn or leg.tilt):
            turn = way.moves * sign * (leg.tilt * F[:, 1] - leg.turn * F[:, -1]) if d == 3 else -way.moves * leg.tilt  # fmt: skip
            self.surface.rotation = turn
        moved = (
            body * L * F @ at - L * self._axes().T @ at
        )  # so that the body's motion beside it is the whole one
        if way.driven is not None:
            moved = moved + (self.surface.displacement - self.home - moved) @ F[:, -1] * F[:, -1]
        self.surface.displacement = self.home + moved

    def _axes(self) -> np.ndarray:
        """The scene's axes as rows, those of the surface."""
        turned = self.surface.rotation
        if self.way.posed or self.way.free or not turned.any():
            return self.F.T
        angle = turned.copy() if self.way.d == 3 else np.array([0.0, 0.0, turned[0]])
        return self.F.T @ Rotation.from_rotvec(angle).as_matrix()[: self.way.d, : self.way.d].T

    def _play(self) -> dict:
        if self.way.again:
            self._played()
            self.problem.reset()
            self.pressing.clear()
        return self._played()

    def _played(self) -> dict:
        way, found, before = self.way, dict(forces=[], work=[], worn=[]), Leg((0.0, 0.0, 0.0))
        if way.free:
            found |= dict(moved=[], turned=[])
        unit = way.E * way.length**2
        share = {"whole": 1.0, "half": 2.0, "slab": float(way.cells[0])}[way.part]
        scale = share / (unit if way.d == 3 else way.E * way.length)
        driven = iter(way.driven or ())
        for leg in way.legs:
            for part in np.arange(1, way.steps + 1) / way.steps:
                self._place(_between(before, leg, part))
                if way.driven is not None:
                    self.surface.free = ("n",) if way.surface in ("plane", "wavy") else ("zyx"[3 - way.d],)  # fmt: skip
                    self.surface.force = next(driven) / scale * self.F[:, -1]
                if way.guess:
                    u = self.problem.u.x.array
                    u[:] = 0.01 * way.length * np.random.default_rng(1).normal(size=u.size)
                self.problem.solve()
                if way.twice:
                    self.problem.rewind()
                    self._place(_between(before, leg, part))
                    self.problem.solve()
                force = scale * self._axes() @ sum(contact.force() for contact in self.contacts)
                self.pressing.append(force[-1])
            before = leg
            if way.part == "half":
                force[0] = 0.0
            found["forces"].append(force if way.d == 2 or way.part != "slab" else force[[0, 2]])
            sums = [(c.dissipation.sum(), (c.wear_depth * c.area).sum()) for c in self.contacts]
            work, worn = scale / way.length * np.sum(sums, axis=0)
            found["work"].append(work)
            found["worn"].append(worn * way.E)
            if way.free:
                sign = np.linalg.det(way.frame)
                turned = rotation_between(self.pose, self.surface.rotation)
                found["moved"].append(
                    self.F.T @ (self.surface.displacement - self.home) / way.length
                )
                found["turned"].append(sign * (self.F.T @ turned if way.d == 3 else turned))
        return found


def _function(domain, values):
    """A constant as a Function."""
    element = ("Lagrange", 1, (2,)) if np.size(values) == 2 else ("Lagrange", 1)
    function = fem.Function(functionspace(domain, element))
    function.x.array[:] = np.resize(values, function.x.array.size)
    return function


def _between(a: Leg, b: Leg, part: float) -> Leg:
    at = (1 - part) * np.array(a.at) + part * np.array(b.at)
    return Leg(tuple(at), *((1 - part) * x + part * y for x, y in zip(a[1:], b[1:])))


# -- scenes, and what may not change them ----------------------------------------------------------

C = dict(mu=(0.3, 0.15), p=(0.05, 0.20))
# Where body or surface turns little is pressed: stresses of a linear body do not turn, an error of their part of E.
TURNS = (Leg((0, 0, -4e-5)), Leg((0, 0, -4e-5), 4e-6), Leg((0, 0, -4e-5), 2e-5))
TILTS = (Leg((0, 0, -4e-5)), Leg((0, 0, -4e-5), 0.0, 5e-6), Leg((2e-5, 0, -4e-5), 0.0, 5e-6))
FAR = (Leg((0, 0, -0.004)), Leg((0, 0, -0.004), 0.15), Leg((0.1, 0.05, -0.004), 0.3))
TURNED_BALL = (Leg((0, 0, -4e-3)), Leg((0, 0, -4e-3), 4e-4), Leg((0, 0, -4e-3), 2e-3))
WEIGHTS = (Leg((0, 0, -1e-3)), Leg((1e-4, 5e-5, -1e-3)), Leg((-5e-5, 5e-5, -7e-4)))
FINE = dict(cells=(8, 8, 3))
LOADS = (Leg((0, 0, 4e-3)), Leg((4e-4, 1e-4, 4e-3)), Leg((-2e-4, 2e-4, 3e-3)))
SCENES = {
    "plane": Way(**C),
    "plane, 2-D": Way(d=2, cells=(8, 4), legs=ALONG),
    "plane, second order": Way(cells=(2, 2, 1), order=2, **C),
    "plane, tetrahedra": Way(cells=(3, 3, 2), simplex=True, **C),
    "plane, finite strain": Way(cells=(3, 3, 2), form="finite", **C),
    "plane, mixed": Way(cells=(2, 2, 1), order=2, form="mixed", nu=0.49, **C),
    "plane, worn": Way(wear=0.5, **C),
    "plane, textured body": Way(texture="body", **C),
    "plane, textured surface": Way(texture="surface", **C),
    "plane, finite strain, turned far": Way(cells=(3, 3, 2), form="finite", legs=FAR, steps=4, **C),
    "ball, turned": Way(surface="ball", legs=TURNED_BALL, **FINE, **C),
    "plane, turned": Way(legs=TURNS, **C),
    "plane, tilted": Way(legs=TILTS, **C),
    "plane, tilted, 2-D": Way(legs=TILTS, d=2, cells=(8, 4)),
    "plane, loose": Way(legs=WEIGHTS, cells=(3, 3, 2), support="loose", **C),
    "plane, loose, 2-D": Way(legs=WEIGHTS, d=2, cells=(6, 3), support="loose"),
    "platen": Way(legs=LOADS, free=("n", "r1", "r2"), **C),
    "platen, sheared": Way(legs=LOADS, free=("t1", "t2", "n"), **C),
    "platen, 2-D": Way(legs=LOADS, free=("t", "n", "r"), d=2, cells=(8, 4)),
    "ball pressed by force": Way(legs=LOADS, free=("x", "y", "z"), surface="ball", **FINE, **C),
    "wavy": Way(surface="wavy", **C),
    "ball": Way(surface="ball", **FINE, **C),
    "ball, smooth": Way(surface="ball", **FINE, mu=(0.0, 0.0)),
    "ball, worn": Way(surface="ball", wear=0.5, **FINE),
    "ball, second order": Way(surface="ball", cells=(4, 4, 2), order=2),
    "ball, textured surface": Way(surface="ball", texture="surface", **FINE, **C),
    "circle": Way(surface="ball", d=2, cells=(16, 6), legs=ALONG),
    "plane, triangles of second order": Way(d=2, cells=(4, 2), simplex=True, order=2, legs=ALONG, wear=0.5),
    "plane, tetrahedra of second order": Way(cells=(2, 2, 1), simplex=True, order=2, wear=0.5, texture="body", **C),
    "ball, finite strain": Way(surface="ball", cells=(6, 6, 2), form="finite", wear=0.5, **C),
    "ball, mixed": Way(surface="ball", cells=(4, 4, 1), order=2, form="mixed", nu=0.49, texture="surface", **C),
    "platen, finite strain": Way(legs=LOADS, cells=(3, 3, 2), free=("n", "r1", "r2"), form="finite", **C),
    "platen, worn and textured": Way(legs=LOADS, cells=(3, 3, 2), free=("t1", "t2", "n", "r1", "r2"), wear=0.5, texture="surface"),
    "ball pressed by force, worn": Way(legs=LOADS, free=("x", "y", "z"), surface="ball", wear=0.5, texture="body", **FINE, **C),
    "roll pressed by force, mixed": Way(legs=LOADS, free=("x", "y", "z"), surface="roll", cells=(6, 2, 2), order=2, form="mixed", nu=0.49),
    "wavy, 2-D": Way(surface="wavy", d=2, cells=(16, 6), legs=ALONG, wear=0.5),
    "wavy, tilted": Way(surface="wavy", legs=TILTS, **C),
    "socket": Way(surface="socket", **FINE, **C),
    "roll": Way(surface="roll", **FINE, **C),
}  # fmt: skip

SWAPPED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
SPUN = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])


class Variant(NamedTuple):
    """Another way to say a scene.

    Attributes:
        name: What it says.
        change: Of ``Way``, or a function of what was ``Played``.
        where: To which scenes it applies, by name and ``Way``.
        tol: Up to which numbers may differ, over the largest of their kind.
    """

    name: str
    change: object
    where: object = lambda name, way: True
    tol: float = 1e-6


def _held(name, way):
    return way.support == "held" and not way.free


def _flat_or_round(name, way):
    return _held(name, way) and name not in ROUGHLY


def _lands_at_once(name, way):
    """Nodes that land one after another slip, each for a part of the step, which is another path in one step than in two."""
    return _held(name, way) and (way.surface == "plane" or name == "ball, smooth")


# Where nodes land on curved surfaces their slip is an estimate, see docs/surfaces.md.
VARIANTS = [
    Variant("the surface moves", dict(moves=1.0), _flat_or_round, 2e-3),
    Variant("both move", dict(moves=0.4), _flat_or_round, 2e-3),
    Variant("stiff springs", dict(support="spring"), _held, 1e-5),
    Variant("turned frame, 3-D", dict(frame=TURNED), lambda name, way: way.d == 3),
    Variant("turned frame, 2-D", dict(frame=SPUN), lambda name, way: way.d == 2),
    Variant("axes permuted", dict(frame=PERMUTED), lambda name, way: way.d == 3),
    Variant("axes swapped, 2-D", dict(frame=SWAPPED), lambda name, way: way.d == 2),
    Variant("put into place, 3-D", dict(frame=TURNED, posed=True), lambda name, way: way.d == 3 and "tilted" not in name and "turned" not in name),
    Variant("put into place, 2-D", dict(frame=SPUN, posed=True), lambda name, way: way.d == 2 and "tilted" not in name),
    Variant("mirrored", dict(frame=MIRRORED), lambda name, way: way.texture is None),
    Variant("mm instead of m", dict(length=1e3, E=2e-4)),
    Variant("tiny", dict(length=1e-6, E=2e11)),
    Variant("two contacts of one", dict(split=True)),
    Variant("friction by arrays", dict(given="array")),
    Variant("friction by callables", dict(given="callable")),
    Variant("friction by Functions", dict(given="function")),
    Variant("friction that follows the pressure", dict(given="pressure")),
    Variant("exponent of friction", dict(given="k"), lambda name, way: way.d == 3 and len(set(way.mu)) > 1),
    Variant("weight one", dict(weight=1.0)),
    Variant("taken back and made again", dict(twice=True)),
    Variant("again after a reset", dict(again=True)),
    Variant("lands from above", lambda played: dict(legs=(ABOVE, *played.way.legs)), _lands_at_once, 5e-4),
    Variant("flies about first", lambda played: dict(legs=(ASIDE, ABOVE, *played.way.legs)), _lands_at_once, 5e-4),
    Variant("ball as function, put into place", dict(surface="ball as function", frame=TURNED, posed=True), lambda name, way: way.surface == "ball" and way.d == 3 and not way.free, 2e-4),
    Variant("roll as function, put into place", dict(surface="roll as function", frame=TURNED, posed=True), lambda name, way: way.surface == "roll", 2e-4),
    Variant("far from the origin", dict(away=1e4), tol=1e-5),
    Variant("from a nonsensical guess", dict(guess=True), lambda name, way: way.form != "finite"),
    Variant("by multigrid", dict(petsc=MULTIGRID_OPTIONS, solver="FixedPoint"), lambda name, way: way.form != "mixed"),
    Variant("FixedPoint", dict(solver="FixedPoint")),
    Variant("CondensedNewton", dict(solver="CondensedNewton"), lambda name, way: way.form != "finite"),
    Variant("SparseNewton", dict(solver="SparseNewton"), _held),
    Variant("plane as level set", dict(surface="level set"), lambda name, way: way.surface == "plane" and _held(name, way), 2e-4),
    Variant("plane as huge ball", dict(surface="ball", radius=1e5), lambda name, way: way.surface == "plane" and _held(name, way) and "turned" not in name and "tilted" not in name, 5e-3),
    Variant("ball as function", dict(surface="ball as function"), lambda name, way: way.surface == "ball", 2e-4),
    Variant("roll as function", dict(surface="roll as function"), lambda name, way: way.surface == "roll", 2e-4),
    Variant("in steps", dict(steps=3), lambda name, way: way.mu[0] == 0.0, 1e-5),
    Variant("driven by its force", lambda played: dict(driven=tuple(played.pressing)), lambda name, way: _held(name, way) and "tilted" not in name and way.texture is None, 2e-3),
    Variant("thin slab", dict(d=3, cells=(8, 8, 4), part="slab"), lambda name, way: name in ("plane, 2-D", "plane, tilted, 2-D")),
    Variant("thin slab on a roll", dict(d=3, cells=(16, 16, 6), part="slab", surface="roll", mu=(0.3, 0.3)), lambda name, way: name == "circle", 1e-5),
]  # fmt: skip
# Scenes apart: halves, orders, small strains.
# What goes round within a step has friction along its chord or at its end; stresses of the ball's block do not turn.
ROUGHLY = {"plane, finite strain, turned far": 0.05, "ball, turned": 0.01}
APART = [
    *((name, SCENES[name], "the surface moves", dict(moves=1.0), tol) for name, tol in ROUGHLY.items()),
    ("ball, half", Way(legs=DOWN, surface="ball", **FINE, **C), "half", dict(part="half"), 1e-6),
    ("circle, half", Way(legs=DOWN, surface="ball", d=2, cells=(16, 6)), "half", dict(part="half"), 1e-6),
    ("plane, half", Way(legs=DOWN, **C), "half", dict(part="half"), 1e-6),
    ("wavy, half", Way(legs=DOWN, surface="wavy", **C), "half", dict(part="half"), 1e-6),
    ("even state", Way(legs=DOWN, nu=0.0, cells=(2, 2, 1)), "second order", dict(order=2), 1e-9),
    ("even state", Way(legs=DOWN, nu=0.0, cells=(2, 2, 1)), "tetrahedra", dict(simplex=True), 1e-9),
    ("even state", Way(legs=DOWN, nu=0.0, cells=(2, 2, 1)), "finer", dict(cells=(5, 4, 3)), 1e-9),
    ("even state", Way(legs=DOWN, nu=0.0, cells=(2, 2, 1)), "mixed", dict(order=2, form="mixed", nu=1e-6), 1e-5),
    ("smooth ball", Way(legs=DOWN, surface="ball", mu=(0, 0), cells=(12, 12, 5)), "second order", dict(order=2, cells=(6, 6, 3)), 0.1),
    ("little strain", Way(legs=tuple(Leg(tuple(1e-4 * np.array(leg.at))) for leg in PRESS), **C), "finite strain", dict(form="finite"), 1e-5),
    ("to and fro", Way(legs=(*PRESS, *PRESS[::-1], *PRESS), mu=(0, 0)), "in steps", dict(steps=2), 1e-8),
    ("in order", Way(legs=DOWN, mu=(0, 0), surface="ball", **FINE), "the other way round", dict(legs=(DOWN[1], DOWN[0], *DOWN)), 1e-5),
]  # fmt: skip


def difference(one: dict, other: dict) -> float:
    """The largest difference of forces, work and wear, each over the largest of its kind."""
    worst = 0.0
    for name, a in one.items():
        a, b = (np.asarray(part, dtype=float)[-2:] for part in (a, other[name]))
        size = np.abs(a).max(initial=0.0)
        if size > 1e-12 * np.abs(one["forces"]).max():
            worst = max(worst, float(np.abs(a - b).max() / size))
    return worst


def pairs(words=()):
    """Names of scene and variant, how to play both, and the tolerance."""
    for name, way in SCENES.items():
        for variant in VARIANTS:
            if variant.where(name, way):
                yield name, variant.name, way, variant.change, variant.tol
    yield from ((name, said, way, change, tol) for name, way, said, change, tol in APART)


def judged(one: Played, change, tol: float) -> tuple[str, float, str]:
    """What comes of a scene and its variant: "agrees", "told", "refused" or "WRONG WITHOUT A WORD"; difference over tolerance; why."""
    if one.numbers is None:
        return "refused", np.inf, one.said[0]
    other = Played(replace(one.way, **(change(one) if callable(change) else change)))
    said = [word for word in other.said if word not in one.said] + one.said
    if other.numbers is None:
        return "refused", np.inf, other.said[0]
    off = difference(one.numbers, other.numbers) / tol
    outcome = "agrees" if off <= 1.0 else "told" if said else "WRONG WITHOUT A WORD"
    return outcome, off, said[0] if said else ""


def main(argv=None) -> list[tuple]:
    words = sys.argv[1:] if argv is None else argv
    rows, played = [], {}
    for name, said, way, change, tol in pairs():
        if words and not any(word in f"{name}: {said}" for word in words):
            continue
        if id(way) not in played:
            played = {id(way): Played(way)}
        outcome, off, why = judged(played[id(way)], change, tol)
        rows.append((name, said, outcome, f"{off:.2g}", f"{tol:.0e}", why[:150]))
        print(*rows[-1], sep=" | ", flush=True)
    print(table(("scene", "said otherwise", "outcome", "difference / tolerance", "tolerance", "why"), rows))  # fmt: skip
    outcomes = [row[2] for row in rows]
    print(
        f"{len(rows)} pairs:", *(f"{outcomes.count(o)} {o}" for o in sorted(set(outcomes))), sep=" "
    )
    return rows


if __name__ == "__main__":
    main()
