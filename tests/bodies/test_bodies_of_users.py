# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Bodies as users bring them: rings, nearly incompressible rubber, misfit, two bodies in a mesh, hysteresis, forms that are NaN."""

import nonlinear_scenes as scenes
import numpy as np
import pytest
import ufl
from nonlinear_scenes import HEIGHT, MEASURE, MPI, block, move
from ring_scenes import DEEP, bend, between_planes, clamp, clamped_middle, half_ring

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh

from dolfinx_contact.bodies.elastic import ElasticBody
from dolfinx_contact.compat import (
    assemble_into,
    cell_dofs,
    cell_values,
    functionspace,
    interpolation_points,
)
from mechanics.material import elasticity

COMM = MPI.COMM_WORLD


def total(form) -> float:
    return COMM.allreduce(fem.assemble_scalar(fem.form(form)))


def ring(gdim, mu=0.0, plane_strain=False, degree=1, cells=(3, 14), stored=None, tol=1e-10):
    """Half a thick ring (x > 0) between two planes that come down from above and up from below."""
    domain, sides = half_ring(gdim, cells, curved=degree == 2)
    V = functionspace(domain, ("Lagrange", degree, (gdim,)))
    bcs = clamped_middle(V)
    if gdim == 3:
        ends = (0.0, 1.0) if plane_strain else (0.0,)
        bcs += [clamp(V, 2, lambda x, z=z: np.isclose(x[2], z)) for z in ends]
    bend(domain)
    u, v = fem.Function(V), ufl.TestFunction(V)
    stored = stored(u) if stored else scenes.energy(u) * ufl.dx(domain=domain, metadata=MEASURE)
    scene = between_planes(ufl.derivative(stored, u, v), u, sides, bcs, mu, tol)
    scene.stored, scene.u, scene.mesh = stored, u, domain
    return scene


@pytest.mark.parametrize("gdim", [2, 3])
def test_ring_between_two_planes(gdim):
    """Both planes carry the same, the derivative of the stored energy, at 30 % of the height; nothing else holds the ring."""
    scene, energies = ring(gdim), []
    for depth in (0.15, 0.2999, 0.3, 0.3001):
        step = scene.press(depth)
        energies.append(total(scene.stored))
        force = np.array([contact.force()[1] for contact in scene.contacts])
        if depth == 0.3:
            middle = force
    assert step.error <= 1e-10
    assert middle[1] == pytest.approx(-middle[0], rel=1e-7)
    assert 2 * middle[1] == pytest.approx((energies[3] - energies[1]) / 2e-4, rel=1e-5)


def test_ring_in_plane_strain_is_the_plane_ring():
    """Held at both ends the ring in three dimensions, with friction, has the forces of the one in two."""
    flat, solid = ring(2, mu=0.3), ring(3, mu=0.3, plane_strain=True)
    for depth in (0.1, 0.2):
        for scene in (flat, solid):
            scene.press(depth)
        for two, three in zip(flat.contacts, solid.contacts):
            np.testing.assert_allclose(three.force()[:2], DEEP * two.force(), rtol=1e-7)
    assert solid.contacts[0].force()[0] != 0.0  # friction does something


BULK = 100.0  # of nearly incompressible rubber of shear modulus 1
FULL, REDUCED = {"quadrature_degree": 5}, {"quadrature_degree": 3}  # 3 and 2 points along an edge


def gradients(u):
    """Deformation gradient and its determinant, plane strain."""
    G = ufl.Identity(2) + ufl.grad(u)
    return G, ufl.det(G)


def shear_energy(u):
    """What of the energy is not of the volume: G/2 (tr C - 2 - 2 ln J)."""
    G, J = gradients(u)
    return (ufl.tr(G.T * G) - 2 - 2 * ufl.ln(J)) / 2 * ufl.dx(domain=u.function_space.mesh, metadata=FULL)  # fmt: skip


def rubber_seal(cells):
    """The ring of nearly incompressible rubber on Q2, its volume held at the 2 x 2 points of reduced integration."""

    def stored(u):
        _, J = gradients(u)
        volume = ufl.dx(domain=u.function_space.mesh, metadata=REDUCED)
        return shear_energy(u) + BULK / 2 * (J - 1) ** 2 * volume

    scene = ring(2, degree=2, cells=cells, stored=stored, tol=1e-9)
    for depth in 0.025 * np.arange(1, 13):
        scene.press(depth)
    return scene


