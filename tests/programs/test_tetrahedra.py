"""The comparison of contact points on second-order tetrahedra (benchmarks/tetrahedra): what its points keep, and that its solver is right."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
from scenes import COMM

from benchmarks.tetrahedra.__main__ import cycle, patch, tetrahedral_punch
from benchmarks.tetrahedra.points import VARIANTS, contact_points, even
from studies.punch.model import programme

pytestmark = pytest.mark.skipif(COMM.size > 1, reason="the benchmark is for one rank")
UNEVEN = ("middles", "nodes", "3 points")  # do not carry an even pressure on curved facets


def two_triangles(curved: bool):
    """Nodes and facets of a unit square cut in two, its middles moved within the plane if ``curved``."""
    X = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 0.5], [0.5, 1], [0, 0.5]])  # fmt: skip
    if curved:
        X[4:] += np.random.default_rng(3).uniform(-0.08, 0.08, (5, 2))
    T = np.array([[0, 1, 2, 5, 6, 4], [0, 2, 3, 7, 8, 6]])
    return np.column_stack((X, np.zeros(9))), T


@pytest.mark.parametrize("curved", [False, True], ids=["straight", "curved"])
@pytest.mark.parametrize("variant", VARIANTS)
def test_points_carry_an_even_pressure(variant, curved):
    """Factors sum to one, and points that push evenly make the forces of an even pressure, whose sum is the area by Green's theorem."""
    X, T = two_triangles(curved)
    points = contact_points(variant, X, T)
    assert np.abs(points.C @ np.ones(9) - 1).max() < 1e-13
    carried, expected = points.C.T @ points.area, even(X, T)
    s, w = np.polynomial.legendre.leggauss(6)
    s, w, total = (s + 1) / 2, w / 2, 0.0
    for a, b, middle in ((0, 1, 4), (1, 2, 5), (2, 3, 7), (3, 0, 8)):  # area: that within the edges
        x = np.outer((1 - s) * (1 - 2 * s), X[a]) + np.outer(s * (2 * s - 1), X[b]) + np.outer(4 * s * (1 - s), X[middle])  # fmt: skip
        dx = np.outer(4 * s - 3, X[a]) + np.outer(4 * s - 1, X[b]) + np.outer(4 - 8 * s, X[middle])
        total += w @ (x[:, 0] * dx[:, 1] - x[:, 1] * dx[:, 0]) / 2
    assert expected.sum() == pytest.approx(total, rel=1e-12)
    miss = np.abs(carried - expected).max() / expected.max()
    pulls = points.area.min() < -1e-4 * expected.max()
    assert (miss > 1e-4 or pulls) if curved and variant in UNEVEN else (miss < 1e-12 and not pulls)


@pytest.mark.parametrize("slips", [False, True], ids=["stick", "slip"])
def test_patch_test_of_curved_facets(slips):
    """The limit that docs/method.md states: where edges of contact facets are curved the middles alone fail the patch test, with what vertices
    would carry they pass it."""
    assert patch("middles", slips, tilted=True, curved=False)["forces"] < 1e-11
    with pytest.warns(UserWarning, match="edges of contact facets are curved: .* up to 2.0%"):
        assert patch("middles", slips, tilted=True, curved=True)["forces"] > 1e-3
    with pytest.warns(UserWarning, match="are curved"):
        found = patch("corrected", slips, tilted=True, curved=True)
    assert max(found["forces"], found["displacement"], found["pressure"]) < 1e-10


def test_the_middles_are_what_the_package_does():
    """On the punch in tetrahedra the comparison's own condensed body finds the work of friction of ContactProblem."""
    with pytest.warns(UserWarning, match="edges of contact facets are curved"):  # the rim's
        punch, body = tetrahedral_punch(2)
    for way in programme(punch.parameters):
        punch.press(way)
    found = cycle("middles", punch, body)
    assert found["work"] == pytest.approx(punch.dissipation(), rel=1e-6)
    assert found["failed"] == 0 and dc.Status.SLIP in punch.contact.status
