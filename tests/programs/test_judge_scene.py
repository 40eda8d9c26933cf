# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The judge on DOLFINx scenes: the library's answers spoiled, a stiffness of the wrong sign, outcomes of the matrix."""

from types import SimpleNamespace

import numpy as np
import pytest

import dolfinx_contact as dc
from benchmarks.stress import matrix as stress
from benchmarks.stress.scenes import LAWS
from mechanics.judge import Verdict
from mechanics.judge_scene import SceneJudge
from mechanics.judge_two_bodies import TwoBodiesJudge
from mechanics.scenes import build, problem_of
from mechanics.two_blocks import build_two

TOL = 1e-8


def pressed(law="A", **body):
    """A block pressed and dragged in one step, its judge, and the record of the step."""
    scene = build(**LAWS[law], **body)
    of = SceneJudge(scene, **LAWS[law])
    problem = dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=scene.bcs, tol=TOL)
    scene.move_top((0.001, 0.0005, -0.01))
    return scene, of, problem.solve()


@pytest.mark.parametrize("law", LAWS)
def test_scaled_reactions_are_rejected(law):
    """What the library found is accepted, and with reactions larger by a thousandth rejected."""
    scene, of, _ = pressed(law)
    assert of.verdict(TOL).accepts(TOL)
    of.restart()
    present = scene.contact.present
    scene.contact.present = present._replace(reaction=1.001 * present.reaction)
    assert not of.verdict(TOL).accepts(TOL)


@pytest.mark.parametrize("law", LAWS)
def test_nothing_done_is_rejected(law):
    """The body as it was, under a top that has moved: no reactions, no equilibrium; and moved rigidly with the top into
    the plane, in equilibrium without a force."""
    scene, of, _ = pressed(law)
    none = np.zeros_like(scene.contact.status)
    present = scene.contact.present
    scene.contact.present = present._replace(reaction=0.0 * present.reaction, status=none)
    for rigid in (False, True):
        of.restart()
        scene.u.x.array[:] = 0 if not rigid else np.tile((0.001, 0.0005, -0.01), of.body.free.size // 3 + of.fixed.size // 3)  # fmt: skip
        scene.u.x.array[of.fixed] = scene.held.x.array[of.fixed]
        found = of.verdict(TOL)
        assert not found.accepts(TOL)
        assert found.excess("normal" if rigid else "equilibrium") > 1e-2


def test_negative_moduli_are_refused_or_rejected():
    """A modulus of the wrong sign: the library raises, or the judge says that the answer is none."""
    try:
        _, of, _ = pressed(E=-210e3)
    except (ValueError, dc.NotConverged, dc.LinearSolverError):
        return
    found = of.verdict(TOL)
    assert found.notes and not found.accepts(TOL)
    assert found.excess("normal") > 1e-2


@pytest.mark.parametrize(
    "way, defect", [((0.0, 0.0), ""), ((0.0, -1e-3), "normal"), ((0.0, 1e-3), "normal"), ((1e-3, 0.0), "slip")]
)  # fmt: skip
def test_bodies_moved_rigidly_are_rejected(way, defect):
    """What the library found for two bodies is accepted; the upper one moved as a whole has its forces, but presses at a distance or slips where it sticks."""
    built = build_two(gap=1e-3, moduli=(1.0, 3.0))
    of, problem = TwoBodiesJudge(built), problem_of(built, tol=TOL, geometry_tol=1e-6)
    for aside in (0.0, 2e-4):
        built.move_top((aside, -0.01))
        problem.solve()
        if not aside:
            assert of.verdict(0.01, TOL, 1e-6).accepts(TOL)
    upper = built.V.tabulate_dof_coordinates()[:, 1] > 5e-4
    for u in (built.u, built.held):
        u.x.array.reshape(-1, 2)[upper] += way
    found = of.verdict(0.01, TOL, 1e-6)
    assert found.accepts(TOL) == (not defect)
    assert not defect or found.excess(defect) > 1e-3


@pytest.mark.parametrize("factor", [1.0, 0.999])
def test_friction_of_two_bodies_beyond_the_cone_is_rejected(factor):
    """Of bodies that slide, with a coefficient that the judge takes to be smaller by a thousandth."""
    built = build_two(sliding="small")
    problem = problem_of(built, tol=TOL)
    built.mu *= factor
    of = TwoBodiesJudge(built)
    for aside in (0.0, 0.03):
        built.move_top((aside, -0.01))
        problem.solve()
        found = of.verdict(0.01, TOL)
    assert found.accepts(TOL) == (factor == 1.0)


@pytest.mark.parametrize("off", [0.0, 1.0, -1.0])
@pytest.mark.parametrize("sliding, part", [("small", 1e-3), ("large", 0.1)])
def test_work_of_friction_that_is_not_done_is_rejected(sliding, part, off):
    """Of bodies that slide on, work that is told to be so much more or less; where the other body's forces move on, the judge sees less."""
    built = build_two(sliding=sliding, size=(1.0, 2.0))
    of, problem = TwoBodiesJudge(built), problem_of(built, tol=TOL, geometry_tol=1e-6)
    for aside in (0.0, 0.05, 0.06, 0.07):
        built.move_top((aside, -0.01))
        problem.solve()
        if aside == 0.07:
            of.dissipated += off * part * (built.contact.dissipation.sum() - of.dissipated)
        found = of.verdict(0.01, TOL, 1e-6)
    assert found.accepts(TOL) == (off == 0.0)
    assert off == 0.0 or found.excess("energy") > 1e-5


def outcome(excess, step_error):
    """Outcome of a step with this error, judged off by this much."""
    zero = dict.fromkeys(("equilibrium", "supports", "normal", "cone", "slip", "reactions"), 0.0)
    record = dict(outcome="solved", error=0.0, slip_error=0.0, reactions=0.0, rounding=0.0, steps=0)
    verdict = Verdict(1.0, 1.0, zero | dict(equilibrium=excess), zero)
    step = SimpleNamespace(error=step_error)
    level = stress.level(step, TOL)
    stress.note(record, verdict, level, level > TOL)
    return record["outcome"]


def test_outcomes():
    """Ten times the tolerance is allowed; beyond it an answer is wrong, unless it said so itself, and then within ten times
    what it said."""
    assert outcome(9e-8, 9e-9) == "solved"
    assert outcome(1.1e-7, 9e-9) == "WRONG"
    assert outcome(1.1e-7, 1e-6) == "rounding"
    assert outcome(1.1e-5, 1e-6) == "WRONG"
