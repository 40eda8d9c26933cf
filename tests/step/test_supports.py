# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact nodes that supports move along their surface: slip is known, friction follows, the support carries the rest."""

from types import SimpleNamespace

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from dolfinx_contact.contact.contact_step import nodal_stiffness, step_of
from dolfinx_contact.step.errors import contact_defects

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
SOLVERS = {
    "condensed": dc.CondensedNewton(),
    "fixed point": dc.FixedPoint(),
    "paper's map": dc.FixedPoint(map="bipotential"),
    "sparse": dc.SparseNewton(),
    "SNES": dc.SNES(),
}
LAW = dict(mu=(0.3, 0.15), p=(0.05, 0.2))


def total(values) -> float:
    return COMM.allreduce(float(np.sum(values)), op=MPI.SUM)


def drag(slip, axis, mu, p):
    """P^2 s / |M^-1 P^2 s| of slips in space, ``shape=(n, 2)``, for a plane's axis in space."""
    turn = np.array([axis[:2], [-axis[1], axis[0]]]) / np.hypot(*axis[:2])
    along = np.array(p) ** 2 * (slip @ turn.T)
    return along / np.linalg.norm(along / np.array(mu), axis=1)[:, None] @ turn


def belt(degree=1, side=True, nonlinear=False, solver=None, wear=1e-6, unit=1.0):
    """A square of weight 1 on a plane, its side face, or all of it, moved along."""
    domain = mesh.create_unit_square(COMM, 4, 4, mesh.CellType.quadrilateral)
    V = functionspace(domain, ("Lagrange", degree, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    E, weight = fem.Constant(domain, 1000.0 * unit), fem.Constant(domain, unit)
    F = E * ufl.inner(ufl.sym(ufl.grad(u)), ufl.grad(v)) * ufl.dx + weight * v[1] * ufl.dx
    if nonlinear:
        F += (1e-5 * u[1] * v[1] + 1e-9 * ufl.inner(u, u) * ufl.inner(u, v)) * ufl.dx
    foot, face = (
        mesh.locate_entities_boundary(domain, 1, lambda x, i=i: np.isclose(x[i], 0)) for i in (1, 0)
    )
    push = fem.Constant(domain, 0.0)
    if side:
        dofs = fem.locate_dofs_topological(V.sub(0), 1, face)
    else:
        dofs = fem.locate_dofs_geometrical((V.sub(0), V.sub(0).collapse()[0]), lambda x: x[0] < 9)[0]  # fmt: skip
    plane = dc.RigidPlane((0, 0), (0, 1))
    contact = dc.Contact(V, foot, plane, dc.Friction(0.3), wear=wear and dc.Wear(wear))
    bcs = [fem.dirichletbc(push, dofs, V.sub(0))]
    return dc.ContactProblem(F, u, [contact], bcs=bcs, solver=solver, tol=1e-10), contact, push


KINDS = {
    "linear": {},
    "second order": dict(degree=2),
    "nonlinear": dict(nonlinear=True),
    "sparse": dict(solver=dc.SparseNewton()),
    "all held": dict(side=False),
    "small forces": dict(unit=1e-10),
    "large forces": dict(unit=1e10, wear=1e-16),
}


@pytest.mark.parametrize("by", ["support", "plane"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_block_pushed_by_its_side_has_the_friction_of_its_weight(kind, by):
    """The side face is moved, or the plane under it: -mu N at every node, its work is mu N a way, its wear that of the work."""
    problem, contact, push = belt(**KINDS[kind])
    unit, worked = KINDS[kind].get("unit", 1.0), []
    problem.solve()
    for way in (0.1, 0.2):
        if by == "support":
            push.value = way
        else:
            contact.surface.displacement = (-way, 0.0)
        step = problem.solve()
        worked.append(total(contact.dissipation) / unit)
        r = contact.reaction / unit
        assert np.abs(contact.force() / unit - (-0.3, 1.0)).max() < 1e-8
        assert np.abs(r[:, 0] + 0.3 * r[:, 1]).max(initial=0.0) < 1e-9
        assert step.counts.slip == COMM.allreduce(contact.nodes.size) and step.error < 1e-9
    assert abs(worked[1] - worked[0] - 0.3 * 0.1) < 1e-8
    wear = KINDS[kind].get("wear", 1e-6) * contact.dissipation
    assert np.abs(contact.wear_depth * contact.area - wear).max(initial=0.0) <= 1e-9 * wear.max(
        initial=0.0
    )
    moved = np.isclose(contact.x[:, 0], 0.0)
    assert np.allclose(contact.slip_path[moved], 0.2, atol=1e-12)


@pytest.mark.parametrize("kind", ["linear", "sparse", "all held", "small forces"])
def test_nothing_jumps_when_motion_pauses(kind):
    """Pause: the same reactions, no work, moved nodes stick. Turned back: the other sign. Half the weight: half the friction."""
    problem, contact, push = belt(**KINDS[kind], wear=None)
    moved = np.isclose(contact.x[:, 0], 0.0) | (kind == "all held")
    unit = KINDS[kind].get("unit", 1.0)
    problem.solve()
    push.value = 0.1
    problem.solve()
    before, worked = contact.reaction, total(contact.dissipation)
    step = problem.solve()
    assert np.abs(contact.reaction - before).max(initial=0.0) < 1e-9 * unit
    assert abs(total(contact.dissipation) - worked) < 1e-9 * unit
    assert (contact.status[moved] == dc.Status.STICK).all() and step.error < 1e-9
    push.value = 0.05
    problem.solve()
    assert np.abs(contact.force() / unit - (0.3, 1.0)).max() < 1e-8
    contact.friction = dc.Friction(0.1)
    problem.solve()
    bound = 0.1 * contact.reaction[moved, 1]
    assert np.abs(contact.reaction[moved, 0] - bound).max(initial=0.0) < 1e-9 * unit


def test_held_friction_is_saved_and_taken_back(tmp_path):
    """A step taken back and made again, and a run that goes on from a checkpoint, give the same reactions and sums."""
    problem, contact, push = belt()
    problem.solve()
    push.value = 0.1
    problem.solve()
    problem.save(tmp_path / "belt.npz")
    problem.solve()  # motion pauses
    rested = contact.reaction
    problem.rewind()
    push.value = 0.15
    problem.solve()
    found, sums = contact.reaction, contact.dissipation
    again, other, pushed = belt()
    pushed.value = 0.1
    again.load(tmp_path / "belt.npz")
    again.solve()
    assert np.abs(other.reaction - rested).max(initial=0.0) < 1e-12
    again.rewind()
    pushed.value = 0.15
    again.solve()
    assert np.abs(other.reaction - found).max(initial=0.0) < 1e-12
    assert np.abs(other.dissipation - sums).max(initial=0.0) < 1e-12


def test_errors_see_friction_that_is_missing():
    """A state whose moved node has no friction, or one in a wrong direction, is none of the law."""
    problem, contact, push = belt()
    problem.solve()
    push.value = 0.1
    problem.solve()
    step = step_of(contact, nodal_stiffness(contact, problem.body.K))
    good, moved = contact.reaction, np.isclose(contact.x[:, 0], 0.0)
    assert np.abs(contact_defects(step, contact.present)[0]).max(initial=0.0) < 1e-9
    for factor in (0.0, -1.0):
        wrong = good.copy()
        wrong[moved, 0] *= factor
        state = contact.present._replace(reaction=wrong)
        missing = np.abs(contact_defects(step, state)[0])
        assert (missing[moved, 0] > 0.9 * 0.3 * good[moved, 1]).all()


def block(solver, axis=(1.0, 0.0, 0.0), held="edge", law=LAW, springs=None):
    """A cube pressed on a plane by its head; along x a face, or all of it along x and y, moved, or pulled by springs."""
    domain = mesh.create_box(COMM, [np.zeros(3), np.ones(3)], [2, 3, 2], mesh.CellType.hexahedron)
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v, head = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    top, foot, side = (
        mesh.locate_entities_boundary(domain, 2, lambda x, i=i, at=at: np.isclose(x[i], at))
        for i, at in ((2, 1.0), (2, 0.0), (0, 0.0))
    )
    bcs = [fem.dirichletbc(head, fem.locate_dofs_topological(V, 2, top))]
    F, pushed = scenes.elasticity(u, v, 1e3, 0.3), [fem.Constant(domain, 0.0) for _ in range(2)]
    if springs is None:
        for k, value in enumerate(pushed[: 1 if held == "edge" else 2]):
            dofs = fem.locate_dofs_topological(V.sub(k), 2, side if held == "edge" else foot)
            bcs.append(fem.dirichletbc(value, dofs, V.sub(k)))
    else:
        tags = mesh.meshtags(domain, 2, np.sort(side), np.full(len(side), 1, dtype=np.int32))
        ds = ufl.Measure(
            "ds", domain=domain, subdomain_data=tags, metadata={"quadrature_degree": 2}
        )
        F += springs * (u[0] - pushed[0]) * v[0] * ds(1)
    contact = dc.Contact(
        V, foot, dc.RigidPlane((0, 0, 0), (0, 0, 1), axis=axis), dc.Friction(**law)
    )
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, solver=solver, tol=1e-10)
    return problem, contact, head, pushed


def drive(head, *displacement):
    head.x.array.reshape(-1, 3)[:] = displacement


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.6, 0.8, 0.0)])
def test_a_foot_moved_as_a_whole_has_the_closed_form(axis):
    """All tangential motion is given: force = -N P^2 e / |M^-1 P^2 e| for any direction e, by the support or by the plane."""
    for by in ("support", "plane"):
        problem, contact, head, pushed = block(dc.CondensedNewton(), axis, held="all")
        drive(head, 0.0, 0.0, -0.01)
        problem.solve()
        assert np.abs(contact.reaction[:, :2]).max(initial=0.0) == 0.0
        at, work = np.zeros(2), 0.0
        for way in ((0.02, 0.0), (0.01, 0.03), (-0.03, 0.01), (0.0, -1e-7)):
            at += way
            if by == "support":
                drive(head, *at, -0.01)
                for value, component in zip(pushed, at):
                    value.value = component
            else:
                contact.surface.displacement = (*-at, 0.0)
            problem.solve()
            normal, force = total(contact.reaction[:, -1]), contact.force()
            expected = -normal * drag(np.array([way]), axis, **LAW)[0]
            assert np.abs(force[:2] - expected).max() < 1e-9 * normal
            work -= total(contact.reaction[:, :2] * contact.slip_increment)
        assert 0.3 * work < total(contact.dissipation) < 3 * work


