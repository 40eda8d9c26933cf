"""Bodies condensed to the nodes of their facets that may touch, and contact of any points there. One rank."""

from __future__ import annotations

import warnings
from time import process_time
from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.bodies.elastic import ElasticBody
from dolfinx_contact.compat import cell_nodes
from dolfinx_contact.contact.interface import ContactPoints
from dolfinx_contact.solvers.condensed.compliance import Rows, compliance
from dolfinx_contact.solvers.condensed.kernel import condensed_operator

# isort: split
import numpy as np
from scipy import sparse

from benchmarks.tetrahedra.points import Points

SECONDS = 10.0  # after which a step counts as failed


def facet_nodes(V, facets: np.ndarray) -> np.ndarray:
    """Nodes of each facet of second-order tetrahedra, vertices first, then the middles that face them: ``(f, 6)``."""
    topology, layout = V.mesh.topology, V.dofmap.dof_layout
    for dims in ((2, 3), (3, 2), (3, 0)):
        topology.create_connectivity(*dims)
    ends = {tuple(layout.entity_closure_dofs(1, e)): layout.entity_dofs(1, e)[0] for e in range(6)}
    middles = {frozenset(k for k in nodes if k < 4): own for nodes, own in ends.items()}
    found, nodes = [], cell_nodes(V)
    for facet in facets:
        cell = topology.connectivity(2, 3).links(facet)[0]
        local = list(topology.connectivity(3, 2).links(cell)).index(facet)
        a, b, c = (k for k in layout.entity_closure_dofs(2, local) if k < 4)
        six = [a, b, c, *(middles[frozenset(pair)] for pair in ((b, c), (c, a), (a, b)))]
        found.append(nodes[cell][six])
    return np.array(found)


class Body:
    """An elastic body, condensed to the nodes of its facets that may touch; components along the rows of ``frame``."""

    def __init__(self, body: ElasticBody, facets: np.ndarray, frame: np.ndarray):
        start = process_time()
        body.refresh()
        triangles = facet_nodes(body.V, facets)
        nodes, self.T = np.unique(triangles, return_inverse=True)
        self.T, self.X = self.T.reshape(-1, 6), body.V.tabulate_dof_coordinates()[nodes]
        dofs = 3 * nodes[:, None] + np.arange(3)
        owned, free = body.displacements.owned, np.ones(body.size, dtype=bool)
        free[body.fixed] = False
        points = ContactPoints(dofs, np.tile(frame, (len(nodes), 1, 1)), owned)
        rows = points.rows(np.tile(np.eye(3), (len(nodes), 1, 1)), free)
        self._rows = Rows(body.comm, *rows, 0, body.size)
        self.S, self._body = compliance(body, [self._rows]), body
        self.unknowns, self.seconds = body.size, process_time() - start

    def free(self) -> np.ndarray:
        """Motion of the nodes without reactions, ``shape=(m, 3)``."""
        return self._rows.of(self._body.free_state(self._body.load()[0])).reshape(-1, 3)


class Touching:
    """The contact of points, components (t1, t2, n) of each."""

    def __init__(self, points: Points, S: np.ndarray):
        self.points, self._S = points, S
        self._B = sparse.kron(points.C, sparse.eye(3)).tocsr()
        W = self._B @ (self._B @ self._S).T
        inert = ~W.any(axis=0)  # held by symmetry
        W[inert, inert] = np.diag(W).mean()
        self._operator = condensed_operator((W + W.T) / 2, 3)

    def solve(self, q: np.ndarray, law: dc.Friction, starts=()) -> SimpleNamespace:
        """Reactions for nodes that stand at ``q``, ``(m, 3)``, and where those are then."""
        begin, solver, failed = process_time(), dc.CondensedNewton(max_seconds=SECONDS), False
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", dc.RoundingWarning)
            try:
                free = self._B @ q.ravel()
                found = solver.solve_condensed(self._operator, law, free, 1e-10, starts)
            except dc.CondensedNotConverged as failure:
                found, failed = failure.best, True
        forces = self._B.T @ found.reaction.ravel()
        motion = q + (self._S @ forces).reshape(q.shape)
        return SimpleNamespace(
            reaction=found.reaction.reshape(-1, 3), status=found.status, forces=forces.reshape(q.shape),
            motion=motion, at_points=(self._B @ motion.ravel()).reshape(-1, 3),
            failed=failed, seconds=process_time() - begin,
        )  # fmt: skip
