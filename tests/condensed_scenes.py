"""Random condensed contact problems with a known solution.

Everything here is NumPy alone, written from the paper; of the package nothing is imported.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from twin_solver import normalised, project_elliptic_cone


def direction_of_slip(r_t, p):
    """Unit vector along P^-2 r_t, against which the slip of [dSFMH07, Section 1] goes."""
    d = r_t / p**2
    d = d / np.abs(d).max()
    return d / np.linalg.norm(d)


def random_pair(rng, mu, p, status, force, length):
    """A reaction and a displacement that satisfy the law: open, stick or slip."""
    t = mu.size
    r, w = np.zeros(t + 1), np.zeros(t + 1)
    if status == "open":
        w[-1] = length * rng.uniform(0.1, 1)
        w[:-1] = length * rng.normal(size=t)
        return r, w
    r[-1] = force * rng.uniform(0.1, 1)
    e = rng.normal(size=t)
    e /= np.linalg.norm(e)
    r[:-1] = r[-1] * mu * e
    if status == "stick":
        r[:-1] *= rng.uniform(0, 0.95)
    else:
        w[:-1] = -length * rng.uniform(0.1, 1) * direction_of_slip(r[:-1], p)
    return r, w


def random_problem(
    seed, contacts=None, dim=3, ratio=None, mu_range=(1e-3, 10), rank=None, unsymmetric=0.0
):
    """A condensed problem w = q + W r of given or random rank, with a solution put into it.

    ``W = B B^T + small``, ``B`` of shape (dim n, rank): below full rank there are more contacts than
    degrees of freedom.  ``q = w - W r`` for a random pair (r, w) that satisfies the law.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 13)) if contacts is None else contacts
    size = dim * n
    rank = int(rng.integers(1, size + 1)) if rank is None else rank
    B = rng.normal(size=(size, rank)) * 10 ** rng.uniform(-1, 0, size=rank)
    if rng.random() < 0.5:  # neighbours couple more than distant contacts, as in a body
        x = np.repeat(rng.uniform(size=n), dim)
        modes = np.arange(1, rank + 1)
        B = np.cos(np.pi * np.outer(x, modes) + rng.uniform(0, 2 * np.pi, size=(1, rank))) * B
    W = B @ B.T
    if unsymmetric:
        W = W + unsymmetric * np.abs(W).mean() * rng.normal(size=W.shape)
    low, high = np.log10(mu_range)
    if dim == 3:
        mu = 10 ** rng.uniform(low, high, size=2)
        ratio = 10 ** rng.uniform(0, 3) if ratio is None else ratio
        p = np.array([1.0, ratio])[:: rng.choice([-1, 1])]
    else:
        mu, p = 10 ** rng.uniform(low, high, size=1), np.ones(1)
    kinds = rng.choice(["open", "stick", "slip"], size=n, p=rng.dirichlet(np.ones(3)))
    pairs = [random_pair(rng, mu, p, kind, 1.0, np.diag(W).mean()) for kind in kinds]
    r, w = (np.array(part) for part in zip(*pairs))
    q = w - (W @ r.ravel()).reshape(n, dim)
    return SimpleNamespace(W=W, q=q, mu=mu, p=p, r=r, w=w, kinds=kinds)


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
