# %% [markdown]
# # A cylinder in a V-groove
#
# A cylinder lies in a groove of two planes under its weight, and a torque turns it. Contact and friction alone hold it. How
# much torque the groove carries follows from statics.
#
# ## Notation
#
# $R$ radius, $W$ weight and $T$ torque per length, $y$ up; $\alpha$ slope of both planes, $n_1 = (\sin\alpha, \cos\alpha)$ and
# $n_2 = (-\sin\alpha, \cos\alpha)$ their normals, $t_i$ the normals turned to the left, $N_i$ normal force and $F_i$ friction
# along $t_i$ on the cylinder, $\mu$ coefficient of friction; $r$ reactions of the contact nodes, $x$ their positions. Units: mm, N, MPa.
#
# ## Strong form
#
# $$ -\operatorname{div} \sigma(u) = f, \qquad
#    w_n \ge 0,\; r_n \ge 0,\; w_n r_n = 0, \qquad |r_t| \le \mu r_n, \quad
#    r_t = -\mu r_n \frac{\Delta w_t}{|\Delta w_t|} \text{ where } \Delta w_t \ne 0 $$
#
# on both planes, $w$ the motion relative to them; $f$ is the weight, and a force about the axis that grows like the radius.
#
# The **closed form**: the cylinder touches at $-R n_i$, so equilibrium is
#
# $$ N_1 n_1 + F_1 t_1 + N_2 n_2 + F_2 t_2 = (0, W), \qquad R\, (F_1 + F_2) = T, $$
#
# three equations for four forces. The largest torque has $F_i = \mu N_i$, and then they have one solution:
#
# $$ \begin{pmatrix} \sin\alpha - \mu\cos\alpha & -\sin\alpha - \mu\cos\alpha \\ \cos\alpha + \mu\sin\alpha & \cos\alpha - \mu\sin\alpha
#    \end{pmatrix} \begin{pmatrix} N_1 \\ N_2 \end{pmatrix} = \begin{pmatrix} 0 \\ W \end{pmatrix}, \qquad
#    T_{\max} = \mu R\, (N_1 + N_2). $$
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \int_\Omega f \cdot v \,\mathrm{d}x + \sum_{\text{contact nodes}} r \cdot v. $$
#
# ## Code
#
# One contact for each plane; no `bcs`.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, hooke, on_all_ranks, picture, picture_of_body, say

E, NU, MU = 1e3, 0.3, 0.25
RADIUS, WEIGHT, SLOPE = 10.0, 20.0, np.pi / 4


def disc(cells: int):
    """A disc of quadrilaterals; the corners of the square it is made of are at the top, the bottom and the sides."""
    corners = [-np.ones(2), np.ones(2)]
    domain = mesh.create_rectangle(COMM, corners, [cells] * 2, mesh.CellType.quadrilateral)
    x = domain.geometry.x
    size, length = np.abs(x).max(axis=1), np.linalg.norm(x, axis=1)
    x *= ((1 - size) + size**2 / np.where(length > 0, length, 1.0))[
        :, None
    ]  # round where size is 1
    x[:, :2] = RADIUS / np.sqrt(2) * np.column_stack((x[:, 0] - x[:, 1], x[:, 0] + x[:, 1]))
    return domain


def cylinder(cells: int = 48):
    """The problem of the cylinder in the groove; its weight per area, and the torque's force per area and radius."""
    domain = disc(cells)
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    weight, turn = fem.Constant(domain, 0.0), fem.Constant(domain, 0.0)
    x = ufl.SpatialCoordinate(domain)
    f = ufl.as_vector((-turn * x[1], turn * x[0] - weight))
    F = ufl.inner(hooke(ufl.sym(ufl.grad(u)), E, NU), ufl.grad(v)) * ufl.dx
    F -= ufl.inner(f, v) * ufl.dx
    contacts = []
    for side in (-1, 1):
        normal = np.array([-side * np.sin(SLOPE), np.cos(SLOPE)])

        def near(x, normal=normal):
            """On the circle, some 9 degrees to both sides of the place that touches."""
            on_circle = np.isclose(np.hypot(x[0], x[1]), RADIUS)
            return on_circle & (np.linalg.norm(x[:2].T + RADIUS * normal, axis=1) < 0.15 * RADIUS)

        plane = dc.RigidPlane(point=-RADIUS * normal, normal=normal)
        face = mesh.locate_entities_boundary(domain, 1, near)
        contacts.append(dc.Contact(V, face, plane, dc.Friction(MU)))
    sums = [fem.assemble_scalar(fem.form(part * ufl.dx)) for part in (fem.Constant(domain, 1.0), ufl.dot(x, x))]  # fmt: skip
    return dc.ContactProblem(F, u, contacts), weight, turn, [COMM.allreduce(part) for part in sums]


