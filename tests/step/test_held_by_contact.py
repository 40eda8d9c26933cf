# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Bodies held by contact alone: statics, soft springs that hold the same body, and what is refused with the motion named."""

import re
import warnings

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from dolfinx_contact.petsc.linear_solver import MULTIGRID_OPTIONS
from dolfinx_contact.step.statics import Statics

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
TOL = 1e-9
SOLVERS = {"condensed": dc.CondensedNewton, "fixed point": dc.FixedPoint, "multigrid": dc.FixedPoint}  # fmt: skip
CELLS = {2: (5, 4), 3: (3, 3, 2)}


class Loose:
    """A block of edges 1, 1, 0.8 (1, 0.8) between planes at given faces, under a force per volume that varies linearly."""

    def __init__(self, dim, kind="condensed", mu=0.3, faces=("low",), gap=0.0, E=1.0, length=1.0, spring=None, bcs=None, grade=1.0, **options):  # fmt: skip
        corners = [np.zeros(dim), np.ones(dim)]
        corners[1][-1] = 0.8
        make, cell = ((mesh.create_rectangle, mesh.CellType.quadrilateral), (mesh.create_box, mesh.CellType.hexahedron))[dim - 2]  # fmt: skip
        domain = make(COMM, corners, CELLS[dim], cell)
        domain.geometry.x[:, 0] **= grade  # cells are smaller on the left
        domain.geometry.x[:] *= length
        self.dim, self.length, self.up = dim, length, np.eye(dim)[-1]
        V = functionspace(domain, ("Lagrange", 1, (dim,)))
        u, v = fem.Function(V), ufl.TestFunction(V)
        self.force = fem.Constant(domain, np.zeros(dim))
        F = scenes.elasticity(u, v, E, 0.3) - ufl.inner(self.force, v) * ufl.dx
        if spring:
            F = F + fem.Constant(domain, spring * E / length) * ufl.inner(u, v) * ufl.ds
        contacts = []
        for face in faces:
            z, side = (0.0, 1) if face == "low" else (0.8 * length, -1)
            facets = mesh.locate_entities_boundary(
                domain, dim - 1, lambda x, z=z: np.isclose(x[dim - 1], z, atol=1e-9 * length)
            )
            plane = dc.RigidPlane((z - side * gap * length) * self.up, side * self.up)
            contacts.append(dc.Contact(V, facets, plane, dc.Friction(mu)))
        if kind == "multigrid":
            options["petsc_options"] = MULTIGRID_OPTIONS
        bcs = [] if bcs is None else bcs(V)
        self.contacts, self.contact, self.u = contacts, contacts[0], u
        self.problem = dc.ContactProblem(F, u, contacts, bcs=bcs, solver=SOLVERS[kind](), tol=TOL, **options)  # fmt: skip
        self.volume = 0.8 * length**dim

    def load(self, *force):
        """Forces on the whole body, applied at its middle."""
        self.force.value[:] = np.array(force) / self.volume
        return self.problem.solve()

    def sums(self):
        """Force of all planes on the body, and its moment about the middle (a number in two dimensions)."""
        force, moment = np.zeros(self.dim), 0.0
        middle = np.full(self.dim, self.length / 2)
        middle[-1] = 0.4 * self.length
        for contact in self.contacts:
            r = contact.reaction @ contact.frame
            force += r.sum(axis=0)
            arm = contact.x[:, : self.dim] - middle
            turn = np.cross(arm, r) if self.dim == 3 else arm[:, 0] * r[:, 1] - arm[:, 1] * r[:, 0]
            moment = moment + turn.sum(axis=0)
        return COMM.allreduce(force, op=MPI.SUM), COMM.allreduce(moment, op=MPI.SUM)


