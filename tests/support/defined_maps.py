# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The maps of the law at one node by their definitions (nearest point, metric), in NumPy: no quartic, no secular equation.

What obeys the law the judge says (mechanics/judge_law.py); what a map makes of a state that does not, these.

[dSFMH07]: G. de Saxcé, Z.-Q. Feng, Z. Mróz, M. Hjiaj, "Comportement hystérétique du frottement
anisotrope", 18e Congrès Français de Mécanique, 2007.
"""

from __future__ import annotations

import numpy as np


def argmax_on_circle(function):
    """Angle at which a function of arrays of angles is largest: all, then golden sections."""
    angles, step = np.linspace(0, 2 * np.pi, 721, retstep=True)
    best = angles[np.argmax(function(angles))]
    ratio = (np.sqrt(5) - 1) / 2
    a, b = best - step, best + step
    for _ in range(50):
        c, d = b - ratio * (b - a), a + ratio * (b - a)
        a, b = (a, d) if function(c) > function(d) else (c, b)
    return (a + b) / 2


def nearest_on_ellipse_rays(tau, mu):
    """Nearest boundary point of the friction cone: of all rays (mu_x cos a, mu_y sin a, 1) the one
    with the largest projection of tau on it."""

    def ray(angle):
        direction = np.array([mu[0] * np.cos(angle), mu[1] * np.sin(angle), np.ones_like(angle)])
        return direction / np.linalg.norm(direction, axis=0)

    direction = ray(argmax_on_circle(lambda angle: tau @ ray(angle)))
    return max(tau @ direction, 0.0) * direction


def project(tau, mu):
    """Euclidean projection on the friction cone, three dimensions: the point itself, or the nearest
    boundary point, which is the apex where tau is in the polar cone."""
    if np.linalg.norm(tau[:2] / mu) <= tau[2]:
        return tau.copy()
    return nearest_on_ellipse_rays(tau, np.asarray(mu))


def bipotential_map(mu, p, r, x_n, du, rho):
    """Predictor and corrector of [dSFMH07, Section 2], with matrices as written there."""
    M, Q = np.diag(mu), np.diag(p) @ np.linalg.inv(np.diag(mu))
    tau_t = r[:2] - rho * Q @ Q @ du
    tau_n = r[2] - rho * (x_n + np.linalg.norm(M @ Q @ Q @ du))
    return project(np.append(tau_t, tau_n), mu)


def bipotential(mu, p, r, x_n, du):
    """b_c(-du, r) + du . r for an admissible pair, the sum as in [dSFMH07, Section 1]."""
    M, Q2 = np.diag(mu), np.diag((np.asarray(p) / mu) ** 2)
    b = (np.eye(len(mu)) - Q2) @ -du @ r[:-1] + r[-1] * np.linalg.norm(M @ Q2 @ du)
    return b + du @ r[:-1] + x_n * r[-1]


def scaled_map(mu, p, r, x_n, du, rho):
    """The same predictor after the change of variables, projected on the cone |t| <= n."""
    M, Q = np.diag(mu), np.diag(p) @ np.linalg.inv(np.diag(mu))
    w = M @ Q @ Q @ du
    t = np.linalg.solve(M, r[:2]) - rho * w
    n = r[2] - rho * (x_n + np.linalg.norm(w))
    x = project(np.append(t, n), np.ones(2))
    return np.append(M @ x[:2], x[2])


def return_map(mu, p, r, x_n, du, rho_n, rho_t):
    """Of all points of the ellipse |M^-1 t| <= R, the nearest to r_t - rho_t du in the metric P^2 M^-2
    of the slip rule."""
    R = max(0.0, r[2] - rho_n * x_n)
    tau = r[:2] - rho_t * du
    if np.linalg.norm(tau / mu) <= R:
        return np.append(tau, R)
    mu, weight = np.asarray(mu), np.asarray(p) / mu / np.max(p)

    def point(angle):
        return R * mu[:, None] * [np.cos(angle), np.sin(angle)]

    def nearness(angle):
        return -np.linalg.norm(
            weight[:, None] * (point(np.atleast_1d(angle)) - tau[:, None]), axis=0
        )

    angle = argmax_on_circle(nearness)
    return np.append(point(np.atleast_1d(angle))[:, 0], R)
