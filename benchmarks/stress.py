# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The stress matrix: every scene times every solver, every answer judged by the NumPy twin.

A run that is stopped continues where it was; ``--output`` then holds one line per scene and solver.
At the end: a table, ``stress.json``, ``stress.csv`` and ``stress.png``; ``stress-small`` with ``--small``.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections import Counter
from pathlib import Path
from time import perf_counter

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from report_run import commit, now
from stress_scenes import Scene, build, scenes, small
from stress_table import summary

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
import twin_solver
from condensed_scenes import direction_of_slip, judge, random_problem

TOL = 1e-8
WRONG = 3 * TOL  # the twin's own rounding, and |du| against |du + |du| d| at the edge of the cone
SOLVERS = {
    "default": lambda: None,
    "condensed": lambda: dc.CondensedNewton(max_seconds=30),
    "fixed point": dc.FixedPoint,
}


class Twin:
    """Judges the steps of a scene from displacement and reactions, with its own dense stiffness."""

    def __init__(self, scene):
        self.scene, contact = scene, scene.contact
        derivative = ufl.derivative(scene.F, scene.u, ufl.TrialFunction(scene.V))
        matrix = dolfinx.fem.petsc.assemble_matrix(fem.form(derivative))
        matrix.assemble()
        self.K = matrix[:, :]
        self.residual = fem.form(scene.F)
        fixed = [bc.dof_indices()[0] for bc in scene.bcs] or [np.zeros(0, int)]
        self.free = np.setdiff1d(np.arange(self.K.shape[0]), np.concatenate(fixed))
        self.factor = np.linalg.inv(self.K[np.ix_(self.free, self.free)])
        self.frame = np.array(contact.frame)
        x = scene.V.tabulate_dof_coordinates()
        self.gap0 = x @ self.frame[2]
        self.nodes = np.flatnonzero(np.abs(self.gap0) <= 1e-9 * np.abs(x).max())
        n = self.frame[2]
        self.kappa = np.array(
            [n @ self.K[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] @ n for i in self.nodes]
        )
        self.before = np.zeros((self.nodes.size, 3))
        self.reaction = np.zeros((self.nodes.size, 3))

    def errors(self) -> tuple[float, float]:
        """Error and slip error of the last step, from definitions written anew."""
        u, contact, frame = self.scene.u, self.scene.contact, self.frame
        order = [int(np.flatnonzero(contact.nodes == i)[0]) for i in self.nodes]
        r, friction = contact.reaction[order], contact.friction
        values = u.x.array.copy()
        forces = np.zeros((len(values) // 3, 3))
        forces[self.nodes] = r @ frame
        unbalanced = fem.assemble_vector(self.residual)
        unbalanced = np.array(getattr(unbalanced, "array", unbalanced)) - forces.ravel()
        # The state without reactions: the same, less what the reactions move.
        trial = values.copy()
        trial[self.free] -= self.factor @ (forces.ravel() + unbalanced)[self.free]
        local, free = ((v.reshape(-1, 3)[self.nodes] @ frame.T) for v in (values, trial))
        gap, slip = self.gap0[self.nodes] + local[:, 2], (local - self.before)[:, :2]
        free_gap, free_slip = self.gap0[self.nodes] + free[:, 2], (free - self.before)[:, :2]
        pressed = np.linalg.norm(self.kappa * np.maximum(-free_gap, 0))
        # A soft spring's force is an external force of the body as DOLFINx assembles it.
        u.x.array[:] = 0.0
        external = np.array(getattr(v := fem.assemble_vector(self.residual), "array", v))[self.free]
        u.x.array[:] = values
        load = max(pressed, np.linalg.norm(self.reaction), np.linalg.norm(external))
        length = max(np.abs(free_slip).max(), np.maximum(-free_gap, 0).max())
        self.before, self.reaction = local, r
        if not r.any() and (gap >= -1e-12 * np.abs(values).max()).all():
            return np.linalg.norm(unbalanced[self.free]) / max(load, 1e-300) if load else 0.0, 0.0
        mu = friction.mu if not friction.frictionless else np.full(2, 1e-30)
        p = friction.p if not friction.frictionless else mu
        error = twin_solver.error(
            self.kappa, mu, p, r, gap, slip, unbalanced[self.free], load
        )  # fmt: skip
        defect = 0.0
        for ri, du in zip(r, slip) if not friction.frictionless else ():
            if ri[2] == 0:
                continue
            inside = np.linalg.norm(ri[:2] / mu) < ri[2] * (1 - 1e-12)
            against = np.zeros(2) if inside or not ri[:2].any() else direction_of_slip(ri[:2], p)
            rest = np.linalg.norm(du + np.linalg.norm(du) * against)
            defect = max(defect, min(rest, np.linalg.norm(du)))
        return error, defect / length if length else 0.0


def run(scene: Scene, solver) -> dict:
    """One scene with one solver: outcome, worst judged errors, iterations, seconds."""
    start = perf_counter()
    record = dict(outcome="solved", error=0.0, slip_error=0.0, steps=0, iterations=0, slowest=0.0)
    used = Counter()
    try:
        if scene.seed is not None:
            random = random_problem(scene.seed)
            friction = dc.Friction(random.mu, random.p)
            found = dc.solve_condensed(random.W, random.q, friction, solver, TOL, max_seconds=30)
            errors = judge(random.W, random.q, random.mu, random.p, found.reaction)
            record.update(error=float(errors[0]), slip_error=float(errors[1]), steps=1)
            record.update(iterations=found.iterations, slowest=found.seconds)
            used[found.branch] += 1
        else:
            built = build(**scene.body)
            twin = Twin(built)
            problem = dc.ContactProblem(
                built.F, built.u, [built.contact], bcs=built.bcs, solver=solver, tol=TOL
            )
            for top in scene.tops:
                built.move_top(top)
                step = problem.solve()
                errors = twin.errors()
                record["steps"] += 1
                record["iterations"] += step.iterations
                record["error"] = max(record["error"], errors[0])
                record["slip_error"] = max(record["slip_error"], errors[1])
                record["slowest"] = max(record["slowest"], step.seconds)
                used[step.tried[-1].branch if step.tried else step.solver.split()[0]] += 1
        if not max(record["error"], record["slip_error"]) <= WRONG:
            record["outcome"] = "WRONG"
    except (dc.NotConverged, dc.CondensedNotConverged, dc.LinearSolverError, ValueError) as said:
        record.update(outcome="refused", said=f"{type(said).__name__}: {str(said)[:200]}")
    record.update(seconds=perf_counter() - start, methods=dict(used))
    return record


def pairs(chosen: list[Scene], solvers=SOLVERS) -> list[tuple[Scene, str]]:
    """Scenes and the solvers that they are given to: on plain arrays there is one."""
    return [
        (scene, solver)
        for scene in chosen
        for solver in solvers
        if scene.seed is None or solver == "default"
    ]


def draw(records: list[dict], file: Path) -> None:
    """Judged error against seconds per step, by outcome and solver."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    for marker, solver in zip("os^", SOLVERS):
        of = [r for r in records if r["solver"] == solver and r["steps"]]
        x = [r["seconds"] / r["steps"] for r in of]
        y = [max(r["error"], r["slip_error"], 1e-17) for r in of]
        axes.plot(x, y, marker, ms=4, alpha=0.5, label=solver)
    axes.axhline(TOL, color="0.5", lw=1)
    axes.set(xscale="log", yscale="log", xlabel="seconds per step, with set-up and judge")
    axes.set(ylabel="worst error found by the judge")
    axes.legend()
    figure.savefig(file, dpi=150)
    plt.close(figure)


def main(argv=None) -> list[dict]:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("results/stress"))
    parser.add_argument("--every", type=int, default=1, help="run every n-th scene only")
    parser.add_argument("--first", type=int, default=0, help="start with this scene")
    parser.add_argument("--solver", choices=SOLVERS, help="this solver only")
    parser.add_argument("--small", action="store_true", help="the same scenes on small bodies")
    options = parser.parse_args(argv)
    options.output.mkdir(parents=True, exist_ok=True)
    name = "stress-small" if options.small else "stress"
    log = options.output / f"{name}.jsonl"
    records = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    done = {(r["group"], r["name"], r["solver"]) for r in records}
    chosen = scenes()[options.first :: options.every]
    if options.small:
        chosen = list(map(small, chosen))
    todo = [
        (scene, solver)
        for scene, solver in pairs(chosen, [options.solver] if options.solver else SOLVERS)
        if (scene.group, scene.name, solver) not in done
    ]
    measured = f"{now()[:10]}, {commit()}"
    with log.open("a") as file:
        for k, (scene, solver) in enumerate(todo, start=1):
            outcome = run(scene, SOLVERS[solver]())
            record = dict(group=scene.group, name=scene.name, solver=solver, measured=measured, **outcome)  # fmt: skip
            records.append(record)
            print(json.dumps(record), file=file, flush=True)
            print(
                f"{k}/{len(todo)} {record['outcome']:8} {record['seconds']:6.2f} s  "
                f"{scene.group}: {scene.name} ({solver})",
                flush=True,
            )
    (options.output / f"{name}.json").write_text(json.dumps(records, indent=1))
    with (options.output / f"{name}.csv").open("w", newline="") as file:
        columns = list(dict.fromkeys(key for record in records for key in record))
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(records)
    draw(records, options.output / f"{name}.png")
    print(summary(records))
    for record in records:
        if record["outcome"] != "solved":
            print(record["outcome"], record["solver"], record["group"], record["name"],
                  record.get("said", ""), record["error"], record["slip_error"])  # fmt: skip
    return records


if __name__ == "__main__":
    main()