@pytest.mark.parametrize(
    "law, ways, angle",
    [
        (LAW, (0.004, 0.008, 0.002), 0.4),
        (dict(mu=(0.3, 0.15)), (0.004, 0.004004, 0.004004, 0.001), 0.0),
    ],
    ids=["not associated, oblique", "with a pause"],
)
def test_nodes_free_in_one_direction_follow_the_slip_in_both(law, ways, angle):
    """Moved along x, free along y: all solvers find the same state, which moving the plane instead has, too, node by node."""
    axis, found = (np.cos(angle), np.sin(angle), 0.0), {}
    for name in (*SOLVERS, "plane moved"):
        problem, contact, head, pushed = block(SOLVERS.get(name), axis, law=law)
        drive(head, 0.0, 0.0, -0.01)
        problem.solve()
        for way in ways:
            if name == "plane moved":
                contact.surface.displacement = (-way, 0.0, 0.0)
                drive(head, 0.0, 0.25 * way, -0.01)
            else:
                pushed[0].value = way
                drive(head, way, 0.25 * way, -0.01)
            step = problem.solve()
            assert max(step.error, step.slip_error) < 1e-9
            if way == ways[0]:
                r = scenes.gathered(contact)[1]
                slip = scenes.by_position(SimpleNamespace(contact=contact), "slip_increment")
                r, slip = r[:, :2] / r[:, -1:] @ contact.frame[:2, :2], slip @ contact.frame[:2, :2]
                assert np.abs(r + drag(slip, axis, law["mu"], law.get("p", law["mu"]))).max() < 1e-6
        found[name] = np.append(
            scenes.gathered(contact)[1].ravel(), 1e3 * total(contact.dissipation)
        )
    size = np.abs(found["condensed"]).max()
    for name, state in found.items():
        assert np.abs(state - found["condensed"]).max() < 1e-7 * size, name


