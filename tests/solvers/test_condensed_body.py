# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The condensed operator of a body, and CondensedNewton as solver of a ContactProblem."""

import contextlib
import io
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from dolfinx_contact.solvers import automatic
from dolfinx_contact.solvers.base import SolverResult
from dolfinx_contact.solvers.condensed import body as condensed
from dolfinx_contact.solvers.condensed import compliance
from dolfinx_contact.step.errors import Errors

CASES = {
    "isotropic": dict(mu=0.2, p=None),
    "orthotropic": dict(mu=(0.3, 0.15), p=None),
    "non-associated": dict(mu=(0.3, 0.15), p=(0.05, 0.2)),
    "frictionless": dict(mu=0.0, p=None),
    "plane strain": dict(mu=0.2, p=None, cells=(6, 3)),
}
PROGRAMME = [(0, 0, -0.005), (0.001, 0.0005, -0.01), (0.002, -0.001, -0.006), (0.01, 0, -0.002)]


def run(programme=PROGRAMME, **options):
    """Local reactions of all nodes after each step, and the records of the steps."""
    scene = scenes.block(**options)
    reactions, steps = [], []
    for top in programme:
        gdim = scene.mesh.geometry.dim
        scene.move_top(*((top[0], top[2]) if gdim == 2 else top))
        steps.append(scene.problem.solve())
        reactions.append(scenes.gathered(scene.contact)[1])
    return np.array(reactions), steps


@pytest.mark.parametrize("case", CASES)
def test_both_solvers_agree(case):
    """Reactions of every step agree to 1e-8 between the fixed point and the condensed method."""
    options = {"tol": 1e-11, **CASES[case]}
    newton, steps = run(solver=dc.CondensedNewton(), **options)
    fixed, _ = run(solver=dc.FixedPoint(map="bipotential"), **options)
    assert np.abs(newton - fixed).max() <= 1e-8 * np.abs(fixed).max()
    for step in steps:
        assert step.solver is dc.SolverName.CONDENSED_NEWTON and step.reason == ""
        assert max(step.error, step.slip_error) <= 1e-11
        assert step.tried[-1].converged


def test_default_says_what_it_chose_and_why():
    """Without a solver small contacts take Newton's method; the record names it and the reason."""
    _, steps = run()
    for step in steps:
        assert step.solver == "CondensedNewton" and step.reason.startswith("25 contact nodes")


def test_default_falls_back(monkeypatch):
    """Where one solver fails the other one takes over, and the record says so."""

    def give_up(self, step, starts, start=None):
        state = step.measure(step.body.free_state(step.b))
        return SolverResult(state, 1, 1.0, "CondensedNewton")

    monkeypatch.setattr(condensed.BoundCondensedNewton, "solve", give_up)
    reactions, steps = run()
    assert steps[0].solver == dc.SolverName.FIXED_POINT
    assert "CondensedNewton ended at" in steps[0].reason
    monkeypatch.undo()
    reference, _ = run()
    assert np.abs(reactions - reference).max() <= 1e-8 * np.abs(reference).max()


def test_memory_is_estimated_before_it_is_taken(monkeypatch):
    """An operator that would not fit is refused with the alternative named; the default avoids it."""
    monkeypatch.setattr(compliance, "free_memory", lambda: 1000.0)
    with pytest.raises(MemoryError, match="FixedPoint"):
        run(solver=dc.CondensedNewton())
    _, steps = run()
    assert steps[0].solver == dc.SolverName.FIXED_POINT and "memory" in steps[0].reason


def test_memory_that_the_cache_of_files_holds_is_free(monkeypatch):
    """A machine whose cache is full, as after long runs, has next to no unused memory and can give nearly all."""
    said = "MemFree:  100 kB\nMemAvailable: 9000 kB\nCached:  8900 kB\n"
    monkeypatch.setattr("builtins.open", lambda name: io.StringIO(said))
    free = compliance.free_memory()
    monkeypatch.undo()
    assert free == 9000 * 1024


