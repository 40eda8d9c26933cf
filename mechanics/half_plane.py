# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Closed forms of contact with an elastic half plane y > 0, plane strain: Hertz's cylinder, partial slip, the flat punch.

Tractions are superposed of ``p_w(x) = p0 w / a sqrt(1 - x^2 / w^2)`` over ``|x| < w``, which Hertz's pressure is for ``w = a``
[K. L. Johnson, Contact Mechanics, 1985, Sections 4.2, 7.2, 2.8].  Their displacements in the whole half plane are sums of those of
point forces [N. I. Muskhelishvili, Some Basic Problems, 1953, Section 90], whose places are the nodes of Gauss's rules: a mesh that
is given them on its far boundary has no error of its size.  Units are the user's: force per length, length.
"""

from dataclasses import dataclass

import numpy as np

POINTS = 24  # of Gauss's rules: eight half widths away fields are exact to rounding


def point_forces(x: np.ndarray, force: complex, at, weights, shear: float, nu: float) -> np.ndarray:
    """Displacement ``shape=(2, n)`` at ``x``, ``shape=(2 or 3, n)``, of a force ``X + iY`` spread over points of the surface.

    ``2 G (u + iv) = k phi - z conj(phi') - conj(psi)`` with ``phi = -F log z / 2 pi``, ``psi = conj(F) log z / 2 pi``.
    """
    z = (x[0] + 1j * x[1])[:, None] - at
    log, kappa = np.log(z / 1j), 3 - 4 * nu
    field = -kappa * force * log + np.conj(force) * z / np.conj(z) - force * np.conj(log)
    found = field @ weights / (4 * np.pi * shear)
    return np.array([found.real, found.imag])


def potential(x: np.ndarray, width: float) -> np.ndarray:
    """Mean of ``log |x - s|`` over ``|s| < width`` with the weight of an ellipse."""
    s = np.abs(x) / width
    outside = np.sqrt(np.maximum(s**2 - 1, 0))
    return s**2 + np.log(width / 2) - 0.5 - s * outside + np.arccosh(np.maximum(s, 1))


@dataclass(frozen=True)
class Cylinder:
    """A body with the face ``y = x^2 / 2 R`` on the rigid plane y = 0; ``a`` is the half width of the contact.

    A shear is a list of pairs (coefficient c, half width w): ``q = sum c p_w``.  It is exact for ``nu = 1/2``, where pressure and shear
    do not move each other's surface.
    """

    young: float
    nu: float
    radius: float
    a: float
    mu: float = 0.0

    @property
    def modulus(self) -> float:
        return self.young / (1 - self.nu**2)

    @property
    def force(self) -> float:
        """Per length."""
        return np.pi * self.modulus * self.a**2 / (4 * self.radius)

    def ellipse(self, x: np.ndarray, width: float) -> np.ndarray:
        """``p_w``."""
        top = 2 * self.force / (np.pi * self.a) * width / self.a
        return top * np.sqrt(np.maximum(1 - (x / width) ** 2, 0))

    def pressure(self, x: np.ndarray) -> np.ndarray:
        return self.ellipse(x, self.a)

    def sheared(self, tangential: float, turned: float | None = None) -> list[tuple[float, float]]:
        """The shear of a tangential force, or of one that has come back from ``turned``, both over ``mu P``."""
        if turned is None:
            return [(self.mu, self.a), (-self.mu, self.a * np.sqrt(1 - tangential))]
        inner = self.a * np.sqrt(1 - (turned - tangential) / 2)
        return self.sheared(turned) + [(-2 * self.mu, self.a), (2 * self.mu, inner)]

    def shear(self, x: np.ndarray, parts) -> np.ndarray:
        return sum(c * self.ellipse(x, w) for c, w in parts) + 0 * x

    def slipped(self, x: np.ndarray, parts) -> np.ndarray:
        """Tangential displacement of the surface beside that of the part that sticks."""
        factor = 2 * self.force / (np.pi * self.modulus * self.a**2)
        return -factor * sum(
            c * w**2 * (potential(x, w) - potential(0 * x, w)) for c, w in parts if w > 0
        )

    def work(self, path, points: int = 2000) -> float:
        """Of friction along a list of shears, from none: where it slips, ``q = mu p`` all the way."""
        x = self.a * np.cos((np.arange(points) + 0.5) * np.pi / points)
        weights = np.pi / points * np.sqrt(self.a**2 - x**2)
        slips = np.array([0 * x] + [self.slipped(x, parts) for parts in path])
        return float(
            self.mu * (np.abs(np.diff(slips, axis=0)).sum(axis=0) * self.pressure(x)) @ weights
        )

    def displacement(self, x: np.ndarray, parts=(), points: int = POINTS) -> np.ndarray:
        """Field ``shape=(2, n)`` of a body whose contact sticks in the middle on the plane y = 0."""
        k = np.arange(1, points + 1) * np.pi / (points + 1)
        spots, weights = np.cos(k), 2 / (points + 1) * np.sin(k) ** 2
        shear = self.young / (2 + 2 * self.nu)
        field, factor = np.zeros((2, x.shape[1])), 2 / (np.pi * self.modulus)
        loads = [(1j, 1.0, self.a)] + [(1.0, c, w) for c, w in parts if w > 0]
        for way, c, w in loads:
            force = c * self.force * (w / self.a) ** 2
            field += point_forces(x, way * force, w * spots, weights, shear, self.nu)
            middle = -factor * force * potential(np.zeros(1), w)[0]
            sign = -1 if way == 1j else 1  # of the term conj(F) z / conj(z) on the surface
            rigid = middle + sign * force / (4 * np.pi * shear)
            field[0 if way == 1.0 else 1] -= rigid
        return field


@dataclass(frozen=True)
class FlatPunch:
    """A rigid punch of half width ``a`` without friction, ``p = P / (pi sqrt(a^2 - x^2))``, and its force per length."""

    young: float
    nu: float
    a: float
    force: float

    @property
    def second_moment(self) -> float:
        """Of the pressure about the middle."""
        return self.force * self.a**2 / 2

    def displacement(self, x: np.ndarray, points: int = POINTS) -> np.ndarray:
        """Field ``shape=(2, n)`` of a body whose face stays at y = 0 under the punch."""
        spots = self.a * np.cos((np.arange(points) + 0.5) * np.pi / points)
        shear = self.young / (2 + 2 * self.nu)
        weights = np.full(points, 1 / points)
        field = point_forces(x, 1j * self.force, spots, weights, shear, self.nu)
        modulus = self.young / (1 - self.nu**2)
        field[1] += 2 * self.force / (np.pi * modulus) * np.log(self.a / 2) + self.force / (
            4 * np.pi * shear
        )
        return field
