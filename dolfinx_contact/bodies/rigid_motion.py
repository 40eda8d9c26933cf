# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Rigid-body modes of a body: unsupported and softly supported ones, geometry, connected parts.

A factorisation does not detect unsupported modes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from dolfinx_contact import compat

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.bodies.loose import LooseMotions
    from dolfinx_contact.contact.displacements import Displacements

# Relative energies and squared lengths below this are rounding errors.
RELATIVE_ROUNDING = 1e-13

# Relative energy below which a mode is soft: solving with the stiffness loses digits that contact
# needs.
SOFT_MOTION = 1e-4

# Approximate number of cells of each rank at which the strain is sampled.
SAMPLED_CELLS = 2000


def soft_motions(body: ElasticBody) -> tuple[np.ndarray, LooseMotions | None]:
    """Return rigid-body modes with little strain energy, and those without any.  Collective.

    Each connected part of the mesh is examined: springs in F give strain energy to rigid-body modes
    that Dirichlet conditions leave free.

    Args:
        body: ElasticBody with its assembled stiffness.

    Returns:
        Soft modes, ``shape=(owned dofs, m)``, zero at fixed degrees of freedom, ``m = 0`` if the
        body is well supported; and ``LooseMotions``, the modes without energy, which only contact
        can prevent, None if there are none.
    """
    displacements = body.displacements
    x = displacements.x[: displacements.count, : displacements.dim]
    part, parts = body.parts
    diagonal, soft, loose = body.diagonal(), [np.zeros((body.size, 0))], []
    for k in range(parts):
        modes = displacements.vectors(rigid_modes(x, part == k, body.comm))
        held = body.total(modes[body.fixed].T @ modes[body.fixed])
        values, vectors = np.linalg.eigh(held)
        left_free = vectors[:, values <= RELATIVE_ROUNDING * values[-1]]
        free = modes @ left_free
        if free.shape[1] == 0:
            continue
        free[body.fixed] = 0.0
        energy = body.total(free.T @ np.array([body.multiply(z) for z in free.T]).T)
        scale = body.total(free.T @ (diagonal[:, None] * free))
        root = np.linalg.inv(np.linalg.cholesky(scale))
        relative, vectors = np.linalg.eigh(root @ (energy + energy.T) / 2 @ root.T)
        if relative[0] < RELATIVE_ROUNDING:
            where = f"one of its {parts} separate parts" if parts > 1 else "the body"
            turned = root.T @ vectors[:, relative < RELATIVE_ROUNDING]
            combination = left_free @ turned
            middle, size = box(x, part == k, body.comm)
            loose.append((where, free @ turned, combination, middle, size))
        soft.append(free @ (root.T @ vectors[:, relative < SOFT_MOTION]))
    if not loose:
        return np.concatenate(soft, axis=1), None
    from dolfinx_contact.bodies.loose import LooseMotions, LoosePart

    return np.concatenate(soft, axis=1), LooseMotions([LoosePart(*part) for part in loose])


def box(x: np.ndarray, here: np.ndarray, comm: MPI.Comm) -> tuple[np.ndarray, float]:
    """Centre and largest edge of the bounding box of selected nodes.  Collective.

    Args:
        x: Nodal positions, ``shape=(n, gdim)``.
        here: Selected nodes, ``shape=(n,)``, bool.
        comm: MPI communicator.
    """
    low = x[here].min(axis=0, initial=np.inf)
    high = x[here].max(axis=0, initial=-np.inf)
    comm.Allreduce(MPI.IN_PLACE, low, op=MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, high, op=MPI.MAX)
    return (low + high) / 2, (high - low).max()


def rigid_modes(x: np.ndarray, here: np.ndarray, comm: MPI.Comm) -> np.ndarray:
    """Rigid-body modes of selected nodes: translations, and rotations about their box's centre.

    Rotations are scaled by the size of the box.

    Args:
        x: Nodal positions, ``shape=(n, gdim)``.
        here: Selected nodes, ``shape=(n,)``, bool.
        comm: MPI communicator.

    Returns:
        ``shape=(gdim n, 3)`` in two dimensions, ``(gdim n, 6)`` in three; zero at the other nodes.
    """
    n, gdim = x.shape
    middle, size = box(x, here, comm)
    x = (x - middle) / size
    pairs = [(i, j) for i in range(gdim) for j in range(i)]
    modes = np.zeros((n, gdim, gdim + len(pairs)))
    modes[:, range(gdim), range(gdim)] = 1.0
    for k, (i, j) in enumerate(pairs, start=gdim):
        modes[:, i, k], modes[:, j, k] = -x[:, j], x[:, i]
    modes[~here] = 0.0
    return modes.reshape(gdim * n, modes.shape[2])


