# %% [markdown]
# # Partial slip: the problem of Cattaneo and Mindlin
#
# A cylinder is pressed on a plane, then the plane is pushed sideways. Before it slides as a whole,
# the contact sticks in the middle and slips at both edges.
#
# ## Notation
#
# Two dimensions, plane strain; $u$ displacement, $E$, $\nu$ elastic constants, $E^* = E / (1 -
# \nu^2)$, $R$ radius of the cylinder; per length of the cylinder, $P$ normal and $Q$ tangential
# force; $\mu$ friction; the contact is $|x| < a$, its sticking part $|x| < c$; $p$ pressure, $q$
# tangential traction. Units: mm, N, MPa.
#
# ## Strong form and closed form
#
# $$ -\operatorname{div} \sigma(u) = 0, \qquad x_n \ge 0, \quad p \ge 0, \quad x_n\, p = 0, \quad |q| \le \mu p, $$
#
# with $|q| = \mu p$ against the slip where there is any; gap $x_n = x^2/2R + u_n$. For a half
# plane [C. Cattaneo 1938; R. D. Mindlin 1949; K. L. Johnson, Contact Mechanics, 1985, Section 7.2]
#
# $$ a^2 = \frac{4 P R}{\pi E^*}, \qquad p = p_0 \sqrt{1 - x^2/a^2}, \qquad
#    \frac{c}{a} = \sqrt{1 - \frac{Q}{\mu P}}, $$
#
# and $q$ is $\mu p$ minus the like distribution over $|x| < c$. When $Q$ falls again from $Q_1$,
# slip starts anew from the edges, against the former, and the sticking part is $c'/a = \sqrt{1 -
# (Q_1 - Q) / 2 \mu P}$.
#
# **What it assumes.** Tangential tractions must not change the pressure, nor pressure move the
# surface sideways. On a rigid plane this is true for $\nu = 1/2$ only: the coupling is Dundurs'
# $\beta = (1 - 2\nu) / (2 - 2\nu)$. Here $\nu = 0.499$ and $\beta = 0.002$, and elements must not
# lock: first-order triangles do not, if they are the four into which the diagonals cut a
# quadrilateral. A body of finite size differs from the half plane by the order of $(a/L)^2$, which
# is 0.4 %, if $P$, $Q$ and not the displacements are compared.
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \sum_{\text{contact nodes}} r \cdot v. $$

# %%
from __future__ import annotations

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact._dolfinx import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from rounded_body import along_face, rounded_body

COMM = MPI.COMM_WORLD
E, NU, MU = 1000.0, 0.499, 0.3
E_STAR = E / (1 - NU**2)
R, A = 1000.0, 0.1  # radius; half width for which the mesh is made
L = 16 * A


# %% [markdown]
# ## Code


# %%
def cylinder(E: float, nu: float, wear=None, cells: int = 32):
    """Body, plane and friction; the far boundary is held, its displacement is the second result."""
    domain, face, far = rounded_body(COMM, R, A, L, cells, crossed=True)
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    strain = ufl.sym(ufl.grad(u))
    lame, shear = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    stress = lame * ufl.tr(strain) * ufl.Identity(2) + 2 * shear * strain
    F = ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx
    held = fem.Constant(domain, np.zeros(2))
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 1, far), V)]
    plane = dc.RigidPlane(point=(0, 0), normal=(0, 1))
    contact = dc.Contact(V, face, plane, dc.Friction(mu=MU), wear=wear)
    return dc.ContactProblem(F, u, [contact], bcs=bcs, tol=1e-10), held


# %% [markdown]
# The sticking part is measured twice. By the status of the nodes it is known to the width of a
# cell, here $a/11$ in the middle and $a/7$ near the edge. By second moments it is known better:
# for the closed form $\int q x^2 = \mu\, (1 - c^4/a^4) \int p x^2$. A change of $q$ by slip that
# has turned round is twice as much.


# %%
def observe(contact: dc.Contact) -> dict:
    """Forces, second moments, and the node positions by status."""
    x, r, status = along_face(contact, contact.reaction, contact.status)
    return {
        "x": x,
        "P": r[:, 1].sum(),
        "Q": r[:, 0].sum(),
        "moment_p": r[:, 1] @ x**2,
        "moment_q": r[:, 0] @ x**2,
        "spread_q": np.abs(r[:, 0]).sum(),
        "stick": x[status == dc.Status.STICK],
    }


def sticking_part(now: dict, before: dict, times: int) -> tuple[float, float]:
    """c over a: of the closed form for the measured forces, and by second moments."""
    limit = times * MU * now["P"]
    moment = abs(now["moment_q"] - before["moment_q"]) / (times * MU * now["moment_p"])
    closed = np.sqrt(1 - abs(now["Q"] - before["Q"]) / limit)
    return closed, max(1 - moment, 0) ** 0.25


# %% [markdown]
# ## Result
#
# 1. Pressing alone makes next to no tangential force: the sum of all $|q|$ is below a tenth of
#    $\mu P$, what there is alternates from node to node and is the mesh's. The half width by the
#    second moment of the pressure, $a^2/4$, is that of the closed form to 1 %.
# 2. Shearing does not change $P$ by more than 0.1 %: the two directions are not coupled.
# 3. For three displacements of the plane, and on the way back, the sticking part by second moments
#    is that of the closed form to $0.005\, a$, and by the nodes' status to the width of a cell.


# %%
def main() -> None:
    """Press, shear, and shear back; print and assert what is claimed above."""
    problem, held = cylinder(E, NU)
    contact = problem.contacts[0]
    stroke = A**2 / (2 * R)
    held.value[:] = 0.0, -3.0 * stroke
    problem.solve()
    pressed = observe(contact)
    a = np.sqrt(4 * pressed["P"] * R / (np.pi * E_STAR))
    measured = np.sqrt(4 * pressed["moment_p"] / pressed["P"])
    if COMM.rank == 0:
        print(f"a {a:.4f} mm, by the second moment {measured:.4f} mm")
    assert pressed["spread_q"] < 0.1 * MU * pressed["P"]
    assert abs(measured / a - 1) < 0.01

    inside = pressed["x"][np.abs(pressed["x"]) < a]
    h = np.diff(inside).max()
    before = pressed
    for times, displacements in ((1, (0.3, 0.6, 0.9)), (2, (0.6, 0.3))):
        for displacement in displacements:
            contact.plane.displacement = np.array([displacement * stroke, 0.0])
            problem.solve()
            now = observe(contact)
            closed, moments = sticking_part(now, before, times)
            stick = np.abs(now["stick"])
            must_stick = np.count_nonzero(np.abs(inside) < closed * a - h)
            if COMM.rank == 0:
                print(f"Q/(mu P) {now['Q'] / (MU * now['P']):.3f}: c/a closed form", end=" ")
                print(f"{closed:.3f}, moments {moments:.3f}, last node {stick.max() / a:.3f}")
            assert abs(now["P"] / pressed["P"] - 1) < 1e-3
            assert abs(moments - closed) < 0.005
            assert stick.max() < closed * a + h
            assert np.count_nonzero(stick < closed * a - h) == must_stick
        before = now  # here the plane turns round


if __name__ == "__main__":
    main()
