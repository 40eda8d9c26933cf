# %% [markdown]
# # A brick in the corner of a box
#
# A brick lies in the corner of a floor and two walls, and pressures on its other faces push it there. Nodes of an edge belong to
# two contacts, that of the corner to three. Nothing else holds the brick.
#
# ## Notation
#
# $e_k$ normals of floor and walls, $q_k$ pressures on the faces opposite to them, $A_k$ areas of these faces, $\mu$ coefficient of
# friction of the floor, walls are smooth; for each contact $c$: $w_n$ gap, $\Delta w_t$ slip, $r$ reactions of the contact nodes, $R_c$ their sum. Units: mm, N, MPa.
#
# ## Strong form
#
# $$ \operatorname{div} \sigma(u) = 0, \qquad \sigma e_k = -q_k e_k \text{ on the faces that are pushed}, $$
#
# and on each of the three other ones, with a gap, a slip and reactions of its own,
#
# $$ w_n \ge 0,\; r_n \ge 0,\; w_n r_n = 0, \qquad |r_t| \le \mu r_n, \quad
#    r_t = -\mu r_n \frac{\Delta w_t}{|\Delta w_t|} \text{ where } \Delta w_t \ne 0. $$
#
# The **closed form** without friction: stresses are uniform, $\sigma = -\operatorname{diag}(q_1, q_2, q_3)$, and every wall has the pressure
# of the face opposite to it. With friction there is an exact **balance**,
#
# $$ R_1 + R_2 + R_3 = (q_1 A_1, q_2 A_2, q_3 A_3). $$
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x + \sum_k \int_{\Gamma_k} q_k\, e_k \cdot v \,\mathrm{d}s
#    = \sum_c \sum_{\text{its nodes}} r \cdot v. $$
#
# ## Code
#
# One contact for each face; they share the nodes of edges and corner. No `bcs`.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, hooke, picture, picture_of_body, say

E, NU, MU, PRESSURE = 1e3, 0.3, 0.2, 1.0
EDGES = np.array([1.0, 1.0, 0.5])
AREAS = EDGES.prod() / EDGES


def brick(mu: float, cells=(3, 3, 2)):
    """The problem of the brick, ``mu`` of the floor, and the pressures on its three outer faces."""
    ends = [np.zeros(3), EDGES]
    domain = mesh.create_box(COMM, ends, cells, mesh.CellType.hexahedron)
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = ufl.inner(hooke(ufl.sym(ufl.grad(u)), E, NU), ufl.grad(v)) * ufl.dx
    pressures = [fem.Constant(domain, 0.0) for _ in range(3)]

    def face(k, at):
        return mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[k], at))

    outer = [face(k, EDGES[k]) for k in range(3)]
    marks = np.repeat(np.arange(3, dtype=np.int32), [len(facets) for facets in outer])
    order = np.argsort(np.concatenate(outer))
    tags = mesh.meshtags(domain, 2, np.concatenate(outer)[order], marks[order])
    ds = ufl.Measure("ds", domain, subdomain_data=tags)
    contacts = []
    for k, normal in enumerate(np.eye(3)):
        F += pressures[k] * v[k] * ds(k)
        plane = dc.RigidPlane((0, 0, 0), normal, axis=np.eye(3)[k - 1])
        contacts.append(dc.Contact(V, face(k, 0.0), plane, dc.Friction(mu if k == 2 else 0.0)))
    return dc.ContactProblem(F, u, contacts), pressures


# %% [markdown]
# ## Result
#
# 1. Without friction the pressure at every node of every wall, edges and corner among them, is that of the face opposite, to $10^{-7}$.
# 2. With friction on the floor, forces balance to $10^{-7}$ in every step, while the pressure from one side rises and falls.
# 3. The floor carries part of the force, at most $\mu q_3 A_3$: on unloading the wall carries more than on loading.


# %%
def main():
    """Push; print and assert what is claimed above; pressure of the side and force of its wall, over P and P A."""
    problem, pressures = brick(0.0)
    for q, value in zip(pressures, (0.4, 0.7, 1.0)):
        q.value = value
    problem.solve()
    for contact, q in zip(problem.contacts, pressures):
        assert np.abs(contact.pressure - q.value).max(initial=0.0) < 1e-7
    say("no friction: the walls have the pressures 0.4, 0.7, 1.0 at all nodes")

    problem, pressures = brick(MU)
    pressures[1].value, pressures[2].value = 0.5 * PRESSURE, PRESSURE
    way = (0.4, 0.7, 1.0, 0.7, 0.4)
    table, work = [], 0.0
    for part in way:
        pressures[0].value = part * PRESSURE
        problem.solve()
        forces = np.array([contact.force() for contact in problem.contacts])
        applied = AREAS * [q.value for q in pressures]
        assert np.abs(forces.sum(axis=0) - applied).max() < 1e-7 * PRESSURE
        done = sum(COMM.allreduce(contact.dissipation.sum()) for contact in problem.contacts)
        assert done >= work
        work = done
        table.append([part, forces[0, 0] / (PRESSURE * AREAS[0])])
        assert abs(forces[2, 0]) <= (1 + 1e-7) * MU * PRESSURE * AREAS[2]
        say(f"q_1 = {part:4.2f} P: the wall carries {table[-1][1]:.4f} P A, friction {part - table[-1][1]:+.4f} P A")  # fmt: skip
    up, down = np.array(table)[:2, 1], np.array(table)[:2:-1, 1]
    assert (down > up).all()
    say(f"frictional work {work:.3e} N mm")
    picture_of_body(problem)
    return (np.array(table),)


def draw(figure, table) -> None:
    """Force of the wall over the pressure opposite to it."""
    axes = figure.subplots()
    axes.plot(table[:, 0], table[:, 0], "k--", label="without friction")
    axes.plot(table[:, 0], table[:, 1], "o-", color="#0072b2", label=rf"$\mu = {MU}$")
    axes.set(xlabel="pressure on the face opposite over P", ylabel="force of the wall over P A")
    axes.legend()


if __name__ == "__main__":
    picture(draw, *main())