def test_a_support_is_the_limit_of_stiff_springs():
    """Springs in place of the support, ten times as stiff: a tenth of the difference, where all slides."""
    axis, states = (0.6, 0.8, 0.0), []
    for springs in (None, 1e6, 1e7):
        problem, contact, head, pushed = block(dc.SparseNewton(), axis, springs=springs)
        drive(head, 0.0, 0.0, -0.01)
        problem.solve()
        for way in (0.01, 0.02, 0.03):
            pushed[0].value = way
            drive(head, way, 0.25 * way, -0.01)
            problem.solve()
        states.append(scenes.gathered(contact)[1])
    far, near = (np.abs(state - states[0]).max() for state in states[1:])
    assert near < 0.15 * far < 1e-4 * np.abs(states[0]).max()


@pytest.mark.parametrize("by", ["support", "roll"])
def test_a_bar_held_along_a_roll_rubs_along_it(by):
    """Plane strain with the roll moved along its axis, or the bar: every node has the law's friction, along the axis in the end."""
    domain = mesh.create_box(
        COMM, [np.zeros(3), [1, 0.5, 0.5]], [5, 1, 2], mesh.CellType.hexahedron
    )
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v, head = fem.Function(V), ufl.TestFunction(V), fem.Function(V)
    top, foot = (
        mesh.locate_entities_boundary(domain, 2, lambda x, z=z: np.isclose(x[2], z))
        for z in (0.5, 0)
    )
    along = fem.Constant(domain, 0.0)
    every = fem.locate_dofs_geometrical((V.sub(1), V.sub(1).collapse()[0]), lambda x: x[0] < 9)[0]
    bcs = [
        fem.dirichletbc(along, every, V.sub(1)),
        fem.dirichletbc(head, fem.locate_dofs_topological(V, 2, top)),
    ]
    roll = dc.RigidCylinder((0.5, 0.25, -2.0), (0, 1, 0), 2.0)
    contact = dc.Contact(V, foot, roll, dc.Friction(0.3))
    problem = dc.ContactProblem(scenes.elasticity(u, v, 1e3, 0.3), u, [contact], bcs=bcs, tol=1e-10)
    drive(head, 0.0, 0.0, -0.02)
    problem.solve()
    assert abs(contact.force()[1]) < 1e-12 * contact.force()[2]
    for way in (0.5, 1.0):
        if by == "support":
            along.value = way
            drive(head, 0.0, way, -0.02)
        else:
            roll.displacement = (0.0, -way, 0.0)
        problem.solve()
    touching = contact.reaction[:, -1] > 0.0
    forces = np.einsum("ni,nij->nj", contact.reaction, contact.points.frames)[touching]
    assert (
        np.abs(forces[:, 1] + 0.3 * contact.reaction[touching, -1]).max(initial=0.0)
        < 1e-4 * contact.force()[2]
    )
    assert contact.force()[1] < -0.299 * total(contact.reaction[:, -1])


