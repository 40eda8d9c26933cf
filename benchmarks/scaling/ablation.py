# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What each ingredient of ``FixedPoint`` is for: the same scenes without it.

    python -m benchmarks.scaling.ablation stress A_35451 C_35451 raise_114231

An ingredient stays if without it scenes are lost or cost more than a tenth more.  A line of JSON per ingredient and
scene goes to ``--output``; what is there already is not measured again.
"""

from __future__ import annotations

import argparse
import json
import math
from contextlib import ExitStack
from functools import partial
from itertools import product
from pathlib import Path
from unittest.mock import patch

import dolfinx_contact as dc
from benchmarks.measurement import commit, now, timed
from benchmarks.scaling.elastic_ratio import step_to
from benchmarks.stress import matrix
from benchmarks.stress.scenes import scenes
from benchmarks.tables import chosen, table
from dolfinx_contact.petsc.linear_solver import MULTIGRID_OPTIONS
from dolfinx_contact.solvers.fixed_point import fixed_point, preconditioner, rigid_balance
from dolfinx_contact.support.anderson import Anderson
from studies.punch import Parameters, Punch, programme


def plain(self, x, g):
    """One step without Anderson's mixing."""
    return x + g, float(self._total([g @ g])[0]) ** 0.5


# What is left out: options of the solver, and what is put in place of what.
INGREDIENTS = {
    "nothing": ({}, []),
    "Anderson's method": ({}, [(Anderson, "step", plain)]),
    "tangent near the plane": ({}, [(fixed_point, "EVERY", 10**9), (fixed_point, "AGAIN", ())]),
    "further attempts": ({}, [(fixed_point, "AGAIN", ())]),
    "soft motions apart": ({}, [(rigid_balance, "STIFFENED", math.inf)]),
    "motions of contacts": ({}, [(preconditioner, "patch_motions", lambda body, _: body.rigid_modes())]),
    "other rho": (dict(rho=1.0), []),
}  # fmt: skip
PUNCHES = {  # case, mesh, displacements of the top face; None: the paper's first cycle
    "A_35451": (dict(case="A", tol=1e-10), dict(divisions=16, layers=8), None),
    "C_35451": (dict(case="C", tol=1e-10), dict(divisions=16, layers=8), None),
    "C_flat_35451": (dict(case="C", tol=1e-10, lowest=0.16), dict(divisions=16, layers=8), None),
    "raise_114231": (dict(case="C", tol=1e-8), dict(divisions=24, layers=12), (0.1, 0.06)),
    "A_264435": (dict(case="A", tol=1e-10), dict(divisions=32, layers=16), None),
    "C_264435": (dict(case="C", tol=1e-10), dict(divisions=32, layers=16), None),
    "C_flat_871275": (dict(case="C", tol=1e-10, lowest=0.05), dict(divisions=48, layers=24), None),
}
TITLES = {key: key for key in ("scene", "without", "solved", "lost", "iterations")}
TITLES["seconds"] = "processor seconds"


def stress(solver, every: int):
    """Iterations and refusals on every n-th scene that has a body: name, record."""
    for scene in [scene for scene in scenes() if not scene.condensed][::every]:
        found = matrix.run(scene, solver())
        lost = found["outcome"] in ("refused", "WRONG")
        yield f"{scene.group}: {scene.name}", found["iterations"], lost


def punch(name: str, solver):
    """Iterations and refusals of the steps of the punch."""
    parameters, mesh, displacements = PUNCHES[name]
    parameters = Parameters(**parameters)
    made = Punch(parameters, solver=solver(), **mesh)
    made.problem.body.options = MULTIGRID_OPTIONS
    for displacement in displacements or programme(parameters)[:15]:
        step = step_to(made, displacement)
        yield f"{displacement:.4g} mm", step["iterations"], "failed" in step
        if "failed" in step:
            return


def without(ingredient: str, scene: str, every: int) -> dict:
    """Steps or scenes solved and refused, iterations and processor seconds."""
    options, replaced = INGREDIENTS[ingredient]
    solver = partial(dc.FixedPoint, **options)
    with ExitStack() as stack:
        for each in replaced:
            stack.enter_context(patch.object(*each))
        work = stress(solver, every) if scene == "stress" else punch(scene, solver)
        seconds, found = timed(list, work)
    lost = [name for name, _, refused in found if refused]
    return dict(
        without=ingredient, scene=scene, every=every if scene == "stress" else 1, solved=len(found) - len(lost),
        lost=lost, iterations=sum(count for _, count, _ in found), seconds=seconds, commit=commit(), date=now(),
    )  # fmt: skip


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", choices=["stress", *PUNCHES])
    parser.add_argument("--every", type=int, default=1, help="n-th scene of the stress matrix only")
    parser.add_argument("--only", nargs="*", choices=INGREDIENTS, default=list(INGREDIENTS))
    parser.add_argument("--output", type=Path, default=Path("results/ablation.jsonl"))
    options = parser.parse_args(argv)
    log = options.output
    log.parent.mkdir(parents=True, exist_ok=True)
    records = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    done = {(record["without"], record["scene"]) for record in records}
    for scene, ingredient in product(options.scenes, options.only):
        if (ingredient, scene) not in done:
            records.append(without(ingredient, scene, options.every))
            with log.open("a") as file:
                print(json.dumps(records[-1]), file=file)
            print(ingredient, scene, records[-1]["iterations"], records[-1]["lost"], flush=True)
    shown = [r | dict(lost=len(r["lost"]), seconds=f"{r['seconds']:.3g}") for r in records]
    print(table(TITLES.values(), (row.values() for row in chosen(shown, TITLES))))


if __name__ == "__main__":
    main()
