# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""How far the results of the fixed point are from those of Newton's method over a cycle of the punch.

Each solver goes through its own history. Differences are relative to the largest nodal reaction, and to the
largest total, of the cycle so far.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "demos"))
import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from punch import Parameters, Punch, programme

from dolfinx_contact.linear_solver import DIRECT, MULTIGRID

PRECONDITIONERS = {"factorisation": DIRECT, "multigrid": MULTIGRID}


def differences(case: str, tol: float, refine: int = 0) -> dict[str, tuple[float, float]]:
    """Largest difference of nodal reactions and of totals (force, sum of tangential norms) by preconditioner."""
    parameters = Parameters(case=case, refine=refine, tol=tol)
    newton = Punch(parameters, solver=dc.CondensedNewton())
    others = {name: Punch(parameters, solver=dc.FixedPoint()) for name in PRECONDITIONERS}
    for name, punch in others.items():
        punch.problem.body._options = PRECONDITIONERS[name]
    largest, worst = np.zeros(2), {name: np.zeros(2) for name in others}
    for displacement in programme(parameters):
        expected = _results(newton, displacement)
        largest = np.maximum(largest, [np.abs(part).max() for part in expected])
        for name, punch in others.items():
            found = _results(punch, displacement)
            apart = [np.abs(a - b).max() for a, b in zip(found, expected)]
            worst[name] = np.maximum(worst[name], apart / largest)
    return {name: tuple(map(float, pair)) for name, pair in worst.items()}


def _results(punch, displacement) -> tuple[np.ndarray, np.ndarray]:
    """Nodal reactions and totals after a step."""
    punch.press(displacement)
    r = punch.contact.reaction
    return r, np.append(r.sum(axis=0), np.linalg.norm(r[:, :2], axis=1).sum())


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--refine", type=int, default=0)
    parser.add_argument("--tol", type=float, nargs="*", default=[1e-10, 1e-11, 1e-12])
    options = parser.parse_args(argv)
    for case in "ABC":
        for tol in options.tol:
            for name, (nodal, totals) in differences(case, tol, options.refine).items():
                print(f"| {case} | {tol:.0e} | {name} | {nodal:.1e} | {totals:.1e} |", flush=True)


if __name__ == "__main__":
    main()
