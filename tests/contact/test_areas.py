# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Areas: pressures, worn depths and friction that follows the pressure are those of the surface that touches."""

import warnings

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from scenes import elasticity

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace

COMM = MPI.COMM_WORLD
pytestmark = pytest.mark.ranks
E, NU = 210e3, 0.3


def boundary(body, where):
    return mesh.locate_entities_boundary(body, body.topology.dim - 1, where)


def cube(order=1, simplex=False, whole=False, friction=None, wear=None, surface=None):
    """A unit cube of modulus 1000 whose head is held, its contact of the foot, or of all faces but the head."""
    kind = mesh.CellType.tetrahedron if simplex else mesh.CellType.hexahedron
    body = mesh.create_box(COMM, [[0, 0, 0], [1, 1, 1]], [3, 3, 3], kind)
    V = functionspace(body, ("Lagrange", order, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = elasticity(u, v, 1000.0, 0.0)
    held = fem.Constant(body, np.zeros(3))
    head = boundary(body, lambda x: np.isclose(x[2], 1))
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, head), V)

    def given(x):
        low = x[2] < 0.7  # the upper third is held
        sides = np.isclose(np.abs(x[:2] - 0.5).max(axis=0), 0.5)
        return np.isclose(x[2], 0) | (whole & sides & low)

    surface = surface or dc.RigidPlane((0, 0, 0), (0, 0, 1))
    contact = dc.Contact(V, boundary(body, given), surface, friction or dc.Friction(0.3), wear=wear)
    return dc.ContactProblem(F, u, [contact], bcs=[bc]), contact, held


@pytest.mark.parametrize("order, simplex", [(1, False), (1, True), (2, False), (2, True)])
def test_facets_that_cannot_touch_have_no_part_in_pressures(order, simplex):
    """Foot alone, or with the sides: the same pressures, friction that follows them, and wear."""
    found = []
    for whole in (False, True):
        friction = dc.Friction(lambda x, pressure: 0.3 / (1 + pressure / 5))
        problem, contact, held = cube(order, simplex, whole, friction, dc.Wear(1e-4))
        held.value = (0, 0, -0.01)
        problem.solve()
        foot = np.isclose(contact.x[:, 2], 0)
        pressure = contact.pressure[foot]
        assert np.isfinite(contact.pressure).all() and not contact.pressure[~foot].any()
        held.value = (0.5, 0, -0.01)
        problem.solve()
        sums = (
            contact.wear_depth[foot].sum(),
            contact.pressure[foot].sum(),
            contact.area[foot].sum(),
        )
        assert not contact.wear_depth[~foot].any()
        found.append([*contact.force(), *COMM.allreduce(np.array([pressure.sum(), *sums]))])
    assert found[1] == pytest.approx(found[0], rel=1e-7, abs=1e-7)
    assert found[1][-1] == pytest.approx(1.0, rel=1e-12)


def test_a_slanted_foot_counts_as_the_plane_sees_it():
    """A wedge on a plane along its slanted face, tilted by 30 degrees: projected areas make an even pressure even."""
    body = mesh.create_rectangle(COMM, [[0, 0], [1, 1]], [6, 6], mesh.CellType.quadrilateral)
    body.geometry.x[:, 1] += 0.1 * body.geometry.x[:, 0] * (1 - body.geometry.x[:, 1])
    V = functionspace(body, ("Lagrange", 1, (2,)))
    foot = boundary(body, lambda x: np.isclose(x[1], 0.1 * x[0]))
    contact = dc.Contact(V, foot, dc.RigidPlane((0, 0), (0, 1)), dc.Friction(0.0))
    assert COMM.allreduce(contact.area.sum()) == pytest.approx(1.0, rel=1e-12)  # not sqrt(1.01)


@pytest.mark.parametrize("whole", [False, True])
def test_sides_do_not_count_on_a_ball_either(whole):
    """A flat foot on a ball, with and without the sides: the same areas, the whole foot."""
    _, contact, _ = cube(whole=whole, surface=dc.RigidSphere((0.5, 0.5, -0.4), 0.4))
    assert COMM.allreduce(contact.area.sum()) == pytest.approx(1.0, rel=1e-12)