def test_operator_is_the_compliance_of_the_contact_nodes():
    """W r is the displacement that reactions r cause, by a solve with the body itself."""
    scene = scenes.block(solver=dc.CondensedNewton())
    scene.move_top(0, 0, -0.005)
    scene.problem.solve()
    problem = scene.problem
    operator = problem.bound()
    rng = np.random.default_rng(0)
    r = rng.normal(size=(operator.nodes, 3))
    W = operator.compliance()
    x = operator.displacement(np.zeros(problem.body.size), r.ravel())
    local = operator.gather(scene.contact.points.motion(x))
    if scene.mesh.comm.rank == 0:
        expected = (W @ r.ravel()).reshape(-1, 3)
        assert np.abs(local - expected).max() <= 1e-12 * np.abs(expected).max()
        assert np.array_equal(W, W.T)


@pytest.mark.parametrize("cells", [(4, 4, 2), (6, 3)])
def test_without_friction_normal_components_alone(cells):
    """mu = 0 keeps the normal rows of W, and its reactions are the limit of those with friction."""
    found, _ = run(mu=0.0, p=None, cells=cells, solver=dc.CondensedNewton())
    friction, _ = run(mu=1e-12, p=None, cells=cells, solver=dc.CondensedNewton())
    assert np.abs(found - friction).max() <= 1e-8 * np.abs(friction).max()
    assert not found[..., :-1].any()
    W = []
    for mu in (0.0, 1e-12):
        scene = scenes.block(mu=mu, p=None, cells=cells, solver=dc.CondensedNewton())
        scene.problem.load_step()
        body = scene.problem.bound()
        W.append(body.compliance())
    if scene.mesh.comm.rank == 0:
        normal = W[1][len(cells) - 1 :: len(cells), len(cells) - 1 :: len(cells)]
        assert W[0].shape == (body.nodes, body.nodes)
        assert np.abs(W[0] - normal).max() <= 1e-12 * np.abs(normal).max()


@pytest.mark.parametrize("mu", [0.0, (0.3, 0.15)])
def test_ranks_without_contact_nodes_take_part(mu):
    """With the contact of a tall stack on one rank Newton's method gives the fixed point's reactions."""
    found = []
    for solver in (dc.CondensedNewton(), dc.FixedPoint()):
        scene = scenes.block(cells=(2, 2, 12), mu=mu, p=None, tol=1e-11, solver=solver)
        scene.move_top(0.001, 0.0, -0.01)
        scene.problem.solve()
        found.append(scenes.gathered(scene.contact)[1])
    assert np.abs(found[0] - found[1]).max() <= 1e-8 * np.abs(found[1]).max()


@pytest.mark.parametrize("solver", [dc.CondensedNewton, dc.FixedPoint])
def test_friction_per_node_where_ranks_have_no_contact_node(solver):
    """A field of coefficients, with wear, gives on all ranks together what it gives on one."""

    def pressed(comm):
        scene = scenes.block(comm, cells=(2, 2, 12), tol=1e-11)
        nodes = scene.contact.x
        mu = np.column_stack((0.2 + 0.1 * nodes[:, 0], 0.3 + 0.2 * nodes[:, 1]))
        friction = dc.Friction(mu, p=(0.05, 0.20), axes=np.tile([0.6, 0.8], (len(mu), 1)))
        contact = dc.Contact(scene.V, scene.facets, scene.surface, friction, wear=dc.Wear(1e-4))
        problem = dc.ContactProblem(
            scene.F, scene.u, [contact], bcs=scene.bcs, J=None, solver=solver(), tol=1e-11
        )
        for top in ((0.001, 0.0, -0.01), (0.004, 0.002, -0.01)):
            scene.move_top(*top)
            problem.solve()
        return contact, scenes.gathered(contact)[1]

    (contact, together), (_, alone) = pressed(scenes.COMM), pressed(MPI.COMM_SELF)
    fewest = scenes.COMM.allreduce(len(contact.nodes), op=MPI.MIN)
    assert fewest == 0 or scenes.COMM.size == 1
    assert contact.friction.mu.shape == (len(contact.nodes), 2)
    assert np.abs(together - alone).max() <= 1e-8 * np.abs(alone).max()


def test_operator_is_kept_while_the_matrix_stands():
    """New loads keep W, a new modulus replaces it, and the answers follow."""
    scene = scenes.block(solver=dc.CondensedNewton())
    scene.move_top(0, 0, -0.005)
    scene.problem.solve()
    first, kept = scenes.gathered(scene.contact)[1], scene.problem.bound().operator
    scene.move_top(0.001, 0, -0.006)
    scene.problem.solve()
    assert scene.problem.bound().operator is kept
    scene.modulus.value *= 2
    scene.problem.reset()
    scene.move_top(0, 0, -0.005)
    scene.problem.solve()
    assert scene.problem.bound().operator is not kept or scenes.COMM.rank > 0  # which has none
    assert scenes.gathered(scene.contact)[1] == pytest.approx(2 * first, abs=1e-8 * first.max())