def mixed_forms(scene):
    """The forms of displacement and pressure with the pressure linear in each cell that has BULK (J - 1) at its 2 x 2 points."""
    u, V = scene.u, scene.u.function_space
    G, J = gradients(u)
    a, b = 0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12)
    points = np.array([(x, y) for y in (a, b) for x in (a, b)])
    shapes = np.array([[(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y] for x, y in points])
    Q = functionspace(scene.mesh, ("DG", 1))
    cells = np.arange(len(cell_dofs(Q)), dtype=np.int32)
    values = cell_values(fem.Expression(BULK * (J - 1), points), scene.mesh, cells)
    p, q, v = fem.Function(Q), ufl.TestFunction(Q), ufl.TestFunction(V)
    p.x.array[cell_dofs(Q)] = np.linalg.solve(shapes, values.T).T
    volume = ufl.dx(domain=scene.mesh, metadata=REDUCED)
    balance = ufl.derivative(shear_energy(u), u, v)
    balance += p * J * ufl.inner(ufl.inv(G).T, ufl.grad(v)) * volume
    return balance, (J - 1 - p / BULK) * q * volume, p


def test_rubber_seal_is_the_solution_of_the_mixed_form(record_property):
    """At 30 % compression displacement and pressure obey both mixed equations with the reactions found; forces do not lock."""
    scene = rubber_seal((2, 8))
    balance, volume, p = mixed_forms(scene)
    body = scene.problem.body
    forces, missing = fem.Function(body.V), fem.Function(p.function_space)
    assemble_into(forces.x, fem.form(balance))
    assemble_into(missing.x, fem.form(volume))
    for contact in scene.contacts:
        forces.x.array[:] -= contact.reaction_function().x.array
    free = np.delete(forces.x.array[: body.size], body.fixed)
    carried = abs(scene.contacts[0].force()[1])
    assert np.abs(free).max(initial=0.0) < 1e-7 * carried
    assert np.abs(missing.x.array).max() < 1e-12
    finer = abs(rubber_seal((2, 16)).contacts[0].force()[1])
    record_property("force of 8 and 16 cells along the rim", (carried, finer))
    assert carried == pytest.approx(finer, rel=0.02)


def test_eigenstrain_of_a_layer():
    """A layer that wants to be higher by ``misfit`` presses with E misfit times its part of the height."""
    misfit, young = 0.01, 3.0

    def grown(u, v, modulus):
        x, one = ufl.SpatialCoordinate(u.function_space.mesh), ufl.Identity(3)
        own = ufl.conditional(x[2] < HEIGHT / 2, misfit, 0.0) * ufl.outer(one[2, :], one[2, :])
        strain = ufl.sym(ufl.grad(u)) - own
        stress = young / 1.25 * (strain + 0.25 / 0.5 * ufl.tr(strain) * one)  # nu = 1/4
        return ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx(metadata=MEASURE)

    scene = block(grown)
    scene.problem.solve()
    assert scene.contact.force()[2] == pytest.approx(young * misfit / 2, rel=1e-8)
    assert scene.problem.body.refresh() == 1  # a linear body


def test_hysteresis_under_a_cyclic_punch():
    """The loop of force and approach has the area of the complex modulus of the discrete solid, in closed form."""
    soft, stiff, rate, steps, mean, swing = 1.0, 3.0, 0.4, 16, 0.05, 0.01
    part, late = {}, {}

    def solid(u, v, modulus):
        """Springs soft, and stiff with a dashpot; ``rate`` is the time step over the time of relaxation."""
        domain = u.function_space.mesh
        strain = ufl.sym(ufl.grad(u))
        flow = fem.Function(functionspace(domain, ("DG", 0, (3, 3))))
        part["strain"] = fem.Expression(strain, interpolation_points(flow.function_space))
        part["flow"], late["state"] = flow, [flow]
        both = soft * strain + stiff * (strain - flow) / (1 + rate)
        stress = both + 0.5 * ufl.tr(both) * ufl.Identity(3)
        return ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx

    def flow_on(u):
        strain = fem.Function(part["flow"].function_space)
        strain.interpolate(part["strain"])
        part["flow"].x.array[:] = (part["flow"].x.array + rate * strain.x.array) / (1 + rate)

    tets = dict(cells=(2, 2, 2), cell=mesh.CellType.tetrahedron, held=True)
    scene = block(solid, **tets, after_step=flow_on, late=late, tol=1e-11)
    depths = mean - swing * np.cos(2 * np.pi / steps * np.arange(3 * steps + 1))
    forces = []
    for depth in depths:  # the punch comes up from below
        scene.surface.displacement = (0.0, 0.0, depth)
        scene.problem.solve()
        forces.append(scene.contact.force()[2])
    stiffness = forces[0] / depths[0] / (soft + stiff / (1 + rate))
    complex_modulus = soft + stiff * (1 - rate / (1 + rate - np.exp(-2j * np.pi / steps)))
    polygon = steps / 2 * np.sin(2 * np.pi / steps)  # of the ellipse's steps, for pi
    loss = stiffness * swing**2 * complex_modulus.imag * polygon
    d, f = depths[-steps - 1 :], np.array(forces[-steps - 1 :])
    assert ((f[1:] + f[:-1]) / 2 * np.diff(d)).sum() == pytest.approx(loss, rel=1e-4)
    assert loss > 0 and min(forces) > 0
    assert type(scene.problem.body) is ElasticBody


@pytest.mark.parametrize("form", [scenes.rubber, None], ids=["rubber", "linear"])
def test_two_bodies_in_one_mesh(form):
    """Two blocks of one mesh, each on its plane, have the forces of each alone."""
    form = form or (lambda u, v, modulus: elasticity(u, v, modulus, 0.3))
    pieces = ((0.0, 1.0), (2.0, 3.0))
    found = [slide(form, (piece,)) for piece in pieces]
    both = slide(form, pieces)
    for i in range(2):
        np.testing.assert_allclose(both[i], found[i][0], atol=1e-8 * np.abs(both[i]).max())
        assert np.abs(both[i][:2]).min() > 0


def slide(form, pieces):
    """Forces of the planes on the blocks ``x_0 < x < x_1``: the first falls on z = 0, the one at 2 slides on a tilted plane below it."""
    domain = mesh.create_box(COMM, [np.zeros(3), np.array([3.0, 1, 1])], [6, 2, 2], mesh.CellType.hexahedron)  # fmt: skip

    def mine(x):
        return np.any([(x[0] > a - 1e-9) & (x[0] < b + 1e-9) for a, b in pieces], axis=0)

    domain = mesh.create_submesh(domain, 3, mesh.locate_entities(domain, 3, mine))[0]
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    contacts, bcs, tops = [], [], []
    for a, b in pieces:

        def face(z, a=a, b=b):
            return mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[2], z) & (x[0] > a - 1e-9) & (x[0] < b + 1e-9))  # fmt: skip

        tilt = 0.0 if a == 0 else 0.05
        plane = dc.RigidPlane((a, 0, -tilt), (-tilt, 0, 1), (1, 0, tilt))
        contacts.append(dc.Contact(V, face(0.0), plane, dc.Friction((0.3, 0.15))))
        tops.append((fem.Constant(domain, np.zeros(3)), a))
        bcs.append(fem.dirichletbc(tops[-1][0], fem.locate_dofs_topological(V, 2, face(1.0)), V))
    problem = dc.ContactProblem(form(u, v, 1.0), u, contacts, bcs=bcs, tol=1e-11)
    for t in (0.5, 1.0):
        for top, a in tops:
            top.value = (
                (0.1 * t, 0.02 * t, -0.1 * t) if a == 0 else (-0.05 * t, 0.03 * t, -0.12 * t)
            )
        problem.solve()
    return [contact.force() for contact in contacts]