def free_modes(body: ElasticBody) -> np.ndarray:
    """Orthonormal rigid-body modes of each part of the body that vanish at fixed dofs.  Collective.

    ``shape=(owned dofs, m)``.
    """
    displacements, (part, parts) = body.displacements, body.parts
    x = displacements.x[: displacements.count, : displacements.dim]
    modes = np.concatenate(
        [
            displacements.vectors(rigid_modes(x, part[: displacements.count] == k, body.comm))
            for k in range(parts)
        ],
        axis=1,
    )
    modes[body.fixed] = 0.0
    products = body.total(modes.T @ modes)
    values, vectors = np.linalg.eigh(products)
    left = values > RELATIVE_ROUNDING * values[-1]
    if not left.all():  # Dirichlet conditions fix a component of all nodes
        return modes @ vectors[:, left] / np.sqrt(values[left])
    return np.linalg.solve(np.linalg.cholesky(products), modes.T).T


def extents(displacements: Displacements) -> tuple[float, float]:
    """Largest and smallest edge of the body's bounding box, length units.  Collective."""
    x, comm = displacements.x, displacements.V.mesh.comm
    edges = np.concatenate((x.max(axis=0, initial=-np.inf), (-x).max(axis=0, initial=-np.inf)))
    comm.Allreduce(MPI.IN_PLACE, edges, op=MPI.MAX)
    edges = edges[:3] + edges[3:]
    return float(edges.max()), float(edges[: displacements.dim].min())


def mean_strain(displacements: Displacements, u: np.ndarray) -> float:
    """Root mean square of the largest principal strain in magnitude, sampled over cells.
    Collective.

    About ``SAMPLED_CELLS`` cells of each rank are used.

    Args:
        displacements: ``Displacements``.
        u: Displacement, degrees of freedom on this rank, ghosts included.
    """
    mesh = displacements.V.mesh
    nodes = compat.cell_nodes(displacements.V)[
        : mesh.topology.index_map(mesh.topology.dim).size_local
    ]
    nodes = nodes[:: len(nodes) // SAMPLED_CELLS + 1]
    x, moved = (
        displacements.x[nodes][..., : displacements.dim],
        u[displacements.dofs(nodes.ravel())].reshape(*nodes.shape, displacements.dim),
    )
    x, moved = (values - values.mean(axis=1, keepdims=True) for values in (x, moved))
    across = x.transpose(0, 2, 1)
    inertia = across @ x
    slopes = np.linalg.solve(inertia, across @ moved)
    strains = np.linalg.eigvalsh(0.5 * (slopes + slopes.transpose(0, 2, 1)))
    volume = np.sqrt(np.linalg.det(inertia))  # up to a factor, for cells of one type
    parts = np.array([volume @ np.abs(strains).max(axis=1) ** 2, volume.sum()])
    mesh.comm.Allreduce(MPI.IN_PLACE, parts, op=MPI.SUM)
    return float(np.sqrt(parts[0] / parts[1]))


def connected_parts(displacements: Displacements) -> tuple[np.ndarray, int]:
    """Index of the connected part of the mesh for each owned node, and the number of parts.
    Collective.
    """
    V = displacements.V
    comm = V.mesh.comm
    local = _smallest_connected(compat.cell_nodes(V), V.tabulate_dof_coordinates().shape[0])
    # Labels unique over all ranks; the owner of a node sends its label to ranks with its ghost.
    first = comm.exscan(local.max(initial=-1) + 1) or 0
    name = fem.Function(V)
    components = V.dofmap.index_map_bs
    mine = (first + local).astype(np.int64)
    name.x.array[:] = np.repeat(mine, components)
    name.x.scatter_forward()
    owners = name.x.array[::components].astype(np.int64)
    same = np.unique(np.column_stack([mine, owners]), axis=0)
    same = np.concatenate(comm.allgather(same))
    joined = _smallest_connected(same, same.max() + 1)
    numbers, part = np.unique(joined[mine], return_inverse=True)
    on_all_ranks = np.unique(np.concatenate(comm.allgather(numbers)))
    return np.searchsorted(on_all_ranks, numbers)[part.reshape(-1)][
        : displacements.count
    ], on_all_ranks.size


def _smallest_connected(groups: np.ndarray, size: int) -> np.ndarray:
    """Smallest index of a node connected to each node, ``shape=(size,)``.

    Args:
        groups: Groups of connected nodes, one per row, ``shape=(m, k)``.
        size: Number of nodes.
    """
    label = np.arange(size)
    while True:
        smallest = np.repeat(label[groups].min(axis=1, initial=size), groups.shape[1])
        following = label.copy()
        np.minimum.at(following, groups.ravel(), smallest)
        following = following[following]  # pointer jumping: halves the distance to the smallest
        if np.array_equal(following, label):
            return label
        label = following
