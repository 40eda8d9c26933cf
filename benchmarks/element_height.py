# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Whether sliding against a slip rule far from the normal of the cone is stable, by the height of the elements.

A half-space of bricks with eight nodes, sliding everywhere in one direction: how its surface resists a wave
of further slip along the slip rule, seen by the load function.  With the layers below the surface
eliminated one after another (Bloch waves), the resistance to a wave is one complex number,
``nu . (S_tt - e S_nt) d``: d the direction of slip, nu the normal of the cone's ellipse, e = r_t / r_n, and
S the surface stiffness while the normal displacement is held.  Where its real part is negative, slip of that wave
grows by itself: the increment of slip is not unique.
"""

from __future__ import annotations

import itertools

import numpy as np
from tables import table

HEIGHTS = 0.25, 0.5, 1.0, 2.0, 4.0  # of a brick over its width
WAVES = 0.05, 0.2, 0.35, 0.5, 0.75, 1.0  # wave number times width over pi
SIDES = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1)])


def brick(height: float, poisson: float) -> np.ndarray:
    """Stiffness of a brick of width 1, by 2 x 2 x 2 points, E = 1, ``shape=(8, 3, 8, 3)``; node order as SIDES."""
    lame, shear = poisson / ((1 + poisson) * (1 - 2 * poisson)), 0.5 / (1 + poisson)
    identity = np.eye(3)
    C = lame * np.einsum("ij,kl->ijkl", identity, identity)
    C += shear * np.einsum("ik,jl->ijkl", identity, identity)
    C += shear * np.einsum("il,jk->ijkl", identity, identity)
    K, signs = np.zeros((8, 3, 8, 3)), 2 * SIDES - 1
    for point in itertools.product((-(3**-0.5), 3**-0.5), repeat=3):
        shape = 1 + signs * point
        others = np.stack([shape[:, [1, 2]], shape[:, [0, 2]], shape[:, [0, 1]]]).prod(axis=2).T
        gradient = signs * others / 8 * 2 / np.array([1, 1, height])
        K += np.einsum("aj,ijkl,bl->aibk", gradient, C, gradient) * height / 8
    return K


def surface(K: np.ndarray, wave: np.ndarray, layers: int) -> np.ndarray:
    """Stiffness of the surface to a wave, ``shape=(3, 3)``, complex; fixed below so many layers."""
    phase = np.exp(1j * SIDES[:, :2] @ wave)
    sheets = np.zeros((2, 3, 2, 3), complex)
    for a, b in itertools.product(range(8), repeat=2):
        sheets[SIDES[a, 2], :, SIDES[b, 2]] += phase[a].conj() * phase[b] * K[a, :, b]
    (top, down), (up, bottom) = sheets.transpose(0, 2, 1, 3)
    S = top
    for _ in range(layers):
        S = top - down @ np.linalg.solve(bottom + S, up)
    return S


def worst_direction(mu, p):
    """``r_t / r_n``, normal of the ellipse and direction of slip where these two are farthest apart."""
    mu, p = np.array(mu), np.array(p)
    angle = np.linspace(0, np.pi / 2, 7201)
    e = mu * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    nu, d = e / mu**2, e / p**2
    nu, d = (v / np.linalg.norm(v, axis=1)[:, None] for v in (nu, d))
    worst = np.argmin(np.einsum("ni,ni->n", nu, d))
    return e[worst], nu[worst], d[worst]


def resistance(height: float, mu, p, poisson: float) -> list[float]:
    """Smallest real part over all directions of a wave, over the mean tangential stiffness, for all WAVES."""
    e, nu, d = worst_direction(mu, p)
    K, directions = brick(height, poisson), np.linspace(0, np.pi, 73)
    rows = []
    for wave in WAVES:
        found = []
        for angle in directions:
            k = np.pi * wave * np.array([np.cos(angle), np.sin(angle)])
            S = surface(K, k, layers=int(60 / min(height, 1.0)))
            found.append(
                (nu @ (S[:2, :2] - np.outer(e, S[2, :2])) @ d).real / (np.trace(S[:2, :2]).real / 2)
            )
        rows.append(min(found))
    return rows


if __name__ == "__main__":
    case_c = dict(mu=(0.3, 0.15), p=(0.05, 0.20))
    print(table(["height over width", *WAVES], [
        [height, *(f"{value:.3f}" for value in resistance(height, **case_c, poisson=0.3))] for height in HEIGHTS
    ]))  # fmt: skip
