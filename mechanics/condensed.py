# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Random condensed contact problems with a known solution.

Everything here is NumPy alone, written from the paper; of the package nothing is imported.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np


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
