"""A flat punch on a plastic half-plane: Prandtl's force, the same body by another Newton's method, and what unloading leaves."""

from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem import petsc
from mpi4py import MPI
from scipy import sparse

from dolfinx_contact.compat import functionspace, interpolation_points

COMM = MPI.COMM_WORLD
YOUNG, NU, YIELD = 1000.0, 0.3, 1.0
SHEAR, BULK, HARDENING = YOUNG / (2 + 2 * NU), YOUNG / (3 - 6 * NU), 1e-3 * YOUNG
HALF, SIZE = 1.0, 5.0  # of the punch, of the body
PRANDTL = (2 + np.pi) * YIELD / np.sqrt(3)  # pressure, von Mises


class Plasticity:
    """Von Mises in plane strain with linear hardening, radial return in plain UFL [Simo, Hughes 1998, box 3.2]; UFL finds J."""

    def __init__(self, u):
        domain = u.function_space.mesh
        S, A = functionspace(domain, ("DG", 0, (3, 3))), functionspace(domain, ("DG", 0))
        self.plastic, self.hardening = fem.Function(S), fem.Function(A)
        strain = ufl.sym(ufl.grad(u))
        strain = ufl.as_tensor([[strain[0, 0], strain[0, 1], 0], [strain[1, 0], strain[1, 1], 0], [0, 0, 0]])  # fmt: skip
        trial = 2 * SHEAR * (ufl.dev(strain) - self.plastic)
        size = ufl.sqrt(ufl.inner(trial, trial) + (1e-12 * YIELD) ** 2)
        above = size - np.sqrt(2 / 3) * (YIELD + HARDENING * self.hardening)
        # a state on the surface has the elastic tangent, whatever rounding says
        grown = ufl.conditional(ufl.gt(above, 1e-9 * YIELD), above, 0.0) / (2 * SHEAR + 2 / 3 * HARDENING)  # fmt: skip
        self.stress = BULK * ufl.tr(strain) * ufl.Identity(3) + trial - 2 * SHEAR * grown / size * trial  # fmt: skip
        self._next = [
            fem.Expression(e, interpolation_points(V))
            for e, V in ((self.plastic + grown / size * trial, S), (self.hardening + np.sqrt(2 / 3) * grown, A))
        ]  # fmt: skip

    def form(self, v):
        plane = ufl.as_tensor([[self.stress[i, j] for j in range(2)] for i in range(2)])
        return ufl.inner(plane, ufl.sym(ufl.grad(v))) * ufl.dx

    @property
    def state(self):
        return [self.plastic, self.hardening]

    def after_step(self, u):
        """Plastic strain and hardening at the end of the step."""
        new = [fem.Function(function.function_space) for function in self.state]
        for function, expression in zip(new, self._next):
            function.interpolate(expression)
        for function, values in zip(self.state, new):
            function.x.array[:] = values.x.array


def half_plane(cells, comm=COMM):
    """Right half of a block in crossed triangles, which do not lock; smaller ones at the punch."""
    size = [cells, cells]
    domain = mesh.create_rectangle(comm, [np.zeros(2), np.ones(2)], size, mesh.CellType.triangle, diagonal=mesh.DiagonalType.crossed)  # fmt: skip
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    near = 2 / 5 + 1e-9  # of the cells are under the punch

    def facets(where):
        return mesh.locate_entities_boundary(domain, 1, where)

    left, right = facets(lambda x: np.isclose(x[0], 0)), facets(lambda x: np.isclose(x[0], 1))
    low, top = facets(lambda x: np.isclose(x[1], 0)), facets(lambda x: np.isclose(x[1], 1) & (x[0] < near))  # fmt: skip
    x = domain.geometry.x

    def graded(s):
        """Even up to the edge of the punch, then growing."""
        t = np.maximum(s - near, 0.0)
        return s * HALF / near + t**2 * (SIZE - HALF / near) / (1 - near) ** 2

    x[:, 0], x[:, 1] = graded(x[:, 0]), -graded(1 - x[:, 1])
    u, v = fem.Function(V), ufl.TestFunction(V)
    law = Plasticity(u)

    def fix(axis, places, value=None):
        part = V.sub(axis)
        value = fem.Constant(domain, 0.0) if value is None else value
        return fem.dirichletbc(value, fem.locate_dofs_topological(part, 1, places), part)

    bcs = [fix(0, left), fix(0, right), fix(1, low)]
    return SimpleNamespace(mesh=domain, V=V, u=u, law=law, F=law.form(v), bcs=bcs, top=top, fix=fix)


