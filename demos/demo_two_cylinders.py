# %% [markdown]
# # Two elastic cylinders in partial slip
#
# A cylinder is pressed on a half plane of another material and moved sideways to and fro. Both bodies are elastic, and
# their meshes do not match.
#
# ## Notation
#
# Two dimensions, plane strain; bodies 1, above, and 2, below; $u$ displacement, $G_i$, $\nu_i$ elastic constants,
# $1/E^* = \sum_i (1 - \nu_i) / 2 G_i$, $R$ radius of the cylinder; per length, $P$ normal and $Q$ tangential force;
# $\mu$ friction; the contact is $|x| < a$, its sticking part $|x| < c$; $p$ pressure, $q$ tangential traction. Units:
# mm, N, MPa.
#
# ## Strong form and closed form
#
# $$ -\operatorname{div} \sigma(u) = 0 \ \text{in both}, \qquad x_n \ge 0, \quad p \ge 0, \quad x_n\, p = 0,
#    \quad |q| \le \mu p, $$
#
# with $|q| = \mu p$ against the slip where there is any; gap $x_n = x^2/2R + u_{n1} - u_{n2}$. For half planes
# [H. Hertz 1881; C. Cattaneo 1938; R. D. Mindlin 1949; K. L. Johnson, Contact Mechanics, 1985, Sections 4.2, 7.2]
#
# $$ a^2 = \frac{4 P R}{\pi E^*}, \qquad p = p_0 \sqrt{1 - x^2/a^2}, \quad p_0 = \frac{2P}{\pi a}, \qquad
#    q = \mu p - \mu p_0 \tfrac{c}{a} \sqrt{1 - x^2/c^2}, \quad \frac{c}{a} = \sqrt{1 - \frac{Q}{\mu P}}. $$
#
# Slip is $s(x) = \frac{\mu}{R} \int_c^x \sqrt{t^2 - c^2} \, \mathrm{d}t$ at first, and twice as much on every stroke
# from $Q$ to $-Q$ or back, against the traction $\mu p$. A cycle dissipates
#
# $$ W = 8 \mu \int_c^a p\, s \,\mathrm{d}x. $$
#
# **What it assumes.** Pressure must not shear the interface: Dundurs' $\beta$ is zero, $(1 - 2\nu_1) / G_1 =
# (1 - 2 \nu_2) / G_2$. Here $G_2 = 2 G_1$, $\nu_1 = 0.35$ and $\nu_2 = 0.2$.
#
# ## Weak form
#
# $$ \int_{\Omega_1 \cup \Omega_2} \sigma(u) : \varepsilon(v) \,\mathrm{d}x
#    = \sum_a r_a \cdot \left( v_a - \sum_b m_{ab} v_b \right), $$
#
# over nodes $a$ of the one side, each against a mean of nodes $b$ of the other one.
#
# ## Code
#
# Both bodies are parts of one mesh: a rectangle without its middle row of cells, whose halves are graded towards the
# contact in different ways. Either face may be the slave, which carries the unknowns.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace, second_order

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, along_face, hooke, picture, say

SHEAR, NU, MU = (400.0, 800.0), (0.35, 0.2), 0.4
E_STAR = 1 / sum((1 - nu) / (2 * shear) for shear, nu in zip(SHEAR, NU))
R, A = 1000.0, 0.1  # radius; half width for which the mesh is made
L = 24 * A  # half width of the bodies, and their height


