# %% [markdown]
# # A block that hits the ground and slides
#
# In dynamics the form changes and contact does not: an implicit time step adds inertia to `F`. A block falls obliquely on a
# plane, is compressed by a wave, slides, and rebounds. Energy balances exactly in every step, and contact never adds any.
#
# ## Notation
#
# $u$ displacement, $v$ velocity, $\varrho$ density, $E$ Young's modulus (Poisson's ratio is zero), $H$ height of the block, $m$ its
# mass, $w$ its width, $c = \sqrt{E/\varrho}$ speed of the wave, $v_0 = (v_t, -v_n)$ velocity of the fall, $\mu$ coefficient of friction, $r$ reactions, $g$ gaps,
# $\Delta w_t$ slips, $h$ time step. Units: mm, N, MPa, ms; masses in g.
#
# ## Strong form
#
# $$ \varrho\, \dot v - \operatorname{div} \sigma(u) = 0, \quad v = \dot u, \qquad
#    g \ge 0,\; r_n \ge 0,\; g\, r_n = 0, \qquad |r_t| \le \mu r_n \text{ with friction against slip} . $$
#
# The **closed form** of the bar that hits a rigid wall: the pressure is $\varrho c v_n$ while the wave travels up and back, for
# $2H/c$; then the bar leaves with the speed of impact. While all nodes slide, friction is $\mu$ times the normal reaction, so the
# momentum lost along the plane is $\mu$ times that gained across it.
#
# ## Weak form
#
# Implicit Euler, $u^{k+1} = u^k + h\, v^{k+1}$:
#
# $$ \int_\Omega \frac{\varrho}{h} \left( \frac{u^{k+1} - u^k}{h} - v^k \right) \cdot \delta u
#    + \sigma(u^{k+1}) : \varepsilon(\delta u) \,\mathrm{d}x = \sum_{\text{contact nodes}} r_i \cdot \delta u_i . $$
#
# With $\delta u = u^{k+1} - u^k$ the energy $T + U$, kinetic and elastic, obeys
#
# $$ \Delta (T + U) = - T(\Delta v) - U(\Delta u) - \sum r_n\, g^k + \sum r_t \cdot \Delta w_t , $$
#
# in which no term is positive: the first two are the numerical dissipation of implicit Euler, the third is the energy lost by nodes
# that land and had a gap $g^k$ before the step, the last is the frictional work.
#
# ## Code
#
# Inertia holds the body, so no support is needed. The matrix of stiffness and inertia is constant and factorised once.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, hooke, picture, say

E, RHO, MU = 200.0, 1e-3, 0.1
HEIGHT, WIDTH = 10.0, 10.0
SPEED = np.array([0.6, -1.0])  # mm/ms
GAP = 0.0123  # mm, below the block at the start
WAVE = float(np.sqrt(E / RHO))
MASS = RHO * HEIGHT * WIDTH  # of a millimetre of depth