@pytest.mark.parametrize("solver", [None, dc.FixedPoint(), dc.CondensedNewton()])
def test_a_form_that_is_not_a_number(solver):
    """Where the user's function gives NaN a step is refused, the last state stays, and solves go on."""
    scene_ = {}

    def made(u, v, modulus):
        domain = u.function_space.mesh
        broken = scene_["broken"] = fem.Function(functionspace(domain, ("DG", 0)))
        F = scenes.rubber(u, v, modulus) + broken * v[1] * ufl.dx(domain=domain)
        late["J"] = ufl.derivative(F, u)
        return F

    def check(u):  # a material that is not defined below half of its height
        lowest = COMM.allreduce(u.x.array[1::2].min(initial=0.0), op=MPI.MIN)
        scene_["broken"].x.array[:] = np.nan if lowest < -0.3 * HEIGHT else 0.0

    late = {}
    scene = block(made, cells=(4, 3), mu=0.3, held=True, solver=solver, late=late, before_residual=check)  # fmt: skip
    move(scene, 0.0, -0.1)
    scene.problem.solve()
    before = scene.u.x.array.copy(), scene.contact.reaction.copy(), scene.contact.force()
    move(scene, 0.0, -0.4)
    with pytest.raises(dc.NotConverged):
        scene.problem.solve()
    assert np.array_equal(scene.u.x.array, before[0])
    assert np.array_equal(scene.contact.reaction, before[1])
    move(scene, 0.0, -0.1)
    scene.problem.solve()
    np.testing.assert_allclose(scene.contact.force(), before[2], rtol=1e-7, atol=1e-9)