def pressed_square(free, held="all", solver=None, mu=0.3):
    """A square below a fixed ceiling, on a plane that force drives; its nodes, or those of a side, held along it."""
    domain = mesh.create_unit_square(COMM, 4, 4, mesh.CellType.quadrilateral)
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = scenes.elasticity(u, v, 1e3, 0.3)
    foot, face, top = (
        mesh.locate_entities_boundary(domain, 1, lambda x, i=i, at=at: np.isclose(x[i], at))
        for i, at in ((1, 0.0), (0, 0.0), (1, 1.0))
    )
    push = fem.Constant(domain, 0.0)
    if held == "all":
        along = fem.locate_dofs_geometrical((V.sub(0), V.sub(0).collapse()[0]), lambda x: x[0] < 9)[0]  # fmt: skip
    else:
        along = fem.locate_dofs_topological(V.sub(0), 1, face)
    ceiling = fem.dirichletbc(
        fem.Constant(domain, 0.0), fem.locate_dofs_topological(V.sub(1), 1, top), V.sub(1)
    )
    plane = dc.RigidPlane((0, 0), (0, 1))
    plane.free = free
    contact = dc.Contact(V, foot, plane, dc.Friction(mu))
    bcs = [fem.dirichletbc(push, along, V.sub(0)), ceiling]
    return dc.ContactProblem(F, u, [contact], bcs=bcs, solver=solver, tol=1e-10), contact, push, plane  # fmt: skip


DRIVEN = {"condensed": dc.CondensedNewton(), "fixed point": dc.FixedPoint()}


