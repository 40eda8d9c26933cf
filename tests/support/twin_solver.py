"""A slow twin of law and solver, in NumPy, written from the paper and not from the package.

Everything is dense and node by node: the body is its full stiffness matrix, the contact problem is
condensed to the contact nodes, and solved by block Gauss-Seidel in the scaled variables in which
the law is the isotropic one with unit friction.
"""

from __future__ import annotations

import numpy as np


def normalised(mu, p):
    """p scaled so that max(p / mu) = 1: only its ratio matters."""
    mu, p = np.atleast_1d(np.asarray(mu, dtype=float)), np.atleast_1d(np.asarray(p, dtype=float))
    return mu, p / np.max(p / mu)


def project_unit_cone(tau):
    """Euclidean projection on {|t| <= n}, by the three cases of the textbook."""
    t, n = tau[:-1], tau[-1]
    length = np.linalg.norm(t)
    if length <= n:
        return tau.copy()
    if length <= -n:
        return np.zeros_like(tau)
    radius = 0.5 * (length + n)
    return np.append(radius * t / length, radius)


def project_elliptic_cone(tau, mu):
    """Euclidean projection on {|M^-1 t| <= n} by bisection of the multiplier's optimality condition.

    Stationarity with multiplier s of (|M^-1 t|^2 - n^2) / 2 gives t_i = tau_i / (1 + s / mu_i^2) and
    n (1 - s) = tau_n; the boundary is where |M^-1 t| = n, so |M^-1 t(s)| (1 - s) = tau_n, whose left
    side falls with s.
    """
    t, n = tau[:-1], tau[-1]
    if np.linalg.norm(t / mu) <= n:
        return tau.copy()
    if np.linalg.norm(mu * t) <= -n:
        return np.zeros_like(tau)

    def foot(s):
        return t / (1 + s / mu**2)

    def excess(s):
        return np.linalg.norm(foot(s) / mu) * (1 - s) - n

    low, high = np.zeros_like(n), np.ones_like(n)  # of the precision of tau
    while excess(high) > 0:
        low, high = high, 2 * high
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    found = foot(low)
    return np.append(found, np.linalg.norm(found / mu))


def error(stiffness, mu, p, reaction, gap, slip, unbalanced, load):
    """The error of a step as the documentation defines it, term by term."""
    mu, p = normalised(mu, p)
    defect = []
    for kappa, r, x_n, du in zip(stiffness, reaction, gap, slip):
        q2 = (p / mu) ** 2
        w = np.append(q2 * du, x_n + np.linalg.norm(mu * q2 * du))
        defect.append(r - project_elliptic_cone(r - kappa * w, mu))
    return max(np.linalg.norm(unbalanced), np.linalg.norm(defect)) / load


def solve(W, q, mu, p, sweeps=200_000, tol=1e-12):
    """Reactions with w = q + W r and the law between w and r, by block Gauss-Seidel.

    Args:
        W: Condensed operator, (n, d, n, d); q: free state (n, d), slip increments and gap.
    """
    mu, p = normalised(mu, p)
    n, d = q.shape
    S = np.append(mu, 1.0)
    T = np.append(p**2 / mu, 1.0)
    W = T[:, None, None] * W * S
    q = T * q
    r = np.zeros((n, d))
    step = [1.0 / np.linalg.norm(W[i, :, i], 2) for i in range(n)]
    scale = np.abs(q).max() * max(step)
    for _ in range(sweeps):
        change = 0.0
        for i in range(n):
            before = r[i].copy()
            elsewhere = q[i] + np.tensordot(W[i], r, 2) - W[i, :, i] @ r[i]
            for _ in range(3):
                w = elsewhere + W[i, :, i] @ r[i]
                w[-1] += np.linalg.norm(w[:-1])
                r[i] = project_unit_cone(r[i] - step[i] * w)
            change = max(change, np.abs(r[i] - before).max())
        if change <= tol * scale:
            return S * r
    raise RuntimeError(f"the twin did not converge: change {change / scale:.1e} in a sweep")
