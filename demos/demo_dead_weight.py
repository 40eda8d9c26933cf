# %% [markdown]
# # Fretting under dead weight: the loop of force and slip
#
# The cylinder of `demo_partial_slip.py`, loaded as in a test rig: a weight presses the plane on the cylinder, a force
# pushes it to and fro. Neither motion is prescribed; `plane.displacement` holds what a step has found.
#
# ## Notation
#
# As in the demo of partial slip: $P$ weight, $Q$ tangential force, both per length of the cylinder, $a$ half width of the
# contact, $c$ of its sticking part, $E^*$ modulus; $\delta$ motion of the plane, $s$ the part of it that is due to slip,
# $F = \mu P$, $Q_1 < F$ amplitude, $D$ dissipation of a cycle. Units: mm, N, MPa.
#
# ## Strong form and closed form
#
# The plane is free along both of its directions, and in equilibrium:
#
# $$ \sum_{\text{contact nodes}} r = (Q, P). $$
#
# The tractions of Cattaneo and Mindlin are two semi-ellipses, of half widths $a$ and $c = a \sqrt{1 - Q/F}$. A semi-ellipse
# of the force $Q$ moves the middle of a half plane by $\frac{2 Q}{\pi E^*} (\ln\frac{2L}{a} + \frac12)$, where the
# length $L$ belongs to the body [K. L. Johnson, Contact Mechanics, 1985, Section 5.4]. The difference of the two is
#
# $$ \delta = C Q + s(Q), \qquad C = \frac{2}{\pi E^*} \ln\frac{2L}{a}, \qquad
#    s(Q) = \frac{1}{\pi E^*} \left[ Q + (F - Q) \ln\left(1 - \frac{Q}{F}\right) \right], $$
#
# an elastic compliance $C$ of the body, and slip, which does not depend on the body's size. When $Q$ falls again from $Q_1$
# the same happens with twice the force [R. D. Mindlin, H. Deresiewicz 1953]: $\delta = \delta(Q_1) - 2\,
# \delta(\frac{Q_1 - Q}{2})$. A cycle between $-Q_1$ and $Q_1$ encloses
#
# $$ D = 4 Q_1 s(Q_1) - 8 \int_0^{Q_1} s \,\mathrm{d}Q . $$
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \sum_{\text{contact nodes}} r \cdot v. $$
#
# ## Code
#
# Two lines let force drive the plane: `plane.free` names its free directions, `plane.force` is the force of
# the plane on the body.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from demo_partial_slip import E_STAR, MU, NU, A, E, R, cylinder
from helpers import picture, say

WEIGHT = np.pi * E_STAR * (1.3 * A) ** 2 / (4 * R)  # half width 1.3 A
LIMIT = MU * WEIGHT
AMPLITUDE = 0.8  # of what friction carries


def slip(part):
    """s of Q = part F."""
    rest = 1 - part
    return LIMIT / (np.pi * E_STAR) * (part + rest * np.log(rest))


def enclosed(part: float) -> float:
    """D of a cycle with the amplitude part F."""
    rest = 1 - part
    integral = part**2 / 2 - 1 / 4 + rest**2 / 4 - rest**2 / 2 * np.log(rest)
    return 4 * part * LIMIT * slip(part) - 8 * LIMIT**2 / (np.pi * E_STAR) * integral


def loop(quarter: int, cells: int = 64):
    """Press, push, and go once round; force over F and motion from Q_1 on, and the dissipation of the cycle."""
    problem, _ = cylinder(E, NU, cells=cells)
    contact = problem.contacts[0]
    plane = contact.surface
    plane.free = ("t", "n")
    history = dc.History(problem)
    to_and_fro = AMPLITUDE * np.interp(
        np.arange(5 * quarter + 1) / quarter, [0, 1, 3, 5], [0, 1, -1, 1]
    )
    for part in to_and_fro:
        plane.force = (part * LIMIT, WEIGHT)
        history.record(problem.solve(), part=float(part))
        assert np.allclose(contact.force(), plane.force, rtol=1e-8, atol=1e-8 * WEIGHT)
    part, moved, work = (
        history.column(name) for name in ("part", "contact0_plane_x", "contact0_dissipation")
    )
    return part[quarter:], moved[quarter:] - moved[0], work[-1] - work[quarter]


# %% [markdown]
# ## Result
#
# 1. The force of the plane on the body is the given one after every step, to $10^{-8}$ of the weight.
# 2. From $Q_1$ down to $-Q_1$ and up again the plane returns to its position, to 0.1 % of the range.
# 3. The width of the loop, $\delta$ on the way down minus that on the way up at the same $Q$, in which the compliance $C$
#    drops out, is that of the closed form, $2 s(Q_1) - 2 s(\frac{Q_1 - Q}{2}) - 2 s(\frac{Q_1 + Q}{2})$, to 1.5 % of its
#    largest value.
# 4. Frictional work of the cycle is $D$ to 0.5 %.


# %%
def width(part: np.ndarray) -> np.ndarray:
    """Of the loop at Q = part F."""
    return 2 * (slip(AMPLITUDE) - slip((AMPLITUDE - part) / 2) - slip((AMPLITUDE + part) / 2))


def main():
    """Go round; print and assert what is claimed above; force, motion and the closed form's."""
    quarter = 8
    part, moved, work = loop(quarter)
    down, up = moved[: 2 * quarter + 1], moved[: 2 * quarter - 1 : -1]
    assert (part[: 2 * quarter + 1] == part[: 2 * quarter - 1 : -1]).all()
    closure = abs(moved[-1] - moved[0]) / np.ptp(moved)
    found, expected = down - up, width(part[: 2 * quarter + 1])
    off = np.abs(found - expected).max() / expected.max()
    dissipation = work / enclosed(AMPLITUDE) - 1
    say(f"loop closed to {closure:.1e} of its range; width {found.max():.4e} mm, closed form {expected.max():.4e}, off by "
        f"{off:.4f}; dissipation {work:.4e} N, closed form {enclosed(AMPLITUDE):.4e}")  # fmt: skip
    assert closure < 1e-3 and off < 0.015 and abs(dissipation) < 0.005
    return part * LIMIT, moved, np.concatenate((expected, -expected[1:])) / 2


def draw(figure, force, moved, half) -> None:
    """The loop, found and in closed form; the elastic part is that of the chord between its ends."""
    axes, n = figure.subplots(), len(force) // 2
    chord = np.interp(force, force[[n, 0]], moved[[n, 0]])
    axes.plot(1e6 * (chord + half), force, color="#d55e00", label="Mindlin, Cattaneo")
    axes.plot(1e6 * moved, force, ".", color="#0072b2", label="found")
    axes.set(xlabel="motion of the plane, nm", ylabel="force on the cylinder, N per mm")
    axes.legend()


if __name__ == "__main__":
    picture(draw, *main())
