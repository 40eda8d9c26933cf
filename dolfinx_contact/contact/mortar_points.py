# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact points between two deformable surfaces: a slave node against its projection on the opposite mesh.

Row a of the contact operator is ``w_a = F_a (u_a - sum_b m_ab u_b)``; its reaction acts with ``r_a`` on a and with ``-m_ab r_a``
on b, so that forces balance whatever the meshes are.  Coefficients ``m_ab`` are those of ``mortar.py``, the rows those of a
PETSc matrix: the opposite nodes may belong to other ranks.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from dolfinx_contact.contact.facets import facets_of
from dolfinx_contact.contact.interface import FREE, ContactPoints, block_diagonal, nodal_blocks
from dolfinx_contact.contact.mortar import Rows, Side, rows_of
from dolfinx_contact.contact.placement import Placed, Placement
from dolfinx_contact.contact.state import State
from dolfinx_contact.step.errors import NodalStiffness
from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.collective import raised_together

STRAYED = 0.5  # part of a facet by which a slave node may slide with the coefficients of the undeformed state

AXIS = 1e-8  # part of an axis along the surface, of a direction that is none


class MortarPlacement(Placement):
    """Frames, gaps and motions of the slave nodes of a contact relative to the opposite mesh, in the undeformed state."""

    def __init__(self, contact, facets: np.ndarray, owned: tuple, extent: float):
        of, surface, nodes = contact.displacements, contact.surface, contact.nodes
        self._facets = _gathered(of, facets, contact.comm)
        self._opposite = Opposite(of, surface.facets, contact.comm)
        numbers = _numbers(of.V.dofmap.index_map, nodes)
        mine = [side.some(np.isin(side.nodes, numbers).any(axis=1)) for side in self._facets]
        with raised_together(contact.comm):
            self.rows = _sorted_rows(mine, self._opposite.sides, numbers)
        self._towards = _mean_normals(mine, numbers)
        gdim = of.dim
        super().__init__(surface, contact.x[:, :gdim], of.dofs(nodes), owned, extent, contact.comm)

    def _place(self, home: np.ndarray, there: np.ndarray, before: Placed | None) -> None:
        """See ``Placement``: once, where the undeformed bodies stand.  Collective."""
        x, surface = self.x, self.surface
        with raised_together(self._comm):
            frames = frames_along(self._towards, surface.axis)
        opposite = self.rows.m @ self._opposite.x
        flat = ((x - opposite) * frames[:, -1]).sum(axis=1)
        flat[~self.rows.covered] = self._apart  # opposite nothing: closed
        points = MortarPoints(self._dofs, frames, self._owned, self.rows, self._opposite.dofs, self._comm)  # fmt: skip
        home, frames, flat = map(frozen, (x.copy(), frames, flat))
        still = surface.rotation
        self.now = Placed(home, still, frames, frames, flat, points, None, None, still)

    @property
    def opposite(self) -> np.ndarray:
        """See ``Placement``."""
        return self._opposite.nodes

    @property
    def covered(self) -> np.ndarray:
        """See ``Placement``."""
        rows, none = self.rows, np.zeros(len(self.x))
        part = np.divide(rows.area, rows.whole, out=none, where=rows.whole > 0.0)
        return np.where(rows.covered, part, 0.0)

    def strayed(self, state: State) -> tuple[float, float]:
        """See ``Placement``: from the opposite point of the undeformed state, and half of the smallest facet."""
        slid = np.linalg.norm(state.displacement[:, :-1], axis=1)
        slid = slid[state.reaction[:, -1] > 0.0].max(initial=0.0)
        return float(slid), STRAYED * self._opposite.smallest

    def follows(self, wanders: bool) -> bool:
        """Never: sliding is small."""
        return False

    def meet(self, fixed: np.ndarray) -> None:
        """Take frames without what supports hold of normals: those of a symmetry plane lie in it.  Collective."""
        held = np.isin(self._dofs, fixed)
        left = np.where(held, 0.0, self._towards)
        length = np.linalg.norm(left, axis=1, keepdims=True)
        some = length > FREE  # else the support holds the node along its normal
        self._towards = np.where(some, left / np.where(some, length, 1.0), self._towards)
        self._place(self.x, self.x, None)
        self.settle()


