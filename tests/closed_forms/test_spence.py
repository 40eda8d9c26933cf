# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A flat rigid punch on a half plane that sticks in the middle and slips outwards at its edges, under normal load alone.

Stick ends at ``|x| = c`` with ``K'(c/a) / K(c/a) = beta / mu``, ``beta = (1 - 2 nu) / (2 - 2 nu)``, ``K`` the complete elliptic
integral of the first kind, whatever the load, if shear traction does not act on pressure: that is of the order of
``beta^2`` [D. A. Spence, Proc. Camb. Phil. Soc. 73 (1973) 249; K. L. Johnson, Contact Mechanics, 1985, Chapter 5].
"""

from types import SimpleNamespace

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh
from scipy.optimize import brentq
from scipy.special import ellipk

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from mechanics.material import elasticity

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
E, FAR = 1000.0, 20.0  # the box ends at FAR, half the punch is of length 1


def below(nu, mu, divisions=100):
    """Half of a box, a punch along the edge 0 < x < 1, and the force by force: a function of it.

    Where the box ends stand the displacements of a half plane under a line load [Johnson, Section 2.2]: what they miss
    falls as ``1 / FAR^2``.
    """
    x = np.sin(np.linspace(0.0, np.pi / 2, divisions + 1))
    size = x[-1] - x[-2]
    outer = np.cumsum(size * 1.3 ** np.arange(int(np.log(FAR / size) / np.log(1.3)) + 6))
    x = np.append(x, 1.0 + outer * (FAR - 1.0) / outer[-1])
    depth = np.cumsum(size * 1.15 ** np.arange(int(np.log(FAR / size) / np.log(1.15)) + 8))
    depth = np.append(0.0, depth * FAR / depth[-1])
    count = [x.size - 1, depth.size - 1]
    domain = mesh.create_rectangle(COMM, [[0, 0], count], count, mesh.CellType.quadrilateral)
    at = np.rint(domain.geometry.x[:, :2]).astype(int).T
    domain.geometry.x[:, 0], domain.geometry.x[:, 1] = x[at[0]], -depth[at[1]]

    def along(where):
        return mesh.locate_entities_boundary(domain, 1, where)

    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, v, ends = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    foot = along(lambda x: np.isclose(x[1], 0.0) & (x[0] < 1.0 + 1e-9))
    middle = fem.locate_dofs_topological(V.sub(0), 1, along(lambda x: np.isclose(x[0], 0.0)))
    far = along(lambda x: np.isclose(x[1], -FAR) | np.isclose(x[0], FAR))
    bcs = [
        fem.dirichletbc(fem.Constant(domain, 0.0), middle, V.sub(0)),
        fem.dirichletbc(ends, fem.locate_dofs_topological(V, 1, far)),
    ]
    plane = dc.RigidPlane((0, 0), (0, -1))
    plane.free = ("n",)
    contact = dc.Contact(V, foot, plane, dc.Friction(mu))
    problem = dc.ContactProblem(elasticity(u, v, E, nu), u, [contact], bcs=bcs)

    def line_load(x):
        r, angle = np.hypot(x[0], x[1]) + 1e-300, np.arctan2(x[0], -x[1])
        a, b = 2 * (1 - nu**2), (1 - 2 * nu) * (1 + nu)
        cos, sin = np.cos(angle), np.sin(angle)
        radial = -a * cos * np.log(r / FAR) - b * angle * sin
        around = a * sin * np.log(r / FAR) + (2 * nu * (1 + nu) + b) * sin - b * angle * cos
        return np.stack([radial * sin + around * cos, around * sin - radial * cos]) / (np.pi * E)

    unit = fem.Function(V)
    unit.interpolate(line_load)

    def press(force):
        """End of the part that sticks, between which nodes; statuses along x."""
        ends.x.array[:] = force * unit.x.array
        plane.force = (0, -force / 2)
        problem.solve()
        parts = COMM.allgather(np.column_stack([contact.x[:, 0], contact.status]))
        x, status = (rows := np.concatenate(parts))[np.argsort(rows[:, 0])].T
        last = np.flatnonzero(status == dc.Status.STICK)[-1]
        return SimpleNamespace(c=x[last : last + 2], status=status)

    return press


def closed_form(nu, mu):
    """c / a without the action of shear on pressure, and beta."""
    beta = (1 - 2 * nu) / (2 - 2 * nu)
    return brentq(lambda c: ellipk(1 - c * c) / ellipk(c * c) - beta / mu, 1e-9, 1 - 1e-12), beta


@pytest.mark.parametrize("nu, mu", [(0.3, 0.25), (0.4, 0.1), (0.4, 0.15), (0.4, 0.2), (0.45, 0.1)])
def test_the_part_that_sticks_ends_where_it_should(nu, mu):
    """To 0.7 beta^2 (0.057, 0.019, 0.006) and the distance of two nodes; towards the edge all slips, and nothing opens."""
    found = below(nu, mu)(1.0)
    c, beta = closed_form(nu, mu)
    assert np.ptp(found.c) < 0.02
    assert found.c[0] - 0.7 * beta**2 < c + 1e-12 and c - 0.7 * beta**2 < found.c[1]
    assert (np.diff(found.status) >= 0).all() and set(found.status) == {
        dc.Status.STICK,
        dc.Status.SLIP,
    }


@pytest.mark.slow
def test_the_part_that_sticks_is_that_of_any_load():
    """The same nodes stick under a load 1e6 times as large, and under one that was put on in three increments."""
    press = below(0.4, 0.15)
    once = press(1e-6).status
    for load in (0.2, 0.5, 1.0):
        assert np.array_equal(press(load).status, once)
