# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Condensed contact problems of rigid bodies, ``W = H M^-1 H'``, most of them rank deficient.

One step of a dynamic simulation: ``q = H v_free``, ``v_free = v + dt M^-1 f`` with the bodies' own
velocities, ``r`` impulses, ``w`` velocities after the step.  They have solutions: lifting all
bodies off each other is a motion with ``w`` in the inside of the dual cone [V. Acary, F. Cadoux,
C. Lemarechal, J. Malick, ZAMM 91 (2011)].

    python -m benchmarks.rigid_family [--seconds 60]
"""

from __future__ import annotations

import argparse
import time
import warnings
from itertools import product
from types import SimpleNamespace

import numpy as np
import scipy.sparse as sp

import dolfinx_contact as dc

GRAVITY = np.array([0.0, 0.0, -9.81])
STEP = 1e-2
UP = np.array([0.0, 0.0, 1.0])


def frame(normal):
    """Rows t1, t2, n of a local frame."""
    t1 = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    t1 /= np.linalg.norm(t1)
    return np.array([t1, np.cross(normal, t1), normal])


def assemble(masses, inertias, contacts, positions, velocity, uneven=0.0, rng=None):
    """W, sparse, and q of contacts (body, other body or -1, point, normal towards the first).

    With ``uneven`` reactions act on bodies by entries of ``H`` that are off by up to so much of them: W is not
    symmetric, as from programs that measure the arms of forces and of motion differently.
    """
    H = np.zeros((len(contacts), 3, len(masses), 6))
    for row, (*pair, point, normal) in zip(H, contacts):
        R = frame(normal)
        for body, sign in zip(pair, (1, -1)):
            if body >= 0:
                row[:, body, :3] = sign * R
                row[:, body, 3:] = -sign * R @ np.cross(np.eye(3), point - positions[body])
    H = sp.csr_matrix(H.reshape(3 * len(contacts), -1))
    inverse = np.column_stack([np.repeat(1 / masses[:, None], 3, 1), 1 / inertias]).ravel()
    free = velocity.copy()
    free[:, :3] += STEP * GRAVITY
    acting = H.copy()
    if uneven > 0:
        acting.data *= 1 + uneven * rng.uniform(-1, 1, size=acting.nnz)
    return (H @ sp.diags(inverse) @ acting.T).tocsr(), (H @ free.ravel()).reshape(-1, 3)


def tower(rng, n):
    """Boxes on each other, four contacts an interface, slightly displaced."""
    positions = np.column_stack((0.1 * rng.normal(size=(n, 2)), 0.5 + np.arange(n)))
    return positions, [
        (i, i - 1, np.array([x, y, float(i)]) + [*positions[i, :2], 0.0], UP)
        for i, x, y in product(range(n), (-0.4, 0.4), (-0.4, 0.4))
    ]


def wall(rng, n):
    """Bricks, each on two below, four contacts with either; the lowest row on the ground."""
    width = max(2, int(np.sqrt(n / 2)))
    level, column = np.divmod(np.arange(n), width)
    x = column + 0.5 * (level % 2)
    contacts = []
    for k in range(n):
        below = [i for i in range(k) if level[i] == level[k] - 1 and abs(x[i] - x[k]) == 0.5]
        sides = [(i, np.sign(x[i] - x[k])) for i in below] or [(-1, -1.0), (-1, 1.0)]
        for (other, side), dx, y in product(sides, (-0.2, 0.2), (-0.3, 0.3)):
            contacts.append((k, other, np.array([x[k] + 0.25 * side + dx, y, level[k]]), UP))
    return np.column_stack((x, np.zeros(n), 0.5 + level)), contacts


def spheres(rng, n):
    """A pyramid of spheres, hexagonal layers upon each other."""
    side = next(s for s in range(2, n + 2) if s * (s + 1) * (s + 2) >= 6 * n)
    positions = np.array([
        (i + 0.5 * j + 0.5 * k, np.sqrt(3) / 2 * j + np.sqrt(3) / 6 * k, 0.5 + np.sqrt(2 / 3) * k)
        for k in range(side) for i in range(side - k) for j in range(side - k - i)
    ])  # fmt: skip
    contacts = [(i, -1, p - 0.5 * UP, UP) for i, p in enumerate(positions) if p[2] < 0.6]
    for i, p in enumerate(positions):
        for j, other in enumerate(positions[:i]):
            if (length := np.linalg.norm(p - other)) < 1.001:
                contacts.append((i, j, other + (p - other) / 2, (p - other) / length))
    return positions, contacts


def capsules(rng, n):
    """Layers of logs, each across the one below: as many contacts as crossings."""
    per = max(2, int(round(np.sqrt(n))))
    middle, positions, contacts = (per - 1) / 2, [], []
    for level, k in product(range(max(1, n // per)), range(per)):
        offset, body = k + 0.1 * rng.normal(), len(positions)
        x, y = (offset, middle) if level % 2 else (middle, offset)
        positions.append((x, y, 0.3 + 0.6 * level))
        if level == 0:
            for end in (-0.5 * per, 0.5 * per):
                contacts.append((body, -1, np.array([middle + end, offset, 0.0]), UP))
            continue
        for other in range(body - k - per, body - k):
            across = positions[other]
            point = (x, across[1]) if level % 2 else (across[0], y)
            contacts.append((body, other, np.array([*point, 0.6 * level]), UP))
    return np.array(positions), contacts


def rocks(rng, n):
    """Polyhedra in a heap: each on three others or the ground, three contacts with either, normals
    of any direction upwards."""
    positions, contacts = [], []
    for k in range(n):
        positions.append(np.append(rng.normal(size=2) * n ** (1 / 3), 0.3 * k ** (2 / 3)))
        for other in rng.choice(k, size=min(k, 3), replace=False) if k > 2 else [-1]:
            up = np.array([*rng.normal(scale=0.5, size=2), 1.0])
            up /= np.linalg.norm(up)
            for _ in range(3):
                point = positions[k] - 0.5 * up + 0.3 * rng.normal(size=2) @ frame(up)[:2]
                contacts.append((k, int(other), point, up))
    return np.array(positions), contacts


KINDS = dict(tower=tower, wall=wall, spheres=spheres, capsules=capsules, rocks=rocks)


def problem(kind, n, seed, mu=None, spread=1.0, motion=0.1, uneven=0.0):
    """A problem of about ``n`` bodies; masses over ``spread`` powers of ten, velocities of ``motion``; see ``assemble``."""
    rng = np.random.default_rng([seed, n, sorted(KINDS).index(kind)])
    positions, contacts = KINDS[kind](rng, n)
    count = len(positions)
    masses = 10 ** rng.uniform(0, spread, size=count)
    inertias = masses[:, None] * rng.uniform(
        0.1, 0.3, size=(count, 3)
    )  # of bodies about one in size
    velocity = motion * rng.normal(size=(count, 6))
    W, q = assemble(masses, inertias, contacts, positions, velocity, uneven, rng)
    mu = float(rng.choice([0.3, 0.5, 0.7, 1.0])) if mu is None else mu
    return SimpleNamespace(W=W, q=q, mu=mu, kind=kind, bodies=count, seed=seed)


def scenes(largest):
    """The family: every kind, sizes to ``largest`` contacts, at rest and moving, masses alike or not, W symmetric or not."""
    motions = (0.0, 0.0, 0.0), (0.1, 0.5, 0.0), (1.0, 2.0, 0.0), (0.1, 0.5, 3e-3)
    sizes = (1, 2, 4, 8, 16, 24, 32, 48, 64, 96, 128, 142, 250)
    for kind, n, seed in product(KINDS, sizes, range(len(motions))):
        motion, spread, uneven = motions[seed]
        scene = problem(kind, n, seed, motion=motion, spread=spread, uneven=uneven)
        if len(scene.q) <= largest:
            yield scene


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--smallest", type=int, default=1)
    parser.add_argument("--largest", type=int, default=300)
    options = parser.parse_args()
    warnings.simplefilter("ignore", dc.RoundingWarning)
    failed = 0
    for s in scenes(options.largest):
        if len(s.q) < options.smallest:
            continue
        start = time.perf_counter()
        try:
            found = dc.solve_condensed(s.W, s.q, dc.Friction(s.mu), max_seconds=options.seconds)
            outcome = found.branch
        except dc.CondensedNotConverged as failure:
            found, outcome = failure.best, "REFUSED"
            failed += 1
        seconds = time.perf_counter() - start
        print(f"{s.kind:9s} {len(s.q):5d} contacts {s.bodies:4d} bodies seed {s.seed} mu {s.mu:.1f} "
              f"{outcome:22s} {found.iterations:6d} it {seconds:7.3f} s error {found.error:.1e} "
              f"{found.slip_error:.1e}", flush=True)  # fmt: skip
    print(f"{failed} refused")


if __name__ == "__main__":
    main()