class Block:
    """A block above the ground, and its steps in time.

    Args:
        cells: Over height and width.
        step: Time step, ms.
    """

    def __init__(self, cells: int, step: float):
        high = np.array([WIDTH, HEIGHT])
        domain = mesh.create_rectangle(
            COMM, [np.zeros(2), high], [cells, cells], mesh.CellType.quadrilateral
        )
        V = functionspace(domain, ("Lagrange", 1, (2,)))
        self.u, self.last, self.velocity = fem.Function(V), fem.Function(V), fem.Function(V)
        v, self.step = ufl.TestFunction(V), step
        self.velocity.interpolate(lambda x: np.outer(SPEED, np.ones(x.shape[1])))
        push = RHO / step * ((self.u - self.last) / step - self.velocity)
        F = (ufl.inner(push, v) + ufl.inner(hooke(ufl.sym(ufl.grad(self.u)), E, 0.0), ufl.grad(v))) * ufl.dx  # fmt: skip
        foot = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[1], 0.0))
        ground = dc.RigidPlane(point=(0, -GAP), normal=(0, 1))
        self.contact = dc.Contact(V, foot, ground, dc.Friction(MU))
        self.problem = dc.ContactProblem(F, self.u, [self.contact], tol=1e-11)
        self._kinetic = fem.form(RHO / 2 * ufl.inner(self.velocity, self.velocity) * ufl.dx)
        self._elastic = fem.form(0.5 * ufl.inner(hooke(ufl.sym(ufl.grad(self.u)), E, 0.0), ufl.grad(self.u)) * ufl.dx)  # fmt: skip
        self._momentum = [fem.form(RHO * self.velocity[i] * ufl.dx) for i in range(2)]

    def of(self, form) -> float:
        return COMM.allreduce(fem.assemble_scalar(form))

    def energy(self) -> float:
        """Kinetic and elastic, N mm for a millimetre of depth."""
        return self.of(self._kinetic) + self.of(self._elastic)

    def momentum(self) -> np.ndarray:
        return np.array([self.of(form) for form in self._momentum])

    def advance(self) -> dict:
        """One step in time: forces, and how much each term of the balance takes."""
        u, last, velocity = (of.x.array for of in (self.u, self.last, self.velocity))
        gap, before = self.contact.gap.copy(), velocity.copy()
        self.problem.solve()
        moved, here = u - last, u.copy()
        velocity[:], u[:] = moved / self.step - before, moved
        method = self.energy()  # of the differences: what implicit Euler takes
        velocity += before
        u[:], last[:] = here, here
        tangential, normal = np.split(self.contact.reaction, [-1], axis=1)
        landing = COMM.allreduce((normal[:, 0] * gap).sum())
        # In implicit Euler a force acts all along its step; slip counts from the landing on.
        way = moved.reshape(-1, 2)[self.contact.nodes] @ self.contact.frame[0]
        friction = -COMM.allreduce((tangential[:, 0] * way).sum())
        return dict(force=self.contact.force(), lost=method + landing + friction, friction=friction)


# %% [markdown]
# ## Result
#
# 1. The balance of energy closes to $10^{-10}$ of the energy, in every step; no step gains any.
# 2. The impulse of the forces is the change of momentum, to $10^{-10}$; along the plane it is $\mu$ times that across it.
# 3. The plateau of the pressure is $\varrho c v_n$ to 0.1 %. The force exceeds half of it for $2H/c$, to 5 %, since implicit Euler
#    smears the wave.


# %%
def main(cells: int = 24, steps: int = 450):
    """Fall, impact, rebound; print and assert what is claimed above; times and forces."""
    duration, plateau = 2 * HEIGHT / WAVE, RHO * WAVE * -SPEED[1] * WIDTH
    step = duration / 300
    block = Block(cells, step)
    energy, forces, friction = [block.energy()], [], 0.0
    first = block.momentum()
    for _ in range(steps):
        done = block.advance()
        energy.append(block.energy())
        forces.append(done["force"])
        friction += done["friction"]
        made = energy[-1] - energy[-2]
        assert abs(made + done["lost"]) < 1e-10 * energy[0] and made < 1e-10 * energy[0]
    forces = np.array(forces)
    impulse = step * forces.sum(axis=0)
    assert np.abs(block.momentum() - first - impulse).max() < 1e-10 * np.abs(first).max()
    assert abs(impulse[0] + MU * impulse[1]) < 1e-10 * impulse[1]
    reached = np.median(forces[forces[:, 1] > 0, 1]) / plateau
    lasted = (forces[:, 1] > plateau / 2).sum() * step / duration
    assert abs(reached - 1) < 1e-3 and abs(lasted - 1) < 0.05
    lost = 1 - np.array([energy[-1], energy[-1] + friction]) / energy[0]
    say(f"plateau {reached:.5f} rho c v_n; contact lasts {lasted:.3f} times 2 H / c; the block leaves at "
        f"{block.momentum()[1] / MASS:.3f} mm/ms; parts of the energy lost: friction {lost[0] - lost[1]:.3f}, implicit Euler {lost[1]:.3f}")  # fmt: skip
    return step * np.arange(1, steps + 1), forces


def draw(figure, times, forces) -> None:
    """Forces of the ground."""
    axes = figure.subplots()
    axes.plot(1e3 * times, forces, label=["along the plane", "across it"])
    axes.axhline(RHO * WAVE * -SPEED[1] * WIDTH, color="0.5", lw=1, label="closed form")
    axes.set(xlabel="time, µs", ylabel="force, N per mm")
    axes.legend(frameon=False)


if __name__ == "__main__":
    picture(draw, *main())
