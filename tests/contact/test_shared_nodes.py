# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Nodes that belong to several contacts: both laws hold, and the sum is in balance, in corners, grooves and boxes."""

from types import SimpleNamespace

import dolfinx.fem.petsc
import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from dolfinx_contact.contact.nodal import NodalProblems
from dolfinx_contact.contact.shared import shared_nodes
from mechanics.corners import STRAIN, Push, build_corner
from mechanics.judge_corners import CornerJudge

# Ends of the faces are held with the faces beyond.
pytestmark = [pytest.mark.ranks, pytest.mark.filterwarnings("ignore:.* are left out")]
COMM, TOL = scenes.COMM, 1e-8
SOLVERS = {"default": None, "condensed": dc.CondensedNewton(), "fixed point": dc.FixedPoint()}
FIXED_POINT_IS_SLOW = ["default", "condensed", pytest.param("fixed point", marks=pytest.mark.slow)]
WAY = [Push(), Push(across=0.3), Push(across=-0.3, down=1.2, along=0.2), Push(down=-0.2), Push(across=0.1, down=0.5)]  # fmt: skip
LAWS = {
    "smooth": dict(mu=0.0),
    "rough": dict(mu=0.3),
    "grooved": dict(mu=(0.3, 0.15), p=(0.05, 0.2)),
    "one smooth": dict(mu=[0.0, 0.3]),
}


def problem_of(scene, solver=None, **options):
    return dc.ContactProblem(
        scene.F, scene.u, scene.contacts, bcs=scene.bcs, solver=solver, **options
    )


def judged(scene, problem, way=WAY):
    """Steps along a way, each judged by both laws and equilibrium."""
    judge = CornerJudge(scene)
    for push in way:
        scene.apply(push)
        step = problem.solve()
        verdict = judge.verdict()
        assert verdict.accepts(max(TOL, step.error)), verdict
    return judge


@pytest.mark.parametrize("solver", FIXED_POINT_IS_SLOW)
@pytest.mark.parametrize("angle", [1, 30, 90, 170])
def test_both_laws_hold_in_the_edge_of_a_groove(angle, solver):
    """In the plane, with friction: pressed, dragged to both sides, lifted and pressed again."""
    scene = build_corner(angle, (3, 3), mu=0.2, turned=17.0)
    judged(scene, problem_of(scene, SOLVERS[solver]))


@pytest.mark.parametrize("solver", FIXED_POINT_IS_SLOW)
@pytest.mark.parametrize("law", LAWS)
def test_both_laws_hold_along_an_edge(law, solver):
    """In space, also along the groove: without friction, with anisotropic friction, and with friction on one face alone."""
    scene = build_corner(70, (3, 3, 2), **LAWS[law])
    judged(scene, problem_of(scene, SOLVERS[solver]), WAY if law == "smooth" else WAY[:3])


def test_friction_that_follows_the_pressure_in_an_edge():
    """Coefficients that follow the pressure end where fixed ones of the values found give the same reactions."""
    scene, fixed = (build_corner(70, (3, 3, 2), mu=0.3) for _ in range(2))
    for contact in scene.contacts:
        contact.friction = dc.Friction(lambda x, pressure: 0.1 + 0.3 / (1 + pressure / 2000.0))
    scene.apply(WAY[1])
    problem_of(scene, tol=1e-10).solve()
    for contact, found in zip(fixed.contacts, scene.contacts):
        contact.friction = found.friction
    fixed.apply(WAY[1])
    problem_of(fixed, tol=1e-10).solve()
    lowest = min(contact.friction.mu.min(initial=1.0) for contact in scene.contacts)
    assert COMM.allreduce(lowest, op=MPI.MIN) < 0.38  # of 0.4 without pressure
    largest = max(np.abs(contact.force()).max() for contact in fixed.contacts)
    for contact, found in zip(fixed.contacts, scene.contacts):
        assert np.abs(contact.reaction - found.reaction).max(initial=0.0) < 1e-8 * largest


