# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A cylinder under a force of constant inclination, then sheared: the closed form of Jäger.

Two dimensions, uncoupled half plane, as in ``demos/demo_partial_slip.py``.  While ``dQ = beta dP`` with beta < mu nothing slips and
``q = beta p``.  After it, P constant, ``q`` is ``mu p`` minus ``(mu - beta)`` times the like pressure over ``|x| < c``, so that
``c^2 / a^2 = (mu P - Q) / ((mu - beta) P)``; ``beta = 0`` is Cattaneo's and Mindlin's case
[J. Jäger, Arch. Appl. Mech. 65 (1995) 478; K. L. Johnson, Contact Mechanics, 1985, Section 7.3].
"""

import importlib

import numpy as np
import pytest

import dolfinx_contact as dc

MU, P = 0.3, 0.0424  # force per length under which a is about what the mesh is made for


@pytest.fixture(scope="module")
def cylinder():
    """Problem of the partial slip demo, its plane driven by force."""
    demo = importlib.import_module("demo_partial_slip")
    problem, _ = demo.cylinder(demo.E, demo.NU)
    return problem, demo


def press(problem, inclination, steps=32):
    """Press with a force of this inclination from nothing."""
    plane = problem.contacts[0].surface
    problem.reset()
    plane.free = ("n",) if inclination == 0.0 else ("t", "n")
    for part in np.arange(1, steps + 1) / steps:
        plane.force = (inclination * part * P, part * P)
        step = problem.solve()
    return step


SLOW = [pytest.param(inclination, marks=pytest.mark.slow) for inclination in (0.0, 0.1, -0.2)]


@pytest.mark.parametrize("inclination", [*SLOW[1:], 0.2])
def test_nothing_slips_under_a_steady_inclination_below_mu(cylinder, inclination):
    """Shear traction is the pressure times the inclination, by its second moment to 3 % of mu p; all but the edge sticks."""
    problem, demo = cylinder
    step = press(problem, inclination)
    seen = demo.observe(problem.contacts[0])
    assert seen["Q"] == pytest.approx(inclination * seen["P"], rel=1e-8)
    assert abs(seen["moment_q"] - inclination * seen["moment_p"]) < 0.03 * MU * seen["moment_p"]
    assert step.counts.slip <= 2 and step.counts.stick >= 20


def test_an_inclination_above_mu_is_refused(cylinder):
    """No reactions within their friction balance it."""
    problem, _ = cylinder
    with pytest.raises((dc.NotConverged, ValueError)):
        press(problem, 1.02 * MU)


@pytest.mark.parametrize("inclination", [*SLOW[:2], pytest.param(0.2, marks=pytest.mark.slow)])
def test_shear_after_oblique_loading_slips_from_the_edges(cylinder, inclination):
    """What friction lacks of ``mu p``, by second moments, is that of the closed form to 1 % of ``mu p``, under three shear forces.

    The fourth root of that part, ``c / a``, says less: near gross sliding it makes 0.04 of 0.005, which no number of steps takes away
    (32 and 64 cells, up to 384 steps, 27 November 2026).
    """
    problem, demo = cylinder
    press(problem, inclination)
    plane = problem.contacts[0].surface
    plane.free = ("t", "n")
    for part in (0.3, 0.6, 0.85):  # of what is left to gross sliding
        shear = (inclination + part * (MU - inclination)) * P
        plane.force = (shear, P)
        problem.solve()
        seen = demo.observe(problem.contacts[0])
        closed = ((MU * P - shear) / ((MU - inclination) * P)) ** 2 * (MU - inclination) / MU
        left = (MU * seen["moment_p"] - seen["moment_q"]) / (MU * seen["moment_p"])
        assert left == pytest.approx(closed, abs=0.01)
