# %% [markdown]
# # A block on a turning path
#
# A block is pressed on a plane with grooves, and the plane is dragged away below it: straight on, along three
# quarters of a circle, and straight on again. Friction differs along and across the grooves, and slip is not normal
# to the friction cone, so the force points neither along the path nor where an associated rule would have it.
#
# ## Notation
#
# $u$ displacement, $\sigma$ stress, $E$, $\nu$ elastic constants; $r = (r_t, r_n)$ reaction of the plane on the
# block, $M = \mathrm{diag}(\mu_x, \mu_y)$, $P = \mathrm{diag}(p_x, p_y)$; $s$ displacement of the plane and $d$ the
# unit vector along its increment $\Delta s$. Units: mm, N, MPa.
#
# ## Strong form
#
# $$ -\operatorname{div} \sigma(u) = 0, \qquad u = (0, 0, -\delta) \text{ on the top face}, $$
#
# and on the bottom face, with the slip increment $\Delta u_t$ relative to the plane [dSFMH07, Section 1]:
# $x_n \ge 0$, $r_n \ge 0$, $x_n r_n = 0$ for the gap $x_n$, $|M^{-1} r_t| \le r_n$, and where there is slip
#
# $$ |M^{-1} r_t| = r_n, \qquad -\Delta u_t = \lambda\, P^{-2} r_t, \quad \lambda \ge 0. $$
#
# A node that slides with the plane below it has $-\Delta u_t = \Delta s$, up to the change of its own elastic
# displacement. Then $P^{-2} r_t$ is along $d$, which is the **closed form**
#
# $$ r_t = r_n \frac{P^2 d}{|M^{-1} P^2 d|}. $$
#
# It holds for every node, and therefore for the total force. How much the elastic displacement matters is a question
# of one length: $\ell = |r_t| / k_t$, the tangential force over the tangential stiffness of the block. On a straight
# line the force reaches the closed form exponentially, within a few $\ell$. Where the path turns, the elastic
# displacement turns with the force, and the force lags behind the closed form by an error of first order in
# $\ell / |\Delta s|$. A block that is pressed half as deep has half the force on the same stiffness, hence half the
# $\ell$ and half the lag.
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \sum_{\text{contact nodes}} r \cdot v. $$
#
# DOLFINx assembles the left side, `dolfinx_contact` finds the reactions on the right.
#
# ## Code
#
# The block, the path, the closed form; `drag` moves the plane along the path. For each step it records the total
# force, how far the total and the worst node are from the closed form, and the frictional work.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, hooke, on_all_ranks, picture, say

MU, P = np.array([0.30, 0.15]), np.array([0.05, 0.20])  # case C of [dSFMH07, Table 1]
STEP = 0.5  # |Delta s|, mm


def block(depth: float, friction: dc.Friction) -> dc.ContactProblem:
    """A pad of 10 x 10 x 4 mm; its top face is pressed down by ``depth``, against the plane z = 0."""
    size, bricks = np.array([10.0, 10.0, 4.0]), mesh.CellType.hexahedron
    domain = mesh.create_box(COMM, [np.zeros(3), size], [4, 4, 2], cell_type=bricks)
    bottom = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[2], 0.0))
    top = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[2], size[2]))

    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    stress = hooke(ufl.sym(ufl.grad(u)), E=2000.0, nu=0.3)
    F = ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx

    pressed = np.array([0.0, 0.0, -depth])
    bcs = [fem.dirichletbc(pressed, fem.locate_dofs_topological(V, 2, top), V)]
    plane = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1), axis=(1, 0, 0))
    contact = dc.Contact(V, bottom, plane, friction)
    return dc.ContactProblem(F, u, [contact], bcs=bcs, tol=1e-10)


STRAIGHT = 6  # steps before the turn, and after it


def path() -> np.ndarray:
    """Angles of the increments: straight on at 20 degrees, a turn by 270 degrees, straight on."""
    start = np.deg2rad(20.0)
    turn = start + np.deg2rad(15.0) * np.arange(1, 19)
    return np.concatenate([np.full(STRAIGHT, start), turn, np.full(STRAIGHT, turn[-1])])


def closed_form(angle: float, p) -> np.ndarray:
    """Tangential over normal reaction of a node that slides along ``angle``, ``shape=(2,)``."""
    force = np.square(p) * [np.cos(angle), np.sin(angle)]
    return force / np.linalg.norm(force / MU)


