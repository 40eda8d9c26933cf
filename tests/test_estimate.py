"""The estimate of the discretisation's error against closed forms: even stress, a column under its weight, a ball of Hertz."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import ufl
from demo_hertz import FORCE, NU, A, E, far_field
from dolfinx import fem, mesh
from helpers import hooke, rounded_body
from patches import CELLS, box
from scenes import COMM, elasticity

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
    return dc.ContactProblem(F, u, contact, bcs, tol=1e-10)


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


def ball(domain, face, far, order) -> dc.ContactProblem:
    """The ball of demo_hertz, far boundary as in the closed form."""
    V = functionspace(domain, ("Lagrange", order, (2,)))
    u, v, r = fem.Function(V), ufl.TestFunction(V), ufl.SpatialCoordinate(domain)[0]

    def strain(w):
        rr, rz, zz = w[0].dx(0), (w[0].dx(1) + w[1].dx(0)) / 2, w[1].dx(1)
        return ufl.as_matrix([[rr, rz, 0], [rz, zz, 0], [0, 0, w[0] / r]])

    dx = ufl.dx(metadata={"quadrature_degree": 2 * order + 1})
    F = 2 * np.pi * r * ufl.inner(hooke(strain(u), E, NU), strain(v)) * dx
    held, radial = fem.Function(V), V.sub(0)
    held.interpolate(lambda x: far_field(x, FORCE))
    axis = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[0], 0.0))
    bcs = [
        fem.dirichletbc(held, fem.locate_dofs_topological(V, 1, far)),
        fem.dirichletbc(
            fem.Constant(domain, 0.0), fem.locate_dofs_topological(radial, 1, axis), radial
        ),
    ]
    contact = dc.Contact(V, face, dc.RigidPlane((0, 0), (0, 1)), dc.Friction(0.0))
    return dc.ContactProblem(F, u, contact, bcs, tol=1e-10)


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
    with pytest.raises(ValueError, match="'nothing' must be a finite number"):
        dc.estimate(problem, reference, {"nothing": lambda p: np.nan})
    other = pressed_box(*box("triangle"), 1)  # of another mesh: quantities alone
    assert dc.estimate(problem, other).cells is None and COMM.size > 0
