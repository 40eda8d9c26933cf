# %% [markdown]
# # An elastic pin in a hole that it nearly fits
#
# A pin is pulled sideways in the hole of a plate of the same material. The contact grows from a line to nearly half of the hole: Hertz's theory holds
# at small loads only.
#
# ## Notation
#
# Two dimensions, plane strain; $u$ displacement, $E' = E / (1 - \nu^2)$ of both bodies, $R$ radius of the hole, $\Delta R$ how much smaller that of the
# pin is; $P$ force per length; the contact is $|\theta| < \epsilon$, $b = \tan(\epsilon / 2)$; $p$ pressure, gap $x_n$.
# Everything in units of $R$ and $E$.
#
# ## Strong form and closed form
#
# $$ -\operatorname{div} \sigma(u) = 0 \ \text{in both}, \qquad x_n \ge 0, \quad p \ge 0, \quad x_n\, p = 0, $$
#
# without friction; the force acts at the middle of the pin, the plate is infinite. For one material [A. Persson, On the Stress Distribution of Cylindrical Elastic
# Bodies in Contact, Gothenburg 1964; M. Ciavarella, P. Decuzzi, Int. J. Solids Struct. 38 (2001) 4507]
#
# $$ \frac{E' \Delta R}{P} = \frac{2 - \ln (1 + b^2) - 2 b^4}{\pi\, b^2 (1 + b^2)}, $$
#
# which is Hertz's line contact, $8 / (\pi \epsilon^2)$, for small angles, and ends at an angle that no load exceeds.
#
# **What differs here.** The plate is held at $20 R$; the pin is moved by a core of radius $R / 10$.
#
# ## Weak form
#
# $$ \int \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \sum_a r_a \cdot \Big( v_a - \sum_b m_{ab} v_b \Big) . $$
#
# ## Code
#
# Half of both bodies: a rectangle of angles and radii without its middle row of cells, whose halves become pin and plate. Nodes of the plate are
# at other angles than those of the pin.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, hooke, on_all_ranks, picture, say

E, NU, CLEARANCE = 1.0, 0.3, 2e-3
CORE, OUTER = 0.1, 20.0  # radii


def half(cells: int):
    """The mesh, ``cells`` along half of the hole; facets of pin, hole, core, outer boundary and of the axis of symmetry."""
    rows = cells // 4
    whole = mesh.create_rectangle(
        COMM, [np.array([0.0, -1.0]), np.ones(2)], [cells, 2 * rows + 1], mesh.CellType.quadrilateral
    )  # fmt: skip
    middle = 1 / (2 * rows + 1)
    sides = [mesh.locate_entities(whole, 2, lambda x, k=k: k * x[1] > 0.5 * middle) for k in (1, -1)]  # fmt: skip
    domain = mesh.create_submesh(whole, 2, np.sort(np.concatenate(sides)))[0]
    x = domain.geometry.x
    places = [lambda x, at=at: np.isclose(x[1], at) for at in (-middle, middle, -1.0, 1.0)]
    places.append(lambda x: np.isclose(x[0] * (1 - x[0]), 0.0))
    facets = [mesh.locate_entities_boundary(domain, 1, place) for place in places]
    plate = x[:, 1] > 0
    part = (np.abs(x[:, 1]) - middle) / (1 - middle)  # from the contact to the far end
    angle = np.pi * x[:, 0] + np.where(plate, 0.1 * np.sin(2 * np.pi * x[:, 0]), 0.0)
    radius = np.where(plate, OUTER**part, (1 - CLEARANCE) * (CORE / (1 - CLEARANCE)) ** part)
    x[:, 0], x[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    return domain, *facets


def problem_of(cells: int):
    """The problem, its contact, and the way of the core along x."""
    domain, pin, hole, core, outer, axis = half(cells)
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    way = fem.Constant(domain, np.zeros(2))
    bcs = [
        fem.dirichletbc(value, fem.locate_dofs_topological(V, 1, facets), V)
        for value, facets in ((way, core), (np.zeros(2), outer))
    ]
    bcs.append(fem.dirichletbc(0.0, fem.locate_dofs_topological(V.sub(1), 1, axis), V.sub(1)))
    F = ufl.inner(hooke(ufl.sym(ufl.grad(u)), E, NU), ufl.grad(v)) * ufl.dx
    contact = dc.Contact(V, pin, dc.DeformableSurface(V, hole), dc.Friction(0.0))
    return dc.ContactProblem(F, u, [contact], bcs=bcs), contact, way


def closed_load(angle):
    """``P / (E' dR)`` of a contact half angle."""
    b2 = np.tan(angle / 2) ** 2
    return np.pi * b2 * (1 + b2) / (2 - np.log(1 + b2) - 2 * b2**2)


# %% [markdown]
# ## Result
#
# The contact ends at the angle of the closed form, to within two elements, at loads that differ by a factor of a hundred.


# %%
def main(cells: int = 160) -> tuple:
    """Loads over ``E' dR``, and contact half angles; those of both ends of the facet in which the contact ends."""
    problem, contact, way = problem_of(cells)
    loads, ends = [], []
    for ratio in (1.2, 1.6, 2.5, 5.0, 20.0):
        way.value[0] = ratio * CLEARANCE
        problem.solve()
        load = 2 * contact.force()[0] / (-E / (1 - NU**2) * CLEARANCE)
        x, p = on_all_ranks(contact.x, contact.pressure)
        angle = np.arctan2(x[:, 1], x[:, 0])
        last = angle[p > 0].max()
        fits = np.linspace(0.01, 1.47, 20001)
        closed = np.interp(load, closed_load(fits), fits)
        say(
            f"P / (E' dR) {load:7.3f}: contact to {np.degrees(last):.1f} degrees, closed form {np.degrees(closed):.1f}"
        )
        loads.append(load)
        ends.append(last + np.pi / cells * np.array([0.0, 1.0]))
        assert last - np.pi / cells < closed < last + 2 * np.pi / cells
    assert loads[-1] > 50 * loads[0] > 0
    return np.array(loads), np.array(ends)


def draw(figure, loads, ends) -> None:
    """Contact half angle against load."""
    axes, angle = figure.subplots(), np.linspace(0.05, 1.47, 400)
    axes.plot(closed_load(angle), np.degrees(angle), color="black", label="closed form")
    hertz = np.geomspace(0.02, 2, 100)
    axes.plot(hertz, np.degrees(np.sqrt(8 / np.pi * hertz)), "--", color="gray", label="Hertz")
    axes.plot(loads, np.degrees(ends.mean(axis=1)), "o", color="#0072b2", label="pin")
    axes.set(
        xscale="log",
        xlabel="P / (E' dR)",
        ylabel="contact half angle, degrees",
        xlim=(0.02, 100),
        ylim=(0, 95),
    )
    axes.legend()


if __name__ == "__main__":
    picture(draw, *main())
