"""The resistance of a half-space of bricks to waves of slip, by which docs/method.md judges meshes."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "benchmarks"))
import element_height

POISSON, SHEAR = 0.3, 0.5 / 1.3  # E = 1


@pytest.mark.parametrize("angle", [0.0, 0.4, np.pi / 2])
def test_long_waves_see_the_elastic_half_space(angle):
    """Boussinesq's and Cerruti's compliances: (1 - nu), 1 and the coupling (1 - 2 nu) / 2, over shear modulus and wave number."""
    wave = 0.02 * np.pi
    direction = np.array([np.cos(angle), np.sin(angle)])
    S = element_height.surface(element_height.brick(1.0, POISSON), wave * direction, layers=400)
    assert S == pytest.approx(S.conj().T, rel=0, abs=1e-12)
    along = np.array([*direction, 0.0])
    across = np.array([-direction[1], direction[0], 0.0])
    normal = np.array([0.0, 0.0, 1.0])
    compliance = np.linalg.inv(S) * SHEAR * wave
    for first, second, expected in (
        (along, along, 1 - POISSON),
        (across, across, 1.0),
        (normal, normal, 1 - POISSON),
        (along, across, 0.0),
        (across, normal, 0.0),
    ):
        assert first @ compliance @ second == pytest.approx(expected, rel=0, abs=2e-3)
    assert abs(along @ compliance @ normal) == pytest.approx((1 - 2 * POISSON) / 2, rel=0, abs=2e-3)


def test_slip_along_the_normal_of_the_cone_is_always_resisted():
    """With the associated rule the resistance is positive at every wave even where bricks are high."""
    found = element_height.resistance(4.0, (0.3, 0.15), (0.3, 0.15), POISSON)
    assert min(found) > 0.5


def test_the_worst_direction_is_the_one_of_case_c():
    """tan of the largest angle between slip and normal is (a - 1 / a) / 2 with a = p2 mu1 / (p1 mu2)."""
    _, nu, d = element_height.worst_direction((0.3, 0.15), (0.05, 0.2))
    assert nu @ d == pytest.approx(np.cos(np.arctan((8 - 1 / 8) / 2)), rel=1e-6)
