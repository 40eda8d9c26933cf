# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the errors of a step promise, on bodies that once made them lie: soft, slender, grazing, lifted off."""

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from dolfinx_contact.extend import Solver
from dolfinx_contact.solvers.base import SolverResult

SOLVERS = {"default": lambda: None, "fixed point": dc.FixedPoint, "condensed": dc.CondensedNewton}
every_solver = pytest.mark.parametrize("solver", SOLVERS)


class Body:
    """A box pressed on the plane z = 0 with everything that DOLFINx says of its forces."""

    def __init__(self, corner, cells, spring=0.0, clamp=None, touching=None, solver=None, tol=1e-8):
        low = np.array([0.0, 0.0, 0.0])
        self.mesh = mesh.create_box(MPI.COMM_SELF, [low, np.array(corner)], cells, mesh.CellType.hexahedron)  # fmt: skip
        self.V = V = functionspace(self.mesh, ("Lagrange", 1, (3,)))
        self.u, v = fem.Function(V), ufl.TestFunction(V)
        self.load = fem.Constant(self.mesh, np.zeros(3))
        spring = fem.Constant(self.mesh, float(spring))
        F = scenes.elasticity(self.u, v, 1.0, 0.3) + spring * ufl.inner(self.u, v) * ufl.dx
        self.F = fem.form(F - ufl.inner(self.load, v) * ufl.dx)
        bcs, self.fixed = [], np.zeros(0, int)
        if clamp is not None:
            facets = mesh.locate_entities_boundary(self.mesh, 2, clamp)
            dofs = fem.locate_dofs_topological(V, 2, facets)
            bcs = [fem.dirichletbc(fem.Function(V), dofs)]
            self.fixed = (3 * dofs[:, None] + np.arange(3)).ravel()
        touching = touching or (lambda x: np.isclose(x[2], 0.0))
        facets = mesh.locate_entities_boundary(self.mesh, 2, touching)
        self.surface = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1), axis=(1, 0, 0))
        self.contact = dc.Contact(V, facets, self.surface, dc.Friction(mu=0.3))
        form = F - ufl.inner(self.load, v) * ufl.dx
        self.problem = dc.ContactProblem(form, self.u, self.contact, bcs=bcs, solver=solver, tol=tol)  # fmt: skip

    def out_of_balance(self):
        """Norm of F(u) - r on free degrees of freedom over the largest force of a node, by DOLFINx alone."""
        F = fem.assemble_vector(self.F)
        F = np.array(getattr(F, "array", F))
        F.reshape(-1, 3)[self.contact.nodes] -= self.contact.reaction @ self.contact.frame
        supports = np.abs(F[self.fixed]).max(initial=0.0)
        free = np.setdiff1d(np.arange(F.size), self.fixed)
        largest = max(np.abs(self.contact.reaction).max(), supports)
        return np.linalg.norm(F[free]) / largest / np.sqrt(len(self.contact.nodes))


def on_springs(stiffness, **options):
    """A block under its own weight and a side load, which nothing but contact and a soft spring holds."""
    body = Body((1.0, 1.0, 0.6), (5, 5, 3), spring=stiffness / 0.6, **options)
    body.load.value[:] = 2e-4, 0, -1e-3
    return body


def cantilever(slenderness, **options):
    """A beam clamped at one end whose other end the plane bends up."""
    tip = slenderness - 1.01
    body = Body(
        (slenderness, 1.0, 1.0), (2 * slenderness, 2, 2), clamp=lambda x: np.isclose(x[0], 0.0),
        touching=lambda x: np.isclose(x[2], 0.0) & (x[0] > tip), **options,
    )  # fmt: skip
    body.surface.displacement = (0, 0, 0.01 * slenderness)
    return body


SOFT = [(on_springs, k) for k in (1e-2, 1e-4, 1e-6, 1e-9)] + [(cantilever, n) for n in (3, 10, 60)]


@every_solver
@pytest.mark.parametrize("build, parameter", SOFT)
def test_a_converged_step_is_in_balance_and_near_a_tight_one(build, parameter, solver):
    """Soft springs and slender bodies: forces balance to the tolerance, reactions are those of a tight solution."""
    body = build(parameter, solver=SOLVERS[solver]())
    tight = build(parameter, solver=dc.CondensedNewton(), tol=1e-10)
    step = body.problem.solve()
    tight.problem.solve()
    tol = body.problem.tol
    assert max(step.error, step.slip_error, step.forward_error) <= tol
    assert body.out_of_balance() <= 10 * tol
    r, expected = body.contact.reaction, tight.contact.reaction
    assert np.linalg.norm(r - expected) <= 1000 * tol * np.linalg.norm(expected)


