# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Internal variables: plasticity and viscoelasticity against closed forms, and what a failed step leaves."""

import numpy as np
import pytest
import ufl
from nonlinear_scenes import HEIGHT, MPI, block, move

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh

from dolfinx_contact.bodies.elastic import ElasticBody
from dolfinx_contact.compat import functionspace, interpolation_points
from dolfinx_contact.extend import Solver

pytestmark = pytest.mark.ranks
E, NU = 200.0, 0.3
SHEAR, LAME = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))
YIELD, HARDENING = 0.5, 20.0
PAIRS = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]


def voigt(tensor, shear=1.0):
    """Six components; those of shear times ``shear``."""
    return ufl.as_vector([(1.0 if i == j else shear) * tensor[i, j] for i, j in PAIRS])


class Plasticity:
    """Small strains, von Mises, linear isotropic hardening: radial return in NumPy, one value a tetrahedron."""

    def __init__(self):
        self.calls = 0

    def form(self, u, v, modulus):
        domain = u.function_space.mesh
        S, M, H = (functionspace(domain, ("DG", 0, shape)) for shape in ((6,), (6, 6), ()))
        self.plastic, self.hardening = fem.Function(S), fem.Function(H)
        self._strain, self.stress, self._tangent = map(fem.Function, (S, S, M))
        self._trial = fem.Expression(voigt(ufl.sym(ufl.grad(u)), 2.0), interpolation_points(S))
        tested = voigt(ufl.sym(ufl.grad(v)), 2.0)
        du = voigt(ufl.sym(ufl.grad(ufl.TrialFunction(u.function_space))), 2.0)
        self.J = ufl.inner(ufl.dot(self._tangent, du), tested) * ufl.dx
        return ufl.inner(self.stress, tested) * ufl.dx

    def before_residual(self, u):
        """Stress and consistent tangent at ``u`` from the state of the last step [Simo, Hughes 1998, box 3.2]."""
        self.calls += 1
        self._strain.interpolate(self._trial)
        strain = (self._strain.x.array - self.plastic.x.array).reshape(-1, 6)
        before = self.hardening.x.array
        one = np.array([1.0, 1, 1, 0, 0, 0])
        to_tensor = np.diag([1.0, 1, 1, 0.5, 0.5, 0.5])
        deviator = 2 * SHEAR * (to_tensor - np.outer(one, one) / 3)
        bulk = LAME + 2 * SHEAR / 3
        trial = strain @ deviator
        size = np.sqrt((trial**2 * [1, 1, 1, 2, 2, 2]).sum(axis=1))
        above = size - np.sqrt(2 / 3) * (YIELD + HARDENING * before)
        self._gamma = np.maximum(above, 0.0) / (2 * SHEAR + 2 / 3 * HARDENING)
        self._normal = trial / np.maximum(size, 1e-300)[:, None]
        stress = bulk * np.outer(strain[:, :3].sum(axis=1), one) + trial
        stress -= 2 * SHEAR * self._gamma[:, None] * self._normal
        kept = 1 - 2 * SHEAR * self._gamma / np.maximum(size, 1e-300)
        # A state on the yield surface, as after a step, has two tangents: the elastic one, not the one rounding picks.
        yields = above > 1e-9 * YIELD
        slope = np.where(yields, 2 * SHEAR / (1 + HARDENING / (3 * SHEAR)) - 2 * SHEAR * (1 - kept), 0.0)  # fmt: skip
        normals = self._normal[:, :, None] * self._normal[:, None, :]
        tangent = bulk * np.outer(one, one) + kept[:, None, None] * deviator
        tangent = tangent - slope[:, None, None] * normals
        self.stress.x.array[:] = stress.ravel()
        self._tangent.x.array[:] = tangent.ravel()

    def after_step(self, u):
        """Plastic strain and hardening at the end of the step."""
        grown = self._gamma[:, None] * self._normal * [1, 1, 1, 2, 2, 2]
        self.plastic.x.array[:] += grown.ravel()
        self.hardening.x.array[:] += np.sqrt(2 / 3) * self._gamma


def plastic_block(solver=None, **options):
    law = Plasticity()
    form = law.form
    domain = dict(cells=(2, 2, 2), cell=mesh.CellType.tetrahedron)
    late = {}

    def made(u, v, modulus):
        F = form(u, v, modulus)
        late.update(J=law.J, state=[law.plastic, law.hardening])
        return F

    scene = block(made, **domain, solver=solver, before_residual=law.before_residual, after_step=lambda u: law.after_step(u), late=late, **options)  # fmt: skip
    scene.law = law
    return scene


def uniaxial(path):
    """Stresses of a path of uniaxial strains."""
    plastic, grown = 0.0, 0.0
    for strain in path:
        trial = E * (strain - plastic)
        above = abs(trial) - YIELD - HARDENING * grown
        more = max(above, 0.0) / (E + HARDENING)
        plastic, grown = plastic + more * np.sign(trial), grown + more
        yield E * (strain - plastic)


@pytest.mark.parametrize("solver", [None, dc.FixedPoint(), dc.CondensedNewton()])
def test_plastic_block(solver):
    """Loaded, unloaded and loaded again between frictionless planes, a block has the uniaxial curve."""
    scene = plastic_block(solver, tol=1e-10)
    path = [0.002, 0.006, 0.01, 0.0085, 0.012]
    for strain, stress in zip(path, uniaxial(path)):
        move(scene, -strain * HEIGHT)
        scene.problem.solve()
        assert scene.contact.force()[2] == pytest.approx(stress, rel=1e-8)
        # what before_residual wrote last is that of the step
        np.testing.assert_allclose(scene.law.stress.x.array[2::6], -stress, rtol=1e-7)
    move(scene, 0.0)
    scene.problem.solve()  # the plastic strain has made it shorter: it lifts off
    assert scene.contact.force()[2] == pytest.approx(0.0, abs=1e-9)