def test_iterative_linear_solver():
    """Another linear solver than MUMPS gives W column by column, and the same answers."""
    iterative = {"ksp_type": "cg", "pc_type": "jacobi", "ksp_rtol": 1e-14, "ksp_max_it": 10_000}
    options = dict(solver=dc.CondensedNewton(), cells=(2, 2, 1), tol=1e-9)
    found, _ = run(PROGRAMME[:2], petsc_options=iterative, **options)
    reference, _ = run(PROGRAMME[:2], **options)
    assert np.abs(found - reference).max() <= 1e-7 * np.abs(reference).max()


@pytest.mark.parametrize("cap", [dict(max_iterations=1), dict(max_seconds=1e-9)])
def test_caps_on_iterations_and_seconds(cap):
    """A step that ends at a cap carries its best state and what was tried; the problem can be used on."""
    scene = scenes.block(solver=dc.CondensedNewton(**cap))
    scene.move_top(0, 0, -0.005)
    with pytest.raises(dc.NotConverged) as caught:
        scene.problem.solve()
    failure = caught.value
    assert failure.step.error > scene.problem.tol and failure.step.seconds < 5
    assert [attempt.branch for attempt in failure.step.tried] == ["newton"] * (
        "max_iterations" in cap
    )
    assert failure.displacement.shape == (scene.problem.body.size,)
    assert [r.shape for r in failure.reactions] == [scene.contact.reaction.shape]
    assert not scene.contact.reaction.any()
    scene.problem.solver = dc.CondensedNewton(max_seconds=60)
    assert scene.problem.solve().error <= scene.problem.tol


def test_closing_opening_and_closing_again():
    """Nodes come into contact, leave it and return; lifted off entirely nothing remains."""
    scene = scenes.block()
    for top, touches in [((0, 0, -0.005), True), ((0, 0, 0.1), False), ((0.02, 0, 0.1), False), ((0.02, 0, -0.004), True)]:  # fmt: skip
        scene.move_top(*top)
        step = scene.problem.solve()
        assert (step.counts.open == 25) != touches
        assert max(step.error, step.slip_error) <= 1e-10


def punch(cells, fixed, solver, friction, programme):
    """Totals of a block on [0, 1] or [-1, 1] whose top is pressed, ``fixed`` holding symmetry planes."""
    low = [0.0 if axis in fixed else -1.0 for axis in (0, 1)] + [0.0]
    domain = mesh.create_box(
        scenes.COMM, [np.array(low), np.array([1.0, 1.0, 0.8])], cells, mesh.CellType.hexahedron
    )
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    facets = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[2], 0.0))
    top = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[2], 0.8))
    held = fem.Function(V)
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, top))]
    for axis in fixed:
        side = mesh.locate_entities_boundary(
            domain, 2, lambda x, axis=axis: np.isclose(x[axis], 0.0)
        )
        dofs = fem.locate_dofs_topological(V.sub(axis), 2, side)
        bcs.append(fem.dirichletbc(fem.Constant(domain, 0.0), dofs, V.sub(axis)))
    plane = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1), axis=(1, 0, 0))
    contact = dc.Contact(V, facets, plane, friction)
    F = scenes.elasticity(u, v, 210e3, 0.3)
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, solver=solver, tol=1e-10)
    found = []
    for depth in programme:
        held.x.array[2::3] = -depth
        problem.solve()
        x, r = scenes.gathered(contact)
        # Nodal reactions on a symmetry plane are half (at the corner a quarter) of the whole body's.
        share = np.prod([np.where(np.isclose(x[:, axis], 0.0), 0.5, 1.0) for axis in fixed], axis=0)
        found.append((x, r / np.reshape(share, (-1, 1)) if fixed else r))
    return found