class Opposite:
    """The nodes of the other side, known to all ranks.

    Attributes:
        sides: Their facets, by shape; nodes in numbers of their own, ``0 ... m - 1``.
        nodes: Local indices of those that this rank owns.
        smallest: The shortest edge of a facet.
        numbers: Global numbers of the nodes, sorted, ``shape=(m,)``.
        x: Where they are, ``shape=(m, gdim)``.
        dofs: Their degrees of freedom in global numbers, ``shape=(m, gdim)``.
    """

    def __init__(self, of, facets: np.ndarray, comm):
        sides = _gathered(of, facets, comm)
        self.numbers = np.unique(np.concatenate([side.nodes.ravel() for side in sides]))
        self.x = np.zeros((self.numbers.size, of.dim))
        for side in sides:
            self.x[np.searchsorted(self.numbers, side.nodes)] = side.x
        ends = [side.x[:, side.corners] for side in sides]
        self.smallest = min(
            np.linalg.norm(x[:, 1] - x[:, 0], axis=1).min(initial=np.inf) for x in ends
        )
        self.sides = [s._replace(nodes=np.searchsorted(self.numbers, s.nodes)) for s in sides]
        index_map, count = of.V.dofmap.index_map, of.count
        own = np.isin(_numbers(index_map, np.arange(count)), self.numbers)
        self.nodes = local = np.flatnonzero(own)
        dofs = of.owned[1] + of.dofs(local)
        given = comm.allgather((_numbers(index_map, local), dofs))
        at = np.searchsorted(self.numbers, np.concatenate([numbers for numbers, _ in given]))
        self.dofs = np.zeros((self.numbers.size, of.dim), dtype=np.int64)
        self.dofs[at] = np.concatenate([dofs for _, dofs in given])


