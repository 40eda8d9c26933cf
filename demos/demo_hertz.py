# %% [markdown]
# # Hertz: a ball on a plane
#
# A ball of radius $R$ is pressed on a rigid plane without friction. The closed form is that of an elastic half space, so the
# far boundary of the mesh needs the displacement of a half space. The demo measures two errors separately: that of the
# mesh, and that of the body's finite size.
#
# ## Notation
#
# Cylindrical coordinates $(r, z)$, $z$ up; displacement $u = (u_r, u_z)$; $E$, $\nu$ elastic constants,
# $E^* = E / (1 - \nu^2)$; $\delta$ approach of the far field to the plane, $a$ contact radius, $p$ pressure, $F$
# force. Units: mm, N, MPa.
#
# ## Strong form
#
# $$ -\operatorname{div} \sigma(u) = 0, \qquad
#    x_n = \frac{r^2}{2R} + u_z \ge 0, \quad p = -\sigma_{zz} \ge 0, \quad x_n\, p = 0, \quad \sigma_{rz} = 0
#    \quad \text{on the face}. $$
#
# The gap comes from the reference positions: the face of the mesh *is* the parabola $z = r^2 / 2R$, and `dc.Contact`
# measures its distance to the plane. The **closed form** [H. Hertz 1881; K. L. Johnson, Contact Mechanics, 1985,
# Section 4.2] is
#
# $$ a = \sqrt{R \delta}, \qquad F = \tfrac{4}{3} E^* \sqrt{R}\, \delta^{3/2}, \qquad
#    p(r) = p_0 \sqrt{1 - r^2/a^2}, \quad p_0 = \frac{2 E^* a}{\pi R}. $$
#
# It neglects $a/R$, which is $10^{-4}$ here.
#
# ## The far field
#
# At a distance $\rho \gg a$ the half space sees the contact as a point force, whose displacement is that of
# Boussinesq,
#
# $$ b_r = \frac{(1+\nu) F}{2 \pi E \rho} \left( \frac{r z}{\rho^2} - \frac{(1 - 2\nu)\, r}{\rho + z} \right), \qquad
#    b_z = \frac{(1+\nu) F}{2 \pi E \rho} \left( 2 (1 - \nu) + \frac{z^2}{\rho^2} \right). $$
#
# A body of size $L$ whose far boundary is *held rigidly*, $u = (0, -\delta)$, is therefore too stiff: the
# approach at its contact is too large by a value between $b_z(L, 0) = F / (\pi E^* L)$, the displacement beside the contact, and
# $b_z(0, L)$ above it, which is $\frac{3 - 2\nu}{2 - 2\nu}$ times as large. For the force of the closed form, the first value over
# $\delta$ is $c = \frac{4}{3\pi} \frac{a}{L}$. The force grows with the power 3/2 of the approach, so it is too large by a
# factor $1 + e$ with
#
# $$ (1 + e)^{2/3} = 1 + c\,(1 + e). $$
#
# At $L = 16 a$ the force is 4 to 7 % too large. Doubling $L$ halves this error; a finer mesh does not reduce it. If
# $u = (0, -\delta) + b$ is prescribed instead, the error left is that of the next moment of the pressure, of the order $(a/L)^3$.
#
# ## Weak form
#
# A form in two dimensions with the weight $2 \pi r$; the hoop strain is $u_r / r$:
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \; 2 \pi r \,\mathrm{d}r\,\mathrm{d}z
#    = \sum_{\text{contact nodes}} r_i \cdot v_i, $$
#
# so a nodal reaction is the force on a whole ring. On the axis $u_r = 0$: this support fixes the tangential
# displacement of a contact node.
#
# ## Code
#
# `far_field` gives the displacement of the far boundary as a function of the coordinates; `press` solves on one mesh. The
# pressure of a node is its force over the area of its ring, $\int 2 \pi r\, \varphi_i \,\mathrm{d}s$, which the contact
# computes with its `weight`. The radius is measured twice: by the position of the last node that touches, which is no more
# accurate than a cell is wide, and by the second moment of the reactions, which is $\frac{2}{5} a^2$ for the closed form.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import along_face, hooke, picture, rounded_body, say

E, NU = 210e3, 0.3
E_STAR = E / (1 - NU**2)
R, A = 1000.0, 0.1  # radius of the ball and of the contact
DELTA = A**2 / R
FORCE = 4 / 3 * E_STAR * np.sqrt(R) * DELTA**1.5
P0 = 2 * E_STAR * A / (np.pi * R)


def far_field(x, point_force: float):
    """Rigid approach and the displacement of a point force at the origin, ``shape=(2, points)``."""
    r, z = x[0], x[1]
    rho = np.hypot(r, z)
    rho[rho + z <= 0] = 1.0  # inside the contact, where the value is not used
    b = point_force * (1 + NU) / (2 * np.pi * E * rho)
    b_r = b * (r * z / rho**2 - (1 - 2 * NU) * r / (rho + z))
    return np.array([b_r, b * (2 * (1 - NU) + z**2 / rho**2) - DELTA])