@pytest.mark.parametrize("solver", DRIVEN)
def test_held_nodes_share_what_drives_a_plane(solver):
    """All nodes held, the plane pulled: friction in proportion to mu r_n, in balance with the force, whatever the sign."""
    problem, contact, push, plane = pressed_square(
        ("t", "n"), solver=DRIVEN[solver], mu=lambda x: 0.2 + 0.2 * x[0]
    )
    plane.force = (0.0, 1.0)
    problem.solve()
    assert np.abs(contact.reaction[:, 0]).max(initial=0.0) < 1e-12
    most = total(contact.friction.mu[:, 0] * contact.reaction[:, 1])
    for pulled in (-0.2, 0.1, 0.99 * most):
        plane.force = (pulled, 1.0)
        step = problem.solve()
        r = contact.reaction
        share = contact.friction.mu[:, 0] * r[:, 1] * pulled / most
        assert np.abs(contact.force() - (pulled, 1.0)).max() < 1e-9
        assert np.abs(r[:, 0] - share).max(initial=0.0) < 1e-9
        assert step.counts.slip == 0 and abs(plane.displacement[0]) < 1e-15
        assert total(contact.dissipation) == 0.0
    push.value = 0.1  # nodes carry the plane along
    problem.solve()
    assert abs(plane.displacement[0] - 0.1) < 1e-12
    assert np.abs(contact.force() - (0.99 * most, 1.0)).max() < 1e-9
    plane.force = (1.01 * most, 1.0)
    with pytest.raises(dc.NotConverged, match="slides away"):
        problem.solve()


@pytest.mark.parametrize("solver", DRIVEN)
def test_a_plane_on_a_spring_slides_past_held_nodes(solver):
    """Stick until the spring pulls with mu N, then its end runs ahead by mu N / k; its work is mu N a way."""
    problem, contact, _, plane = pressed_square(("t", "n"), solver=DRIVEN[solver])
    plane.force, plane.stiffness = (0.0, 1.0), {"t": 10.0}
    at, worked = 0.0, 0.0
    for end in (0.02, 0.03, 0.05, 0.1, 0.1, 0.06, 0.0):
        plane.drive = (end, 0.0)
        step = problem.solve()
        before, at = at, np.clip(at, end - 0.03, end + 0.03)
        worked += 0.3 * abs(at - before)
        assert abs(plane.displacement[0] - at) < 1e-9
        assert np.abs(contact.force() - (10 * (end - at), 1.0)).max() < 1e-8
        assert np.abs(contact.slip_increment + (at - before)).max(initial=0.0) < 1e-9
        assert abs(total(contact.dissipation) - worked) < 1e-9 and step.error < 1e-9


@pytest.mark.parametrize("nonlinear", [False, True])
def test_a_spring_pulls_a_plane_past_held_nodes_in_one_step(nonlinear):
    """Pulled at once, from stick, far beyond mu N: the plane stands where its spring pulls with mu N, of a nonlinear body, too."""
    problem, contact, _ = belt(side=False, nonlinear=nonlinear, wear=None)
    plane = contact.surface
    plane.free, plane.force = ("t",), (0.1, 0.0)
    problem.solve()
    assert np.abs(contact.force() - (0.1, 1.0)).max() < 1e-8
    plane.force = (0.4, 0.0)
    with pytest.raises(dc.NotConverged, match="slides away"):
        problem.solve()
    plane.force, plane.stiffness, plane.drive = (0.0, 0.0), {"t": 10.0}, (0.1, 0.0)
    problem.solve()
    assert np.abs(contact.force() - (0.3, 1.0)).max() < 1e-8
    assert abs(plane.displacement[0] - 0.07) < 1e-8


def test_a_plane_slides_past_the_nodes_of_a_held_side():
    """Nodes of a side held, others elastic: both solvers agree, and the same motion of the plane makes the same reactions."""
    found = []
    for solver in DRIVEN:
        problem, contact, _, plane = pressed_square(("t", "n"), "side", DRIVEN[solver])
        plane.force = (0.0, 1.0)
        problem.solve()
        for pulled in (-0.2, -0.28, 0.1):
            plane.force = (pulled, 1.0)
            problem.solve()
            assert np.abs(contact.force() - (pulled, 1.0)).max() < 1e-8
            if pulled == -0.2:
                way, driven = plane.displacement[0], scenes.gathered(contact)[1]
        found.append(scenes.gathered(contact)[1])
    assert np.abs(found[0] - found[1]).max() < 1e-8
    problem, contact, push, plane = pressed_square(("n",), "side")
    plane.force = (0.0, 1.0)
    problem.solve()
    plane.displacement = plane.displacement + (way, 0.0)
    problem.solve()
    assert way < 0.0 and np.abs(scenes.gathered(contact)[1] - driven).max() < 1e-8


