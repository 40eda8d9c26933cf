# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Wear of two deformable bodies that rub each other: volumes, worn tracks that stay with their body, histories."""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mixed_scenes import elasticity, held, taylor_hood
from two_bodies import COMM, blocks, dc, largest, pair, rubber

pytestmark = pytest.mark.ranks

K = (
    2e-7,
    6e-7,
)  # of the upper and the lower body; at the speed of these scenes a part of the elastic compression
CELLS = {"quadrilateral": ((4, 2), (15, 2)), "triangle": ((4, 2), (15, 2)), "hexahedron": ((2, 2, 1), (7, 3, 1)), "tetrahedron": ((2, 2, 1), (5, 2, 1))}  # fmt: skip
slow = [pytest.param(*case, marks=pytest.mark.slow) for case in (("hexahedron", 1), ("tetrahedron", 2))]  # fmt: skip


def rubbed(cell, degree, ways=4, swapped=False, scale=1.0, size=(1.0, 3.0), far=0.8, cells=None, form=None, **options):  # fmt: skip
    scene = blocks(cell, degree, cells or CELLS[cell], size=size, sliding="large", swapped=swapped, tol=1e-9, form=form)  # fmt: skip
    own, other = np.array(K[::-1] if swapped else K) * scale
    scene.contact.wear = dc.Wear(own, opposite=other, **options)
    for part in np.linspace(0.0, 1.0, ways + 1):
        scene.way.value[:] = [far * part, *[0.0] * (scene.domain.geometry.dim - 2), -0.005]
        scene.problem.solve()
    return scene, np.array([own, other])


def work(scene) -> float:
    return COMM.allreduce(scene.contact.dissipation.sum())


@pytest.mark.parametrize("cell, degree", [("quadrilateral", 1), ("triangle", 2), *slow])
@pytest.mark.parametrize("swapped", [False, True], ids=["upper", "lower"])
@pytest.mark.parametrize("options", [dict(explicit=True), pytest.param(dict(scale=1e-4), marks=pytest.mark.slow)], ids=["explicit", "gentle"])  # fmt: skip
def test_each_side_loses_its_coefficient_times_the_work(cell, degree, swapped, options):
    """To rounding, on meshes that do not match and are covered in part; no node gains.  Within the step, where nodes open, to a tenth of ``geometry_tol``."""
    scene, k = rubbed(cell, degree, swapped=swapped, **options)
    contact = scene.contact
    assert contact.worn_volume() == pytest.approx(
        k * work(scene), rel=1e-12 if contact.wear.explicit else 1e-3
    )
    assert (contact.wear_depth >= 0.0).all() and (contact.opposite_wear_depth >= 0.0).all()
    assert largest(contact.opposite_wear_depth) > 0.0


def test_bodies_apart_have_the_gap_that_both_have_lost():
    """Lifted off, undeformed bodies are apart by the lift and by what both sides have worn; ``opening`` is that opposite nodes of the pressed state."""
    scene, _ = rubbed("quadrilateral", 1, explicit=True)
    contact = scene.contact
    scene.way.value[1] = 0.02
    scene.problem.solve()
    assert contact.gap - 0.02 == pytest.approx(contact.opening, rel=0.02)
    assert (
        largest(contact.gap - 0.02 - contact.wear_depth) > 0.1 * largest(contact.wear_depth) > 0.0
    )


def test_rubber_loses_it_too():
    """Bodies of finite strain, in steps by one facet."""
    scene, k = rubbed("quadrilateral", 1, form=rubber, explicit=True)
    assert scene.contact.worn_volume() == pytest.approx(k * work(scene), rel=1e-12)


@pytest.mark.parametrize("swapped", [False, True], ids=["upper", "lower"])
def test_incompressible_bodies(swapped):
    """In Taylor and Hood's mixed form: an even pressure of 4 G e at a strain e is exact on meshes that do not match, and sliding wears both."""
    domain, top, bottom, upper, lower, _ = pair("triangle", ((4, 2), (7, 2)))
    W, G, down = taylor_hood(domain), 100.0, 0.02
    w = fem.Function(W)
    F = elasticity(w, ufl.TestFunction(W), G, 0.0)
    slave, master = (lower, upper) if swapped else (upper, lower)
    contact = dc.Contact(W, slave, dc.DeformableSurface(W, master), 0.0, wear=dc.Wear(1e-6, opposite=3e-6, explicit=True))  # fmt: skip
    side = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[0], 0.0))
    (press, way), (foot, _), (left, _) = held(W, top, component=1), held(W, bottom, component=1), held(W, side, component=0)  # fmt: skip
    problem = dc.ContactProblem(F, w, [contact], bcs=[press, foot, left], tol=1e-10)
    way.x.array[:] = -down
    problem.solve()
    assert contact.pressure == pytest.approx(4 * G * down / 2, rel=1e-9)
    assert w.sub(1).collapse().x.array == pytest.approx(-G * down, rel=1e-9)
    contact.friction = 0.3
    (moved, way), (foot, _) = held(W, top), held(W, bottom)
    problem.bcs = [moved, foot]
    for slid in (0.0, 0.2, 0.3):
        way.interpolate(lambda x, slid=slid: np.array([0 * x[0] + slid, 0 * x[0] - down]))
        step = problem.solve()
    done = COMM.allreduce(contact.dissipation.sum())
    assert step.counts.slip > 0 and done > 0.0
    assert contact.worn_volume() == pytest.approx([1e-6 * done, 3e-6 * done], rel=1e-12)


