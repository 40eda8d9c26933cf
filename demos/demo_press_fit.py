# %% [markdown]
# # Press fit: a shaft in a hub, both elastic
#
# A steel shaft that is too thick for its aluminium hub is fitted into it, and pushed through it until it slides. The bodies are of revolution
# and need not
# match: half a section of both is meshed.
#
# ## Notation
#
# $r, z$ coordinates, $u$ displacement; shaft 1 of radius $R + \delta$, hub 2 from $R$ to $R_2$, both of length $L$; $E_i$, $\nu_i$ elastic
# constants; $p$ pressure,
# $F$ force along the axis; $\mu$ friction. Units: mm, N, MPa.
#
# ## Strong form and closed form
#
# $$ -\operatorname{div} \sigma(u) = 0 \ \text{in both}, \qquad x_n \ge 0, \quad p \ge 0, \quad x_n\, p = 0, \quad |q| \le \mu p . $$
#
# Without friction the ends are free of stress, and the pressure is uniform [G. Lamé 1852]:
#
# $$ p = \frac{\delta}{R} \left[ \frac{1}{E_2} \left( \frac{R_2^2 + R^2}{R_2^2 - R^2} + \nu_2 \right) + \frac{1 - \nu_1}{E_1} \right]^{-1},
#    \qquad F = 2 \pi R L\, \mu\, p , $$
#
# with the force $F$ at which the shaft slides, if friction changes $p$ little.
#
# ## Weak form
#
# $$ \int \big( \sigma : \varepsilon(v) + \sigma_{\theta\theta}\, v_r / r \big)\, 2 \pi r \,\mathrm{d}r\, \mathrm{d}z
#    = \sum_a r_a \cdot \Big( v_a - \sum_b m_{ab} v_b \Big) . $$
#
# ## Code
#
# The contact has the surface measure of the forms: `weight`. As meshed, the two bodies overlap by the interference; the first
# step removes the overlap, without friction, which would resist the change of length of the bodies in this step.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace, model_to_mesh

# isort: split
import gmsh
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, on_all_ranks, picture, say

R, OUTER, L, DELTA, MU = 10.0, 20.0, 15.0, 0.01, 0.15
E, NU = (210e3, 70e3), (0.3, 0.33)  # of shaft and hub
LAME = DELTA / R / (((OUTER**2 + R**2) / (OUTER**2 - R**2) + NU[1]) / E[1] + (1 - NU[0]) / E[0])


def section(cells: int):
    """The mesh of triangles, ``cells`` along the shaft, fewer along the hub.

    Returns:
        The mesh; facets of shaft, bore, axis, lower end of the hub, upper end of the shaft.
    """
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    if COMM.rank == 0:
        shaft = gmsh.model.occ.addRectangle(0, 0, 0, R + DELTA, L)
        hub = gmsh.model.occ.addRectangle(R, 0, 0, OUTER - R, L)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [shaft, hub], 1)
        for body, size in ((shaft, L / cells), (hub, 1.3 * L / cells)):
            corners = gmsh.model.getBoundary([(2, body)], combined=False, recursive=True)
            gmsh.model.mesh.setSize(corners, size)
        gmsh.model.mesh.generate(2)
    domain = model_to_mesh(gmsh.model, COMM, 0, gdim=2).mesh
    gmsh.finalize()

    def faces(where):
        return mesh.locate_entities_boundary(domain, 1, where)

    def is_hub(x):
        return x[0] > R - DELTA / 2

    facets = [faces(lambda x, at=at: np.isclose(x[0], at)) for at in (R + DELTA, R, 0.0)]
    facets.append(faces(lambda x: np.isclose(x[1], 0) & is_hub(x)))
    facets.append(faces(lambda x: np.isclose(x[1], L) & (x[0] < 0.9 * R)))
    return domain, *facets


