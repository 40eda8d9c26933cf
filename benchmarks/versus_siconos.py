# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The condensed problems of the paper's punch, solved here and by Siconos; processor seconds.

    python benchmarks/versus_siconos.py problems.npz           # makes the problems and solves them here
    python3 benchmarks/versus_siconos.py problems.npz NSN_AC   # with Siconos, by one of its fc3d solvers

Both get the same problems and starts (the step before).  Siconos solves the isotropic law alone: it
gets the scaled problem, in which every law is the isotropic one with unit friction.
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import process_time

import numpy as np

TOL = 1e-10
LAWS = {
    "A": ((0.2, 0.2), (0.2, 0.2)),
    "B": ((0.3, 0.15), (0.3, 0.15)),
    "C": ((0.3, 0.15), (0.05, 0.2)),
}


def report(case, name, seconds, converged, difference=0.0):
    t = 1e3 * np.array(seconds)
    print(
        f"{case} {name}: median {np.median(t):.0f} ms, {t.min():.0f} to {t.max():.0f}, {converged} of "
        f"{len(t)} converged, largest difference of reactions {difference:.1e}",
        flush=True,
    )


def ours(file):
    """Make the problems by one cycle of each case, write them, and solve them once more."""
    import dolfinx_contact as dc
    from dolfinx_contact import _kernel

    sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "demos"))
    from punch import Parameters, Punch, programme

    problems = {}
    for case in LAWS:
        punch = Punch(Parameters(case=case))
        punch.problem.solver = dc.CondensedNewton()
        for displacement in programme(punch.parameters):
            punch.press(displacement)
        q, r = (np.array(part) for part in zip(*punch.problem._past))
        problems |= {f"{case}q": q, f"{case}r": r}
        if case == "A":
            problems["W"] = punch.problem._condensed.compliance()
    np.savez(file, **problems)
    operator = _kernel.CondensedOperator(problems["W"], 3)
    start = process_time()
    operator.prepare()
    print(f"inverse of W, once: {process_time() - start:.2f} s")
    solver = dc.CondensedNewton()
    for case, law in LAWS.items():
        q, r, seconds = problems[f"{case}q"], problems[f"{case}r"], []
        for k in range(len(q)):
            start = process_time()
            solver.solve_condensed(operator, dc.Friction(*law), q[k], TOL, r[k - 1 : k])
            seconds.append(process_time() - start)
        report(case, "CondensedNewton", seconds, len(q))


def siconos(file, name):
    import siconos.numerics as sn

    problems = np.load(file)
    W = problems["W"]
    n = len(W) // 3
    order = np.arange(3 * n).reshape(n, 3)[:, [2, 0, 1]].ravel()
    for case, (mu, p) in LAWS.items():
        mu, p = np.array(mu), np.array(p) / np.max(np.divide(p, mu))
        S, T = np.tile([*mu, 1.0], n), np.tile([*(p**2 / mu), 1.0], n)
        q, r = (problems[case + part].reshape(-1, 3 * n) for part in "qr")
        length = np.abs(q).max()
        S *= length / np.diag(W)[2::3].mean()
        T /= length
        M = np.asfortranarray((T[:, None] * W * S)[np.ix_(order, order)])
        problem = sn.FrictionContactProblem(3, M, np.zeros(3 * n), np.ones(n))
        seconds, converged, difference = [], 0, 0.0
        for k in range(len(q)):
            problem.q = (T * q[k])[order].copy()
            found = (r[k - 1] / S)[order].copy() if k else np.zeros(3 * n)
            options = sn.SolverOptions(getattr(sn, f"SICONOS_FRICTION_3D_{name}"))
            options.dparam[0], options.iparam[0] = TOL, 20_000
            start = process_time()
            converged += sn.fc3d_driver(problem, found, np.zeros(3 * n), options) == 0
            seconds.append(process_time() - start)
            back = np.empty(3 * n)
            back[order] = found
            difference = max(difference, np.abs(back * S - r[k]).max() / np.abs(r[k]).max())
        report(case, f"Siconos {name}", seconds, converged, difference)


if __name__ == "__main__":
    siconos(*sys.argv[1:]) if len(sys.argv) > 2 else ours(sys.argv[1])