class Curious(Solver):
    """Newton's method, and a look at the undeformed body before it answers."""

    nonlinear = True

    def bind(self, step):
        self.bound = dc.SparseNewton().bind(step)
        return self

    def update(self, step):
        self.bound.update(step)

    def solve(self, step, starts):
        found = self.bound.solve(step, starts)
        step.body.residual(np.zeros_like(found.state.x))
        return found

    def close(self):
        self.bound.close()


def test_the_state_moves_on_from_the_answer():
    """Whatever the solver looked at last, before_residual has been called at the answer when after_step is."""
    scene = plastic_block(Curious(), tol=1e-10)
    path = (0.01, 0.0085)  # loaded and unloaded
    for strain, stress in zip(path, uniaxial(path)):
        move(scene, -strain * HEIGHT)
        scene.problem.solve()
        assert scene.contact.force()[2] == pytest.approx(stress, rel=1e-8)


def test_a_failed_step_leaves_the_state():
    """After a step that does not converge, and one whose after_step raises, all is as after the last good one."""
    scene = plastic_block(tol=1e-10)
    problem, law = scene.problem, scene.law
    move(scene, -0.006 * HEIGHT)
    problem.solve()
    arrays = (law.plastic.x.array, law.hardening.x.array, scene.u.x.array)
    kept = [array.copy() for array in arrays]

    def stands():
        return all(np.array_equal(array, was) for array, was in zip(arrays, kept))

    move(scene, -0.01 * HEIGHT)
    problem.solver = dc.SparseNewton(max_iterations=1)
    with pytest.raises(dc.NotConverged):
        problem.solve()
    assert stands()
    problem.solver, advance = None, law.after_step

    def failing(u):
        advance(u)
        raise ArithmeticError("of the user")

    law.after_step = failing
    with pytest.raises(ArithmeticError, match="of the user"):
        problem.solve()
    assert stands()
    law.after_step = advance
    problem.solve()
    assert not stands()
    assert scene.contact.force()[2] == pytest.approx(list(uniaxial([0.006, 0.01]))[1], rel=1e-8)
    problem.reset()
    assert not law.hardening.x.array.any()


def test_a_step_taken_back_after_a_reset():
    """Reset, one step, rewind: internal variables are those of the undeformed body again."""
    scene = plastic_block(tol=1e-10)
    for between in (scene.problem.reset, scene.problem.rewind):
        move(scene, -0.01 * HEIGHT)
        scene.problem.solve()
        assert scene.law.hardening.x.array.any()
        between()
        assert not scene.law.hardening.x.array.any()


def test_a_checkpoint_has_the_state(tmp_path):
    """A run goes on from a file with the plastic strains it had."""
    path = MPI.COMM_WORLD.bcast(tmp_path, root=0) / "plastic.npz"
    first, second = plastic_block(tol=1e-10), plastic_block(tol=1e-10)
    move(first, -0.01 * HEIGHT)
    first.problem.solve()
    first.problem.save(path)
    second.problem.load(path)
    np.testing.assert_array_equal(second.law.plastic.x.array, first.law.plastic.x.array)
    move(second, -0.009 * HEIGHT)
    second.problem.solve()
    assert second.contact.force()[2] == pytest.approx(list(uniaxial([0.01, 0.009]))[1], rel=1e-8)


def test_relaxation():
    """A viscoelastic block held at a height relaxes as backward Euler in closed form; its stiffness is set up once."""
    soft, stiff, rate = 1.0, 3.0, 0.2  # moduli of both springs, time step over time of relaxation
    held = {}

    def form(u, v, modulus):
        strain = ufl.sym(ufl.grad(u))
        held["flow"] = fem.Function(functionspace(u.function_space.mesh, ("DG", 0, (3, 3))))
        held["strain"] = fem.Expression(strain, interpolation_points(held["flow"].function_space))
        elastic = (strain - held["flow"]) / (1 + rate)  # of the second spring, at the end
        total = soft * strain + stiff * elastic
        lame = NU / ((1 + NU) * (1 - 2 * NU))
        stress = lame * ufl.tr(total) * ufl.Identity(3) + total / (1 + NU)
        return ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx

    def flow_on(u):
        flow, strain = held["flow"], fem.Function(held["flow"].function_space)
        strain.interpolate(held["strain"])
        flow.x.array[:] = (flow.x.array + rate * strain.x.array) / (1 + rate)

    tets = dict(cells=(2, 2, 2), cell=mesh.CellType.tetrahedron)
    late = {}

    def made(u, v, modulus):
        F = form(u, v, modulus)
        late["state"] = [held["flow"]]
        return F

    scene = block(made, **tets, after_step=flow_on, late=late, tol=1e-11)
    move(scene, -0.01 * HEIGHT)
    for n in range(1, 6):
        scene.problem.solve()
        stress = 0.01 * (soft + stiff * (1 + rate) ** -n)
        assert scene.contact.force()[2] == pytest.approx(stress, rel=1e-9)
    assert type(scene.problem.body) is ElasticBody and scene.problem.body.refresh() == 1


def test_what_makes_no_sense_is_refused():
    """State that is no Function, callbacks that cannot be called, and before_residual without a derivative."""
    with pytest.raises(ValueError, match="state must"):
        block(state=[1.0])
    with pytest.raises(ValueError, match="after_step"):
        block(after_step=3)
    with pytest.raises(ValueError, match="before_residual"):
        block(before_residual=3)
    with pytest.raises(ValueError, match="give J"):
        block(before_residual=lambda u: None)