def fitted(cells: int):
    """The problem without friction, its contact, and the displacement of the shaft's upper end along z."""
    domain, shaft, bore, axis, foot, head = section(cells)
    V, DG = functionspace(domain, ("Lagrange", 2, (2,))), functionspace(domain, ("DG", 0))
    u, v = fem.Function(V), ufl.TestFunction(V)
    modulus, ratio = fem.Function(DG), fem.Function(DG)
    for of, values in ((modulus, E), (ratio, NU)):
        of.interpolate(lambda x, values=values: np.where(x[0] < R + DELTA / 2, *values))
    r = ufl.SpatialCoordinate(domain)[0]

    def strain(w):
        plane = ufl.sym(ufl.grad(w))
        rows = [[plane[0, 0], plane[0, 1], 0], [plane[1, 0], plane[1, 1], 0], [0, 0, w[0] / r]]
        return ufl.as_matrix(rows)

    shear = modulus / (2 * (1 + ratio))
    lame = 2 * shear * ratio / (1 - 2 * ratio)
    stress = 2 * shear * strain(u) + lame * ufl.tr(strain(u)) * ufl.Identity(3)
    F = ufl.inner(stress, strain(v)) * 2 * ufl.pi * r * ufl.dx
    push = fem.Constant(domain, 0.0)
    held = ((0.0, axis, V.sub(0)), (0.0, foot, V.sub(1)), (push, head, V.sub(1)))
    bcs = [fem.dirichletbc(of, fem.locate_dofs_topological(W, 1, at), W) for of, at, W in held]
    contact = dc.Contact(V, shaft, dc.DeformableSurface(V, bore), 0.0, weight=2 * ufl.pi * r)
    return dc.ContactProblem(F, u, [contact], bcs=bcs), contact, push


# %% [markdown]
# The hub stands on its lower end. The shaft is pushed at its upper end, except at the edge: a node that a boundary condition holds along the
# other body has no friction there.
#
# ## Result
#
# 1. Without friction the pressure of every node is that of the closed form to 1 %.
# 2. With friction the shaft slides under the force $2 \pi R L \mu p$ to 1 %.


# %%
def pressures(contact: dc.Contact) -> tuple[np.ndarray, np.ndarray]:
    """Heights of all nodes, sorted, and pressures there, on every rank."""
    z, p = on_all_ranks(contact.x[:, 1], contact.pressure)
    order = np.argsort(z)
    return z[order], p[order]


def main(cells: int = 10) -> list[tuple]:
    """Fit without friction and compare; assign friction and push; heights and pressures of the fit and of the shaft that slides."""
    problem, contact, push = fitted(cells)
    problem.solve()
    found = [pressures(contact)]
    off = np.abs(found[0][1] / LAME - 1).max()
    say(f"pressure {found[0][1].mean():.3f} MPa, Lame {LAME:.3f} MPa, off by {off:.1e} at most")
    assert off < 0.01

    contact.friction = dc.Friction(MU)
    for way in (0.002, 0.006, 0.02, 0.03):
        push.value = -way
        step = problem.solve()
        force = abs(contact.force()[1])
        say(f"pushed by {way:.3f} mm: {force:.0f} N, {step.counts.stick} nodes stick")
    found.append(pressures(contact))
    part = force / (2 * np.pi * R * L * MU * LAME)
    say(f"it slides under {force:.0f} N, {part:.4f} of the closed form")
    assert step.counts.stick == 0 and abs(part - 1) < 0.01
    return found


def draw(figure, found) -> None:
    """Pressures over the height."""
    axes = figure.subplots()
    axes.axhline(LAME, color="#0072b2", label="Lamé")
    for (z, p), label, style in zip(found, ("without friction", "as it slides"), ("o", ".-")):
        axes.plot(z, p, style, color="#d55e00", label=label)
    axes.set(xlabel="z, mm", ylabel="p, MPa", ylim=0)
    axes.legend()


if __name__ == "__main__":
    picture(draw, main())
