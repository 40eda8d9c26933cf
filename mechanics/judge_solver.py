# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Tight solutions of small contact problems: dense semismooth Newton, residuals in extended precision.

The unknowns are displacements of the contact nodes where a stiffness is given, so no free state of size load / k
enters on soft springs, and reactions where a compliance is given.  Linear systems are solved in double
precision and what is left of the equations is evaluated in ``numpy.longdouble``: corrections shrink until that
precision ends.  Nothing here comes from the package.
"""

from __future__ import annotations

import numpy as np

LONG = np.longdouble
LONG_EPS = float(np.finfo(LONG).eps)
METRICS = (1.0, 0.1, 10.0, 0.01, 100.0)  # of the nodal stiffness, tried in this order


class Sparse:
    """Rows of a dense matrix without its zeros; products in extended precision."""

    def __init__(self, matrix: np.ndarray):
        rows, self.columns = np.nonzero(matrix)
        if not np.array_equal(np.unique(rows), np.arange(len(matrix))):
            raise ValueError("a row of the stiffness is empty")
        self.values = matrix[rows, self.columns].astype(LONG)
        self.starts = np.searchsorted(rows, np.arange(len(matrix)))

    def __matmul__(self, u: np.ndarray) -> np.ndarray:
        return np.add.reduceat(self.values * u[self.columns], self.starts)

    def magnitude(self, u: np.ndarray) -> np.ndarray:
        """|K| |u|: the size of the terms that cancel in K u."""
        return np.add.reduceat(np.abs(self.values) * np.abs(u)[self.columns], self.starts)


class ByStiffness:
    """Reactions as a function of the displacement of the contact nodes: ``r = A u_c - g``.

    Args:
        K: Stiffness without boundary conditions, dense.
        contact: Degrees of freedom of the contact nodes, ``shape=(n, d)``, global frame.
        fixed: Degrees of freedom that boundary conditions hold.
        frame: Rows (t1, t2, n).
    """

    unique = True  # is what a regular Jacobian says

    def __init__(self, K, contact, fixed, frame):
        self.K, self.contact, self.frame = Sparse(K), contact, frame
        if np.intersect1d(contact, fixed).size:
            raise ValueError("a contact node is held by a boundary condition")
        self.fixed = np.asarray(fixed, dtype=int)
        self.inner = np.setdiff1d(np.arange(len(K)), np.concatenate([contact.ravel(), self.fixed]))
        c, i = contact.ravel(), self.inner
        self.inverse = np.linalg.inv(K[np.ix_(i, i)]) if i.size else np.zeros((0, 0))
        self.transfer = -K[np.ix_(c, i)] @ self.inverse  # of forces on inner nodes
        A = K[np.ix_(c, c)] + self.transfer @ K[np.ix_(i, c)]
        self.by_w = np.eye(c.size)
        self.by_r = self._local(self._local((A + A.T) / 2).T)

    def _local(self, matrix):
        """Rows turned from the global into the local frame."""
        n, d = self.contact.shape
        blocks = matrix.reshape(n, d, matrix.shape[1])
        return np.einsum("ab,nbm->nam", self.frame, blocks).reshape(matrix.shape)

    def start(self, u, f, gap0, before):
        """Take a displacement, loads, gaps at rest and the contact nodes' displacement before."""
        self.u, self.f = u.astype(LONG), f.astype(LONG)
        self.gap0, self.before = gap0, before
        self._relax()

    def start_closed(self, u, f, gap0, before):
        """As ``start``, but all contact nodes touch the plane where they stuck before."""
        closed = before.copy()
        closed[:, -1] = -gap0
        u = u.copy()
        u[self.contact] = closed @ self.frame
        self.start(u, f, gap0, before)

    def state(self):
        """Reactions, gaps and slips, local frame."""
        moved = self.u[self.contact] @ self.frame.T
        r = self._forces[self.contact] @ self.frame.T
        return r, self.gap0 + moved[:, -1], (moved - self.before)[:, :-1]

    def floor(self) -> float:
        """What extended precision leaves of forces."""
        return LONG_EPS * float(np.linalg.norm(self.K.magnitude(self.u).astype(float)))

    def move(self, z):
        self.u[self.contact] += z.reshape(self.contact.shape) @ self.frame
        self._relax()

    def _relax(self):
        """Inner nodes into equilibrium, until extended precision ends."""
        self._forces, last = self.K @ self.u - self.f, np.inf
        for _ in range(8 if self.inner.size else 0):
            left = self._forces[self.inner]
            size = float(np.linalg.norm(left.astype(float)))
            if not 0 < size < 0.1 * last:
                break
            scale = float(np.abs(left).max())
            self.u[self.inner] -= scale * (self.inverse @ (left / scale).astype(float))
            self._forces, last = self.K @ self.u - self.f, size


