"""Contact points on the facets of second-order tetrahedra: what may stand for a gap and carry a pressure there.

A contact point is a row of ``C``, factors of the motions of the facets' nodes that sum to one. Reactions ``r`` of the points are
forces ``C^T r`` on the nodes. NumPy, SciPy and basix alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
from scipy import sparse

EXACT = 12  # degree up to which facets are integrated, also curved ones
ALPHA = 0.2  # of the basis whose vertices have weight [A. Popp et al., SIAM J. Sci. Comput. 34 (2012) B421]
VARIANTS = {
    "middles": "gaps at the middles of edges, which carry what an even pressure makes there: what the package does",
    "corrected": "the same, with the little that vertices of curved facets would carry: half of it to each edge beside them",
    "nodes": "gaps at all nodes",
    "weighted P0": "mean gaps of facets: one pressure on each",
    "weighted P1": "gaps weighted with hat functions: pressures linear on facets, continuous",
    "weighted P2": "gaps weighted with positive functions of second order",
    "dual P1": "gaps weighted with what is biorthogonal to hat functions",
    "dual P2": "gaps weighted with what is biorthogonal to positive functions of second order",
    "3 points": "gaps at the 3 points of a rule within facets",
    "6 points": "gaps at the 6 points of a rule within facets",
}


def shapes(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear shape functions of a triangle and those of second order, vertices first, then the middles that face them: ``(q, k)``."""
    a = np.column_stack((1 - xi.sum(axis=1), xi))
    return a, np.hstack((a * (2 * a - 1), 4 * np.roll(a, -1, axis=1) * np.roll(a, -2, axis=1)))


def slopes(xi: np.ndarray) -> np.ndarray:
    """Derivatives of those of second order, ``shape=(q, 6, 2)``."""
    a = shapes(xi)[0]
    d = np.array([[-1.0, -1], [1, 0], [0, 1]])
    j, k = (np.roll(np.arange(3), -s) for s in (1, 2))
    edges = 4 * (a[:, j, None] * d[k] + a[:, k, None] * d[j])
    return np.concatenate(((4 * a[:, :, None] - 1) * d, edges), axis=1)


def measured(triangles: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of a rule on the reference facet, and weights on each one, curved or not: ``(f, q)``; ``triangles`` ``(f, 6, 3)``."""
    xi, weight = basix.make_quadrature(basix.CellType.triangle, degree)
    along = np.einsum("qkd,fki->fqid", slopes(xi), triangles)
    return xi, weight * np.linalg.norm(np.cross(along[..., 0], along[..., 1]), axis=2)


@dataclass
class Points:
    """Contact points of a variant."""

    C: sparse.csr_matrix  # (points, nodes)
    area: np.ndarray  # reaction over pressure
    x: np.ndarray  # where the pressure is read, (points, 3)
    mass: np.ndarray | sparse.csr_matrix  # of the functions whose coefficients are pressures


def assembled(local: np.ndarray, rows: np.ndarray, columns: np.ndarray, shape) -> sparse.csr_matrix:
    """Sum of the matrices of facets, ``(f, i, j)``, at ``rows`` ``(f, i)`` and ``columns`` ``(f, j)``."""
    at = [np.broadcast_to(k, local.shape).ravel() for k in (rows[:, :, None], columns[:, None, :])]
    return sparse.coo_matrix((local.ravel(), at), shape).tocsr()


def reference_values() -> np.ndarray:
    """Shape functions of second order at points all over a facet, its nodes too."""
    nodes = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])
    return shapes(np.vstack((nodes, basix.make_quadrature(basix.CellType.triangle, EXACT)[0])))[1]


def even(X: np.ndarray, T: np.ndarray) -> np.ndarray:
    """What an even pressure of one makes at nodes, ``shape=(m,)``: integrals of the shape functions."""
    xi, w = measured(X[T], EXACT)
    return np.bincount(T.ravel(), (w @ shapes(xi)[1]).ravel(), len(X))


def contact_points(variant: str, X: np.ndarray, T: np.ndarray) -> Points:
    """Points of one of ``VARIANTS`` on facets ``T``, ``(f, 6)``, vertices before the middles that face them, of nodes at ``X``, ``(m, 3)``."""
    kind, _, name = variant.partition(" ")
    if name == "points":
        xi, w = measured(X[T], {"3": 2, "6": 4}[kind])
        values = np.broadcast_to(shapes(xi)[1], (*w.shape, 6))
        C = assembled(values, np.arange(w.size).reshape(w.shape), T, (w.size, len(X)))
        return Points(C, w.ravel(), C @ X, sparse.diags(w.ravel()))
    if name:
        return _weighted(kind == "dual", name, X, T)
    nodes = np.arange(len(X)) if kind == "nodes" else np.unique(T[:, 3:])
    C, area = sparse.eye(len(X), format="csr")[nodes], even(X, T)[nodes]
    if kind == "corrected":
        xi, w = measured(X[T], EXACT)
        shares = (w @ shapes(xi)[1])[:, None, :] * np.hstack(((1 - np.eye(3)) / 2, np.eye(3)))
        C = assembled(shares, T[:, 3:], T, (len(X),) * 2)[nodes]
        area = C @ np.ones(len(X))
        C = sparse.diags(1 / area) @ C
    return Points(C.tocsr(), area, X[nodes], sparse.diags(area))


def _weighted(dual: bool, name: str, X: np.ndarray, T: np.ndarray) -> Points:
    """Points of gaps that are weighted with functions."""
    xi, w = measured(X[T], EXACT)
    linear, second = (np.broadcast_to(N, (*w.shape, N.shape[1])) for N in shapes(xi))
    positive = np.eye(6)
    positive[3:] = np.hstack((ALPHA * (1 - np.eye(3)), (1 - 2 * ALPHA) * np.eye(3)))
    basis = {"P0": np.ones((*w.shape, 1)), "P1": linear, "P2": second @ positive}[name]
    labels = {"P0": np.arange(len(T))[:, None], "P1": T[:, :3], "P2": T}[name]
    used, rows = np.unique(labels, return_inverse=True)
    rows, whole = rows.reshape(labels.shape), np.einsum("fq,fqi->fi", w, basis)
    if dual:  # on each facet by itself
        gram = np.einsum("fq,fqi,fqj->fij", w, basis, basis)
        basis = basis @ (np.linalg.inv(gram) * whole[:, None, :])
    area = np.bincount(rows.ravel(), whole.ravel())
    gaps, gram = (np.einsum("fq,fqi,fqj->fij", w, basis, other) for other in (second, basis))
    C = (sparse.diags(1 / area) @ assembled(gaps, rows, T, (len(used), len(X)))).tocsr()
    mass = assembled(gram, rows, rows, (len(used),) * 2)
    return Points(C, area, C @ X if name == "P0" else X[used], mass)
