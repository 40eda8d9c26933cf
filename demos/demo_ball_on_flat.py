# %% [markdown]
# # A rigid ball on an elastic flat
#
# The other half of `demo_hertz.py`: there the body is round and the counterface flat, here a rigid sphere is pressed on
# a block in three dimensions. `dc.RigidSphere` replaces `dc.RigidPlane`.
#
# ## Notation
#
# $(x, y, z)$, $z$ up, the block is below $z = 0$; $u$ displacement, $E$, $\nu$ elastic constants, $E^* = E / (1 - \nu^2)$;
# $c$, $R$ centre and radius of the sphere, $\delta$ its displacement downwards; $a$ contact radius, $p$ pressure, $F$ force, $r = \sqrt{x^2 +
# y^2}$. Units: mm, N, MPa.
#
# ## Strong form
#
# $$ -\operatorname{div} \sigma(u) = 0, \qquad
#    g = |x + u - c| - R \ge 0, \quad p \ge 0, \quad g\, p = 0 \quad \text{on the top}, $$
#
# without friction. The gap is measured to the tangent plane of the sphere below each node, `docs/surfaces.md`.
# The **closed form** [H. Hertz 1881; K. L. Johnson, Contact Mechanics, 1985, Section 4.2] is
#
# $$ a = \sqrt{R \delta}, \qquad F = \tfrac{4}{3} E^* \sqrt{R}\, \delta^{3/2}, \qquad
#    p(r) = p_0 \sqrt{1 - r^2/a^2}, \quad p_0 = \frac{2 E^* a}{\pi R}. $$
#
# It replaces the sphere by a paraboloid, which neglects $(a/R)^2$, here $10^{-4}$. The block ends at $L = 8 a$. There it is given the
# displacement of a half space under a point force $F$ [J. Boussinesq 1885], as `demo_hertz.py` explains; the remaining error is of
# the order $(a/L)^3$.
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \sum_{\text{contact nodes}} r_i \cdot v_i . $$
#
# ## Code
#
# A quarter of the block, its cells fine at the contact (`quarter_block` in `helpers.py`). On the two planes of symmetry the normal displacement is zero.
# These supports fix a tangential direction of contact nodes, which is along `axis` or across it.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from helpers import (
    elastic,
    on_all_ranks,
    picture,
    point_force_field,
    quarter_block,
    quarter_supports,
    say,
)

E, NU = 210e3, 0.3
E_STAR = E / (1 - NU**2)
R, A = 10.0, 0.1  # radius of the sphere and of the contact
SIZE = 8 * A
DELTA = A**2 / R
FORCE = 4 / 3 * E_STAR * np.sqrt(R) * DELTA**1.5
P0 = 2 * E_STAR * A / (np.pi * R)


def scene(cells: int):
    """The mesh of a quarter and its facets, see ``quarter_block``."""
    return quarter_block(cells, SIZE, (2.2, 2.2, 2.2), (1.5 * A, 1.5 * A))


def ball_on_flat(domain, top, *boundary, order: int = 1):
    """The problem and its contact, for displacements of an order."""
    V, u, F = elastic(domain, E, NU, order)
    bcs = quarter_supports(V, *boundary, lambda x: point_force_field(x, FORCE, E, NU))
    ball = dc.RigidSphere(centre=(0, 0, R), radius=R, axis=(1, 0, 0))
    contact = dc.Contact(V, top, ball, dc.Friction(mu=0.0))
    return dc.ContactProblem(F, u, [contact], bcs=bcs), contact


def press(cells: int):
    """Press the ball on the block, then leave it to the weight F; the contact after both."""
    problem, contact = ball_on_flat(*scene(cells))
    ball = contact.surface
    ball.displacement = (0, 0, -DELTA)
    problem.solve()
    yield contact
    ball.free, ball.force = ("z",), (0, 0, -FORCE / 4)
    problem.solve()
    yield contact


# %% [markdown]
# ## Result
#
# 1. The force on the quarter of the block is a quarter of Hertz's force, to 1 %.
# 2. The radius, from the second moment of the reactions, which is $\frac{2}{5} a^2$ in closed form, is right to 1 %.
# 3. The largest pressure is right to 1 %. The root mean square error of the pressure at nodes in contact is below 5 % of it,
#    most of it in the cells at the edge.
# 4. The reaction of every node is along the normal of the sphere there: the force along $x$ on the quarter is
#    $\sum r_n x / R$, to $(a/R)^2$.
# 5. With `ball.free = ("z",)` the ball sinks under its weight $F$: the force is $F$, and the depth is $\delta$ to 1 %.


# %%
def main(cells: int = 20):
    """Solve, print and assert what is claimed above; radius and pressure of the nodes."""
    states = press(cells)
    contact = next(states)
    force = contact.force()
    x, normal, pressure = on_all_ranks(contact.x, contact.reaction[:, 2], contact.pressure)
    r = np.hypot(x[:, 0], x[:, 1])
    off = -4 * force[2] / FORCE - 1
    radius = np.sqrt(2.5 * (normal @ r**2) / normal.sum()) / A - 1
    expected = P0 * np.sqrt(np.maximum(1 - (r / A) ** 2, 0))
    peak = pressure.max() / P0 - 1
    within = np.sqrt(((pressure - expected) ** 2)[r < A].mean()) / P0
    say(f"force {-4 * force[2]:.3f} N, by Hertz {FORCE:.3f} ({100 * off:+.2f} %); radius {100 * radius:+.2f} %; "
        f"largest pressure {100 * peak:+.2f} %, root mean square error of all {100 * within:.2f} % of it")  # fmt: skip
    assert abs(off) < 0.01 and abs(radius) < 0.01
    assert abs(peak) < 0.01 and within < 0.05
    assert np.allclose(force[:2], normal @ x[:, :2] / R, rtol=1e-3)
    next(states)
    weighed, way = -4 * contact.force()[2] / FORCE - 1, -contact.surface.displacement[2] / DELTA - 1
    say(f"under its weight: error of the force {weighed:+.1e}, of the depth {100 * way:+.2f} %")
    assert abs(weighed) < 1e-8 and abs(way) < 0.01
    return r / A, pressure / P0


def draw(figure, r, pressure) -> None:
    """Pressure of the nodes and of the closed form."""
    axes, line = figure.subplots(), np.linspace(0, 1, 400)
    axes.plot(line, np.sqrt(1 - line**2), color="black", label="Hertz")
    axes.plot(r, pressure, "o", color="#0072b2", label="nodes")
    axes.set(xlabel="r / a", ylabel="pressure / p0")
    axes.legend()


if __name__ == "__main__":
    picture(draw, *main())