def ball(domain, face, far, order: int = 1, point_force: float = FORCE) -> dc.ContactProblem:
    """The ball on the plane, in finite elements of an order."""
    V = functionspace(domain, ("Lagrange", order, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    r = ufl.SpatialCoordinate(domain)[0]

    def strain(w):
        rr, rz, zz = w[0].dx(0), (w[0].dx(1) + w[1].dx(0)) / 2, w[1].dx(1)
        return ufl.as_matrix([[rr, rz, 0], [rz, zz, 0], [0, 0, w[0] / r]])

    dx = ufl.dx(metadata={"quadrature_degree": 2 * order + 1})  # Gauss points, none on the axis
    F = 2 * np.pi * r * ufl.inner(hooke(strain(u), E, NU), strain(v)) * dx

    held = fem.Function(V)
    held.interpolate(lambda x: far_field(x, point_force))
    axis = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[0], 0.0))
    radial, zero = V.sub(0), fem.Constant(domain, 0.0)
    on_axis = fem.dirichletbc(zero, fem.locate_dofs_topological(radial, 1, axis), radial)
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 1, far)), on_axis]
    plane = dc.RigidPlane(point=(0, 0), normal=(0, 1))
    contact = dc.Contact(V, face, plane, dc.Friction(mu=0.0), weight=2 * np.pi * r)
    return dc.ContactProblem(F, u, [contact], bcs=bcs, tol=1e-10)


def press(cells: int, size: float, point_force: float) -> dict:
    """Press the ball on the plane; errors relative to the closed form."""
    problem = ball(*rounded_body(R, A, size, cells, half=True), point_force=point_force)
    problem.solve()
    return compare(problem.contacts[0])


def compare(contact: dc.Contact) -> dict:
    """Errors of force, pressure and radius; ``h`` is the width of a cell at the edge of contact.

    With them the pressure itself, over that in the middle, against r over a.
    """
    x, area, force = along_face(contact, contact.area, contact.reaction[:, 1])
    pressure, expected = force / area, P0 * np.sqrt(np.maximum(1 - (x / A) ** 2, 0))
    edge = np.searchsorted(x, A * (1 - 1e-9))
    return {
        "h": (x[edge] - x[edge - 1]) / A,
        "force": force.sum() / FORCE - 1,
        "pressure": np.sqrt(area @ (pressure - expected) ** 2 / (area @ expected**2)),
        "moment": np.sqrt(2.5 * (force @ x**2) / force.sum()) / A - 1,
        "edge": x[force > 0].max() / A - 1,
        "profile": (x / A, pressure / P0),
    }


# %% [markdown]
# ## Result
#
# **Convergence**, with $u = (0, -\delta) + b$ on the far boundary at $L = 16 a$, three meshes. Each has a node at
# $r = a$, so errors fall evenly; with the edge inside a cell they depend on its position there. The order is measured
# against the number of cells:
#
# - force, and radius by the second moment: second order, as usual for integrals;
# - pressure, in the mean square: first order, because the pressure ends like a square root, which the mesh replaces by a
#   polygon in the cell where it ends;
# - the last node that touches is less than one cell from the edge.
#
# **Finite size**, on one mesh, for three sizes: the excess of the force of a rigidly held body over that with $b$ lies between
# the two estimates.


# %%
def finiteness(size: float) -> list[float]:
    """Estimates, from below and from above, of the excess of force of a rigidly held body."""
    c = [factor * 4 / (3 * np.pi) * A / size for factor in (1.0, (3 - 2 * NU) / (2 - 2 * NU))]
    # with y = (1 + e)^(1/3) a cubic, of which the root between the other two is meant
    return [np.sort(np.roots([c, -1, 0, 1]))[1] ** 3 - 1 for c in c]


def main() -> list[dict]:
    """Solve, print and assert what is claimed above; the errors on the meshes."""
    meshes = [press(cells, 16 * A, FORCE) for cells in (16, 32, 64)]
    order = {
        name: [np.log2(abs(c[name] / f[name])) for c, f in zip(meshes, meshes[1:])]
        for name in ("force", "moment", "pressure")
    }
    for name, orders in order.items():
        errors = "  ".join(f"{found[name]:.5f}" for found in meshes)
        say(f"error of {name:9s} {errors}   orders " + "  ".join(f"{o:.2f}" for o in orders))
    assert all(1.8 < o < 2.5 for o in order["force"] + order["moment"])
    assert all(0.85 < o < 1.2 for o in order["pressure"])
    assert meshes[-1]["force"] < 1e-3 and meshes[-1]["moment"] < 1e-3
    assert all(abs(found["edge"]) < found["h"] for found in meshes)

    for size in (8 * A, 16 * A, 32 * A):
        excess = press(32, size, 0.0)["force"] - press(32, size, FORCE)["force"]
        low, high = finiteness(size)
        say(f"held rigidly at {size / A:.0f} a: force {100 * excess:.1f} % too large, "
            f"estimated {100 * low:.1f} to {100 * high:.1f} %")  # fmt: skip
        assert low < excess < high
    return meshes


def draw(figure, meshes) -> None:
    """Pressure of the nodes on the three meshes, and of the closed form."""
    axes, r = figure.subplots(), np.linspace(0, 1, 400)
    axes.plot(r, np.sqrt(1 - r**2), color="black", label="closed form")
    for found, marker in zip(meshes, "os."):
        axes.plot(*found["profile"], marker, label=f"cells of {found['h']:.3f} a at the edge")
    axes.set(xlabel="r / a", ylabel="pressure / p0", xlim=(0, 1.3))
    axes.legend()


if __name__ == "__main__":
    picture(draw, main())