class MortarPoints(ContactPoints):
    """Slave nodes, each with the opposite nodes that it presses on; see ``ContactPoints``.

    Args:
        dofs, frames, owned: As ``ContactPoints`` has them.
        rows: Coefficients of the opposite nodes.
        opposite: Degrees of freedom of all opposite nodes in global numbers, ``shape=(m, gdim)``.
        comm: MPI communicator.  Everything that asks for motion or forces is collective.
    """

    local = False

    def __init__(self, dofs, frames, owned, rows: Rows, opposite: np.ndarray, comm):
        (size, self.first, self._whole), (self.count, self.dim) = owned, dofs.shape
        self.size, self.dofs, self.frames = size, dofs, frames
        self._m, self._covered, self._opposite, self._comm = rows.m, rows.covered, opposite, comm
        turned = block_diagonal(frames)
        mine = (self.first + dofs).ravel()
        self._S = self._petsc(turned.indptr, mine[turned.indices], turned.data)
        away = (turned @ sparse.kron(self._m, sparse.eye(self.dim), "csr")).tocoo()
        own = turned.tocoo()
        columns = (mine[own.col], opposite.ravel()[away.col])
        parts = (np.append(own.row, away.row), np.append(*columns))
        B = sparse.coo_matrix((np.append(own.data, -away.data), parts), (dofs.size, self._whole))
        B = B.tocsr()
        self._B = self._petsc(B.indptr, B.indices, B.data)
        self._sizes = self._petsc(B.indptr, B.indices, np.abs(B.data))
        self._points, self._body = self._B.createVecLeft(), self._B.createVecRight()
        self.hold(np.zeros((self.count, self.dim - 1), dtype=bool), np.zeros(self.count, dtype=bool))  # fmt: skip

    def _petsc(self, starts, columns, values) -> PETSc.Mat:
        csr = (starts.astype(PETSc.IntType), columns.astype(PETSc.IntType), np.ravel(values))
        size = ((self.dofs.size, None), (self.size, self._whole))
        return PETSc.Mat().createAIJ(size, csr=csr, comm=self._comm)

    def hold(self, held, closed, guided=None, fixed=None) -> None:
        """See ``ContactPoints``; nodes opposite nothing never touch, either."""
        super().hold(held, closed | ~self._covered, guided, fixed)

    def motion(self, u: np.ndarray) -> np.ndarray:
        """See ``ContactPoints``."""
        return self._rows(self._B, u)

    def magnitudes(self, u: np.ndarray) -> np.ndarray:
        """See ``ContactPoints``."""
        return self._rows(self._sizes, np.abs(u))

    def reactions(self, forces: np.ndarray) -> np.ndarray:
        """See ``ContactPoints``: those on the slave node alone."""
        return np.einsum("nij,nj...->ni...", self.frames, forces[self.dofs])

    def add_forces(self, reaction: np.ndarray, forces: np.ndarray) -> None:
        """See ``ContactPoints``."""
        forces += self._columns(self._B, reaction)

    def add_magnitudes(self, reaction: np.ndarray, forces: np.ndarray) -> None:
        """See ``ContactPoints``."""
        forces += self._columns(self._sizes, np.abs(reaction))

    def _rows(self, matrix, u: np.ndarray) -> np.ndarray:
        if u.ndim > 1:
            return np.stack([self._rows(matrix, column) for column in u.T], axis=-1)
        self._body.array_w[:] = u
        matrix.mult(self._body, self._points)
        return self._points.array_r.reshape(self.count, self.dim).copy()

    def _columns(self, matrix, reaction: np.ndarray) -> np.ndarray:
        self._points.array_w[:] = reaction.ravel()
        matrix.multTranspose(self._points, self._body)
        return self._body.array_r.copy()

    def matrix(self, blocks: np.ndarray) -> sparse.csr_matrix:
        """See ``ContactPoints``."""
        return self._product(blocks, self._B)

    def of_reactions(self, blocks: np.ndarray) -> sparse.csr_matrix:
        """See ``ContactPoints``."""
        return self._product(blocks, self._S)

    def _product(self, blocks: np.ndarray, by: PETSc.Mat) -> sparse.csr_matrix:
        """``B^T D by``."""
        D, size = block_diagonal(blocks), (self.dofs.size, None)
        first = self._B.getOwnershipRange()[0]
        csr = (D.indptr.astype(PETSc.IntType), (D.indices + first).astype(PETSc.IntType), D.data)
        D = PETSc.Mat().createAIJ((size, size), csr=csr, comm=self._comm)
        turned = D.matMult(by)
        product = self._B.transposeMatMult(turned)
        starts, columns, values = product.getValuesCSR()
        for matrix in (D, turned, product):
            matrix.destroy()
        return sparse.csr_matrix((values, columns, starts), (self.size, self._whole))

    def rows(self, turns: np.ndarray, free: np.ndarray) -> sparse.csr_matrix:
        """See ``ContactPoints``."""
        kept, weights = self._B.copy(), self._body.duplicate()
        weights.array_w[:] = free
        kept.diagonalScale(None, weights)
        starts, columns, values = kept.getValuesCSR()
        kept.destroy()
        weights.destroy()
        B = sparse.csr_matrix((values, columns, starts), (self.dofs.size, self._whole))
        k = turns.shape[1]
        turned = sparse.bsr_matrix(
            (turns, np.arange(self.count), np.arange(self.count + 1)),
            (self.count * k, self.dofs.size),
        )
        own = np.linalg.norm(turns @ self.frames * free[self.dofs][:, None, :], axis=2)
        out = (own < FREE) | self.closed[:, None]  # held: then what opposite nodes do is carried
        own = np.where(out, 0.0, 1.0).ravel()
        return (sparse.diags(own) @ turned @ B).tocsr()

    def stiffness(self, K) -> NodalStiffness:
        """See ``ContactPoints``: of springs in series, ``1/k = 1/k_a + sum_b m_ab^2 / k_b``, as matrices along slip.  Collective."""
        alone = super().stiffness(K)
        C = self._opposite_compliance(K)
        squares = self._m.multiply(self._m).tocsr()
        flat = (squares @ C.reshape(len(C), -1)).reshape(-1, self.dim, self.dim)
        local = self.frames @ flat @ self.frames.transpose(0, 2, 1)
        normal = 1.0 / (1.0 / alone.normal + local[:, -1, -1])
        along = local[:, :-1, :-1]
        eye = np.eye(self.dim - 1)
        tangential = np.linalg.solve(eye + alone.tangential @ along, alone.tangential)
        return NodalStiffness(normal, tangential)

    def _opposite_compliance(self, K) -> np.ndarray:
        """Inverse nodal blocks of the opposite nodes, ``shape=(m, gdim, gdim)``; zero along fixed directions."""
        mine = ((self._opposite >= self.first) & (self._opposite < self.first + self.size)).all(axis=1)  # fmt: skip
        own = np.flatnonzero(mine)
        blocks = nodal_blocks(K, self._opposite[own] - self.first)
        alone = np.abs(blocks - blocks * np.eye(self.dim)).sum(axis=2) == 0.0
        fixed = alone & (np.einsum("nii->ni", blocks) == 1.0)  # rows of boundary conditions
        C = np.linalg.inv(blocks)
        C[fixed] = 0.0
        found = np.zeros((len(self._opposite), self.dim, self.dim))
        for rows, part in self._comm.allgather((own, C)):
            found[rows] = part
        return found


