# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Lagged quantities of users: see the page docs/extending.md, whose scripts are run elsewhere."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import scenes

from dolfinx_contact.extend import Lagged, LaggedFriction

pytestmark = pytest.mark.ranks


class Same(LaggedFriction):
    """Friction that stays."""

    def friction(self, contact, state):
        return contact.friction


@pytest.mark.parametrize("solver", [None, dc.FixedPoint()])
def test_a_law_that_stays_changes_nothing(solver):
    """Two steps with a lagged law that is always the same end where they do without, to the tolerance."""
    found = []
    for lagged in ((), [Same()]):
        scene = scenes.block(solver=solver, tol=1e-10)
        scene.problem.lagged = lagged
        for way in (0.001, 0.003):
            scene.move_top(way, 0.0, -0.01)
            scene.problem.solve()
        found.append(scenes.gathered(scene.contact)[1])
    assert np.abs(found[0] - found[1]).max() <= 1e-8 * np.abs(found[0]).max()


class Never(Lagged):
    """A quantity that never settles."""

    limit = 3

    def change(self, found, goal):
        from dolfinx_contact.extend import Change

        return Change(False, found.state)

    def renewed(self, step, state):
        return step

    def not_settled(self, change):
        return "it never settles"


def test_a_quantity_that_does_not_settle_refuses_the_step():
    """In its own words; nothing has happened, and the next step without it is solved."""
    scene = scenes.block()
    scene.problem.lagged = [Never()]
    scene.move_top(0.0, 0.0, -0.01)
    with pytest.raises(dc.NotConverged, match="it never settles"):
        scene.problem.solve()
    assert not scene.contact.reaction.any()
    scene.problem.lagged = ()
    assert scene.problem.solve().error <= scene.problem.tol


@pytest.mark.parametrize("wrong", [[0.3], [dc.Friction(0.3)], "friction"])
def test_what_is_no_lagged_quantity_is_refused(wrong):
    """Named, with what to do; what was there stays."""
    scene = scenes.block()
    with pytest.raises(ValueError, match="classes derived from dolfinx_contact.extend.Lagged"):
        scene.problem.lagged = wrong
    assert scene.problem.lagged == ()
