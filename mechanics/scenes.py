# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Bodies on a plane, for tests and benchmarks: held at the top, at an end, or by soft springs."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import ufl
from mpi4py import MPI

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh

from dolfinx_contact.compat import functionspace
from mechanics.material import elasticity


@dataclass(frozen=True)
class Move:
    """One load step of a scene, in its axes and in units of ``length``, ``E``.

    Attributes:
        top: Displacement of what is held, or of the springs' home.
        tilt: Turn of it about the y axis, small: ``u_z = tilt x``.
        load: Force per volume, for bodies with ``loads``; in units of ``E / length``.
        fresh: Whether the step starts from the undeformed body.
    """

    top: tuple = (0, 0, 0)
    tilt: float = 0.0
    load: tuple = (0, 0, 0)
    fresh: bool = False


def on_plane(
    domain, touching, top, modulus, nu, mu, p=None, length=1.0, turn=None, spring=None, loads=True, wear=None
):  # fmt: skip
    """A body whose plane is its lowest coordinate 0, as loads, supports and contact; any number of ranks, two or three dimensions.

    Args:
        domain: The mesh in the scene's axes; it is scaled by ``length`` and rotated by ``turn`` here.
        touching, top: Facets that may touch (None: the problem has no contact), and those that are held.
        modulus, nu: Coefficients of the material.
        spring: Stiffness of springs at ``top``, per area; None holds it.
        loads: Whether there is a force per volume, ``force``.
    """
    d = domain.geometry.dim
    turn = np.eye(3) if turn is None else turn
    axes = turn[:d, :d]
    domain.geometry.x[:] = length * domain.geometry.x @ turn.T
    V = functionspace(domain, ("Lagrange", 1, (d,)))
    u, v, held = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    force = fem.Constant(domain, np.zeros(d))
    F = elasticity(u, v, modulus, nu)
    if loads:
        F = F - ufl.inner(force, v) * ufl.dx
    bcs = []
    if spring is None:
        bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, d - 1, top))]
    else:
        tags = mesh.meshtags(domain, d - 1, np.sort(top), np.ones(top.size, dtype=np.int32))
        ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)
        F = F + fem.Constant(domain, spring) * ufl.inner(u - held, v) * ds(1)
    contact = plane = None
    if touching is not None:
        axis = None if d == 2 else axes[:, 0]
        plane = dc.RigidPlane(point=np.zeros(d), normal=axes[:, -1], axis=axis)
        contact = dc.Contact(V, touching, plane, dc.Friction(mu=mu, p=p), wear=wear)
    return SimpleNamespace(
        V=V, u=u, F=F, bcs=bcs, contact=contact, surface=plane, facets=touching, held=held, force=force,
        axes=axes, mesh=domain, modulus=modulus,
    )  # fmt: skip


def problem_of(scene, solver=None, tol=1e-8, **options):
    """The contact problem of a scene, which may have no contact."""
    contacts = [] if scene.contact is None else [scene.contact]
    return dc.ContactProblem(
        scene.F, scene.u, contacts, bcs=scene.bcs, solver=solver, tol=tol, **options
    )


