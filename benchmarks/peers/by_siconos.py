# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The condensed problems of the paper's punch, solved here and by Siconos; processor seconds.

    python -m benchmarks.peers.by_siconos problems.npz make      # the problems: W, and q of each step
    python -m benchmarks.peers.by_siconos problems.npz ours      # solved by CondensedNewton
    python -m benchmarks.peers.by_siconos problems.npz NSN_AC   # with Siconos, by one of its fc3d solvers

Both get the same problems and starts (the step before).  Siconos solves the isotropic law alone: it
gets the scaled problem, in which every law is the isotropic one with unit friction.  The answers go to
problems.<solver>.npz, with the error that the solver itself reports.
"""

from __future__ import annotations

import sys
from time import process_time

import numpy as np

TOL = 1e-10
LAWS = {
    "A": ((0.2, 0.2), (0.2, 0.2)),
    "B": ((0.3, 0.15), (0.3, 0.15)),
    "C": ((0.3, 0.15), (0.05, 0.2)),
}


def make(file):
    """One cycle of each case; its condensed problems with their solutions, ``q`` and ``r`` (steps, nodes, 3)."""
    import dolfinx_contact as dc
    from studies.punch import Parameters, Punch, programme

    problems = {}
    for case in LAWS:
        punch = Punch(Parameters(case=case))
        punch.problem.solver = dc.CondensedNewton()
        for displacement in programme(punch.parameters):
            punch.press(displacement)
        q, r, _ = zip(*punch.problem.bound().past)
        q, r = (np.reshape(part, (len(part), -1, 3)) for part in (q, r))
        problems |= {f"{case}q": q, f"{case}r": r}
        if case == "A":
            problems["W"] = punch.problem.bound().compliance()
    np.savez(file, **problems)


def ours(file, name="ours"):
    """All problems by CondensedNewton."""
    import dolfinx_contact as dc
    from dolfinx_contact import _kernel

    problems = np.load(file)
    operator = _kernel.CondensedOperator(problems["W"], 3)
    operator.prepare()
    solver, answers = dc.CondensedNewton(), {}
    for case, law in LAWS.items():
        q, r = problems[f"{case}q"], problems[f"{case}r"]
        found = []
        for k in range(len(q)):
            start = process_time()
            answer = solver.solve_condensed(operator, dc.Friction(*law), q[k], TOL, r[k - 1 : k])
            seconds = process_time() - start
            found.append((answer.reaction, seconds, max(answer.error, answer.slip_error), True))
        answers |= kept(case, found)
    np.savez(file.removesuffix("npz") + name, **answers)


def siconos(file, name):
    """All problems by Siconos, scaled as the module's text says."""
    import siconos.numerics as sn

    problems = np.load(file)
    W = problems["W"]
    n = len(W) // 3
    order = np.arange(3 * n).reshape(n, 3)[:, [2, 0, 1]].ravel()
    answers = {}
    for case, (mu, p) in LAWS.items():
        mu, p = np.array(mu), np.array(p) / np.max(np.divide(p, mu))
        S, T = np.tile([*mu, 1.0], n), np.tile([*(p**2 / mu), 1.0], n)
        q, r = (problems[case + part].reshape(-1, 3 * n) for part in "qr")
        length = np.abs(q).max()
        S *= length / np.diag(W)[2::3].mean()
        T /= length
        M = np.asfortranarray((T[:, None] * W * S)[np.ix_(order, order)])
        problem = sn.FrictionContactProblem(3, M, np.zeros(3 * n), np.ones(n))
        found = []
        for k in range(len(q)):
            problem.q = (T * q[k])[order].copy()
            reaction = (r[k - 1] / S)[order].copy() if k else np.zeros(3 * n)
            options = sn.SolverOptions(getattr(sn, f"SICONOS_FRICTION_3D_{name}"))
            options.dparam[0], options.iparam[0] = TOL, 20_000
            start = process_time()
            converged = sn.fc3d_driver(problem, reaction, np.zeros(3 * n), options) == 0
            seconds = process_time() - start
            back = np.empty(3 * n)
            back[order] = reaction
            own = options.dparam[sn.SICONOS_DPARAM_RESIDU]
            found.append(((back * S).reshape(n, 3), seconds, own, converged))
        answers |= kept(case, found)
    np.savez(file.removesuffix("npz") + name, **answers)


def kept(case, found) -> dict:
    """Arrays of one case by name; prints what it took."""
    columns = ("reaction", "seconds", "own", "converged")
    arrays = {f"{case}{name}": np.array(column) for name, column in zip(columns, zip(*found))}
    t = 1e3 * arrays[f"{case}seconds"]
    print(
        f"{case}: median {np.median(t):.0f} ms, {t.min():.0f} to {t.max():.0f}, {arrays[case + 'converged'].sum()} of "
        f"{len(t)} converged, largest error that the solver reports {arrays[case + 'own'].max():.1e}",
        flush=True,
    )
    return arrays


if __name__ == "__main__":
    file, what = sys.argv[1:]
    make(file) if what == "make" else (ours if what.startswith("ours") else siconos)(file, what)
