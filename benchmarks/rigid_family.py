# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Condensed contact problems of rigid bodies, ``W = H M^-1 H'``, most of them rank deficient.

One step of a dynamic simulation: ``q = H v_free``, ``v_free = v + dt M^-1 f`` with the bodies' own
velocities, ``r`` impulses, ``w`` velocities after the step.  They have solutions: lifting all
bodies off each other is a motion with ``w`` in the inside of the dual cone [V. Acary, F. Cadoux,
C. Lemarechal, J. Malick, ZAMM 91 (2011)].

    .venv/bin/python benchmarks/rigid_family.py [--seconds 60]
"""

from __future__ import annotations

import argparse
import time
import warnings
from types import SimpleNamespace

import numpy as np
import scipy.sparse as sp

import dolfinx_contact as dc

GRAVITY = np.array([0.0, 0.0, -9.81])


def frame(normal):
    """Rows t1, t2, n of a local frame."""
    a = np.eye(3)[np.argmin(np.abs(normal))]
    t1 = np.cross(normal, a)
    t1 /= np.linalg.norm(t1)
    return np.array([t1, np.cross(normal, t1), normal])


def assemble(masses, inertias, contacts, positions, velocity, dt=1e-2):
    """W, sparse, and q of contacts (body, other body or -1, point, normal towards the first)."""
    n = len(masses)
    rows = []
    for a, b, point, normal in contacts:
        R = frame(np.asarray(normal, float))
        row = sp.lil_matrix((3, 6 * n))
        for body, sign in ((a, 1), (b, -1)):
            if body < 0:
                continue
            arm = point - positions[body]
            cross = np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
            row[:, 6 * body : 6 * body + 3] = sign * R
            row[:, 6 * body + 3 : 6 * body + 6] = -sign * R @ cross
        rows.append(row.tocsr())
    H = sp.vstack(rows).tocsr()
    inverse = np.column_stack([np.repeat(1 / masses[:, None], 3, 1), 1 / inertias]).ravel()
    free = velocity.copy()
    free[:, :3] += dt * GRAVITY
    W = (H @ sp.diags(inverse) @ H.T).tocsr()
    return W, (H @ free.ravel()).reshape(-1, 3)


def bodies(rng, n, spread):
    """Masses of any density and moments of inertia of bodies about one in size."""
    masses = 10 ** rng.uniform(0, spread, size=n)
    return masses, masses[:, None] * rng.uniform(0.1, 0.3, size=(n, 3))


def tower(rng, n, spread):
    """Boxes on each other, four contacts an interface, slightly displaced."""
    positions = np.column_stack((0.1 * rng.normal(size=(n, 2)), 0.5 + np.arange(n)))
    contacts = []
    for i in range(n):
        for x in (-0.4, 0.4):
            for y in (-0.4, 0.4):
                point = np.array([x, y, float(i)]) + [*positions[i, :2], 0.0]
                contacts.append((i, i - 1, point, (0, 0, 1)))
    return positions, contacts


def wall(rng, n, spread):
    """Bricks, each on two below, four contacts with either; the lowest row on the ground."""
    width = max(2, int(np.sqrt(n / 2)))
    positions, contacts, index = [], [], {}
    for k in range(n):
        level, column = divmod(k, width)
        index[level, column] = k
        x = column + 0.5 * (level % 2)
        positions.append((x, 0.0, 0.5 + level))
        below = [c for c in ((column - 1, column) if level % 2 == 0 else (column, column + 1))]
        supports = [(index[level - 1, c], 0.25 if c + 0.5 * ((level - 1) % 2) > x else -0.25)
                    for c in below if level and (level - 1, c) in index]  # fmt: skip
        for other, side in supports or [(-1, -0.25), (-1, 0.25)]:
            for dx in (-0.2, 0.2):
                for y in (-0.3, 0.3):
                    contacts.append((k, other, np.array([x + side + dx, y, level]), (0, 0, 1)))
    return np.array(positions), contacts


def spheres(rng, n, spread):
    """A pyramid of spheres, hexagonal layers upon each other."""
    positions, side = [], 2
    while side * (side + 1) * (side + 2) // 6 < n:
        side += 1
    for level in range(side):
        for i in range(side - level):
            for j in range(side - level - i):
                positions.append(
                    (i + 0.5 * j + 0.5 * level, np.sqrt(3) / 2 * j + np.sqrt(3) / 6 * level,
                     0.5 + np.sqrt(2 / 3) * level)
                )  # fmt: skip
    positions = np.array(positions)
    contacts = [(i, -1, p - [0, 0, 0.5], (0, 0, 1)) for i, p in enumerate(positions) if p[2] < 0.6]
    for i in range(len(positions)):
        for j in range(i):
            d = positions[i] - positions[j]
            if (length := np.linalg.norm(d)) < 1.001:
                contacts.append((i, j, positions[j] + d / 2, d / length))
    return positions, contacts


def capsules(rng, n, spread):
    """Layers of logs, each across the one below: as many contacts as crossings."""
    per = max(2, int(round(np.sqrt(n))))
    positions, contacts = [], []
    for level in range(max(1, n // per)):
        for k in range(per):
            offset = k + 0.1 * rng.normal()
            middle = (per - 1) / 2
            x, y = (offset, middle) if level % 2 else (middle, offset)
            positions.append((x, y, 0.3 + 0.6 * level))
            body = len(positions) - 1
            if level == 0:
                for end in (-0.5 * per, 0.5 * per):
                    contacts.append((body, -1, np.array([middle + end, offset, 0.0]), (0, 0, 1)))
                continue
            for c in range(per):
                other = body - k - per + c
                ox, oy = positions[other][:2]
                point = (
                    np.array([x, oy, 0.6 * level]) if level % 2 else np.array([ox, y, 0.6 * level])
                )
                contacts.append((body, other, point, (0, 0, 1)))
    return np.array(positions), contacts


def rocks(rng, n, spread):
    """Polyhedra in a heap: each on three others or the ground, three contacts with either, normals
    of any direction upwards."""
    positions, contacts = [], []
    for k in range(n):
        positions.append(np.append(rng.normal(size=2) * n ** (1 / 3), 0.3 * k ** (2 / 3)))
        for other in rng.choice(k, size=min(k, 3), replace=False) if k > 2 else [-1]:
            up = np.array([*rng.normal(scale=0.5, size=2), 1.0])
            up /= np.linalg.norm(up)
            across = frame(up)
            for _ in range(3):
                point = positions[k] - 0.5 * up + 0.3 * rng.normal(size=2) @ across[:2]
                contacts.append((k, int(other), point, up))
    return np.array(positions), contacts


KINDS = dict(tower=tower, wall=wall, spheres=spheres, capsules=capsules, rocks=rocks)


def problem(kind, n, seed, mu=None, spread=1.0, motion=0.1):
    """A problem of about ``n`` bodies; masses over ``spread`` powers of ten, velocities of ``motion``."""
    rng = np.random.default_rng([seed, n, sorted(KINDS).index(kind)])
    positions, contacts = KINDS[kind](rng, n, spread)
    masses, inertias = bodies(rng, len(positions), spread)
    velocity = motion * rng.normal(size=(len(positions), 6))
    W, q = assemble(masses, inertias, contacts, positions, velocity)
    mu = float(rng.choice([0.3, 0.5, 0.7, 1.0])) if mu is None else mu
    return SimpleNamespace(W=W, q=q, mu=mu, kind=kind, bodies=len(positions), seed=seed)


def scenes(largest=1000, options_first=0):
    """The family: every kind, sizes to ``largest`` contacts, at rest and moving, masses alike or not."""
    for kind in KINDS:
        for n in (1, 2, 4, 8, 16, 32, 64, 128, 250)[options_first:]:
            for seed, (motion, spread) in enumerate([(0.0, 0.0), (0.1, 0.5), (1.0, 2.0)]):
                scene = problem(kind, n, seed, motion=motion, spread=spread)
                if len(scene.q) <= largest:
                    scene.motion = motion
                    yield scene


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--largest", type=int, default=1000)
    options = parser.parse_args()
    warnings.simplefilter("ignore", dc.RoundingWarning)
    failed = 0
    for s in scenes(options.largest):
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