def drag(depth: float, p) -> dict[str, np.ndarray]:
    """Drag the plane below a block pressed by ``depth``; arrays over the steps by name."""
    problem = block(depth, dc.Friction(mu=MU, p=p))
    contact = problem.contacts[0]
    problem.solve()  # pressed, before anything slides
    rows, before = [], 0.0
    for angle in path():
        d = np.array([np.cos(angle), np.sin(angle), 0.0])
        contact.surface.displacement = contact.surface.displacement + STEP * d
        step = problem.solve()
        assert step.counts.slip == sum(step.counts)  # all nodes touch and slide
        force, expected = contact.force(), closed_form(angle, p)
        total = np.linalg.norm(force[:2] - force[2] * expected) / np.linalg.norm(force[:2])
        r, dissipation = on_all_ranks(contact.reaction, contact.dissipation)
        worst = np.linalg.norm(r[:, :2] - r[:, 2:] * expected, axis=1).max() / force[2]
        rows.append((force, total, worst, dissipation.sum() - before))
        before = dissipation.sum()
    return dict(zip(("force", "total", "worst", "work"), map(np.array, zip(*rows))))


# %% [markdown]
# ## Result
#
# 1. At the end of each straight part every node has the closed form, and the frictional work of a step is
#    $r_n\, |\Delta s|\, d \cdot P^2 d / |M^{-1} P^2 d|$, both to 1e-9.
# 2. On the turn the total force never leaves the ellipse, and it lags behind the closed form by an error of first
#    order in $\ell / |\Delta s|$: three depths, each half of the one before, have lags with a ratio of two. The lag
#    is largest where the path runs along the direction of large $\mu$ and small $p$: there the force swings from one
#    side to the other while the path turns by two steps.
# 3. The non-associated force is 75 degrees away from the associated one on the first straight part.


# %%
def main() -> dict[str, np.ndarray]:
    """Drag the block and assert what is claimed above; tangential over normal force by title."""
    angles, turn = path(), slice(STRAIGHT, -STRAIGHT)
    lags, traces = [], {}
    for p, depths in ((P, (0.02, 0.01, 0.005)), (MU, (0.01,))):
        for depth in depths:
            found = drag(depth, p)
            tangential, normal = found["force"][:, :2], found["force"][:, 2]
            cone = np.linalg.norm(tangential / MU, axis=1) / normal
            rule = "non-associated" if p is P else "associated"
            traces[f"{rule}, pressed by {depth} mm"] = tangential / normal[:, None]
            for end in (STRAIGHT - 1, -1):
                assert found["total"][end] < 1e-9 and found["worst"][end] < 1e-9
                assert abs(cone[end] - 1) < 1e-12
                d = [np.cos(angles[end]), np.sin(angles[end])]
                work = normal[end] * STEP * (d @ closed_form(angles[end], p))
                assert abs(found["work"][end] / work - 1) < 1e-9
            assert (cone <= 1 + 1e-12).all()
            if p is P:
                lags.append(found["total"][turn].max())
        degrees = np.rad2deg(np.arctan2(*tangential[STRAIGHT - 1, ::-1]))
        expected = np.rad2deg(np.arctan2(*closed_form(angles[0], p)[::-1]))
        assert abs(degrees - expected) < 1e-6
        say(f"p = {p}: path at 20 degrees, force at {degrees:.4f} degrees, "
            f"mu = {np.linalg.norm(tangential[-1]) / normal[-1]:.4f} on the last part")  # fmt: skip
    ratios = np.divide(lags[:-1], lags[1:])
    shown = " ".join(f"{lag:.4f}" for lag in lags)
    say(f"largest lag on the turn: {shown} ratios {ratios.round(3)}")
    assert (np.abs(ratios - 2) < 0.25).all() and ratios[1] < ratios[0]  # towards two
    return traces


def draw(figure, traces) -> None:
    """The friction force on the ellipse, step by step, and where the closed form has it."""
    for axes, names in zip(figure.subplots(1, 2), (list(traces)[1:3], list(traces)[3:])):
        circle = np.linspace(0, 2 * np.pi, 200)
        axes.plot(MU[0] * np.cos(circle), MU[1] * np.sin(circle), color="#bbbbbb")
        p = P if "non" in names[0] else MU
        axes.plot(*np.transpose([closed_form(a, p) for a in path()]), "kx", label="closed form")
        for name in names:
            axes.plot(*traces[name].T, ".-", label=name.split(", ")[1])
        axes.set(xlabel="force along x / normal", ylabel="along y", title=names[0].split(", ")[0])
        axes.set(aspect="equal", ylim=(-0.2, 0.32))
        axes.legend(fontsize=8, loc="upper center")


if __name__ == "__main__":
    picture(draw, main())
