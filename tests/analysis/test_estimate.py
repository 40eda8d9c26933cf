# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The estimate of the discretisation's error against closed forms: even stress, a column under its weight, Hertz, partial slip."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import demo_ball_on_flat as ball_on_flat
import numpy as np
import pytest
import ufl
from demo_hertz import FORCE, A, ball
from dolfinx import fem
from helpers import rounded_body
from patches import CELLS, box
from scenes import COMM, elasticity

from benchmarks.effectivity import ROUGH, hertz, partial_slip
from dolfinx_contact.compat import functionspace


def pressed_box(domain, bottom, top, order, weight=0.0, mu=0.0):
    """The unit square or cube between a plane and a plate that goes 1e-3 down; Young's modulus 1, no Poisson's effect."""
    d = domain.geometry.dim
    V = functionspace(domain, ("Lagrange", order, (d,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = elasticity(u, v, 1.0, 0.0) + fem.Constant(domain, weight) * v[d - 1] * ufl.dx
    held = fem.Constant(domain, np.array([*np.zeros(d - 1), -1e-3]))
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, d - 1, top), V)]
    plane = dc.RigidPlane(np.zeros(d), np.eye(d)[-1])
    contact = dc.Contact(V, bottom, plane, dc.Friction(mu))
    return dc.ContactProblem(F, u, contact, bcs=bcs, tol=1e-10)


@pytest.mark.parametrize(
    "cell",
    [
        "triangle",
        "quadrilateral",
        *(pytest.param(c, marks=pytest.mark.slow) for c in ("tetrahedron", "hexahedron")),
    ],
)
def test_an_even_stress_has_no_error(cell):
    """What both spaces contain is estimated at rounding, in forces, in the energy norm and on every cell."""
    scene = box(cell)
    problem, reference = (pressed_box(*scene, order, mu=0.3) for order in (1, 2))
    problem.solve(), reference.solve()
    found = dc.estimate(problem, reference)
    assert found["normal_force"].value == pytest.approx(1e-3, rel=1e-8)
    assert found["normal_force"].relative < 1e-8 and found["tangential_force"].error < 1e-12
    assert found["dissipation"].error < 1e-12 and found["peak_pressure"].relative < 1e-7
    assert found.energy_norm < 1e-7
    assert found["pressure"].relative < 1e-7 and found["shear"].error < 1e-12
    assert np.max(found.cells.x.array, initial=0) < 1e-10


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "hexahedron"])
def test_a_column_under_its_weight(cell):
    """The stress is linear over the height; on cells of height h and volume V first order misses the energy (rho g)^2 h^2 V / 12 / E."""
    kind, cells = CELLS[cell]
    scene = box(cell, distorted=False)
    problem, reference = (pressed_box(*scene, order, weight=1e-4) for order in (1, 2))
    problem.solve(), reference.solve()
    found = dc.estimate(problem, reference)
    height, volume = 1 / cells[-1], 1 / np.prod(cells)
    exact = 1e-4 * np.sqrt(height**2 / 12)  # of the whole body of volume 1
    energy = np.sqrt(1e-3**2 + 1e-4**2 / 12)  # of e' = e0 + g y about the middle
    own = found.cells.function_space.dofmap.index_map.size_local
    volume /= 2 if cell == "triangle" else 1
    assert found.energy_norm * energy == pytest.approx(exact, rel=1e-6)
    assert found.cells.x.array[:own] == pytest.approx(exact * np.sqrt(volume), rel=1e-6)
    assert found["normal_force"].error < 1e-10  # of nodes that are exact
    assert found["normal_force"].value == pytest.approx(1e-3 + 0.5e-4, rel=1e-8)


@pytest.mark.parametrize("cells", [8, 16])
def test_the_force_of_hertz(cells):
    """The estimated error of the force lies between half and three times the true one, and cells far away have none of it."""
    scene = rounded_body(1000.0, A, 16 * A, cells, half=True, order=2)
    problem, reference = (ball(*scene, order) for order in (1, 2))
    problem.solve(), reference.solve()
    found = dc.estimate(problem, reference)
    force = found["normal_force"]
    assert 0.5 < force.error / abs(force.value - FORCE) < 3
    doubled = dc.estimate(
        problem, reference, {"twice": lambda p: 2 * p.contacts[0].force()[1]}, share=0.5
    )
    assert doubled["twice"].error == pytest.approx(force.error)  # its share is half
    assert doubled.energy_norm == pytest.approx(found.energy_norm / 2)


@pytest.mark.parametrize("other", [False, True])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_norms_of_tractions(cell, other):
    """Pressures 1 + x and 1 + 2x differ by x, whose mean square on 0 < x < 1 is 1/3; shears 1 - x and 2 - x by 1; on one mesh or two."""
    scene = box(cell)
    scenes = [scene, box(cell, distorted=False) if other else scene]
    pair = problem, reference = [pressed_box(*of, order) for of, order in zip(scenes, (1, 2))]
    for of, slope in zip(pair, (1, 2)):
        contact = of.contacts[0]
        x = contact.x[:, 0]
        tractions = np.zeros(contact.reaction.shape)
        tractions[:, -1], tractions[:, 0] = 1 + slope * x, slope - x
        reaction = contact.area[:, None] * tractions
        contact.present = contact.present._replace(reaction=reaction)
    found = dc.estimate(problem, reference, share=2.0)
    assert found["pressure"] == pytest.approx((np.sqrt(7 / 3), 2 * np.sqrt(1 / 3)))
    assert found["shear"] == pytest.approx((np.sqrt(1 / 3), 2.0))