def ring(order, weight=None, closed=True, **options):
    """A ring 20 < r < 30 in the plane (r, z), pressed outwards at its bore by a plane that expands; ends ``closed``, or held outside."""
    body = mesh.create_rectangle(
        COMM, [[20.0, 0.0], [30.0, 4.0]], [16, 3], mesh.CellType.quadrilateral
    )
    V = functionspace(body, ("Lagrange", order, (2,)))
    u, v, r = fem.Function(V), ufl.TestFunction(V), ufl.SpatialCoordinate(body)[0]

    def strain(w):
        g = ufl.sym(ufl.grad(w))
        return ufl.as_tensor([[g[0, 0], g[0, 1], 0], [g[0, 1], g[1, 1], 0], [0, 0, w[0] / r]])

    volume = NU / (1 - 2 * NU) * ufl.tr(strain(u)) * ufl.tr(strain(v))
    F = E / (1 + NU) * (ufl.inner(strain(u), strain(v)) + volume) * 2 * np.pi * r * ufl.dx
    ends = boundary(
        body,
        lambda x: np.isclose(x[1], 0) | np.isclose(x[1], 4) if closed else np.isclose(x[0], 30),
    )
    bc = fem.dirichletbc(
        fem.Constant(body, 0.0), fem.locate_dofs_topological(V.sub(1), 1, ends), V.sub(1)
    )
    bore = boundary(body, lambda x: np.isclose(x[0], 20))
    weight = {"ufl": 2 * np.pi * r, "callable": lambda x: 2 * np.pi * x[0], None: None}[weight]
    contact = dc.Contact(
        V, bore, dc.RigidPlane((20, 0), (1, 0)), dc.Friction(0.1), weight=weight, **options
    )
    return contact, dc.ContactProblem, (F, u, [contact]), dict(bcs=[bc])


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("weight", ["ufl", "callable"])
def test_an_expanded_ring_has_the_pressure_of_lame(order, weight):
    """A ring in plane strain along its axis, expanded at the bore: Lame's pressure, Archard's depth, 2 pi r h p in all."""
    contact, make, given, options = ring(order, weight, wear=dc.Wear(1e-9))
    problem = make(*given, **options)
    a, b, way = 20.0, 30.0, 0.0025
    G, lame = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))
    # u = A r + B / r with no traction at b; pressure at a
    ratio = 2 * (G + lame) * b**2 / (2 * G)  # B / A
    A = way / (a + ratio / a)
    p = 2 * G * A * ratio / a**2 - 2 * (G + lame) * A
    contact.surface.displacement = (way, 0)
    problem.solve()
    assert contact.pressure == pytest.approx(
        np.full(contact.nodes.size, p), rel=0.02 if order == 1 else 1e-3
    )
    assert contact.force()[0] == pytest.approx(p * 2 * np.pi * a * 4, rel=2e-3)
    pressed = contact.pressure
    contact.surface.displacement = (way, -1.0)
    problem.solve()
    assert contact.force()[1] == pytest.approx(-0.1 * contact.force()[0], rel=1e-8)
    mean = (pressed + contact.pressure) / 2  # of both ends of the step, as its work is taken
    assert contact.wear_depth == pytest.approx(1e-9 * 0.1 * mean, rel=1e-3)


def test_areas_without_a_weight_are_warned_of():
    """A form times r without a weight; silent with one, and where r is in a load or a modulus alone."""
    _, make, given, options = ring(1)
    with pytest.warns(UserWarning, match="no weight"):
        make(*given, **options)
    _, make, given, options = ring(1, "ufl")
    make(*given, **options)