@pytest.mark.parametrize("units", [(1.0, 1.0), (1e9, 1e-3), (1e-6, 1e3)])
@pytest.mark.parametrize("kind", SOLVERS)
@pytest.mark.parametrize("dim", [2, 3])
def test_reactions_balance_what_pushes_a_block_and_more_than_friction_is_refused(dim, kind, units):
    """Sums of forces and moments are those of statics in any unit; beyond mu W the last state stays, and solves go on."""
    E, length = units
    scene = Loose(dim, kind, E=E, length=length)
    weight = 1e-3 * E * length ** (dim - 1)
    for part in (0.0, 0.6, 0.99, 0.3):
        load = np.zeros(dim)
        load[0], load[-1] = part * 0.3 * weight, -weight
        step = scene.load(*load)
        force, moment = scene.sums()
        assert max(step.error, step.slip_error) <= TOL
        assert np.abs(force + load).max() < 1e-8 * weight
        assert np.abs(moment).max() < 1e-8 * weight * length
        kept, reaction = scene.u.x.array.copy(), scene.contact.reaction.copy()
        load[0] = 1.01 * 0.3 * weight
        with pytest.raises(dc.NotConverged, match=r"a translation along \(1, 0"):
            scene.load(*load)
        assert np.array_equal(scene.u.x.array, kept)
        assert np.array_equal(scene.contact.reaction, reaction)