def test_curved_surfaces_on_two_meshes():
    """Between meshes tractions are compared on planes alone; on one mesh everywhere."""
    scenes = [ball_on_flat.scene(cells) for cells in (4, 6)]
    problem = ball_on_flat.ball_on_flat(*scenes[0])[0]
    for scene, known in zip(scenes, (True, False)):
        found = dc.estimate(problem, ball_on_flat.ball_on_flat(*scene, order=2)[0])
        assert ("pressure" in found.quantities) == known


def test_hertz_in_two_dimensions():
    """Errors of force and pressure are estimated between half and three times those against the closed form."""
    for rows in hertz(8).values():
        assert 0.5 < rows["normal_force"]["effectivity"] < 3
        assert 0.5 < rows["pressure"]["effectivity"] < 3


@pytest.mark.parametrize("edge", [0.92, 0.84])
def test_hertz_with_the_edge_within_a_cell(edge):
    """There the pressure of second order on the same cells is hardly better; on half of them it estimates the error of first order well."""
    rows = hertz(8, edge)
    assert 0.7 < rows["half cells"]["pressure"]["effectivity"] < 1.5


@pytest.mark.slow
def test_cattaneo_and_mindlin():
    """In partial slip and after it has turned round so are those of shear, tangential force and work, at each state and along the programme."""
    states = partial_slip(8, names=["same cells"])
    for name, rows in states.items():
        for key in {
            "pressure",
            "shear",
            "tangential_resultant",
            "dissipation",
            "resultant",
            "work",
        } & set(rows):
            assert 0.5 < rows[key]["effectivity"] < 3, (name, key)


def test_the_closed_form_of_partial_slip():
    """The field for the far boundary closes the gap, keeps the inner part stuck after a turn, slips as the surface's formula says."""
    parts = ROUGH.sheared(-0.2, turned=0.6)
    x = np.linspace(-2, 2, 41) * ROUGH.a
    u = ROUGH.displacement(np.array([x, 0 * x + 1e-9 * ROUGH.a]), parts, points=4000)
    scale, inside = ROUGH.a**2 / ROUGH.radius, np.abs(x) < 0.95 * ROUGH.a
    gap = x**2 / (2 * ROUGH.radius) + u[1]
    # pressure moves the surface sideways, shear lifts it: as 1 - 2 nu over 2 - 2 nu
    assert np.abs(gap[inside]).max() < 5e-3 * scale and (gap > -5e-3 * scale).all()
    assert np.abs(u[0] - ROUGH.slipped(x, parts)).max() < 5e-3 * scale
    s = np.linspace(-1, 1, 20_001) * ROUGH.a
    force = ROUGH.shear(s, parts).sum() * (s[1] - s[0])
    assert force == pytest.approx(-0.2 * ROUGH.mu * ROUGH.force, rel=1e-3)
    assert (np.abs(ROUGH.shear(s, parts)) <= ROUGH.mu * ROUGH.pressure(s) * (1 + 1e-9)).all()


def test_several_numbers():
    """The error of a list of numbers is the largest of theirs, beside the largest number; lists must be as long."""
    scene = box("triangle")
    problem, reference = (pressed_box(*scene, order) for order in (1, 2))
    lists = {problem: [1.0, -5.0, 2.0], reference: [1.5, -4.9, 2.0]}
    assert dc.estimate(problem, reference, {"loop": lists.get})["loop"] == (-5.0, 0.5)
    lists[reference].append(1.0)
    with pytest.raises(ValueError, match="3 numbers of the problem, 4 of the reference"):
        dc.estimate(problem, reference, {"loop": lists.get})


def test_pairs_that_do_not_belong_together():
    """The order of the two, their contacts and quantities are checked on all ranks."""
    scene = box("triangle")
    problem, reference = (pressed_box(*scene, order) for order in (1, 2))
    with pytest.raises(ValueError, match="got degrees 2 and 1"):
        dc.estimate(reference, problem)
    with pytest.raises(ValueError, match="another ContactProblem"):
        dc.estimate(problem, problem)
    with pytest.raises(ValueError, match="share must be a positive"):
        dc.estimate(problem, reference, share=0)
    with pytest.raises(ValueError, match="'nothing' must be finite"):
        dc.estimate(problem, reference, {"nothing": lambda p: np.nan})
    domain, bottom, top = scene
    turned = pressed_box(domain, top, bottom, 2)
    with pytest.raises(ValueError, match="must have the same facets"):
        dc.estimate(problem, turned)
    other = pressed_box(*box("triangle"), 1)  # of another mesh: quantities alone
    assert dc.estimate(problem, other).cells is None and COMM.size > 0