def limit() -> tuple[np.ndarray, float]:
    """Normal forces on both planes under the largest torque, and that torque."""
    s, c = np.sin(SLOPE), np.cos(SLOPE)
    equations = [[s - MU * c, -s - MU * c], [c + MU * s, c - MU * s]]
    normal = np.linalg.solve(equations, [0, WEIGHT])
    return normal, MU * RADIUS * normal.sum()


def moment(contact) -> float:
    """Moment of a contact's reactions about the axis of the cylinder."""
    x, r = on_all_ranks(contact.x, contact.reaction @ contact.frame)
    return float((x[:, 0] * r[:, 1] - x[:, 1] * r[:, 0]).sum())


# %% [markdown]
# ## Result
#
# 1. Forces and moments of the reactions balance weight and torque, to $10^{-7}$ of the weight.
# 2. Close to the largest torque, at $0.999\, T_{\max}$, both normal forces are those of the closed form to 1 %.
# 3. $2\, T_{\max}$ is refused. The message names the motion, a rotation; the problem keeps its last converged state.
#
# A little above $T_{\max}$ there still are static states: geometry is linear, so a rotation of some degrees moves the contact along
# the faces, where normal forces have a lever. Twice the torque exceeds what any nodes of the faces can carry.


# %%
def main():
    """Turn; print and assert what is claimed above; torque over the largest one, and forces over the weight."""
    problem, weight, turn, (area, inertia) = cylinder()
    expected, largest = limit()
    weight.value, table = WEIGHT / area, []
    for part in (0.2, 0.5, 0.8, 0.95, 0.999):
        turn.value = part * largest / inertia
        problem.solve()
        forces = np.array([contact.force() for contact in problem.contacts])
        turning = sum(moment(contact) for contact in problem.contacts)
        assert np.abs(forces.sum(axis=0) - [0, WEIGHT]).max() < 1e-7 * WEIGHT
        assert abs(turning + part * largest) < 1e-7 * WEIGHT * RADIUS
        normal = [
            force @ contact.surface.normal for force, contact in zip(forces, problem.contacts)
        ]
        table.append([part, *np.array(normal) / WEIGHT])
        say(f"T = {part:5.3f} T_max: N_1 = {normal[0]:.4f}, N_2 = {normal[1]:.4f} N per mm")
    assert np.allclose(normal, expected, rtol=0.01)
    kept = problem.u.x.array.copy()
    turn.value = 2 * largest / inertia
    try:
        problem.solve()
    except dc.NotConverged as refused:
        said = str(refused)
    assert "a rotation about" in said and np.array_equal(problem.u.x.array, kept)
    say(
        f"closed form: N_1 = {expected[0]:.4f}, N_2 = {expected[1]:.4f}, T_max = {largest:.4f} N mm per mm"
    )
    say(said[said.index("The loads") :])
    picture_of_body(problem)
    return np.array(table), expected / WEIGHT


def draw(figure, table, expected) -> None:
    """Normal forces over the torque, and those of the closed form."""
    axes = figure.subplots()
    for k, colour in ((1, "#0072b2"), (2, "#d55e00")):
        axes.plot(table[:, 0], table[:, k], "o-", color=colour, label=f"$N_{k}$")
        axes.plot(1.0, expected[k - 1], "x", color=colour, markersize=10)
    axes.set(xlabel="torque over the largest one", ylabel="normal force over weight")
    axes.legend(title="crosses: closed form")


if __name__ == "__main__":
    picture(draw, *main())
