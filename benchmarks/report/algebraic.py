# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Work and precision of the solvers: error against processor seconds along the iterations of a step."""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path
from time import process_time

import numpy as np
from matplotlib.ticker import LogLocator

import dolfinx_contact as dc
from benchmarks.measurement import SOLVERS, Measurement, ladder, mesh_of
from benchmarks.report.drawing import legend, panels, style
from benchmarks.stress.scenes import PROGRAMMES, C
from dolfinx_contact.extend import Solver
from mechanics.scenes import build, problem_of
from studies.punch import CASES, Parameters, Punch, programme

TITLE = "Work and precision, algebraic"
CAPTION = "Error against the time of one step, set-up left out; the line is the tolerance."
# Scenes of the stress matrix that are far from the punch: what they are, and which step is looked at.
EXTREMES = {
    "p ratio 1000 crossed": (dict(mu=(1.0, 0.1), p=(1e-3, 1.0)), "reversals", 3),
    "nu 0.49999 opening": (dict(nu=0.49999, **C), "into the air", 4),
    "spring 1e-6": (dict(spring=1e-6, **C), "rocking", 2),
}
TOL = 1e-8  # what the seconds of the table are for
SECONDS = ("least", "seconds", "largest")  # of the repetitions; in the middle the median
DEEP = 1e-12  # where the curves end


def plan(size: str) -> list[Measurement]:
    settings = dict(repeat=3 if size == "full" else 2, mesh=mesh_of(size))
    names = ["A", "B", "C", *EXTREMES] if size != "smallest" else ["C"]
    return [
        Measurement(f"algebraic/{name}", "benchmarks.report.algebraic:scene", dict(name=name, **settings))
        for name in names
    ]  # fmt: skip


def opened(name: str, solver, tol: float, mesh: dict):
    """A problem, a function that moves what is prescribed, and its load steps."""
    if name in CASES:
        punch = Punch(Parameters(case=name, tol=tol), solver=solver, **mesh)
        return punch.problem, punch.move_top, programme(punch.parameters)
    body, of, _ = EXTREMES[name]
    built = build(**body)
    return problem_of(built, solver, tol), built.move_top, PROGRAMMES[of]


class Sampled(Solver):
    """A solver whose every residual is noted: seconds since its start, and the error."""

    def __init__(self, solver):
        self.solver, self.samples = solver, []

    def bind(self, step):
        self._bound = self.solver.bind(step)
        return self

    def update(self, step):
        self._bound.update(step)

    def close(self):
        self._bound.close()

    def tell(self, error, _):
        self.samples.append((process_time() - self._start, error))

    def solve(self, step, starts):
        self.samples, self._start = [], process_time()
        found = self._bound.solve(step.replaced(monitor=self), starts)
        self.seconds = process_time() - self._start
        return found


def scene(name: str, repeat: int, mesh: dict) -> dict:
    """One step of a programme with every solver, again and again, interleaved."""
    watched = 6 if name in CASES else EXTREMES[name][2]  # the punch's first reversal
    problems, curves = {}, {solver: [] for solver in SOLVERS}
    with tempfile.TemporaryDirectory() as directory:
        before = Path(directory) / "before.npz"
        problem, move, steps = opened(name, None, 1e-11, mesh)
        for step in steps[: watched - 1]:
            move(step)
            problem.solve()
        problem.save(before)
        for solver, make in SOLVERS.items():
            problem, move, _ = opened(name, Sampled(make()), DEEP, mesh)
            problem.load(before)
            move(steps[watched - 1])
            with contextlib.suppress(dc.NotConverged):
                problem.solve()  # set-up, which is not measured here
            problems[solver] = problem
        for _ in range(repeat):
            for solver, problem in problems.items():
                curves[solver].append(curve(problem, before))
    return dict(
        watched=watched, unknowns=problem.body.size, nodes=len(problem.contacts[0].nodes),
        curves={solver: merged(found) for solver, found in curves.items()},
    )  # fmt: skip


def curve(problem, before) -> list[tuple[float, float]]:
    """Seconds and error of one step: samples on the way, or one solve for each tolerance.

    The condensed solver does its iterations in the kernel, where no error of the whole body is known.
    """
    condensed, answers = isinstance(problem.solver.solver, dc.CondensedNewton), []
    for tol in ladder(1, 12) if condensed else [DEEP]:
        problem.load(before)
        problem.tol = tol
        with contextlib.suppress(dc.NotConverged):
            step = problem.solve()
            answers.append((problem.solver.seconds, max(step.error, step.slip_error)))
    return answers if condensed else problem.solver.samples


def merged(curves: list) -> dict:
    """Smallest error so far, with the median and the spread of the seconds to it."""
    length = min(map(len, curves))
    seconds = np.array([[seconds for seconds, _ in curve[:length]] for curve in curves])
    error = np.array([error for _, error in curves[0][:length]])
    kept = error <= np.minimum.accumulate(error)
    quantiles = np.quantile(np.maximum.accumulate(seconds, axis=1)[:, kept], [0, 0.5, 1], axis=0)
    spread = dict(zip(SECONDS, quantiles.tolist()))
    return dict(**spread, error=error[kept].tolist(), iterations=length, repetitions=len(curves))


def evaluate(results: dict) -> dict:
    return dict(rows=[dict(result, scene=name.split("/")[1]) for name, result in results.items()])


def figure(data):
    rows = data["rows"]
    figure, axes = panels(len(rows))
    for ax, row in zip(axes, rows):
        for solver, curve in row["curves"].items():
            least, seconds, largest = 1e3 * np.array([curve[key] for key in SECONDS])
            error, colour = np.maximum(curve["error"], 1e-16), style(solver)["color"]
            ax.plot(seconds, error, markevery=max(1, len(error) // 25), **style(solver))
            ax.fill_betweenx(error, least, largest, color=colour, alpha=0.2, lw=0)
        ax.axhline(TOL, color="0.6", lw=1)
        ax.set(xscale="log", yscale="log", xlabel="processor time of the step [ms]", ylabel="error")
        ax.yaxis.set_major_locator(LogLocator(numticks=8))
        title = f"{row['scene']}: step {row['watched']}, {row['unknowns']} unknowns"
        ax.set_title(title, fontsize=11)
    legend(figure, axes[0])
    return figure


def tables(data):
    yield [
        {
            "scene": row["scene"], "solver": solver, "smallest error": min(curve["error"], default=None),
            "seconds to 1e-8": min((s for s, e in zip(curve["seconds"], curve["error"]) if e <= TOL), default=None),
        }
        for row in data["rows"] for solver, curve in row["curves"].items()
    ]  # fmt: skip