def test_answers_do_not_depend_on_units():
    """The same scene in units of length and force that are 1e-5 and 1e7 times as large."""
    found = []
    for length, E in ((1.0, 210e3), (1e-5, 210e10)):
        scene = build_corner(60, (3, 3), E=E, length=length)
        judged(scene, problem_of(scene), WAY[:3])
        found.append([c.force() / (E * length) for c in scene.contacts])
    assert np.abs(np.subtract(*found)).max() <= 1e-9 * np.abs(found[0]).max()


@pytest.mark.parametrize("angle", [1, 30, 90, 170])
def test_a_wedge_on_smooth_planes_has_the_forces_of_statics(angle):
    """Held by contact alone, under its weight: each plane carries W / (2 sin(angle / 2)) along its normal."""
    scene = build_corner(angle, (3, 3), mu=0.0, held=False)
    weight = 1e-3 * scene.E * np.sin(np.deg2rad(angle))  # area times force per area
    scene.force.value[:] = (0.0, -1e-3 * scene.E)
    problem = problem_of(scene)
    problem.solve()
    for contact, normal in zip(scene.contacts, scene.normals):
        carried = weight / (2 * np.sin(np.deg2rad(angle) / 2))
        assert np.abs(contact.force() - carried * normal).max() <= 1e-6 * carried
    assert CornerJudge(scene).verdict().accepts(1e-7)


def cube(mus, solver=None, cells=(2, 3, 2), edges=(1.0, 2.0, 0.5)):
    """A brick in the corner of a box of three planes; its three other faces can be moved along their normals."""
    low, high = np.zeros(3), np.array(edges)
    domain = mesh.create_box(COMM, [low, high], cells, mesh.CellType.hexahedron)
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = scenes.elasticity(u, v, fem.Constant(domain, 1e3), fem.Constant(domain, 0.3))
    bcs, held, contacts, normals = [], [], [], list(np.eye(3))
    for k in range(3):
        sides = [mesh.locate_entities_boundary(domain, 2, lambda x, k=k, at=at: np.isclose(x[k], at)) for at in (0.0, high[k])]  # fmt: skip
        value = fem.Constant(domain, 0.0)
        dofs = fem.locate_dofs_topological(V.sub(k), 2, sides[1])
        bcs.append(fem.dirichletbc(value, dofs, V.sub(k)))
        held.append(value)
        plane = dc.RigidPlane(low, normals[k], np.eye(3)[(k + 1) % 3])
        contacts.append(dc.Contact(V, sides[0], plane, dc.Friction(mus[k])))
    problem = dc.ContactProblem(F, u, contacts, bcs=bcs, solver=solver)
    return SimpleNamespace(V=V, u=u, F=F, bcs=bcs, held=held, contacts=contacts, problem=problem, mesh=domain)  # fmt: skip


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_brick_in_the_corner_of_a_box_has_the_pressures_of_hooke(solver):
    """Without friction strains are even: the pressures of the three walls are those of Hooke's law, at every node."""
    strain, edges = np.array([2e-3, -5e-4, 1e-3]), np.array([1.0, 2.0, 0.5])
    scene = cube([0.0] * 3, SOLVERS[solver], edges=edges)
    for value, pushed in zip(scene.held, -strain * edges):
        value.value = pushed
    scene.problem.solve()
    lame, shear = 1e3 * 0.3 / (1.3 * 0.4), 1e3 / 2.6
    pressures = lame * strain.sum() + 2 * shear * strain
    assert (pressures > 0).all()
    for contact, pressure, normal in zip(scene.contacts, pressures, np.eye(3)):
        assert np.abs(contact.pressure - pressure).max(initial=0.0) <= 1e-6 * pressure
        area = edges.prod() / edges[normal.argmax()]
        assert np.abs(contact.force() - area * pressure * normal).max() <= 1e-6 * area * pressure


