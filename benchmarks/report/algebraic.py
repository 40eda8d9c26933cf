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
from matplotlib.ticker import LogLocator, MaxNLocator

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
TOL = 1e-8  # of the programmes
DEEP = 1e-12  # where the curves end


def plan(size: str) -> list[Measurement]:
    mesh = dict(full={}, quick={}, smallest=dict(divisions=2, layers=2))[size]
    repeat = dict(full=3, quick=2, smallest=2)[size]
    scenes = [*CASES, *EXTREMES] if size != "smallest" else ["C"]
    scenes = [name for name in scenes if name in "ABC" or name in EXTREMES]
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
    """One programme with every solver, then one of its steps again and again, interleaved."""
    runs = {label: programme_of(name, make(), mesh) for label, make in SOLVERS.items()}
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
        runs=runs, curves={label: merged(found) for label, found in curves.items()},
    )  # fmt: skip


def programme_of(name: str, solver, mesh: dict) -> dict:
    """Processor seconds of every step from scratch; the first one holds the set-up."""
    problem, move, steps = opened(name, solver, TOL, mesh)
    seconds, iterations, errors, said = [], [], [], ""
    for step in steps:
        move(step)
        start = process_time()
        found, said = attempt(problem)
        seconds.append(process_time() - start)
        iterations.append(found.iterations)
        errors.append(max(found.error, found.slip_error))
        if said:
            break
    # The first step once more: what it takes without the set-up.
    problem.reset()
    move(steps[0])
    start = process_time()
    attempt(problem)
    setup = seconds[0] - (process_time() - start)
    return dict(
        seconds=seconds, setup=max(setup, 0.0), iterations=iterations, error=max(errors),
        steps=len(steps), said=said,
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

    figure, axes = panels(len(rows))
    for ax, row in zip(axes, rows):
        for solver, run in row["runs"].items():
            steps = len(run["seconds"])
            ax.plot(np.arange(1, steps + 1), np.cumsum(run["seconds"]), **style(solver))
            if run["said"]:
                ax.plot(steps, sum(run["seconds"]), "x", color="black", ms=12, mew=2)
        ax.set(yscale="log", xlabel="steps", ylabel="processor seconds so far")
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set_title(row["scene"], fontsize=11)
    legend(figure, axes[0])
    yield (
        "setup",
        figure,
        "Time of a programme with all set-up, step by step; a cross is a step that was refused.",
    )


def tables(data):
    rows = []
    for row in data["rows"]:
        for solver, run in row["runs"].items():
            curve, later = row["curves"][solver], run["seconds"][1:] or [None]
            reached = [s for s, e in zip(curve["seconds"], curve["error"]) if e <= TOL]
            rows.append({
                "scene": row["scene"], "solver": solver, "to 1e-8 [s]": min(reached, default=None), "set-up [s]": run["setup"],
                "median step [s]": sorted(later)[len(later) // 2], "programme [s]": sum(run["seconds"]),
                "iterations": sum(run["iterations"]), "worst error": run["error"], "refused": run["said"][:60],
            })  # fmt: skip
    yield rows