def bodies(cells: int, order: int = 1):
    """A mesh of two bodies with ``2 cells`` by ``cells`` quadrilaterals each, of an order, half of them within A.

    Returns:
        The mesh; facets of the upper and lower face near the contact, and of both far boundaries.
    """
    whole = mesh.create_rectangle(
        COMM, [np.array([-1.0, -1.0]), np.ones(2)], [2 * cells, 2 * cells + 1], mesh.CellType.quadrilateral
    )  # fmt: skip
    middle = 1 / (2 * cells + 1)
    halves = [mesh.locate_entities(whole, 2, lambda x, k=k: k * x[1] > 0.5 * middle) for k in (1, -1)]  # fmt: skip
    domain = mesh.create_submesh(whole, 2, np.sort(np.concatenate(halves)))[0]
    domain = second_order(domain) if order == 2 else domain
    x = domain.geometry.x
    above = x[:, 1] > 0

    def face(side, width):
        def near(x):
            return np.isclose(x[1], side * middle) & (np.abs(x[0]) < width)

        return mesh.locate_entities_boundary(domain, 1, near)

    def far(side):
        def is_far(x):
            return (np.isclose(np.abs(x[0]), 1) | np.isclose(x[1], side)) & (side * x[1] > 0)

        return mesh.locate_entities_boundary(domain, 1, is_far)

    grading = 2 * np.arccosh(L / (2 * A))
    facets = face(1, 0.65), face(-1, 0.7), far(1), far(-1)
    x[:, 1] -= np.where(above, middle, -middle)
    x[:, 1] /= 1 - middle
    steep = np.where(above, grading, 0.94 * grading)[:, None]
    x[:, :2] = L * np.sinh(steep * x[:, :2]) / np.sinh(steep)
    x[:, 1] += above * (1 - x[:, 1] / L) * x[:, 0] ** 2 / (2 * R)
    return domain, above, *facets


def problem_of(cells: int, swapped: bool = False, shear=SHEAR, nu=NU, order: int = 1, **options):
    """The problem, and the displacement of the upper body's far boundary."""
    domain, _, upper, lower, top, bottom = bodies(cells, order)
    V = functionspace(domain, ("Lagrange", order, (2,)))
    u, v, DG = fem.Function(V), ufl.TestFunction(V), functionspace(domain, ("DG", 0))
    G, ratio = fem.Function(DG), fem.Function(DG)
    for of, values in ((G, shear), (ratio, nu)):
        of.interpolate(lambda x, values=values: np.where(x[1] > 0, *values))
    strain = ufl.sym(ufl.grad(u))
    F = ufl.inner(hooke(strain, 2 * G * (1 + ratio), ratio), ufl.sym(ufl.grad(v))) * ufl.dx
    held, ends = fem.Constant(domain, np.zeros(2)), []
    for value, facets in ((held, top), (np.zeros(2), bottom)):
        ends.append(fem.dirichletbc(value, fem.locate_dofs_topological(V, 1, facets), V))
    slave, master = (lower, upper) if swapped else (upper, lower)
    contact = dc.Contact(V, slave, dc.DeformableSurface(V, master), dc.Friction(MU))
    return dc.ContactProblem(F, u, [contact], bcs=ends, **options), held


def observe(contact: dc.Contact) -> dict:
    """Forces, and tractions along the face; those on the upper body."""
    forces = np.einsum("ni,nij->nj", contact.reaction, contact.frame)
    x, forces, area = along_face(contact, forces, contact.area)
    Q, P = forces.sum(axis=0)
    q, p = np.divide(forces, area[:, None], np.zeros_like(forces), where=area[:, None] > 0).T
    side = np.sign(P)
    return dict(x=x, area=area, P=side * P, Q=side * Q, p=side * p, q=side * q)


def half_width(P: float) -> float:
    return np.sqrt(4 * P * R / (np.pi * E_STAR))


def closed_shear(x, P: float, Q: float):
    """Traction of a first loading to Q, which is negative if the body goes to the right."""
    a = half_width(P)
    c, top = a * np.sqrt(1 - abs(Q) / (MU * P)), MU * 2 * P / (np.pi * a)
    outer, inner = (np.sqrt(np.maximum(1 - (x / w) ** 2, 0)) for w in (a, c))
    return np.sign(Q) * top * (outer - c / a * inner)


