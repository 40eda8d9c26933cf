# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the paper says of its figures, as questions to the data of a run.

A statement is decided by a number and a bound; both are in the table, for every case and every
variant, so that whoever would draw the line elsewhere can.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from studies.punch.measures import RIM, STILL, hysteresis, nonlinearity, plateau, total, zones
from studies.punch.run import Run

SMALL = 0.05  # what "quasi-linear" and "no noticeable difference" may deviate, relative
ROUNDING = 1e-9  # radii that differ by less, over R, are one
FIRST, LAST = ("first",), ("last",)  # cycle; one about the last is not asked of runs of one cycle


class Statement(NamedTuple):
    """A claim about runs and how it is decided."""

    key: str
    where: str  # paper, section and figure; or the issue's own observation
    text: str
    measure: str
    cases: str  # which cases it is about; several at once if ``together``
    values: Callable  # of a Run or dict of Runs, and a cycle: the number and what else decides; nan: not asked
    holds: Callable  # of these values
    cycles: tuple = FIRST
    together: bool = False


def loaded(run: Run, cycle: int):
    now = zones(run, run.loaded(cycle))
    return now.count, now.central


def unloading(run: Run, cycle: int) -> list:
    """Zones from the loaded state of a cycle to its unloaded one."""
    return [zones(run, step) for step in range(run.loaded(cycle), run.unloaded(cycle) + 1)]


def peripheral(run: Run, cycle: int) -> float:
    before, *steps = (z.peripheral for z in unloading(run, cycle))
    return max(steps) - before


def ends(run: Run) -> list:
    """Zones at the end of every cycle."""
    return [zones(run, run.unloaded(c)) for c in range(1, run.parameters.cycles + 1)]


def stuck(run: Run, cycle: int) -> float:
    first, *_, last = ends(run)
    return last.fraction / first.fraction if first.fraction else np.nan


def pieces(run: Run, cycle: int) -> float:
    first, *_, last = ends(run)
    return last.count - first.count if first.count else np.nan


def breaking(run: Run, cycle: int) -> float:
    within = np.ptp([z.count for z in unloading(run, 1)])
    return float(within - np.ptp([z.count for z in ends(run)]))


def reverse(run: Run, cycle: int):
    inner = np.array([z.inner for z in unloading(run, cycle)[1:]])
    inner = inner[~np.isnan(inner)]
    return (inner[-1] - inner[0], inner[0]) if len(inner) > 1 else np.nan


def curvature(run: Run, cycle: int):
    """Non-linearity of a loading, and of the unloading after it."""
    start, top, end = run.unloaded(cycle - 1), run.loaded(cycle), run.unloaded(cycle)
    return nonlinearity(run, start, top), nonlinearity(run, top, end)


def still(side: int):
    return lambda run, last: min(plateau(run, cycle)[side] for cycle in range(2, last + 1))


def still_elsewhere(run: Run, cycle: int) -> float:
    """Area of the nodes that slip in a cycle but are still at its last loading increment."""
    start, top, end = run.unloaded(cycle - 1), run.loaded(cycle), run.unloaded(cycle)
    slips = [run.fields(k)["slip_increment"] for k in range(start + 1, end + 1)]
    moved = np.linalg.norm(slips, axis=-1)
    most = moved.max(axis=0)
    chosen = (most > STILL * most.max()) & (moved[top - start - 1] < STILL * most)
    return run.area[chosen].sum() / run.area.sum()


def spread(runs: dict[str, Run], cycle: int) -> float:
    works = [total(run, cycle) for run in runs.values()]
    return max(works) / min(works)


def all_work(runs: dict[str, Run]) -> np.ndarray:
    """Work of friction of all cycles by case and node."""
    return np.array([run.dissipation(run.parameters.cycles) for run in runs.values()])


def second_over_first(runs: dict[str, Run], cycle: int) -> float:
    one, other = all_work(runs).sum(axis=1)
    return other / one


def tenfold_area(runs: dict[str, Run], cycle: int) -> float:
    """Area share where the cases' densities of work differ tenfold, in all cycles together.

    Not counted are nodes at which no case reaches a tenth of the mean density of work.
    """
    area, works = next(iter(runs.values())).area, all_work(runs)
    counts = (works / area).max(axis=0) >= 0.1 * works.mean(axis=0).sum() / area.sum()
    tenfold = works.max(axis=0) >= 10 * works.min(axis=0)
    return float(area[counts & tenfold].sum() / area.sum())


