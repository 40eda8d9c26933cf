# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Errors of condensed answers as the documentation defines them, in long double, with a projection of their own.

Everything here is NumPy alone, written from the paper; of the package nothing is imported.
"""

from __future__ import annotations

import numpy as np

from mechanics.condensed import direction_of_slip


def normalised(mu, p):
    """p scaled so that max(p / mu) = 1: only its ratio matters."""
    mu, p = np.atleast_1d(np.asarray(mu, dtype=float)), np.atleast_1d(np.asarray(p, dtype=float))
    return mu, p / np.max(p / mu)


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


def judge(W, q, mu, p, r, external=0.0):
    """Error and slip error of reactions ``r``, (n, dim), as ``solve_condensed`` defines them.

    In long double, so that what is judged are the reactions and not the judge's own rounding.
    """
    mu, p = normalised(mu, p) if np.any(mu) else (np.atleast_1d(mu), None)
    mu, r = (np.asarray(part, dtype=np.longdouble) for part in (mu, r))
    n, dim = q.shape
    W = W.toarray() if hasattr(W, "toarray") else W
    W = np.asarray(W, dtype=np.longdouble).reshape(n, dim, n, dim)
    w = q + np.tensordot(W, r, 2)
    own = np.array([W[i, :, i, :] for i in range(n)]).reshape(n, dim, dim)
    floor = 1e-12 * np.abs(own[:, -1, -1]).mean()
    defect, slip = [], []
    for A, ri, wi in zip(own, r, w):
        k = 1 / max(A[-1, -1], floor)
        if p is None:
            defect.append(np.append(ri[:-1], ri[-1] - max(ri[-1] - k * wi[-1], 0)))
            continue
        q2 = (p / mu) ** 2
        tau = ri - k * np.append(q2 * wi[:-1], wi[-1] + np.linalg.norm(mu * q2 * wi[:-1]))
        defect.append(ri - project_elliptic_cone(tau, mu))
        if np.linalg.norm(mu * tau[:-1]) <= -tau[-1] or not np.any(ri):
            continue
        left = wi[:-1]
        if np.linalg.norm(tau[:-1] / mu) > tau[-1] and np.any(ri[:-1]):
            left = left + np.linalg.norm(left) * direction_of_slip(ri[:-1], p)
        if length := np.linalg.norm(left):
            compliance = left @ A[:-1, :-1] @ left / length**2
            slip.append(length / max(compliance, floor))
    load = np.linalg.norm(
        [np.append(qi[:-1], min(qi[-1], 0)) / max(A[-1, -1], floor) for A, qi in zip(own, q)]
    )
    acting = max(min(np.linalg.norm(r), load), external)
    errors = [float(np.linalg.norm(part)) for part in (defect, slip)]
    return tuple(error / acting if error else 0.0 for error in errors)
