# %% [markdown]
# # A rubber ring between two plates
#
# A thick ring of incompressible rubber is pressed flat between two rigid plates, with friction and without. Strains are
# large, and the contact grows from a line to a strip. The pressure in the rubber is a separate unknown, in Taylor-Hood
# elements. Newton's method solves for body, pressure and contact together.
#
# ## Notation
#
# $u$ displacement, $p$ pressure (positive in tension), $G = I + \nabla u$ deformation gradient, $J = \det G$,
# $C = G^T G$; $\psi$ energy per reference volume, $\mu_s$ shear modulus of rubber; $E_s$ stored energy; $\delta$
# displacement of the upper plate from the middle of the ring, $N$ its force. Outer radius 1, inner radius 0.6,
# $\mu_s = 1$. Plane strain.
#
# ## Strong form
#
# $$ \operatorname{div} P = 0, \quad P = \partial \psi / \partial G, \quad J = 1, \qquad
# \psi = \tfrac{\mu_s}{2} (\operatorname{tr} C - 2 - 2 \ln J) + p\, (J - 1) . $$
#
# By symmetry a quarter is enough: $u_x = 0$ on $x = 0$, $u_y = 0$ on $y = 0$. On the outer face: unilateral contact
# and Coulomb friction with the upper plate. A rigid plane has the same normal everywhere, so the gap
# $x_n = (X + u - a) \cdot n$ is exact for any displacement, and so is slip, which is measured on the plane.
#
# Without friction no energy is lost, so the force is the derivative of the stored energy: the **exact balance**
#
# $$ N = \mathrm{d} E_s / \mathrm{d} \delta . $$
#
# With friction the work of the plate is the energy stored plus the frictional work.
#
# ## Weak form
#
# $$ F(u, p; v, q) = \int_\Omega P(u, p) : \nabla v + q\, (J - 1) \,\mathrm{d}x
# = \sum_{\text{contact nodes}} r \cdot v. $$
#
# $F$ is the derivative of $E_s = \int \psi$ with respect to both, found by UFL, and is given as it stands.
# `ContactProblem` detects that it is nonlinear, and which part of the mixed space holds displacements. For rubber of bulk
# modulus $K$, add the term $-p^2 / 2K$ to $\psi$.
#
# ## Code

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import mixed_functionspace

# isort: split
import numpy as np
import ufl
from dolfinx import fem, mesh
from helpers import COMM, on_all_ranks, picture, say

INNER, SHEAR = 0.6, 1.0
STEP, STEPS = 0.025, 12  # displacement of the plate in a step; the height goes down by 30 %


