# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Whose is what: springs belong to the motion they name, motions and histories to one problem, textures to their owner."""

import numpy as np
import pytest
from mpi4py import MPI
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


def test_a_driven_surface_belongs_to_one_problem():
    """Two problems that a force drives on one surface would take each other's motion for theirs: the older one is refused."""
    scene = free_block(("n",), mu=0.3, p=None)
    scene.push(0, 0, 1e-3 * E)
    contact = dc.Contact(scene.V, scene.facets, scene.plane, dc.Friction(0.3))
    later = dc.ContactProblem(scene.F, scene.u, [contact], bcs=scene.bcs)
    later.solve()
    for verb in (scene.problem.solve, scene.problem.reset):
        with pytest.raises(ValueError, match="driven by force in a ContactProblem made later"):
            verb()
    later.solve()
    scene.plane.free = ()  # where it stands is still what the later problem has found
    with pytest.raises(ValueError, match="make a surface"):
        scene.problem.solve()


def test_a_surface_driven_by_displacement_may_be_shared():
    """Two problems, stepped in turn over one prescribed surface, have the forces that each has alone."""
    forces = {}
    for together in (False, True):
        first = free_block((), mu=0.3, p=None)
        second = free_block((), mu=0.3, p=None)
        if together:
            contact = dc.Contact(second.V, second.facets, first.plane, dc.Friction(0.3))
            second.problem = dc.ContactProblem(second.F, second.u, [contact], bcs=second.bcs)
            second.contact = contact
        for place in ((0, 0, 1e-3), (3e-4, 0, 1e-3), (1e-4, 0, 1e-3)):
            for scene in (first, second):
                scene.contact.plane.displacement = place
                scene.problem.solve()
        forces[together] = [scene.contact.force() for scene in (first, second)]
    assert np.allclose(forces[True], forces[False], rtol=1e-9, atol=1e-9 * E)


def test_a_second_problem_on_a_contact_is_told_of():
    """A history that ends without a word is a wrong answer: a warning; none of a contact that has made no step."""
    scene = free_block((), mu=0.3, p=None)
    dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=scene.bcs).solve()
    with pytest.warns(UserWarning, match="1 of 1 contacts have a history .* begins anew"):
        dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=scene.bcs)
    dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=scene.bcs)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_law_of_the_last_step_is_in_the_checkpoint(dim, tmp_path):
    """Friction exchanged after a step: the next one does the same work, straight on or from the file."""
    path = MPI.COMM_WORLD.bcast(tmp_path, root=0) / "state.npz"
    laws = [dict(mu=(0.3, 0.1), p=(0.02, 0.2)), dict(mu=(0.1, 0.3), p=(0.2, 0.02))]
    if dim == 2:
        laws = [dict(mu=0.3, p=None), dict(mu=0.1, p=None)]
    works = []
    for loaded in (False, True):
        scene = free_block((), dim, **laws[0], wear=dc.Wear(1e-3))
        rest = np.arange(1.0, dim - 1)
        for k in range(2, 4) if loaded else range(4):
            if k == 2:
                if loaded:
                    scene.problem.load(path)
                scene.problem.save(path)
                before = scene.contact.dissipation.sum(), scene.contact.wear_depth.sum()
                scene.contact.friction = dc.Friction(**laws[1])
            scene.move_top(2e-3 * k, *1e-3 * k * rest, -1e-3)
            scene.problem.solve()
        sums = scene.contact.dissipation.sum(), scene.contact.wear_depth.sum()
        works.append(np.subtract(sums, before))
    assert (works[0] > 0).all() or MPI.COMM_WORLD.size > 1
    assert works[1] == pytest.approx(works[0], rel=1e-6)


@pytest.mark.parametrize("moved_before", [False, True])
def test_reset_returns_surfaces_to_where_the_problem_found_them(moved_before):
    """The same programme after a reset has the same forces, on a surface moved and turned by hand, and by force."""
    scene = free_block((), mu=0.3, p=None)
    if moved_before:
        scene.plane.displacement, scene.plane.rotation = (0, 0, -2e-4), (0, 0, 0.1)
        contact = dc.Contact(scene.V, scene.facets, scene.plane, dc.Friction(0.3))
        scene.contact, scene.problem = (
            contact,
            dc.ContactProblem(scene.F, scene.u, [contact], bcs=scene.bcs),
        )
    start, runs = (scene.plane.displacement, scene.plane.rotation), []
    for _ in range(2):
        forces = []
        for place, turn, free in (
            ((0, 0, 1e-3), 0.0, ()),
            ((4e-4, 0, 1e-3), 0.0, ()),
            ((0, 0, 0), 0.2, ()),
            (None, 0, ("n",)),
        ):
            scene.plane.free = free
            if place is not None:
                scene.plane.displacement = start[0] + np.array(place)
                scene.plane.rotation = start[1] + np.array((0, 0, turn))
            scene.plane.force = (0, 0, 1e-3 * E) if free else None
            scene.problem.solve()
            forces.append(scene.contact.force())
        runs.append(forces)
        scene.problem.reset()
        assert np.array_equal(scene.plane.displacement, start[0])
        assert np.array_equal(scene.plane.rotation, start[1])
    assert np.allclose(runs[1], runs[0], rtol=0, atol=1e-9 * E)
