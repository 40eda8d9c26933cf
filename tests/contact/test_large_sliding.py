# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Two deformable bodies that slide over many facets: even pressures, forces of fine steps, balance, slip that is objective."""

import warnings

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from two_bodies import COMM, E, blocks, dc, largest, rubber, stress, work

from dolfinx_contact import problem_input
from dolfinx_contact.compat import cell_points, functionspace
from dolfinx_contact.results.meshes import SurfaceMesh
from dolfinx_contact.solvers.fixed_point.preconditioner import ContactPreconditioner
from mechanics.two_blocks import box, joined, pair

pytestmark = pytest.mark.ranks


def total(values) -> np.ndarray:
    return COMM.allreduce(np.sum(values, axis=0))


def even(cell, degree, cells, sides, swapped):
    """A block on a larger one without lateral strain; what it leaves bare carries the pressure that it does."""
    domain, top, bottom, upper, lower, _ = pair(cell, cells, sides)
    d, p = domain.geometry.dim, 1e-4 * E
    V = functionspace(domain, ("Lagrange", degree, (d,)))
    u, v, way = fem.Function(V), ufl.TestFunction(V), fem.Constant(domain, np.zeros(d))
    bare = fem.Function(functionspace(domain, ("DG", 0)))
    tags = mesh.meshtags(domain, d - 1, np.sort(lower), np.ones(lower.size, np.int32))
    ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)
    F = ufl.inner(stress(u, 0.0, E / 2), ufl.grad(v)) * ufl.dx + p * bare * v[d - 1] * ds(1)
    bcs = [fem.dirichletbc(way, fem.locate_dofs_topological(V, d - 1, top), V)]
    bcs.append(fem.dirichletbc(np.zeros(d), fem.locate_dofs_topological(V, d - 1, bottom), V))
    slave, master = (lower, upper) if swapped else (upper, lower)
    contact = dc.Contact(V, slave, dc.DeformableSurface(V, master), dc.Friction(0.0))
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, tol=1e-10, geometry_tol=1e-8)
    count = bare.x.array.size
    middle = domain.geometry.x[cell_points(domain)[:count]].mean(axis=1)[:, : d - 1]

    def slide(to):
        way.value[:] = [*to, -2 * p / E]
        off = np.abs(middle - sides[1] / 2 - to).max(axis=1)
        bare.x.array[:] = off > sides[0] / 2
        return problem.solve()

    return slide, contact, p, V, u


