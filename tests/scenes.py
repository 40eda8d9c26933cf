"""Small scenes that several tests share: a block on a plane, in two and three dimensions."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

import dolfinx_contact as dc  # before dolfinx, which some releases want
from dolfinx_contact.compat import functionspace

COMM = MPI.COMM_WORLD


def rotation(seed: int = 0) -> np.ndarray:
    """A seeded rotation matrix, ``shape=(3, 3)``."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.linalg.det(q)


def elasticity(u, v, E, nu):
    """Internal virtual work of linear isotropic elasticity (plane strain in two dimensions)."""
    lmbda, shear = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    eps = ufl.sym(ufl.grad(u))
    sigma = lmbda * ufl.tr(eps) * ufl.Identity(len(u)) + 2 * shear * eps
    return ufl.inner(sigma, ufl.sym(ufl.grad(v))) * ufl.dx


def block(
    comm=COMM,
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
    turn = np.eye(3) if turn is None else turn
    low, high = [-0.5] * (gdim - 1) + [0.0], [0.5] * (gdim - 1) + [0.6]
    distribution = {} if partitioner is None else {"partitioner": partitioner}
    if gdim == 3:
        domain = mesh.create_box(
            comm, [np.array(low), np.array(high)], cells, mesh.CellType.hexahedron, **distribution
        )
    else:
        domain = mesh.create_rectangle(
            comm, [np.array(low), np.array(high)], cells, mesh.CellType.quadrilateral
        )
    height = gdim - 1
    facets = mesh.locate_entities_boundary(domain, gdim - 1, lambda x: np.isclose(x[height], 0.0))
    top = mesh.locate_entities_boundary(domain, gdim - 1, lambda x: np.isclose(x[height], 0.6))
    domain.geometry.x[:] = length * domain.geometry.x @ turn.T
    V = functionspace(domain, ("Lagrange", 1, (gdim,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    held = fem.Function(V)
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, gdim - 1, top))]
    modulus = fem.Constant(domain, float(E))
    force = fem.Constant(domain, np.zeros(gdim))
    F = elasticity(u, v, modulus, nu) - ufl.inner(force, v) * ufl.dx
    axes = turn[:gdim, :gdim]
    axis = None if gdim == 2 else axes[:, 0]
    plane = dc.RigidPlane(point=np.zeros(gdim), normal=axes[:, -1], axis=axis)
    contact = dc.Contact(V, facets, plane, dc.Friction(mu=mu, p=p), wear=wear)
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, tol=tol, **options)

    def move_top(*displacement):
        """Displacement of the top in the scene's own axes, in units of ``length``."""
        held.x.array[:] = np.tile(
            length * axes @ np.array(displacement, dtype=float), held.x.array.size // gdim
        )

    return SimpleNamespace(
        V=V, u=u, F=F, bcs=bcs, facets=facets, plane=plane, contact=contact, problem=problem,
        move_top=move_top, held=held, force=force, modulus=modulus, axes=axes, mesh=domain,
    )  # fmt: skip


def gathered(contact):
    """Positions and local reactions of all nodes on every rank, sorted by position."""
    x = np.concatenate(contact.comm.allgather(contact.x))
    r = np.concatenate(contact.comm.allgather(contact.reaction))
    order = np.lexsort(np.round(x / np.abs(x).max(), 9).T)
    return x[order], r[order]


def totals(contact):
    """Total normal reaction and sum of the norms of the tangential ones, the same on all ranks."""
    _, r = gathered(contact)
    return np.array([r[:, -1].sum(), np.linalg.norm(r[:, :-1], axis=1).sum()])


def by_position(scene, name):
    """An array of all contact nodes, in an order that no rank has to do with."""
    contact = scene.contact
    x, values = (np.concatenate(contact.comm.allgather(a)) for a in (contact.x, getattr(contact, name)))  # fmt: skip
    return values[np.lexsort(np.round(x / np.abs(x).max(), 9).T)]