@pytest.mark.parametrize("solver", FIXED_POINT_IS_SLOW)
def test_a_brick_slides_on_the_walls_of_a_box(solver):
    """With other friction on each wall, and nodes of edges held along one direction: all laws hold."""
    scene = cube([0.2, 0.0, 0.4], SOLVERS[solver])
    judge_of = SimpleNamespace(V=scene.V, u=scene.u, F=scene.F, bcs=scene.bcs, contacts=scene.contacts, E=1e3, length=1.0,
                               normals=list(np.eye(3)), mu=[0.2, 0.0, 0.4], p=[None] * 3, axes=None)  # fmt: skip
    judge = CornerJudge(judge_of)
    for pushed in ((-2e-3, 1e-4, -1e-3), (-1e-3, -1e-3, -1e-3), (-2e-3, -1e-3, 0.0)):
        for value, way in zip(scene.held, pushed):
            value.value = way
        step = scene.problem.solve()
        verdict = judge.verdict()
        assert verdict.accepts(max(TOL, step.error)), verdict.defects


def test_friction_in_the_edge_agrees_with_slow_gauss_seidel():
    """Nodal forces and displacement are those of projected Gauss-Seidel on the dense problem of both contacts."""
    scene = build_corner(80, (3, 3), mu=0.15, comm=MPI.COMM_SELF)
    problem = problem_of(scene, dc.CondensedNewton(), tol=1e-11)
    matrix = dolfinx.fem.petsc.assemble_matrix(
        fem.form(ufl.derivative(scene.F, scene.u, ufl.TrialFunction(scene.V)))
    )
    matrix.assemble()
    K = matrix[:, :]
    scene.apply(Push(across=0.2))
    problem.solve()
    fixed = np.unique(scene.bcs[0].dof_indices()[0])
    free = np.setdiff1d(np.arange(len(K)), fixed)
    prescribed = np.zeros(len(K))
    prescribed[fixed] = scene.held.x.array[fixed]
    inverse, x = np.linalg.inv(K[np.ix_(free, free)]), scene.V.tabulate_dof_coordinates()[:, :2]
    rows, gaps = [], []
    for contact, normal in zip(scene.contacts, scene.normals):
        for node in contact.nodes:
            if np.isin(2 * node, fixed):
                continue
            for way in ((normal[1], -normal[0]), normal):
                row = np.zeros(len(K))
                row[2 * node : 2 * node + 2] = way
                rows.append(row)
                gaps.append(x[node] @ normal if way is normal else 0.0)
    B, at_rest = np.array(rows), prescribed.copy()
    at_rest[free] = -inverse @ (K[np.ix_(free, fixed)] @ prescribed[fixed])
    W, q = B[:, free] @ inverse @ B[:, free].T, B @ at_rest + gaps
    r = np.zeros(len(q))
    for _ in range(3000):
        for t in range(0, len(q), 2):
            n, w = t + 1, q[t : t + 2] + W[t : t + 2] @ r
            before = r[t : t + 2].copy()
            r[n] = max(0.0, r[n] - w[1] / W[n, n])
            slip = w[0] + W[t, n] * (r[n] - before[1])
            r[t] = np.clip(r[t] - slip / W[t, t], -0.15 * r[n], 0.15 * r[n])
    u = at_rest.copy()
    u[free] += inverse @ (B[:, free].T @ r)
    assert np.abs(u - scene.u.x.array).max() <= 1e-8 * np.abs(u).max()
    forces = np.zeros(len(K))
    for contact in scene.contacts:
        contact.assemble_reaction(forces)
    assert np.abs(forces - B.T @ r)[free].max() <= 1e-7 * np.abs(r).max()


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_two_contacts_with_the_same_plane_carry_together_what_one_does(mu, solver):
    """How they share is not determined; displacement and the sum of their forces are."""
    found = []
    for count in (1, 2):
        scene = scenes.block(cells=(3, 3, 2), mu=mu, p=None, solver=SOLVERS[solver])
        contacts = [dc.Contact(scene.V, scene.facets, scene.surface, dc.Friction(mu)) for _ in range(count)]  # fmt: skip
        problem = dc.ContactProblem(scene.F, scene.u, contacts, bcs=scene.bcs, solver=SOLVERS[solver], tol=1e-10)  # fmt: skip
        for top in ((0, 0, -1e-3), (5e-4, 2e-4, -1e-3)):
            scene.move_top(*top)
            problem.solve()
        found.append((scene.u.x.array.copy(), sum(contact.force() for contact in contacts)))
    (u, force), (other, shared) = found
    assert np.abs(u - other).max(initial=0.0) <= 1e-7 * 1e-3
    assert np.abs(force - shared).max() <= 1e-7 * np.abs(force).max()