@pytest.mark.parametrize("build, parameter", SOFT)
def test_contact_error_says_how_far_the_reactions_are_off(build, parameter):
    """Stopped early, the fixed point is off by no more than it says, also where supports carry far more than the contact."""
    tight = build(parameter, tol=1e-10)
    tight.problem.solve()
    expected = tight.contact.reaction
    for tol in (1e-4, 1e-6, 1e-8):
        body = build(parameter, solver=dc.FixedPoint(), tol=tol)
        step = body.problem.solve()
        off = np.linalg.norm(body.contact.reaction - expected) / np.linalg.norm(expected)
        assert off <= 2 * step.contact_error


@every_solver
def test_an_unloaded_block_slides_on_the_plane(solver):
    """A block that just rests on the plane is moved sideways: nothing acts, in any direction."""
    scene = scenes.block(comm=MPI.COMM_SELF, solver=SOLVERS[solver](), tol=1e-8)
    for angle in np.linspace(0, 2 * np.pi, 73):
        scene.move_top(0.01 * np.cos(angle), 0.01 * np.sin(angle), 0)
        step = scene.problem.solve()
        assert step.error <= step.rounding < 1e-15 and not scene.contact.reaction.any()


@every_solver
@pytest.mark.parametrize("touch, tol", [(1e-6, 1e-10), (1e-8, 1e-8)])
def test_lifted_after_a_light_touch(touch, tol, solver):
    """A body that hardly touched is lifted far off, and comes down again, also after it was tried twice."""
    options = dict(cells=(4, 4, 3), E=1.0, mu=0.3, p=None, tol=tol, solver=SOLVERS[solver]())
    scene = scenes.block(comm=MPI.COMM_SELF, **options)
    for _ in range(2):
        scene.move_top(0, 0, -touch)
        assert scene.problem.solve().error <= tol
        assert scene.contact.reaction[:, 2].sum() > 0.1 * touch
        scene.move_top(0, 0, 0.1)
        assert scene.problem.solve().counts.open == 25


@every_solver
@pytest.mark.parametrize("penetration", [1e-9, 1e-11, 1e-14])
@pytest.mark.filterwarnings("ignore::dolfinx_contact.RoundingWarning")
def test_grazing_while_sliding(penetration, solver):
    """A block slides by 0.1 while it touches by next to nothing: solved as far as double precision goes, which is said."""
    options = dict(cells=(4, 4, 3), E=1.0, mu=0.3, p=None, tol=1e-8, solver=SOLVERS[solver]())
    scene = scenes.block(comm=MPI.COMM_SELF, **options)
    scene.move_top(0.1, 0, -penetration)
    step = scene.problem.solve()
    assert step.counts.slip == 25
    assert max(step.error, step.slip_error) <= max(1e-8, step.rounding)
    assert step.rounding < 1e-15 / penetration  # 0.1 times the last digit
    deep = scenes.block(comm=MPI.COMM_SELF, **options)
    deep.move_top(0.1, 0, -1e-6)
    deep.problem.solve()
    scaled = deep.contact.reaction * penetration / 1e-6
    bound = 30 * max(1e-8, step.rounding)
    assert np.linalg.norm(scene.contact.reaction - scaled) <= bound * np.linalg.norm(scaled)


def test_at_the_limit_of_double_precision_a_warning_says_so():
    """An error above the tolerance is never returned without a word."""
    scene = scenes.block(cells=(4, 4, 3), E=1.0, mu=0.3, p=None, tol=1e-8)
    scene.move_top(0.1, 0, -1e-11)
    with pytest.warns(dc.RoundingWarning, match="rounding"):
        step = scene.problem.solve()
    assert 1e-8 < step.error <= step.rounding


@pytest.mark.parametrize("height", [-1e-3, 0.0, 1e-3])
def test_rounding_is_what_two_ways_to_the_forces_differ_by(height):
    """F assembled by DOLFINx and products with K differ by the rounding that is claimed, to a factor of hundred."""
    scene = scenes.block(comm=MPI.COMM_SELF, cells=(6, 6, 4))
    scene.move_top(0.3, 0.2, height)
    if height < 0:
        scene.problem.solve()
    else:
        with np.errstate(all="raise"):
            scene.problem.solve()
    body = scene.problem.body
    x = scene.u.x.array[: body.size].copy()
    b, _ = body.load()
    free = np.setdiff1d(np.arange(body.size), body.fixed)
    apart = np.linalg.norm((b - body.multiply(x) + body.internal_force(x))[free])
    claimed = np.finfo(float).eps / 2 * np.linalg.norm(body.cancelling(x)[free])
    assert apart <= 3 * claimed and claimed <= 100 * apart


@pytest.mark.parametrize("sign", ["F", "modulus"])
def test_a_stiffness_that_is_none_is_refused(sign):
    """A residual of the wrong sign or a negative modulus is named, not solved."""
    scene = scenes.block()
    scene.move_top(0, 0, -0.01)
    problem, F = scene.problem, scene.F
    if sign == "F":
        problem = dc.ContactProblem(-F, scene.u, [scene.contact], bcs=scene.bcs)
    else:
        scene.modulus.value = -210e3
    with pytest.raises(ValueError, match="must be positive: check the sign of F"):
        problem.solve()