def ring(cells=(3, 24)) -> tuple:
    """A quarter of the ring in quadrilaterals; facets on x = 0, on y = 0 and outside."""
    corners, kind = [np.zeros(2), np.ones(2)], mesh.CellType.quadrilateral
    domain = mesh.create_rectangle(COMM, corners, cells, kind)
    facets = [
        mesh.locate_entities_boundary(domain, 1, where)
        for where in (
            lambda x: np.isclose(x[1], 1.0),
            lambda x: np.isclose(x[1], 0.0),
            lambda x: np.isclose(x[0], 1.0) & (x[1] > 0.2),  # below it nothing comes near the plate
        )
    ]
    x = domain.geometry.x
    radius, angle = INNER + (1 - INNER) * x[:, 0], np.pi / 2 * x[:, 1]
    x[:, 0], x[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    return domain, *facets


def seal(mu: float) -> tuple[dc.ContactProblem, object]:
    """The problem, and the stored energy as a form."""
    domain, left, low, outside = ring()
    W = mixed_functionspace(domain, [("Lagrange", 2, (2,)), ("Lagrange", 1)])
    w = fem.Function(W)
    u, p = ufl.split(w)
    G = ufl.Identity(2) + ufl.grad(u)
    J = ufl.det(G)
    psi = SHEAR / 2 * (ufl.tr(G.T * G) - 2 - 2 * ufl.ln(J)) + p * (J - 1)
    energy = psi * ufl.dx(metadata={"quadrature_degree": 5})

    bcs = []
    for component, facets in enumerate((left, low)):
        part = W.sub(0).sub(component)
        whole, _ = part.collapse()
        dofs = fem.locate_dofs_topological((part, whole), 1, facets)
        bcs.append(fem.dirichletbc(fem.Function(whole), dofs, part))
    plate = dc.RigidPlane(point=(0, 1), normal=(0, -1))
    contact = dc.Contact(W, outside, plate, dc.Friction(mu=(mu, mu)))
    F = ufl.derivative(energy, w, ufl.TestFunction(W))
    return dc.ContactProblem(F, w, [contact], bcs=bcs, tol=1e-9), fem.form(energy)


def stored(form) -> float:
    """Energy of all ranks."""
    return COMM.allreduce(fem.assemble_scalar(form))


def flatten(mu: float, depths) -> dict:
    """Press to one depth after another: forces, energies and works of friction over the steps, the last shape."""
    problem, energy = seal(mu)
    contact, found = problem.contacts[0], {name: [0.0] for name in ("force", "energy", "friction")}
    for depth in depths:
        contact.surface.displacement = (0.0, -depth)
        step, errors = solved(problem)
        found["force"].append(-contact.force()[1])
        found["energy"].append(stored(energy))
        found["friction"].append(COMM.allreduce(contact.dissipation.sum()))
    say(f"mu = {mu}: {step.solver}, {step.counts}, errors of the last step {errors}")
    u = problem.u.sub(0).collapse()
    n = u.function_space.dofmap.index_map.size_local
    x = u.function_space.tabulate_dof_coordinates()[:n, :2]
    shape = on_all_ranks(x, u.x.array[: 2 * n].reshape(-1, 2))
    touch = on_all_ranks(contact.x[:, :2], contact.reaction[:, -1])
    return {name: np.array(row) for name, row in found.items()} | dict(shape=shape, touch=touch)


def solved(problem) -> tuple[dc.Step, str]:
    """The record of a step, and the errors of its iterates."""
    errors = []
    problem.monitor = lambda iteration, error, counts: errors.append(f"{error:.0e}")
    return problem.solve(), " ".join(errors)


# %% [markdown]
# ## Result
#
# 1. In the last iterations of a step errors fall quadratically, those of body and contact together.
# 2. Without friction $N$ is the derivative of the stored energy, by central differences to 1e-5, and does not depend
#    on the number of steps.
# 3. With friction the work of the plate, by the trapezoidal rule, is stored or dissipated, to 1 %.


# %%
def main() -> dict:
    """Press, print and assert what is claimed above."""
    depths = STEP * np.arange(1, STEPS + 1)
    smooth, rough = (flatten(mu, depths) for mu in (0.0, 0.3))

    end, h = depths[-1], 1e-4
    near = flatten(0.0, (end / 2, end - h, end + h))
    slope = (near["energy"][3] - near["energy"][2]) / (2 * h)
    say(f"force {smooth['force'][-1]:.6f}, derivative of the energy {slope:.6f}")
    assert abs(smooth["force"][-1] / slope - 1) < 1e-5

    work = STEP * (rough["force"][1:] + rough["force"][:-1]).sum() / 2
    taken = rough["energy"][-1] + rough["friction"][-1]
    say(
        f"work of the plate {work:.5f}, stored {rough['energy'][-1]:.5f}, friction {rough['friction'][-1]:.5f}"
    )
    assert abs(work / taken - 1) < 0.01 and rough["friction"][-1] > 0
    assert rough["force"][-1] > smooth["force"][-1]
    return dict(smooth=smooth, rough=rough, depths=np.append(0.0, depths))


def draw(figure, found) -> None:
    """The flattened quarter, mirrored, with reactions; force over displacement."""
    shape, force = figure.subplots(1, 2)
    x, u = found["rough"]["shape"]
    for at, style in ((x, dict(color="#cccccc", s=3)), (x + u, dict(color="#4477aa", s=5))):
        shape.scatter(*np.concatenate((at, at * [-1, 1])).T, **style)
    at, reaction = found["rough"]["touch"]
    height = 1 - found["depths"][-1]
    shape.plot([-1.4, 1.4], [height, height], color="black")
    pressed = reaction > 0
    where = np.concatenate((at[pressed, 0], -at[pressed, 0]))
    shape.vlines(where, height, height + 40 * np.tile(reaction[pressed], 2), color="#ee6677")
    shape.set(aspect="equal", title="friction 0.3")
    for name, label in (("smooth", "no friction"), ("rough", "friction 0.3")):
        force.plot(found["depths"], found[name]["force"], ".-", label=label)
    force.set(xlabel="displacement of the plate", ylabel="force of a quarter")
    force.legend()


if __name__ == "__main__":
    picture(draw, main())