@pytest.mark.parametrize("kind", SOLVERS)
@pytest.mark.parametrize("dim", [2, 3])
def test_a_vanishing_spring_leads_to_the_same_reactions(dim, kind):
    """Springs of 1e-8 of the body's stiffness hold the same block: reactions agree to what these springs carry."""
    own, held = Loose(dim, kind), Loose(dim, spring=1e-8)
    for side in (1e-4, 2e-4, -1e-4):
        load = np.zeros(dim)
        load[0], load[-1] = side, -1e-3
        own.load(*load)
        held.load(*load)
        r, expected = (scenes.gathered(scene.contact)[1] for scene in (own, held))
        assert np.abs(r - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize("kind", SOLVERS)
@pytest.mark.parametrize("dim", [2, 3])
def test_a_block_above_its_plane_comes_down(dim, kind):
    """However far the plane is, the block lands with the reactions that it has where it starts on the plane."""
    expected = Loose(dim, kind)
    load = np.zeros(dim)
    load[0], load[-1] = 5e-5, -1e-3
    expected.load(*load)
    for gap in (1e-6, 1e-2, 5.0):
        fallen = Loose(dim, kind, gap=gap)
        fallen.load(*load)
        r, of = (scenes.gathered(scene.contact)[1] for scene in (fallen, expected))
        assert np.abs(r - of).max() < 1e-6 * np.abs(of).max()


@pytest.mark.parametrize("kind", SOLVERS)
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("driven", [False, True])
def test_plates_clamp_a_block(dim, kind, driven):
    """Pressed by a plate, held by friction at both: forces balance a side force; a plate driven by force has its force."""
    scene = Loose(dim, kind, faces=("low", "high"))
    plate = scene.contacts[1].surface
    if driven:
        plate.free, plate.force = ("n",), -1e-3 * scene.up
    else:
        plate.displacement = -1e-3 * scene.up
    for side in (0.0, 1e-4):
        load = side * np.eye(dim)[0]
        scene.load(*load)
        force, moment = scene.sums()
        assert np.abs(force + load).max() < 1e-11 and np.abs(moment).max() < 1e-11
        if driven:
            assert scene.contacts[1].force() @ scene.up == pytest.approx(-1e-3, rel=1e-7)


def test_a_plate_below_a_body_that_nothing_holds_is_refused():
    """Body and plate both move along the normal: the step that does not converge says that nothing holds them."""
    scene = Loose(2)
    plate = scene.contact.surface
    plate.free, plate.force = ("n",), 1e-3 * scene.up
    with pytest.raises(dc.NotConverged, match="leave 'n' out of its surface.free"):
        scene.problem.solve()
    plate.free, plate.displacement = (), np.zeros(2)
    scene.load(0, -1e-3)
    assert scene.contact.force() @ scene.up == pytest.approx(1e-3, rel=1e-7)


@pytest.mark.parametrize("kind", ["condensed", pytest.param("fixed point", marks=pytest.mark.slow)])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_clamped_block_is_pushed_out(dim, kind):
    """Between plates whose pressure is not given: more than friction carries is refused, long before the limit of iterations.

    Nodes that may carry any normal force could hold it: only the search tells that they do not.  What it ends with tells
    the fixed point which motion it is.
    """
    scene = Loose(dim, kind, faces=("low", "high"))
    scene.contacts[1].surface.displacement = -1e-3 * scene.up
    scene.load(*np.zeros(dim))
    most = 2 * 0.3 * (scene.contact.force() @ scene.up)
    scene.load(*0.5 * most * np.eye(dim)[0])
    kept = scene.u.x.array.copy()
    said = r"a translation along \(1, 0(, 0)?\)" if kind == "fixed point" else None
    for part in (1.1, 1.5)[: 1 if said else 2]:
        with pytest.raises(dc.NotConverged, match=said) as failure:
            scene.load(*part * most * np.eye(dim)[0])
        assert failure.value.step.iterations < 10000  # the limit of the condensed solver is 200000
        assert np.array_equal(scene.u.x.array, kept)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_block_that_tips_is_refused_as_a_rotation_about_its_edge(dim):
    """Friction enough, side force above half the width over half the height times the weight: it turns about its edge."""
    scene = Loose(dim, mu=5.0)
    load = np.zeros(dim)
    load[0], load[-1] = 1.24e-3, -1e-3  # 0.5 / 0.4 of the weight is the limit
    scene.load(*load)
    load[0] = 1.26e-3
    about = r"about \(1, 0\)" if dim == 2 else r"axis \(0, 1, 0\) through \(1, 0\.5, 0\)"
    with pytest.raises(
        dc.NotConverged, match=f"a rotation {'' if dim == 2 else 'about the '}{about}"
    ):
        scene.load(*load)


@pytest.mark.parametrize("dim", [2, 3])
def test_what_pulls_a_block_off_is_refused(dim):
    """Nothing can hold a block that is pulled off its plane: the motion is named, the last state stays."""
    scene = Loose(dim)
    with pytest.raises(dc.NotConverged, match=r"a translation along \(0, (0, )?1\)"):
        scene.load(*1e-3 * scene.up)
    assert not scene.u.x.array.any()


def integral(of):
    """Over the body, the same on all ranks."""
    return COMM.allreduce(fem.assemble_scalar(fem.form(of * ufl.dx)))


@pytest.mark.parametrize("kind", SOLVERS)
@pytest.mark.parametrize("dim", [2, 3])
def test_undetermined_motions_are_refused_or_nearest_to_the_last_state(dim, kind):
    """Without friction: refused, the motions and friction named; or nearest by volume, as small cells on one side must not draw it
    there: no part of the change along them; pushed along: refused always."""
    down = np.zeros(dim)
    down[-1] = -1e-3
    scene = Loose(dim, kind, mu=0.0, grade=2.0)
    with pytest.raises(
        ValueError, match=f"{2 * dim - 3} rigid motion.*translation along.*add friction"
    ):
        scene.load(*down)
    assert not scene.u.x.array.any()
    scene.problem.undetermined = "nearest"
    for load in (1.0, 2.0):
        before = fem.Function(scene.u.function_space)
        before.x.array[:] = scene.u.x.array
        scene.load(*load * down)
        change, x = scene.u - before, ufl.SpatialCoordinate(scene.u.function_space.mesh)
        motions = [ufl.as_vector(along.tolist()) for along in np.eye(dim)[:-1]]
        if dim == 3:
            motions.append(ufl.as_vector((-x[1], x[0], 0.0)))
        left = [integral(ufl.inner(change, motion)) for motion in motions]
        size = np.sqrt(integral(ufl.inner(change, change)) * scene.volume)
        assert np.abs(left).max() < 1e-8 * size
    down[0] = 1e-6
    with pytest.raises(dc.NotConverged, match="a translation along"):
        scene.load(*down)


def test_a_body_without_load_stays_where_it_is():
    """No load and nothing pressed: every position is a solution, so it is refused for want of a normal force, or the block stays."""
    scene = Loose(2)
    with pytest.raises(
        ValueError, match="3 rigid motion.*no node with friction is pressed: add a normal"
    ):
        scene.load(0.0, 0.0)
    scene.problem.undetermined = "nearest"
    assert scene.load(0.0, 0.0).error < 1e-15
    assert np.abs(scene.u.x.array).max() < 1e-15
    with pytest.raises(ValueError, match="undetermined must be one of refused, nearest"):
        scene.problem.undetermined = "any"


@pytest.mark.parametrize("kind", SOLVERS)
def test_half_a_block_behind_its_plane_of_symmetry_is_half_a_block(kind):
    """A condition that leaves some motions free: with u_x = 0 at x = 0 the other reactions hold the rest."""

    def symmetry(V):
        sub = V.sub(0)
        facets = mesh.locate_entities_boundary(V.mesh, 1, lambda x: np.isclose(x[0], 0.0))
        return [fem.dirichletbc(0.0, fem.locate_dofs_topological(sub, 1, facets), sub)]

    scene = Loose(2, kind, bcs=symmetry)
    step = scene.load(1e-4, -1e-3)
    assert step.error <= TOL
    assert scene.sums()[0][1] == pytest.approx(1e-3, rel=1e-8)
    assert scene.problem.body.loose.modes.shape[1] == 1


def test_steps_are_taken_back_saved_and_loaded(tmp_path):
    """rewind, and save and load, lead to the same next step."""
    path = COMM.bcast(tmp_path / "state.npz", root=0)
    scene = Loose(3)
    scene.load(1e-4, 0, -1e-3)
    scene.problem.save(path)
    scene.load(2e-4, 0, -1e-3)
    expected = scenes.gathered(scene.contact)[1]
    scene.problem.rewind()
    scene.load(2e-4, 0, -1e-3)
    again = scenes.gathered(scene.contact)[1]
    other = Loose(3)
    other.problem.load(path)
    other.load(2e-4, 0, -1e-3)
    for r in (again, scenes.gathered(other.contact)[1]):
        assert np.abs(r - expected).max() < 1e-7 * np.abs(expected).max()


def test_whether_loads_can_be_held_is_what_a_linear_programme_says():
    """Random loads in two dimensions: the cone of sums is found to have them or not as SciPy's simplex does."""
    optimize = pytest.importorskip("scipy.optimize")
    scene, random, seen = Loose(2, mu=0.4), np.random.default_rng(3), set()
    scene.load(0.0, -1e-3)
    problem, x = scene.problem, np.concatenate(COMM.allgather(scene.contact.x))
    for _ in range(40):
        side, tilt = random.uniform(-1.0, 1.0, size=2)
        scene.force.value[:] = side, -1.0
        step = problem.load_step()
        # a couple of forces along the sides, as a load of its own
        body = problem.body
        middle = body.V.tabulate_dof_coordinates()[: body.size // 2, 0] - 0.5
        nodes = COMM.allreduce(len(middle))
        step.b[1::2] += tilt * middle / nodes
        arm = COMM.allreduce((tilt * middle**2 / nodes).sum())
        rays = np.array([[s * 0.4, 1.0, (p - 0.5) + 0.4 * s * 0.4] for p in x[:, 0] for s in (-1, 1)]).T  # fmt: skip
        target = -np.array([0.8 * side, -0.8, arm])
        found = optimize.linprog(np.ones(rays.shape[1]), A_eq=rays, b_eq=target)
        said = Statics(step, np.zeros(body.size)).message
        assert (said == "") == (found.status == 0)
        seen.add(found.status)
    assert seen == {0, 2}


@pytest.mark.slow
def test_friction_at_its_limit_is_decided_in_every_direction():
    """Pushed by a little less or more than mu N along any direction: statics say which, and name the translation."""
    scene, random = Loose(3), np.random.default_rng(5)
    for angle in np.append(random.uniform(0.0, 2 * np.pi, 20), [0.0, np.pi / 2, np.pi / 4]):
        along = np.array([np.cos(angle), np.sin(angle), 0.0])
        for part in (1 - 1e-7, 1 - 1e-3, 1 + 1e-3, 1 + 1e-5):
            scene.force.value[:] = 0.3 * part * along - scene.up
            step, body = scene.problem.load_step(), scene.problem.body
            said = Statics(step, np.zeros(body.size)).message
            assert (said == "") == (part < 1)
            assert part < 1 or "a translation along" in said


@pytest.mark.parametrize("degrees", [2.0, 5.0])
@pytest.mark.parametrize("lands", [True, False])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_block_comes_to_rest_on_a_tilted_floor(dim, lands, degrees):
    """Below its angle of friction a floor carries a block, N = W cos t and T = W sin t, however it came to be tilted."""
    scene = Loose(dim, mu=0.3, gap=0.01 if lands else 0.0)
    scene.problem.solver = None
    down, tilt = -1e-3 * scene.up, np.radians(degrees)
    if not lands:
        scene.load(*down)
    scene.contact.surface.rotation = -tilt if dim == 2 else (0.0, tilt, 0.0)
    step = scene.load(*down)
    force, _ = scene.sums()
    local = COMM.allreduce(scene.contact.reaction.sum(axis=0), op=MPI.SUM)
    assert local[-1] == pytest.approx(1e-3 * np.cos(tilt), rel=1e-7)
    assert np.linalg.norm(local[:-1]) == pytest.approx(1e-3 * np.sin(tilt), rel=1e-6)
    assert np.abs(force + down).max() < 1e-10
    assert step.iterations < 300  # Newton's fallbacks took 3000, and found nothing


@pytest.mark.parametrize("way", [0.5, -0.5, 3.0])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_block_goes_with_its_belt(dim, way):
    """A belt takes a loose block along by half its length, and more: the same reactions, the same displacement beside it."""
    scene = Loose(dim)
    scene.problem.solver = None
    down = -1e-3 * scene.up
    scene.load(*down)
    before, reaction = scene.u.x.array.reshape(-1, dim).copy(), scene.contact.reaction.copy()
    scene.contact.surface.displacement = way * np.eye(dim)[0]
    scene.problem.solve()
    moved = scene.u.x.array.reshape(-1, dim) - before
    assert np.abs(moved - way * np.eye(dim)[0]).max() < 1e-6 * abs(way)
    assert np.abs(scene.contact.reaction[:, -1] - reaction[:, -1]).max(initial=0.0) < 1e-6 * 1e-3


@pytest.mark.parametrize("part", [1e-3, 1e-6])
@pytest.mark.parametrize("dim", [2, 3])
def test_almost_all_of_a_load_may_go_in_one_step(dim, part):
    """From full weight to a millionth of it: the floor carries what is left."""
    scene = Loose(dim)
    scene.problem.solver = None
    scene.load(*-1e-3 * scene.up)
    step = scene.load(*-part * 1e-3 * scene.up)
    force, _ = scene.sums()
    assert force[-1] == pytest.approx(part * 1e-3, rel=1e-6)
    assert step.iterations < 300


def test_loads_that_rounding_hides_are_said_to_be():
    """A load of 1e-15 of the last one is less than rounding of the coordinates makes of gaps: that is said, no motion."""
    scene = Loose(2)
    scene.problem.solver = None
    scene.load(0.0, -1e-3)
    with pytest.raises(dc.NotConverged, match=r"rounding of coordinates and displacements alone makes contact forces of .*Take the load off altogether"):  # fmt: skip
        scene.load(0.0, -1e-18)


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("undetermined", ["refused", "nearest"])
def test_a_bar_between_walls_is_heated_and_cools_down(mu, undetermined):
    """Heated N = E A T without friction; cold again nothing presses: no warning, and no search for what rounding leaves."""
    domain = mesh.create_rectangle(COMM, [np.zeros(2), np.array([1.0, 0.2])], (8, 2), mesh.CellType.quadrilateral)  # fmt: skip
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, v, heat = fem.Function(V), ufl.TestFunction(V), fem.Constant(domain, 1e-3)
    F = 1e4 * ufl.inner(ufl.sym(ufl.grad(u)) - heat * ufl.Identity(2), ufl.sym(ufl.grad(v))) * ufl.dx  # fmt: skip
    contacts = []
    for x, side in ((0.0, 1.0), (1.0, -1.0)):
        facets = mesh.locate_entities_boundary(domain, 1, lambda p, x=x: np.isclose(p[0], x))
        contacts.append(dc.Contact(V, facets, dc.RigidPlane((x, 0), (side, 0)), dc.Friction(mu)))
    foot = mesh.locate_entities_boundary(domain, 1, lambda p: np.isclose(p[1], 0))
    guide = fem.dirichletbc(0.0, fem.locate_dofs_topological(V.sub(1), 1, foot), V.sub(1))
    problem = dc.ContactProblem(F, u, contacts, bcs=[guide], undetermined=undetermined)
    problem.solve()
    if mu == 0.0:
        assert contacts[0].force()[0] == pytest.approx(2.0, rel=1e-10)
    heat.value = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if undetermined == "refused":
            with pytest.raises(ValueError, match=r"a translation along \(1, 0\)"):
                problem.solve()
        else:
            step = problem.solve()
            assert max(step.error, step.forward_error) < 1e-12 and step.iterations < 300
            assert np.abs(contacts[0].force()).max() < 1e-11


@pytest.mark.parametrize("dim", [2, 3])
def test_more_than_a_gripper_holds_is_refused_at_once(dim):
    """Plates squeeze a block by a force N: 2 mu N hold it; beyond, and where it pushes a plate away, nothing is searched."""
    scene = Loose(dim, mu=0.3, faces=("low", "high"))
    scene.problem.solver = None
    plate, side = scene.contacts[1].surface, np.eye(dim)[0]
    plate.free, plate.force = ("n",), -1e-3 * scene.up
    scene.load(*0.95 * 0.6e-3 * side)
    force, _ = scene.sums()
    assert np.abs(force + 0.95 * 0.6e-3 * side).max() < 1e-9
    for load, said in ((1.001 * 0.6e-3 * side, r"along \(1, 0"), (2e-3 * scene.up, r"along \(0, (0, )?1\)")):  # fmt: skip
        with pytest.raises(dc.NotConverged, match=f"a translation {said}.*no static state") as caught:  # fmt: skip
            scene.load(*load)
        assert caught.value.step.iterations == 0


@pytest.mark.parametrize("dim", [2, 3])
def test_no_motion_is_named_by_a_point_far_from_the_body(dim):
    """A turn about a point of the body is said as that; about one ten metres away as a translation that turns a little."""
    scene = Loose(dim)
    scene.load(*-1e-3 * scene.up)
    body, V = scene.problem.body, scene.u.function_space
    for centre, said in (((1.0, 0.0), r"a rotation about .*\(1, (0.5, )?0\)"), ((-9.7, 0.4), r"a translation along \(0, (0, )?-?1\) that turns a little about the middle")):  # fmt: skip
        turned = fem.Function(V)
        turned.interpolate(
            lambda x, at=centre: np.array([-(x[dim - 1] - at[1]), *[0 * x[0]] * (dim - 2), x[0] - at[0]])
        )  # fmt: skip
        Z, motion = body.loose.modes, turned.x.array[: body.size]
        c = np.linalg.solve(body.total(Z.T @ Z), body.total(Z.T @ motion))
        assert re.fullmatch(said, body.loose.words(c).split(" (0.5")[0])
