# %% [markdown]
# # Elliptic contact, and grooves
#
# A rigid body with two curvatures is pressed by its weight on an elastic block, then dragged over it. It is neither a ball
# nor a roller: `dc.RigidSurface` takes any surface as a function of position.
#
# ## Notation
#
# $(x, y, z)$, $z$ up, the block is below $z = 0$; $E^* = E / (1 - \nu^2)$; $R_1 > R_2$ radii of curvature along $x$ and $y$; $F$ weight,
# $\delta$ displacement downwards; $a > b$ semi-axes of the contact, $e = \sqrt{1 - b^2/a^2}$, $p_0$ largest pressure; $K(e)$, $E(e)$ complete
# elliptic integrals; $d$ unit vector along the slip of the block, $M$, $P$ diagonal matrices of the coefficients of friction and of
# the slip rule. Units: mm, N, MPa.
#
# ## Strong form
#
# $$ -\operatorname{div} \sigma(u) = 0, \qquad g \ge 0, \quad p \ge 0, \quad g\, p = 0 \quad \text{on the top}, \qquad
#    f(y) = \frac{y_1^2}{2 R_1} + \frac{y_2^2}{2 R_2} - y_3 , $$
#
# the gap $g$ being $f / |\nabla f|$ at $y = x + u$ relative to the surface, and $\int p = F$. The **closed form** [H. Hertz 1881; K. L. Johnson,
# Contact Mechanics, 1985, Section 4.2] is $p = p_0 \sqrt{1 - x^2/a^2 - y^2/b^2}$ with
#
# $$ \frac{1}{2 R_1} = \frac{p_0}{E^*} \frac{b}{e^2 a^2} [K - E], \quad
#    \frac{1}{2 R_2} = \frac{p_0}{E^*} \frac{b}{e^2 a^2} \left[\frac{a^2}{b^2} E - K\right], \quad
#    F = \tfrac{2}{3} \pi a b p_0, \quad \delta = \frac{p_0}{E^*} b K . $$
#
# Dragged in one direction, all nodes slip in that direction. For any distribution of pressure, the slip rule [dSFMH07, Section 1] gives the friction
#
# $$ T = -F \frac{P^2 d}{|M^{-1} P^2 d|} , $$
#
# which is not opposite to the motion: grooves guide.
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \sum_{\text{contact nodes}} r_i \cdot v_i . $$
#
# ## Code
#
# A quarter of the block, $9 a$ wide; its far boundary has the displacement of a half space under a point force, as in
# `demo_ball_on_flat.py`. The radii are those that belong to $a$, $b$ and $F$.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from dolfinx import fem, mesh
from helpers import (
    COMM,
    elastic,
    on_all_ranks,
    picture,
    point_force_field,
    quarter_block,
    quarter_supports,
    say,
)
from scipy.special import ellipe, ellipk

E, NU = 210e3, 0.3
E_STAR = E / (1 - NU**2)
A, B, P0 = 0.12, 0.06, 1500.0
FORCE = 2 / 3 * np.pi * A * B * P0
K_E, E_E = (integral(1 - (B / A) ** 2) for integral in (ellipk, ellipe))
UNIT = P0 / E_STAR * B / (A**2 - B**2)
R1, R2 = 1 / (2 * UNIT * (K_E - E_E)), 1 / (2 * UNIT * ((A / B) ** 2 * E_E - K_E))
DELTA = P0 / E_STAR * B * K_E
SIZE = 9 * A
MU, P = (0.3, 0.1), (0.2, 0.1)


def surface(turned: float = 0.0) -> dc.RigidSurface:
    """The body above the block; its grooves are along x, or turned about z by an angle."""
    along = (np.cos(turned), np.sin(turned), 0.0)
    return dc.RigidSurface(
        lambda y: y[0] ** 2 / (2 * R1) + y[1] ** 2 / (2 * R2) - y[2],
        gradient=lambda y: np.array([y[0] / R1, y[1] / R2, -np.ones_like(y[0])]),
        axis=along,
    )