def frames_along(normals: np.ndarray, axis: np.ndarray | None) -> np.ndarray:
    """Rows (t1, t2, n), in two dimensions (t, n), of unit normals, ``shape=(n, gdim, gdim)``.

    Raises:
        ValueError: an axis that is along a normal.
    """
    if normals.shape[1] == 2:
        return np.stack((np.column_stack((normals[:, 1], -normals[:, 0])), normals), axis=1)
    most_across = np.abs(normals).round(6).argmin(axis=1)  # rounding does not choose
    given = np.eye(3)[most_across] if axis is None else axis
    along = given - (given * normals).sum(axis=1, keepdims=True) * normals
    length = np.linalg.norm(along, axis=1, keepdims=True)
    if not (length > AXIS).all():
        raise ValueError(f"axis {axis} is along the normal of a contact node: it has no direction on the surface.")  # fmt: skip
    along /= length
    return np.stack((along, np.cross(normals, along), normals), axis=1)


def _gathered(of, facets: np.ndarray, comm) -> list[Side]:
    """The facets of all ranks by shape, nodes in global numbers.  Collective."""
    mine = []
    for part in facets_of(of, facets):
        numbers = _numbers(of.V.dofmap.index_map, part.nodes.ravel()).reshape(part.nodes.shape)
        mine.append(Side(numbers, part.x, part.outwards, part.local, part.vertices, part.degree))
    shapes: dict = {}
    for side in [side for sides in comm.allgather(mine) for side in sides]:
        key = (side.corners.tobytes(), np.round(side.local, 9).tobytes())
        shapes.setdefault(key, []).append(side)
    return [
        same[0]._replace(
            **{n: np.concatenate([getattr(s, n) for s in same]) for n in ("nodes", "x", "outwards")}
        )
        for same in shapes.values()
    ]


def _numbers(index_map, nodes: np.ndarray) -> np.ndarray:
    """Global numbers of local nodes."""
    return index_map.local_to_global(nodes.astype(np.int32)).astype(np.int64)


def _sorted_rows(slaves: list[Side], masters: list[Side], numbers: np.ndarray) -> Rows:
    """``rows_of`` for nodes in any order."""
    order, count = np.argsort(numbers), 1 + max((int(s.nodes.max(initial=-1)) for s in masters), default=-1)  # fmt: skip
    rows = rows_of(slaves, masters, numbers[order], count)
    back = np.argsort(order)
    return Rows(rows.area[back], rows.whole[back], rows.m[back], rows.covered[back])


def _mean_normals(sides: list[Side], numbers: np.ndarray) -> np.ndarray:
    """Unit normals at slave nodes, towards their body: means of facets' by area, ``shape=(n, gdim)``."""
    order = np.argsort(numbers)
    gdim = sides[0].x.shape[2] if sides else 3
    sums = np.zeros((numbers.size, gdim))
    for side in sides:
        ends = side.x[:, side.corners]
        span = ends[:, 1:] - ends[:, :1]
        area = np.linalg.norm(span[:, 0], axis=1)
        if gdim == 3:
            area = np.linalg.norm(np.cross(span[:, 0], span[:, 1]), axis=1)
        at = np.searchsorted(numbers[order], side.nodes)
        at[at == numbers.size] = 0
        mine = numbers[order][at] == side.nodes
        facet, k = np.nonzero(mine)
        np.add.at(sums, order[at[facet, k]], -area[facet, None] * side.outwards[facet])
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)
