# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Coefficients of friction that follow the pressure at the end of the step, and sums of the steps before."""

from types import SimpleNamespace

import dolfinx.fem.petsc
import numpy as np
import pytest
import scenes
import ufl
from defined_maps import return_map
from dolfinx import fem, mesh

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from mechanics.material import elasticity

COMM = scenes.COMM
SOLVERS = [None, dc.FixedPoint(), dc.CondensedNewton()]
E = 1000.0
P = (0.05, 0.2)


def weak(x, pressure):
    """One coefficient, which falls from 0.4 as pressure grows beside a hundredth of the modulus."""
    return 0.4 / (1 + pressure / (0.01 * E))


def pair(x, pressure):
    """Two coefficients, one of which depends on the place, too."""
    return np.stack((weak(x, pressure), (0.3 + 0.1 * x[0]) / (1 + pressure / (0.02 * E))))


def block(
    mu,
    p=None,
    height=0.6,
    nu=0.0,
    cells=(3, 3, 2),
    solver=None,
    comm=COMM,
    face=None,
    E=E,
    **options,
):
    """A block of edges 1, 1 and ``height`` on a plane; its top moves as a whole."""
    corners = [[-0.5, -0.5, 0.0], [0.5, 0.5, height]]
    domain = mesh.create_box(comm, corners, cells, mesh.CellType.hexahedron)
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v, held = fem.Function(V), ufl.TestFunction(V), fem.Constant(domain, np.zeros(3))
    foot, top = (
        mesh.locate_entities_boundary(domain, 2, lambda x, z=z: np.isclose(x[2], z))
        for z in (0.0, height)
    )
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, top), V)
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1), (1, 0, 0), height=face)
    contact = dc.Contact(V, foot, plane, dc.Friction(mu, p), **options)
    F = elasticity(u, v, fem.Constant(domain, float(E)), nu)
    problem = dc.ContactProblem(F, u, [contact], bcs=[bc], solver=solver)

    def step(*displacement):
        held.value = displacement
        return problem.solve()

    return SimpleNamespace(
        V=V, u=u, F=F, bc=bc, held=held, surface=plane, contact=contact, problem=problem, step=step
    )


def rows(contact, *arrays):
    """Arrays of all nodes, the same on all ranks, by their places."""
    every = [np.concatenate(contact.comm.allgather(array)) for array in (contact.x, *arrays)]
    order = np.lexsort(np.round(every[0], 9).T)
    return [array[order] for array in every[1:]]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("angle", [0.0, 1.0])
def test_a_flat_block_slides_at_mu_of_its_pressure(angle, solver):
    """Thin, so that pressure is even: at every node t = mu(p) p along the slip rule's direction, to the thickness."""
    thin = 1e-4
    scene = block(pair, P, height=thin, cells=(3, 3, 1), solver=solver)
    way = np.array([np.cos(angle), np.sin(angle)])
    for depth in (0.003, 0.02):
        scene.step(0, 0, -depth * thin)
        scene.step(*(10 * depth * thin * way), -depth * thin)
        contact, pressure = scene.contact, depth * E
        mu = pair(contact.x.T, np.full(len(contact.x), pressure))
        along = (np.array(P) ** 2 * way)[:, None] / np.linalg.norm((np.array(P) ** 2 * way)[:, None] / mu, axis=0)  # fmt: skip
        assert contact.pressure == pytest.approx(np.full(len(contact.x), pressure), rel=5e-3)
        shear = contact.reaction[:, :2] / contact.area[:, None]
        assert np.abs(-shear - pressure * along.T).max(initial=0) < 1e-2 * pressure * 0.4


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("law", [(weak, None), (pair, P)], ids=["isotropic", "orthotropic"])
def test_errors_are_those_of_the_law_at_the_final_pressure(law, solver):
    """Uneven pressure: coefficients are those of the pressure found, and a step that starts there with them as an array stays."""
    scene = block(*law, nu=0.3, solver=solver)
    for move in ((0, 0, -0.01), (0.003, 0.001, -0.012), (0.02, 0.01, -0.009)):
        step = scene.step(*move)
        assert max(step.error, step.slip_error, step.forward_error) <= 1e-8
        contact = scene.contact
        mu = np.broadcast_to(law[0](contact.x.T, contact.pressure), (2, len(contact.x))).T
        assert np.abs(contact.friction.mu - mu).max(initial=0) < 1e-12
        limit = np.linalg.norm(contact.reaction[:, :2] / mu, axis=1)
        assert (limit <= contact.reaction[:, 2] * (1 + 1e-8) + 1e-8).all()
    kept = scene.u.x.array.copy()
    reaction, friction = contact.reaction.copy(), contact.friction
    scene.problem.rewind()
    contact.friction = friction
    scene.u.x.array[:] = kept
    scene.problem.solve()
    scale = COMM.allreduce(np.abs(reaction).max(initial=0), op=scenes.MPI.MAX)
    assert np.abs(contact.reaction - reaction).max(initial=0) < 1e-6 * scale