def test_a_weight_without_the_2_pi_of_the_form_is_told():
    """The weight r beside a form times 2 pi r, in a sum or not, and the other way round, and 2 pi without r; silent with a modulus or a thickness before both."""
    body = mesh.create_rectangle(COMM, [[1, 0], [2, 1]], [2, 2], mesh.CellType.quadrilateral)
    V = functionspace(body, ("Lagrange", 1, (2,)))
    u, v, r = fem.Function(V), ufl.TestFunction(V), ufl.SpatialCoordinate(body)[0]
    foot, head = (boundary(body, lambda x, y=y: np.isclose(x[1], y)) for y in (0, 1))
    bc = fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, head), V)
    energy, turn = ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))), 2 * np.pi
    for integrand, weight, told in (
        (energy * 2 * np.pi * r, r, True),
        (turn * (energy * r - v[1] * r), r, False),  # hidden: nothing is claimed
        (energy * turn * r - v[1] * turn * r, lambda x: 3 * x[0], False),
        (energy * turn * r - v[1] * turn * r, r, True),
        (energy * r, turn * r, True),
        (210e3 * energy * r, turn * r, False),
        (energy * turn * r, turn * r, False),
        (energy * turn * r, turn, "or 2 pi alone"),
        (energy * turn * r, lambda x: turn + 0 * x[0], "or 2 pi alone"),
        (energy * r, 3.0, False),  # a thickness beside a modulus
    ):
        contact = dc.Contact(V, foot, dc.RigidPlane((0, 0), (0, 1)), 0.3, weight=weight)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            dc.ContactProblem(integrand * ufl.dx, u, [contact], bcs=[bc])
        message = told if isinstance(told, str) else "only one of them by 2 pi"
        said = [str(w.message) for w in said if w.category is UserWarning]
        assert [message in one for one in said] == [True] * bool(told)


@pytest.mark.parametrize("wrong", ["turned", "free to turn", "driven along r"])
def test_motions_that_no_body_of_revolution_makes_are_refused(wrong):
    """Rotations in the plane and forces along the radius have no meaning with axial symmetry; axial forces have."""
    contact, make, given, options = ring(1, "callable", closed=False)
    problem, plane = make(*given, **options), contact.surface
    if wrong == "turned":
        plane.rotation = 0.01
    elif wrong == "free to turn":
        plane.free, plane.moment = ("r",), 1.0
    else:
        plane.free, plane.force = ("n",), (100.0, 0)
    with pytest.raises(ValueError, match="bodies are those of revolution"):
        problem.solve()
    plane.rotation, plane.free, plane.force = 0.0, (), None
    plane.displacement = (0.0025, 0)
    problem.solve()
    plane.free, plane.force = ("t",), (0, 1.0)
    problem.solve()
    assert contact.force()[1] == pytest.approx(1.0, rel=1e-8)


def test_a_thickness_is_no_axial_symmetry():
    """Plane strain of thickness t: forces t times as large, the same pressures; the surface may turn."""
    forces = []
    for t in (1.0, 3.0):
        body = mesh.create_unit_square(COMM, 4, 4, mesh.CellType.quadrilateral)
        V = functionspace(body, ("Lagrange", 1, (2,)))
        u, v = fem.Function(V), ufl.TestFunction(V)
        F = t * 1000 * ufl.inner(ufl.sym(ufl.grad(u)), ufl.grad(v)) * ufl.dx
        foot, head = (boundary(body, lambda x, z=z: np.isclose(x[1], z)) for z in (0, 1))
        held = fem.Constant(body, np.array([0.0, -0.01]))
        bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, 1, head), V)
        contact = dc.Contact(V, foot, dc.RigidPlane((0, 0), (0, 1)), dc.Friction(0.3), weight=t)
        problem = dc.ContactProblem(F, u, [contact], bcs=[bc])
        problem.solve()
        contact.surface.rotation = 1e-4
        problem.solve()
        mean = COMM.allreduce(contact.pressure @ contact.area) / COMM.allreduce(contact.area.sum())
        forces.append([contact.force()[1] / t, mean])
    assert forces[1] == pytest.approx(forces[0], rel=1e-9)


def test_the_axis_carries_nothing_in_second_order():
    """A disc on a plane: second-order nodes on the axis have no area and are left out; an even pressure stays even."""
    body = mesh.create_rectangle(
        COMM, [[0.0, 0.0], [1.0, 1.0]], [4, 4], mesh.CellType.quadrilateral
    )
    V = functionspace(body, ("Lagrange", 2, (2,)))
    foot = boundary(body, lambda x: np.isclose(x[1], 0))
    r = ufl.SpatialCoordinate(body)[0]
    contact = dc.Contact(
        V, foot, dc.RigidPlane((0, 0), (0, 1)), dc.Friction(0.0), weight=2 * ufl.pi * r
    )
    assert COMM.allreduce(contact.nodes.size) == 8
    assert contact.x[:, 0].min(initial=1.0) > 0.1
    assert COMM.allreduce(contact.area.sum()) == pytest.approx(np.pi, rel=1e-12)


