# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Load steps before the judge, which shares neither law nor error nor solver with the package; and the error as documented."""

import numpy as np
import pytest
import scenes
from condensed_scenes import normalised, project_elliptic_cone
from mpi4py import MPI

from mechanics.judge_scene import SceneJudge

EPSILON = np.finfo(float).eps
CASES = {
    "A": ((4, 4, 2), 0.2, None),
    "B": ((4, 4, 2), (0.3, 0.15), None),
    "C": ((4, 4, 2), (0.3, 0.15), (0.05, 0.20)),
    "crossed": ((4, 4, 2), (0.4, 0.1), (0.1, 0.3)),
    "plane strain": ((6, 3), 0.2, None),
}
PROGRAMMES = {
    3: [(0, 0, -0.005), (0.001, 0.0005, -0.01), (0.002, -0.001, -0.006), (0.01, 0, -0.002)],
    2: [(0, -0.005), (0.001, -0.01), (0.002, -0.006), (0.01, -0.002)],
}
pytestmark = pytest.mark.skipif(scenes.COMM.size > 1, reason="dense: one rank is enough")


def documented(kappa, mu, p, reaction, gap, slip, unbalanced, load):
    """The error of a step as docs/errors.md defines it, term by term."""
    mu, p = normalised(mu, p)
    defect = []
    for k, r, x_n, du in zip(kappa, reaction, gap, slip):
        q2 = (p / mu) ** 2
        w = np.append(q2 * du, x_n + np.linalg.norm(mu * q2 * du))
        defect.append(r - project_elliptic_cone(r - k * w, mu))
    penetration = kappa * np.maximum(-gap, 0.0)
    return max(map(np.linalg.norm, (unbalanced, defect, penetration))) / load


@pytest.mark.parametrize("case", CASES)
def test_a_programme_before_the_judge(case):
    """Every step is accepted, near a tight solution sought from a start of its own; ``step.error`` is the documented one."""
    cells, mu, p = CASES[case]
    scene = scenes.block(comm=MPI.COMM_SELF, cells=cells, mu=mu, p=p)
    contact, d = scene.contact, len(cells)
    mu = np.broadcast_to(mu, d - 1)
    p = mu if p is None else p
    of = SceneJudge(scene, mu, p)
    of.unique = True  # in these steps there is one solution
    K, fixed, nodes, kappa = of.body.relation.K, of.fixed, of.nodes, of.body.k_n
    assert np.array_equal(nodes, contact.nodes)
    free, frame, before = of.body.free, contact.frame, np.zeros((nodes.size, d))
    for top in PROGRAMMES[d]:
        scene.move_top(*top)
        step = scene.problem.solve()
        verdict = of.verdict(scene.problem.tol)
        assert verdict.accepts(scene.problem.tol), verdict
        assert verdict.from_scratch <= 1e-8 * verdict.contact_scale
        u = scene.u.x.array
        local = u.reshape(-1, d)[nodes] @ frame.T
        forces = np.zeros((u.size // d, d))
        forces[nodes] = contact.reaction @ frame
        acting = max(np.linalg.norm(contact.reaction), np.linalg.norm((K @ u)[fixed]))
        slip = (local - before)[:, :-1]
        left = (forces.ravel() - K @ u)[free]
        found = documented(kappa, mu, p, contact.reaction, local[:, -1], slip, left, acting)
        assert found <= 1e-10
        # Both are rounded, as sums of so many terms of random sign as a row of K has.
        terms = np.sqrt(d * 3**d) * K.magnitude(u).astype(float)
        rounding = EPSILON * np.linalg.norm(terms[free]) / acting
        assert rounding < 1e-12
        assert found == pytest.approx(step.error, rel=0.05, abs=rounding)
        before = local