@pytest.mark.parametrize("solver", [dc.CondensedNewton, dc.FixedPoint])
@pytest.mark.parametrize("law", [dict(mu=0.2), dict(mu=(0.3, 0.15), p=(0.05, 0.2))])
def test_a_quarter_of_the_punch_is_a_quarter_of_the_whole(solver, law):
    """Symmetry planes by tangential boundary conditions at contact nodes change nothing else."""
    programme, friction = (0.01, 0.02, 0.012), dc.Friction(**law)
    whole = punch((4, 4, 2), (), solver(), friction, programme)
    quarter = punch((2, 2, 2), (0, 1), solver(), friction, programme)
    for (x, r), (y, part) in zip(whole, quarter):
        same = [np.argmin(np.linalg.norm(x - point, axis=1)) for point in y]
        assert np.linalg.norm(x[same] - y) < 1e-12
        assert np.abs(r[same] - part).max() <= 1e-8 * np.abs(r).max()


@pytest.mark.parametrize("end,given", [(1.0, False), (1e-2, False), (1e-5, True)])
def test_where_the_second_solver_starts(end, given):
    """The second solver of the default has a start of its own, unless the end of the first one misses no more than digits."""
    starts, ends = [], []

    def solver(error):
        def solve(step, _, start):
            starts.append(start)
            ends.append(SimpleNamespace(errors=Errors(error, 0.0, 0.0)))
            ends[-1].judged = ends[-1]
            return SolverResult(ends[-1], 1, error, "this one", ())

        return SimpleNamespace(solve=solve, update=lambda step: None)

    bound = object.__new__(automatic.BoundAutomatic)
    bound._why, bound._solvers, bound._bound = "", [0, 1], {0: solver(end), 1: solver(0.0)}
    bound.solve(SimpleNamespace(tol=1e-8, statics=None, slides=lambda state: False), ())
    assert starts[0] is None and (starts[1] is ends[0] if given else starts[1] is None)


@pytest.mark.filterwarnings("ignore:contact carries:UserWarning")  # its change is made up
def test_one_budget_for_all_searches_of_a_step(monkeypatch):
    """All searches of a step have ``max_seconds`` together: what each may take is what is left, not the whole again."""
    given, own = [], dc.CondensedNewton.search

    def watched(self, *arguments, **options):
        given.append(self.max_seconds)
        found, converged = own(self, *arguments, **options)
        return replace(found, change=1.0), converged  # the step searches again

    monkeypatch.setattr(dc.CondensedNewton, "search", watched)
    scene = scenes.block(solver=dc.CondensedNewton(max_seconds=25))
    scene.move_top(0.001, 0.0005, -0.01)
    with contextlib.suppress(dc.NotConverged):
        scene.problem.solve()
    if scene.mesh.comm.rank == 0:
        assert len(given) > 1
        assert 25 > given[0] and (np.diff(given) < 0).all()


@pytest.mark.parametrize("mu", [0.3, 0.0])
def test_frames_that_turn_cost_no_solves(mu, monkeypatch):
    """On a ball W of later steps is made of the columns that the first one has solved for, and is the same as one solved anew."""
    asked, solver = [], compliance.block_solver

    def counted(ksp):
        solve = solver(ksp)
        return lambda rows: asked.append(rows.shape[0]) or solve(rows)

    monkeypatch.setattr(compliance, "block_solver", counted)
    low, high = [-0.5, -0.5, 0.0], [0.5, 0.5, 0.6]
    domain = mesh.create_box(MPI.COMM_WORLD, [low, high], [4, 4, 2], mesh.CellType.hexahedron)
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, held = fem.Function(V), fem.Constant(domain, np.zeros(3))
    foot, head = (mesh.locate_entities_boundary(domain, 2, lambda x, z=z: np.isclose(x[2], z)) for z in (0, 0.6))  # fmt: skip
    F = scenes.elasticity(u, ufl.TestFunction(V), 100.0, 0.3)
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, head), V)
    contact = dc.Contact(V, foot, dc.RigidSphere((0, 0, -3), 3.0), mu)
    problem = dc.ContactProblem(F, u, contact, bcs=[bc], solver=dc.CondensedNewton())
    for way in (0.0, 0.05, 0.1):
        held.value[:] = way, 0.0, -0.02
        problem.solve()
        assert sum(asked) == 3 * 25
    bound = problem.bound()
    W = bound.compliance()
    anew = compliance.compliance(problem.body, [bound._rows(), bound._anchor_rows()])  # noqa: SLF001
    if MPI.COMM_WORLD.rank == 0:
        assert np.abs(W - anew).max() <= 1e-12 * W.max()