@pytest.mark.parametrize(
    "cell, degree, cells, sides, swapped",
    [
        ("quadrilateral", 1, ((5, 1), (12, 1)), (1.0, 3.0), False),
        ("triangle", 2, ((3, 1), (12, 1)), (1.0, 3.0), False),
        ("hexahedron", 1, ((3, 3, 1), (4, 4, 1)), (1.0, 2.0), False),
        pytest.param("quadrilateral", 1, ((5, 1), (12, 1)), (1.0, 3.0), True, marks=pytest.mark.slow),
        pytest.param("tetrahedron", 2, ((3, 3, 1), (4, 4, 1)), (1.0, 2.0), False, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_an_even_pressure_slides_along(cell, degree, cells, sides, swapped):
    """Over meshes that do not match an even pressure stays even: every node has it times its area, and displacements are linear."""
    slide, contact, p, V, u = even(cell, degree, cells, sides, swapped)
    flat = len(cells[0]) == 2
    for to in ((0.0,), (0.25,), (1.0,), (-0.5,)) if flat else ((0.0, 0.0), (0.5, 0.0), (-0.5, 0.5)):
        step = slide(np.array(to))
        assert step.error <= 1e-10 and step.geometry_error <= 1e-8
        assert largest(contact.reaction[:, -1] - p * contact.area) <= 1e-7 * p
        x, moved = V.tabulate_dof_coordinates(), u.x.array.reshape(-1, len(cells[0]))
        height = x[:, len(cells[0]) - 1]
        assert largest(moved[:, -1] + p / E * (height + 1)) <= 1e-7 * p / E


def ironed(steps, cell="quadrilateral", degree=1, cells=((4, 2), (15, 2)), far=0.8, press=0.02, size=(1.0, 3.0), **options):  # fmt: skip
    """A block pressed on a longer one and slid over its facets, of length 0.2; the force on it, and the scene."""
    scene = blocks(cell, degree, cells, size=size, sliding="large", **options)
    d = len(cells[0])
    for part in np.linspace(0.0, 1.0, steps + 1):
        scene.way.value[:] = [far * part, *[0.0] * (d - 2), -press]
        scene.problem.solve()
    return scene.contact.force(), scene


@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("swapped", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["upper", "lower"])  # fmt: skip
def test_ironing(degree, swapped):
    """One facet a step: the force is within 1 % of that of steps ten times finer, and that on both bodies is in balance."""
    coarse, scene = ironed(4, degree=degree, swapped=swapped)
    left = np.zeros(scene.contact.points.size)
    scene.contact.assemble_reaction(left)
    assert np.abs(total(left.reshape(-1, 2))).max() <= 1e-12 * np.abs(coarse).max()
    fine, _ = ironed(40, degree=degree, swapped=swapped)
    assert np.abs(coarse - fine).max() <= 0.01 * np.abs(fine).max()


@pytest.mark.parametrize("steps, off", [(1, 0.02), (4, 0.01)])
def test_work_of_nodes_that_come_and_go(steps, off):
    """Of a slave that is the larger body, nodes come in over the edge of the other one and leave: work of friction is that of fine steps, with four facets a step, too."""
    long, fine = (ironed(n, swapped=True)[1].contact for n in (steps, 40))
    assert total(long.dissipation) == pytest.approx(total(fine.dissipation), rel=off)


@pytest.mark.parametrize("cell, degree", [("hexahedron", 1), *[pytest.param(cell, 2, marks=pytest.mark.slow) for cell in ("hexahedron", "tetrahedron")]])  # fmt: skip
def test_ironing_in_space(cell, degree):
    """As in the plane, with edges across and along the way that cover facets in part, as the block reaches the end of the other one."""
    coarse, fine = (ironed(n, cell, degree, ((2, 2, 1), (9, 5, 1)), size=(1.0, 2.0))[0] for n in (4, 40))  # fmt: skip
    assert np.abs(coarse - fine).max() <= 0.01 * np.abs(fine).max()


@pytest.mark.parametrize("solver", ["SparseNewton", *[pytest.param(name, marks=pytest.mark.slow) for name in ("FixedPoint", "SNES")]])  # fmt: skip
def test_solvers_agree_in_space(solver):
    """Slid obliquely by facets with orthotropic friction, every solver finds the same forces and work of friction."""
    found = []
    for name in ("CondensedNewton", solver):
        scene = blocks("hexahedron", 1, ((2, 2, 1), (6, 6, 1)), size=(1.0, 2.0), sliding="large", mu=(0.3, 0.15), p=(0.1, 0.2), axis=(1, 0.2, 0), solver=getattr(dc, name)(), geometry_tol=1e-4)  # fmt: skip
        for k in range(3):
            scene.way.value[:] = (0.15 * k, 0.1 * k, -0.01)
            step = scene.problem.solve()
        assert step.counts.slip > 0 and step.geometry_error <= 1e-4
        found.append(np.append(scene.contact.force(), total(scene.contact.dissipation)))
    assert found[0] == pytest.approx(found[-1], rel=1e-6)


def test_bodies_that_move_together_do_not_slip():
    """Both bodies go by several facets, and further than their size: forces stay, and nothing slips."""
    scene = blocks("quadrilateral", 1, ((4, 2), (13, 2)), size=(1.0, 2.0), sliding="large", mu=0.3)
    scene.way.value[:] = (0.001, -0.01)
    scene.problem.solve()
    before, path = scene.contact.reaction.copy(), total(scene.contact.slip_path)
    for way in (0.7, 3.0):
        scene.way.value[:], scene.foot.value[:] = (way + 0.001, -0.01), (way, 0.0)
        scene.problem.solve()
        assert largest(scene.contact.reaction - before) <= 1e-8 * largest(before)
    assert total(scene.contact.slip_path) - path <= 1e-9


def test_over_the_edge():
    """Nodes that slide over the edge of the other body carry nothing, the others go on, until none is left."""
    scene = blocks("quadrilateral", 1, ((4, 2), (6, 2)), size=(1.0, 1.0), sliding="large", mu=0.1)
    for way in (0.0, 0.15, 0.4, 0.65, 0.9):
        scene.way.value[:] = (way, -0.005)
        step = scene.problem.solve()
        off = scene.contact.x[:, 0] + way > 1.251  # with all their facets
        assert not scene.contact.reaction[off].any() and not scene.contact.covered[off].any()
        left = np.zeros(scene.contact.points.size)
        scene.contact.assemble_reaction(left)
        assert np.abs(total(left.reshape(-1, 2))).max() <= 1e-12 * largest(scene.contact.force())
    scene.way.value[0] = 1.2
    assert (
        scene.problem.solve().counts.open == step.counts.open + step.counts.slip + step.counts.stick
    )


def test_the_moment_is_that_of_where_bodies_are():
    """Of both blocks moved by three times their width the resultant acts in their middle; without a displacement the moment is refused."""
    scene = blocks("quadrilateral", 1, ((3, 2), (4, 2)), 0.0, sliding="large")
    scene.way.value[:], scene.foot.value[:] = (3.0, -0.02), (3.0, 0.0)
    scene.problem.solve()
    moment = float(np.ravel(scene.contact.moment(scene.problem.u))[0])
    assert moment == pytest.approx(3.5 * scene.contact.force()[1], rel=1e-6)
    with pytest.raises(ValueError, match="problem.u"):
        scene.contact.moment()


@pytest.mark.parametrize("swapped", [False, True], ids=["upper", "lower"])
def test_taken_away_and_put_back(swapped):
    """A block that was beside the other one, where its nodes are opposite nothing, presses as one that never left, on which side the unknowns are."""
    forces = []
    for ways in ([(0, -0.02)], [(0, 0.1), (3, 0.1), (3, -0.05), (3, 0.1), (0, 0.1), (0, -0.02)], [(3, 0.1), (0, -0.02)]):  # fmt: skip
        scene = blocks("quadrilateral", 1, ((3, 2), (7, 2)), 0.0, swapped=swapped, sliding="large", size=(1.0, 2.0))  # fmt: skip
        for way in ways:
            scene.way.value[:] = way
            scene.problem.solve()
        forces.append(np.abs(scene.contact.force()))
    assert forces[0][1] > 1e-3 * E
    assert np.allclose(forces[1:], forces[:1], atol=1e-3 * forces[0][1])


def test_checkpoints_and_rewind(tmp_path):
    """A run that goes on from a file, or whose last step was taken back and made again, has the same bits on one rank."""
    whole, parted = (blocks("quadrilateral", 1, ((4, 2), (13, 2)), size=(1.0, 2.0), sliding="large") for _ in range(2))  # fmt: skip
    file = COMM.bcast(str(tmp_path / "state.npz"))
    for k in range(5):
        whole.way.value[:] = parted.way.value[:] = (0.2 * k, -0.01)
        whole.problem.solve()
        parted.problem.solve()
        if k == 2:
            parted.problem.rewind()
            parted.problem.solve()
            parted.problem.save(file)
            parted.problem.reset()
            parted.problem.load(file)
    for name in ("reaction", "slip_path", "dissipation", "gap", "covered"):
        one, other = (getattr(scene.contact, name) for scene in (whole, parted))
        assert np.array_equal(np.isinf(one), np.isinf(other))  # gaps where nothing is opposite
        one, other = one[np.isfinite(one)], other[np.isfinite(other)]
        assert largest(one - other) <= (0.0 if COMM.size == 1 else 1e-9 * largest(one))


@pytest.mark.parametrize(
    "cell, degree", [("quadrilateral", 1), ("triangle", 2), ("tetrahedron", 2)]
)
@pytest.mark.parametrize("sliding", ["large", "small"])
def test_there_is_no_gap_where_nothing_is_opposite(cell, degree, sliding, tmp_path):
    """Below the other body the gap is what separates both; elsewhere it is infinite, in files NaN, before and after steps, and as nodes slide out."""
    cells = ((2, 2, 1), (4, 4, 1)) if cell == "tetrahedron" else ((4, 2), (8, 2))
    scene = blocks(cell, degree, cells, size=(1.0, 2.0), sliding=sliding, swapped=True, gap=0.3)
    contact = scene.contact

    def check(away):
        off = np.abs(contact.x[:, : len(cells[0]) - 1] - 1.0 - away).max(axis=1)
        assert np.isinf(contact.gap[off > 0.8]).all()
        assert largest(contact.gap[off < 0.4] - 0.3) <= 1e-9
        assert np.array_equal(np.isinf(contact.gap), contact.covered == 0.0)

    axes = len(cells[0]) - 1
    check(np.zeros(axes))
    slides = (0.0, 0.25) if sliding == "large" else (0.0,)
    for slid in slides:
        scene.way.value[0] = slid
        scene.problem.solve()
        check(np.array([slid, 0.0][:axes]))
    mesh = SurfaceMesh(contact)(scene.u)
    if COMM.rank == 0:
        gap, bare = mesh.at_nodes["gap"], mesh.at_nodes["covered"] == 0.0
        assert np.isnan(gap[bare & (mesh.at_nodes["contact_node"] == 1)]).all()
        assert np.nanmin(gap) == pytest.approx(0.3) and np.nanmax(gap) == pytest.approx(0.3)
    scene.problem.reset()
    check(np.zeros(axes))


@pytest.mark.slow
@pytest.mark.parametrize("cell, degree, press", [("quadrilateral", 1, 0.1), ("triangle", 2, 0.1), ("quadrilateral", 1, 0.3)])  # fmt: skip
def test_rubber_is_ironed(cell, degree, press):
    """Bodies pressed by a tenth of their height: rows that follow the strain settle, and one facet a step is as good as a fifth."""
    coarse, _ = ironed(4, cell, degree, press=press, form=rubber)
    fine, _ = ironed(20, cell, degree, press=press, form=rubber)
    assert np.abs(coarse - fine).max() <= 0.01 * np.abs(fine).max()


@pytest.mark.parametrize("cell, degree", [("quadrilateral", 1), *[pytest.param(*case, marks=pytest.mark.slow) for case in (("triangle", 2), ("hexahedron", 2))]])  # fmt: skip
@pytest.mark.parametrize("moduli", [(E, 1e4 * E), (1e4 * E, E)], ids=["soft", "stiff"])
def test_moduli_far_apart(cell, degree, moduli):
    """One body is next to rigid, the slave or the other one: two solvers find the same where a gap closes, and forces balance."""
    forces = []
    cells = ((2, 2, 1), (3, 3, 1)) if cell == "hexahedron" else ((3, 2), (7, 2))
    for solver in (dc.CondensedNewton(), dc.FixedPoint()):
        scene = blocks(cell, degree, cells, size=(1.0, 2.0), sliding="large", moduli=moduli, gap=0.003, solver=solver, tol=1e-8)  # fmt: skip
        for k in range(3):
            scene.way.value[:] = [0.15 * k, *[0.0] * (len(cells[0]) - 2), -0.01]
            scene.problem.solve()
        left = np.zeros(scene.contact.points.size)
        scene.contact.assemble_reaction(left)
        forces.append(scene.contact.force())
        assert np.abs(total(left.reshape(-1, len(cells[0])))).max() <= 1e-12 * largest(forces[-1])
    assert largest(forces[0] - forces[1]) <= 1e-6 * largest(forces[0])


def test_rounds_of_a_step_share_a_preconditioner(monkeypatch):
    """Without a factorisation, renewed rows go on with the springs that are set up, and the answer has all digits."""
    made, rounds = [], []
    build, load = ContactPreconditioner.__init__, dc.ContactProblem.load_step
    monkeypatch.setattr(ContactPreconditioner, "__init__", lambda *given: made.append(build(*given)))  # fmt: skip
    monkeypatch.setattr(dc.ContactProblem, "load_step", lambda *given: rounds.append(1) or load(*given))  # fmt: skip
    options = {"ksp_type": "cg", "pc_type": "gamg", "ksp_rtol": 1e-10}
    scene = blocks("hexahedron", 1, ((2, 2, 2), (5, 5, 2)), size=(1.0, 2.0), sliding="large", tol=1e-9, petsc_options=options)  # fmt: skip
    for k in range(4):
        scene.way.value[:] = (0.3 * k, 0.0, -0.01)
        step = scene.problem.solve()
        assert max(step.error, step.slip_error, step.forward_error) <= 1e-9
    assert len(made) == 4 < len(rounds)


def test_multigrid():
    """Without a factorisation forces are the same."""
    options = {"ksp_type": "cg", "pc_type": "gamg", "ksp_rtol": 1e-10}
    found = []
    for given in (None, options):
        scene = blocks("hexahedron", 1, ((2, 2, 2), (5, 5, 2)), size=(1.0, 2.0), sliding="large", tol=1e-8, petsc_options=given)  # fmt: skip
        for k in range(2):
            scene.way.value[:] = (0.3 * k, 0.0, -0.01)
            step = scene.problem.solve()
        found.append(scene.contact.force())
    assert step.solver == dc.SolverName.FIXED_POINT
    assert largest(found[0] - found[1]) <= 1e-6 * largest(found[0])


def test_geometry_that_does_not_settle_is_refused_with_two_remedies():
    """No rows agree below rounding: steps are to be divided, and the other side may be the slave."""
    scene = blocks("quadrilateral", 1, ((2, 1), (3, 1)), sliding="large", mu=0.3)
    scene.way.value[:] = (0.05, -0.1)
    scene.problem.geometry_tol = 1e-300
    with pytest.raises(dc.NotConverged, match="Divide it, .*let the other body carry"):
        scene.problem.solve()


def test_a_body_that_lies_on_the_other():
    """Held by contact alone it carries its load while it may stick; a load that slides it off is refused, and the body named."""
    scene = blocks("quadrilateral", 1, ((4, 2), (9, 2)), size=(1.0, 2.0), sliding="large", mu=0.3, gap=0.01, held=False, tol=1e-8)  # fmt: skip
    for along in (0.0, 10.0, 20.0):
        scene.load.value[:] = (along, -100.0)
        scene.problem.solve()
        assert scene.contact.force() == pytest.approx([-along, 100.0], abs=1e-6)
    scene.load.value[0] = 50.0
    with pytest.raises(dc.NotConverged, match=r"translation along \(1, 0\) of one of its 2 separate parts"):  # fmt: skip
        scene.problem.solve()


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("push", [0.5, 1.5])
def test_a_body_that_is_pushed_off(push, swapped):
    """What friction has held slides off in a search: NotConverged, which names the motion, not a mistake of the user's; held back, it is solved."""
    scene = blocks("quadrilateral", 1, ((6, 4), (11, 4)), size=(1.0, 4.0), sliding="large", mu=0.3, held=False, swapped=swapped, tol=1e-8)  # fmt: skip
    pressed, V = fem.Constant(scene.domain, -0.01), scene.V.sub(1)
    scene.problem.bcs = [*scene.bcs, fem.dirichletbc(pressed, fem.locate_dofs_topological(V, 1, scene.ends[0]), V)]  # fmt: skip
    scene.problem.solve()
    normal = abs(scene.contact.force()[1])
    scene.load.value[0] = push * 0.3 * normal
    if push < 1.0:
        scene.problem.solve()
        assert abs(scene.contact.force()[0]) == pytest.approx(push * 0.3 * normal, rel=1e-6)
        return
    with pytest.raises(dc.NotConverged, match="translation along"):
        scene.problem.solve()
    scene.load.value[0] = 0.0
    assert scene.problem.solve().error <= 1e-8


def test_three_in_a_row():
    """A block slides on another one that lies on a rigid floor: both contacts carry the same."""
    domain, top, bottom, upper, lower, _ = pair("quadrilateral", ((4, 2), (9, 2)), (1.0, 2.0))
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, way = fem.Function(V), fem.Constant(domain, np.zeros(2))
    F = ufl.inner(stress(u, E / 2, E / 2), ufl.grad(ufl.TestFunction(V))) * ufl.dx
    contact = dc.Contact(V, upper, dc.DeformableSurface(V, lower), dc.Friction(0.3))
    floor = dc.Contact(V, bottom, dc.RigidPlane((0, -1), (0, 1)), dc.Friction(0.5))
    bcs = [fem.dirichletbc(way, fem.locate_dofs_topological(V, 1, top), V)]
    problem = dc.ContactProblem(F, u, [contact, floor], bcs=bcs)
    for k in range(4):
        way.value[:] = (0.2 * k, -0.02)
        step = problem.solve()
    assert step.counts.stick > 0 and step.counts.slip > 0
    assert contact.force() == pytest.approx(floor.force(), rel=1e-9)
    wall = dc.Contact(V, mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[0], 0.0)), dc.RigidPlane((0, 0), (1, 0)), 0.0)  # fmt: skip
    with pytest.raises(ValueError, match="every node is slave or master"):
        dc.ContactProblem(F, u, [contact, wall], bcs=bcs)


def test_error_of_the_mesh():
    """A finer mesh is the reference that it is for one body: its error of the force is the difference, that of work some per cent."""
    coarse, fine = (ironed(3, "triangle", 1, ((4 * n, 2 * n), (9 * n, 2 * n)))[1] for n in (1, 2))
    found = dc.estimate(coarse.problem, fine.problem)
    off = np.abs(coarse.contact.force() - fine.contact.force())
    assert found["normal_force"].error == pytest.approx(off[1], rel=0.05)
    assert 0.0 < found["dissipation"].relative < 0.1


def test_what_makes_no_sense_is_refused():
    """Sliding is large or small."""
    scene = blocks("quadrilateral", 1, ((2, 2), (3, 2)))
    with pytest.raises(ValueError, match="sliding must be one of large, small, got 'huge'"):
        dc.DeformableSurface(scene.V, scene.contact.surface.facets, sliding="huge")


def test_compliance_from_columns_kept():
    """After slides W, made of columns that earlier rows needed too, is the motion of the nodes by unit reactions."""
    scene = blocks("hexahedron", 1, ((2, 2, 1), (6, 6, 1)), size=(1.0, 2.0), sliding="large", solver=dc.CondensedNewton(), tol=1e-8)  # fmt: skip
    for k in range(4):
        scene.way.value[:] = (0.2 * k, 0.1 * k, -0.01)
        scene.problem.solve()
    W, points, body = scene.problem.bound().compliance(), scene.contact.points, scene.problem.body
    assert W.shape[0] == (27 if COMM.rank == 0 else 0)
    if COMM.size > 1:  # units of a rank's nodes would be units of all ranks'
        return
    moved = []
    for unit in np.eye(27):
        forces = np.zeros(points.size)
        points.add_forces(unit.reshape(9, 3), forces)
        forces[body.fixed] = 0.0
        moved.append(points.motion(body.solve(forces)).ravel())
    assert np.abs(W - moved).max() <= 1e-12 * W.max()


def test_a_texture_slides_with_the_other_body():
    """Axes given on the lower body are those of what a node presses on, wherever both bodies are."""
    turns = lambda x: np.array([np.cos(x[0]), np.sin(x[0]), 0 * x[0]])  # noqa: E731
    domain, top, bottom, upper, lower, _ = pair("hexahedron", ((2, 2, 1), (6, 6, 1)), (1.0, 2.0))
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, ways = fem.Function(V), [fem.Constant(domain, np.zeros(3)) for _ in range(2)]
    F = ufl.inner(stress(u, 0.0, E / 2), ufl.grad(ufl.TestFunction(V))) * ufl.dx
    surface = dc.DeformableSurface(V, lower, axis=(1, 0, 0))
    friction = dc.Friction((0.2, 0.1), axes=turns, of="surface")
    contact = dc.Contact(V, upper, surface, friction)
    bcs = [fem.dirichletbc(way, fem.locate_dofs_topological(V, 2, at), V) for way, at in zip(ways, (top, bottom))]  # fmt: skip
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs)
    for slid, together in ((0.0, 0.0), (0.3, 0.0), (0.5, 1.0)):
        ways[0].value[:], ways[1].value[:] = (slid + together, 0.0, -0.001), (together, 0.0, 0.0)
        problem.solve()
        at = contact.x + np.array([slid, 0.0, 0.0])
        axes = np.einsum("nij,jn->ni", contact.frame[:, :2], turns(at.T))
        used = contact.friction.axes
        assert largest(axes[:, 0] * used[:, 1] - axes[:, 1] * used[:, 0]) <= 2e-3


