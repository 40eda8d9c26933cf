# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Work and precision of the solvers: error against processor seconds along the iterations of a step."""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import process_time

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from matplotlib.ticker import LogLocator

from benchmarks.measurement import Measurement, ladder
from benchmarks.report.drawing import legend, panels, style
from benchmarks.stress.scenes import PROGRAMMES, C
from mechanics.scenes import build
from studies.punch import CASES, Parameters, Punch, programme

TITLE = "Work and precision, algebraic"
SOLVERS = {
    "condensed Newton": dc.CondensedNewton,
    "fixed point, return": dc.FixedPoint,
    "fixed point, bipotential": lambda: dc.FixedPoint(map="bipotential"),
}
# Scenes of the stress matrix that are far from the punch: what they are, and which step is looked at.
EXTREMES = {
    "p ratio 1000 crossed": (dict(mu=(1.0, 0.1), p=(1e-3, 1.0)), "reversals", 3),
    "nu 0.49999 opening": (dict(nu=0.49999, **C), "into the air", 4),
    "spring 1e-6": (dict(spring=1e-6, **C), "rocking", 2),
}
TOL = 1e-8  # what the seconds of the table are for
DEEP = 1e-12  # where the curves end


def plan(size: str) -> list[Measurement]:
    mesh = dict(full={}, quick={}, smallest=dict(divisions=2, layers=2))[size]
    repeat = dict(full=3, quick=2, smallest=2)[size]
    scenes = ["A", "B", "C", *EXTREMES] if size != "smallest" else ["C"]
    settings = dict(repeat=repeat, mesh=mesh)
    return [
        Measurement(f"algebraic/{name}".replace(" ", "_"), "benchmarks.report.algebraic:scene", dict(name=name, **settings))
        for name in scenes
    ]  # fmt: skip


def opened(name: str, solver, tol: float, mesh: dict):
    """A problem and its load steps: functions that move what is prescribed."""
    if name in CASES:
        punch = Punch(Parameters(case=name, tol=tol), **mesh)
        if solver is not None:
            punch.problem.solver = solver

        def move(displacement):
            punch.approach.value = -displacement

        return punch.problem, move, programme(punch.parameters)
    body, of, _ = EXTREMES[name]
    built = build(**body)
    problem = dc.ContactProblem(
        built.F, built.u, [built.contact], bcs=built.bcs, solver=solver, tol=tol
    )
    return problem, built.move_top, PROGRAMMES[of]


class Sampled:
    """A solver whose every residual is noted: seconds since its start, and the error."""

    def __init__(self, solver):
        self.solver, self.samples = solver, []

    def bind(self, *arguments):
        self._bound = self.solver.bind(*arguments)
        return self

    def destroy(self):
        self._bound.destroy()

    def solve(self, step):
        residual, samples, start = step.residual, [], process_time()

        def noted(x, maps):
            found = residual(x, maps)
            samples.append((process_time() - start, found[1].largest))
            return found

        step.residual, self.samples = noted, samples
        try:
            return self._bound.solve(step)
        finally:
            self.seconds = process_time() - start
            del step.residual


def scene(name: str, repeat: int, mesh: dict) -> dict:
    """One step of a programme with every solver, again and again, interleaved."""
    watched = 6 if name in CASES else EXTREMES[name][2]  # the punch's first reversal
    curves = {label: [] for label in SOLVERS}
    problems = {}
    with tempfile.TemporaryDirectory() as directory:
        before = Path(directory) / "before.npz"
        problem, move, steps = opened(name, None, 1e-11, mesh)
        for step in steps[: watched - 1]:
            move(step)
            problem.solve()
        problem.save(before)
        for label, make in SOLVERS.items():
            problems[label] = opened(name, Sampled(make()), DEEP, mesh)[:2]
            problems[label][0].load(before)
            problems[label][1](steps[watched - 1])
            attempt(problems[label][0])  # set-up, which is not measured here
        for _ in range(repeat):
            for label, (problem, _) in problems.items():
                curves[label].append(curve(problem, before))
    return dict(
        watched=watched, unknowns=problem.body.size, nodes=len(problem.contacts[0].nodes),
        curves={label: merged(found) for label, found in curves.items()},
    )  # fmt: skip


def attempt(problem):
    """The record of a step, and what was said if it was refused."""
    try:
        return problem.solve(), ""
    except dc.NotConverged as failure:
        return failure.step, str(failure)[:200]


def curve(problem, before) -> list[tuple[float, float]]:
    """Seconds and error of one step: samples on the way, or one solve for each tolerance.

    The condensed solver does its iterations in the kernel, where no error of the whole body is known.
    """
    tolerances = ladder(1, 12) if isinstance(problem.solver.solver, dc.CondensedNewton) else [DEEP]
    samples = []
    for tol in tolerances:
        problem.load(before)
        problem.tol = tol
        found, said = attempt(problem)
        if len(tolerances) == 1:
            samples = problem.solver.samples
        elif not said:
            samples.append((problem.solver.seconds, max(found.error, found.slip_error)))
    return samples


def merged(curves: list) -> dict:
    """Smallest error so far, with the median and the spread of the seconds to it."""
    length = min(len(c) for c in curves)
    seconds = np.array([[s for s, _ in c[:length]] for c in curves])
    error = np.array([e for _, e in curves[0][:length]])
    seconds = np.maximum.accumulate(seconds, axis=1)
    kept = np.flatnonzero(error <= np.minimum.accumulate(error))
    median, least, largest = np.median(seconds, 0), seconds.min(0), seconds.max(0)
    return dict(
        seconds=median[kept].tolist(), least=least[kept].tolist(), largest=largest[kept].tolist(),
        error=error[kept].tolist(), iterations=length, repetitions=len(curves),
    )  # fmt: skip


def evaluate(results: dict) -> dict:
    return dict(rows=[dict(r, scene=name.split("/")[1].replace("_", " ")) for name, r in results.items()])  # fmt: skip


def figures(data):
    rows = data["rows"]
    figure, axes = panels(len(rows))
    for ax, row in zip(axes, rows):
        for solver, curve in row["curves"].items():
            seconds = np.array(curve["seconds"])
            lower, upper = seconds - curve["least"], np.array(curve["largest"]) - seconds
            ax.errorbar(1e3 * seconds, np.maximum(curve["error"], 1e-16), xerr=1e3 * np.abs([lower, upper]),
                elinewidth=0.4, errorevery=max(1, len(seconds) // 12), markevery=max(1, len(seconds) // 25),
                **style(solver))  # fmt: skip
        ax.axhline(TOL, color="0.6", lw=1)
        ax.set(xscale="log", yscale="log", xlabel="processor time of the step [ms]", ylabel="error")
        ax.yaxis.set_major_locator(LogLocator(numticks=8))
        ax.set_title(f"{row['scene']}: step {row['watched']}, {row['unknowns']} unknowns", fontsize=11)  # fmt: skip
    legend(figure, axes[0])
    yield (
        "precision",
        figure,
        "Error against the time of one step, set-up left out; the line is the tolerance.",
    )


def tables(data):
    yield [
        {
            "scene": row["scene"], "solver": solver, "smallest error": min(curve["error"], default=None),
            "seconds to 1e-8": min((s for s, e in zip(curve["seconds"], curve["error"]) if e <= TOL), default=None),
        }
        for row in data["rows"] for solver, curve in row["curves"].items()
    ]  # fmt: skip
