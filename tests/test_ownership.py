# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Whose is what: springs belong to the motion they name, motions and histories to one problem, textures to their owner."""

import numpy as np
import pytest
from test_force import E, free_block

import dolfinx_contact as dc

SPRINGS = {
    "by name": (("n", "t1"), {"n": 0.5 * E, "t1": 0.1 * E}),
    "by name in another order": (("t1", "n"), {"n": 0.5 * E, "t1": 0.1 * E}),
    "in the order of free": (("n", "t1"), (0.5 * E, 0.1 * E)),
    "by name, one without": (("n", "t1"), {"n": 0.5 * E}),
}


@pytest.mark.parametrize("given", SPRINGS)
def test_springs_pull_the_motions_that_they_name(given):
    """Body and spring in series share the drive, R = drive / (1 / k + h / (E A)), whatever the order of names."""
    free, stiffness = SPRINGS[given]
    scene = free_block(free, mu=0.3, p=None, nu=0.0)
    scene.plane.stiffness, scene.plane.drive = stiffness, (0, 0, 1e-3)
    assert scene.plane.free == free
    scene.push(0, 0, 0)
    assert scene.force()[2] == pytest.approx(1e-3 / (1 / (0.5 * E) + 0.6 / E), rel=1e-8)


def test_springs_of_turning_surfaces_by_name():
    """A ball joint with a rotational spring: one name is enough, and one number for all is refused."""
    moved = []
    for stiffness in ({"r1": 1e9 * E, "r2": 1e9 * E}, None):
        scene = free_block(("n", "r2", "r1") if stiffness else ("n",), mu=0.0, p=None, nu=0.0)
        scene.plane.stiffness = stiffness or 0.0
        scene.push(0, 0, 1e-3 * E)
        moved.append(scene.moved()[2])
        assert np.abs(scene.plane.rotation).max() < 1e-9
    assert moved[0] == pytest.approx(moved[1], rel=1e-7)


@pytest.mark.parametrize("wrong", [{"t": 1.0}, {"n": -1.0}, {"n": np.nan}, {"n": "stiff"}])
def test_springs_that_name_nothing_are_refused(wrong):
    """A name that is no motion, and a number that is no stiffness."""
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1))
    with pytest.raises(ValueError, match="plane.stiffness"):
        plane.stiffness = wrong