@pytest.mark.parametrize(
    "free, force", [(("t1", "n"), (0.7, 0.0)), (("t1", "t2", "n"), (0.5, -0.3))]
)
def test_held_nodes_in_space_share_along_one_or_two_directions(free, force):
    """A foot held as a whole carries what drives the plane, in the cone, each node in proportion to its normal force."""
    axis = (0.6, 0.8, 0.0)
    problem, contact, head, _ = block(dc.CondensedNewton(), axis, held="all")
    plane = contact.surface
    turned = np.array([axis, (-0.8, 0.6, 0.0)])
    plane.free, plane.force = free, (0.0, 0.0, 10.0)
    problem.solve()
    plane.force = (*(np.array(force) @ turned)[:2], 10.0)
    step = problem.solve()
    assert np.abs(contact.force() - plane.force).max() < 1e-8
    assert (contact.load_function <= 1e-9).all() and step.counts.slip == 0
    ratio = contact.reaction[:, :2] / contact.reaction[:, 2:]
    mean = np.array([total(contact.reaction[:, k]) for k in (0, 1)]) / 10.0
    assert np.abs(ratio - mean).max(initial=0.0) < 1e-9
    plane.force = (*(10 * np.array(force) @ turned)[:2], 10.0)
    with pytest.raises((dc.NotConverged, ValueError), match="slides"):
        problem.solve()


def test_how_guided_nodes_hold_a_driven_plane_is_not_known():
    """Nodes free in another direction, and a plane of symmetry across a free motion: refused, and left out it is solved."""
    problem, contact, head, _ = block(dc.CondensedNewton())
    drive(head, 0.0, 0.0, -0.01)
    contact.surface.free, contact.surface.force = ("t1", "n"), (0.0, 0.0, 10.0)
    with pytest.raises(ValueError, match="Leave these motions out"):
        problem.solve()
    contact.surface.free, contact.surface.force = ("t2", "n"), (0.0, 0.1, 10.0)
    problem.solve()
    assert np.abs(contact.force()[1:] - (0.1, 10.0)).max() < 1e-8


def test_a_driven_plane_carries_a_block_whose_side_is_held():
    """Under dead weight, nodes of the side free in the other direction: both solvers agree, and friction is that of the weight."""
    found = []
    for solver in (dc.CondensedNewton(), dc.FixedPoint()):
        domain = mesh.create_unit_cube(COMM, 2, 2, 2, mesh.CellType.hexahedron)
        V = functionspace(domain, ("Lagrange", 1, (3,)))
        u, v = fem.Function(V), ufl.TestFunction(V)
        F = scenes.elasticity(u, v, 1000.0, 0.3)

        def held(i, axis, at, V=V, domain=domain):
            side = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[axis], at))
            dofs = fem.locate_dofs_topological(V.sub(i), 2, side)
            return fem.dirichletbc(fem.Constant(domain, 0.0), dofs, V.sub(i))

        foot = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[2], 0))
        plane = dc.RigidPlane((0, 0, 0), (0, 0, 1), axis=(1, 0, 0))
        contact = dc.Contact(V, foot, plane, dc.Friction(0.3))
        bcs = [held(1, 2, 1), held(2, 2, 1), held(0, 0, 0)]
        problem = dc.ContactProblem(F, u, [contact], bcs=bcs, solver=solver, tol=1e-9)
        plane.free, plane.force, plane.displacement = ("n",), (0, 0, 20.0), (0.05, 0, 0)
        assert problem.solve().counts.slip == 9
        found.append(contact.force())
    assert np.abs(found[0] - found[1]).max() < 1e-6
    assert found[0][2] == pytest.approx(20.0, rel=1e-8) and 5.0 < found[0][0] <= 6.0