@pytest.mark.parametrize(
    "wrong", [-1.0, np.ones(3), "2 pi r", lambda x: x[0] - 0.5, lambda x: np.nan * x[0]]
)
def test_weights_that_are_not_positive_are_refused(wrong):
    """A measure below zero, or none at all, or what is no measure."""
    body = mesh.create_unit_square(COMM, 4, 4, mesh.CellType.quadrilateral)
    V = functionspace(body, ("Lagrange", 1, (2,)))
    foot = boundary(body, lambda x: np.isclose(x[1], 0))
    with pytest.raises(ValueError, match="weight"):
        dc.Contact(V, foot, dc.RigidPlane((0, 0), (0, 1)), dc.Friction(0.0), weight=wrong).area  # noqa: B018


HALVES = [("default", 2, 1), ("fixed point", 2, 1), ("sparse", 2, 1), ("condensed", 3, 1), ("default", 2, 2), ("fixed point", 3, 1)]  # fmt: skip


@pytest.mark.parametrize("solver, dim, order", HALVES)
def test_two_contacts_on_one_face_are_one_with_the_mean_at_their_edge(solver, dim, order):
    """A face in two parts of different friction: forces are those of one contact whose edge nodes have the mean by area."""
    solver = {"default": None, "fixed point": dc.FixedPoint(), "condensed": dc.CondensedNewton(), "sparse": dc.SparseNewton()}[solver]  # fmt: skip
    cut, laws, found = 0.4, (0.3, 0.1), []
    if dim == 2:
        body = mesh.create_rectangle(COMM, [[0, 0], [1, 1]], [5, 4], mesh.CellType.quadrilateral)
    else:
        body = mesh.create_box(COMM, [[0, 0, 0], [1, 1, 1]], [5, 2, 2], mesh.CellType.hexahedron)
    V = functionspace(body, ("Lagrange", order, (dim,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = elasticity(u, v, 1000.0, 0.0)
    head = boundary(body, lambda x: np.isclose(x[dim - 1], 1))
    held = fem.Constant(body, np.zeros(dim))
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, dim - 1, head), V)
    plane = dc.RigidPlane(np.zeros(dim), np.eye(dim)[-1])
    foot = lambda low, high: boundary(  # noqa: E731
        body, lambda x: np.isclose(x[dim - 1], 0) & (x[0] > low - 1e-9) & (x[0] < high + 1e-9)
    )

    def mean(x):
        return np.where(np.isclose(x[0], cut), np.mean(laws), np.where(x[0] < cut, *laws))

    for apart in (True, False):
        if apart:
            parts = ((0, cut), (cut, 1))
            contacts = [dc.Contact(V, foot(*ends), plane, mu) for ends, mu in zip(parts, laws)]
        else:
            contacts = [dc.Contact(V, foot(0, 1), plane, dc.Friction(mean))]
        u.x.array[:] = 0.0  # no guess from the other one
        problem = dc.ContactProblem(F, u, contacts, bcs=[bc], solver=solver)
        for way in (0.0, 0.002, 0.5, 0.45):
            held.value = (way, *np.zeros(dim - 2), -0.01)
            problem.solve()
            found.append([contact.force() for contact in contacts])
    for apart, whole in zip(found[:4], found[4:]):
        assert sum(apart) == pytest.approx(whole[0], rel=1e-6, abs=1e-6)
    (friction, *_, normal), (other, *_, rest) = found[2]  # all slides
    assert (-friction, -other) == pytest.approx((0.3 * normal, 0.1 * rest), rel=1e-6)


@pytest.mark.parametrize("kind", ["plane", "ball"])
def test_a_surface_that_was_turned_into_place_sees_the_same_areas(kind):
    """A plane made upright and laid down, a ball upside down: areas, pressures and worn depths as of one made in place."""
    found = []
    for turned in (False, True):
        if kind == "plane":
            surface = dc.RigidPlane((0, 0, 0), (1, 0, 0) if turned else (0, 0, 1), (0, 1, 0))
            angle = (0, -np.pi / 2, 0)
        else:
            surface = dc.RigidSphere((0.5, 0.5, -30), 30.0)
            angle = (np.pi, 0, 0)
        if turned:
            surface.rotation = angle
        problem, contact, held = cube(surface=surface, wear=dc.Wear(1e-4))
        for way in (0.0, 0.1):
            held.value = (0, way, -0.01)
            problem.solve()
        sums = contact.area.sum(), contact.pressure.sum(), contact.wear_depth.sum()
        found.append(COMM.allreduce(np.array(sums)))
    assert (found[0] > 0.0).all()
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def test_a_plane_that_tilts_sees_less_of_a_face():
    """By 0.3 radians after areas were asked for: the cosine of it is left."""
    problem, contact, held = cube()
    held.value = (0, 0, 0.2)
    problem.solve()
    before = COMM.allreduce(contact.area.sum())
    contact.surface.rotation = (0, 0.3, 0)
    problem.solve()
    assert COMM.allreduce(contact.area.sum()) == pytest.approx(before * np.cos(0.3), rel=1e-9)


def test_areas_turn_with_the_body():
    """A rubber block and its plane turned together by a right angle: areas, pressures and worn depths are those of before."""
    body = mesh.create_rectangle(COMM, [[0, 0], [1, 1]], [3, 2], mesh.CellType.quadrilateral)
    V = functionspace(body, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    log = ufl.ln(ufl.det(ufl.Identity(2) + ufl.grad(u)))
    G = ufl.Identity(2) + ufl.grad(u)
    energy = 100 * (ufl.tr(G.T * G) - 2 - 2 * log) + 100 * log**2
    head, foot = (boundary(body, lambda x, at=at: np.isclose(x[1], at)) for at in (1, 0))
    way = fem.Function(V)
    bc = fem.dirichletbc(way, fem.locate_dofs_topological(V, 1, head))
    plane = dc.RigidPlane((0, 0), (0, 1))
    contact = dc.Contact(V, foot, plane, dc.Friction(0.3), wear=dc.Wear(1e-4, explicit=True))
    problem = dc.ContactProblem(ufl.derivative(energy * ufl.dx, u, v), u, [contact], bcs=[bc])
    x = V.tabulate_dof_coordinates()[:, :2]

    def put(angle, slid):
        c, s = np.cos(angle), np.sin(angle)
        plane.rotation = angle
        way.x.array[:] = ((x + (slid, -0.02)) @ np.array([[c, s], [-s, c]]) - x).ravel()
        problem.solve()

    put(0.0, 0.0)
    put(0.0, 0.1)
    pressure = contact.pressure.copy()
    for angle in np.linspace(0.0, np.pi / 2, 7)[1:]:
        put(angle, 0.1)
    assert COMM.allreduce(contact.area.sum()) == pytest.approx(1.0, rel=1e-9)
    assert contact.pressure == pytest.approx(pressure, rel=5e-3)
    worn, work = contact.wear_depth.copy(), contact.dissipation.copy()
    put(np.pi / 2, 0.2)
    area = contact.area
    assert contact.wear_depth - worn == pytest.approx(1e-4 * (contact.dissipation - work) / area)


def test_the_axis_has_the_pressure_of_its_neighbours():
    """A cylinder of second order squeezed evenly: in a profile from the axis outwards the pressure is even, though the axis is no contact node."""
    body = mesh.create_rectangle(COMM, [[0, 0], [10, 10]], [5, 5], mesh.CellType.quadrilateral)
    V = functionspace(body, ("Lagrange", 2, (2,)))
    u, v, r = fem.Function(V), ufl.TestFunction(V), ufl.SpatialCoordinate(body)[0]

    def strain(w):
        g = ufl.sym(ufl.grad(w))
        return ufl.as_tensor([[g[0, 0], g[0, 1], 0], [g[0, 1], g[1, 1], 0], [0, 0, w[0] / r]])

    F = 1000 * ufl.inner(strain(u), strain(v)) * 2 * np.pi * r * ufl.dx
    foot, head, axis = (boundary(body, lambda x, i=i, at=at: np.isclose(x[i], at)) for i, at in ((1, 0), (1, 10), (0, 0)))  # fmt: skip
    bcs = [
        fem.dirichletbc(value, fem.locate_dofs_topological(V.sub(i), 1, facets), V.sub(i))
        for i, facets, value in ((1, head, -0.01), (0, axis, 0.0))
    ]
    plane = dc.RigidPlane((0, 0), (0, 1))
    contact = dc.Contact(V, foot, plane, dc.Friction(0.0), weight=2 * np.pi * r)
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs)
    problem.solve()
    line = np.column_stack((np.linspace(0, 10, 21), np.zeros(21)))
    assert dc.profile(problem, line)["pressure"] == pytest.approx(1.0, rel=1e-8)