def press(cells: int):
    """Let a quarter of the weight press the surface on a quarter of the block; the contact."""
    domain, top, *boundary = quarter_block(cells, SIZE, (3.0, 3.6, 3.2), (1.3 * A, 1.3 * B))
    V, u, F = elastic(domain, E, NU)
    bcs = quarter_supports(V, *boundary, lambda x: point_force_field(x, FORCE, E, NU))
    body = surface()
    contact = dc.Contact(V, top, body, dc.Friction(mu=0.0))
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs)
    body.free, body.force = ("z",), (0, 0, -FORCE / 4)
    problem.solve()
    return contact


def drag(angle: float, grooves: float):
    """Drag the surface under its weight over a coarse block, at an angle; force of the block on it over the weight."""
    half = 2 * A
    box = [[-half, -half, -half], [half, half, 0]]
    domain = mesh.create_box(COMM, box, [8, 12, 3], mesh.CellType.hexahedron)
    top, foot = (
        mesh.locate_entities_boundary(domain, 2, lambda x, z=z: np.isclose(x[2], z))
        for z in (0.0, -half)
    )
    V, u, F = elastic(domain, E, NU)
    bc = fem.dirichletbc(np.zeros(3), fem.locate_dofs_topological(V, 2, foot), V)
    body = surface(grooves)
    contact = dc.Contact(V, top, body, dc.Friction(mu=MU, p=P))
    problem = dc.ContactProblem(F, u, [contact], bcs=[bc])
    body.free, body.force = ("z",), (0, 0, -FORCE)
    for way in (0.0, 0.1 * A, 0.2 * A):
        along = way * np.array([np.cos(angle), np.sin(angle)])
        body.displacement = np.append(along, body.displacement[2])
        problem.solve()
    return contact.force()[:2] / FORCE


# %% [markdown]
# ## Result
#
# 1. The surface comes to rest at $\delta$, and its force is the weight.
# 2. Semi-axes from the second moments of the reactions, $\frac{1}{5} a^2$ and $\frac{1}{5} b^2$ in closed form, and the largest
#    pressure are right to 2 %.
# 3. Dragged at several angles to the grooves, $T$ is that of the slip rule to 2 % of the weight's friction.


# %%
def guided(angle: float, grooves: float) -> np.ndarray:
    """Force on the block over the weight, in closed form; it slips against the way."""
    c, s = np.cos(grooves), np.sin(grooves)
    turn = np.array([[c, s], [-s, c]])
    way = np.array(P) ** 2 * (turn @ [np.cos(angle), np.sin(angle)])
    return way / np.linalg.norm(way / MU) @ turn


def main(cells: int = 16):
    """Solve, print and assert what is claimed above; places and pressure of the nodes."""
    contact = press(cells)
    x, normal, pressure = on_all_ranks(contact.x, contact.reaction[:, 2], contact.pressure)
    sizes = [np.sqrt(5 * (normal @ x[:, k] ** 2) / normal.sum()) for k in range(2)]
    found = [
        sizes[0] / A,
        sizes[1] / B,
        pressure.max() / P0,
        -contact.surface.displacement[2] / DELTA,
    ]
    off = np.array(found) - 1
    say(f"off by {100 * off[0]:+.2f} % in a, {100 * off[1]:+.2f} % in b, {100 * off[2]:+.2f} % in p0, {100 * off[3]:+.2f} % "
        f"in the depth; weight off by {-4 * contact.force()[2] / FORCE - 1:.1e}")  # fmt: skip
    assert np.abs(off).max() < 0.02
    for angle, grooves in ((0.0, 0.5), (1.0, 0.5), (0.7, 0.0)):
        dragged, expected = drag(angle, grooves), guided(angle, grooves)
        say(
            f"dragged at {angle:.1f}, grooves at {grooves:.1f}: {dragged.round(4)}, closed form {expected.round(4)}"
        )
        assert np.abs(dragged - expected).max() < 0.02 * np.linalg.norm(expected)
    return x, pressure / P0


def draw(figure, x, pressure) -> None:
    """Pressure of the nodes and of the closed form, against the elliptic radius."""
    axes, line = figure.subplots(), np.linspace(0, 1, 400)
    axes.plot(line, np.sqrt(1 - line**2), color="black", label="Hertz")
    axes.plot(np.hypot(x[:, 0] / A, x[:, 1] / B), pressure, "o", color="#0072b2", label="nodes")
    axes.set(xlabel="root of (x/a)² + (y/b)²", ylabel="pressure / p0", xlim=(0, 1.3))
    axes.legend()


if __name__ == "__main__":
    picture(draw, *main())
