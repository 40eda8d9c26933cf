# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A hard step of the punch, and variants of the fixed point that are tried on it: for variants.py.

A variant is the present library with other constants of its modules, another metric, or other options of multigrid.
"""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import variants_table
from punch import Parameters, Punch, programme
from report_run import commit
from solvers_operator import timed

from dolfinx_contact.contact_equations import ContactEquations
from dolfinx_contact.fixed_point import EVERY, METRICS
from dolfinx_contact.linear_solver import MULTIGRID

LOADING, MOST = 5, 400  # steps before the first unloading, iterations with one metric
NEVER = {"fixed_point.EVERY": 10**9}
AT_ONCE = {"fixed_point.FALL": -1.0}  # the first tangent is not waited for


class Tally(dc.FixedPoint):
    """Counts the iterations of all steps, those that were refused, too."""

    iterations = 0

    def solve(self, *step):
        x, count = super().solve(*step)
        self.iterations += count
        return x, count


class NewtonNext(Tally):
    """Newton's method after the first iterations, from their best iterate; with ``AT_ONCE``."""

    def _accelerate(self, search, x, hasty):
        super()._accelerate(search, x, hasty)
        return search.best


class Variant(NamedTuple):
    """What is not as it is built in: constants of modules, arguments of the fixed point, options of multigrid."""

    name: str
    constants: dict = {}
    solver: dict = {}
    options: dict = {}
    kind: type = Tally

    def without_tangent(self) -> Variant:
        return self._replace(
            name=self.name + variants_table.WITHOUT, constants=self.constants | NEVER, solver=self.solver | dict(newton=False)
        )  # fmt: skip


def constants(of: dict) -> ExitStack:
    """Other constants of the library's modules for a while."""
    stack = ExitStack()
    for name, value in of.items():
        stack.enter_context(patch(f"dolfinx_contact.{name}", value))
    return stack


def along_slip(factor: float) -> dict:
    """The fixed point's metric along slip over that along the normal."""
    built_in = ContactEquations._set_metric

    def set_metric(self, map, normal, tangential=None):
        built_in(self, map, normal, factor * normal if tangential is None else tangential)

    return {"contact_equations.ContactEquations._set_metric": set_metric}


AS_IT_IS = Variant(variants_table.AS_IT_IS)
METRICS_AND_CYCLES = [
    AS_IT_IS,
    *(Variant(f"rho {rho} of the nodal stiffness", solver=dict(rho=rho)) for rho in (0.3, 3.0)),
    *(
        Variant(f"rho along slip {f} of that along the normal", along_slip(f))
        for f in (0.1, 0.3, 3.0)
    ),
    *(Variant(f"Anderson's depth {depth}", solver=dict(depth=depth)) for depth in (8, 60)),
    Variant("Chebyshev of order 3", options={"mg_levels_ksp_max_it": 3}),
    Variant("point-block Jacobi", options={"mg_levels_pc_type": "pbjacobi"}),
    Variant("threshold 0 of the aggregation", options={"pc_gamg_threshold": 0.0}),
]
TANGENTS = [
    Variant("tangent on one layer", {"surface_layer.LAYERS": 1}),
    Variant("tangent on three layers", {"surface_layer.LAYERS": 3}),
    *(Variant(f"tangent every {n} iterations", {"fixed_point.EVERY": n}) for n in (10, 12, 40)),
    Variant("dropped when the error grows by a factor of 10", {"fixed_point.GROWTH": 10.0}),
    Variant("without Newton's method", solver=dict(newton=False)),
    Variant("Newton's method from iteration 20 on", AT_ONCE, kind=NewtonNext),
]


def newton(name: str, changed: dict) -> Variant:
    """Newton's method alone, after the first iterations, with other constants of modules."""
    name = variants_table.ALONE + name
    return Variant(name, AT_ONCE | changed, dict(max_iterations=EVERY + 1), kind=NewtonNext)


NEWTON = [
    newton("law not rounded off", {"smoothing_newton.START": 0.0}),
    newton("metric 1, 1", {"contact_equations.NEWTON": (1.0, 1.0)}),
    newton("metric 10, 0.3", {"contact_equations.NEWTON": (10.0, 0.3)}),
    newton("metric 10, 0.03", {"contact_equations.NEWTON": (10.0, 0.03)}),
    newton("rounding at first as large as the error", {"smoothing_newton.START": 1.0}),
    newton("rounding at first 0.01 of the error", {"smoothing_newton.START": 0.01}),
    newton("rounding to a third at a time", {"smoothing_newton.QUICKEST": 0.3}),
    newton("systems to 0.01", {"newton_krylov.ACCURACY": 0.01}),
    newton(variants_table.AS_IT_IS, {}),
]


# On the finer mesh each takes minutes.
FINE = [
    *METRICS_AND_CYCLES[:3],
    TANGENTS[0],
    TANGENTS[5],
    AS_IT_IS.without_tangent(),
    NEWTON[0],
    NEWTON[1],
    NEWTON[-1],
]


def tried(file: Path, variants: list[Variant], **step) -> list[dict]:
    """Rows of all variants of a hard step; those that ``file`` has of this library are not measured again."""
    file.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    done, hard = {row["name"]: row for row in rows if row["commit"] == commit()}, None
    for variant in variants:
        if variant.name in done:
            continue
        hard = hard or HardStep(file.with_suffix(".npz"), **step)
        done[variant.name] = hard.row(variant)
        with file.open("a") as lines:
            print(json.dumps(done[variant.name]), file=lines)
    return [done[variant.name] for variant in variants]


class HardStep:
    """A step of case C from the loaded state, with multigrid, tried from the same history time and again.

    Args:
        history: File of the loaded state, written anew.
        displacement: At the end of the step; None takes the first unloading of the programme.
        tol: Of all steps.
        mesh: As of ``Punch``, with ``refine``.
    """

    def __init__(
        self, history: Path, displacement: float | None = None, tol: float = 1e-10, **mesh
    ):
        parameters = Parameters(case="C", tol=tol, refine=mesh.pop("refine", 0))
        self.punch = Punch(parameters, solver=dc.FixedPoint(), **mesh)
        self.problem, steps = self.punch.problem, programme(parameters)
        self.problem.body._options = MULTIGRID
        self.displacement = displacement or steps[LOADING]
        for step in steps[:LOADING]:
            self.punch.press(step)
        self._history = history
        self.problem.save(history)

    def row(self, variant: Variant) -> dict:
        """Iterations and seconds, all set-ups but the layers' apart."""
        problem = self.problem
        arguments = dict(rho=METRICS["return"][0], max_iterations=MOST) | variant.solver
        problem._free_solvers()
        problem.body.forget_solver()  # the levels of K serve stiffness and springs
        problem.body._options = MULTIGRID | variant.options
        with constants(variant.constants):
            self._press(dc.FixedPoint(**arguments | dict(max_iterations=1, newton=False)))  # set-up
            seconds, outcome = timed(self._press, variant.kind(**arguments))
        row = dict(name=variant.name, unknowns=problem.body.K.getSize()[0], seconds=seconds, commit=commit(), **outcome)  # fmt: skip
        print(row, flush=True)
        return row

    def _press(self, solver) -> dict:
        self.problem.load(self._history)
        self.problem.solver = solver
        try:
            of = self.punch.press(self.displacement)
        except dc.NotConverged as failure:
            step = failure.step
            return dict(solved=False, iterations=step.iterations, error=max(step.error, step.slip_error))  # fmt: skip
        return dict(solved=True, iterations=of["iterations"], error=of["error"], tangential=of["tangential_reaction_sum"])  # fmt: skip
