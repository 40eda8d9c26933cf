# %% [markdown]
# # Ironing: a rounded stamp slides over a soft block
#
# A stamp with a cylindrical face is pressed into a block of rubber and drawn over it, by one facet of the block a step.
# Both bodies are deformable and three-dimensional, strains are finite, and the meshes do not match. A run with ten times as many steps
# shows the error of long steps.
#
# ## Notation
#
# $u$ displacement, $G = 1 + \nabla u$, $J = \det G$, $C = G^T G$; $\mu_i$, $\lambda_i$ moduli of stamp and block; $f$ friction; $N$ and $T$ the
# forces of the block on the stamp, up and along the path; $s$ the displacement of the stamp's top; $D$ frictional work, $W$ elastic energy. Units: mm, N, MPa.
#
# ## Strong form and balance
#
# $$ \operatorname{Div} P(u) = 0 \ \text{in both}, \quad P = \frac{\partial w}{\partial G}, \quad
#    w = \frac{\mu}{2} (\operatorname{tr} C - 3 - 2 \ln J) + \frac{\lambda}{2} (\ln J)^2, $$
#
# with Signorini's and Coulomb's laws where the faces meet as they are deformed. What is done at the top of the stamp, which moves as a whole, is
# stored or dissipated:
#
# $$ -\int T \,\mathrm{d}s = D + W - W_0 . $$
#
# ## Weak form
#
# $$ \int_{\Omega_1 \cup \Omega_2} P(u) : \nabla v \,\mathrm{d}x = \sum_a r_a \cdot \left( v_a - \sum_b m_{ab} v_b \right), $$
#
# over the nodes $a$ of the stamp's face, each against those nodes $b$ of the block that are opposite in the present, deformed state.
#
# ## Code
#
# Both bodies are cells of one box, the rest of which is left out; their coordinates are changed afterwards.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, picture, say

STAMP, BLOCK = (10.0, 10.0), (1.0, 2.0)  # mu and lambda, MPa
FRICTION, DEPTH, WAY = 0.3, 0.12, 1.0
CELLS, ACROSS, LENGTH = 12, 3, 3.0  # of the block, whose facets are 0.25 long


def bodies():
    """The mesh, which cells are the stamp's, facets of both faces, of the top and of the bottom."""
    corners = [np.zeros(3), np.array([CELLS, ACROSS, 5.0])]
    whole = mesh.create_box(COMM, corners, [CELLS, ACROSS, 5], mesh.CellType.hexahedron)
    eps = 1e-6
    parts = (
        lambda x: x[2] < 2 + eps,
        lambda x: (x[2] > 3 - eps) & (x[0] > 1 - eps) & (x[0] < 5 + eps) & (x[1] < 2 + eps),
    )
    cells = np.sort(np.concatenate([mesh.locate_entities(whole, 3, part) for part in parts]))
    domain = mesh.create_submesh(whole, 3, cells)[0]

    def level(z):
        return mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[2], z))

    facets = [level(z) for z in (3, 2, 5, 0)]
    x = domain.geometry.x
    above = x[:, 2] > 2.5
    at = np.where(above, (x[:, 0] - 3) / 2, 0.0)  # from -1 to 1 over the stamp
    x[:, 2] = np.where(above, 1 + (x[:, 2] - 3) / 4, x[:, 2] / 2)
    x[:, 2] += above * (1.5 - x[:, 2]) / 0.5 * 0.1 * at**2
    x[:, 0] = np.where(above, 0.75 + 0.4 * at, x[:, 0] * LENGTH / CELLS)
    x[:, 1] = np.where(above, 0.1 + 0.4 * x[:, 1], x[:, 1] / ACROSS)
    return domain, *facets


def energy_of(u):
    """Density of a neo-Hooke material, whose moduli depend on the height."""
    stamp = ufl.SpatialCoordinate(u.function_space.mesh)[2] > 1
    mu, lam = (ufl.conditional(stamp, *both) for both in zip(STAMP, BLOCK))
    G = ufl.Identity(3) + ufl.grad(u)
    log = ufl.ln(ufl.det(G))
    return mu / 2 * (ufl.tr(G.T * G) - 3 - 2 * log) + lam / 2 * log**2


# %% [markdown]
# The block is held at its bottom, the stamp moved by its top. Sliding over facets needs nothing but small enough steps; the face of the
# stamp, the smaller one,
# carries the unknowns.
#
# ## Result
#
# 1. Forces with steps of one facet differ from those with ten times as many steps by less than 1 %.
# 2. The balance of work holds to 2 %, the error of this mesh.


# %%
def ironed(steps: int) -> dict:
    """Press, slide by ``WAY`` in so many steps: rows of s, T, N, D, W, from the pressed state on."""
    domain, face, ground, top, bottom = bodies()
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, moved = fem.Function(V), fem.Constant(domain, np.zeros(3))
    density = energy_of(u) * ufl.dx(metadata={"quadrature_degree": 2})
    energy = fem.form(density)
    ends = ((moved, top), (np.zeros(3), bottom))
    bcs = [fem.dirichletbc(of, fem.locate_dofs_topological(V, 2, at), V) for of, at in ends]
    contact = dc.Contact(V, face, dc.DeformableSurface(V, ground), dc.Friction(FRICTION))
    F = ufl.derivative(density, u, ufl.TestFunction(V))
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs)
    rows = []
    for part in (-0.5, *np.linspace(0, 1, steps + 1)):
        moved.value[:] = WAY * max(part, 0), 0, -DEPTH * min(1, 1 + part)
        problem.solve()
        force = contact.force()
        dissipated = COMM.allreduce(contact.dissipation.sum())
        stored = COMM.allreduce(fem.assemble_scalar(energy))
        rows.append((moved.value[0], -force[0], force[2], dissipated, stored))
    return dict(zip(("s", "T", "N", "D", "W"), np.array(rows[1:]).T))


def main(steps: int = 4) -> tuple[dict, dict]:
    """Long steps and steps ten times finer; print and assert what is claimed."""
    coarse, fine = (ironed(n) for n in (steps, 10 * steps))
    say(f"pressed with {fine['N'][0]:.4f} N")
    for k, s in enumerate(coarse["s"][1:], start=1):
        T, N = (coarse[name][k] for name in "TN")
        off = max(abs(of - fine[name][10 * k]) for of, name in ((T, "T"), (N, "N")))
        say(f"s {s:.3f}: T {T:.4f} N, N {N:.4f} N, off by {off / fine['N'][10 * k]:.1e}")
        assert off < 0.01 * fine["N"][10 * k]
    s, T, D, W = (fine[name] for name in "sTDW")
    done = np.sum((T[1:] + T[:-1]) / 2 * np.diff(s))
    kept = D[-1] - D[0] + W[-1] - W[0]
    say(f"work done {done:.4f}, dissipated and stored {kept:.4f} N mm")
    assert abs(done / kept - 1) < 0.02
    return coarse, fine


def draw(figure, found) -> None:
    """Forces over the way, of long and fine steps."""
    axes = figure.subplots()
    for of, style in zip(found, ("o", "-")):
        for name, color in (("N", "#0072b2"), ("T", "#d55e00")):
            label = f"{name}, {'long' if style == 'o' else 'fine'} steps"
            axes.plot(of["s"], of[name], style, color=color, label=label)
    axes.set(xlabel="s, mm", ylabel="N", ylim=0)
    axes.legend()


if __name__ == "__main__":
    picture(draw, main())
