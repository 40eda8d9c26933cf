# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A rigid pin without friction in a hole it fits, loaded sideways: contact angle and pressure of a Fourier series.

The hole has radius one, the plate is held at radius ``b``.  A pressure ``p_n cos(n theta)`` on the hole moves it by ``f_n p_n``:
in ``t = ln r`` the equations of elasticity of each harmonic are an ordinary differential equation with constant
coefficients, for displacements and tractions [J. H. Michell, Proc. London Math. Soc. 31 (1899) 100: its solutions are powers of r].
Pressure is found from these by complementarity in NumPy.  A pin of the hole's radius touches on an arc that does not depend on
the load [A. Persson, On the Stress Distribution of Cylindrical Elastic Bodies in Contact, Gothenburg 1964]; a smaller one, at small loads, as
Hertz says.
"""

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh
from scipy.linalg import expm

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from mechanics.material import elasticity

COMM = scenes.COMM
E, NU, OUTER = 1000.0, 0.3, 20.0


def flexibility(n: int, nu: float = NU, outer: float = OUTER) -> float:
    """``f_n``: radial displacement of the hole by a pressure ``cos(n theta)``, in plane strain, held at ``outer``."""
    G, lame = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
    P = lame + 2 * G
    # u_r = U cos, u_theta = V sin, r times stresses: S cos, T sin
    strain = np.array([1.0, n, 0, 0])  # of the hoop, times r
    U = (np.array([0, 0, 1.0, 0]) - lame * strain) / P
    V = np.array([n, 1.0, 0, 1 / G])
    hoop = lame * U + P * strain
    A = np.array([U, V, hoop - n * np.array([0, 0, 0, 1.0]), n * hoop - np.array([0, 0, 0, 1.0])])
    if n < 2:  # logarithms
        through = expm(A * np.log(outer))
        basis, end = np.eye(4), through
    else:  # decaying ones are one at the hole, growing ones outside
        s, basis = np.linalg.eig(A)
        s, basis = s.real, basis.real
        far = outer ** -np.abs(s)
        basis, end = basis * np.where(s > 0, far, 1.0), basis * np.where(s > 0, 1.0, far)
    known = np.vstack((basis[2:], end[:2]))
    if n == 0:  # without V and T
        basis, known = basis[:, [0, 2]], known[np.ix_([0, 2], [0, 2])]
        return float(basis[0] @ np.linalg.solve(known, [-1.0, 0]))
    return float(basis[0] @ np.linalg.solve(known, [-1.0, 0, 0, 0]))


def series(clearance: float, way: float, nu: float = NU, outer: float = OUTER, points: int = 720):
    """Angles over half the hole, and the pressure there of a pin moved by ``way``."""
    angle = (np.arange(points) + 0.5) * np.pi / points
    cosines = np.cos(np.outer(np.arange(points), angle)) * np.sqrt(2 / points)
    cosines[0] /= np.sqrt(2)
    f = np.array([flexibility(n, nu, outer) for n in range(points)])
    C, d = (cosines.T * f) @ cosines, way * np.cos(angle) - clearance
    pressed = d > 0
    for _ in range(100):
        p = np.zeros(points)
        p[pressed] = np.linalg.solve(C[np.ix_(pressed, pressed)], d[pressed])
        following = np.where(pressed, p > 0, C @ p < d)
        if (following == pressed).all():
            return angle, p
        pressed = following
    raise AssertionError("complementarity is not reached")


def force(angle: np.ndarray, p: np.ndarray) -> float:
    return float(2 * np.pi / len(p) * (p @ np.cos(angle)))


def half_plate(cells: int, nu: float = NU):
    """Half of the plate, cells that grow like the radius; the pin moves along -x, where angles begin."""
    through = int(np.ceil(np.log(OUTER) * cells / np.pi))
    count = [cells, through]
    domain = mesh.create_rectangle(COMM, [[0, 0], count], count, mesh.CellType.quadrilateral)
    angle, t = (domain.geometry.x[:, :2] / count * [np.pi, np.log(OUTER)]).T
    domain.geometry.x[:, 0], domain.geometry.x[:, 1] = (
        -np.exp(t) * np.cos(angle),
        np.exp(t) * np.sin(angle),
    )

    def along(where):
        return mesh.locate_entities_boundary(domain, 1, where)

    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    hole, outside = (
        along(
            lambda x, r=r: np.hypot(x[0], x[1]) < r[1] if r[0] == 0 else np.hypot(x[0], x[1]) > r[0]
        )
        for r in ((0, 1.0 + 1e-9), (OUTER * (1 - 1e-9), np.inf))
    )
    middle = fem.locate_dofs_topological(V.sub(1), 1, along(lambda x: np.abs(x[1]) < 1e-9))
    bcs = [
        fem.dirichletbc(fem.Constant(domain, 0.0), middle, V.sub(1)),
        fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, outside), V),
    ]
    return elasticity(u, v, E, nu), u, bcs, hole


def pressed(cells: int, clearance: float, ways, nu: float = NU, solver=None):
    """For each way of the pin: angles of the nodes of the hole, their pressures, and the force."""
    F, u, bcs, hole = half_plate(cells, nu)
    pin = dc.RigidSphere((0, 0), 1.0 - clearance)
    contact = dc.Contact(u.function_space, hole, pin, dc.Friction(0.0))
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, solver=solver)
    for way in ways:
        pin.displacement = (-way, 0)
        problem.solve()
        x, p = (np.concatenate(COMM.allgather(a)) for a in (contact.x, contact.pressure))
        angle = np.arctan2(x[:, 1], -x[:, 0])
        order = np.argsort(angle)
        yield angle[order], p[order], -2 * contact.force()[0]


@pytest.mark.parametrize("solver", [None, pytest.param(dc.FixedPoint(), marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "nu",
    [0.3, pytest.param(0.0, marks=pytest.mark.slow), pytest.param(0.45, marks=pytest.mark.slow)],
)
def test_a_pin_that_fits_touches_on_one_arc_whatever_the_load(nu, solver):
    """Contact angle to a node, the largest pressure over the force to 1 %, the force to 1 %, at loads a thousand times apart."""
    angle, p = series(0.0, 1.0, nu)
    end, size = angle[p > 0].max(), np.pi / 90
    expected, total = p.max() / force(angle, p), force(angle, p)
    for at, found, carried in pressed(90, 0.0, (1e-6, 1e-3), nu, solver):
        last = at[found > 0].max()
        assert last - size < end < last + 2 * size
        assert found[0] / carried == pytest.approx(p[0] / total, rel=0.01)
        assert found.max() / carried == pytest.approx(expected, rel=0.01)
    assert carried == pytest.approx(1e-3 * total, rel=0.01)


@pytest.mark.slow
def test_a_looser_pin_touches_on_a_shorter_arc():
    """With clearance the angle grows with the way: each time that of the series to a node, forces to 2 %."""
    clearance, size, ends = 1e-6, np.pi / 90, []
    ways = clearance * np.array([1.2, 2.0, 5.0, 30.0])
    for way, (at, found, carried) in zip(ways, pressed(90, clearance, ways)):
        angle, p = series(clearance, way)
        ends.append(angle[p > 0].max())
        last = at[found > 0].max()
        assert last - size < ends[-1] < last + 2 * size
        assert carried == pytest.approx(force(angle, p), rel=0.02)
    assert ends == sorted(ends) and ends[-1] < series(0.0, 1.0)[0][series(0.0, 1.0)[1] > 0].max()


@pytest.mark.slow
def test_the_series_has_the_closed_forms():
    """Lamé's ring, Hertz's line contact of a loose pin, and a thick plate's arc that does not change with its size."""
    a, b = 1.0, 2.0
    G, lame = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))
    part = 1.0 / (a - b**2 / a)  # u = A r + B / r, u(b) = 0, for a displacement of one
    assert 1 / flexibility(0, outer=b) == pytest.approx(
        -2 * (lame + G) * part - 2 * G * part * b**2
    )
    clearance = 1e-3
    angle, p = series(clearance, 1.01 * clearance, points=2000)
    P = force(angle, p)
    width = np.sqrt(
        4 * P * (1 - NU**2) / (np.pi * E * clearance)
    )  # 1 / R = clearance over radius squared
    assert angle[p > 0].max() == pytest.approx(width, rel=0.05)
    assert p.max() == pytest.approx(2 * P / (np.pi * width), rel=0.02)
    ends = []
    for outer in (20.0, 200.0):
        angle, p = series(0.0, 1.0, outer=outer)
        ends.append(angle[p > 0].max())
    assert ends[1] == pytest.approx(ends[0], abs=0.02)