def rotation(seed: int = 0) -> np.ndarray:
    """A seeded rotation matrix, ``shape=(3, 3)``."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.linalg.det(q)


def block(
    comm=MPI.COMM_WORLD,
    cells=(4, 4, 2),
    mu=(0.3, 0.15),
    p=(0.05, 0.20),
    E=210e3,
    nu=0.3,
    length=1.0,
    turn=None,
    tol=1e-10,
    wear=None,
    partitioner=None,
    **options,
):
    """A block whose top is held and moved and whose bottom meets the plane through the origin.

    Edges 1, 1, 0.6 (1, 0.6 in two dimensions) times ``length``; ``turn`` rotates the whole scene.
    """
    gdim = len(cells)
    low, high = [-0.5] * (gdim - 1) + [0.0], [0.5] * (gdim - 1) + [0.6]
    distribution = {} if partitioner is None else {"partitioner": partitioner}
    corners = [np.array(low), np.array(high)]
    if gdim == 3:
        domain = mesh.create_box(comm, corners, cells, mesh.CellType.hexahedron, **distribution)
    else:
        domain = mesh.create_rectangle(comm, corners, cells, mesh.CellType.quadrilateral)
    bottom, top = (
        mesh.locate_entities_boundary(domain, gdim - 1, lambda x, z=z: np.isclose(x[gdim - 1], z))
        for z in (0.0, 0.6)
    )
    modulus = fem.Constant(domain, float(E))
    scene = on_plane(domain, bottom, top, modulus, nu, mu, p, length, turn, wear=wear)
    scene.problem = problem_of(scene, tol=tol, **options)

    def move_top(*displacement):
        """Displacement of the top in the scene's own axes, in units of ``length``."""
        moved = length * scene.axes @ np.array(displacement, dtype=float)
        scene.held.x.array[:] = np.tile(moved, scene.held.x.array.size // gdim)

    scene.move_top = move_top
    return scene


def build(
    mu=0.2, p=None, cells=(4, 4, 2), E=210e3, nu=0.3, length=1.0, turn=None, aspect=1.0, jump=1.0,
    spring=None, edges=(1.0, 1.0, 0.6), tip=None, grade=1.0, coat=None, loads=False, touching=True,
):  # fmt: skip
    """A block, by default of edges 1, 1, 0.6 over ``aspect``, top held rigidly or by a soft ``spring``.

    Args:
        jump: Ratio of the moduli of neighbouring cells.
        spring: Stiffness of springs at the top over E / length; None holds the top.
        tip: Of a cantilever along x: its end is held instead of the top, and as much of the other end may touch.
        grade: Width of the largest cell over that of the smallest, in both directions of the plane.
        coat: Modulus over E, and thickness, of the lowest layer of cells.
        loads: Whether there is a force per volume.
        touching: Whether the problem has a contact at all.
    """
    turn = np.eye(3) if turn is None else turn
    domain, facets, top, soft = box(cells, edges, tip, grade, coat, aspect)
    modulus = fem.Function(functionspace(domain, ("Discontinuous Lagrange", 0)))
    modulus.x.array[:] = E * np.where(np.arange(modulus.x.array.size) % 2, jump, 1.0)
    if coat is not None:
        height = modulus.function_space.tabulate_dof_coordinates()[:, 2]
        modulus.x.array[height < soft] *= coat[0]
    scene = on_plane(
        domain, facets if touching else None, top, modulus, fem.Constant(domain, float(nu)), mu, p, length, turn,
        None if spring is None else spring * E / length, loads,
    )  # fmt: skip
    x = scene.V.tabulate_dof_coordinates() @ turn[:, 0]

    def move_top(move):
        move = move if isinstance(move, Move) else Move(top=tuple(move))
        moved = length / aspect * turn @ np.asarray(move.top, dtype=float)
        tilted = move.tilt * x[:, None] * turn[:, 2]
        scene.held.x.array[:] = (moved + tilted).ravel()
        scene.force.value[:] = E / length * turn @ np.asarray(move.load, dtype=float)

    scene.move_top = move_top
    return scene


def box(cells, edges, tip, grade, coat, aspect):
    """A mesh of hexahedra, facets that may touch, facets that are held, and the height of the coat."""
    half = np.array(edges) / 2
    low = np.array([-half[0], -half[1], 0.0])
    domain = mesh.create_box(MPI.COMM_SELF, [low, low + edges], cells, mesh.CellType.hexahedron)

    def bottom(x):
        return np.isclose(x[2], 0.0) & (True if tip is None else x[0] > half[0] - tip)

    def hold(x):
        return np.isclose(x[2], edges[2]) if tip is None else np.isclose(x[0], -half[0])

    facets, top = (mesh.locate_entities_boundary(domain, 2, where) for where in (bottom, hold))
    x = domain.geometry.x
    if grade != 1:
        for k in range(2):
            widths = np.geomspace(1, grade, cells[k])
            planes = np.append(0, np.cumsum(widths)) / widths.sum() * edges[k] - half[k]
            x[:, k] = np.interp(x[:, k], np.linspace(-half[k], half[k], cells[k] + 1), planes)
    if coat is not None:
        planes = np.append(0, np.linspace(coat[1], edges[2], cells[2]))
        x[:, 2] = np.interp(x[:, 2], np.linspace(0, edges[2], cells[2] + 1), planes)
    x[:, 2] /= aspect
    return domain, facets, top, None if coat is None else coat[1] / aspect
