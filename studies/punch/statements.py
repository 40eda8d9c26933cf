"""What the paper says of its figures, as questions to the data of a run.

A statement is decided by a number and a bound; both are in the table, for every case and every
variant, so that whoever would draw the line elsewhere can.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from studies.punch.measures import (
    RIM,
    STILL,
    hysteresis,
    loading_nonlinearity,
    plateau,
    total,
    unloading,
    unloading_nonlinearity,
    zones,
)
from studies.punch.run import Run

SMALL = 0.05  # what "quasi-linear" and "no noticeable difference" may deviate, relative
ROUNDING = 1e-9  # radii that differ by less, over R, are one
NOT_ASKED = np.nan, None  # of runs without anything to compare


class Statement(NamedTuple):
    """A claim about runs and how it is decided."""

    key: str
    where: str  # paper, section and figure; or the issue's own observation
    text: str
    measure: str
    cases: str  # which cases it is about; several at once if ``together``
    decide: Callable  # Run, or dict of Runs by case -> value, whether it holds
    cycles: int = 1  # that a run must have to be asked
    together: bool = False


def _over(bound, measure):
    """Decided by ``measure``: holds above the bound; not asked where it is None."""
    return lambda runs: NOT_ASKED if (value := measure(runs)) is None else (value, value > bound)


def _most(bound, measure):
    """As ``_over``, but holds up to the bound."""
    return lambda runs: NOT_ASKED if (value := measure(runs)) is None else (value, value <= bound)


def _centre(run):
    now = zones(run, run.loaded(1))
    return now.count, now.central and now.count == 1


def _peripheral(run):
    steps = unloading(run, 1)
    return max(z.peripheral for z in steps[1:]) - steps[0].peripheral


def _ends(run) -> list:
    """Zones at the end of every cycle."""
    return [zones(run, run.unloaded(c)) for c in range(1, run.parameters.cycles + 1)]


def _shrink(run):
    first, last = (_ends(run)[k].fraction for k in (0, -1))
    return (last / first, last < 0.9 * first) if first else NOT_ASKED


def _fragment(run):
    first, last = (_ends(run)[k].count for k in (0, -1))
    return last - first if first else None


def _within(run):
    return float(np.ptp([z.count for z in unloading(run, 1)]) - np.ptp([z.count for z in _ends(run)]))  # fmt: skip


def _reverse(cycle):
    def decide(run):
        inner = np.array([z.inner for z in unloading(run, cycle(run))[1:]])
        inner = inner[~np.isnan(inner)]
        if len(inner) < 2:
            return NOT_ASKED
        return inner[-1] - inner[0], inner[0] > RIM and inner[-1] < inner[0] - ROUNDING

    return decide


def _asymmetric(cycle):
    def decide(run):
        up, down = loading_nonlinearity(run, cycle(run)), unloading_nonlinearity(run, cycle(run))
        return up, up <= SMALL < down

    return decide


def _plateau(side):
    return lambda run: min(plateau(run, c)[side] for c in range(2, run.parameters.cycles + 1))


def _plateau_elsewhere(run):
    """Area of the nodes that slip in the last cycle but are still at its last loading increment."""
    n = run.parameters.cycles
    start, top, end = run.unloaded(n - 1), run.loaded(n), run.unloaded(n)
    slips = [run.fields(k)["slip_increment"] for k in range(start + 1, end + 1)]
    moved = np.linalg.norm(slips, axis=-1)
    most = moved.max(axis=0)
    chosen = (most > STILL * most.max()) & (moved[top - start - 1] < STILL * most)
    return run.area[chosen].sum() / run.area.sum()


def _spread(cycle):
    def ratio(runs):
        works = [total(run, cycle(run)) for run in runs.values()]
        return max(works) / min(works)

    return ratio


def _against(a, b):
    def ratio(runs):
        works = [runs[case].dissipation(runs[case].parameters.cycles).sum() for case in (a, b)]
        return works[1] / works[0]

    return ratio


def tenfold_area(runs) -> float:
    """Area share where the cases' densities of work differ tenfold, in all cycles together.

    Not counted are nodes at which no case reaches a tenth of the mean density of work.
    """
    area = next(iter(runs.values())).area
    works = np.array([run.dissipation(run.parameters.cycles) for run in runs.values()])
    counts = (works / area).max(axis=0) >= 0.1 * works.mean(axis=0).sum() / area.sum()
    tenfold = works.max(axis=0) >= 10 * works.min(axis=0)
    return float(area[counts & tenfold].sum() / area.sum())


def first(run) -> int:
    return 1


def last(run) -> int:
    return run.parameters.cycles


S, F = "Section 3, ", "Fig. {}".format
STATEMENTS = [
    Statement("centre", S + F(3), "After the first loading, sticking is one zone at the centre.",
        "number of stick zones; one, with the centre", "ABC", _centre),
    Statement("peripheral", S + F(3), "During the first unloading the periphery (r > 3/4 R) "
        "begins to stick.", "area fraction of the periphery gained; > 0.1", "ABC", _over(0.1, _peripheral)),
    Statement("shrink", S + F(3), "From cycle to cycle the stick zones after unloading shrink.",
        "stuck area, last cycle over first; < 0.9", "ABC", _shrink, 2),
    Statement("fragment", S + F(3), "From cycle to cycle they break into more pieces.",
        "pieces after the last unloading less those after the first; > 0", "ABC", _over(0, _fragment), 2),
    Statement("reverse1", S + F(3), "Reverse slip begins at the rim and advances inwards "
        "(first unloading).", "change of its innermost radius / R; begins beyond 3/4, < 0",
        "ABC", _reverse(first)),
    Statement("reverseN", S + F(3), "Reverse slip begins at the rim and advances inwards "
        "(last unloading).", "the same", "ABC", _reverse(last), 2),
    Statement("A_closed", S + F(4), "Isotropic: loading and unloading show no noticeable difference "
        "in the force-slip curve of P (last cycle).", "difference in slip / range; <= 0.05",
        "A", _most(SMALL, lambda run: hysteresis(run, last(run))), 2),
    Statement("BC_first", S + F(4), "Anisotropic: loading is quasi-linear, unloading is not "
        "(first cycle).", "non-linearity of loading; <= 0.05 < that of unloading", "BC",
        _asymmetric(first)),
    Statement("BC_last", S + F(4), "Anisotropic: loading is quasi-linear, unloading is not "
        "(last cycle).", "the same", "BC", _asymmetric(last), 2),
    Statement("plateau", S + F(6), "From the second cycle on P is still at the end of loading, before "
        "the peak.", "part of loading before the peak; > 0", "ABC", _over(0, _plateau(0)), 2),
    Statement("plateau_elsewhere", S + F(6), "There are other choices of P for which it is so (last "
        "cycle).", "share of the area that slips in the cycle but is still before the peak; > 0.05",
        "ABC", _over(SMALL, _plateau_elsewhere), 2),
    Statement("A_linear", S + F(7), "Isotropic: the force-slip curve is quasi-linear (loading of the "
        "last cycle).", "non-linearity of loading; <= 0.05", "A",
        _most(SMALL, lambda run: loading_nonlinearity(run, last(run))), 2),
    Statement("wear", "Sections 3, 4", "Anisotropy has a strong influence on wear: B dissipates more "
        "than A by a fifth or more.", "all work of B over that of A; > 1.2", "AB",
        _over(1.2, _against("A", "B")), together=True),
    Statement("nonassociated", "Section 4", "The slip rule alone has a strong influence: C dissipates "
        "more than B by a fifth or more.", "all work of C over that of B; > 1.2", "BC",
        _over(1.2, _against("B", "C")), together=True),
    Statement("within", "observed", "Stick zones break up within one unloading more than from cycle to "
        "cycle.", "range of the pieces' number, within first less between; > 0", "ABC", _over(0, _within), 2),
    Statement("after", "observed", "From the second cycle on P is still after the peak.",
        "part of unloading after the peak; > 0", "ABC", _over(0, _plateau(1)), 2),
    Statement("A_unlinear", "observed", "Even the isotropic force-slip curve is not quasi-linear (last "
        "cycle).", "non-linearity of loading; > 0.05", "A",
        _over(SMALL, lambda run: loading_nonlinearity(run, last(run))), 2),
    Statement("spread1", "observed", "The cases dissipate alike within 30 % or so (first cycle).",
        "largest over smallest work; <= 1.35", "ABC", _most(1.35, _spread(first)), together=True),
    Statement("spreadN", "observed", "The cases dissipate alike within 30 % or so (last cycle).",
        "the same", "ABC", _most(1.35, _spread(last)), 2, True),
    Statement("local", "observed", "Locally the cases differ tenfold.", "share of the area where "
        "the work differs tenfold; > 0.05", "ABC", _over(SMALL, tenfold_area), together=True),
]  # fmt: skip


def ask(runs: dict[str, dict[str, Run]]) -> list[dict]:
    """All statements asked of all runs: rows with statement, variant, case, value and holds."""
    rows = []
    for statement in STATEMENTS:
        for variant, cases in runs.items():
            wanted = {case: cases[case] for case in statement.cases if case in cases}
            if statement.together:
                asked = {"+".join(wanted): wanted} if len(wanted) == len(statement.cases) else {}
            else:
                asked = wanted
            for case, subject in asked.items():
                if min(run.parameters.cycles for run in wanted.values()) < statement.cycles:
                    continue
                value, holds = statement.decide(subject)
                if holds is not None:
                    rows.append(dict(statement=statement.key, variant=variant, case=case,
                                     value=float(value), holds=int(holds)))  # fmt: skip
    return rows