@pytest.mark.slow
@pytest.mark.parametrize(
    "law",
    [(weak, None), (pair, None)],
    ids=["isotropic", "orthotropic"],
)
def test_a_round_face_agrees_with_slow_gauss_seidel(law):
    """Pressure as under a ball: reactions are those of one sweep after another in NumPy, mu taken at each node's own force."""
    comm, radius = scenes.MPI.COMM_SELF, 4.0
    scene = block(
        *law,
        nu=0.3,
        cells=(5, 5, 2),
        comm=comm,
        face=lambda y: -(y[0] ** 2 + y[1] ** 2) / (2 * radius),
    )
    scene.held.value = np.array([0.0024, 0.0012, -0.02])
    scene.problem.geometry_tol = np.inf  # the sweeps count slip from the start of the step
    matrix = dolfinx.fem.petsc.assemble_matrix(
        fem.form(ufl.derivative(scene.F, scene.u, ufl.TrialFunction(scene.V)))
    )
    matrix.assemble()
    K, fixed = matrix[:, :], scene.bc.dof_indices()[0]
    free = np.setdiff1d(np.arange(len(K)), fixed)
    inverse, at_rest = np.linalg.inv(K[np.ix_(free, free)]), np.zeros(len(K))
    at_rest[fixed] = np.tile(scene.held.value, len(fixed) // 3)
    at_rest[free] = -inverse @ (K[np.ix_(free, fixed)] @ at_rest[fixed])
    contact = scene.contact
    dofs = (3 * contact.nodes[:, None] + np.arange(3)).ravel()
    at = np.searchsorted(free, dofs)
    W, q = inverse[np.ix_(at, at)], at_rest[dofs]
    q[2::3] += (contact.x[:, 0] ** 2 + contact.x[:, 1] ** 2) / (2 * radius)
    area, r = contact.area, np.zeros(len(q))
    for _ in range(60):
        before = r.copy()
        for k, x in enumerate(contact.x):
            node, across = slice(3 * k, 3 * k + 3), W[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
            for _ in range(2):
                w = q[node] + W[node] @ r
                normal = max(r[3 * k + 2] - w[2] / across[2, 2], 0.0)
                mu = np.ravel(law[0](x[:, None], np.array([normal / area[k]]))) * np.ones(2)
                rho = 1 / np.linalg.norm(across[:2, :2], 2)
                r[node] = return_map(mu, mu, r[node], w[2], w[:2], 1 / across[2, 2], rho)
        if np.abs(r - before).max() < 1e-9 * np.abs(r).max():
            break
    scene.problem.solve()
    found = contact.reaction
    assert set(contact.status) == {0, 1, 2}
    assert np.abs(found - r.reshape(-1, 3)).max() < 1e-6 * np.abs(r).max()


def test_work_of_friction_is_that_of_both_ends():
    """Pressed harder while it slides: at each node half the sum of the friction forces before and after, times the slip."""
    scene = block(weak, height=1e-4, cells=(3, 3, 1), wear=dc.Wear(1e-12))
    contact = scene.contact
    scene.step(0, 0, -1e-6)
    scene.step(1e-4, 0, -1e-6)
    for k in (1, 2):
        worked, before = contact.dissipation.copy(), contact.reaction[:, 0].copy()
        scene.step(1e-4 * (1 + k), 0, -1e-6 * (1 + k))
        force = np.abs(before + contact.reaction[:, 0]) / 2
        assert contact.dissipation - worked == pytest.approx(
            force * np.abs(contact.slip_increment[:, 0]), rel=1e-3
        )


@pytest.mark.parametrize("solver", SOLVERS[:2])
def test_force_may_drive_the_plane(solver):
    """A stroke under dead weight: friction is the sum of mu(p) p over the nodes, and the weight is carried."""
    scene = block(weak, nu=0.3, solver=solver)
    scene.surface.free, scene.surface.force = ("n",), (0, 0, 8.0)
    for way in (0.0, 0.02, 0.04):
        scene.held.value = (way, 0, 0)
        scene.problem.solve()
    contact = scene.contact
    carried = COMM.allreduce((weak(None, contact.pressure) * contact.reaction[:, 2]).sum())
    pulled = np.linalg.norm(contact.reaction[:, :2], axis=1).sum()
    assert COMM.allreduce(pulled) == pytest.approx(carried, rel=1e-7)
    assert contact.force()[2] == pytest.approx(8.0, rel=1e-7)


def test_units_do_not_matter():
    """Moduli and pressures in other units: the same reactions over the modulus."""
    found = []
    for unit in (1.0, 1e9, 1e-9):
        scene = block(lambda x, pressure, unit=unit: weak(x, pressure / unit), nu=0.3, E=unit * E)
        scene.step(0.004, 0.002, -0.01)
        found.append(scene.contact.reaction / unit)
    for other in found[1:]:
        assert other == pytest.approx(found[0], abs=1e-7 * np.abs(found[0]).max(initial=1e-9))


def test_other_arrays_are_those_of_the_steps_before():
    """A coefficient that falls with the slip path is that of the path at the end of the last step."""
    scene = block(lambda x, slip_path: 0.1 + 0.2 * np.exp(-slip_path / 0.01), nu=0.3)
    for k in range(4):
        path = scene.contact.slip_path
        scene.step(0.008 * k, 0, -0.01)
        expected = 0.1 + 0.2 * np.exp(-path / 0.01)
        assert np.abs(scene.contact.friction.mu[:, 0] - expected).max(initial=0) < 1e-14
    assert COMM.allreduce(scene.contact.friction.mu.min(initial=1), op=scenes.MPI.MIN) < 0.2


def test_steps_back_failures_and_files(tmp_path):
    """rewind, a step that fails, and a file lead to the same next step, and to the friction of the state in place."""
    scene, other = block(pair, P, nu=0.3), block(pair, P, nu=0.3)
    scene.step(0, 0, -0.01)
    friction = scene.contact.friction.mu
    scene.problem.save(tmp_path / "state.npz")
    step = scene.step(0.01, 0.002, -0.012)
    (expected,) = rows(scene.contact, scene.contact.reaction)

    def once_more(scene):
        scene.step(0.01, 0.002, -0.012)
        (found,) = rows(scene.contact, scene.contact.reaction)
        assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()

    scene.problem.rewind()
    assert np.array_equal(scene.contact.friction.mu, friction)
    once_more(scene)
    scene.problem.rewind()
    scene.problem.solver = dc.CondensedNewton(
        newton_iterations=1, max_iterations=1, fallbacks=False
    )
    with pytest.raises(dc.NotConverged, match="friction follows the pressure"):
        scene.step(0.01, 0.002, -0.012)
    assert np.array_equal(scene.contact.friction.mu, friction)
    scene.problem.solver = None
    once_more(scene)
    other.problem.load(tmp_path / "state.npz")
    once_more(other)
    assert step.counts == other.problem.counts()


def test_friction_that_does_not_settle_is_refused():
    """A coefficient that is another one whenever it is asked for never fits the state; the last one stays."""
    turns = []

    def restless(x, pressure):
        turns.append(1)
        return np.full(x.shape[1], 0.1 + 0.1 * (len(turns) % 2))

    scene = block(weak)
    scene.step(0, 0, -0.01)
    kept = scene.u.x.array.copy()
    scene.contact.friction = dc.Friction(restless)
    with pytest.raises(dc.NotConverged, match="friction follows the pressure"):
        scene.step(0.02, 0, -0.01)
    assert np.array_equal(scene.u.x.array, kept)