class ByCompliance:
    """Displacements as a function of the reactions: ``w = q + W r``; slips first, the gap last."""

    unique = False  # W may have a null space

    def __init__(self, W, q):
        self.W, self.q = W.astype(LONG), q.astype(LONG)
        self.by_r, self.by_w = np.eye(len(W)), np.asarray(W, dtype=float)

    def start(self, r):
        self.r = r.astype(LONG)

    def state(self):
        w = self.q + (self.W @ self.r.ravel()).reshape(self.q.shape)
        return self.r, w[:, -1], w[:, :-1]

    def floor(self) -> float:
        return LONG_EPS * float(np.linalg.norm(self.r.astype(float)))

    def move(self, z):
        self.r = self.r + z.reshape(self.r.shape)


def equations(r, gap, slip, mu, p, normal, tangential):
    """A nodal map whose zeros obey the law, and its derivatives by (r) and by (slip, gap).

    With ``y = M^-1 r_t`` and ``v = M^-1 P^2 du_t`` the slip rule says that ``v`` is opposite to ``y``: the isotropic rule
    with unit friction.  ``normal`` and ``tangential`` are positive stiffnesses, ``shape=(n,)``.
    """
    n, d = r.shape
    t = d - 1
    by_r, by_w = np.zeros((n, d, d)), np.zeros((n, d, d))
    R = np.maximum(r[:, -1] - normal * gap, 0)
    closed = R > 0
    left = np.empty_like(r)
    left[:, -1] = r[:, -1] - R
    by_r[:, -1, -1] = ~closed
    by_w[:, -1, -1] = np.where(closed, normal, 0)
    left[:, :-1] = r[:, :-1]
    by_r[:, :-1, :-1] = np.eye(t)
    if not np.any(mu):
        return left, by_r, by_w
    weight = (p / np.max(p)) ** 2
    y = (r[:, :-1] - tangential[:, None] * weight * slip) / mu
    length = np.sqrt((y**2).sum(axis=1))
    stick, slide = closed & (length <= R), closed & (length > R)
    left[stick, :-1] = tangential[stick, None] * slip[stick]
    by_r[stick, :-1] = 0
    by_w[stick, :-1, :-1] = tangential[stick, None, None] * np.eye(t)
    e = y[slide] / length[slide, None]
    left[slide, :-1] -= mu * R[slide, None] * e
    turn = (np.eye(t) - e[:, :, None] * e[:, None, :]) * (R / np.where(slide, length, 1))[slide, None, None]  # fmt: skip
    by_y = mu[:, None] * turn / mu
    by_r[slide, :-1, :-1] -= by_y
    by_r[slide, :-1, -1] = -(mu * e)
    by_w[slide, :-1, :-1] = by_y * weight * tangential[slide, None, None]
    by_w[slide, :-1, -1] = mu * e * normal[slide, None]
    return left, by_r, by_w


def jacobian(relation, by_r, by_w):
    n, d, _ = by_r.shape
    rows = [
        np.einsum("nij,njm->nim", part.astype(float), matrix.reshape(n, d, n * d))
        for part, matrix in ((by_r, relation.by_r), (by_w, relation.by_w))
    ]
    return sum(rows).reshape(n * d, n * d)


def solved(J, right, unique=True):
    """The correction; the smallest one where the solution may not be unique."""
    rows = np.abs(J).max(axis=1)
    rows[rows == 0] = 1
    J, right = J / rows[:, None], right / rows
    try:
        x = np.linalg.solve(J, right) if unique else np.full(len(J), np.nan)
        if np.isfinite(x).all() and np.linalg.norm(J @ x - right) <= 1e-6 * np.linalg.norm(right):
            return x
    except np.linalg.LinAlgError:
        pass
    return np.linalg.lstsq(J, right, rcond=1e-12)[0]


def newton(relation, mu, p, normal, tangential, most=60):
    """Semismooth Newton's method until precision ends; (what is left, last change of reactions, precision), forces."""
    last = previous = np.inf
    for _ in range(most):
        r, gap, slip = relation.state()
        left, by_r, by_w = equations(r, gap, slip, mu, p, normal, tangential)
        size, force = length(left), length(r)
        floor = LONG_EPS * (force + length(tangential * np.sqrt((slip**2).sum(axis=1)))) + relation.floor()  # fmt: skip
        settled = max(size, last) <= 100 * floor
        if size <= floor or (settled and size > 0.1 * previous):
            return size, min(last, size), floor
        previous, scale = size, float(np.abs(left).max())
        J = jacobian(relation, by_r, by_w)
        z = -scale * solved(J, (left.ravel() / scale).astype(float), relation.unique)
        dr, dw = ((m @ z).reshape(r.shape) for m in (relation.by_r, relation.by_w))
        step = 1.0
        for _ in range(0 if settled else 10):
            trial = equations(r + step * dr, gap + step * dw[:, -1], slip + step * dw[:, :-1], mu, p, normal, tangential)[0]  # fmt: skip
            if length(trial) <= (1 - 0.1 * step) * size:
                break
            step /= 2
        else:
            step = 1.0  # no way down: the branches may change by a whole step
        last = step * length(dr)
        relation.move(step * z)
    return size, last, floor


def length(values) -> float:
    values = np.ravel(values)
    largest = np.abs(values).max(initial=0)
    return float(largest * np.sqrt(((values / largest) ** 2).sum())) if largest > 0 else 0.0
