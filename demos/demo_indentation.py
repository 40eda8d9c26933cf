# %% [markdown]
# # A flat punch on a plastic half-plane
#
# A rigid flat punch without friction is pressed into a von Mises material, deeper and deeper, until the material flows beside it.
# Then the punch is lifted off and leaves an imprint. The material is written in UFL, which also finds its derivative.
#
# ## Notation
#
# $u$ displacement, $\varepsilon$ strain, $\sigma$ stress, $\varepsilon^p$ plastic strain, $\alpha$ accumulated plastic strain,
# $s = \operatorname{dev} \sigma$; $G$, $K$ moduli of shear and of volume, $\sigma_y$ yield stress, $H$ hardening modulus,
# $k = \sigma_y / \sqrt 3$; $a$ half width of the punch, $N$ its force. Plane strain.
#
# ## Strong form
#
# $$ \operatorname{div} \sigma = 0, \quad \sigma = K \operatorname{tr}\varepsilon\, I + 2 G (\operatorname{dev} \varepsilon - \varepsilon^p), \quad
#    |s| \le \sqrt{2/3}\, (\sigma_y + H \alpha), \quad \dot\varepsilon^p = \dot\gamma\, s / |s|, \quad \dot\alpha = \sqrt{2/3}\, \dot\gamma , $$
#
# unilateral contact with the punch, no friction. The **closed form** of Prandtl, without hardening: the mean pressure tends to $(2 + \pi)\, k$.
#
# ## Weak form
#
# $$ F(u; v) = \int_\Omega \sigma(u; \varepsilon^p, \alpha) : \varepsilon(v) \,\mathrm{d}x = \sum_{\text{contact nodes}} r_i \cdot v_i, $$
#
# with $\sigma$ at the end of the step by radial return, $s = s^{tr} - 2 G\, \Delta\gamma\, s^{tr} / |s^{tr}|$. Triangles in crossed pairs do not lock.
#
# ## Code
#
# `InternalVariables` names the Functions that hold the state, and the function `after_step`, which updates them after a converged step.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace, interpolation_points

# isort: split
from types import SimpleNamespace

import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, on_all_ranks, picture, say

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


def indent(scene, depths, **options):
    """Forces of a frictionless punch, one depth after another."""
    plane = dc.RigidPlane((0, 0), (0, -1))
    contact = dc.Contact(scene.V, scene.top, plane, dc.Friction(0.0))
    problem = dc.ContactProblem(
        scene.F, scene.u, contact, bcs=scene.bcs, internal=dc.InternalVariables(scene.law.state, after_step=scene.law.after_step), tol=1e-9, **options
    )  # fmt: skip
    for depth in depths:
        plane.displacement = (0.0, -depth)
        problem.solve()
        yield -contact.force()[1]


# %% [markdown]
# ## Result
#
# 1. The first step is elastic; then the force grows ever more slowly. The punch acts as if half a cell wider than its nodes:
#    extrapolated from two meshes, its pressure is $(2 + \pi)\, k$ to 2 %.
# 2. The imprint that is left is more than half as deep as the punch was pressed in.


# %%
def main(cells=(10, 20)) -> dict:
    """Press on two meshes and take off; print and assert what is claimed above."""
    depths = YIELD / YOUNG * np.array([2.0, 5, 10, 15, 20, 25, 23, 20, 18, 17])
    deepest = np.argmax(depths)
    scenes = [half_plane(n) for n in cells]
    pressures = [np.array(list(indent(scene, depths))) / HALF / PRANDTL for scene in scenes]
    coarse, fine = (pressure[deepest] for pressure in pressures)
    found = 2 * fine - coarse
    u = scenes[-1].u.x.array.reshape(-1, 2)[: scenes[-1].V.dofmap.index_map.size_local]
    x = scenes[-1].V.tabulate_dof_coordinates()[: len(u), :2]
    x, u = on_all_ranks(x, u)
    left = -u[:, 1].min() / depths[deepest]
    say(
        f"pressure over (2 + pi) k: {coarse:.3f}, {fine:.3f}, extrapolated {found:.3f}; imprint {left:.2f} times the depth"
    )
    assert 1 < fine < coarse < 1.2 and abs(found - 1) < 0.02
    assert fine > 3 * pressures[-1][0]
    assert pressures[-1][-1] == 0.0 and 0.5 < left < 1
    return dict(depths=depths, pressures=pressures, x=x, u=u)


def draw(figure, found) -> None:
    """Pressure over depth, and the face after the punch has gone."""
    force, face = figure.subplots(1, 2)
    depths = np.append(0.0, found["depths"]) * YOUNG / YIELD
    for pressure, label in zip(found["pressures"], ("coarse", "fine")):
        force.plot(depths, np.append(0.0, pressure), ".-", label=label)
    force.axhline(1.0, color="0.5", lw=1, label="Prandtl")
    force.set(xlabel="depth, $\\sigma_y a / E$", ylabel="mean pressure / $(2 + \\pi) k$")
    force.legend(frameon=False)
    x, u = found["x"], found["u"]
    top = np.flatnonzero(np.isclose(x[:, 1], 0.0))
    top = top[np.argsort(x[top, 0])]
    face.plot(x[top, 0], u[top, 1] * YOUNG / YIELD, ".-")
    face.set(xlabel="x / a", ylabel="imprint, $\\sigma_y a / E$")


if __name__ == "__main__":
    picture(draw, main())
