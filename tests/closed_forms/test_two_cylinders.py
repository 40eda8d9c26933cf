# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Two elastic cylinders of different materials, twenty elements a half width: Hertz, Cattaneo and Mindlin, Spence.

Bodies, tractions and closed forms are those of the demo, whose materials are such that pressure does not shear the interface.
"""

import demo_two_cylinders as demo
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipk

import dolfinx_contact as dc

pytestmark = pytest.mark.slow
DIRECT = {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}
STROKE = demo.A**2 / (2 * demo.R)


def spread(state) -> float:
    """Half width of the ellipse of pressure with the same second moment."""
    weight = state["p"] * state["area"]
    return 2 * np.sqrt(weight @ state["x"] ** 2 / weight.sum())


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("swapped", [False, True], ids=["upper", "lower"])
def test_partial_slip(swapped, order):
    """The largest pressure to 0.3 %, the half width to 1 %, shear to 4 % in L2, half a cycle's frictional work to 2 %."""
    problem, held = demo.problem_of(40, swapped, order=order, petsc_options=DIRECT)
    contact = problem.contacts[0]
    held.value[:] = 0.0, -3.4 * STROKE
    problem.solve()
    pressed = demo.observe(contact)
    a = demo.half_width(pressed["P"])
    assert pressed["p"].max() == pytest.approx(2 * pressed["P"] / (np.pi * a), rel=0.003)
    assert spread(pressed) == pytest.approx(a, rel=0.01)
    for way in np.linspace(0, 1.1, 5)[1:]:
        held.value[0] = way * STROKE
        problem.solve()
    now, before = demo.observe(contact), demo.COMM.allreduce(contact.dissipation.sum())
    closed = demo.closed_shear(now["x"], now["P"], now["Q"])
    assert (now["q"] - closed) ** 2 @ now["area"] <= 0.04**2 * (closed**2 @ now["area"])
    for way in np.linspace(1.1, -1.1, 9)[1:]:
        held.value[0] = way * STROKE
        problem.solve()
    work = demo.COMM.allreduce(contact.dissipation.sum()) - before
    assert 2 * work == pytest.approx(demo.closed_work(now["P"], now["Q"]), rel=0.02)


@pytest.mark.parametrize("shear, nu, mu", [((400.0, 4000.0), (0.3, 0.3), 0.2), ((400.0, 1200.0), (0.3, 0.3), 0.1)])  # fmt: skip
def test_the_part_that_sticks_grows_with_the_load(shear, nu, mu):
    """Pressed in ten steps, to Spence's part of the half width, to two nodes and 0.7 beta^2; in one step less than half of it sticks.

    ``K'(c/a) / K(c/a) = beta / mu`` as under a flat punch, see test_spence.py [D. A. Spence, J. Elasticity 5 (1975) 297].
    """
    terms = [[(1 - k * v) / G for G, v in zip(shear, nu)] for k in (1, 2)]
    beta = abs(terms[1][0] - terms[1][1]) / (2 * sum(terms[0]))
    closed = brentq(lambda c: ellipk(1 - c * c) / ellipk(c * c) - beta / mu, 1e-9, 1 - 1e-12)
    found = []
    for steps in (10, 1):
        problem, held = demo.problem_of(40, False, shear, nu)
        contact = problem.contacts[0]
        contact.friction = dc.Friction(mu)
        for part in np.arange(1, steps + 1) / steps:
            held.value[1] = -3.4 * STROKE * part
            problem.solve()
        a = np.sqrt(8 * demo.R * abs(contact.force()[1]) / np.pi * sum(terms[0]) / 4)
        x, status = demo.along_face(contact, contact.status)
        sticks = np.flatnonzero(status == dc.Status.STICK)
        assert (np.diff(sticks) == 1).all()
        found.append(x[sticks[-1] - 1 : sticks[-1] + 3] / a)
    (before, *_, after), once = found
    assert before - 0.7 * beta**2 < closed < after + 0.7 * beta**2
    assert once[1] < 0.5 * closed
