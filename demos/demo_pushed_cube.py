# %% [markdown]
# # A cube pushed across a table
#
# A cube lies on a table. Nothing but its weight and friction holds it: no support, no spring. A side force pushes it,
# at first less than friction can carry, then more.
#
# ## Notation
#
# $\Omega$ the cube with edge $L$, $z$ up, the table is $z = 0$; $u$ displacement, $\sigma$ stress, $W$ weight, $Q$ side force,
# both spread uniformly over the volume; $\mu$ coefficient of friction, $r$ reactions of the contact nodes, $x$ their positions.
# Units: mm, N, MPa.
#
# ## Strong form
#
# $$ -\operatorname{div} \sigma(u) = \frac{1}{L^3} (Q, 0, -W), \qquad
#    u_z \ge 0,\; r_z \ge 0,\; u_z r_z = 0, \qquad |r_t| \le \mu r_z, \quad
#    r_t = -\mu r_z \frac{\Delta u_t}{|\Delta u_t|} \text{ where } \Delta u_t \ne 0. $$
#
# No boundary value is given, so the sums of forces and moments vanish, whatever the material:
#
# $$ \sum r = (-Q, 0, W), \qquad \sum x \times r = -\tfrac{L}{2} (1, 1, 1) \times (Q, 0, -W). $$
#
# A **static state** exists up to $Q = \mu W$; the cube would tip at $Q = W$.
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \int_\Omega f \cdot v \,\mathrm{d}x + \sum_{\text{contact nodes}} r \cdot v,
#    \qquad f = (Q, 0, -W) / L^3. $$
#
# ## Code
#
# There is no `bcs`.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, hooke, on_all_ranks, picture, picture_of_body, say

E, NU, MU = 210e3, 0.3, 0.3
LENGTH, WEIGHT = 100.0, 77.0  # a cube of steel


def cube(cells: int = 8):
    """The problem of the cube on the table, and its force per volume."""
    corners = [np.zeros(3), np.full(3, LENGTH)]
    domain = mesh.create_box(COMM, corners, [cells] * 3, mesh.CellType.hexahedron)
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    f = fem.Constant(domain, np.zeros(3))
    F = ufl.inner(hooke(ufl.sym(ufl.grad(u)), E, NU), ufl.grad(v)) * ufl.dx
    F -= ufl.inner(f, v) * ufl.dx
    foot = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[2], 0))
    table = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1))
    return dc.ContactProblem(F, u, [dc.Contact(V, foot, table, dc.Friction(MU))]), f


def reactions(problem):
    """Places and reactions of all contact nodes, global components, on every rank."""
    contact = problem.contacts[0]
    return on_all_ranks(contact.x, contact.reaction @ contact.frame)


# %% [markdown]
# ## Result
#
# 1. Sums of forces and moments of the reactions are those of statics, to $10^{-7}$ of the weight.
# 2. Up to $0.999\, \mu W$ the cube rests; the part of its foot that slips grows.
# 3. $1.001\, \mu W$ is refused. The message names the motion, a translation along the force; the problem keeps its last converged state.


# %%
def main():
    """Push; print and assert what is claimed above; places and reactions of the last state."""
    problem, f = cube()
    for part in (0.0, 0.5, 0.9, 0.999):
        load = np.array([part * MU * WEIGHT, 0, -WEIGHT])
        f.value[:] = load / LENGTH**3
        step = problem.solve()
        x, r = reactions(problem)
        moment = np.cross(x, r).sum(axis=0) + np.cross(np.full(3, LENGTH / 2), load)
        assert np.abs(r.sum(axis=0) + load).max() < 1e-7 * WEIGHT
        assert np.abs(moment).max() < 1e-7 * WEIGHT * LENGTH
        counts = f"{step.counts.stick} stick, {step.counts.slip} slip, {step.counts.open} open"
        say(f"Q = {part:5.3f} mu W: friction {-r[:, 0].sum():7.4f} N; {counts}")
    kept = problem.u.x.array.copy()
    f.value[0] = 1.001 * MU * WEIGHT / LENGTH**3
    try:
        problem.solve()
    except dc.NotConverged as refused:
        said = str(refused)
    assert "a translation along (1, 0, 0)" in said and np.array_equal(problem.u.x.array, kept)
    say(said[said.index("The loads") :])
    picture_of_body(problem)
    return x, r


def draw(figure, x, r) -> None:
    """Reactions on the foot at 0.999 of what friction carries: normal ones as colour, friction as arrows."""
    axes = figure.subplots()
    colours = axes.scatter(*x[:, :2].T, c=r[:, 2], s=120, cmap="Blues", edgecolors="#888888")
    axes.quiver(*x[:, :2].T, *r[:, :2].T, color="#d55e00")
    figure.colorbar(colours, label="normal reaction, N")
    axes.set(xlabel="x, mm", ylabel="y, mm", aspect="equal")


if __name__ == "__main__":
    picture(draw, *main())