@pytest.mark.parametrize("cell, degree", [("quadrilateral", 1), ("triangle", 2), *slow])
def test_even_wear_is_even_on_the_other_side(cell, degree):
    """An even depth of the one side, covered wholly, is an even depth of the other one, and opens gaps by itself."""
    flat = len(CELLS[cell][0]) == 2
    scene = blocks(cell, degree, ((4, 2), (7, 2)) if flat else ((2, 2, 1), (3, 3, 1)), mu=0.0)
    scene.way.value[-1] = -0.001
    scene.problem.solve()
    contact, geometry = scene.contact, scene.contact.geometry
    history = contact.history
    worn = 0.25 * contact.whole_area
    taken = geometry.taken(worn, contact.opposite_area, history.frames, history)
    assert taken == pytest.approx(0.25, rel=1e-10)
    worn = geometry.on_all_ranks(taken)
    assert geometry.opened(contact.points, worn) == pytest.approx(0.25, rel=1e-10)


def test_a_worn_track_stays_with_its_body():
    """Wear of the lower body alone: of a block that is put elsewhere gaps open by what is worn there, which is nothing."""
    scene, _ = rubbed("quadrilateral", 1, far=0.4, size=(0.6, 3.0), cells=((3, 2), (30, 2)))
    contact = scene.contact
    own = contact.wear_depth.copy()
    assert largest(contact.opening - own) > 0.1 * largest(own)
    for way in ((0.4, 0.1), (1.15, 0.1), (1.15, -1e-4)):
        scene.way.value[:] = way
        scene.problem.solve()
    assert largest(contact.opening - contact.wear_depth) <= 1e-6 * largest(own)
    assert largest(contact.opposite_wear_depth) > 0.1 * largest(own)
    both = contact.wear_function().x.array
    assert largest(both) == max(largest(contact.wear_depth), largest(contact.opposite_wear_depth))


def test_sides_swapped_lose_the_same():
    """Each body loses what it does as the other side: volumes differ as the work does, by the error of the mesh."""
    found = [rubbed("quadrilateral", 1, 8, swapped, size=(1.0, 1.0), far=0.1)[0].contact.worn_volume() for swapped in (False, True)]  # fmt: skip
    assert found[0] == pytest.approx(found[1][::-1], rel=0.02)


def test_histories(tmp_path):
    """Depths of both sides are saved, loaded and taken back with the others, and a cycle that counts twice wears twice."""
    whole, parted = (rubbed("quadrilateral", 1, 1)[0] for _ in range(2))
    file = COMM.bcast(str(tmp_path / "state.npz"))
    for way in (0.5, 0.2):
        for scene in (whole, parted):
            scene.way.value[0] = way
            scene.problem.solve()
    before = parted.contact.opposite_wear_depth
    parted.problem.rewind()
    assert largest(parted.contact.opposite_wear_depth - before) > 0.0
    parted.problem.solve()
    parted.problem.save(file)
    parted.problem.reset()
    assert not largest(parted.contact.opposite_wear_depth)
    parted.problem.load(file)
    for scene in (whole, parted):
        scene.way.value[0] = 0.6
        scene.contact.repeats = 2
        scene.problem.solve()
    for name in ("wear_depth", "opposite_wear_depth", "opening", "reaction"):
        one, other = (getattr(scene.contact, name) for scene in (whole, parted))
        assert largest(one - other) <= (0.0 if COMM.size == 1 else 1e-9 * largest(one)), name


@pytest.mark.parametrize("change", ["left out", "negative", "cut", "NaN"])
def test_a_checkpoint_with_other_depths_of_the_other_side_is_refused(change, tmp_path):
    """Depths of the other body that are not there, or that no step leaves: a ValueError on all ranks that names them, and nothing changes."""
    scene, _ = rubbed("quadrilateral", 1)
    file = COMM.bcast(str(tmp_path / "state.npz"))
    scene.problem.save(file)
    COMM.barrier()
    if COMM.rank == 0:
        with np.load(file) as saved:
            arrays = dict(saved)
        worn = arrays.pop("0_worn")
        others = dict(negative=-1e-9 - worn, cut=worn[1:], NaN=np.full_like(worn, np.nan))
        np.savez(file, **arrays, **({"0_worn": others[change]} if change in others else {}))
    COMM.barrier()
    before = scene.contact.worn_volume()
    with pytest.raises(ValueError, match="0_worn"):
        scene.problem.load(file)
    assert scene.contact.worn_volume() == before


def test_rigid_surfaces_do_not_wear():
    """A coefficient of the other side is refused where that is rigid, and a negative one everywhere."""
    scene = blocks("quadrilateral", 1, ((2, 2), (3, 2)))
    plane = dc.RigidPlane((0, -1), (0, 1))
    with pytest.raises(ValueError, match="does not wear"):
        dc.Contact(scene.V, scene.ends[1], plane, 0.3, wear=dc.Wear(1e-6, opposite=1e-6))
    with pytest.raises(ValueError, match="wear coefficient"):
        dc.Wear(1e-6, opposite=-1.0)