@every_solver
def test_unloaded_to_next_to_nothing(solver):
    """Reactions a millionth of those before are as right as those were, by forces of their own size."""
    scene = scenes.block(comm=MPI.COMM_SELF, solver=SOLVERS[solver](), tol=1e-8, mu=0.0, p=None)
    other = scenes.block(comm=MPI.COMM_SELF, tol=1e-8, mu=0.0, p=None)
    scene.move_top(0, 0, -0.01)
    scene.problem.solve()
    for each in (scene, other):
        each.move_top(0, 0, -1e-8)
        each.problem.solve()
    r, expected = scene.contact.reaction, other.contact.reaction
    assert np.linalg.norm(r - expected) <= 1e-6 * np.linalg.norm(expected)


class Nothing(Solver):
    """A solver that moves nothing."""

    def bind(self, step):
        return self

    def update(self, step):
        pass

    def close(self):
        pass

    def solve(self, step, starts):
        return SolverResult(step.measure(np.zeros(step.body.size)), 0, 0.0, "nothing")


def test_supports_that_are_not_where_they_should_be_are_an_error():
    """A displacement without the boundary values is no solution, however well its forces are in balance."""
    scene = scenes.block()
    scene.move_top(0, 0, -0.01)
    scene.problem.solver = Nothing()
    with pytest.raises(dc.NotConverged) as caught:
        scene.problem.solve()
    assert caught.value.step.error > 0.1


def heated(tol, solver, shorter=0.0, heat=1e4, gdim=3):
    """A cube between walls across, heated along x without lateral contraction, pressed by 0.01: N = 10, thermal forces ``heat`` times that."""
    made = mesh.create_unit_cube if gdim == 3 else mesh.create_unit_square
    cell = mesh.CellType.hexahedron if gdim == 3 else mesh.CellType.quadrilateral
    domain = made(MPI.COMM_WORLD, *[3] * gdim, cell)
    V, up = functionspace(domain, ("Lagrange", 1, (gdim,))), gdim - 1
    u, v = fem.Function(V), ufl.TestFunction(V)
    stress = fem.Constant(domain, 10.0 * heat)
    F = (1e3 * ufl.inner(ufl.sym(ufl.grad(u)), ufl.grad(v)) - stress * v[0].dx(0)) * ufl.dx
    foot, head, *walls = (
        mesh.locate_entities_boundary(domain, up, lambda x, k=k, at=at: np.isclose(x[k], at))
        for k, at in ((up, 0), (up, 1), (0, 0), (0, 1))
    )
    bcs = [
        fem.dirichletbc(
            fem.Constant(domain, value), fem.locate_dofs_topological(V.sub(k), up, facets), V.sub(k)
        )
        for k, facets, value in [(up, head, shorter - 0.01)]
        + [(k, facets, 0.0) for k in range(up) for facets in walls]
    ]
    plane = dc.RigidPlane(np.zeros(gdim), np.eye(gdim)[up])
    contact = dc.Contact(V, foot, plane, dc.Friction(0.3))
    return dc.ContactProblem(F, u, contact, bcs=bcs, tol=tol, solver=solver)


@pytest.mark.filterwarnings("ignore:contact carries")  # at the second tolerance, too
@pytest.mark.parametrize("gdim", [2, 3])
def test_reactions_beside_large_loads(gdim):
    """The reactions are within ``contact_error`` of the exact ones; where that is a thousand tolerances, a warning has the tolerance that helps."""
    problem = heated(1e-4, dc.FixedPoint(), gdim=gdim)
    with pytest.warns(UserWarning, match="contact carries .* set problem.tol to"):
        step = problem.solve()
    assert step.error <= 1e-4 and step.contact_error > 0.1
    off = abs(problem.contacts[0].force()[-1] / 10.0 - 1.0)
    assert off <= step.contact_error * (1 + 1e-12)
    problem.reset()
    problem.tol = 1e-4**2 / step.contact_error
    step = problem.solve()
    assert (
        abs(problem.contacts[0].force()[-1] / 10.0 - 1.0) <= max(step.contact_error, 1e-10) <= 0.1
    )


def test_the_error_of_contact_without_other_forces():
    """Where contact carries what acts it is the largest of the other errors; without reactions it is none."""
    step = (problem := heated(1e-8, None, heat=0.0)).solve()
    largest = max(step.error, step.slip_error, step.forward_error)
    share = step.contact_error / largest if largest else 1.0
    assert 1.0 <= share < 2.0
    assert heated(1e-8, None, shorter=0.02).solve().contact_error == 0.0
    assert problem.contacts[0].force()[-1] == pytest.approx(10.0)
