# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Variants of the fixed point, and how many solutions a step has: what docs/variants.md and docs/method.md say.

    python benchmarks/variants.py --parts springs --json docs/variants.json     # one part anew, the others stay

Counts are iterations of the fixed point and of GMRES together; seconds are processor seconds of this process, one thread.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "demos"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import agreement
import element_height
import numpy as np
import solutions
import solvers
import stress
import two_solutions
from hard_step import (
    AS_IT_IS,
    FINE,
    METRICS_AND_CYCLES,
    NEVER,
    NEWTON,
    TANGENTS,
    Variant,
    constants,
    tried,
)
from punch import Parameters, Punch, programme
from report_run import ROOT
from stress_scenes import scenes
from variants_table import claims

from dolfinx_contact.fixed_point import METRICS
from dolfinx_contact.linear_solver import MULTIGRID

KEPT = ROOT / "results" / "variants"  # a run of hard steps that is stopped continues

# -- a hard step ---------------------------------------------------------------------------------------


def unloading() -> list[dict]:
    """The first unloading, 35,451 unknowns."""
    metrics = METRICS_AND_CYCLES
    variants = [*metrics, *map(Variant.without_tangent, metrics), *TANGENTS, *NEWTON]
    return tried(KEPT / "unloading.jsonl", variants, refine=1)


def unloading_fine() -> list[dict]:
    """The same, 264,435 unknowns."""
    return tried(KEPT / "unloading-fine.jsonl", FINE, refine=2)


def raised() -> list[dict]:
    """114,231 unknowns, raised from 0.1 to 0.06 mm at once."""
    step = dict(displacement=0.06, tol=1e-8, divisions=24, layers=12)
    return tried(KEPT / "raised.jsonl", [AS_IT_IS, *TANGENTS[-2:]], **step)


# -- whole cycles --------------------------------------------------------------------------------------


def cycle(variant: Variant, case: str, options=None, **parameters) -> dict:
    """Iterations of a cycle, until a step is refused."""
    parameters = Parameters(case=case, **parameters)
    with constants(variant.constants):
        punch = Punch(parameters, solver=(solver := variant.kind(**variant.solver)))
        punch.problem.body._options = options
        row = dict(name=variant.name, case=case, unknowns=punch.problem.body.size, refused=None, steps=[])  # fmt: skip
        for displacement in programme(parameters):
            try:
                row["steps"].append(punch.press(displacement)["iterations"])
            except dc.NotConverged as failure:
                row["refused"] = max(failure.step.error, failure.step.slip_error)
                break
    return row | dict(iterations=solver.iterations)


def iterations() -> list[dict]:
    """Paper's mesh and programme, both maps, with and without the tangent."""
    maps = [Variant(map, solver=dict(map=map)) for map in METRICS]
    return [cycle(v, case) for case in "ABC" for map in maps for v in (map, map.without_tangent())]


def increments() -> list[dict]:
    """Case C in 40 + 80 increments."""
    variants = AS_IT_IS, AS_IT_IS.without_tangent()
    return [cycle(variant, "C", loading=40, unloading=80) for variant in variants]


def order() -> list[dict]:
    """Anderson's method before Newton's, and the other way round, over a cycle with 35,451 unknowns."""
    return [cycle(v, case, MULTIGRID, refine=1) for case in "AC" for v in (AS_IT_IS, TANGENTS[-1])]


# -- bodies of the stress matrix -----------------------------------------------------------------------


def bodies(variants: list[Variant], *groups: str) -> list[dict]:
    """``FixedPoint()`` alone on groups of the stress matrix; answers are judged as there."""
    rows = []
    for variant in variants:
        for scene in (scene for scene in scenes() if scene.group in groups):
            solver = variant.kind(**variant.solver)
            with constants(variant.constants):
                of = stress.run(scene, solver)
            rows.append(dict(variant=variant.name, group=scene.group, name=scene.name, outcome=of["outcome"],
                iterations=solver.iterations, error=max(of["error"], of["slip_error"])))  # fmt: skip
    return rows


def springs() -> list[dict]:
    """Soft springs, with rigid motions balanced apart and without."""
    variants = [Variant("alone", {"rigid_balance.STIFFENED": np.inf}), Variant("balanced")]
    return bodies(variants, "soft spring")


def balanced() -> list[dict]:
    """The paper's punch with all six motions balanced apart."""
    every = Variant("all six motions balanced", {"rigid_balance.STIFFENED": 1e-9})
    return [cycle(variant, case, MULTIGRID) for case in "AC" for variant in (AS_IT_IS, every)]


def rules() -> list[dict]:
    """When the next metric is tried, and when Newton's method."""
    four = {"fixed_point.METRICS": METRICS | {"return": 4 * METRICS["return"]}}
    variants = [
        AS_IT_IS,
        Variant("without Newton's method", solver=dict(newton=False)),
        Variant("Newton's method left after 200 iterations, not 600", {"smoothing_newton.MOST": 200}),
        Variant("100 iterations a metric, the list four times over", four, dict(max_iterations=100)),
        Variant("the first metric alone, 1200 iterations", solver=dict(rho=METRICS["return"][0], max_iterations=1200)),
        Variant("without tangent and Newton's method", NEVER, dict(newton=False)),
    ]  # fmt: skip
    return bodies(variants, "p ratio", "nearly incompressible")


# -- solutions -----------------------------------------------------------------------------------------


def agree() -> list[dict]:
    """Fixed point and Newton's method over a cycle."""
    return [
        dict(case=case, preconditioner=name, nodal=nodal, totals=totals)
        for case in "ABC" for name, (nodal, totals) in agreement.differences(case, 1e-10).items()
    ]  # fmt: skip


PARTS = {
    "iterations": iterations,
    "increments": increments,
    "agreement": agree,
    "unloading": unloading,
    "springs": springs,
    "balanced": balanced,
    "rules": rules,
    "two": two_solutions.both,
    "block": lambda: solutions.examine(*solutions.block(), starts=[0, 200]),
    "coarse": lambda: solutions.examine(*solutions.punch("crossed", -1), starts=[20] * 15),
    "paper": lambda: solutions.examine(*solutions.punch("C", 0), starts=[10] + [0] * 4 + [8] * 3 + [4] * 7),
    "order": order,
    "raised": raised,
    "unloading-fine": unloading_fine,
    "height": element_height.rows,
}  # fmt: skip

if __name__ == "__main__":
    solvers.main(parts=PARTS, claims=claims, description=__doc__)
