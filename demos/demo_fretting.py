# %% [markdown]
# # Fretting: cyclic partial slip that wears
#
# The cylinder of `demo_partial_slip.py`, now of an ordinary material, stands on a plane that moves to and fro by a
# prescribed stroke, too small for gross slip. Where it slips it wears, worn depth opens the gap, and the
# pressure moves to where it sticks.
#
# ## Notation
#
# As in the demo of partial slip; $s$ displacement of the plane, $w$ worn depth, $k$ wear coefficient, volume per work
# (one over stress), $D$ dissipation. Units: mm, N, MPa, per millimetre of the cylinder.
#
# ## Strong form
#
# $$ -\operatorname{div} \sigma(u) = 0, \qquad x_n = \frac{x^2}{2R} + u_n + w \ge 0, \quad p \ge 0, \quad x_n\, p = 0,
#    \quad |q| \le \mu p, \qquad \dot w = -k\, q\, \dot u_t , $$
#
# the last being Archard's law with $k = K / \mu H$. `dc.Wear(k, explicit=True)` applies it after every step: the depth that a step
# wears opens the gap of the next, and the volume is $k D$. The load is kept: after every step the approach of the far
# boundary is corrected by the missing part of $P$ over the stiffness of the contact.
#
# ## What must hold
#
# No closed form, but balances. Worn volume is $k D$. Over a cycle that repeats itself elastic energy does not change,
# so the plane's work $\oint Q \,\mathrm{d}s$, a quantity of the whole body, is the dissipation, a sum over slipping
# nodes. Where nothing slips nothing wears, and there the pressure has to grow, since the load stays.
#
# ## Weak form
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v) \,\mathrm{d}x = \sum_{\text{contact nodes}} r \cdot v. $$
#
# ## Code
#
# A cycle is middle, right, left, middle. `dc.History` keeps a row for each step.

# %%
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from demo_partial_slip import A, R, cylinder
from helpers import along_face, picture, say

YOUNG, POISSON = 1000.0, 0.3
COEFFICIENT = 30.0  # 1/MPa: far above a real one, so that few cycles show what wear does
APPROACH = 3.0 * A**2 / (2 * R)
STROKE = 0.6 * A**2 / (2 * R)  # amplitude, mm
QUARTER = 2  # steps from the middle to the end of a stroke


def fret(cycles: int, wear: dc.Wear | None, quarter: int = QUARTER):
    """Press, then move the plane to and fro; the history, the load, and profiles before and after each cycle."""
    problem, held = cylinder(YOUNG, POISSON, wear)
    contact = problem.contacts[0]

    def press(approach: float) -> float:
        held.value[1] = -approach
        problem.solve()
        return contact.force()[1]

    low, load = press(0.98 * APPROACH), press(APPROACH)
    stiffness = (load - low) / (0.02 * APPROACH)
    history = dc.History(problem)
    profiles = [profile(contact)]
    ramp = np.arange(1, 4 * quarter + 1) / quarter
    positions = STROKE * np.interp(ramp, [0, 1, 3, 4], [0, 1, -1, 0])
    for cycle in range(1, cycles + 1):
        for position in positions:
            contact.surface.displacement = np.array([position, 0.0])
            history.record(problem.solve(), cycle=cycle, position=float(position))
            if wear is not None:
                held.value[1] -= (load - contact.force()[1]) / stiffness
        profiles.append(profile(contact))
    return history, load, profiles


def profile(contact: dc.Contact) -> dict[str, np.ndarray]:
    """Positions, pressure, slip path and worn depth along the face."""
    pressure = contact.reaction[:, 1] / contact.area
    names = ("x", "pressure", "slip_path", "depth")
    arrays = along_face(contact, pressure, contact.slip_path, contact.wear_depth)
    return dict(zip(names, arrays))


