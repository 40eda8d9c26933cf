"""A body on soft springs: its rigid motions are balanced apart, and the fixed point solves it."""

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem
from mpi4py import MPI

import dolfinx_contact as dc
from dolfinx_contact.contact_equations import ContactEquations

SHAPES = [(6, 4), (4, 4, 2)]


def held_by_springs(stiffness, cells, solver=None, comm=scenes.COMM, tol=1e-10, **options):
    """A block in springs of ``stiffness`` times its modulus, which pull it to ``scene.home``."""
    friction = {"mu": 0.2, "p": None} if len(cells) == 2 else {}
    scene = scenes.block(comm, cells, **friction, **options)
    scene.home = fem.Function(scene.V)
    stiffness = fem.Constant(scene.mesh, float(stiffness))  # one form for all
    pull = stiffness * scene.modulus * ufl.inner(scene.u - scene.home, ufl.TestFunction(scene.V))
    scene.problem = dc.ContactProblem(
        scene.F + pull * ufl.dx, scene.u, [scene.contact], solver=solver, tol=tol
    )

    def go(*displacement):
        scene.home.x.array[:] = np.tile(
            scene.axes @ displacement, scene.home.x.array.size // len(cells)
        )

    scene.go = go
    return scene


def equations_of(stiffness, cells, map, **options):
    """Equations of the first step of a block pressed and dragged, and a state with reactions."""
    scene = held_by_springs(stiffness, cells, turn=scenes.rotation() if len(cells) == 3 else None)
    problem = scene.problem
    scene.go(*[0.004, 0.002][: len(cells) - 1], -0.005)
    assert problem.body.refresh() == 1
    for contact in problem.contacts:
        contact.set_metric(problem.body.K)
    problem._stiffness = [contact.rho for contact in problem.contacts]
    b, external = problem.body.load()
    trial = problem.body.free_state(b)
    equations = ContactEquations(problem, b, *problem._load(trial, external))
    equations.use_metric(map, 1.0)
    return equations, trial


@pytest.mark.parametrize("map", ["return", "bipotential"])
@pytest.mark.parametrize("cells", SHAPES)
def test_no_force_is_left_along_rigid_motions(cells, map):
    """After balancing, the forces out of balance along all rigid motions have fallen a hundredfold or more."""
    equations, trial = equations_of(1e-4, cells, map)
    body, motions = equations.body, equations.body._rigid_modes()

    def along(x):
        return np.linalg.norm(body.total(motions.T @ equations.residual(x)[0]))

    assert along(equations.balanced(trial)) < 1e-2 * along(trial)


@pytest.mark.parametrize("map", ["return", "bipotential"])
@pytest.mark.parametrize("cells", SHAPES)
def test_slope_is_the_derivative_of_the_forces(cells, map):
    """Newton's matrix is the difference quotient of the forces along the motions, statuses mixed."""
    equations, trial = equations_of(1e-4, cells, map)
    body, rigid = equations.body, equations.problem._stiffened.rigid
    n = len(rigid)
    assert n == {2: 3, 3: 6}[len(cells)]
    x0 = equations.balanced(trial)
    forces = equations.b - body.multiply(x0)
    size = np.abs(rigid._modes).max()
    unit = body.largest(np.abs(trial)) / body.largest(np.array([size]))
    middle = 0.02 * unit * np.random.default_rng(3).normal(size=n)

    def left(c):
        return rigid._left(x0 + rigid._modes @ c, forces - rigid._forces @ c, map)

    quotient = [
        (left(middle - h)[0] - left(middle + h)[0]) / 2e-6 / unit for h in 1e-6 * unit * np.eye(n)
    ]
    slope = left(middle)[1]
    assert np.abs(np.transpose(quotient) - slope).max() < 1e-4 * np.abs(slope).max()


def test_held_bodies_have_no_motions_to_balance():
    """A block whose top is held pays nothing: no motion is soft."""
    scene = scenes.block(solver=dc.FixedPoint())
    scene.move_top(0, 0, -0.01)
    scene.problem.solve()
    assert len(scene.problem._stiffened.rigid) == 0


@pytest.mark.parametrize("stiffness", [1e-4, 1e-6])
@pytest.mark.parametrize("cells", SHAPES)
def test_fixed_point_solves_what_soft_springs_hold(cells, stiffness):
    """Pressed, dragged, tilted by the drag and nearly lifted: few iterations, and the reactions of Newton's method."""
    own = held_by_springs(stiffness, cells, dc.FixedPoint())
    newton = held_by_springs(stiffness, cells, dc.CondensedNewton(), MPI.COMM_SELF)
    for x, z in ((0, -0.005), (0.02, -0.005), (-0.02, -0.003), (0, -0.001)):
        for scene in (own, newton):
            scene.go(x, *[x / 2][: len(cells) - 2], z)
        step = own.problem.solve()
        newton.problem.solve()
        assert step.iterations <= 40
        # Errors are relative to the reactions of the trial state, which are those of the body unsprung.
        bound = 10 * own.problem.tol / stiffness
        (_, found), (_, expected) = scenes.gathered(own.contact), scenes.gathered(newton.contact)
        assert np.abs(found - expected).max() <= bound * np.abs(expected).max()