@pytest.mark.filterwarnings("ignore:the body lies on the other side")
@pytest.mark.parametrize("solver", SOLVERS)
def test_opposite_planes_hold_as_a_support_does(solver):
    """Nodes between two planes that face each other move with neither: pushed and pulled they carry the same."""
    scene = scenes.block(cells=(2, 2, 2), mu=0.0, p=None)
    normal = np.array([0.0, 0.0, 1.0])
    contacts = [dc.Contact(scene.V, scene.facets, dc.RigidPlane(np.zeros(3), way), dc.Friction(0.0)) for way in (normal, -normal)]  # fmt: skip
    problem = dc.ContactProblem(scene.F, scene.u, contacts, bcs=scene.bcs, solver=SOLVERS[solver])
    carried = []
    for down in (1e-3, -1e-3):
        scene.move_top(0, 0, -down)
        problem.solve()
        carried.append(sum(contact.force() for contact in contacts)[2])
    assert carried[0] > 0.0
    assert carried[1] == pytest.approx(-carried[0], rel=1e-6)


def test_rewind_and_checkpoints_keep_the_reactions_of_each_contact(tmp_path):
    """A step after rewind, or after load in another problem, is the one that was made."""
    path = COMM.bcast(str(tmp_path / "corner.npz"))
    scene = build_corner(90, (3, 3), mu=0.3)
    problem = problem_of(scene)
    for push in WAY[:2]:
        scene.apply(push)
        problem.solve()
    problem.save(path)
    kept = [contact.reaction.copy() for contact in scene.contacts]
    scene.apply(WAY[2])
    problem.solve()
    after = [contact.reaction.copy() for contact in scene.contacts]
    problem.rewind()
    for contact, reaction in zip(scene.contacts, kept):
        assert np.array_equal(contact.reaction, reaction)
    other = build_corner(90, (3, 3), mu=0.3)
    loaded = problem_of(other)
    loaded.load(path)
    for of, again in ((scene, problem), (other, loaded)):
        of.apply(WAY[2])
        again.solve()
        for contact, reaction in zip(of.contacts, after):
            scale = COMM.allreduce(np.abs(reaction).max(initial=0.0), op=MPI.MAX)
            assert np.abs(contact.reaction - reaction).max(initial=0.0) <= 1e-6 * scale


def test_work_of_friction_is_each_contacts_own():
    """A smooth face dissipates nothing, the rough one what its own reactions do along its slips."""
    scene = build_corner(90, (3, 3), mu=[0.0, 0.3])
    judged(scene, problem_of(scene), WAY[:3])
    smooth, rough = (COMM.allreduce(c.dissipation.sum()) for c in scene.contacts)
    assert smooth == 0.0 < rough