@pytest.mark.parametrize("cell, degree", [("hexahedron", 1), pytest.param("tetrahedron", 2, marks=pytest.mark.slow)])  # fmt: skip
def test_half_of_it(cell, degree):
    """On a plane of symmetry along which a block slides, rows see one half of the other body: half the force and work of friction."""
    found = []
    for low in (0.0, -1.0):
        cells = 1 if low == 0.0 else 2
        parts = [box(cell, (0.5, low / 2, 0), (1.5, 0.5, 1), (2, cells, 1)), box(cell, (0, low, -1), (3, 1, 0), (7, 3 * cells, 1))]  # fmt: skip
        domain = joined(parts)
        V = functionspace(domain, ("Lagrange", degree, (3,)))
        u, way = fem.Function(V), fem.Constant(domain, np.zeros(3))
        side, top, bottom, faces = (mesh.locate_entities_boundary(domain, 2, lambda x, k=k, at=at: np.isclose(x[k], at)) for k, at in ((1, 0.0), (2, 1.0), (2, -1.0), (2, 0.0)))  # fmt: skip
        above = mesh.locate_entities(domain, 3, lambda x: x[2] > -1e-9)
        domain.topology.create_connectivity(2, 3)
        links = domain.topology.connectivity(2, 3)
        upper = np.array([links.links(face)[0] in above for face in faces], dtype=bool)
        F = ufl.inner(stress(u, E / 2, E / 2), ufl.grad(ufl.TestFunction(V))) * ufl.dx
        held = [(way, top, V), (np.zeros(3), bottom, V)]
        held += [(0.0, side, V.sub(1))] if low == 0.0 else []
        bcs = [fem.dirichletbc(value, fem.locate_dofs_topological(W, 2, facets), W) for value, facets, W in held]  # fmt: skip
        contact = dc.Contact(V, faces[upper], dc.DeformableSurface(V, faces[~upper], axis=(1, 0, 0)), dc.Friction((0.3, 0.1), (0.1, 0.2)))  # fmt: skip
        problem = dc.ContactProblem(F, u, [contact], bcs=bcs, geometry_tol=1e-5)
        for k in range(3):
            way.value[:] = (0.3 * k, 0.0, -0.01)
            problem.solve()
        share = 1.0 if low == 0.0 else 0.5
        found.append(share * np.append(contact.force()[[0, 2]], total(contact.dissipation)))
    # halves of tetrahedral meshes are no mirror images
    assert found[0] == pytest.approx(found[1], rel=1e-5 if cell == "hexahedron" else 0.01)


