# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Scenes said in two ways that mechanics says are one have the same forces, work and wear: a sample of ``python -m benchmarks.pairs``."""

import pytest
from mpi4py import MPI

from benchmarks.pairs import Played, Way, difference, judged, pairs

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="numbers are this rank's")
ALL = {(name, said): (way, change, tol) for name, said, way, change, tol in pairs()}
# What has disagreed without a word, and was mended.
MENDED = [
    ("plane", "stiff springs"), ("circle", "stiff springs"), ("plane, textured surface", "the surface moves"), ("circle", "FixedPoint"),
    ("plane, mixed", "two contacts of one"), ("ball, worn", "two contacts of one"),
]  # fmt: skip
SAMPLE = [("plane, 2-D", said) for name, said in ALL if name == "plane, 2-D"]


def agrees(name, said):
    way, change, tol = ALL[name, said]
    outcome, off, why = judged(Played(way), change, tol)
    assert outcome in ("agrees", "told"), (off, why)


@pytest.mark.parametrize("name, said", MENDED)
def test_pairs_that_did_not_agree(name, said):
    """Beside springs of 1e8 of the body's stiffness a slip is not none and geometry not right; a texture is that of a step's end; a node
    that presses does not land once more; an edge of two contacts is found among mixed unknowns."""
    agrees(name, said)


def test_a_block_in_two_dimensions_however_it_is_said():
    """Every variant of one scene."""
    one = Played(ALL[SAMPLE[0]][0])
    for pair in SAMPLE:
        _, change, tol = ALL[pair]
        outcome, off, why = judged(one, change, tol)
        assert outcome == "agrees", (pair, off, why)


@pytest.mark.slow
@pytest.mark.parametrize("name, said", [pair for pair in ALL if pair not in SAMPLE + MENDED])
def test_all_other_pairs_agree(name, said):
    """As the tests above, of every feature."""
    agrees(name, said)


def test_what_is_another_scene_does_not_agree():
    """Friction less by a thousandth, or a radius more by one: the judge notices."""
    one = Played(Way(surface="ball", d=2, cells=(8, 3)))
    for change in (dict(mu=(0.2997, 0.15)), dict(radius=3.003)):
        assert judged(one, change, 1e-5)[0] == "WRONG WITHOUT A WORD"
    assert difference(one.numbers, one.numbers) == 0.0
