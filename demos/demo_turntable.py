# %% [markdown]
# # A pin on a turntable
#
# A weight presses a short square pin on a plate that turns about an axis beside it. `plane.rotation` turns the plate, by
# finite angles, and slip is relative to it. The torque that friction makes is known.
#
# ## Notation
#
# $(x, y, z)$, the plate is $z = 0$ and turns by $\theta$ about the $z$ axis; $u$ displacement, $r$ a node's distance from
# the axis, $N$ weight, $\mu$ coefficient of friction, $f_i$ friction at a node, $n_i$ its normal reaction, $T$ torque, $D$ work of
# friction. Units: mm, N, MPa.
#
# ## Strong form
#
# $$ -\operatorname{div} \sigma(u) = 0, \qquad
#    w = u - (R_\theta - 1)\, x, \qquad w_z \ge 0,\; n \ge 0,\; w_z\, n = 0, \qquad |f| \le \mu n, \quad
#    f = -\mu n\, \frac{\Delta w_t}{|\Delta w_t|} \text{ where } \Delta w_t \ne 0, $$
#
# $R_\theta$ the rotation and $\Delta w_t$ the slip of a step, tangential. The top of the pin is held, and the plate is free along its normal: it presses with $N$.
#
# The **closed form**: once every node slides, friction is along the motion of the plate, $\mu n_i$ at a lever $r_i$. With a uniform
# pressure on the foot $S$
#
# $$ T = \mu N \bar r, \qquad \bar r = \frac{1}{|S|} \int_S r \,\mathrm{d}S, $$
#
# and each turn by $\Delta\theta$ dissipates $T \Delta\theta$.
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \sum_{\text{contact nodes}} r_i \cdot v_i, \qquad \sum n_i = N . $$
#
# ## Code
#
# The slip of a step is the arc on the plate, with the direction that it has at the end of the step.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, hooke, on_all_ranks, picture, picture_of_body, say

E, NU, MU = 210e3, 0.0, 0.2
INNER, WIDTH, HEIGHT = 1.0, 2.0, 0.2  # the foot is INNER < x < INNER + WIDTH, |y| < WIDTH / 2
WEIGHT = 100.0
TURN = 0.01


def pin(cells: int = 8):
    """The problem of the pin on its plate."""
    low, high = [INNER, -WIDTH / 2, 0.0], [INNER + WIDTH, WIDTH / 2, HEIGHT]
    domain = mesh.create_box(COMM, [low, high], [cells, cells, 2], mesh.CellType.hexahedron)
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = ufl.inner(hooke(ufl.sym(ufl.grad(u)), E, NU), ufl.grad(v)) * ufl.dx
    foot, top = (
        mesh.locate_entities_boundary(domain, 2, lambda x, z=z: np.isclose(x[2], z))
        for z in (0.0, HEIGHT)
    )
    bc = fem.dirichletbc(fem.Function(V), fem.locate_dofs_topological(V, 2, top))
    plate = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1))
    plate.free, plate.force = ("n",), (0, 0, WEIGHT)
    contact = dc.Contact(V, foot, plate, dc.Friction(MU))
    return dc.ContactProblem(F, u, [contact], bcs=[bc])


def mean_radius(points: int = 200) -> float:
    """Mean distance of the foot from the axis."""
    middle = (np.arange(points) + 0.5) / points
    x, y = np.meshgrid(INNER + WIDTH * middle, WIDTH * (middle - 0.5))
    return float(np.hypot(x, y).mean())


def friction(problem):
    """Positions, normal reactions and friction of all contact nodes, global components, on every rank."""
    contact = problem.contacts[0]
    u = problem.u.x.array.reshape(-1, 3)[contact.nodes]
    return on_all_ranks((contact.x + u)[:, :2], contact.reaction[:, 2], contact.reaction[:, :2] @ contact.frame[:2, :2])  # fmt: skip


# %% [markdown]
# ## Result
#
# 1. All nodes slide from the first turn on, and the sum of the normal reactions is the weight.
# 2. At every node friction is along the motion of the plate there, to $10^{-3}$.
# 3. The torque is $\mu N \bar r$ to 1 %.
# 4. The frictional work of each further turn is $T \Delta\theta$ to 0.1 %.


# %%
def main(turns: int = 5):
    """Press and turn; print and assert what is claimed above; positions and friction."""
    problem = pin()
    contact, plate = problem.contacts[0], problem.contacts[0].surface
    problem.solve()
    expected, before = MU * WEIGHT * mean_radius(), 0.0
    for k in range(1, turns + 1):
        plate.rotation = (0, 0, k * TURN)
        step = problem.solve()
        x, normal, force = friction(problem)
        torque = (x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]).sum()
        work = COMM.allreduce(contact.dissipation.sum())
        along = np.column_stack((-x[:, 1], x[:, 0])) / np.linalg.norm(x, axis=1)[:, None]
        off = np.abs(force - MU * normal[:, None] * along).max() / (MU * normal.max())
        assert step.counts.slip == len(normal) and np.isclose(normal.sum(), WEIGHT, rtol=1e-7)
        assert off < 1e-3 and abs(torque / expected - 1) < 0.01
        assert k == 1 or abs((work - before) / (torque * TURN) - 1) < 1e-3
        before = work
    say(f"torque {torque:.4f} N mm, mu N r {expected:.4f}; friction differs from the motion of the plate by {off:.0e} at most; "
        f"dissipated {work:.5f} N mm in {turns * TURN:.2f} rad")  # fmt: skip
    picture_of_body(problem)
    return x, force


def draw(figure, x, force) -> None:
    """Friction of the nodes on the plate."""
    axes = figure.subplots()
    axes.quiver(*x.T, *force.T, color="#d55e00")
    axes.plot(0, 0, "k+", markersize=12)
    axes.set(xlabel="x, mm", ylabel="y, mm", aspect="equal")


if __name__ == "__main__":
    picture(draw, *main())