def test_a_body_that_is_tipped():
    """A tall block on rough ground is dragged at its top and turns: what the step looks at then knows of deformable surfaces."""
    scene = blocks("quadrilateral", 1, ((4, 7), (11, 1)), size=(1.0, 2.0), sliding="large", mu=1.0, swapped=True, tol=1e-8)  # fmt: skip
    for part in range(3):
        scene.way.value[:] = (0.24 * part, -0.013)
        with warnings.catch_warnings(record=True):
            warnings.simplefilter("always")
            assert scene.problem.solve().geometry_error <= 1e-3


def test_a_texture_turns_with_both_bodies():
    """Rubber blocks turned together by a right angle, then slid along what were the grooves: friction is that along the grooves."""
    domain, top, bottom, upper, lower, above = pair(
        "hexahedron", ((2, 2, 1), (3, 3, 1)), (1.0, 2.0)
    )
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, way = fem.Function(V), fem.Function(V)
    G = ufl.Identity(3) + ufl.grad(u)
    log = ufl.ln(ufl.det(G))
    energy = 50 * (ufl.tr(G.T * G) - 3 - 2 * log) + 50 * log**2
    F = ufl.derivative(energy * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(V))
    ends = np.concatenate((top, bottom))
    bc = fem.dirichletbc(way, fem.locate_dofs_topological(V, 2, ends))
    surface = dc.DeformableSurface(V, lower, axis=(1, 0, 0))
    contact = dc.Contact(V, upper, surface, dc.Friction((0.3, 0.1)))
    problem = dc.ContactProblem(F, u, [contact], bcs=[bc])
    x = V.tabulate_dof_coordinates()
    middle = np.array([1.0, 1.0, 0.0])

    def put(angle, slid):
        turn = np.array(
            [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        )
        moved = x - middle + np.where(x[:, 2:] > 0.5, [slid, 0.0, -0.05], 0.0)
        way.x.array[:] = (moved @ turn - x + middle).ravel()
        problem.solve()
        return turn @ contact.force()

    for angle in np.linspace(0.0, np.pi / 2, 5):
        put(angle, 0.0)
    for slid in (0.1, 0.3):
        force = put(np.pi / 2, slid)
    assert abs(force[0]) == pytest.approx(0.3 * abs(force[2]), rel=0.06)
    assert abs(force[1]) < 0.03 * abs(force[2])


def test_gaps_of_bodies_apart():
    """A block moves along a slope without touching it: gaps are those at its place, also of nodes that stay open while others press."""
    domain, top, bottom, upper, lower, _ = pair("quadrilateral", ((4, 2), (12, 2)), (1.0, 3.0), 0.1)
    x = domain.geometry.x
    ground = np.abs(x[:, 1]) < 1e-9
    x[ground, 1] = 0.05 * (x[ground, 0] - 1.5)
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, way = fem.Function(V), fem.Constant(domain, np.zeros(2))
    F = ufl.inner(stress(u, E / 2, E / 2), ufl.grad(ufl.TestFunction(V))) * ufl.dx
    bcs = [fem.dirichletbc(value, fem.locate_dofs_topological(V, 1, ends), V) for value, ends in ((way, top), (np.zeros(2), bottom))]  # fmt: skip
    contact = dc.Contact(V, upper, dc.DeformableSurface(V, lower), dc.Friction(0.0))
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs)
    for along in (0.4, 0.7):
        way.value[:] = (along, 0.0)
        problem.solve()
        slope = 0.05 * (contact.x[:, 0] + along - 1.5)
        assert largest(contact.gap - (0.1 - slope)) < 1e-12
    found = []
    for begin in (problem.solve, problem.reset):
        begin()
        way.value[:] = (0.2, -0.095)
        problem.solve()
        found.append(np.where(contact.reaction[:, -1] > 0.0, 0.0, contact.gap))
    assert largest(found[0]) > 0.01
    assert largest(found[0] - found[1]) < 1e-3 * largest(found[0])