def indent(scene, depths):
    """Forces of a frictionless punch, one depth after another."""
    plane = dc.RigidPlane((0, 0), (0, -1))
    contact = dc.Contact(scene.V, scene.top, plane, dc.Friction(0.0))
    problem = dc.ContactProblem(
        scene.F, scene.u, contact, scene.bcs, state=scene.law.state, after_step=scene.law.after_step, tol=1e-9
    )  # fmt: skip
    for depth in depths:
        plane.displacement = (0.0, -depth)
        problem.solve()
        yield -contact.force()[1]


def pushed(scene, depths):
    """The same with the punch as boundary values: Newton's method on them with SciPy, one rank, no contact."""
    down = fem.Constant(scene.mesh, 0.0)
    conditions = [*scene.bcs, scene.fix(1, scene.top, down)]
    F = fem.form(scene.F)
    J = fem.form(ufl.derivative(scene.F, scene.u))
    u, n = scene.u.x.array, scene.u.x.array.size
    under = fem.locate_dofs_topological(scene.V.sub(1), 1, scene.top)
    fixed = np.unique(np.concatenate([bc.dof_indices()[0] for bc in conditions]))
    free = np.setdiff1d(np.arange(n), fixed)
    for depth in depths:
        down.value = -depth
        for _ in range(30):
            move = np.zeros(n)
            move[under] = -depth - u[under]
            forces = petsc.assemble_vector(F).array
            A = petsc.assemble_matrix(J)
            A.assemble()
            A = sparse.csr_matrix(A.getValuesCSR()[::-1], shape=(n, n))
            left = -(forces + A @ move)[free]
            move[free] = sparse.linalg.spsolve(A[free][:, free].tocsc(), left)
            u += move
            if np.abs(move).max() < 1e-13 * SIZE:
                break
        yield -petsc.assemble_vector(F).array[under].sum()
        scene.law.after_step(scene.u)


def test_prandtl():
    """The punch is as wide as half a cell more than its nodes: extrapolated, its pressure is (2 + pi) k, k of the yield stress."""
    depths = YIELD / YOUNG * np.array([2.0, 5, 10, 15, 20, 25])
    coarse, fine = ([*indent(half_plane(cells), depths)] for cells in (10, 20))
    above = [forces[-1] / (HALF * PRANDTL) - 1 for forces in (coarse, fine)]
    assert 0 < above[1] < above[0] < 0.2
    assert abs(2 * above[1] - above[0]) < 0.02
    assert fine[0] < 0.4 * fine[-1]  # elastic at first


def test_the_punch_as_boundary_values():
    """Loaded, partly unloaded and loaded again forces are those of Newton's method without contact; taken off, the imprint stays."""
    depths = YIELD / YOUNG * np.array([2.0, 6, 12, 11, 14])
    scene = half_plane(10)
    *forces, _, left = indent(scene, [*depths, 0.9 * depths[-1], 0.0])
    expected = list(pushed(half_plane(10, MPI.COMM_SELF), depths))
    np.testing.assert_allclose(forces, expected, rtol=1e-7)
    assert forces[3] < 0.9 * forces[2] and left == 0.0
    deepest = COMM.allreduce(scene.u.x.array[1::2].min(initial=0.0), op=MPI.MIN)
    assert -depths[-1] < deepest < -0.5 * depths[-1]