def test_derivatives_at_shared_nodes_are_those_of_differences():
    """Of the nodal forces that new reactions make, by displacement: the tangent of solvers against central differences."""
    scene = build_corner(75, (3, 3, 2), mu=(0.3, 0.2), p=(0.1, 0.3))
    problem = problem_of(scene, dc.FixedPoint())
    for push in WAY[:2]:
        scene.apply(push)
        problem.solve()
    step, body = problem.load_step(), problem.body
    rng = np.random.default_rng(COMM.rank)
    size = STRAIN * scene.length
    x = scene.u.x.array[: body.size] + 0.02 * size * rng.normal(size=body.size)
    way = rng.normal(size=body.size)
    for array in (x, way):
        array[body.fixed] = 0.0
    x[body.fixed] = step.b[body.fixed]
    maps = step.error_maps

    def left(at):
        return step.evaluate(at, maps).residual - step.free(step.forces(at))

    h = 1e-7 * size
    expected = (left(x + h * way) - left(x - h * way)) / (2 * h)
    forces, change = body.multiply(way), np.zeros(body.size)
    derivatives = step.derivatives(step.evaluate(x, maps), maps)
    for contact, (by_force, by_motion) in zip(scene.contacts, derivatives):
        points = contact.points
        moved, pushed = points.motion(way), points.motion(step.free(forces))
        new = np.einsum("nij,nj->ni", by_force, pushed) + np.einsum("nij,nj->ni", by_motion, moved)
        points.add_forces(new, change)
    change = step.free(change)
    assert body.norm(change - expected) <= 1e-5 * body.norm(expected)


def test_contacts_that_share_no_node_have_no_nodal_problems():
    """Nothing is set up for them; one Contact named twice is refused."""
    scene = build_corner(90, (3, 3), mu=0.3)
    problem = problem_of(scene)
    step = problem.load_step()
    assert shared_nodes(step.contacts[:1], problem.body.fixed) is None
    twice = scene.contacts[:1] * 2
    with pytest.raises(ValueError, match="same Contact twice"):
        dc.ContactProblem(scene.F, scene.u, twice, bcs=scene.bcs)


@pytest.mark.parametrize("mu", [0.0, pytest.param(0.3, marks=pytest.mark.slow)])
def test_a_face_of_the_groove_may_be_driven_by_force(mu):
    """The force of its contact, nodes of the edge among it, is the given one along the normal."""
    scene = build_corner(90, (3, 3), mu=mu)
    problem, plane = problem_of(scene), scene.contacts[0].surface
    plane.free = ("n",)
    for force in (50.0, 80.0, 20.0):
        plane.force = force * scene.normals[0]
        scene.apply(Push(down=0.05))
        problem.solve()
        assert scene.contacts[0].force() @ scene.normals[0] == pytest.approx(force, rel=1e-7)


@pytest.mark.parametrize("solver", SOLVERS)
def test_an_edge_on_circles_tends_to_one_on_planes(solver):
    """Forces of a groove of two circles differ from those of its tangent planes as the inverse of the radius."""
    missed, way, planes = [], (Push(), Push(across=0.3), Push(down=1.2)), None
    for radius in (None, 1e3, 1e4):
        scene = build_corner(70, (3, 3), mu=0.0)
        if radius:
            rounded = [dc.RigidSphere(-radius * n, radius) for n in scene.normals]
            scene.contacts = [
                dc.Contact(scene.V, side, circle, dc.Friction(0.0))
                for side, circle in zip(scene.sides[1::-1], rounded)
            ]
        problem, forces = problem_of(scene, SOLVERS[solver]), []
        for push in way:
            scene.apply(push)
            problem.solve()
            forces += [contact.force() for contact in scene.contacts]
        planes = planes or forces
        missed.append(np.abs(np.subtract(forces, planes)).max() / np.abs(planes).max())
    assert missed[1] < 0.5 and 8.0 < missed[1] / missed[2] < 12.0


@pytest.mark.parametrize("solver", ["default", "condensed"])
def test_walls_given_by_functions_are_walls(solver):
    """Three faces of a box with frames for each node have the forces of planes."""
    found = []
    for given in (False, True):
        scene = cube([0.2, 0.0, 0.4])
        for k in range(3) if given else ():
            wall = dc.RigidSurface(lambda y, k=k: y[k], axis=np.eye(3)[(k + 1) % 3])
            side = mesh.locate_entities_boundary(scene.mesh, 2, lambda x, k=k: np.isclose(x[k], 0.0))  # fmt: skip
            scene.contacts[k] = dc.Contact(scene.V, side, wall, scene.contacts[k].friction)
        problem = problem_of(scene, SOLVERS[solver])
        for pushed in ((-2e-3, 1e-4, -1e-3), (-1e-3, -1e-3, -1e-3)):
            for value, way in zip(scene.held, pushed):
                value.value = way
            problem.solve()
        found.append([contact.force() for contact in scene.contacts])
    assert np.abs(np.subtract(*found)).max() <= 1e-7 * np.abs(found[0]).max()


