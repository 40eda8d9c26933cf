# %% [markdown]
# # A quarter of the punch
#
# The punch of [dSFMH07, Section 3] is symmetric about two planes, and so is its friction, whose principal directions
# lie in them. A quarter of it with symmetry conditions is therefore enough. Its contact nodes on the planes of
# symmetry are held in one tangential direction by a boundary condition, which must not be mistaken for friction.
#
# ## Notation
#
# $u$ displacement, $\sigma$ stress, $r = (r_t, r_n)$ reaction of the plane on the body. Units: mm, N, MPa.
#
# ## Strong form
#
# $$ -\operatorname{div} \sigma(u) = 0, \qquad u = (0, 0, -\delta) \text{ on the top face}, $$
#
# contact and friction with the plane $z = 0$ on the bottom face, for the whole body; and for the quarter $x, y > 0$
# in addition
#
# $$ u_x = 0,\; \sigma_{xy} = \sigma_{xz} = 0 \text{ on } x = 0, \qquad
#    u_y = 0,\; \sigma_{xy} = \sigma_{yz} = 0 \text{ on } y = 0. $$
#
# On a contact node with $x = 0$ there is neither slip nor friction along $x$: what the support carries there is the
# force between the two halves of the body, not a reaction of the plane. `dc.Contact` calls such directions `held`.
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \sum_{\text{contact nodes}} r \cdot v . $$
#
# ## Code
#
# The cross section is a square of $n \times n$ quadrilaterals bent into a disc,
# $(x, y) \mapsto (x \sqrt{1 - y^2/2},\, y \sqrt{1 - x^2/2})$, so that the quarter has the same cells as the whole. A
# node on one plane of symmetry has half the reaction, the node on both a quarter, because the other part is that of
# the missing body; along the held direction the reaction of the whole is zero.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, hooke, on_all_ranks, picture, picture_of_body, say

RADIUS, HEIGHT, E, NU = 10.0, 10.0, 210e3, 0.3
MU, P = (0.30, 0.15), (0.05, 0.20)  # case C of [dSFMH07, Table 1]
DEPTHS = (0.05, 0.1, 0.08, 0.05, 0.02)  # loading, then unloading, with reverse slip


def punch(quarter: bool, cells: int = 8):
    """The punch or its quarter, ``cells`` across the diameter; the problem and a setter of the depth."""
    low, across = (0.0, cells // 2) if quarter else (-1.0, cells)
    corners, bricks = [np.array([low, low, 0.0]), np.ones(3)], mesh.CellType.hexahedron
    domain = mesh.create_box(COMM, corners, [across, across, cells // 2], cell_type=bricks)

    def facets(axis, value):
        return mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[axis], value))

    bottom, top, *sides = facets(2, 0), facets(2, 1), facets(0, 0), facets(1, 0)
    x, y, z = domain.geometry.x.T.copy()
    disc = np.array([x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2)])
    domain.geometry.x[:] = np.stack([*(RADIUS * disc), HEIGHT * z], axis=1)

    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    dx = ufl.dx(metadata={"quadrature_degree": 3})
    F = ufl.inner(hooke(ufl.sym(ufl.grad(u)), E, NU), ufl.sym(ufl.grad(v))) * dx

    pressed, zero = fem.Constant(domain, np.zeros(3)), fem.Constant(domain, 0.0)
    bcs = [fem.dirichletbc(pressed, fem.locate_dofs_topological(V, 2, top), V)]
    for i, side in enumerate(sides if quarter else ()):
        dofs = fem.locate_dofs_topological(V.sub(i), 2, side)
        bcs.append(fem.dirichletbc(zero, dofs, V.sub(i)))
    plane = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1), axis=(1, 0, 0))
    contact = dc.Contact(V, bottom, plane, dc.Friction(mu=MU, p=P))
    return dc.ContactProblem(F, u, [contact], bcs=bcs, tol=1e-11), pressed


def run(quarter: bool) -> list[dict]:
    """Press and unload; for each step totals, and reactions of the nodes with x, y >= 0, by position."""
    problem, pressed = punch(quarter)
    contact, results = problem.contacts[0], []
    for depth in DEPTHS:
        pressed.value[2] = -depth
        step = problem.solve()
        x, r, work = on_all_ranks(contact.x, contact.reaction, contact.dissipation)
        here = (x[:, :2] > -1e-9 * RADIUS).all(axis=1)
        x, r = x[here], r[here]
        if quarter:
            r = r * 2.0 ** np.isclose(x[:, :2], 0.0).sum(axis=1)[:, None]
        order = np.lexsort(np.round(x / RADIUS, 9).T)
        totals = np.array([contact.force()[2], work.sum()])
        results.append({"x": x[order], "r": r[order], "totals": totals, "counts": step.counts})
    picture_of_body(problem)
    return results


# %% [markdown]
# ## Result
#
# After each step of loading and unloading, the quarter has the reactions of the whole, node by node, to 1e-8 of the
# largest, and a quarter of its total force and of its dissipation.


# %%
def main() -> tuple[dict, dict]:
    """Solve both and compare; the last states."""
    for whole, part, depth in zip(run(False), run(True), DEPTHS):
        assert np.abs(whole["x"] - part["x"]).max() < 1e-9 * RADIUS
        difference = np.abs(whole["r"] - part["r"]).max() / np.abs(whole["r"]).max()
        totals = np.abs(4 * part["totals"] / whole["totals"] - 1).max()
        _, stick, slip = whole["counts"]
        say(f"{depth:.2f} mm: whole {whole['totals'][0]:.1f} N, {stick} stick, {slip} slip; "
            f"4 quarters {4 * part['totals'][0]:.1f} N, nodes differ by {difference:.0e}")  # fmt: skip
        assert difference < 1e-8 and totals < 1e-8
    return whole, part


def draw(figure, whole, part) -> None:
    """Friction forces at the last step, of the whole and of the quarter, on each other."""
    axes = figure.subplots()
    orange, black = (dict(width=9e-3, color="#e69f00"), dict(width=3e-3, color="black"))
    for found, name, style in ((whole, "whole", orange), (part, "quarter", black)):
        axes.quiver(*found["x"].T[:2], *found["r"].T[:2], label=name, **style)
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    axes.legend()


if __name__ == "__main__":
    picture(draw, *main())