def closed_work(P: float, Q: float) -> float:
    """Of friction in a cycle from Q to -Q and back."""
    a = half_width(P)
    c = a * np.sqrt(1 - abs(Q) / (MU * P))
    x = a - (a - c) * np.linspace(0, 1, 4001)[::-1] ** 2  # the root of p at a
    slip = MU / (2 * R) * (x * np.sqrt(x**2 - c**2) - c**2 * np.arccosh(np.maximum(x / c, 1)))
    density = 2 * P / (np.pi * a) * np.sqrt(np.maximum(1 - (x / a) ** 2, 0)) * slip
    return 8 * MU * float(np.sum((density[1:] + density[:-1]) / 2 * np.diff(x)))


# %% [markdown]
# ## Result
#
# 1. The largest pressure is $p_0$ to 1 %. With the other side as slave, forces and the largest pressure differ
#    by less than 0.5 %.
# 2. Shear tractions are those of the closed form to 4 % in $L_2$.
# 3. A cycle dissipates what the closed form says to 2 %.
# 4. Where everything slides, friction is $\mu P$ to rounding.


# %%
def cycle(cells: int, swapped: bool) -> dict:
    """Press, shear, go through a cycle, slide; print and assert what is claimed of each side."""
    say(f"the {'lower' if swapped else 'upper'} face is the slave:")
    problem, held = problem_of(cells, swapped)
    contact, stroke = problem.contacts[0], A**2 / (2 * R)
    held.value[:] = 0.0, -3.4 * stroke
    problem.solve()
    pressed = observe(contact)
    peak = 2 * pressed["P"] / (np.pi * half_width(pressed["P"]))
    say(f"a {half_width(pressed['P']):.4f} mm, largest pressure {pressed['p'].max() / peak:.4f} p0")

    ways = np.linspace(0, 1.1, 5)[1:] * stroke
    for way in ways:
        held.value[0] = way
        problem.solve()
    now = observe(contact)
    closed = closed_shear(now["x"], now["P"], now["Q"])
    off = (now["q"] - closed) ** 2 @ now["area"] / (closed**2 @ now["area"])
    say(f"Q / (mu P) {abs(now['Q']) / (MU * now['P']):.3f}, shear off by {np.sqrt(off):.3f} in L2")

    steps = np.linspace(1, -1, 9)[1:]
    for factor in (*steps, *-steps):
        held.value[0] = factor * ways[-1]
        problem.solve()
        if factor == steps[-1]:
            turned = COMM.allreduce(contact.dissipation.sum())
    again = COMM.allreduce(contact.dissipation.sum()) - turned
    work = 2 * again / closed_work(now["P"], now["Q"])
    say(f"a cycle dissipates {work:.4f} of the closed form")

    held.value[0] = 6 * stroke
    slid = problem.solve()
    sizes = [COMM.allreduce(np.abs(r).sum()) for r in contact.reaction.T]
    say(f"slides: friction / (mu P) - 1 = {sizes[0] / (MU * sizes[1]) - 1:.0e}")
    assert abs(pressed["p"].max() / peak - 1) < 0.01
    assert np.sqrt(off) < 0.04 and abs(work - 1) < 0.02
    assert slid.counts.stick == 0 and abs(sizes[0] / (MU * sizes[1]) - 1) < 1e-12
    return {**now, "peak": pressed["p"].max()}


def main(cells: int = 40) -> dict:
    """Either face as the slave, and both answers beside each other; the state after shear."""
    found, other = (cycle(cells, swapped) for swapped in (False, True))
    for name in ("P", "Q", "peak"):
        say(f"{name} of both differ by {abs(other[name] / found[name] - 1):.1e}")
        assert abs(other[name] / found[name] - 1) < 5e-3
    return found


def draw(figure, found) -> None:
    """Shear tractions, computed and of the closed form."""
    axes, a = figure.subplots(), half_width(found["P"])
    x = a * np.linspace(-1.3, 1.3, 1001)
    closed = np.abs(closed_shear(x, found["P"], found["Q"]))
    axes.plot(x / a, closed, color="#0072b2", label="closed form")
    axes.plot(found["x"] / a, np.abs(found["q"]), ".", color="#d55e00", label="nodes")
    axes.set(xlabel="x / a", ylabel="q, MPa", xlim=(-1.3, 1.3))
    axes.legend()


if __name__ == "__main__":
    picture(draw, main())