def test_steady_sliding_takes_one_solution(monkeypatch):
    """Once a block slides on as in the step before, the rows of where it is expected are those of where it ends: none is repeated."""
    placed, own = [], problem_input.frames_of
    monkeypatch.setattr(problem_input, "frames_of", lambda *a: placed.append(0) or own(*a))
    scene = blocks("quadrilateral", 1, ((6, 2), (19, 2)), size=(1.0, 3.0), sliding="large", mu=0.3)
    counts = []
    for k in range(5):
        placed.clear()
        scene.way.value[:] = (0.02 * k, -0.01)
        step = scene.problem.solve()
        counts.append(len(placed))
    assert counts[1] > 1 and counts[2:] == [1, 1, 1]  # in the second one friction sets in
    assert 0.0 < step.geometry_error <= 1e-3
    force = scene.contact.force()
    assert force[0] == pytest.approx(-0.3 * force[1], rel=0.01)


@pytest.mark.parametrize("x", [0.0, 0.1, 0.17, 0.2, 0.21, 0.23, 0.25, 0.3, 0.45])
def test_a_loose_block_between_elastic_plates(x):
    """Without friction it goes to where plates that bulge hold it, wherever its edges are in their meshes; both forces are one, and what presses is nearly the same."""
    corners = (((x, 0), (x + 1, 1), (5, 4)), ((-0.5, -0.6), (2, 0), (8, 3)), ((-0.5, 1), (2, 1.6), (7, 3)))  # fmt: skip
    domain = joined([box("quadrilateral", *of) for of in corners])
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, way = fem.Function(V), fem.Constant(domain, np.zeros(2))
    F = work(u, V, 750.0 / 1.3, 500.0 / 1.3) * ufl.dx

    def inside(X):
        return (np.abs(X[0] - x - 0.5) < 0.5 + 1e-9) & (np.abs(X[1] - 0.5) < 0.5 + 1e-9)

    domain.topology.create_connectivity(1, 2)
    block = mesh.locate_entities(domain, 2, inside)
    links = domain.topology.connectivity(1, 2)

    def side(y, of_block):
        faces = mesh.locate_entities_boundary(domain, 1, lambda X: np.isclose(X[1], y))
        mine = np.array([links.links(face)[0] in block for face in faces], dtype=bool)
        return faces[mine == of_block]

    bcs = [fem.dirichletbc(value, fem.locate_dofs_topological(V, 1, side(y, False)), V) for y, value in ((-0.6, np.zeros(2)), (1.6, way))]  # fmt: skip
    contacts = [dc.Contact(V, side(y, True), dc.DeformableSurface(V, side(y, False)), 0.0) for y in (0.0, 1.0)]  # fmt: skip
    problem = dc.ContactProblem(F, u, contacts, bcs=bcs, undetermined="nearest")
    way.value[:] = (0.0, -0.01)
    assert problem.solve().geometry_error <= 1e-3
    low, high = (contact.force() for contact in contacts)
    assert 5.9 < low[1] < 6.1 and np.abs(low + high).max() <= 1e-6 * low[1]