@pytest.mark.parametrize("solver", FIXED_POINT_IS_SLOW)
def test_walls_may_turn_with_the_body(solver):
    """Groove and held faces turned together by a small angle: the forces are turned, up to the angle squared and rounding."""
    found = []
    for turn in (0.0, 0.5):
        scene = build_corner(70, (3, 3), mu=0.2)
        problem = problem_of(scene, SOLVERS[solver])
        for push in (Push(), Push(across=0.3)):
            scene.apply(Push(across=push.across, turn=turn))
            for contact in scene.contacts:
                contact.surface.rotation = STRAIN * turn
            problem.solve()
        found.append([contact.force() for contact in scene.contacts])
    size = np.abs(found[0]).max()
    assert np.abs(np.subtract(*found)).max() <= 4 * STRAIN * size
    scene.apply(Push(across=0.3))  # the groove alone is turned
    problem.solve()
    assert np.abs(scene.contacts[0].force() - found[0][0]).max() > 0.05 * size


@pytest.mark.slow
def test_a_nonlinear_body_in_the_corner_of_a_box():
    """A body that is hardly nonlinear meets both laws and equilibrium of the linear one in every edge."""
    scene = cube([0.2, 0.0, 0.4])
    bent = scene.F + 1e-9 * ufl.inner(scene.u, scene.u) * ufl.inner(scene.u, ufl.TestFunction(scene.V)) * ufl.dx  # fmt: skip
    problem = dc.ContactProblem(bent, scene.u, scene.contacts, bcs=scene.bcs)
    assert problem.body.nonlinear
    judge = CornerJudge(SimpleNamespace(V=scene.V, u=scene.u, F=scene.F, bcs=scene.bcs, contacts=scene.contacts, E=1e3, length=1.0,
                                        normals=list(np.eye(3)), mu=[0.2, 0.0, 0.4], p=[None] * 3, axes=None))  # fmt: skip
    for pushed in ((-2e-3, 1e-4, -1e-3), (-1e-3, -1e-3, -1e-3), (-2e-3, -1e-3, 0.0)):
        for value, way in zip(scene.held, pushed):
            value.value = way
        step = problem.solve()
        verdict = judge.verdict()
        assert verdict.accepts(max(TOL, step.error)), verdict.defects


@pytest.mark.slow
def test_nodes_of_three_faces_keep_the_start_that_served(monkeypatch):
    """An evaluation of a step solves each node's problem about once, not from all five starts, in few calls of the laws."""
    scene, calls = cube([0.3] * 3, dc.FixedPoint()), dict.fromkeys(("problems", "laws", "states"), 0)  # fmt: skip
    for contact in scene.contacts:
        contact.friction = dc.Friction((0.3, 0.15), (0.05, 0.2))
    solve, linearise = NodalProblems.balanced, NodalProblems.linearised

    def balanced(problems, r, tol):
        calls["problems"] += len(r)
        return solve(problems, r, tol)

    def linearised(problems, asked):
        calls["laws"] += 1
        return linearise(problems, asked)

    def told(*_):
        calls["states"] += 1

    monkeypatch.setattr(NodalProblems, "balanced", balanced)
    monkeypatch.setattr(NodalProblems, "linearised", linearised)
    scene.problem.monitor = told
    nodes = np.concatenate([contact.nodes for contact in scene.contacts])
    shared = (np.unique(nodes, return_counts=True)[1] > 1).sum()
    for value, way in zip(scene.held, (-2e-3, 1e-4, -1e-3)):
        value.value = way
    scene.problem.solve()
    assert calls["problems"] <= 3 * shared * calls["states"]
    assert calls["laws"] <= 25 * calls["states"]