# %% [markdown]
# ## Result
#
# Without wear the second and the third cycle are the same: this is shakedown into a steady loop. There,
# $\oint Q \,\mathrm{d}s = D$ as steps become small. $Q$ is known only at the ends of steps, and reverses within one:
# the trapezoidal rule for $\oint Q \,\mathrm{d}s$ is 5.6 % too small with two steps a quarter, 1.5 % with four. $D$, the
# sum of $\frac12 (P_0 + P_1) \mu |\Delta u_t|$ over nodes and steps, changes by less than 0.1 % between the two.
#
# With wear, over four cycles:
#
# 1. worn volume is $k D$, to rounding, after every step, and the load stays within 1 %;
# 2. from the third cycle on some nodes in the middle do not slip, and these do not wear at all;
# 3. pressure in the middle grows, where most is worn it falls, and the contact becomes wider.


# %%
def main() -> list[dict]:
    """Fret without and with wear; print and assert what is claimed above; the profiles with wear."""
    found, lacking = [], []
    for quarter in (QUARTER, 2 * QUARTER):
        steps = 4 * quarter
        history, _, _ = fret(3, None, quarter)
        force, position = history.column("contact0_force_x"), history.column("position")
        dissipated = history.column("contact0_dissipation")[steps - 1 :: steps]
        work = np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(position))[steps - 2 :: steps]
        second, third = np.diff(dissipated)
        loop = np.diff(work)[-1]
        found.append(third)
        lacking.append(1 - loop / third)
        say(f"without wear, {quarter} steps a quarter: dissipation {second:.4e}, {third:.4e} N a cycle, "
            f"work of the plane {loop:.4e}")  # fmt: skip
        assert abs(third / second - 1) < 1e-6
    assert abs(found[1] / found[0] - 1) < 1e-3
    assert 0 < 3 * lacking[1] < lacking[0] < 0.06  # towards a quarter

    history, load, profiles = fret(4, dc.Wear(COEFFICIENT, explicit=True))
    dissipated = history.column("contact0_dissipation")
    volume = history.column("contact0_worn_volume")
    assert (np.abs(volume / (COEFFICIENT * dissipated) - 1) < 1e-12).all()
    assert (np.abs(history.column("contact0_force_y") / load - 1) < 0.01).all()

    new, worn = profiles[0], profiles[-1]
    for earlier, later in zip(profiles[2:], profiles[3:]):
        slip, wear = (later[name] - earlier[name] for name in ("slip_path", "depth"))
        core = (later["pressure"] > 0) & (slip < 1e-9 * slip.max())
        assert core.sum() >= 5 and np.abs(wear[core]).max() < 1e-9 * wear.max()
    middle, deepest = np.abs(new["x"]).argmin(), worn["depth"].argmax()
    assert core[middle] and not core[deepest]
    change = [worn["pressure"][node] / new["pressure"][node] - 1 for node in (middle, deepest)]
    touching = [np.count_nonzero(profile["pressure"]) for profile in (new, worn)]
    say(f"with wear: deepest {worn['depth'].max():.2e} mm, load {load:.4f} N, pressure "
        f"{change[0]:+.1%} in the middle, {change[1]:+.1%} where it is deepest; "
        f"{touching[0]} nodes touch at first, {touching[1]} at last")  # fmt: skip
    assert change[0] > 0.05 and change[1] < -0.3 and touching[1] > touching[0]
    return profiles


def draw(figure, profiles) -> None:
    """Pressure and worn depth along the face, before and after each cycle."""
    above, below = figure.subplots(2, 1, sharex=True)
    for cycle, now in enumerate(profiles):
        style = dict(color=str(0.8 - 0.2 * cycle), label=f"after {cycle} cycles")
        above.plot(now["x"], now["pressure"], ".-", **style)
        below.plot(now["x"], now["depth"], ".-", **style)
    above.set(ylabel="pressure [MPa]")
    below.set(xlabel="x [mm]", ylabel="worn depth [mm]")
    above.legend()


if __name__ == "__main__":
    picture(draw, main())