FIG3, FIG4, FIG6, FIG7 = ("Section 3, Fig. " + number for number in "3467")
STATEMENTS = [
    Statement("centre", FIG3, "After the first loading, sticking is one zone at the centre.",
        "number of stick zones; one, with the centre", "ABC", loaded, lambda n, central: central and n == 1),
    Statement("peripheral", FIG3, "During the first unloading the periphery (r > 3/4 R) begins to stick.",
        "area fraction of the periphery gained; > 0.1", "ABC", peripheral, lambda gain: gain > 0.1),
    Statement("shrink", FIG3, "From cycle to cycle the stick zones after unloading shrink.",
        "stuck area, last cycle over first; < 0.9", "ABC", stuck, lambda ratio: ratio < 0.9, LAST),
    Statement("fragment", FIG3, "From cycle to cycle they break into more pieces.",
        "pieces after the last unloading less those after the first; > 0", "ABC", pieces, lambda n: n > 0, LAST),
    Statement("reverse", FIG3, "Reverse slip begins at the rim and advances inwards ({} unloading).",
        "change of its innermost radius / R; begins beyond 3/4, < 0", "ABC", reverse,
        lambda change, begin: begin > RIM and change < -ROUNDING, FIRST + LAST),
    Statement("A_closed", FIG4, "Isotropic: loading and unloading show no noticeable difference in the force-slip "
        "curve of P ({} cycle).", "difference in slip / range; <= 0.05", "A", hysteresis, lambda d: d <= SMALL, LAST),
    Statement("BC", FIG4, "Anisotropic: loading is quasi-linear, unloading is not ({} cycle).",
        "non-linearity of loading; <= 0.05 < that of unloading", "BC", curvature,
        lambda up, down: up <= SMALL < down, FIRST + LAST),
    Statement("plateau", FIG6, "From the second cycle on P is still at the end of loading, before the peak.",
        "part of loading before the peak; > 0", "ABC", still(0), lambda part: part > 0, LAST),
    Statement("plateau_elsewhere", FIG6, "There are other choices of P for which it is so ({} cycle).",
        "share of the area that slips in the cycle but is still before the peak; > 0.05",
        "ABC", still_elsewhere, lambda share: share > SMALL, LAST),
    Statement("A_linear", FIG7, "Isotropic: the force-slip curve is quasi-linear (loading of the {} cycle).",
        "non-linearity of loading; <= 0.05", "A", curvature, lambda up, down: up <= SMALL, LAST),
    Statement("wear", "Sections 3, 4", "Anisotropy has a strong influence on wear: B dissipates more than A by a "
        "fifth or more.", "all work of B over that of A; > 1.2", "AB", second_over_first,
        lambda ratio: ratio > 1.2, together=True),
    Statement("nonassociated", "Section 4", "The slip rule alone has a strong influence: C dissipates more than B by a "
        "fifth or more.", "all work of C over that of B; > 1.2", "BC", second_over_first,
        lambda ratio: ratio > 1.2, together=True),
    Statement("within", "observed", "Stick zones break up within one unloading more than from cycle to cycle.",
        "range of the pieces' number, within first less between; > 0", "ABC", breaking, lambda more: more > 0, LAST),
    Statement("after", "observed", "From the second cycle on P is still after the peak.",
        "part of unloading after the peak; > 0", "ABC", still(1), lambda part: part > 0, LAST),
    Statement("spread", "observed", "The cases dissipate alike within 30 % or so ({} cycle).",
        "largest over smallest work; <= 1.35", "ABC", spread, lambda ratio: ratio <= 1.35, FIRST + LAST, True),
    Statement("local", "observed", "Locally the cases differ tenfold.", "share of the area where the work differs "
        "tenfold; > 0.05", "ABC", tenfold_area, lambda share: share > SMALL, together=True),
]  # fmt: skip
STATEMENTS = [
    s._replace(key=s.key if s.cycles == (cycle,) else f"{s.key}_{cycle}", text=s.text.format(cycle), cycles=(cycle,))
    for s in STATEMENTS for cycle in s.cycles
]  # fmt: skip


def ask(runs: dict[str, dict[str, Run]]) -> list[dict]:
    """All statements asked of all runs: rows with statement, variant, case, value and holds."""
    rows = []
    for statement in STATEMENTS:
        for variant, cases in runs.items():
            asked = {case: cases[case] for case in statement.cases if case in cases}
            last = min((run.parameters.cycles for run in asked.values()), default=0)
            cycle = 1 if statement.cycles == FIRST else last
            if statement.together:
                asked = {"+".join(asked): asked} if len(asked) == len(statement.cases) else {}
            for case, subject in asked.items() if last > 1 or statement.cycles == FIRST else ():
                values = np.atleast_1d(statement.values(subject, cycle)).tolist()
                if not np.isnan(values[0]):
                    rows.append(dict(statement=statement.key, variant=variant, case=case,
                                     value=float(values[0]), holds=int(statement.holds(*values))))  # fmt: skip
    return rows
