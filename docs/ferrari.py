# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Writes docs/ferrari.svg and ferrari.json: what Ferrari's closed form loses of the projection on the friction cone.

Both methods solve the quartic of [dSFMH07, Section 2] in R = r_n,
(d_x d_y)^2 = (mu_x tau_x d_y)^2 + (mu_y tau_y d_x)^2 with d_i = (1 + mu_i^2) R - tau_n, in double
precision for the same points; the reference has 60 digits. Run it in the repository's environment:

    .venv/bin/python docs/ferrari.py
"""

import json
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import mpmath as mp
import numpy as np

from dolfinx_contact.law.friction_cone import load_function, project_cone

mp.mp.dps = 60
UNIT = np.finfo(float).eps / 2


def ferrari(tau, mu):
    """The points that belong to the four roots R of the quartic, by Ferrari's method."""
    (A, B), n = (mu * tau[:2]) ** 2, tau[2]
    x, y = (np.array([g**2, -2 * g * n, n**2]) for g in 1 + mu**2)  # d_x^2, d_y^2 by powers of R
    coefficients = np.polymul(x, y)
    coefficients[2:] -= A * y + B * x
    a, b, c, d = coefficients[1:] / coefficients[0]
    # R = z - a / 4, z^4 + p z^2 + q z + r = 0, q != 0 unless both coefficients are the same
    p = b - 3 * a**2 / 8
    q = c - a * b / 2 + a**3 / 8
    r = d - a * c / 4 + a**2 * b / 16 - 3 * a**4 / 256
    # the largest real root of m^3 + p m^2 + (p^2 / 4 - r) m - q^2 / 8 = 0, by Cardano's method
    P, Q = p**2 / 4 - r - p**2 / 3, 2 * p**3 / 27 - p * (p**2 / 4 - r) / 3 - q**2 / 8
    discriminant = Q**2 / 4 + P**3 / 27
    root = np.sqrt(complex(discriminant))
    t = max(-Q / 2 + root, -Q / 2 - root, key=abs) ** (1 / 3) * np.exp(
        2j * np.pi * np.arange(3) / 3
    )
    m = t - P / (3 * t) - p / 3
    m = m[np.argmin(np.abs(m.imag))].real if discriminant > 0 else m.real.max()
    s = np.sqrt(complex(2 * m))
    roots = [
        (sign * s / 2 + half * np.sqrt((-p - m - sign * q / s) / 2)).real - a / 4
        for sign in (1, -1)
        for half in (1, -1)
    ]
    return [np.append(tau[:2] * mu**2 * R / ((1 + mu**2) * R - n), R) for R in roots]


def exact(tau, mu):
    """The projection of a point that has its projection on the boundary, with 60 digits."""
    t, n, mu = [mp.mpf(x) for x in tau[:2]], mp.mpf(tau[2]), [mp.mpf(x) for x in mu]

    def excess(R):
        return sum((m * x / ((1 + m * m) * R - n)) ** 2 for m, x in zip(mu, t, strict=True)) - 1

    # between the largest root for one term alone and sqrt(2) times its share
    low, high = (
        max((f * abs(x) * m + n) / (1 + m * m) for m, x in zip(mu, t, strict=True))
        for f in (1, mp.sqrt(2))
    )
    low = max(low, n * (1 + mp.mpf(10) ** -58))
    R = mp.findroot(excess, (low, high), solver="anderson", tol=1e-100, verify=False)
    return [x * m * m * R / ((1 + m * m) * R - n) for m, x in zip(mu, t, strict=True)] + [R]


def error(points, tau, r):
    """Distance of the best of some points from the exact projection, in units of rounding of |tau|."""
    distances = [
        float(mp.sqrt(sum((mp.mpf(a) - b) ** 2 for a, b in zip(point.tolist(), r, strict=True))))
        / (UNIT * np.linalg.norm(tau))
        for point in points
        if np.all(np.isfinite(point))
    ]
    return min(distances, default=1 / UNIT)  # nothing left of it


def slipping_points(rng, mu, count):
    """Random directions, well outside of the cone and of its polar."""
    while count:
        tau = rng.normal(size=3)
        if load_function(tau[None], mu)[0] > 0.1 and np.linalg.norm(mu * tau[:2]) + tau[2] > 0.1:
            count -= 1
            yield tau


METHODS = {
    "ferrari": (ferrari, "tab:red", "Ferrari, best of four roots"),
    "project_cone": (lambda tau, mu: project_cone(tau[None], mu), "tab:blue", "project_cone"),
}


def panel(axes, where, label, cases) -> dict:
    """Errors of both methods for points that `cases` gives for each abscissa: drawn, and as a record."""
    errors = {name: [] for name in METHODS}
    for x in where:
        points = [(tau, mu, exact(tau, mu)) for tau, mu in cases(x)]
        for name, (method, *_) in METHODS.items():
            errors[name].append([error(method(tau, mu), tau, r) for tau, mu, r in points])
    record = {
        name: dict(worst=np.max(of, axis=1).tolist(), median=np.median(of, axis=1).tolist())
        for name, of in errors.items()
    }
    for name, (_, colour, title) in METHODS.items():
        for which, style in (("worst", "-"), ("median", "--")):
            drawn = np.maximum(record[name][which], 0.1)
            axes.loglog(where, drawn, style, color=colour, label=f"{title}: {which}")
    axes.axhline(4, color="0.7", zorder=0)
    axes.set_xlabel(label)
    return record | dict(where=list(where))


def main():
    np.seterr(all="ignore")  # Ferrari's formula divides by zero and takes roots of negative numbers
    rng = np.random.default_rng(1)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True, layout="constrained")

    def by_ratio(ratio):
        mu = np.array([0.3, 0.3 / ratio])
        return [(tau, mu) for tau in slipping_points(rng, mu, 60)]

    def by_distance(distance):
        """Points outside of the cone by a small part of their normal component."""
        mu = np.array([0.3, 0.15])
        t = rng.normal(size=(60, 2))
        t /= np.linalg.norm(t, axis=1)[:, None]
        normal = np.linalg.norm(t / mu, axis=1) * (1 - distance)
        return [(tau, mu) for tau in np.column_stack([t, normal])]

    record = {}
    record["ratio"] = panel(
        left,
        np.append(1.1, 10.0 ** np.arange(0.5, 8.1, 0.5)),
        "ratio of the coefficients of friction",
        by_ratio,
    )
    record["distance"] = panel(
        right,
        10.0 ** np.arange(-14, -0.5, 1),
        "relative distance from the friction cone",
        by_distance,
    )
    left.set_ylabel("error of the projection\nin units of rounding of |τ|")
    right.legend(fontsize="small", loc="upper right")
    figure.savefig(Path(__file__).with_suffix(".svg"), metadata={"Date": None})
    Path(__file__).with_suffix(".json").write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
