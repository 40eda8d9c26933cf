# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Wear as part of a step's equations: whatever the coefficient, by any solver."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import scenes

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
MU, MODULUS, APPROACH = 0.3, 1000.0, 0.01
NATURAL = 1.0 / MODULUS  # so that a way of the body's size wears off what was pressed in, about


def rubbed(coefficient, ways, cells=(4, 4, 2), solver=None, **options):
    """A block pressed by an approach, or by ``weight``, and rubbed along x: the scene, after each step told to ``look``."""
    weight, look = options.pop("weight", None), options.pop("look", lambda scene: None)
    wear = dc.Wear(coefficient, **options)
    scene = scenes.block(cells=cells, mu=MU, p=None, E=MODULUS, tol=1e-8, solver=solver, wear=wear)
    gdim = len(cells)
    if weight:
        scene.surface.free, scene.surface.force = ("n",), (0,) * (gdim - 1) + (weight,)
    else:
        scene.move_top(*[0] * (gdim - 1), -APPROACH)
    scene.problem.solve()
    for way in ways:
        scene.surface.displacement = (way, *scene.surface.displacement[1:])
        scene.problem.solve()
        look(scene)
    return scene


def largest(array):
    return scenes.MPI.COMM_WORLD.allreduce(float(np.max(array, initial=0.0)), op=scenes.MPI.MAX)


@pytest.mark.parametrize("solver", [None, dc.FixedPoint(), dc.SparseNewton()], ids=["condensed", "fixed point", "sparse"])  # fmt: skip
def test_gentle_wear_is_coefficient_times_work(solver):
    """At every node, after every step, to rounding; the gap has it in the same step."""
    k, seen = 1e-3 * NATURAL, []

    def look(scene):
        c = scene.contact
        assert c.wear_depth * c.area == pytest.approx(k * c.dissipation, rel=1e-9, abs=1e-20)
        gap = c.x[:, 2] + c.wear_depth + c.displacement[:, 2]
        assert c.gap == pytest.approx(gap, abs=1e-4 * APPROACH)
        seen.append(largest(c.wear_depth))

    rubbed(k, (0.1, 1.0), solver=solver, look=look)
    assert 1e-4 * APPROACH < seen[-1] < 1e-2 * APPROACH


@pytest.mark.parametrize("power", [-12, -6, -3, 0, 1, 3, 6])
def test_any_coefficient(power):
    """No more is worn off than was pressed in, but for what corners stand out; never less than by a smaller coefficient; nothing alternates."""
    forces = []
    scene = rubbed(10.0**power * NATURAL, (1.0, 2.0, 3.0), (4, 2), look=lambda s: forces.append(s.contact.force()[-1]))  # fmt: skip
    pressed = rubbed(0.0, (1.0,), (4, 2)).contact.force()[-1]
    c = scene.contact
    mean = COMM.allreduce(float(c.wear_depth @ c.area))  # of a foot of length one
    assert 0.0 < mean < 1.001 * APPROACH
    assert (np.diff([pressed, *forces]) <= 1e-3 * pressed).all() and min(forces) >= 0.0
    if power >= 3:
        assert mean == pytest.approx(APPROACH, rel=0.02)
    if power <= -6:
        work = COMM.allreduce(float(c.dissipation.sum()))
        assert mean == pytest.approx(10.0**power * NATURAL * work, rel=0.01)


@pytest.mark.parametrize("power", [-3, 0, 2])
def test_under_dead_weight_volume_is_archards(power):
    """In gross slip the volume is k mu N times the way, and with much wear pressure becomes even, step by step."""
    weight, coefficient, uneven = 1.0, 10.0**power * NATURAL, []

    def look(scene):
        p = scene.contact.pressure
        uneven.append(largest(np.abs(p / weight - 1.0)))

    scene = rubbed(coefficient, np.arange(1.0, 6.0), (6, 3), weight=weight, look=look)
    c = scene.contact
    volume = COMM.allreduce(float(c.wear_depth @ c.area))
    assert volume == pytest.approx(coefficient * MU * weight * 5.0, rel=2e-3)
    if power >= 0:
        assert uneven[-1] < 0.6 * uneven[0] and (np.diff(uneven) < 1e-3).all()


def test_refusals_and_options():
    """A Wear says whether it is explicit; a checkpoint of it is the same."""
    assert repr(dc.Wear(1e-6, explicit=True)) == "Wear(1e-06, explicit=True)"
    assert not dc.Wear(1e-6).explicit


@pytest.mark.parametrize("explicit", [False, True])
def test_a_coating_and_a_threshold_of_work(explicit):
    """A coefficient that is a field wears what a number wears on each side; below the threshold nothing wears, above it what is beyond."""
    k = 1e-6

    def half(x):
        return np.where(x[0] < 0.0, k, 0.0)

    coated, whole = (rubbed(of, (1.0, 2.0), explicit=explicit) for of in (half, k))
    left = whole.contact.x[:, 0] < 0.0
    depth = whole.contact.wear_depth
    assert (depth > 0.0).all()
    assert coated.contact.wear_depth == pytest.approx(np.where(left, depth, 0.0), rel=1e-3)
    scene, depths = rubbed(0.0, ()), []
    limit = 1.5 * MU * scene.contact.force()[-1]  # work of one way and a half
    late = rubbed(k, (1.0, 2.0, 3.0), explicit=explicit, threshold=limit, look=lambda s: depths.append(s.contact.wear_depth @ s.contact.area))  # fmt: skip
    volumes = COMM.allreduce(np.array(depths))
    work = COMM.allreduce(float(late.contact.dissipation.sum()))
    assert volumes[0] < volumes[1] < volumes[2]
    assert volumes[2] == pytest.approx(k * np.maximum(work - limit, 0.0), rel=0.1)
    with pytest.raises(ValueError, match="threshold must be a number >= 0"):
        dc.Wear(1.0, threshold=-1.0)
    with pytest.raises(ValueError, match="the field has -1"):
        rubbed(lambda x: -np.ones(x.shape[1]), ())
