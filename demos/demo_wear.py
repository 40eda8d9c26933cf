# %% [markdown]
# # A million cycles of wear
#
# A pad under a dead weight is rubbed to and fro on a plane. It wears until its pressure, averaged over a cycle, is uniform; from then on it wears uniformly.
# `dc.cycle_jump` simulates only a few of the cycles.
#
# ## Notation
#
# $N$ weight, $b$ width of the pad, $\mu$ coefficient of friction, $k$ wear coefficient (volume per work), $s$ sliding distance per cycle, $w$ worn depth,
# $n$ cycles. Units: mm, N, MPa, per millimetre of the pad.
#
# ## Strong form
#
# $$ -\operatorname{div} \sigma(u) = 0, \qquad x_n = u_n + w \ge 0, \quad p \ge 0, \quad x_n\, p = 0,
#    \quad |q| \le \mu p, \qquad \dot w = k \mu p\, |\dot u_t|, \qquad \int p = N . $$
#
# ## Closed form
#
# In gross slip $\int w = k \mu N s\, n$ at any time. Where more is worn, the pressure falls, so it becomes even, $p = N / b$, and depth grows
# by $k \mu p s$ a cycle everywhere [J. F. Archard, J. Appl. Phys. 24 (1953) 981].
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \sum_{\text{contact nodes}} r \cdot v. $$
#
# ## Code

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, along_face, hooke, picture, say

E, NU, MU = 210e3, 0.3, 0.3
WIDTH, HEIGHT = 10.0, 6.0
WEIGHT, STROKE = 1000.0, 0.5  # N, mm to either side
COEFFICIENT, CYCLES, ACCURACY = 1e-8, 10**6, 0.02


def pad():
    """Pad and plane, pressed together: the problem."""
    corners = [[-WIDTH / 2, 0.0], [WIDTH / 2, HEIGHT]]
    domain = mesh.create_rectangle(COMM, corners, [12, 6], mesh.CellType.quadrilateral)
    foot, head = (
        mesh.locate_entities_boundary(domain, 1, lambda x, y=y: np.isclose(x[1], y))
        for y in (0.0, HEIGHT)
    )
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    strain = ufl.sym(ufl.grad(u))
    F = ufl.inner(hooke(strain, E, NU), ufl.sym(ufl.grad(v))) * ufl.dx
    bc = fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, head), V)
    plane = dc.RigidPlane((0, 0), (0, 1))
    contact = dc.Contact(V, foot, plane, dc.Friction(MU), wear=dc.Wear(COEFFICIENT))
    problem = dc.ContactProblem(F, u, [contact], bcs=[bc])
    plane.free, plane.force = ("n",), (0, WEIGHT)
    problem.solve()
    return problem


def rub(problem):
    """A million cycles; what cycle_jump found, and the face at first and after each jump."""
    contact = problem.contacts[0]
    plane = contact.surface

    def cycle(done):
        for way in (STROKE, 0.0, -STROKE, 0.0):
            plane.displacement = (way, plane.displacement[1])
            problem.solve()

    def face(row):
        faces.append((row["cycle"], *along_face(contact, contact.pressure, contact.wear_depth)))

    faces = []
    face({"cycle": 0})
    return dc.cycle_jump(problem, cycle, CYCLES, ACCURACY, monitor=face), faces


# %% [markdown]
# ## Result
#
# 1. The worn volume is $k \mu N s\, n$ to 2 %, the requested accuracy. (The pad follows the plane at each turn, which is less than 1 % of the sliding distance.)
# 2. Depth is that of a uniform pressure to 2 % everywhere, as the pressure averaged over a cycle is uniform. At the end of a stroke the moment of
#    friction tilts it.
# 3. At most one cycle of 5,000 is simulated.


# %%
def main():
    """Rub; print and assert what is claimed above; the faces."""
    found, faces = rub(pad())
    volume = COEFFICIENT * MU * WEIGHT * 4 * STROKE * CYCLES
    first, (last, depth) = faces[0][2], faces[-1][2:]
    say(f"{found.simulated} cycles of {found.cycles} simulated, {found.rejected} jumps rejected")
    say(f"volume {found.volume:.4f} mm^2, closed form {volume:.4f}, estimated error {found.volume_error:.1e}")  # fmt: skip
    say(f"pressure at most {first.max():.1f} MPa at first, {last.max():.1f} at last; depth {depth.min():.4f} to {depth.max():.4f} mm")  # fmt: skip
    assert found.reached and found.simulated < CYCLES / 5000
    assert abs(found.volume / volume - 1) < ACCURACY
    assert np.abs(depth / (volume / WIDTH) - 1).max() < ACCURACY
    return faces


def draw(figure, faces) -> None:
    """Pressure and depth along the face, from light to dark."""
    above, below = figure.subplots(2, 1, sharex=True)
    for k, (cycle, x, pressure, depth) in enumerate(faces):
        style = dict(
            color=str(0.85 * (1 - (k + 1) / len(faces))), label=None if k % 4 else f"{cycle}"
        )
        above.plot(x, pressure, **style)
        below.plot(x, depth, **style)
    above.set(ylabel="pressure [MPa]")
    below.set(xlabel="x [mm]", ylabel="worn depth [mm]")
    above.legend(title="cycles", fontsize="x-small", ncols=2)


if __name__ == "__main__":
    picture(draw, main())
