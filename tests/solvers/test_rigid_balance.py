"""A body on soft springs: its rigid motions are balanced apart, and the fixed point solves it."""

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem
from mpi4py import MPI

import dolfinx_contact as dc
from dolfinx_contact.law.maps import BipotentialMap, ReturnMap
from dolfinx_contact.solvers.fixed_point.preconditioner import ContactPreconditioner

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


def pressed_and_dragged(stiffness, cells, map):
    """The first step of a block pressed and dragged, maps, its rigid balance, and a state with reactions."""
    scene = held_by_springs(stiffness, cells, turn=scenes.rotation() if len(cells) == 3 else None)
    scene.go(*[0.004, 0.002][: len(cells) - 1], -0.005)
    step = scene.problem.load_step()
    trial = step.body.free_state(step.b)
    rho = [of.normal for of in step.stiffness]
    maps = [BipotentialMap(r) if map == "bipotential" else ReturnMap(r, r) for r in rho]
    return step, maps, ContactPreconditioner(step.body, step.contacts, maps).rigid, trial


@pytest.mark.parametrize("map", ["return", "bipotential"])
@pytest.mark.parametrize("cells", SHAPES)
def test_no_force_is_left_along_rigid_motions(cells, map):
    """After balancing, the forces out of balance along all rigid motions have fallen a hundredfold or more."""
    step, maps, rigid, trial = pressed_and_dragged(1e-4, cells, map)
    body, motions = step.body, step.body.rigid_modes()

    def along(x):
        return np.linalg.norm(body.total(motions.T @ step.out_of_balance(x, maps)))

    assert along(rigid.balanced(trial, step, maps)[0]) < 1e-2 * along(trial)


@pytest.mark.parametrize("map", ["return", "bipotential"])
@pytest.mark.parametrize("cells", SHAPES)
def test_slope_is_the_derivative_of_the_forces(cells, map):
    """Newton's matrix is the difference quotient of the forces along the motions, statuses mixed."""
    step, maps, rigid, trial = pressed_and_dragged(1e-4, cells, map)
    body, n = step.body, len(rigid)
    assert n == {2: 3, 3: 6}[len(cells)]
    x0, _ = rigid.balanced(trial, step, maps)
    forces = step.b - body.multiply(x0)
    size = np.abs(rigid.modes).max()
    unit = body.largest(np.abs(trial)) / body.largest(np.array([size]))
    middle = 0.02 * unit * np.random.default_rng(3).normal(size=n)

    def left(c):
        return rigid.left(x0 + rigid.modes @ c, forces - rigid.forces @ c, step, maps)

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
    assert len(scene.problem.bound().preconditioner.rigid) == 0


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
        other = newton.problem.solve()
        assert step.iterations <= 40
        # The judge's bound of reactions, see judge.py, by the error that a step admits where rounding limits it.
        bound = 1000 * max(
            own.problem.tol, step.error, step.slip_error, other.error, other.slip_error
        )
        (_, found), (_, expected) = scenes.gathered(own.contact), scenes.gathered(newton.contact)
        assert np.abs(found - expected).max() <= bound * np.abs(expected).max()
